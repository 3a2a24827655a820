"""The letters of unknowns and parameters: q, f, p, e of the family, kappa and mu numbered as in the book.

A coordinate q1 has the flow f1 and the momentum p1; any other, x, has f_x and p_x; what the compiler chose as a
coordinate (the branch `coil`) is q_coil.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.mirror import letter, spelled
from sysdyn.dsl.model.expression import Node
from sysdyn.values import dataclass

GREEK = (
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "omicron", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega",
)  # fmt: skip
SHORT = {"th": "theta", "om": "omega"}
_NAME = re.compile(rf"({'|'.join(sorted([*GREEK, *SHORT], key=len, reverse=True))}|[^\W\d_])(?:_(\w+)|(\d+))?")
_NUMBERED = re.compile(r"[qp](\d+)")


@dataclass(frozen=True, slots=True)
class Letter:
    """A symbol: its base, what stands below it, dots above."""

    base: str
    below: tuple[str, ...]
    dots: int


class Letters:
    """Of one formulation of a model; named: coordinates that the text declares."""

    def __init__(self, form: DescriptorForm, named: Sequence[str]) -> None:
        self._formulation = form.formulation
        self._named = frozenset(named)
        self._speeds = frozenset(f.owner for f in form.families if form.is_speed(f))
        self._numbers: dict[tuple[str, str], int] = {}
        for kind in ("kappa", "mu"):
            owners = [f.owner for f in form.families if f.kind == kind]
            self._numbers |= {(owner, kind): k for k, owner in enumerate(owners, 1)}

    def unknown(self, node: Node) -> Letter:
        """The symbol of an unknown without its indices."""
        owner, kind, order = node.data
        if (owner, kind) in self._numbers:
            return Letter(kind, (str(self._numbers[owner, kind]),), order)
        if kind in ("q", "f", "p"):
            return self._of_coordinate(owner, kind, order)
        return self.name(spelled(self._formulation, owner, kind), order)

    def _of_coordinate(self, owner: str, kind: str, order: int) -> Letter:
        own = letter(self._formulation, kind)
        if kind == "f" and owner in self._speeds:
            path, _, own = owner.rpartition(".")
            return Letter(path, (own,), order) if path == "u" else self.name(owner, order)
        if kind == "q" and owner in self._named:
            return self.name(owner, order)
        numbered = _NUMBERED.fullmatch(owner)
        return Letter(own, (numbered[1],) if numbered else tuple(owner.split("#")), order)

    def name(self, text: str, order: int = 0) -> Letter:
        """A parameter, a dynamic variable, an implicit effort: a letter with an index where the name is one."""
        return named(text, order)

    def legend(self, form: DescriptorForm) -> list[tuple[str, int, str, int]]:
        """(kind, number, constraint, line) of each multiplier."""
        found = []
        for family in form.families:
            if (family.owner, family.kind) in self._numbers:
                line = family.place.start[0] if family.place else 0
                found.append((family.kind, self._numbers[family.owner, family.kind], family.owner, line))
        return found


def named(text: str, order: int = 0) -> Letter:
    """A name as a letter with an index where it is one."""
    if text.startswith("#offset "):  # the constant of an integrated constraint
        return Letter("c", (text.removeprefix("#offset "),), order)
    *path, own = text.lstrip("#").split(".")
    found = _NAME.fullmatch(own)
    if found is None:
        return Letter(own, tuple(path), order)
    below = found[2] or found[3]
    return Letter(found[1], (*((below,) if below else ()), *(part for part in path if part)), order)


def is_letter(text: str) -> bool:
    """Whether a name is a letter, with an index or without."""
    return _NAME.fullmatch(text) is not None
