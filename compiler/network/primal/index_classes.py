"""Which elements of families belong together, by index classes: no element is ever visited.

Items are boxes of indices.  A link says that for every index k of its box the element a(k) of one item and b(k) of
another belong together, each of their indices being k_j + c or a constant.  Indices that links set against each other
are aligned to common *axes* u = x + offset; where a second link between the same axes is shifted by one, it ties
neighbours (a run: `R[i]: m[i-1] -> m[i]`).  All ends of intervals cut the axes, so that within a *cell*, a product of
intervals, all elements are alike.  Cells are then united; an axis along which the elements of a cell are all tied
together is *collapsed* there.

Received: items, links.  Returned: a IndexClasses; links that this method cannot follow are in `refused`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import Box, Interval, WholeNumber, between, number
from sysdyn.values import dataclass

Key = tuple[int, int]  # item, dimension
Cut = tuple[int, int, WholeNumber]  # item, dimension, first index behind the cut
Cell = tuple[int, tuple[int, ...]]  # item, interval number on the axis of each dimension


@dataclass(frozen=True, slots=True)
class LinkEnd:
    """Element of an item: each index is a link index (its number) plus an offset, or the offset alone (None)."""

    item: int
    at: tuple[tuple[int | None, WholeNumber], ...]


@dataclass(frozen=True, slots=True)
class Link:
    """a(k) and b(k) belong together for every k of the box, with equal (+1) or opposite (-1) sense."""

    box: Box
    a: LinkEnd
    b: LinkEnd
    sign: int = 1


@dataclass(frozen=True, slots=True)
class Option:
    """What a link does along one of its indices, in one place: intervals of both ends, and how they are tied."""

    how: str  # zero self cross free
    a: int
    b: int
    axis: Key | None


def foremost_way(choice: Sequence[Option]) -> str:
    """What a link does along the first of its indices that does not tie equals."""
    return next((o.how for o in choice if o.how != "zero"), "zero")


class IndexClasses:
    """Cells of items and the groups that they form."""

    def __init__(self, items: Sequence[Box], links: Sequence[Link], cuts: Iterable[Cut] = ()) -> None:
        self.items = items
        self.refused: list[Link] = []
        self._aligned: dict[Key, tuple[Key, WholeNumber]] = {}
        self._parent: dict[Cell, tuple[Cell, int]] = {}
        self._collapsed: set[tuple[Cell, Key, int]] = set()
        kept = [link for link in map(_without_points, links) if self._align(link)]
        self._intervals = self._cut(kept, cuts)
        self._numbers = {axis: {i.first.value: k for k, i in enumerate(v)} for axis, v in self._intervals.items()}
        self._unite([link for link in kept if self._can_follow(link)])

    # -- axes ---------------------------------------------------------------------------------------------------

    def axis(self, item: int, dimension: int) -> tuple[Key, WholeNumber]:
        """The axis of an item's index and the offset: u = x + offset."""
        key, offset = (item, dimension), number(0)
        while key in self._aligned:
            key, step = self._aligned[key]
            offset = offset.plus(step)
        return key, offset

    def _align(self, link: Link) -> bool:
        """Put the indices that a link compares on one axis; refuse where two indices of one item would meet."""
        for (i, a), (j, b) in itertools.product(enumerate(link.a.at), enumerate(link.b.at)):
            if a[0] is None or a[0] != b[0]:
                continue
            (left, of_left), (right, of_right) = self.axis(link.a.item, i), self.axis(link.b.item, j)
            if left == right:
                continue
            if self._owners(left) & self._owners(right):
                self.refused.append(link)
                return False
            # x_a = k + a, x_b = k + b: u_b + (a - b) + (of_left - of_right) = u_a
            self._aligned[right] = left, a[1].minus(b[1]).plus(of_left.minus(of_right))
        return True

    def _owners(self, axis: Key) -> set[int]:
        return {n for n, box in enumerate(self.items) for d in range(len(box)) if self.axis(n, d)[0] == axis}

    def _shift(self, link: Link, k: int) -> tuple[Key, int] | None:
        """The axis of link index k and u_a - u_b there; None where only one end moves with it."""
        places = self._places(link, k)
        return (places[0][1], places[0][2].value - places[1][2].value) if len(places) == 2 else None

    def _can_follow(self, link: Link) -> bool:
        """Whether the link is one that ties equals, or neighbours along one axis."""
        shifts = [s[1] for k in range(len(link.box)) if (s := self._shift(link, k)) is not None]
        if sum(s != 0 for s in shifts) > 1 or any(abs(s) > 1 for s in shifts):
            self.refused.append(link)
            return False
        return True

    # -- cells --------------------------------------------------------------------------------------------------

    def _cut(self, links: Sequence[Link], cuts: Iterable[Cut]) -> dict[Key, list[Interval]]:
        """Intervals of each axis between all ends of items, links and cuts that are asked for."""
        found: dict[Key, dict[int, WholeNumber]] = {}

        def add(axis: Key, first: WholeNumber, behind: WholeNumber) -> None:
            found.setdefault(axis, {}).setdefault(first.value, first)
            found[axis].setdefault(behind.value, behind)

        for n, box in enumerate(self.items):
            for d, interval in enumerate(box):
                axis, offset = self.axis(n, d)
                add(axis, interval.first.plus(offset), interval.last.plus(offset).plus(1))
        for n, d, cut in cuts:
            axis, offset = self.axis(n, d)
            add(axis, cut.plus(offset), cut.plus(offset))
        for link in links:
            for axis, interval in self._reaches(link):
                add(axis, interval.first, interval.last.plus(1))
        return {axis: between(values) for axis, values in found.items()}

    def _reaches(self, link: Link) -> Iterator[tuple[Key, Interval]]:
        """The stretch of each axis that a link touches; a run's stretch holds both neighbours."""
        runs: dict[int, list[tuple[Key, Interval]]] = {}
        for end in (link.a, link.b):
            for d, (index, own) in enumerate(end.at):
                axis, offset = self.axis(end.item, d)
                moved = own.plus(offset)
                if index is None:
                    yield axis, Interval(moved, moved)
                else:
                    runs.setdefault(index, []).append((axis, link.box[index].plus(moved)))
        for stretches in runs.values():
            first = min((s[1].first for s in stretches), key=lambda b: b.value)
            last = max((s[1].last for s in stretches), key=lambda b: b.value)
            yield stretches[0][0], Interval(first, last)

    def interval(self, axis: Key, k: int) -> Interval:
        """An interval of an axis."""
        return self._intervals[axis][k]

    def cells(self, item: int) -> Iterator[Cell]:
        """The cells of an item."""
        ranges = []
        for d, interval in enumerate(self.items[item]):
            axis, offset = self.axis(item, d)
            ranges.append(self._inside(axis, interval.plus(offset)))
        return ((item, at) for at in itertools.product(*ranges))

    def _inside(self, axis: Key, interval: Interval) -> list[int]:
        return [k for k, piece in enumerate(self._intervals[axis]) if interval.holds(piece) and piece.size]

    def box(self, cell: Cell) -> Box:
        """The cell in the item's own indices."""
        item, at = cell
        found = []
        for d, k in enumerate(at):
            axis, offset = self.axis(item, d)
            found.append(self._intervals[axis][k].minus(offset))
        return tuple(found)

    def free_dimensions(self, cell: Cell) -> list[tuple[int, Key, int]]:
        """(dimension, axis, interval) where the cell has more than one element that are not tied together."""
        item, at = cell
        found = []
        for d, k in enumerate(at):
            axis = self.axis(item, d)[0]
            if self._intervals[axis][k].size > 1 and not self.is_collapsed(cell, axis, k):
                found.append((d, axis, k))
        return found

    # -- groups -------------------------------------------------------------------------------------------------

    def find(self, cell: Cell) -> tuple[Cell, int]:
        """The group's representative, and the sense relative to it."""
        path = []
        while cell in self._parent:
            above, step = self._parent[cell]
            path.append((cell, step))
            cell = above
        sign = 1
        for below, step in reversed(path):
            sign *= step
            self._parent[below] = cell, sign
        return cell, sign

    def is_collapsed(self, cell: Cell, axis: Key, k: int) -> bool:
        """Whether all elements along an axis' interval are tied together in the cell's group."""
        return (self.find(cell)[0], axis, k) in self._collapsed

    def groups(self) -> dict[Cell, list[tuple[Cell, int]]]:
        """Representative -> members with their senses, in the order of the items."""
        found: dict[Cell, list[tuple[Cell, int]]] = {}
        for item in range(len(self.items)):
            for cell in self.cells(item):
                root, sign = self.find(cell)
                found.setdefault(root, []).append((cell, sign))
        return found

    def _join(self, a: Cell, b: Cell, sign: int) -> None:
        (left, of_left), (right, of_right) = self.find(a), self.find(b)
        if left != right:
            if (right[0], right[1]) < (left[0], left[1]):
                left, right = right, left
            self._parent[right] = left, of_left * of_right * sign
            if self._collapsed:
                self._collapsed = {(left if root == right else root, axis, k) for root, axis, k in self._collapsed}

    def _unite(self, links: Sequence[Link]) -> None:
        """Equals first, one with many too, then runs inside cells, then what reaches from cell to cell."""
        applied = [(link, choice) for link in links for choice in self._choices(link)]
        # whole cells that equal each other
        for link, choice in applied:
            if all(o.how in ("zero", "free") for o in choice):
                self._join(*self._ends(link, choice), link.sign)
        # runs: neighbours tied inside of one cell make it one class along the axis
        for link, choice in applied:
            a, b = self._ends(link, choice)
            for option in choice:
                if option.how == "self" and self.find(a)[0] == self.find(b)[0] and option.axis is not None:
                    self._collapsed.add((self.find(a)[0], option.axis, option.a))
                elif option.how == "self":
                    self._refuse(link)
                elif option.how == "free" and option.axis is not None:
                    end = a if option.b < 0 else b
                    self._collapsed.add((self.find(end)[0], option.axis, max(option.a, option.b)))
        # from cell to cell: only where both sides are collapsed already
        for link, choice in applied:
            a, b = self._ends(link, choice)
            crossing = [o for o in choice if o.how == "cross" and o.axis is not None]
            if all(self._is_tied(a, o.axis, o.a) and self._is_tied(b, o.axis, o.b) for o in crossing):
                if foremost_way(choice) in ("cross", "free"):
                    self._join(a, b, link.sign)
            else:
                self._refuse(link)

    def _is_tied(self, cell: Cell, axis: Key | None, k: int) -> bool:
        assert axis is not None
        return self._intervals[axis][k].size == 1 or self.is_collapsed(cell, axis, k)

    def _refuse(self, link: Link) -> None:
        if link not in self.refused:
            self.refused.append(link)

    def _choices(self, link: Link) -> Iterator[tuple[Option, ...]]:
        return itertools.product(*(self._options(link, k) for k in range(len(link.box))))

    def _places(self, link: Link, k: int) -> list[tuple[int, Key, WholeNumber]]:
        """The ends that move with link index k, their axes, and u - k there."""
        ends = ((n, d, own) for n, end in enumerate((link.a, link.b)) for d, (i, own) in enumerate(end.at) if i == k)
        found = ((n, own, self.axis((link.a, link.b)[n].item, d)) for n, d, own in ends)
        return [(n, axis, own.plus(offset)) for n, own, (axis, offset) in found]

    def _options(self, link: Link, k: int) -> list[Option]:
        """The intervals that a link meets along one dimension: tied by nothing, to one point, within one cell, or
        across.
        """
        places = [(n, axis, link.box[k].plus(moved)) for n, axis, moved in self._places(link, k)]
        if not places:
            return [Option("zero", -1, -1, None)]
        # one end moves along the axis, the other stays
        if len(places) == 1:
            n, axis, stretch = places[0]
            inside = self._inside(axis, stretch)
            return [Option("free", i if n == 0 else -1, i if n == 1 else -1, axis) for i in inside]
        (_, axis, at_a), (_, _, at_b) = places
        shift = at_a.first.value - at_b.first.value
        # both move together
        if shift == 0:
            return [Option("zero", i, i, axis) for i in self._inside(axis, at_a)]
        # shifted by one: neighbours
        low, high = (at_b, at_a) if shift > 0 else (at_a, at_b)
        inside = self._inside(axis, Interval(low.first, high.last))
        found = [Option("self", i, i, axis) for i in inside if self._intervals[axis][i].size > 1]
        pairs = ((i + 1, i) if shift > 0 else (i, i + 1) for i in inside[:-1])
        return found + [Option("cross", a, b, axis) for a, b in pairs]

    def _ends(self, link: Link, choice: tuple[Option, ...]) -> tuple[Cell, Cell]:
        return self._cell(link.a, [o.a for o in choice]), self._cell(link.b, [o.b for o in choice])

    def _cell(self, end: LinkEnd, chosen: list[int]) -> Cell:
        at = []
        for d, (index, own) in enumerate(end.at):
            axis, offset = self.axis(end.item, d)
            at.append(self._numbers[axis][own.plus(offset).value] if index is None else chosen[index])
        return end.item, tuple(at)


def _without_points(link: Link) -> Link:
    """Indices of the link that take one value only as constants."""
    points = {k: i.first for k, i in enumerate(link.box) if i.size == 1}

    def at_point(end: LinkEnd) -> LinkEnd:
        return LinkEnd(end.item, tuple((None, points[k].plus(c)) if k in points else (k, c) for k, c in end.at))

    return replace(link, a=at_point(link.a), b=at_point(link.b))
