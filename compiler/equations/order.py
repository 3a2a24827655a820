"""The order in which a book writes the factors of a term."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.model.expression import Node, variables

RANKS = ("q", "s", "e", "p", "f")
"""Kinds of unknowns in the order in which the factors of a term are written; rates follow, then multipliers."""


class FactorOrder:
    """How the factors of a term follow each other; parameters: their names as declared."""

    def __init__(self, parameters: Sequence[str] = ()) -> None:
        self._declared = {name: k for k, name in enumerate(parameters)}

    def rank(self, node: Node) -> tuple[int, int]:
        """The place of a factor: numbers, sums of parameters, parameters, functions, unknowns, rates, multipliers."""
        # numbers, parameters in the order of their declaration, time and indices
        if node.op == "const":
            return 0, 0
        if node.op == "param":
            return 2, self._declared.get(node.data, len(self._declared))
        if node.op in ("time", "index"):
            return 3, node.number
        if node.op != "var":
            return (4 if variables(node) else 1), node.number
        # unknowns, their rates, multipliers
        _, kind, order = node.data
        if order:
            return 10, node.number
        return (11 if kind in ("kappa", "mu") else 5 + RANKS.index(kind) if kind in RANKS else 5), node.number
