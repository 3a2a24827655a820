"""Rule P2: one displacement coordinate per series class of branches of common-effort domains.

Two branches that meet at a node of degree 2 carry the same flow, the sense kept.  The relation is followed by
`index_classes`; a node of degree 2 that they cannot follow keeps its row, which says the same.  A node that a law
reads keeps its row because its multiplier is what is read.

Received: the incidence and the names of nodes that are read.  Returned: coordinates, for each element the members of
classes it is cut into, and the node cells that were merged.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import Box, WholeNumber, number, parts, shape_of, union
from sysdyn.compiler.network.primal.incidence import BranchElement, Incidence, NodeCell, Touch, ground
from sysdyn.compiler.network.primal.index_classes import Cell, IndexClasses, Link, LinkEnd
from sysdyn.dsl.model.expression import Node, add
from sysdyn.dsl.model.network import Coordinate, Shape
from sysdyn.values import dataclass

Places = tuple[tuple[int | None, WholeNumber], ...]


@dataclass(frozen=True, slots=True)
class SeriesMember:
    """Elements of a branch in a series class: their flow is sign * (flow of the coordinate).

    Each index of the coordinate (and of the leader, the branch whose displacement it is) is (index of the branch's
    name, offset) or (None, constant).  leads: these branches are their own leaders.
    """

    element: BranchElement
    box: Box  # of the name's indices
    sign: int
    coordinate: str
    index: Places
    leader: BranchElement
    leader_index: Places
    leads: bool

    def indices(self, at: tuple[Node, ...]) -> tuple[Node, ...]:
        """The coordinate's indices for the branch with these indices."""
        return tuple(c.node if k is None else add(at[k], c.node) for k, c in self.index)

    def leader_at(self, at: tuple[Node, ...]) -> tuple[Node, ...]:
        """The indices of the first branch of the class, whose displacement the coordinate is."""
        return tuple(c.node if k is None else add(at[k], c.node) for k, c in self.leader_index)


@dataclass(frozen=True, slots=True)
class Series:
    """Coordinates and members of all series classes; merged node cells."""

    coordinates: tuple[Coordinate, ...]
    members: tuple[SeriesMember, ...]
    merged: tuple[NodeCell, ...]


def series(incidence: Incidence, read: frozenset[str]) -> Series:
    """The series classes."""
    flowing = [e for e in incidence.elements if e.ends and e.branch.domain.common == "effort"]
    candidates = [cell for cell in incidence.all_cells() if _mergeable(cell, incidence, read)]
    number_of = {e.number: k for k, e in enumerate(flowing)}
    while True:
        links = [_link(cell, number_of) for cell in candidates]
        likeness = IndexClasses([e.box for e in flowing], links)
        if not likeness.refused:
            break
        plain = {_key(link) for link in likeness.refused}
        candidates = [c for c, link in zip(candidates, links, strict=True) if _key(link) not in plain]
    coordinates, members = _classes(flowing, likeness)
    return Series(coordinates, members, tuple(candidates))


def _key(link: Link) -> tuple[object, ...]:
    """What identifies a link whether or not its points were made constants."""
    return (
        tuple((i.first.value, i.last.value) for i in link.box),
        link.a.item,
        link.b.item,
        link.sign,
        _first_corner(link),
    )


def _first_corner(link: Link) -> tuple[object, ...]:
    """Where both ends lie at the box's first corner."""
    first = [i.first.value for i in link.box]
    return tuple((0 if k is None else first[k]) + c.value for end in (link.a, link.b) for k, c in end.at)


def _mergeable(cell: NodeCell, incidence: Incidence, read: frozenset[str]) -> bool:
    if len(cell.touches) != 2 or any(t.free for t in cell.touches) or cell.node in read:
        return False
    first, second = cell.touches
    if first.element is second.element and _same_place(first, second):
        return False
    if cell.node == ground(cell.domain):
        return not any(f.domain == cell.domain for f in incidence.families.values() if f.name in read)
    return True


def _same_place(first: Touch, second: Touch) -> bool:
    """Whether both ends of one branch meet the node: it is a loop of its own."""
    pairs = zip(first.contact.at, second.contact.at, strict=True)
    return all(a.loop == b.loop and a.offset.value == b.offset.value for a, b in pairs)


def _link(cell: NodeCell, number_of: dict[int, int]) -> Link:
    first, second = cell.touches
    sign = -1 if first.end == second.end else 1
    return Link(cell.box, _end(first, number_of), _end(second, number_of), sign)


def _end(touch: Touch, number_of: dict[int, int]) -> LinkEnd:
    at: list[tuple[int | None, WholeNumber]] = []
    for name in touch.element.loops:
        d = next(d for d, a in enumerate(touch.contact.at) if a.loop == name)
        at.append((d, number(0).minus(touch.contact.at[d].offset)))
    return LinkEnd(number_of[touch.element.number], tuple(at))


@dataclass(frozen=True, slots=True)
class _Class:
    leader: Cell
    sign: int
    members: tuple[tuple[Cell, int], ...]
    kept: tuple[int, ...]  # indices of the leader's name that the coordinate has


def _classes(
    flowing: Sequence[BranchElement], likeness: IndexClasses
) -> tuple[tuple[Coordinate, ...], tuple[SeriesMember, ...]]:
    """Coordinates of the classes of equal flows, and the members of each class with sign and indices."""
    classes = sorted((_class(m, flowing, likeness) for m in likeness.groups().values()), key=lambda c: c.leader)
    named = [_family(c, flowing, likeness) for c in classes]
    plain = [(name, box) for name, box, whole in named if whole]
    names = iter(parts(plain))
    taken = {p.name for p in parts(plain)}
    coordinates: dict[str, Coordinate] = {}
    members: list[SeriesMember] = []
    # a class over a whole family keeps its name and range
    for c, (name, box, whole) in zip(classes, named, strict=True):
        if whole:
            part = next(names)
            own, shape = part.name, shape_of(part.box)
        else:
            own, shape = _unique_name(name, taken), shape_of(tuple(box[k] for k in c.kept))
            taken.add(own)
        coordinates.setdefault(own, _coordinate(own, shape, flowing[c.leader[0]]))
        members += _members(c, own, flowing, likeness)
    return tuple(coordinates.values()), tuple(_fewer(members))


def _unique_name(name: str, taken: set[str]) -> str:
    if name not in taken:
        return name
    return next(n for k in range(2, len(taken) + 3) if (n := f"{name}.{k}") not in taken)


def _class(members: list[tuple[Cell, int]], flowing: Sequence[BranchElement], likeness: IndexClasses) -> _Class:
    """The leader is the first potential store, else the first branch; runs lose the index they run along."""
    stores = [m for m in members if flowing[m[0][0]].branch.kind == "potential"]
    leader, sign = (stores or members)[0]
    element = flowing[leader[0]]
    tied = {d for d, k in enumerate(leader[1]) if likeness.is_collapsed(leader, likeness.axis(leader[0], d)[0], k)}
    if any(_has_tied_elements(cell, likeness) for cell, _ in members) and not likeness.free_dimensions(leader):
        return _Class(leader, sign, tuple(members), ())
    kept = tuple(k for k, a in enumerate(element.at) if a.loop is None or element.loops.index(a.loop) not in tied)
    return _Class(leader, sign, tuple(members), kept)


def _has_tied_elements(cell: Cell, likeness: IndexClasses) -> bool:
    return any(likeness.is_collapsed(cell, likeness.axis(cell[0], d)[0], k) for d, k in enumerate(cell[1]))


def _family(c: _Class, flowing: Sequence[BranchElement], likeness: IndexClasses) -> tuple[str, Box, bool]:
    element = flowing[c.leader[0]]
    box = _box_of_indices(element, likeness.box(c.leader))
    return element.name, box, len(c.kept) == len(element.at)


def _box_of_indices(element: BranchElement, box: Box) -> Box:
    """A box of loop variables as one of the name's indices."""
    ranges = dict(zip(element.loops, box, strict=True))
    return tuple(a.over(ranges) for a in element.at)


def _coordinate(name: str, shape: Shape, leader: BranchElement) -> Coordinate:
    d = leader.branch.domain
    return Coordinate(name, shape, False, d.displacement, d.flow, d.momentum, d.effort, None, leader.branch.place)


def _members(c: _Class, name: str, flowing: Sequence[BranchElement], likeness: IndexClasses) -> Iterable[SeriesMember]:
    """Elements of a class by the leader's indices; those along which all are tied have one value."""
    leader = flowing[c.leader[0]]
    first = likeness.box(c.leader)
    for cell, sign in c.members:
        element = flowing[cell[0]]
        own = {likeness.axis(cell[0], d)[0]: d for d in range(len(element.loops))}
        at: list[tuple[int | None, WholeNumber]] = []
        for k, place in enumerate(leader.at):
            # a fixed index
            if place.loop is None:
                at.append((None, place.offset))
                continue
            d = leader.loops.index(place.loop)
            axis, offset = likeness.axis(c.leader[0], d)
            # the index moves along, but for a shift
            if k in c.kept and axis in own and cell[1][own[axis]] == c.leader[1][d]:
                mine = likeness.axis(cell[0], own[axis])[1]
                at.append((element.place_of(element.loops[own[axis]]), mine.minus(offset)))
            else:
                at.append((None, first[d].first))
        leads = cell == c.leader and not _has_tied_elements(cell, likeness)
        kept = tuple(at[k] for k in c.kept)
        box = _box_of_indices(element, likeness.box(cell))
        yield SeriesMember(element, box, sign * c.sign, name, kept, leader, tuple(at), leads)


def _fewer(members: Sequence[SeriesMember]) -> Iterable[SeriesMember]:
    """Members that say the same of neighbouring boxes made one."""
    groups: dict[tuple[object, ...], list[SeriesMember]] = {}
    for m in members:
        at = tuple((k, c.value) for k, c in (*m.index, *m.leader_index))
        groups.setdefault((m.element.number, m.sign, m.coordinate, at, m.leads), []).append(m)
    for same in groups.values():
        m = same[0]
        for box in union([s.box for s in same]):
            yield replace(m, box=box)
