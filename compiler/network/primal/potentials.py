"""Efforts of common-effort nodes: multipliers, zero at a reference, and walks along series classes for merged nodes.

A merged node lies between two branches. From there the walk goes through branches and merged nodes until it meets one
whose effort is known; the way without a kinetic store is preferred (rule P3), then that of the fewest efforts: the
voltage of a large capacitor behind 1 Mohm is its own, not what the resistor leaves of a source's. Where a walk comes
back to nodes of the same cell one index further, it is a run: the steps in between are summed over the run at once.
"""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.compiler.network.primal.balances import MULTIPLIER, WALK, ZERO, NodeEffort
from sysdyn.compiler.network.primal.bounds import Affine, Interval, Picked, WholeNumber
from sysdyn.compiler.network.primal.incidence import PLUS, Touch, unrolling_error
from sysdyn.compiler.network.primal.reading import LoopRange, Ranges, Rewriter
from sysdyn.dsl.model.expression import Node, add, const, index, linear, neg, reduction, sub, var
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class _Visit:
    """A merged node on the way: where, by which branch end it is left, and how many terms lie behind."""

    effort: NodeEffort
    at: tuple[Node, ...]
    touch: Touch
    behind: int


@dataclass(frozen=True, slots=True)
class _Path:
    """Efforts (signed) of the branches on a way, and the effort of the node at its end."""

    terms: tuple[Node, ...]
    base: Node
    kinetic: int


class Potentials:
    """Reads `ne` of every node."""

    def __init__(self, efforts: Sequence[NodeEffort]) -> None:
        self.efforts: dict[str, list[NodeEffort]] = {}
        for e in efforts:
            self.efforts.setdefault(e.node, []).append(e)
        self._serial = 0

    def read(self, reader: Rewriter, node: Node, ranges: Ranges, active: tuple[Node, ...]) -> Node:
        """Effort of a node: against the reference, less that of the ground where this is not the reference."""
        effort = self.effort_of_node(reader, node.data[0], node.args, ranges)
        value = self._raw(reader, effort, node.args, ranges)
        if effort.ground is not None:
            value = sub(value, self._raw(reader, self.efforts[effort.ground][0], (), ranges))
        return reader.resolve(value, ranges, active)

    def effort_of_node(self, reader: Rewriter, name: str, at: tuple[Node, ...], ranges: Ranges) -> NodeEffort:
        """How the effort of a node is read."""
        found = self.efforts.get(name, [])
        if not found:
            raise ModelError([Diagnostic("E409", f"node {name} touches no element: it has no effort", reader.place)])
        return found[reader.locate(name, at, [e.box for e in found], ranges)]

    def _raw(self, reader: Rewriter, effort: NodeEffort, at: tuple[Node, ...], ranges: Ranges) -> Node:
        """Effort against the component's reference."""
        if effort.how == MULTIPLIER:
            return var(effort.label, "mu", *at)
        if effort.how == ZERO:
            return const(0.0)
        paths = [self._path(reader, effort, at, touch, ranges) for touch in effort.cell.touches]
        best = min(paths, key=lambda p: (p.kinetic, len(p.terms) + (p.base != const(0.0))))
        return add(best.base, *best.terms)

    def _path(self, reader: Rewriter, effort: NodeEffort, at: tuple[Node, ...], touch: Touch, ranges: Ranges) -> _Path:
        """The way from a node to one whose effort is known: terms along merged elements, periods of a run summed up."""
        terms: list[Node] = []
        visits: list[_Visit] = []
        kinetic = 0
        while effort.how == WALK:
            visits.append(_Visit(effort, at, touch, len(terms)))
            kinetic += touch.element.branch.kind == "kinetic"
            term, name, at = _step(touch, at)
            terms.append(term)
            effort = self.effort_of_node(reader, name, at, ranges)
            arrival = touch
            if effort.how == WALK:
                touch = _other(effort, arrival)
                back = next((v for v in visits if v.effort == effort and v.touch == touch), None)
                # the same cell and element as before: a period
                if back is not None:
                    terms, at, effort, name = self._run(reader, visits, back, (effort, at), terms, ranges)
                    visits = []
                    if effort.how == WALK:
                        touch = _other(effort, arrival)
        return _Path(tuple(terms), self._raw(reader, effort, at, ranges), kinetic)

    def _run(
        self,
        reader: Rewriter,
        visits: list[_Visit],
        start: _Visit,
        now: tuple[NodeEffort, tuple[Node, ...]],
        terms: list[Node],
        ranges: Ranges,
    ) -> tuple[list[Node], tuple[Node, ...], NodeEffort, str]:
        """Sum the period that leads from `start` to `now`, one index further, over the rest of the run."""
        before, behind = reader.affine(start.at, ranges), reader.affine(now[1], ranges)
        shifts = [b.offset.value - a.offset.value for a, b in zip(before, behind, strict=True)]
        along = [d for d, s in enumerate(shifts) if s]
        # a period that does not move on by one index has no sum over a loop
        if len(along) != 1 or abs(shifts[along[0]]) != 1:
            place = reader.place or start.effort.cell.place
            raise unrolling_error(f"the effort of node {start.effort.node} along its series class", place)
        d, step = along[0], shifts[along[0]]
        self._serial += 1
        counter = f"#w{self._serial}"
        held = {name: r.interval for name, r in ranges.items()}
        own = {**ranges, counter: LoopRange(before[d].over(held))}
        at: tuple[Node, ...] = (*start.at[:d], index(counter), *start.at[d + 1 :])
        period: list[Node] = []
        limits: list[WholeNumber] = []
        effort, touch = start.effort, start.touch
        # one period at a counter, and how far each of its cells reaches
        for _ in visits[visits.index(start) :]:
            limits += _limits(effort, reader.affine(at, own), counter, step)
            term, name, at = _step(touch, at)
            period.append(term)
            effort = self.effort_of_node(reader, name, at, own)
            touch = _other(effort, touch) if effort.how == WALK else touch
        # up to where the first of them ends
        end = (max if step < 0 else min)(limits, key=lambda b: b.value)
        first, last = (end.node, start.at[d]) if step < 0 else (start.at[d], end.node)
        total = reduction("sum", counter, first, last, add(*period))
        beyond = linear(float(step), ((1.0, end.node),))
        at = (*start.at[:d], beyond, *start.at[d + 1 :])
        name = start.effort.node
        return [*terms[: start.behind], total], at, self.effort_of_node(reader, name, at, ranges), name


def _step(touch: Touch, at: tuple[Node, ...]) -> tuple[Node, str, tuple[Node, ...]]:
    """Through a branch: its effort with the sign of e(here) = e(there) +- e_branch, and the node there."""
    loops = touch.loops_at(at)
    element = touch.element
    effort = var(element.name, "be", *(a.substitute_loops(loops) for a in element.at))
    other = element.ends[1 - touch.end]
    return effort if touch.end == PLUS else neg(effort), other.node, tuple(a.substitute_loops(loops) for a in other.at)


def _other(effort: NodeEffort, arrival: Touch) -> Touch:
    """The end by which a merged node is left when it was reached through `arrival`."""
    by = (arrival.element.number, 1 - arrival.end)
    return next(t for t in effort.cell.touches if (t.element.number, t.end) != by)


def _limits(effort: NodeEffort, at: tuple[Affine | Picked, ...], counter: str, step: int) -> list[WholeNumber]:
    """How far the counter may run before this node leaves the box in which it is merged."""
    boxes: list[tuple[Interval, Affine | Picked]] = list(zip(effort.box, at, strict=True))
    return [(i.first if step < 0 else i.last).minus(a.offset) for i, a in boxes if a.loop == counter]
