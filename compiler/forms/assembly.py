"""Collects local expressions for the rows of a descriptor form and merges those of one loop nest into one kernel.

Contributions to one row under one nest add up to one expression; loop-less ones make one kernel a block.
"""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.compiler.forms.descriptor import BLOCKS, HOME, Block, EquationFamily, LoopKernel, Summand
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.calculus import without_signals
from sysdyn.dsl.model.expression import Node, add, is_const
from sysdyn.dsl.model.network import Loop, loop_ranges

_Bounds = tuple[tuple[Node, Node], ...]
_Place = tuple[int, tuple[Node, ...]]


class Assembly:
    """Row families by number, and what is added to them block by block."""

    def __init__(self) -> None:
        self.rows: list[EquationFamily] = []
        self._numbers: dict[tuple[str, str], int] = {}
        self._found: dict[str, dict[_Bounds, dict[_Place, list[Node]]]] = {name: {} for name in BLOCKS}

    def family(self, equations: EquationFamily) -> None:
        """Declare a row family; its key is (block, owner)."""
        self._numbers[equations.block, equations.owner] = len(self.rows)
        self.rows.append(equations)

    def add(self, block: str, owner: str, at: Sequence[Node], nest: Nest, expression: Node) -> None:
        """Add an expression to the rows of `owner` in a block, for all iterations of the nest."""
        expression = without_signals(expression)
        if is_const(expression, 0.0):
            return
        key = (self._numbers[HOME.get(block, block), owner], tuple(at))
        bounds = loop_ranges(nest)
        self._found[block].setdefault(bounds, {}).setdefault(key, []).append(expression)

    def blocks(self) -> tuple[Block, ...]:
        """All blocks that have rows, in the order of the contract."""
        found = []
        for name in BLOCKS:
            kernels = [_kernel(bounds, places) for bounds, places in self._found[name].items()]
            kept = tuple(k for k in kernels if k.rows)
            if kept:
                found.append(Block(name, kept))
        return tuple(found)


def _kernel(bounds: _Bounds, places: dict[_Place, list[Node]]) -> LoopKernel:
    nest = tuple(Loop(f"#{k}", first, last) for k, (first, last) in enumerate(bounds))
    summands = (Summand(row, at, add(*nodes)) for (row, at), nodes in sorted(places.items(), key=_order))
    return LoopKernel(nest, tuple(s for s in summands if not is_const(s.expression, 0.0)))


def _order(item: tuple[_Place, list[Node]]) -> tuple[int, tuple[int, ...]]:
    (row, at), _ = item
    return row, tuple(node.number for node in at)
