"""Coordinates that are counted from one of them, q_k = u_k + q_r, for one of two reasons.

Inertia joins them to each other alone: T* holds their flows in differences only, so the sum of their balances of
efforts is algebraic.  Where it reads no flow either (current sources and inductors cut capacitors off), its rate is a
hidden constraint, which shows once the sum is a row: Lagrange's equation of q_r is that sum, and T* lacks q_r.

Potential energy joins coordinates without inertia to q_r, and nothing reads their displacements but in differences: q_r
is ignorable, and grows no more beside the differences that matter (the nodes of pipes between tanks are impulses in the
complementary family, 5e9 Pa s for differences of 1e3).

Families take part as wholes: x[i, j] = u[i, j] + r, or + r[i + c] where what is joined stands side by side along i.

Received: an EnergyModel whose rows are as written.  Returned: the same model in u_k and q_r.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from sysdyn.compiler.forms.momenta import coordinates_with_inertia
from sysdyn.compiler.model.energies import EnergyModel, UnknownFamily, reading, tangible
from sysdyn.compiler.model.terms import Nest, has_reduction, local_variables, vanishes
from sysdyn.dsl.model.calculus import derivative, differential
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.expression import (
    Node,
    add,
    const,
    index,
    is_const,
    ordered_variables,
    sub,
    substitute,
    topological,
    var,
    variables,
)
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class _Anchor:
    """What a family is counted from: for each index of that its own index and an offset, or (None, a constant)."""

    name: str
    places: tuple[tuple[int | None, Node], ...]

    def anchor_indices(self, args: tuple[Node, ...]) -> tuple[Node, ...]:
        """The anchor's indices for an element of the family."""
        return tuple(c if k is None else add(args[k], c) for k, c in self.places)


_Anchors = Mapping[str, _Anchor]
"""By family, the anchor itself among them."""


def in_relative_coordinates(model: EnergyModel) -> EnergyModel:
    """The model with every group that inertia alone joins counted from one of it: its rows have no hidden rate then."""
    m = model.mirror
    return _measure_from_anchors(model, m.coenergy, m.rate, _floats)


def without_ignorable(model: EnergyModel) -> EnergyModel:
    """The model with what potential energy joins to an ignorable coordinate counted from that: for runs, where nobody
    reads the rows.
    """
    m = model.mirror
    return _measure_from_anchors(model, m.potential, m.coordinate, _is_ignorable)


def _measure_from_anchors(
    model: EnergyModel, function: str, kind: str, admits: Callable[[EnergyModel, _Anchors], bool]
) -> EnergyModel:
    """The model with the groups that a state function joins, by its variables of a kind, counted from one of each."""
    change: dict[str, _Anchor] = {}
    for group in _groups(model, function, kind):
        found = (_anchors(model, function, kind, group, anchor) for anchor in _candidates(model, group, kind))
        anchors = next((a for a in found if a and admits(model, a)), {})
        change |= {name: a for name, a in anchors.items() if name != a.name}
    return _substitute_relative(model, change) if change else model


def _groups(model: EnergyModel, function: str, kind: str) -> Iterator[list[UnknownFamily]]:
    """Families of coordinates that terms of a state function join, in the order of the model."""
    joined, groups = Joined[str](), dict[str, list[UnknownFamily]]()
    for term in model.function(function):
        names = [n.data[0] for n in local_variables(term.expression, kind)]
        for name in names:
            joined.join(names[0], name)
    for c in model.coordinates:
        groups.setdefault(joined.first(c.name), []).append(c)
    return (group for group in groups.values() if len(group) > 1)


def _candidates(model: EnergyModel, group: list[UnknownFamily], kind: str) -> list[UnknownFamily]:
    """What a group may be counted from: the last with fewest indices; of a group without inertia what has some, or
    any of most indices before others.
    """
    if kind == model.mirror.rate:
        return [min(reversed(group), key=lambda c: len(c.shape))]
    inertial = coordinates_with_inertia(model)
    heavy = [c for c in group if c.name in inertial]
    return heavy if len(heavy) == 1 else [] if heavy else sorted(group, key=lambda c: -len(c.shape))


def _anchors(
    model: EnergyModel, function: str, kind: str, group: list[UnknownFamily], anchor: UnknownFamily
) -> _Anchors:
    """How the families of a group are counted from one of them; empty where they cannot be."""
    found = {anchor.name: _Anchor(anchor.name, tuple((k, const(0.0)) for k in range(len(anchor.shape))))}
    shapes = {c.name: c for c in group}
    joined = [local_variables(t.expression, kind) for t in model.function(function)]
    # spread from the anchor along terms that join families
    while len(found) < len(group):
        before = len(found)
        for nodes in joined:
            known = next((n for n in nodes if n.data[0] in found), None)
            for n in nodes if known is not None else ():
                if n.data[0] in shapes and n.data[0] not in found:
                    assert known is not None
                    places = _places(found[known.data[0]].anchor_indices(known.args), n.args)
                    # indices that are not those of the anchor but for a shift
                    if places is None or not _inside(shapes[n.data[0]], anchor, places):
                        return {}
                    found[n.data[0]] = _Anchor(anchor.name, places)
        # a family that no term joins to the anchor
        if len(found) == before:
            return {}
    return found


def _places(wanted: tuple[Node, ...], args: tuple[Node, ...]) -> tuple[tuple[int | None, Node], ...] | None:
    """Indices of the anchor in those of an element beside it; None where they do not follow."""
    found: list[tuple[int | None, Node]] = []
    for node in wanted:
        pairs = ((k, sub(node, a)) for k, a in enumerate(args))
        own = (None, node) if not _runs(node) else next(((k, c) for k, c in pairs if not _runs(c)), None)
        if own is None:
            return None
        found.append(own)
    return tuple(found)


def _runs(node: Node) -> bool:
    return any(n.op == "index" for n in topological([node]))


def _inside(family: UnknownFamily, anchor: UnknownFamily, places: tuple[tuple[int | None, Node], ...]) -> bool:
    """Whether each element has an anchor, by the text."""
    for (k, c), (first, last) in zip(places, anchor.shape, strict=True):
        low, high = (c, c) if k is None else (add(family.shape[k][0], c), add(family.shape[k][1], c))
        if not all(is_const(apart) and apart.data >= 0.0 for apart in (sub(low, first), sub(last, high))):
            return False
    return True


def _floats(model: EnergyModel, group: _Anchors) -> bool:
    """Whether neither inertia nor anything else that reads flows reads those of the group but in differences.

    Elements of the anchor that inertia does not reach do not count.
    """
    m = model.mirror
    along = _Along(model, m.coenergy, m.rate, group)
    rows = [row for row in model.rows if row.kind != "lambda"]
    terms = [*model.function(m.coenergy), *model.function(m.content), *(t for row in rows for t in row.terms)]
    # kinetic coenergy, content or rows change when all flows of the group grow by one number
    if any(along.changes(t.expression, t.loops, m.rate) for t in terms):
        return False
    # a phi reads one displacement by itself, as q - 1 = 0
    if any(along.changes(t.expression, t.loops, m.coordinate) for row in model.of_kind("phi") for t in row.terms):
        return False
    # so does the work of an effort that is neither of q alone nor of entropies
    for work in model.works:
        read = {n.data[1:] for n in variables(work.effort) if n.op == "var"}
        if not read <= {(m.coordinate, 0), ("s", 0)} and along.changes(work.on, work.loops, m.coordinate):
            return False
    return _without_conjugates(model, set(group))


def _is_ignorable(model: EnergyModel, group: _Anchors) -> bool:
    """Whether nothing that makes a coordinate tangible, and no `init`, reads displacements but in differences, and what
    reads flows does so linearly; nor a trace, where an `init` moves some of them.

    Elements of the anchor that no potential energy reaches do not count.
    """
    m = model.mirror
    along = _Along(model, m.potential, m.coordinate, group)
    said = [(i.target, i.nest) for i in model.initials]
    read = ((expression, loops) for expression, loops, _ in reading(model))
    begun = any(n.data[0] in group for target, _ in said for n in local_variables(target, m.coordinate))
    if begun and any(along.changes(q.expression, (), m.coordinate) for q in model.quantities):
        return False  # where the group begins is seen: each coordinate is a guess of zero of its own
    if any(along.changes(expression, loops, m.coordinate) for expression, loops in (*read, *said)):
        return False
    linear = all(_is_linear_in_flows(root, group, m.rate) for root in _efforts_and_rows(model))
    return linear and _without_conjugates(model, {name for name, anchor in group.items() if name != anchor.name})


def _efforts_and_rows(model: EnergyModel) -> Iterator[Node]:
    """What balances and rows are made of: slopes of functions of flows, efforts of works, rows."""
    m = model.mirror
    for term in (*model.function(m.coenergy), *model.function(m.content)):
        yield from (derivative(term.expression, n) for n in local_variables(term.expression, m.rate))
    yield from (work.effort for work in model.works)
    yield from (t.expression for row in model.rows for t in row.terms)


def _is_linear_in_flows(root: Node, group: _Anchors, rate: str) -> bool:
    """Whether flows of the group enter linearly: one that a steep law reads stays an unknown of its own, by which an
    iteration climbs down.
    """
    own = [n for n in local_variables(root, rate) if n.data[0] in group]
    return all(n.data[0] not in group for by in own for n in local_variables(derivative(root, by), rate))


def _without_conjugates(model: EnergyModel, names: set[str]) -> bool:
    """Whether statements read these coordinates by their displacements and flows alone."""
    m = model.mirror
    read = (n for root in model.expressions() for n in ordered_variables(root) if n.op == "var" and n.data[0] in names)
    return all(n.data[1] in (m.coordinate, m.rate) for n in read)


class _Along:
    """The motion of all that have one anchor, alike; function, kind: what joins them, and by which of its variables."""

    def __init__(self, model: EnergyModel, function: str, kind: str, group: _Anchors) -> None:
        self.group = group
        self.reached = [
            _reach(group[n.data[0]].anchor_indices(n.args), term.loops)
            for term in model.function(function)
            for n in local_variables(term.expression, kind)
            if n.data[0] in group
        ]

    def changes(self, root: Node, loops: Nest, kind: str) -> bool:
        """Whether the expression changes along it, by its variables of that kind."""
        together: dict[tuple[Node, ...], dict[Node, Node]] = {}
        for n in local_variables(root, kind):
            if n.data[0] in self.group:
                together.setdefault(self.group[n.data[0]].anchor_indices(n.args), {})[n] = const(1.0)
        if together and has_reduction(root):
            return True
        return any(
            not vanishes(differential(root, alike)) and any(_meet(_reach(at, loops), box) for box in self.reached)
            for at, alike in together.items()
        )


def _reach(at: tuple[Node, ...], loops: Nest) -> tuple[tuple[Node, Node], ...]:
    """The least and the greatest of each index."""
    low = {index(loop.index): loop.first for loop in loops}
    high = {index(loop.index): loop.last for loop in loops}
    return tuple((substitute(node, low), substitute(node, high)) for node in at)


def _meet(a: tuple[tuple[Node, Node], ...], b: tuple[tuple[Node, Node], ...]) -> bool:
    """Whether the text lets both hold one element."""
    apart = (sub(low, high) for x, y in zip(a, b, strict=True) for low, high in ((x[0], y[1]), (y[0], x[1])))
    return not any(is_const(gap) and gap.data > 0.0 for gap in apart)


def _substitute_relative(model: EnergyModel, change: _Anchors) -> EnergyModel:
    """Every variable of u_k as u_k + q_r."""

    def new(root: Node) -> Node:
        found = [n for n in topological([root]) if n.op == "var" and n.data[0] in change]
        pairs = {}
        for n in found:
            anchor = change[n.data[0]]
            pairs[n] = add(n, var(anchor.name, n.data[1], *anchor.anchor_indices(n.args), order=n.data[2]))
        return substitute(root, pairs) if pairs else root

    found = model.rewritten(new)
    touched = tangible(found)
    less = {name: _less(anchor) for name, anchor in change.items()}
    coordinates = (replace(c, tangible=c.name in touched, less=less.get(c.name, c.less)) for c in found.coordinates)
    return replace(found, coordinates=tuple(coordinates))


def _less(anchor: _Anchor) -> str:
    """The anchor as it is shown: its one element, or the family."""
    if any(k is not None for k, _ in anchor.places):
        return anchor.name
    return to_text(var(anchor.name, "q", *(c for _, c in anchor.places)))
