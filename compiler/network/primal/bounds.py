"""Whole numbers that keep the expression they came from, intervals of them, and indices i + c.

Values order the ends of intervals and count; what is emitted is the expression, so that a network of any size gets the
same text (language, 8.5).
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Sequence

from sysdyn.dsl.model.affine import not_affine
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import Node, add, const, index, param, sub, substitute
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import Network, Parameter, Shape
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class WholeNumber:
    """A whole number: its value with the network's parameters, and its expression."""

    value: int
    node: Node

    def plus(self, other: WholeNumber | int) -> WholeNumber:
        """The sum."""
        other = number(other) if isinstance(other, int) else other
        return WholeNumber(self.value + other.value, add(self.node, other.node))

    def minus(self, other: WholeNumber | int) -> WholeNumber:
        """The difference."""
        other = number(other) if isinstance(other, int) else other
        return WholeNumber(self.value - other.value, sub(self.node, other.node))


def number(value: int) -> WholeNumber:
    """A literal."""
    return WholeNumber(value, const(value))


@dataclass(frozen=True, slots=True)
class Interval:
    """first..last, both included."""

    first: WholeNumber
    last: WholeNumber

    @property
    def size(self) -> int:
        """How many whole numbers lie in it."""
        return max(self.last.value - self.first.value + 1, 0)

    def plus(self, offset: WholeNumber | int) -> Interval:
        """The interval moved."""
        return Interval(self.first.plus(offset), self.last.plus(offset))

    def minus(self, offset: WholeNumber | int) -> Interval:
        """The interval moved back."""
        return Interval(self.first.minus(offset), self.last.minus(offset))

    def common(self, other: Interval) -> Interval:
        """What lies in both."""
        first = self.first if self.first.value >= other.first.value else other.first
        return Interval(first, self.last if self.last.value <= other.last.value else other.last)

    def holds(self, other: Interval) -> bool:
        """Whether the other lies inside."""
        return self.first.value <= other.first.value and other.last.value <= self.last.value


Box = tuple[Interval, ...]


def box_size(box: Box) -> int:
    """Number of elements."""
    total = 1
    for interval in box:
        total *= interval.size
    return total


def box_holds(outer: Box, inner: Box) -> bool:
    """Whether the inner box lies in the outer."""
    return all(a.holds(b) for a, b in zip(outer, inner, strict=True))


def meet(a: Box, b: Box) -> bool:
    """Whether boxes have elements in common."""
    return all(x.first.value <= y.last.value and y.first.value <= x.last.value for x, y in zip(a, b, strict=True))


def shape_of(box: Box) -> Shape:
    """The box as a family's shape."""
    return tuple((i.first.node, i.last.node) for i in box)


def box_union(a: Box, b: Box) -> Box | None:
    """The union of two disjoint boxes where it is a box."""
    differing = [k for k, (x, y) in enumerate(zip(a, b, strict=True)) if _ends(x) != _ends(y)]
    if len(differing) != 1:
        return None
    k = differing[0]
    low, high = (a[k], b[k]) if a[k].first.value < b[k].first.value else (b[k], a[k])
    if low.last.value + 1 != high.first.value:
        return None
    return (*a[:k], Interval(low.first, high.last), *a[k + 1 :])


def _ends(interval: Interval) -> tuple[int, int]:
    return interval.first.value, interval.last.value


def box_difference(box: Box, *holes: Box) -> list[Box]:
    """The parts of a box outside others."""
    left = [box]
    for hole in holes:
        left = [part for rest in left for part in _parts_outside(rest, hole)]
    return left


def _parts_outside(box: Box, hole: Box) -> Iterator[Box]:
    """The parts of a box outside of a hole, a slab before and behind it along each dimension."""
    inner = tuple(a.common(b) for a, b in zip(box, hole, strict=True))
    if not box_size(inner):
        yield box
        return
    for k, (whole, cut) in enumerate(zip(box, inner, strict=True)):
        before = Interval(whole.first, cut.first.minus(1))
        behind = Interval(cut.last.plus(1), whole.last)
        for part in (before, behind):
            if part.size:
                yield (*inner[:k], part, *box[k + 1 :])


def between(cuts: dict[int, WholeNumber]) -> list[Interval]:
    """The intervals between successive cuts (each cut begins an interval; the last one ends all)."""
    ordered = [cuts[value] for value in sorted(cuts)]
    return [Interval(a, b.minus(1)) for a, b in itertools.pairwise(ordered)]


@dataclass(frozen=True, slots=True)
class Affine:
    """An index: (loop variable) + offset."""

    loop: str | None
    offset: WholeNumber

    def substitute_loops(self, values: dict[str, Node]) -> Node:
        """The index with loop variables replaced."""
        return self.offset.node if self.loop is None else add(values[self.loop], self.offset.node)

    def over(self, ranges: dict[str, Interval]) -> Interval:
        """All its values."""
        if self.loop is None:
            return Interval(self.offset, self.offset)
        return ranges[self.loop].plus(self.offset)


@dataclass(frozen=True, slots=True)
class Picked:
    """An index from a table of whole numbers that the compiler made: table[along]; values: from index 0 on."""

    table: str
    along: Affine
    values: tuple[int, ...]

    @property
    def loop(self) -> None:
        """It moves along no loop."""
        return None

    @property
    def offset(self) -> WholeNumber:
        """The first that is picked."""
        return number(self.values[0])

    def substitute_loops(self, values: dict[str, Node]) -> Node:
        """The index with loop variables replaced."""
        own = self.along.substitute_loops(values)
        return const(self.values[int(own.data)]) if own.op == "const" else param(self.table, own)

    def over(self, ranges: dict[str, Interval]) -> Interval:
        """What holds all its values."""
        own = self.along.over(ranges)
        found = self.values[own.first.value : own.last.value + 1]
        return Interval(number(min(found)), number(max(found)))


class WholeNumbers:
    """Values of whole-number expressions with a network's own parameter values; only what is asked is computed."""

    def __init__(self, network: Network) -> None:
        self._parameters = {p.name: p for p in network.parameters}
        self._settings = tuple(reversed(network.elements))
        self._found: dict[Node, float] = {}

    def value(self, node: Node) -> float:
        """The value of an expression of parameters."""
        if node not in self._found:
            self._found[node] = evaluate([node], self._leaf)[0]
        return self._found[node]

    def bound(self, node: Node, place: Place | None) -> WholeNumber:
        """A whole number; E805 where it is none."""
        value = self.value(node)
        if not abs(value) < 2**31 or value != round(value):
            raise ModelError([Diagnostic("E805", f"{to_text(node)} = {value:g} is no whole number", place)])
        return WholeNumber(round(value), node)

    def interval(self, first: Node, last: Node, place: Place | None) -> Interval:
        """first..last."""
        return Interval(self.bound(first, place), self.bound(last, place))

    def box(self, shape: Shape, place: Place | None) -> Box:
        """The box of a shape."""
        return tuple(self.interval(first, last, place) for first, last in shape)

    def affine(self, node: Node, loops: Collection[str], place: Place | None) -> Affine:
        """An index as i + c; E806 where it is none."""
        parts = list(zip(node.data[1], node.args, strict=True)) if node.op == "sum" else [(1.0, node)]
        counters = [(c, n) for c, n in parts if n.op == "index" and n.data in loops]
        if not counters and not _indices(node):
            return Affine(None, self.bound(node, place))
        if len(counters) == 1 and counters[0][0] == 1.0:
            rest = sub(node, counters[0][1])
            if not _indices(rest):
                return Affine(counters[0][1].data, self.bound(rest, place))
        text, help_, size = not_affine(node, ": i + c with whole c is meant")
        place = self._parameters[size].place if size in self._parameters else place
        raise ModelError([Diagnostic("E806", text, place, help_)])

    def index(self, node: Node, loops: Collection[str], place: Place | None) -> Affine | Picked:
        """An index as i + c, or from a table of the compiler's own (parameters whose names begin with #)."""
        if node.op != "param" or not node.args or not node.data.startswith("#"):
            return self.affine(node, loops, place)
        found = tuple(round(self.value(v)) for v in self._parameters[node.data].values)
        return Picked(node.data, self.affine(node.args[0], loops, place), found)

    def reach(self, at: Sequence[Node], within: dict[str, Interval], place: Place | None) -> Box:
        """All values of indices over the ranges of loop variables."""
        return tuple(self.index(node, within, place).over(within) for node in at)

    def _leaf(self, node: Node) -> float:
        """Number of a parameter before the start: elements of the scene, formulas over indices, values of a list
        (E807).
        """
        if node.op != "param" or node.data not in self._parameters:
            raise ModelError([Diagnostic("E807", f"{to_text(node)} is not known before the start", None)])
        parameter = self._parameters[node.data]
        at = tuple(const(round(self.value(a))) for a in node.args)
        # elements that a scene sets
        for setting in self._settings:
            if setting.name == node.data and self._same(setting.at, at):
                return self.value(setting.value)
        # a formula with loop variables
        if parameter.indices:
            change = {index(name): value for name, value in zip(parameter.indices, at, strict=False)}
            rest = len(parameter.indices)
            place = self._position(parameter, at, rest) if len(parameter.values) > 1 else 0
            return self.value(substitute(parameter.values[place], change))
        if len(parameter.values) == 1:
            return self.value(parameter.values[0])
        return self.value(parameter.values[self._position(parameter, at)])

    def _same(self, own: Sequence[Node], at: Sequence[Node]) -> bool:
        return all(self.value(a) == b.data for a, b in zip(own, at, strict=True))

    def _position(self, parameter: Parameter, at: Sequence[Node], start: int = 0) -> int:
        """Row-major place of an element, of its indices from `start` on."""
        place = 0
        for (first, last), k in zip(parameter.shape[start:], at[start:], strict=True):
            low, high = self.value(first), self.value(last)
            if not low <= k.data <= high:
                text = f"{parameter.name}: index {k.data:g} outside {low:g}..{high:g}"
                raise ModelError([Diagnostic("E805", text, parameter.place)])
            place = place * round(high - low + 1) + round(k.data - low)
        return place


def _indices(node: Node) -> bool:
    stack = [node]
    while stack:
        top = stack.pop()
        if top.op == "index":
            return True
        stack.extend(top.args)
    return False


@dataclass(frozen=True, slots=True)
class FamilyBox:
    """A box of a named family: `name` is unique, `family` the one the author knows."""

    name: str
    box: Box


def parts(found: Sequence[tuple[str, Box]]) -> list[FamilyBox]:
    """For each (family, box) the part it lies in: unions of disjoint boxes that are boxes, each with a name of its own.

    The first part of a family keeps the family's name, others are `name.2`, `name.3`, ...
    """
    groups: dict[str, list[Box]] = {}
    for family, box in found:
        groups.setdefault(family, []).append(box)
    hulls: dict[str, list[FamilyBox]] = {}
    for family, boxes in groups.items():
        hulls[family] = [FamilyBox(family if k == 0 else f"{family}.{k + 1}", b) for k, b in enumerate(union(boxes))]
    return [next(p for p in hulls[family] if box_holds(p.box, box)) for family, box in found]


def union(boxes: Sequence[Box]) -> list[Box]:
    """Disjoint boxes joined as long as two of them make a box, in the order of their first corners."""
    kept = sorted(boxes, key=corner)
    changed = True
    while changed:
        changed = False
        # again from the beginning after each join: boxes are few
        for i in range(len(kept)):
            for j in range(i + 1, len(kept)):
                both = box_union(kept[i], kept[j])
                if both is not None:
                    kept = [*kept[:i], both, *kept[i + 1 : j], *kept[j + 1 :]]
                    changed = True
                    break
            if changed:
                break
    return kept


def corner(box: Box) -> tuple[int, ...]:
    """Its first corner."""
    return tuple(i.first.value for i in box)
