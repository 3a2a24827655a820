"""Which family of Paynter's diagram a formulation is written in: the names that the mirror exchanges.

Reflecting the diagram exchanges effort and flow, momentum and displacement, T* and V*, T and V, D and G; every arrow
that lowers energies takes these names from a `Mirror` and so exists once.
"""

from __future__ import annotations

import re

from sysdyn.dsl.model.expression import Node, ordered_variables, substitute, var
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Mirror:
    """Kinds of unknowns and names of state functions of one family."""

    coordinate: str  # kind of the configuration coordinate: q (p)
    rate: str  # kind of its time derivative: f (e)
    conjugate: str  # kind of what the Legendre transformation introduces: p (q)
    coenergy: str  # function of the rate: T* (V*)
    energy: str  # function of the conjugate: T (V)
    potential: str  # function of the coordinate: V (T)
    content: str  # power function of the rate: D (G)


PRIMAL = Mirror("q", "f", "p", "T*", "T", "V", "D")
COMPLEMENTARY = Mirror("p", "e", "q", "V*", "V", "T", "G")

_REFLECTED = {"q": "p", "f": "e", "p": "q", "e": "f"}
"""Letters of the complementary family for those of the reflection that it is lowered from."""


def letter(formulation: str, kind: str) -> str:
    """The kind of an unknown in the letters of its family: the q of co_lagrangian is a momentum p."""
    return _REFLECTED.get(kind, kind) if formulation.startswith("co_") else kind


_FUNCTIONS = {"T*": "V*", "T": "V", "V": "T", "V*": "T*", "D": "G", "G": "D"}
"""Names of state functions of the complementary family for those of the reflection."""


def function_name(formulation: str, name: str) -> str:
    """The name of a state function in its family: the T* of co_lagrangian's reflection is V*."""
    return _FUNCTIONS.get(name, name) if formulation.startswith("co_") else name


def family_name(formulation: str, name: str, kind: str) -> str:
    """A name with its family's letter: x.p of the reflection is x.q, law.e law.f."""
    own = formulation.startswith("co_") and kind in ("p", "e") and name.endswith(f".{kind}")
    return f"{name[:-2]}.{_REFLECTED[kind]}" if own else name


def with_family_letters(formulation: str, root: Node) -> Node:
    """An expression for a reader: conjugates and implicit unknowns by their family's letter."""
    if not formulation.startswith("co_"):
        return root
    change = {}
    for node in ordered_variables(root):
        if node.op == "var" and node.data[1] in ("p", "e"):
            owner, kind, order = node.data
            shown = var(owner, "bq", *node.args, order=order) if kind == "p" else None
            change[node] = shown or var(family_name(formulation, owner, kind), kind, *node.args, order=order)
    return substitute(root, change) if change else root


def word(formulation: str, name: str) -> str:
    """The name of a block or of a kind of rows in the words of its family: momentum is displacement there."""
    return name.replace("momentum", "displacement") if formulation.startswith("co_") else name


def refusal(formulation: str, text: str) -> str:
    """What an arrow says of itself, in the names of the family that it lowers."""
    if not formulation.startswith("co_"):
        return text
    return re.sub(r"\b(lagrangian|hamiltonian|kane)\b", r"co_\1", text)
