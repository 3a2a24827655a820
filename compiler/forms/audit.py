"""The energy audit of a form: its four rows.

    T = f.dT*/df - T* (or T where given)       V       dissipated = f.dD/df
    supplied = sum E du/dq f + kappa.Phi_t + mu.b + V_t - T*_t + T_t        (b = Psi at f = 0; _t at fixed q, f)

so that d(T + V)/dt + dissipated - supplied = 0 on every solution: from (3.34), multiplied by f.  A store whose law
stands beside the state functions adds its energy; its work is no supply.
"""

from __future__ import annotations

from sysdyn.compiler.forms.assembly import Assembly
from sysdyn.compiler.forms.descriptor import Equations
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.terms import Nest, local_variables
from sysdyn.dsl.model.expression import (
    Node,
    add,
    const,
    derivative,
    differential,
    mul,
    neg,
    rate,
    signals_held,
    sub,
    substitute,
    var,
    variables,
)


def add_audit(assembly: Assembly, model: EnergyModel) -> None:
    """Rows kinetic, potential (J), dissipated, supplied (W)."""
    for name, unit in (("kinetic", "J"), ("potential", "J"), ("dissipated", "W"), ("supplied", "W")):
        assembly.family(Equations("audit", name, name, "audit", unit, None))

    def into(row: str, nest: Nest, expression: Node) -> None:
        assembly.add("audit", row, (), nest, expression)

    m = model.mirror
    for term in model.function(m.coenergy):
        into("kinetic", term.loops, sub(_along(term.expression, m.rate), term.expression))
        into("supplied", term.loops, neg(explicit(term.expression)))
    for name, stored in ((m.energy, "kinetic"), (m.potential, "potential")):
        for term in model.function(name):
            into(stored, term.loops, term.expression)
            into("supplied", term.loops, explicit(term.expression))
    for stored in ("kinetic", "potential"):
        for term in model.function(f"kept {stored}"):
            into(stored, term.loops, term.expression)
    for term in model.function(m.content):
        into("dissipated", term.loops, _along(term.expression, m.rate))
    for work in (w for w in model.works if not w.kept):
        power = [mul(derivative(work.on, q), _rate(q)) for q in local_variables(work.on, m.coordinate)]
        into("supplied", work.loops, mul(work.effort, add(*power)))
    for row in model.rows:
        for term in row.terms if row.kind in ("phi", "psi") else ():
            still = explicit(term.expression) if row.kind == "phi" else _at_rest(term.expression, m.rate)
            multiplier = var(row.name, "kappa" if row.kind == "phi" else "mu", *row.at)
            into("supplied", term.loops, mul(multiplier, still))


def explicit(expression: Node) -> Node:
    """Derivative by time at fixed coordinates and their rates: time, states and implicit unknowns move."""
    moving = (n for n in variables(expression) if n.op == "time" or (n.data[1] in ("s", "e") and not n.data[2]))
    return differential(expression, {n: _rate(n) for n in sorted(moving, key=lambda n: n.number)})


def _at_rest(expression: Node, kind: str) -> Node:
    """What is left of a flow constraint where no flow is; signals keep their values."""
    held, signals = signals_held(expression)
    return substitute(substitute(held, {f: const(0.0) for f in local_variables(held, kind)}), signals)


def _along(expression: Node, kind: str) -> Node:
    """F . d/df."""
    return add(*(mul(f, derivative(expression, f)) for f in local_variables(expression, kind)))


def _rate(node: Node) -> Node:
    dot = rate(node)
    assert dot is not None
    return dot
