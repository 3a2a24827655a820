"""The branch graph by index classes: branches with their ranges, and common-effort nodes with what touches them.

A node family is cut where the reach of a terminal begins or ends; in each box so made every node is touched by the same
branches, so its degree is known (language, 8.5).  A family that terminals reach by a table of indices is one cell; such
families are connected in themselves (`alike_elements.py`).  A domain's ground is a node without indices.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from sysdyn.compiler.network.primal.bounds import (
    Affine,
    Box,
    Interval,
    Picked,
    WholeNumber,
    WholeNumbers,
    between,
    box_holds,
    box_size,
)
from sysdyn.dsl.model.expression import Node, index, sub
from sysdyn.dsl.model.network import Branch, Domain, Loop, Network, NodeFamily, Terminal
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place
from sysdyn.values import dataclass

PLUS, MINUS = 0, 1


@dataclass(frozen=True, slots=True)
class BranchEnd:
    """One end of a branch at a node: the flow leaves the node at plus and enters it at minus."""

    node: str  # family, or the ground's name
    at: tuple[Affine | Picked, ...]


@dataclass(frozen=True, slots=True)
class BranchElement:
    """A branch statement: ranges of its loops, indices of its name, contacts (none where it stands `on`)."""

    number: int
    branch: Branch
    loops: tuple[str, ...]
    box: Box
    at: tuple[Affine, ...]
    ends: tuple[BranchEnd, ...]

    @property
    def name(self) -> str:
        """The family's name."""
        return self.branch.name

    @property
    def ranges(self) -> dict[str, Interval]:
        """Range of each loop variable."""
        return dict(zip(self.loops, self.box, strict=True))

    @property
    def named(self) -> Box:
        """The box of the indices of its name."""
        return tuple(a.over(self.ranges) for a in self.at)

    def loops_at(self, at: tuple[Node, ...]) -> dict[str, Node]:
        """Loop variables of the element whose name has these indices."""
        pairs = zip(self.at, at, strict=True)
        return {a.loop: sub(node, a.offset.node) for a, node in pairs if a.loop is not None}

    def place_of(self, loop: str) -> int:
        """The index of the name that a loop variable runs along."""
        return next(k for k, a in enumerate(self.at) if a.loop == loop)


@dataclass(frozen=True, slots=True)
class Touch:
    """A branch end that touches every node of a cell; `free`: loop variables along which many branches touch it."""

    element: BranchElement
    end: int
    free: tuple[str, ...]

    @property
    def contact(self) -> BranchEnd:
        """Its terminal."""
        return self.element.ends[self.end]

    def loops_at(self, at: tuple[Node, ...]) -> dict[str, Node]:
        """Loop variables of the branch that touches the node with these indices."""
        pairs = zip(self.contact.at, at, strict=True)
        return {a.loop: sub(node, a.offset.node) for a, node in pairs if a.loop is not None}


@dataclass(frozen=True, slots=True)
class NodeCell:
    """Nodes of one family that the same branches touch; scattered: ends of branches that touch any of them."""

    node: str
    domain: Domain
    box: Box
    touches: tuple[Touch, ...]
    place: Place
    scattered: tuple[tuple[BranchElement, int], ...] = ()

    @property
    def degree(self) -> int:
        """Number of branch ends at each of them, on the average of what is scattered."""
        ends = sum(box_size(e.box) for e, _ in self.scattered)
        each = sum(box_size(tuple(t.element.ranges[name] for name in t.free)) for t in self.touches)
        return each + ends // max(box_size(self.box), 1)


def ground(domain: Domain) -> str:
    """The name of a domain's ground."""
    return f"#ground {domain.name}"


def elements(network: Network, sizes: WholeNumbers) -> tuple[BranchElement, ...]:
    """All branches with at least one element, in the order of the text."""
    return tuple(e for k, b in enumerate(network.branches) for e in _element(k, b, sizes))


def _element(number: int, branch: Branch, sizes: WholeNumbers) -> Iterator[BranchElement]:
    """A branch as a box of elements with ends, none of an empty range; E806 of ranges or indices that boxes cannot
    hold.
    """
    loops = tuple(loop.index for loop in branch.loops)
    # triangular loops
    for loop in branch.loops:
        for bound in (loop.first, loop.last):
            if sizes.affine(bound, loops, branch.place).loop is not None:
                raise unrolling_error(
                    f"the range of {branch.name} along {loop.index} follows another index", branch.place
                )
    box = tuple(sizes.interval(loop.first, loop.last, branch.place) for loop in branch.loops)
    if not box_size(box):
        return
    at = tuple(sizes.affine(node, loops, branch.place) for node in branch.at)
    # each loop numbers the branch along one index
    for name in loops:
        if sum(a.loop == name for a in at) != 1:
            raise unrolling_error(f"{branch.name} is not indexed once by {name}", branch.place)
    ends: tuple[BranchEnd, ...] = ()
    if branch.on is None:
        pair = (branch.plus, branch.minus)
        ends = tuple(_contact(t, branch, loops, sizes) for t in pair if t is not None)
    yield BranchElement(number, branch, loops, box, at, ends)


def _contact(terminal: Terminal, branch: Branch, loops: tuple[str, ...], sizes: WholeNumbers) -> BranchEnd:
    name = ground(branch.domain) if terminal.node is None else terminal.node
    at = tuple(sizes.index(node, loops, branch.place) for node in terminal.at)
    used = [a.loop for a in at if a.loop is not None]
    if len(used) != len(set(used)):
        raise unrolling_error(f"{branch.name} meets node {name} along a diagonal", branch.place)
    return BranchEnd(name, at)


def unrolling_error(what: str, place: Place | None) -> ModelError:
    """E806: a pattern that index classes cannot hold."""
    return ModelError([Diagnostic("E806", f"{what}: it would have to be unrolled", place)])


class Incidence:
    """The common-effort nodes of a network in cells."""

    def __init__(self, network: Network, sizes: WholeNumbers) -> None:
        self.elements = elements(network, sizes)
        self.families = {n.name: n for n in network.nodes}
        self.boxes: dict[str, Box] = {}
        self.cells: dict[str, tuple[NodeCell, ...]] = {}
        self.sizes = sizes
        self._contacts: dict[str, list[tuple[BranchElement, int, BranchEnd]]] = {}
        # ends by node
        for e in self.elements:
            for k, c in enumerate(e.ends):
                self._contacts.setdefault(c.node, []).append((e, k, c))
        for family in network.nodes:
            if family.domain.common == "effort":
                self._add(family.name, family, sizes.box(family.shape, family.place))
        # the ground of each domain as a node
        for domain in dict.fromkeys(e.branch.domain for e in self.elements if e.branch.domain.common == "effort"):
            if ground(domain) in self._contacts:
                self._add(ground(domain), NodeFamily(ground(domain), (), domain, domain.place), ())

    def _add(self, name: str, family: NodeFamily, box: Box) -> None:
        """Enter a family of nodes: its box, cut into cells that are touched alike; E805 of an end outside."""
        self.boxes[name] = box
        reaches = [(e, k, tuple(a.over(e.ranges) for a in c.at)) for e, k, c in self._contacts.get(name, ())]
        for e, _, reach in reaches:
            if not box_holds(box, reach):
                at = ", ".join(f"{i.first.value}..{i.last.value}" for i in reach)
                text = f"{e.name} meets {name}[{at}], outside its range"
                raise ModelError([Diagnostic("E805", text, e.branch.place)])
        # indices by a table: which elements are touched is not cut apart
        if any(isinstance(a, Picked) for _, _, c in self._contacts.get(name, ()) for a in c.at):
            ends = tuple((e, k) for e, k, _ in reaches)
            self.cells[name] = (NodeCell(name, family.domain, box, (), family.place, ends),)
            return
        sides: list[list[Interval]] = []
        # cuts along each dimension where an element begins or ends
        for d, whole in enumerate(box):
            cuts: dict[int, WholeNumber] = {}
            for interval in (whole, *(reach[d] for _, _, reach in reaches)):
                for cut in (interval.first, interval.last.plus(1)):
                    cuts.setdefault(cut.value, cut)
            sides.append(between(cuts))
        found = []
        # cells that nothing touches are left out
        for part in itertools.product(*sides):
            touches = tuple(_touch(e, k) for e, k, reach in reaches if box_holds(reach, part))
            if touches:
                found.append(NodeCell(name, family.domain, part, touches, family.place))
        self.cells[name] = tuple(found)

    def all_cells(self) -> Iterator[NodeCell]:
        """Every cell."""
        return (cell for cells in self.cells.values() for cell in cells)


def _touch(element: BranchElement, end: int) -> Touch:
    used = {a.loop for a in element.ends[end].at}
    return Touch(element, end, tuple(name for name in element.loops if name not in used))


def counters(box: Box) -> tuple[str, ...]:
    """Names of loop variables over a box."""
    return tuple(f"#k{d}" for d in range(len(box)))


def indices(box: Box) -> tuple[Node, ...]:
    """The loop variables over a box."""
    return tuple(index(name) for name in counters(box))


def loops_over(box: Box) -> tuple[Loop, ...]:
    """The loops over a box."""
    return tuple(Loop(name, i.first.node, i.last.node) for name, i in zip(counters(box), box, strict=True))


def ranges_over(box: Box) -> dict[str, Interval]:
    """The ranges of the loop variables over a box."""
    return dict(zip(counters(box), box, strict=True))
