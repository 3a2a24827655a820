"""A spanning forest of points of families that links with contents join: no element is ever visited.

The content of a link is the position of a(k) less that of b(k).  Links that join trees hang one at the other; the
position of a point over the root of its tree is then an expression in its indices, along a run a sum.  A link within
one tree closes a loop: what its content must be is told by the positions of its ends.

Received: items (boxes of points), links in the order in which they are preferred, their contents over `#k0, #k1, ...`.
Returned: an IndexForest; `loops`: (owner, box of link indices, position of a(k) over b(k)); links that neither join
whole trees nor close loops are in `refused`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

from sysdyn.compiler.network.primal.bounds import Box, Interval, box_size, number, without
from sysdyn.compiler.network.primal.incidence import indices
from sysdyn.compiler.network.primal.index_classes import (
    Cell,
    Cut,
    End,
    IndexClasses,
    Key,
    Link,
    Option,
    foremost_way,
)
from sysdyn.dsl.model.expression import Node, add, const, index, mul, neg, reduction, sub, substitute
from sysdyn.dsl.model.joined import Joined

Stage = Sequence[tuple[Link, Node]]
Ends = tuple[Cell, Cell]
Trees = dict[int | None, tuple[Key, int]]
"""By indices of a link: stretches of axes along which each element has a tree of its own."""
_WAYS = ("zero", "free", "self", "cross")
"""Equals are joined before neighbours: what lies along a run is told by other links where it can be."""


class IndexForest(IndexClasses):
    """Trees of cells; the position of each cell over the root of its tree, in the coordinates of its axes."""

    def __init__(self, items: Sequence[Box], stages: Sequence[Stage], cuts: Iterable[Cut] = ()) -> None:
        """Links of a stage join before those of the next."""
        self.loops: list[tuple[int, Box, Node]] = []
        self._over: dict[Cell, tuple[Cell, Node]] = {}
        self._contents = {link.owner: content for stage in stages for link, content in stage}
        self._stages = {link.owner: k for k, stage in enumerate(stages) for link, _ in stage}
        self._left: list[tuple[Link, tuple[Option, ...], Box]] = []
        self._serial = itertools.count(1)
        self._links = [link for stage in stages for link, _ in stage]
        super().__init__(items, self._links, cuts)

    def trees(self) -> list[list[Cell]]:
        """The cells of each tree that joins any."""
        found: dict[Cell, list[Cell]] = {}
        for cell in (cell for item in range(len(self.items)) for cell in self.cells(item)):
            found.setdefault(self._root(cell), []).append(cell)
        return [cells for root, cells in found.items() if cells != [root]]

    def between(self, a: End, b: End) -> Node | None:
        """The position of one point over another; None where they are not joined."""
        ((one, other),) = (
            pair
            for pair in itertools.product(self.cells(a.item), self.cells(b.item))
            if box_size(self._between(Link((), a, b), (), pair))
        )
        return self._around(Link((), a, b), (one, other)) if self._root(one) == self._root(other) else None

    def along(self, cell: Cell, more: Node | None = None) -> Node:
        """The positions of a cell over its root, and more in the coordinates of its axes, over `#k0, #k1, ...`."""
        return self._at(End(cell[0], tuple((d, number(0)) for d in range(len(cell[1])))), cell, more)

    def summed(self, cell: Cell, root: Node) -> tuple[Node, Node]:
        """The sum of an expression over `#k0, ...` along the axes that a tree runs along, and of how many."""
        opened, count, box = {d for d, _, _ in self.extended(cell)}, const(1.0), self.box(cell)
        for d, (own, i) in enumerate(zip(indices(box), box, strict=True)):
            axis, offset = self.axis(cell[0], d)
            if d in opened:
                root = substitute(root, {own: sub(coordinate(axis), offset.node)})
            elif i.size == 1:
                root = substitute(root, {own: i.first.node})
            else:
                body = substitute(root, {own: index(f"#s{d}")})
                root = reduction("sum", f"#s{d}", i.first.node, i.last.node, body)
                count = mul(count, i.last.plus(1).minus(i.first).node)
        return root, count

    def _at(self, end: End, cell: Cell, more: Node | None = None) -> Node:
        """The position of an end of a link over the root, over the link's indices."""
        change = {}
        for d, (k, own) in enumerate(end.at):
            axis, offset = self.axis(end.item, d)
            moved = own.plus(offset).node
            change[coordinate(axis)] = moved if k is None else add(index(f"#k{k}"), moved)
        return substitute(add(self._position(cell), more or const(0.0)), change)

    def _position(self, cell: Cell) -> Node:
        """The position over the root of its tree, in the coordinates of the axes."""
        steps = []
        while cell in self._over:
            cell, step = self._over[cell]
            steps.append(step)
        return add(*steps)

    def _root(self, cell: Cell) -> Cell:
        return self.find(cell)[0]

    # -- joining ------------------------------------------------------------------------------------------------

    def _unite(self, links: Sequence[Link]) -> None:
        refused = [(link, link.box) for link in self.refused]
        for _, stage in itertools.groupby(links, lambda link: self._stages[link.owner]):
            applied = [(link, choice) for link in stage for choice in self._choices(link)]
            for way in _WAYS:
                for link, choice in applied:
                    if foremost_way(choice) == way:
                        self._tie(link, choice)
            again, self._left = self._left, []  # others may have joined the trees of its ends meanwhile
            for link, choice, _ in again:
                self._tie(link, choice)
        left = [(link, box) for link, _, box in self._left]
        self.refused = [link for link, box in (*refused, *left) if not self._closed(link, box)]

    def _tie(self, link: Link, choice: tuple[Option, ...]) -> None:
        """Hang one tree at the other, lay a run, or close loops."""
        box = tuple(self._range(link, k, option) for k, option in enumerate(choice))
        ends = self._ends(link, choice)
        one, other = (self._open(end, cell) for end, cell in zip((link.a, link.b), ends, strict=True))
        if self._root(ends[0]) == self._root(ends[1]):
            runs = [k for k in one if k is not None and choice[k].how == "self"]
            if runs and one.keys() == other.keys() and None not in one:
                self._run(link, box, ends, runs[0], one)
            elif one.keys() == other.keys() and not runs:
                self._close(link, box, ends)
            else:
                self._left.append((link, choice, box))
            return
        moving = {k for k, i in enumerate(box) if i.size > 1}
        whole = all(
            k is not None and box[k].size == self.interval(*stretch).size
            for trees in (one, other)
            for k, stretch in trees.items()
        )
        if whole and not (moving - one.keys()) & other.keys():
            self._join_trees(link, box, ends, 0, one)
        elif whole and not (moving - other.keys()) & one.keys():
            self._join_trees(link, box, ends, 1, other)
        else:
            self._left.append((link, choice, box))

    def _range(self, link: Link, k: int, option: Option) -> Interval:
        """The values of a link index in one place."""
        found = link.box[k]
        for n, axis, moved in self._places(link, k):
            found = found.common(self.interval(axis, (option.a, option.b)[n]).minus(moved))
        return found

    def _open(self, end: End, cell: Cell) -> Trees:
        """The stretches of axes along which a cell has a tree for each element, by the link's indices."""
        opened = {d: (axis, k) for d, axis, k in self.extended(cell)}
        return {end.at[d][0]: stretch for d, stretch in opened.items()}

    def _join_trees(self, link: Link, box: Box, ends: Ends, n: int, trees: Trees) -> None:
        """The tree of one end at that of the other, by the first of links where several join the two."""
        keep = tuple(i if k in trees else Interval(i.first, i.first) for k, i in enumerate(box))
        step = sub(self._contents[link.owner], self._around(link, ends))
        root, above = self._root(ends[n]), self._root(ends[1 - n])
        both = {axis for _, axis, _ in self.extended(ends[1 - n])}
        self._over[root] = above, self._placed(step if n == 0 else neg(step), link, n, keep)
        self._hang(root, above, 1)
        self._collapsed |= {(above, axis, k) for axis, k in trees.values() if axis not in both}
        for rest in without(box, keep):
            self._close(link, rest, ends)

    def _run(self, link: Link, box: Box, ends: Ends, run: int, trees: Trees) -> None:
        """Neighbours along an axis joined: positions over its first element are sums."""
        (_, axis, one), (_, _, other) = self._places(link, run)
        n = 0 if one.value > other.value else 1
        keep = tuple(i if k in trees else Interval(i.first, i.first) for k, i in enumerate(box))
        step = sub(self._contents[link.owner], self._around(link, ends))
        step = self._placed(step if n == 0 else neg(step), link, n, keep)
        serial, root, stretch = next(self._serial), self._root(ends[0]), trees[run]
        new, name = (-serial, ()), f"#w{serial}"
        body = substitute(step, {coordinate(axis): index(name)})
        first = self.interval(*stretch).first.plus(1).node
        self._over[root] = new, reduction("sum", name, first, coordinate(axis), body)
        self._hang(root, new, 1)
        self._collapsed.add((new, *stretch))
        for rest in without(box, keep):
            self._close(link, rest, ends)

    def _placed(self, root: Node, link: Link, n: int, box: Box) -> Node:
        """An expression in link indices as one in the coordinates of an end."""
        moved = {k: (axis, by) for k in range(len(box)) for m, axis, by in self._places(link, k) if m == n}
        change = {}
        for k, (name, i) in enumerate(zip(indices(box), box, strict=True)):
            alone = i.size == 1 or k not in moved
            change[name] = i.first.node if alone else sub(coordinate(moved[k][0]), moved[k][1].node)
        return substitute(root, change)

    def _around(self, link: Link, ends: Ends) -> Node:
        """The position of a(k) over b(k), but for what lies between their roots."""
        return sub(self._at(link.a, ends[0]), self._at(link.b, ends[1]))

    # -- loops --------------------------------------------------------------------------------------------------

    def _close(self, link: Link, box: Box, ends: Ends) -> None:
        self.loops.append((link.owner, box, self._around(link, ends)))

    def _closed(self, link: Link, box: Box) -> bool:
        """Loops that a link closes which the cells do not follow; whether it does for its whole box."""
        left = box_size(box)
        for ends in itertools.product(self.cells(link.a.item), self.cells(link.b.item)):
            here = self._between(link, box, ends)
            if box_size(here) and self._root(ends[0]) == self._root(ends[1]) and not any(map(self.extended, ends)):
                left -= box_size(here)
                self._close(link, here, ends)
        return left == 0

    def misses_loops(self) -> bool:
        """Whether links that were refused close loops; only where there are any are the elements counted."""
        if not self.refused:
            return False
        joined, closed = Joined[tuple[int, ...]](), 0
        for link in self._links:
            for k in itertools.product(*(range(i.first.value, i.last.value + 1) for i in link.box)):
                at = ([(0 if d is None else k[d]) + c.value for d, c in end.at] for end in (link.a, link.b))
                closed += not joined.join((link.a.item, *next(at)), (link.b.item, *next(at)))
        return closed > sum(box_size(box) for _, box, _ in self.loops)

    def _between(self, link: Link, box: Box, ends: Ends) -> Box:
        """The link indices at which its ends lie in these cells."""
        found = list(box)
        for end, cell in zip((link.a, link.b), ends, strict=True):
            for (k, own), i in zip(end.at, self.box(cell), strict=True):
                if k is not None:
                    found[k] = found[k].common(i.minus(own))
                elif not i.holds(Interval(own, own)):
                    return (Interval(number(1), number(0)),)
        return tuple(found)


def coordinate(axis: Key) -> Node:
    """The coordinate along an axis."""
    return index(f"#u{axis[0]}.{axis[1]}")
