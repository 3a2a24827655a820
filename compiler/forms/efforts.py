"""The efforts on each coordinate but the rate of its momentum: what the balance of (3.34) adds up, term by term.

    -dT*/dq + dT/dq + dV/dq + dD/df     of state functions
    -E du/dq                            of virtual works
    Phi_q^T kappa, Psi_f^T mu           of constraints: the multiplier rule

Received: an EnergyModel.  Returned: efforts, each for all iterations of its nest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sysdyn.compiler.model.energies import EnergyModel, Row
from sysdyn.compiler.model.terms import Nest, local_variables
from sysdyn.dsl.model.expression import Node, derivative, mul, neg, signals_held, substitute, var


@dataclass(frozen=True, slots=True)
class Effort:
    """A summand of the balance of the coordinate `on`, for all iterations of the nest; block: where it is added."""

    block: str  # dynamics phi_reaction psi_reaction
    on: Node
    nest: Nest
    value: Node


def efforts(model: EnergyModel) -> Iterator[Effort]:
    """Every summand: those of state functions, of works, of constraints."""
    yield from gradients(model)
    yield from forces(model)
    for row in model.rows:
        yield from reactions(model, row)


def gradients(model: EnergyModel) -> Iterator[Effort]:
    """-dT*/dq + dT/dq + dV/dq + dD/df."""
    m = model.mirror
    functions = ((m.coenergy, -1.0, m.coordinate), (m.energy, 1.0, m.coordinate), (m.potential, 1.0, m.coordinate))
    for name, sign, kind in (*functions, (m.content, 1.0, m.rate)):
        for term in model.function(name):
            for node in local_variables(term.expression, kind):
                slope = derivative(term.expression, node)
                yield Effort("dynamics", node, term.loops, slope if sign > 0 else neg(slope))


def forces(model: EnergyModel) -> Iterator[Effort]:
    """-Q_j = -E du/dq_j."""
    for work in model.works:
        for node in local_variables(work.on, model.mirror.coordinate):
            yield Effort("dynamics", node, work.loops, neg(mul(work.effort, derivative(work.on, node))))


def reactions(model: EnergyModel, row: Row) -> Iterator[Effort]:
    """Phi_q^T kappa or Psi_f^T mu of one row of constraints; nothing of others.  Signals are held: power is kept."""
    if row.kind not in ("phi", "psi"):
        return
    m = model.mirror
    kind, name = (m.coordinate, "kappa") if row.kind == "phi" else (m.rate, "mu")
    multiplier = var(row.name, name, *row.at)
    for term in row.terms:
        held, signals = signals_held(term.expression)
        for node in local_variables(held, kind):
            value = mul(substitute(derivative(held, node), signals), multiplier)
            yield Effort(f"{row.kind}_reaction", node, term.loops, value)
