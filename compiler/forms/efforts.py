"""The efforts that act on a coordinate, by class (book, 2.3; Lagrange's principle): their sum is zero.

    inertial      -(d/dt dT*/df - dT*/dq + dT/dq)     with p' for d/dt dT*/df where p is an unknown
    potential     -dV/dq                              and what laws of stores give that have no V
    dissipative   -dD/df                              and what laws of dissipators give that have no D
    source        E du/dq                             virtual work
    implicit      E du/dq                             virtual work of an implicit unknown
    constraint    -Phi_q^T kappa - Psi_f^T mu         the multiplier rule

A balance adds them up with the other sign; the rate of the momentum stands beside them (lowering.py).
Received: an EnergyModel.  Returned: summands of balances; or, for a node `var(coordinate, "x:CLASS", indices)`, the
effort as an expression.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from sysdyn.compiler.forms.momenta import at_indices
from sysdyn.compiler.model.energies import EnergyModel, Row, Virtual
from sysdyn.compiler.model.terms import Nest, local_variables
from sysdyn.dsl.model.calculus import derivative, signals_held
from sysdyn.dsl.model.expression import Node, add, mul, neg, substitute, var, variables
from sysdyn.values import dataclass

PREFIX = "x:"
"""Of the kinds of unknown that stand for effort classes."""
Places = Callable[[Node, str], list[Node]]
"""(expression, kind) -> the variables of the coordinates that are asked for."""
_WORKS = {"stored": "potential", "dissipated": "dissipative", "supplied": "source"}


@dataclass(frozen=True, slots=True)
class Effort:
    """A summand of the balance of the coordinate `on`, for all iterations of the nest: the effort with the other sign.

    name: of its class; block: where the balance adds it.
    """

    name: str
    block: str  # dynamics phi_reaction psi_reaction
    on: Node
    nest: Nest
    value: Node


def efforts(model: EnergyModel, owner: str | None = None) -> Iterator[Effort]:
    """Every summand but the rates of momenta; owner: those on one coordinate alone."""

    def on_(root: Node, kind: str) -> list[Node]:
        return [n for n in local_variables(root, kind) if owner in (None, n.data[0])]

    yield from _gradients(model, on_)
    for work in model.works:
        for on in on_(work.on, model.mirror.coordinate):
            value = neg(mul(work.effort, derivative(work.on, on)))
            yield Effort(_class_of(model, work), "dynamics", on, work.loops, value)
    for row in model.rows:
        yield from _reactions(model, row, on_)


def _gradients(model: EnergyModel, on_: Places) -> Iterator[Effort]:
    """-dT*/dq + dT/dq + dV/dq + dD/df."""
    m = model.mirror
    functions = (
        ("inertial", m.coenergy, m.coordinate, -1.0), ("inertial", m.energy, m.coordinate, 1.0),
        ("potential", m.potential, m.coordinate, 1.0), ("dissipative", m.content, m.rate, 1.0),
    )  # fmt: skip
    for name, function, kind, sign in functions:
        for term in model.function(function):
            for on in on_(term.expression, kind):
                slope = derivative(term.expression, on)
                yield Effort(name, "dynamics", on, term.loops, slope if sign > 0.0 else neg(slope))


def _class_of(model: EnergyModel, work: Virtual) -> str:
    unknowns = {u.name for u in model.unknowns}
    if any(n.data[0] in unknowns for n in local_variables(work.effort, "e")):
        return "implicit"
    return _WORKS[work.account]


def _reactions(model: EnergyModel, row: Row, on_: Places) -> Iterator[Effort]:
    """Phi_q^T kappa or Psi_f^T mu of one row of constraints; nothing of others.  Signals are held: power is kept."""
    if row.kind not in ("phi", "psi"):
        return
    m = model.mirror
    kind, name = (m.coordinate, "kappa") if row.kind == "phi" else (m.rate, "mu")
    multiplier = var(row.name, name, *row.at)
    for term in row.terms:
        held, signals = signals_held(term.expression)
        for on in on_(held, kind):
            value = mul(substitute(derivative(held, on), signals), multiplier)
            yield Effort("constraint", f"{row.kind}_reaction", on, term.loops, value)


# --- by class ---------------------------------------------------------------------------------------------------


def acting(root: Node) -> list[Node]:
    """The efforts of classes that an expression reads."""
    found = (n for n in variables(root) if n.op == "var" and n.data[1].startswith(PREFIX))
    return sorted(found, key=lambda n: n.number)


def effort(model: EnergyModel, node: Node) -> Node:
    """The effort of the node's class at its indices."""
    name, owner, at = node.data[1].removeprefix(PREFIX), node.data[0], node.args
    found = (e for e in efforts(model, owner) if e.name == name)
    parts = [neg(at_indices(e.nest, e.on.args, e.value, at)) for e in found]
    if name == "inertial":
        parts.append(neg(var(owner, model.mirror.conjugate, *at, order=1)))
    return add(*parts)
