"""Coordinates that inertia joins to each other alone, counted from one of them.

T* holds their flows in differences only, so the sum of their balances of efforts is algebraic.  Where it reads no flow
either (current sources and inductors cut capacitors off), its rate is a hidden constraint, which shows once the sum is
a row: with q_k = u_k + q_r, Lagrange's equation of q_r is that sum, and T* lacks q_r.

Families take part as wholes: x[i, j] = u[i, j] + r, or + r[i + c] where what is joined stands side by side along i.

Received: an EnergyModel whose rows are as written.  Returned: the same model in u_k and q_r.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from sysdyn.compiler.model.energies import EnergyModel, Family, tangible
from sysdyn.compiler.model.terms import Nest, has_reduction, local_variables, vanishes
from sysdyn.dsl.model.calculus import derivative
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
from sysdyn.dsl.model.joined import Joined
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class _Anchor:
    """What a family is counted from: for each index of that its own index and an offset, or (None, a constant)."""

    name: str
    places: tuple[tuple[int | None, Node], ...]

    def at(self, args: tuple[Node, ...]) -> tuple[Node, ...]:
        """The anchor's indices for an element of the family."""
        return tuple(c if k is None else add(args[k], c) for k, c in self.places)


_Anchors = Mapping[str, _Anchor]
"""By family, the anchor itself among them."""


def in_relative_coordinates(model: EnergyModel) -> EnergyModel:
    """The model with every group of floating coordinates counted from one of them."""
    change: dict[str, _Anchor] = {}
    for group in _groups(model):
        anchors = _anchors(model, group)
        if anchors and _floats(model, anchors):
            change |= {name: a for name, a in anchors.items() if name != a.name}
    return _changed(model, change) if change else model


def _groups(model: EnergyModel) -> Iterator[list[Family]]:
    """Families of coordinates that terms of T* join, in the order of the model."""
    joined, groups = Joined[str](), dict[str, list[Family]]()
    for term in model.function(model.mirror.coenergy):
        names = [n.data[0] for n in local_variables(term.expression, model.mirror.rate)]
        for name in names:
            joined.join(names[0], name)
    for c in model.coordinates:
        groups.setdefault(joined.first(c.name), []).append(c)
    return (group for group in groups.values() if len(group) > 1)


def _anchors(model: EnergyModel, group: list[Family]) -> _Anchors:
    """How the families of a group are counted from the last with fewest indices; empty where they cannot be."""
    m = model.mirror
    last = min(reversed(group), key=lambda c: len(c.shape))
    found = {last.name: _Anchor(last.name, tuple((k, const(0.0)) for k in range(len(last.shape))))}
    shapes = {c.name: c for c in group}
    joined = [local_variables(t.expression, m.rate) for t in model.function(m.coenergy)]
    while len(found) < len(group):
        before = len(found)
        for nodes in joined:
            known = next((n for n in nodes if n.data[0] in found), None)
            for n in nodes if known is not None else ():
                if n.data[0] in shapes and n.data[0] not in found:
                    assert known is not None
                    places = _places(found[known.data[0]].at(known.args), n.args)
                    if places is None or not _inside(shapes[n.data[0]], last, places):
                        return {}
                    found[n.data[0]] = _Anchor(last.name, places)
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


def _inside(family: Family, anchor: Family, places: tuple[tuple[int | None, Node], ...]) -> bool:
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
    inertia = model.function(m.coenergy)
    reached = [
        _reach(group[n.data[0]].at(n.args), term.loops)
        for term in inertia
        for n in local_variables(term.expression, m.rate)
        if n.data[0] in group
    ]

    def along(root: Node, loops: Nest, kind: str) -> bool:
        """Whether the expression changes where all that have one anchor move alike."""
        slopes: dict[tuple[Node, ...], list[Node]] = {}
        for n in local_variables(root, kind):
            if n.data[0] in group:
                slopes.setdefault(group[n.data[0]].at(n.args), []).append(derivative(root, n))
        if slopes and has_reduction(root):
            return True
        return any(
            not vanishes(*found) and any(_meet(_reach(at, loops), box) for box in reached)
            for at, found in slopes.items()
        )

    rows = [row for row in model.rows if row.kind != "lambda"]
    terms = [*inertia, *model.function(m.content), *(t for row in rows for t in row.terms)]
    if any(along(t.expression, t.loops, m.rate) for t in terms):
        return False
    if any(along(t.expression, t.loops, m.coordinate) for row in model.of_kind("phi") for t in row.terms):
        return False
    for work in model.works:
        read = {n.data[1:] for n in variables(work.effort) if n.op == "var"}
        if not read <= {(m.coordinate, 0), ("s", 0)} and along(work.on, work.loops, m.coordinate):
            return False
    return all(n.data[1] in (m.coordinate, m.rate) for n in _unknowns(model) if n.data[0] in group)


def _reach(at: tuple[Node, ...], loops: Nest) -> tuple[tuple[Node, Node], ...]:
    """The least and the greatest of each index."""
    low = {index(loop.index): loop.first for loop in loops}
    high = {index(loop.index): loop.last for loop in loops}
    return tuple((substitute(node, low), substitute(node, high)) for node in at)


def _meet(a: tuple[tuple[Node, Node], ...], b: tuple[tuple[Node, Node], ...]) -> bool:
    """Whether the text lets both hold one element."""
    apart = (sub(low, high) for x, y in zip(a, b, strict=True) for low, high in ((x[0], y[1]), (y[0], x[1])))
    return not any(is_const(gap) and gap.data > 0.0 for gap in apart)


def _unknowns(model: EnergyModel) -> Iterable[Node]:
    """Every variable of a coordinate that any statement reads."""
    names = {c.name for c in model.coordinates}
    return (n for root in model.expressions() for n in ordered_variables(root) if n.op == "var" and n.data[0] in names)


def _changed(model: EnergyModel, change: _Anchors) -> EnergyModel:
    """Every variable of u_k as u_k + q_r."""

    def new(root: Node) -> Node:
        found = [n for n in topological([root]) if n.op == "var" and n.data[0] in change]
        pairs = {}
        for n in found:
            anchor = change[n.data[0]]
            pairs[n] = add(n, var(anchor.name, n.data[1], *anchor.at(n.args), order=n.data[2]))
        return substitute(root, pairs) if pairs else root

    found = model.rewritten(new)
    touched = tangible(found)
    return replace(found, coordinates=tuple(replace(c, tangible=c.name in touched) for c in found.coordinates))
