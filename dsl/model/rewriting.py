"""The expressions of a network's statements, collected and replaced."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.network import Network

EXPRESSIONS = {
    "energies": ("expression",),
    "works": ("effort", "on"),
    "constraints": ("expression",),
    "dynamics": ("expression",),
    "initials": ("target", "value"),
    "observations": ("expression",),
    "speeds": ("expression",),
    "expectations": ("left", "right", "within"),
    "branches": ("law", "on", "energy"),
    "couplings": ("ratio",),
}
"""Of each sort of statement the fields that hold what it says."""
TRACED = ("observations", "speeds", "expectations")
"""What reads the motion and leaves it as it is."""


def expressions(said: Any, *sorts: str) -> list[Node]:
    """What statements of these sorts say, or one field of them (`works.on`); said: a Network, or the parts of one."""
    found = []
    for sort in sorts:
        name, _, one = sort.partition(".")
        for field in (one,) if one else EXPRESSIONS[name]:
            found += [getattr(statement, field) for statement in getattr(said, name)]
    return [node for node in found if node is not None]


def rewritten(network: Network, change: Callable[[Node], Node], sorts: Iterable[str] = EXPRESSIONS) -> Network:
    """The network with every expression of these statements changed."""

    def new(statement: Any, fields: tuple[str, ...]) -> Any:
        old = {field: getattr(statement, field) for field in fields}
        return replace(statement, **{field: change(node) for field, node in old.items() if node is not None})

    changed: dict[str, Any] = {s: tuple(new(x, EXPRESSIONS[s]) for x in getattr(network, s)) for s in sorts}
    return replace(network, **changed)


def nodes_read(said: Any) -> frozenset[str]:
    """Common-effort nodes whose effort a statement (not a trace) reads; said: a Network, or the parts of one."""
    roots = expressions(said, "energies", "constraints", "works", "dynamics", "branches.law", "couplings")
    return frozenset(n.data[0] for n in topological(roots) if n.op == "var" and n.data[1] == "ne")
