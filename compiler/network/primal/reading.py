"""Quantities of branches and nodes replaced by coordinates, multipliers and implicit unknowns.

A family may be cut into pieces that read differently.  Where an index runs over several pieces, `resolve` raises
`_BoxSplitError` with the cut, and whoever owns the loop (a statement or a sum) cuts it there and begins again.  Bounds
stay symbolic, so a statement becomes as many loops as there are pieces, whatever their size.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import TypeVar

from sysdyn.compiler.network.primal.bounds import Affine, Box, Interval, Picked, WholeNumber, WholeNumbers, box_holds
from sysdyn.compiler.network.primal.incidence import BranchElement, BranchEnd, unrolling_error
from sysdyn.compiler.network.primal.series import SeriesMember
from sysdyn.dsl.model.calculus import time_derivative
from sysdyn.dsl.model.expression import (
    Node,
    add,
    combine_terms,
    const,
    index,
    linear,
    param,
    rebuild,
    reduction,
    scale,
    sub,
    substitute,
    topological,
    topological_unbound,
    var,
    variables,
)
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import Loop
from sysdyn.dsl.model.paynter import EFFORT_CLASSES, STATE_FUNCTIONS
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place
from sysdyn.values import dataclass

Result = TypeVar("Result")
FUNCTIONS = frozenset(f"b{name}" for name in STATE_FUNCTIONS)
"""State functions of branches."""
CLASSES = frozenset(f"n:{name}" for name in EFFORT_CLASSES)
"""Efforts by class at common-flow nodes."""
KINDS = frozenset(("be", "bf", "bq", "bp", "ne", "nf", "nq", "np")) | FUNCTIONS | CLASSES


@dataclass(frozen=True, slots=True)
class LoopRange:
    """The values of a loop variable; one whose bounds follow another index cannot be cut."""

    interval: Interval
    cuttable: bool = True


Ranges = Mapping[str, LoopRange]


class _BoxSplitError(Exception):
    """An index runs over two pieces: its loop is to be cut before `at`."""

    def __init__(self, loop: str, at: WholeNumber, name: str) -> None:
        super().__init__(loop)
        self.loop, self.at, self.name = loop, at, name


@dataclass(frozen=True, slots=True)
class IndexBox:
    """Branches of a family that read alike."""

    box: Box
    element: BranchElement
    member: SeriesMember | None = None


@dataclass(slots=True)
class EliminationTable:
    """All that is needed to read: pieces by family, efforts and momenta by element, contents by element.

    A content is the name of a constant, and whether that is a parameter.  functions: state functions by name.
    """

    pieces: dict[str, list[IndexBox]]
    efforts: dict[int, Node]
    momenta: dict[int, Node]
    nodes: Callable[[Rewriter, Node, Ranges, tuple[Node, ...]], Node]
    contents: dict[int, tuple[str, bool]] = field(default_factory=dict)
    functions: dict[int, dict[str, Node]] = field(default_factory=dict)
    sticking: dict[str, tuple[str, ...]] = field(default_factory=dict)  # labels of what holds the branches of a family


def touches_network(root: Node) -> bool:
    """Whether a quantity of a branch or node occurs."""
    return any(n.op == "var" and n.data[1] in KINDS for n in variables(root))


class Rewriter:
    """Resolves expressions of one network."""

    def __init__(self, sizes: WholeNumbers, book: EliminationTable) -> None:
        self.sizes = sizes
        self.book = book
        self.place: Place | None = None
        self._serial = itertools.count()

    # -- statements ---------------------------------------------------------------------------------------------

    def statement(
        self, loops: tuple[Loop, ...], roots: Sequence[Node], place: Place
    ) -> Iterator[tuple[tuple[Loop, ...], tuple[Node, ...]]]:
        """The statement's loops and expressions, cut where what they read changes."""
        if not any(touches_network(root) for root in roots):
            yield loops, tuple(roots)
            return
        yield from self.cut(loops, place, lambda ranges: tuple(self.resolve(root, ranges) for root in roots))

    def cut(
        self, loops: tuple[Loop, ...], place: Place, work: Callable[[Ranges], Result]
    ) -> Iterator[tuple[tuple[Loop, ...], Result]]:
        """What `work` finds for the ranges of the loops, which are cut until it finds one thing only."""
        self.place = place
        ranges: dict[str, LoopRange] = {}
        for loop in loops:
            ranges[loop.index] = self.range_of(loop.first, loop.last, ranges)
            if not ranges[loop.index].interval.size:
                return
        try:
            result = work(ranges)
        except _BoxSplitError as found:
            self._check(found, ranges)
            k = next(k for k, loop in enumerate(loops) if loop.index == found.loop)
            for part in _halves(loops[k], found.at):
                yield from self.cut((*loops[:k], part, *loops[k + 1 :]), place, work)
            return
        yield loops, result

    def scalar(self, root: Node, place: Place) -> Node:
        """An expression outside all loops."""
        ((_, (resolved,)),) = self.statement((), (root,), place)
        return resolved

    def _check(self, found: _BoxSplitError, ranges: Ranges) -> None:
        if found.loop not in ranges or not ranges[found.loop].cuttable:
            text = f"{found.name} changes its meaning along {found.loop}, whose range follows another index"
            raise ModelError([Diagnostic("E806", f"{text}: it would have to be unrolled", self.place)])

    def range_of(self, first: Node, last: Node, outer: Ranges) -> LoopRange:
        """The range of a loop inside others."""
        held = {name: r.interval for name, r in outer.items()}
        ends = [self.sizes.affine(node, held, self.place) for node in (first, last)]
        low, high = (a.over(held) for a in ends)
        return LoopRange(Interval(low.first, high.last), all(a.loop is None for a in ends))

    # -- expressions --------------------------------------------------------------------------------------------

    def resolve(self, root: Node, ranges: Ranges, active: tuple[Node, ...] = ()) -> Node:
        """The expression without quantities of branches and nodes."""
        if not touches_network(root):
            return root
        done: dict[Node, Node] = {}
        for node in topological_unbound([root]):
            if node.op == "var" and node.data[1] in KINDS:
                done[node] = self._read(node, ranges, active)
            elif node.op == "reduce":
                done[node] = self._rewrite_reduction(node, (done[node.args[0]], done[node.args[1]]), ranges, active)
            else:
                done[node] = rebuild(node, tuple(done[a] for a in node.args))
        return done[root]

    def _rewrite_reduction(self, node: Node, ends: tuple[Node, Node], ranges: Ranges, active: tuple[Node, ...]) -> Node:
        """A reduction whose body reads the network: rewritten, cut in two where its range runs over several boxes."""
        operator, name = node.data
        body = node.args[2]
        if not touches_network(body):
            return reduction(operator, name, *ends, body)
        own = self.range_of(*ends, ranges)
        if not own.interval.size and operator in ("sum", "prod"):
            return const(0.0 if operator == "sum" else 1.0)
        try:
            return reduction(operator, name, *ends, self.resolve(body, {**ranges, name: own}, active))
        except _BoxSplitError as found:
            if found.loop != name:
                raise
            self._check(found, {name: own})
            halves = _halves(Loop(name, *ends), found.at)
            parts = [self._rewrite_reduction(node, (h.first, h.last), ranges, active) for h in halves]
        return combine_terms(operator, parts)

    def _read(self, node: Node, ranges: Ranges, active: tuple[Node, ...]) -> Node:
        """What a variable of nodes and branches is in coordinates; E105 of a circle, E102 of a quantity that is not
        there.
        """
        if node in active:
            text = f"{node.data[0]} is defined in a circle: {to_text(node)}"
            raise ModelError([Diagnostic("E105", text, self.place)])
        name, kind, order = node.data
        inside = (*active, node)
        # a node that is a coordinate
        if kind in ("nq", "nf", "np"):
            return var(name, kind[1], *node.args, order=order)
        if kind in CLASSES:
            return var(name, f"x{kind[1:]}", *node.args)
        # derivatives of what the variable itself is
        if order:
            plain = self.resolve(var(name, kind, *node.args), ranges, active)
            return self._derivative(plain, node)
        # by potentials
        if kind == "ne":
            return self.book.nodes(self, node, ranges, inside)
        # of a branch: by the element that holds the reference
        piece = self.piece(name, node.args, ranges)
        if kind in ("bq", "bf"):
            return self._moving(node, piece, ranges, inside)
        if kind in FUNCTIONS:
            function = self.book.functions[piece.element.number][kind[1:]]
            return self.resolve(self.at_piece(function, piece, node.args), ranges, inside)
        known = self.book.efforts if kind == "be" else self.book.momenta
        if piece.element.number in known:
            found = self.resolve(self.at_piece(known[piece.element.number], piece, node.args), ranges, inside)
            held = self.book.sticking.get(name, ()) if kind == "be" else ()
            return add(found, *(var(label, "mu", *node.args) for label in held)) if held else found
        plain_ends = piece.element.ends
        # between effort nodes: the difference of potentials
        if kind == "be" and len(plain_ends) == 2 and piece.element.branch.domain.common == "effort":
            plus, minus = (self._end(c, "ne", piece, node.args) for c in plain_ends)
            return self.resolve(sub(plus, minus), ranges, inside)
        what = "effort" if kind == "be" else "momentum"
        text = f"{name} has no {what} of its own: a {piece.element.branch.kind} branch"
        raise ModelError([Diagnostic("E102", text, self.place)])

    def _derivative(self, plain: Node, node: Node) -> Node:
        try:
            return time_derivative(plain)
        except ValueError as cause:
            text = f"{to_text(node)}: the derivative of {cause} is not known"
            raise ModelError([Diagnostic("E518", text, self.place)]) from None

    def _moving(self, node: Node, piece: IndexBox, ranges: Ranges, active: tuple[Node, ...]) -> Node:
        """Displacement or flow of a branch."""
        kind, branch = node.data[1], piece.element.branch
        if branch.on is not None:
            value = self.at_piece(branch.on, piece, node.args)
            return self.resolve(value if kind == "bq" else self._derivative(value, node), ranges, active)
        if piece.member is not None:
            m = piece.member
            value = scale(m.sign, var(m.coordinate, kind[1], *m.indices(node.args)))
        else:
            ends = [self._end(c, "n" + kind[1], piece, node.args) for c in piece.element.ends]
            value = self.resolve(sub(*ends), ranges, active)
        content = self.book.contents.get(piece.element.number)
        if kind == "bf" or content is None:
            return value
        constant, fixed = content
        return add(value, param(constant, *node.args) if fixed else var(constant, "s", *node.args))

    def _end(self, contact: BranchEnd, kind: str, piece: IndexBox, at: tuple[Node, ...]) -> Node:
        """A quantity of the node at one end; that of a common-flow ground is zero."""
        if contact.node.startswith("#ground ") and kind != "ne":
            return const(0.0)
        loops = piece.element.loops_at(at)
        return var(contact.node, kind, *(a.substitute_loops(loops) for a in contact.at))

    def at_piece(self, root: Node, piece: IndexBox, at: tuple[Node, ...]) -> Node:
        """An expression over an element's loops at the indices of its name; sums inside get variables of their own."""
        change = {index(name): node for name, node in piece.element.loops_at(at).items()}
        return substitute(self._rename_loops(root), change)

    def _rename_loops(self, root: Node) -> Node:
        """An expression whose reductions have loop variables of their own, so that it can be put into others."""
        done: dict[Node, Node] = {}
        nodes = topological([root])
        if all(node.op != "reduce" for node in nodes):
            return root
        for node in nodes:
            args = tuple(done[a] for a in node.args)
            if node.op == "reduce":
                own = f"#n{next(self._serial)}"
                body = substitute(args[2], {index(node.data[1]): index(own)})
                done[node] = reduction(node.data[0], own, args[0], args[1], body)
            else:
                done[node] = rebuild(node, args)
        return done[root]

    # -- where --------------------------------------------------------------------------------------------------

    def affine(self, at: tuple[Node, ...], ranges: Ranges) -> tuple[Affine | Picked, ...]:
        """Indices as affine forms, or from tables."""
        return tuple(self.sizes.index(node, ranges.keys(), self.place) for node in at)

    def piece(self, name: str, at: tuple[Node, ...], ranges: Ranges) -> IndexBox:
        """The piece of a branch family that a reference lies in."""
        pieces = self.book.pieces.get(name, [])
        return pieces[self.locate(name, at, [p.box for p in pieces], ranges)]

    def locate(self, name: str, at: tuple[Node, ...], boxes: Sequence[Box], ranges: Ranges) -> int:
        """The box that holds a reference; _BoxSplitError where it runs over several, E805 where over none."""
        places = self.affine(at, ranges)
        held = {loop: r.interval for loop, r in ranges.items()}
        reach = tuple(a.over(held) for a in places)
        # one box holds all of it
        for k, box in enumerate(boxes):
            if len(box) == len(reach) and box_holds(box, reach):
                return k
        corner = tuple(Interval(i.first, i.first) for i in reach)
        # it begins in one: cut where that ends
        for box in boxes:
            if len(box) == len(corner) and box_holds(box, corner):
                k = next(k for k, (b, r) in enumerate(zip(box, reach, strict=True)) if not b.holds(r))
                loop = places[k].loop
                if loop is None:
                    raise unrolling_error(f"{name} by a table of indices", self.place)
                raise _BoxSplitError(loop, box[k].last.plus(1).minus(places[k].offset), name)
        text = ", ".join(str(i.first.value) for i in reach)
        raise ModelError([Diagnostic("E805", f"{name}[{text}] is outside its range", self.place)])


def _halves(loop: Loop, at: WholeNumber) -> tuple[Loop, Loop]:
    before = linear(-1.0, ((1.0, at.node),))
    return Loop(loop.index, loop.first, before), Loop(loop.index, at.node, loop.last)
