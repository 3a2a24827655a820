"""Rule P3: node constraints, one for each common-effort node that was not merged, except a reference per component.

    psi node[at]: sum of the flows into the node = 0

so that the multiplier is the node's effort against the reference: e = multiplier(plus) - multiplier(minus).  Connected
components are found by `index_classes`; where copies of a component stand along an index, each has a reference.
The effort of a node is read from its multiplier, is zero at a reference, and is found along the series class elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.compiler.network.primal.bounds import (
    Box,
    Interval,
    WholeNumber,
    box_difference,
    box_holds,
    number,
    parts,
    union,
)
from sysdyn.compiler.network.primal.incidence import (
    MINUS,
    BranchElement,
    BranchEnd,
    Incidence,
    NodeCell,
    ground,
    indices,
    loops_over,
    unrolling_error,
)
from sysdyn.compiler.network.primal.index_classes import Cell, IndexClasses, Link, LinkEnd
from sysdyn.dsl.model.expression import Node, index, linear, reduction, scale, var
from sysdyn.dsl.model.network import Constraint
from sysdyn.values import dataclass

MULTIPLIER, ZERO, WALK = "multiplier", "zero", "walk"


@dataclass(frozen=True, slots=True)
class NodeEffort:
    """How the effort of the nodes of a box is read: the multiplier of `label`, zero, or a walk from `cell`.

    `ground`: the name of the ground that is not the reference of the component, so that its effort is subtracted.
    """

    node: str
    box: Box
    how: str
    label: str
    cell: NodeCell
    ground: str | None


@dataclass(frozen=True, slots=True)
class Balances:
    """Node constraints (their flows still those of branches) and how efforts are read."""

    constraints: tuple[Constraint, ...]
    efforts: tuple[NodeEffort, ...]


class _Components:
    """Connected components of the branch graph by index classes."""

    def __init__(self, incidence: Incidence) -> None:
        self.names = list(incidence.boxes)
        self.number = {name: k for k, name in enumerate(self.names)}
        branches = [e for e in incidence.elements if len(e.ends) == 2 and all(c.node in self.number for c in e.ends)]
        cuts = [
            (self.number[cell.node], d, bound)
            for cell in incidence.all_cells()
            for d, interval in enumerate(cell.box)
            for bound in (interval.first, interval.last.plus(1))
        ]
        boxes = [incidence.boxes[name] for name in self.names]
        self.tied = {cell.node: cell.box for cell in incidence.all_cells() if cell.scattered}
        links = [Link(e.box, self._end(e, e.ends[0]), self._end(e, e.ends[1])) for e in branches]
        self.likeness = IndexClasses(boxes, [*links, *(self._tie(*item) for item in self.tied.items())], cuts)
        self._check_links(branches, links)

    def _tie(self, name: str, box: Box) -> Link:
        """Nodes that a table of indices reaches belong together: neighbours do."""
        (whole,) = box
        one, other = (LinkEnd(self.number[name], ((0, number(k)),)) for k in (0, 1))
        return Link((Interval(whole.first, whole.last.minus(1)),), one, other)

    def _end(self, element: BranchElement, contact: BranchEnd) -> LinkEnd:
        if contact.node in self.tied:
            return LinkEnd(self.number[contact.node], ((None, self.tied[contact.node][0].first),))
        at: list[tuple[int | None, WholeNumber]] = [
            (None if a.loop is None else element.loops.index(a.loop), a.offset) for a in contact.at
        ]
        return LinkEnd(self.number[contact.node], tuple(at))

    def _check_links(self, branches: Sequence[BranchElement], links: Sequence[Link]) -> None:
        """What could not be followed does no harm where both ends are connected to ground anyway."""
        bad = {link.a for link in self.likeness.refused} | {link.b for link in self.likeness.refused}
        for element, link in zip(branches, links, strict=True):
            refused = any(link.a.item == r.a.item and link.b.item == r.b.item for r in self.likeness.refused)
            if bad and refused and not all(self._is_grounded(end.item) for end in (link.a, link.b)):
                raise unrolling_error(f"what node {element.ends[0].node} is connected to", element.branch.place)

    def _is_grounded(self, item: int) -> bool:
        grounds = {self.likeness.find((k, ()))[0] for k, name in enumerate(self.names) if name.startswith("#ground ")}
        return all(self.likeness.find(cell)[0] in grounds for cell in self.likeness.cells(item))

    def groups(self) -> Iterator[list[Cell]]:
        """The cells of each component (or of its copies along an index)."""
        for members in self.likeness.groups().values():
            yield [cell for cell, _ in members]


def balances(incidence: Incidence, merged: Sequence[NodeCell]) -> Balances:
    """Node constraints and the reading of efforts."""
    components = _Components(incidence)
    known = {id(cell) for cell in merged}
    rows: list[tuple[NodeCell, Box, str | None]] = []
    still: list[NodeEffort] = []
    for cells in components.groups():
        held = [(c, node) for c in cells if (node := _node(components, incidence, c)) is not None]
        if not held:
            continue
        own, floating = _split(held, components, known)
        rows += own
        still += floating
    rows = _merge_boxes(rows)
    labels = parts([(cell.node, box) for cell, box, _ in rows])
    efforts = [
        NodeEffort(cell.node, box, MULTIPLIER, label.name, cell, gauge)
        for (cell, box, gauge), label in zip(rows, labels, strict=True)
    ]
    constraints = [row for e in efforts for row in _rows(e, incidence)]
    return Balances(tuple(constraints), tuple(_fewer([*efforts, *still])))


def _node(components: _Components, incidence: Incidence, cell: Cell) -> NodeCell | None:
    name, box = components.names[cell[0]], components.likeness.box(cell)
    return next((c for c in incidence.cells[name] if box_holds(c.box, box)), None)


Held = tuple[Cell, NodeCell]


def _split(
    held: list[Held], components: _Components, merged: set[int]
) -> tuple[list[tuple[NodeCell, Box, str | None]], list[NodeEffort]]:
    """Rows of one component, and how the efforts of its other nodes are read."""
    like = components.likeness
    free = [(c, node) for c, node in held if id(node) not in merged]
    earth = next(((c, node) for c, node in held if node.node == ground(node.domain)), None)
    # one node of the component is the reference: its balance is the sum of the others
    base = _reference(free, held, earth, merged)
    corner = _corner(base[0], like)
    gauge = None if earth is None or earth is base else earth[1].node
    rows: list[tuple[NodeCell, Box, str | None]] = []
    still: list[NodeEffort] = []
    # the reference has an effort of zero, merged nodes are read along their class, others have a row
    for cell, node in held:
        box = like.box(cell)
        if (cell, node) == base:
            still.append(NodeEffort(node.node, corner, ZERO, "", node, gauge))
            if id(node) in merged:
                still += [NodeEffort(node.node, rest, WALK, "", node, gauge) for rest in box_difference(box, corner)]
            else:
                rows += [(node, rest, gauge) for rest in box_difference(box, corner)]
        elif id(node) in merged:
            still.append(NodeEffort(node.node, box, WALK, "", node, gauge))
        else:
            rows.append((node, box, gauge))
    return rows, still


def _reference(free: list[Held], held: list[Held], earth: Held | None, merged: set[int]) -> Held:
    """Ground if it is in the component and not merged, else the node of highest degree; in a closed class any node."""
    if earth is not None and id(earth[1]) not in merged:
        return earth
    if free:
        return max(free, key=lambda h: h[1].degree)
    return earth or next(iter(held))


def _corner(cell: Cell, like: IndexClasses) -> Box:
    """One node of each copy of a component: indices along which the nodes are tied together at their first value."""
    loose = {d for d, _, _ in like.free_dimensions(cell)}
    return tuple(i if d in loose else Interval(i.first, i.first) for d, i in enumerate(like.box(cell)))


def _merge_boxes(rows: list[tuple[NodeCell, Box, str | None]]) -> list[tuple[NodeCell, Box, str | None]]:
    """Boxes of one cell made as few as possible."""
    groups: dict[tuple[int, str | None], list[tuple[NodeCell, Box]]] = {}
    for cell, box, gauge in rows:
        groups.setdefault((id(cell), gauge), []).append((cell, box))
    return [(same[0][0], box, gauge) for (_, gauge), same in groups.items() for box in union([box for _, box in same])]


def _fewer(efforts: Sequence[NodeEffort]) -> Iterator[NodeEffort]:
    """Neighbouring boxes that are read alike as one."""
    groups: dict[tuple[str, str, str, str | None, int], list[NodeEffort]] = {}
    for e in efforts:
        key = (e.node, e.how, e.label, e.ground, id(e.cell) if e.how == WALK else 0)
        groups.setdefault(key, []).append(e)
    for same in groups.values():
        for box in union([e.box for e in same]):
            yield NodeEffort(same[0].node, box, same[0].how, same[0].label, same[0].cell, same[0].ground)


def _rows(effort: NodeEffort, incidence: Incidence) -> Iterator[Constraint]:
    """The sum of flows into each node of the box, and what scattered ends add to it."""
    cell = effort.cell
    yield _row(effort)
    if cell.scattered and effort.box != incidence.boxes[cell.node]:
        raise unrolling_error(f"which node of {cell.node} the others are counted from", cell.place)
    for element, end in cell.scattered:
        here = {name: index(name) for name in element.loops}
        at = tuple(a.substitute_loops(here) for a in element.ends[end].at)
        flow = scale(
            1.0 if end == MINUS else -1.0, var(element.name, "bf", *(a.substitute_loops(here) for a in element.at))
        )
        unit, loops = cell.domain.flow, element.branch.loops
        yield Constraint("psi", effort.label, at, flow, loops, unit, cell.place, adds=True)


def _row(effort: NodeEffort) -> Constraint:
    """The sum of flows into each node of the box from the ends that touch all of them."""
    at = indices(effort.box)
    terms: list[tuple[float, Node]] = []
    for touch in effort.cell.touches:
        loops = touch.loops_at(at)
        ranges = touch.element.ranges
        flow_at = loops | {name: index(f"#s {name}") for name in touch.free}
        flow = var(touch.element.name, "bf", *(a.substitute_loops(flow_at) for a in touch.element.at))
        for name in reversed(touch.free):
            flow = reduction("sum", f"#s {name}", ranges[name].first.node, ranges[name].last.node, flow)
        terms.append((1.0 if touch.end == MINUS else -1.0, flow))
    loops_ = loops_over(effort.box)
    unit = effort.cell.domain.flow
    return Constraint("psi", effort.label, at, linear(0.0, terms), loops_, unit, effort.cell.place)
