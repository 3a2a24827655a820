"""Coordinates that inertia joins to each other alone, counted from one of them.

T* holds their flows in differences only, so the sum of their balances of efforts is algebraic.  Where it reads no flow
either (current sources and inductors cut capacitors off), its rate is a hidden constraint, which shows once the sum is
a row: with q_k = u_k + q_r, Lagrange's equation of q_r is that sum, and T* lacks q_r.

Received: an EnergyModel whose rows are as written.  Returned: the same model in u_k and q_r.  Scalars only.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from sysdyn.compiler.energies import EnergyModel, Row, tangible
from sysdyn.compiler.terms import Term, local_variables
from sysdyn.dsl.expression import Node, add, derivative, is_const, substitute, var, variables


def anchored(model: EnergyModel) -> EnergyModel:
    """The model with every group of floating coordinates counted from its last."""
    change: dict[str, str] = {}
    for group in _groups(model):
        if _floats(model, group):
            change |= dict.fromkeys(group[:-1], group[-1])
    return _changed(model, change) if change else model


def _groups(model: EnergyModel) -> Iterator[list[str]]:
    """Coordinates that terms of T* join, in the order of the model."""
    m = model.mirror
    of = {c.name: {c.name} for c in model.coordinates if not c.shape}
    massive: set[str] = set()
    for term in model.function(m.coenergy):
        names = {n.data[0] for n in local_variables(term.expression, m.rate)}
        massive |= names
        known = [name for name in names if name in of]
        if len(known) < len(names):  # beside an array: nothing is known of it
            massive -= names
            continue
        joined: set[str] = set().union(*(of[name] for name in known))
        for name in joined:
            of[name] = joined
    seen: set[str] = set()
    for c in model.coordinates:
        if c.name in massive and c.name not in seen and len(of[c.name]) > 1:
            seen |= of[c.name]
            yield [k.name for k in model.coordinates if k.name in of[c.name]]


def _floats(model: EnergyModel, group: list[str]) -> bool:
    """Whether neither inertia nor anything else that reads flows reads those of the group but in differences."""
    m = model.mirror
    roots = [t.expression for name in (m.coenergy, m.content) for t in model.function(name)]
    roots += [t.expression for row in model.rows if row.kind != "lambda" for t in row.terms]
    if any(_along(root, group, m.rate) for root in roots):
        return False
    if any(_along(t.expression, group, m.coordinate) for row in model.rows if row.kind == "phi" for t in row.terms):
        return False
    for work in model.works:
        read = {n.data[1:] for n in variables(work.effort) if n.op == "var"}
        if _along(work.on, group, m.coordinate) and not read <= {(m.coordinate, 0), ("s", 0)}:
            return False
    return all(n.data[1] in (m.coordinate, m.rate) for n in _unknowns(model) if n.data[0] in group)


def _along(root: Node, group: list[str], kind: str) -> bool:
    """Whether the expression changes where all of the group move alike."""
    own = [n for n in local_variables(root, kind) if n.data[0] in group]
    return bool(own) and not is_const(add(*(derivative(root, n) for n in own)), 0.0)


def _unknowns(model: EnergyModel) -> Iterable[Node]:
    """Every variable of a coordinate that any statement reads."""
    names = {c.name for c in model.coordinates}
    roots = [t.expression for name in model.functions for t in model.function(name)]
    roots += [t.expression for row in model.rows for t in row.terms]
    roots += [n for w in model.works for n in (w.effort, w.on)] + [q.expression for q in model.quantities]
    roots += [n for i in model.initials for n in (i.target, i.value)]
    return (n for root in roots for n in variables(root) if n.op == "var" and n.data[0] in names)


def _changed(model: EnergyModel, change: dict[str, str]) -> EnergyModel:
    """Every variable of u_k as u_k + q_r."""

    def new(root: Node) -> Node:
        found = [n for n in variables(root) if n.op == "var" and n.data[0] in change]
        pairs = {n: add(n, var(change[n.data[0]], n.data[1], order=n.data[2])) for n in found}
        return substitute(root, pairs) if pairs else root

    def terms(old: tuple[Term, ...]) -> tuple[Term, ...]:
        return tuple(replace(t, expression=new(t.expression)) for t in old)

    def row(old: Row) -> Row:
        return replace(old, terms=terms(old.terms))

    found = replace(
        model,
        functions={name: terms(pieces) for name, pieces in model.functions.items()},
        works=tuple(replace(w, effort=new(w.effort), on=new(w.on)) for w in model.works),
        rows=tuple(row(r) for r in model.rows),
        initials=tuple(replace(i, target=new(i.target), value=new(i.value)) for i in model.initials),
        quantities=tuple(replace(q, expression=new(q.expression)) for q in model.quantities),
    )
    touched = tangible(found)
    return replace(found, coordinates=tuple(replace(c, tangible=c.name in touched) for c in found.coordinates))
