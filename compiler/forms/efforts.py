"""The efforts that act on a coordinate, by class (book, 2.3; Lagrange's principle): their sum is zero.

    inertial      -(d/dt dT*/df - dT*/dq + dT/dq)     with p' for d/dt dT*/df where p is an unknown
    potential     -dV/dq                              and what laws of stores give that have no V
    dissipative   -dD/df                              and what laws of dissipators give that have no D
    source        E du/dq                             virtual work
    implicit      E du/dq                             virtual work of an implicit unknown
    constraint    -Phi_q^T kappa - Psi_f^T mu

Received: an EnergyModel and a node `var(coordinate, "x:CLASS", indices)`.  Returned: the effort as an expression.
"""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.compiler.forms.momenta import at_indices
from sysdyn.compiler.model.energies import EnergyModel, Virtual
from sysdyn.compiler.model.terms import local_variables
from sysdyn.dsl.model.expression import Node, add, derivative, mul, neg, signals_held, substitute, var, variables

PREFIX = "x:"
"""Of the kinds of unknown that stand for effort classes."""
_WORKS = {"stored": "potential", "dissipated": "dissipative", "supplied": "source"}


def acting(root: Node) -> list[Node]:
    """The efforts of classes that an expression reads."""
    found = (n for n in variables(root) if n.op == "var" and n.data[1].startswith(PREFIX))
    return sorted(found, key=lambda n: n.number)


def effort(model: EnergyModel, node: Node) -> Node:
    """The effort of the node's class at its indices."""
    name = node.data[1].removeprefix(PREFIX)
    return add(*_efforts(model, name, node.data[0], node.args))


def _efforts(model: EnergyModel, name: str, owner: str, at: tuple[Node, ...]) -> Iterator[Node]:
    m = model.mirror
    if name == "inertial":
        yield neg(var(owner, m.conjugate, *at, order=1))
        yield from _gradient(model, m.coenergy, m.coordinate, owner, at)
        yield from (neg(v) for v in _gradient(model, m.energy, m.coordinate, owner, at))
    if name == "potential":
        yield from (neg(v) for v in _gradient(model, m.potential, m.coordinate, owner, at))
    if name == "dissipative":
        yield from (neg(v) for v in _gradient(model, m.content, m.rate, owner, at))
    if name == "constraint":
        yield from _reactions(model, owner, at)
        return
    for work in model.works:
        if _class_of(model, work) == name:
            for own in local_variables(work.on, m.coordinate):
                if own.data[0] == owner:
                    yield at_indices(work.loops, own.args, mul(work.effort, derivative(work.on, own)), at)


def _class_of(model: EnergyModel, work: Virtual) -> str:
    unknowns = {u.name for u in model.unknowns}
    if any(n.data[0] in unknowns for n in local_variables(work.effort, "e")):
        return "implicit"
    return _WORKS[work.account]


def _gradient(
    model: EnergyModel, function: str, kind: str, owner: str, at: tuple[Node, ...]
) -> Iterator[Node]:
    for term in model.function(function):
        for own in local_variables(term.expression, kind):
            if own.data[0] == owner:
                yield at_indices(term.loops, own.args, derivative(term.expression, own), at)


def _reactions(model: EnergyModel, owner: str, at: tuple[Node, ...]) -> Iterator[Node]:
    m = model.mirror
    for row in model.rows:
        if row.kind not in ("phi", "psi"):
            continue
        kind, multiplier = (m.coordinate, "kappa") if row.kind == "phi" else (m.rate, "mu")
        for term in row.terms:
            held, signals = signals_held(term.expression)
            for own in local_variables(held, kind):
                if own.data[0] == owner:
                    slope = substitute(derivative(held, own), signals)
                    value = neg(mul(slope, var(row.name, multiplier, *row.at)))
                    yield at_indices(term.loops, own.args, value, at)
