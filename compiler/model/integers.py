"""The whole numbers of a program: slots of `ix`, and indices as affine forms i + ix[slot] + constant.

A slot is named by what it holds; the binding evaluates it:
    ("value", node)              a whole-number expression of parameters (loop bounds, offsets)
    ("origin", owner)            -sum(first_k * stride_k) of the family of that owner
    ("stride", owner, k)         distance of neighbours along index k (the last index has stride 1, no slot)
    ("array", name)              position in p of element 0 of a parameter array (may lie before the array)
    ("step", name, k)            stride of a parameter array
    ("table", name)              position in p of a table's numbers
    ("points", name, k)          its number of breakpoints of argument k
    ("clamped", name)            1 where a table of two arguments clamps, else 0
    ("picks", name)              position in ix, behind all slots, of a table of indices that the compiler made
"""

from __future__ import annotations

from typing import Any

from sysdyn.dsl.model.affine import index_text
from sysdyn.dsl.model.expression import Node, linear, topological
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError
from sysdyn.values import dataclass

Slot = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Index:
    """(loop variable or 0) + (ix[slot] or 0) + constant; -1 for none.  table: a slot, ix[ix[table] + that] then."""

    loop: int
    slot: int
    constant: int
    table: int = -1

    def as_list(self) -> list[int]:
        """Its numbers; of a table only where there is one."""
        return [self.loop, self.slot, self.constant, *([self.table] if self.table >= 0 else [])]


@dataclass(frozen=True, slots=True)
class FamilyReference:
    """An element of a family: y[at[family] + position]; position = ix[origin] + sum(index_k * ix[strides_k])."""

    family: int
    indices: tuple[Index, ...]
    origin: int  # slot, -1 for scalars
    strides: tuple[int, ...]  # slots, all indices but the last


@dataclass(frozen=True, slots=True)
class ArrayElement:
    """An element of a parameter array: p[ix[origin] + sum(index_k * ix[strides_k])]."""

    indices: tuple[Index, ...]
    origin: int
    strides: tuple[int, ...]


class Integers:
    """Gives slots to what a program needs, each once."""

    def __init__(self) -> None:
        self._slots: dict[Slot, int] = {}

    @property
    def slots(self) -> tuple[Slot, ...]:
        """All slots in order."""
        return tuple(self._slots)

    def slot(self, *what: Any) -> int:
        """The slot that holds this."""
        return self._slots.setdefault(what, len(self._slots))

    def value(self, node: Node) -> int:
        """The slot of a whole-number expression of parameters."""
        return self.slot("value", node)

    def index(self, node: Node, loops: dict[str, int]) -> Index:
        """An index expression as an affine form; ModelError E806 where it is none."""
        # x[list[i]]: the inner index, then the table of picks
        if node.op == "param" and node.args and node.data.startswith("#"):
            own = self.index(node.args[0], loops)
            return Index(own.loop, own.slot, own.constant, self.slot("picks", node.data))
        # i, i + 1, i + n - 1: at most one counter of coefficient 1, a whole number, parameters
        constant, parts = 0.0, [(1.0, node)]
        if node.op == "const":
            constant, parts = node.data, []
        elif node.op == "sum":
            constant, parts = node.data[0], list(zip(node.data[1], node.args, strict=True))
        counters = [(c, n) for c, n in parts if n.op == "index"]
        rest = [(c, n) for c, n in parts if n.op != "index"]
        bad = len(counters) > 1 or any(c != 1.0 for c, _ in counters) or constant != int(constant)
        if bad or any(n.op not in ("const", "param", "sum", "mul", "call", "pow") for n in topological_of(rest)):
            text = f"index {index_text(node)} is not affine: i + c with whole c is meant"
            raise ModelError([Diagnostic("E806", text, None)])
        loop = loops[counters[0][1].data] if counters else -1
        slot = self.value(linear(0.0, rest)) if rest else -1
        return Index(loop, slot, int(constant))

    def reference(self, family: int, owner: str, at: tuple[Node, ...], loops: dict[str, int]) -> FamilyReference:
        """An element of the family of `owner`."""
        indices = tuple(self.index(node, loops) for node in at)
        origin = self.slot("origin", owner) if indices else -1
        strides = tuple(self.slot("stride", owner, k) for k in range(len(indices) - 1))
        return FamilyReference(family, indices, origin, strides)

    def element(self, name: str, at: tuple[Node, ...], loops: dict[str, int]) -> ArrayElement:
        """An element of the parameter array `name`."""
        indices = tuple(self.index(node, loops) for node in at)
        strides = tuple(self.slot("step", name, k) for k in range(len(indices) - 1))
        return ArrayElement(indices, self.slot("array", name), strides)


def topological_of(rest: list[tuple[float, Node]]) -> list[Node]:
    """All nodes of the parts."""
    return topological(n for _, n in rest)
