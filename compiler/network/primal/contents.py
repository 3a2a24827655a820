"""Initial conditions of a network as those of its coordinates; stores whose contents these do not tell alone.

Contents of potential stores, and other displacements that something reads (a memristor's charge), are c = B x + k: x
the coordinates, which are one choice of tree; k one constant for each beside it (language, section 11, 11), a parameter
`branch.content` where the text tells it, else a dynamic variable of rate zero, which the start chooses.

In a series class the first potential store is the coordinate.  Another one holds q = +-q(class) + k, with k its own
initial content less +- that of the first; it is chosen where not all of these are fixed and a loop of stores and
efforts, or what is said of anything else (a resistor, an effort of e = q + q^3), may ask for others.  What is no store
begins at what the text says of it, else at zero, whatever the first store holds.  A store between two nodes of the
reflection (an inductor) holds their difference: where such stores may close loops each has its own initial content as k
where the text fixes it, else it is chosen.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal import overlaps
from sysdyn.compiler.network.primal.bounds import Box, Interval, WholeNumbers, box_difference, box_size, shape_of, union
from sysdyn.compiler.network.primal.choices import own
from sysdyn.compiler.network.primal.cycles import in_loops
from sysdyn.compiler.network.primal.incidence import (
    PLUS,
    BranchElement,
    Incidence,
    NodeCell,
    Touch,
    counters,
    indices,
    loops_over,
    ranges_over,
)
from sysdyn.compiler.network.primal.integrals import line
from sysdyn.compiler.network.primal.laws import Laws
from sysdyn.compiler.network.primal.overlaps import initially, inside, meeting, ranges_of, restrict_loops, untold
from sysdyn.compiler.network.primal.reading import Ranges, Rewriter, touches_network
from sysdyn.compiler.network.primal.series import SeriesMember
from sysdyn.dsl.model.expression import (
    Node,
    const,
    index,
    is_const,
    neg,
    scale,
    sub,
    substitute,
    topological,
    var,
    variables,
)
from sysdyn.dsl.model.network import Branch, Dynamic, InitialCondition, Loop, Network, Parameter, State

TELLING = {"potential": ("be", "bq"), "kinetic": ("bf", "bp")}
"""What tells what a store holds: by its law its effort or flow, and its displacement or momentum itself."""


def held_at(branch: Branch, kind: str, value: Node) -> Node | None:
    """What a store over its own loops holds where its content, effort or flow is the value; None where no law tells."""
    if kind in ("bq", "bp"):
        return value
    given, held = TELLING.get(branch.kind, ("", ""))
    if kind != given or branch.law is None:
        return None
    if branch.side == held[1]:
        of = own(branch, given)
        return None if variables(branch.law) - {of} else substitute(branch.law, {of: value})
    content = own(branch, held)
    straight = None if variables(branch.law) - {content} else line(branch.law, content)
    return None if straight is None else straight.inverse(value)


def contents_by_text(
    b: Branch, initials: Iterable[InitialCondition], sizes: WholeNumbers
) -> Iterator[tuple[InitialCondition, tuple[Loop, ...], Node]]:
    """Of statements about a branch those that tell what elements of it hold, the loops over these, what they hold."""
    within = ranges_of(b.loops, sizes, b.place)
    for initial in initials:
        found = meeting(initial, b.at, within, sizes)
        content = None if found is None else held_at(b, initial.target.data[1], found[1])
        if found is not None and content is not None:
            yield initial, restrict_loops(b.loops, found[0]), content


def at_stores(
    network: Network, said: Laws, incidence: Incidence, reader: Rewriter, *, reflected: bool
) -> Iterator[InitialCondition]:
    """Initial conditions; efforts of potential stores, and of nodes that a linear one holds to ground, as contents, but
    for those that hold the same at any effort; fixed efforts that are unknowns as efforts too, for at the start the
    store may hold nothing.
    """
    kinds = {b.name: b.kind for b in network.branches}
    for initial in network.initials:
        told = initial.target.op == "var" and not initial.target.data[2]
        name, kind, _ = initial.target.data if told else ("", "", 0)
        if kind == "ne":
            for part in _at_store(initial, incidence.cells.get(name, ()), reader):
                yield from _as_content(part, said, reader)
            continue
        apart = kind in ("be", "bf") and kinds[name] not in TELLING
        if kind == "nf" and reflected:
            apart = not any(_holds(touch) for cell in incidence.cells.get(name, ()) for touch in cell.touches)
        yield from _as_content(replace(initial, apart=apart and not initial.fixed), said, reader)


def _as_content(initial: InitialCondition, said: Laws, reader: Rewriter) -> Iterator[InitialCondition]:
    """Where a law tells it, what the store holds at the effort."""
    target = initial.target
    # what is said of anything but an effort, by a number
    if target.op != "var" or target.data[1:] != ("be", 0) or variables(initial.value):
        yield initial
        return
    mark = index("#v")  # the value is over the statement's own loops: put in after the law's were replaced

    def content(ranges: Ranges) -> tuple[Node | None, bool]:
        piece = reader.piece(target.data[0], target.args, ranges)
        branch = piece.element.branch
        found = None if branch in said.constant else held_at(branch, "be", mark)
        # the law does not tell the content
        if found is None:
            return None, True
        value = substitute(reader.at_piece(found, piece, target.args), {mark: initial.value})
        return value, initial.fixed and branch in said.implicit

    for loops, (value, effort) in reader.cut(initial.loops, initial.place, content):
        # the content, and the effort beside it where the law is implicit
        if value is not None:
            yield replace(initial, target=var(target.data[0], "bq", *target.args), value=value, loops=loops)
        if effort:
            yield replace(initial, loops=loops)


def _at_store(initial: InitialCondition, cells: Sequence[NodeCell], reader: Rewriter) -> Iterator[InitialCondition]:
    """Initial efforts of nodes as those of stores between the node and ground, element by element."""
    node = initial.target

    boxes: dict[Touch | None, list[Box]] = {}
    # elements of the family by the store that each has
    for cell in cells:
        touch = next((t for t in cell.touches if _between_ground(t)), None)
        boxes.setdefault(touch, []).append(cell.box)
    places = [(box, touch) for touch, found in boxes.items() for box in union(found)]

    def store(ranges: Ranges) -> Touch | None:
        return places[reader.locate(node.data[0], node.args, [box for box, _ in places], ranges)][1]

    for loops, touch in reader.cut(initial.loops, initial.place, store):
        # no store to ground: the effort itself is said
        if touch is None:
            yield replace(initial, loops=loops)
            continue
        at = touch.loops_at(node.args)
        target = var(touch.element.name, "be", *(a.substitute_loops(at) for a in touch.element.at))
        value = initial.value if touch.end == PLUS else neg(initial.value)
        yield replace(initial, target=target, value=value, loops=loops)


def _ends_at_ground(touch: Touch) -> bool:
    """Whether an element's other end is the ground."""
    return touch.element.ends[1 - touch.end].node.startswith("#ground ")


def _between_ground(touch: Touch) -> bool:
    told = held_at(touch.element.branch, "be", const(1.0)) is not None
    return not touch.free and _ends_at_ground(touch) and told


def _holds(touch: Touch) -> bool:
    """Whether a kinetic store stands there between a node and the ground."""
    return touch.element.branch.kind == "kinetic" and (len(touch.element.ends) < 2 or _ends_at_ground(touch))


class Contents:
    """Initial contents of potential stores: constants of followers, and the initial conditions that remain."""

    def __init__(
        self,
        reader: Rewriter,
        members: Sequence[SeriesMember],
        initials: Sequence[InitialCondition],
        elements: Sequence[BranchElement],
        *,
        reflected: bool,
        read: frozenset[str] = frozenset(),
    ) -> None:
        """read: branches whose displacement a statement reads."""
        self.reader = reader
        self.initials = initials
        joining = [(e, e.branch.kind, e.branch.domain.common) for e in elements if len(e.ends) == 2]
        # a branch of its own law may be a wire: an ideal diode, a switch
        # stores and sources that may close a loop: their contents are not free
        series = [e for e, kind, common in joining if common == "effort" and kind in ("potential", "effort", "field")]
        between = [e for e, kind, common in joining if reflected and common == "flow" and kind == "potential"]
        both = [*series, *between]
        looped = in_loops([(e.ends[0].node, e.ends[1].node, box_size(e.box)) for e in both])
        self.looped = {both[k].number for k in looped}
        self.parameters: list[Parameter] = []
        self.states: list[State] = []
        self.dynamics: list[Dynamic] = []
        self._given: dict[str, list[tuple[InitialCondition, Box]]] = {}
        self._stems: list[str] = []
        self._led: dict[int, BranchElement] = {}  # followers that are no stores: what they begin at is no guess
        kinetic = {e.name for e in elements if e.branch.kind == "kinetic"}
        self._loose = any(  # what is said of others may ask for contents
            not _is_content(i) and not _of_momenta(i, kinetic) for i in initials
        )
        # what is said of contents, by branch, with the elements it is said of
        for initial in filter(_is_content, initials):
            within = ranges_of(initial.loops, reader.sizes, initial.place)
            box = reader.sizes.reach(initial.target.args, within, initial.place)
            self._given.setdefault(initial.target.data[0], []).append((initial, box))
        followers: dict[int, list[SeriesMember]] = {}
        begin = [m for m in members if m.element.branch.kind == "potential" or m.element.name in {*read, *self._given}]
        alike: dict[str, set[int]] = {}
        # members of one coordinate: the first leads, others follow from it
        for m in begin:
            alike.setdefault(m.coordinate, set()).add(m.element.number)
        for m in begin:
            if not m.leads and (m.element.branch.kind == "potential" or len(alike[m.coordinate]) > 1):
                followers.setdefault(m.element.number, []).append(m)
        for group in followers.values():
            self._follower(group[0].element, group)
        # of the reflection, stores of a loop begin at what is said of them
        for e in between:
            if e.number in self.looped and e.branch.law is not None:
                value = self.start(e.name, indices(e.named), ranges_over(e.named))
                self._constant(e, value if self._is_fixed(e, e.named) else None)

    def start(self, name: str, at: tuple[Node, ...], within: overlaps.Ranges) -> Node:
        """The initial content of a store: what the statement about it says, else 0."""
        given = [initial for initial, _ in self._given.get(name, ())]
        return initially(given, at, within, self.reader.sizes) or const(0.0)

    def _follower(self, element: BranchElement, members: Sequence[SeriesMember]) -> None:
        """The constant of stores in series with others, unless it is zero by the text."""
        at, whole = indices(element.named), ranges_over(element.named)
        value: Node = const(0.0)
        for m in members:
            part = dict(zip(whole, m.box, strict=True))
            first = self.start(m.leader.name, m.leader_at(at), part)
            value = inside(part, whole, sub(self.start(element.name, at, part), scale(m.sign, first)), value)
        if element.branch.kind != "potential":
            self._led[element.number] = element
        sought = self._loose or self.looped & {element.number, *(m.leader.number for m in members)}
        fixed = all(self._is_fixed(element, m.box) and self._is_fixed(m.leader, _led_by(m)) for m in members)
        self._constant(element, value if fixed or not sought else None)

    def _constant(self, element: BranchElement, value: Node | None) -> None:
        """A parameter of that value over the element's indices, none for zero; chosen by the start where None."""
        if value is not None and is_const(value, 0.0):
            return
        box, place = element.named, element.branch.place
        self._stems.append(f"{element.name}.content")
        name, number = self._stems[-1], self._stems.count(self._stems[-1])
        name = name if number == 1 else f"{name}.{number}"
        unit, shape = element.branch.domain.displacement, shape_of(box)
        self.reader.book.contents[element.number] = name, value is not None
        if value is not None:
            self.parameters.append(Parameter(name, shape, unit, (value,), counters(box), place))
        else:
            self.states.append(State(name, shape, unit, place))
            self.dynamics.append(Dynamic(var(name, "s", *indices(box)), const(0.0), loops_over(box), place))

    def _is_fixed(self, element: BranchElement, box: Box) -> bool:
        """Whether the text fixes the contents of all these elements; of what is no store it does, if only at zero."""
        given = self._given.get(element.name, ())
        return element.branch.kind != "potential" or not box_difference(box, *(said for i, said in given if i.fixed))

    # -- initial conditions -------------------------------------------------------------------------------------

    def initial_conditions(self, measured: Container[str]) -> Iterator[InitialCondition]:
        """The initial conditions of coordinates and other unknowns; measured: stores whose guesses stand elsewhere."""
        known: set[tuple[Node, Node, tuple[Loop, ...], bool]] = set()
        for initial in (*self.initials, *self._follower_initials()):
            # a guess of a store that is measured elsewhere
            if not initial.fixed and initial.target.op == "var" and initial.target.data[0] in measured:
                continue
            # of states and coordinates: as it stands
            if not touches_network(initial.target) and not touches_network(initial.value):
                yield initial
                continue
            # of nodes and branches: piece by piece
            for loops, found in self.reader.cut(
                initial.loops,
                initial.place,
                lambda ranges, i=initial: self._one(i, ranges),  # type: ignore[misc]
            ):
                if found is None:
                    continue
                target, value = found
                # stores of a class have one coordinate, of which the same is said once
                over = topological((target, value, *(end for loop in loops for end in (loop.first, loop.last))))
                own = tuple(loop for loop in loops if index(loop.index) in over)
                if (said := (target, value, own, initial.fixed)) not in known:
                    known.add(said)
                    yield replace(initial, target=target, value=value, loops=own)

    def _follower_initials(self) -> Iterator[InitialCondition]:
        """What followers that are no stores begin at."""
        for e in self._led.values():
            b, given = e.branch, [initial for initial, _ in self._given.get(e.name, ())]
            within = ranges_of(b.loops, self.reader.sizes, b.place)
            zero = InitialCondition(var(e.name, "bq", *b.at), const(0.0), True, b.loops, b.place, said=False)
            for ranges in untold(given, b.at, within, self.reader.sizes):
                yield replace(zero, loops=restrict_loops(b.loops, ranges))

    def _one(self, initial: InitialCondition, ranges: Ranges) -> tuple[Node, Node] | None:
        """Where one piece is read: target and value; of stores whose constant is told the coordinate of their class;
        None where a constant says it.
        """
        target = initial.target
        if _is_content(initial):
            piece = self.reader.piece(target.data[0], target.args, ranges)
            m, (_, fixed) = piece.member, self.reader.book.contents.get(piece.element.number, ("", True))
            if fixed and piece.element.number in self._led:
                return None  # by its constant
            if m is not None and fixed and piece.element.branch.kind == "potential":
                q = var(m.coordinate, "q", *m.indices(target.args))
                if m.leads and len(m.index) == len(target.args):
                    return q, initial.value
                within = {name: r.interval for name, r in ranges.items()}
                return q, self.start(m.leader.name, m.leader_at(target.args), within)
        new, value = (self.reader.resolve(node, ranges) for node in (target, initial.value))
        return (new, value) if variables(value) else _pin(new, value)


def _is_content(initial: InitialCondition) -> bool:
    """Whether a statement tells a displacement of a branch by itself."""
    return initial.target.op == "var" and initial.target.data[1:] == ("bq", 0) and not variables(initial.value)


def _of_momenta(initial: InitialCondition, kinetic: Container[str]) -> bool:
    """Whether a statement tells the flow or the momentum of a node, or of one of these branches, by itself."""
    target = initial.target
    plain = target.op == "var" and not target.data[2] and not variables(initial.value)
    return plain and (target.data[1] in ("nf", "np") or (target.data[1] in ("bf", "bp") and target.data[0] in kinetic))


def _pin(target: Node, value: Node) -> tuple[Node, Node]:
    """An equation that is linear in one unknown as that unknown's value."""
    unknowns = [n for n in variables(target) if n.op == "var"]
    if len(unknowns) == 1 and not variables(target) - set(unknowns):
        straight = line(target, unknowns[0])
        if straight is not None:
            return unknowns[0], straight.inverse(value)
    return target, value


def _led_by(m: SeriesMember) -> Box:
    """The elements of the leader that a member follows."""
    pairs = ((None if k is None else m.box[k], c) for k, c in m.leader_index)
    return tuple(Interval(c, c) if i is None else i.plus(c) for i, c in pairs)
