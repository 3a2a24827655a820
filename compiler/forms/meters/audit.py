"""The energy audit of a form: what is stored, dissipated and supplied, in all and ledger by ledger.

    T = f.dT*/df - T* (or T where given)       V       dissipated = f.dD/df - E f of dissipators' works
    supplied = sum E du/dq f + kappa.Phi_t + mu.b + V_t - T*_t + T_t        (b = Psi at f = 0; _t at fixed q, f)

so that d(T + V)/dt + dissipated - supplied = 0 on every solution: from (3.34), multiplied by f.  A store whose law
stands beside the state functions adds its energy; its work is no supply.

A ledger is kept for each connected part of the model (ledgers.py): its own sums, additive constants left out, and the
sums of the magnitudes of what single elements dissipate and are supplied with, against which its balance is judged.
Block `ledger` holds what each element stores.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.compiler.forms.assembly import Assembly
from sysdyn.compiler.forms.descriptor import EquationFamily
from sysdyn.compiler.forms.efforts import Effort
from sysdyn.compiler.forms.meters.ledgers import POWERS, STORED, EnergyAccount, Entry, Ledger, ledgers
from sysdyn.compiler.model.energies import EnergyModel, Virtual
from sysdyn.compiler.model.magnitudes import rounding
from sysdyn.compiler.model.terms import Term, counter, local_variables
from sysdyn.dsl.model.calculus import derivative, differential, rate, signals_held
from sysdyn.dsl.model.expression import (
    Node,
    add,
    call,
    const,
    is_const,
    mul,
    neg,
    scale,
    sub,
    substitute,
    topological,
    var,
    variables,
)
from sysdyn.dsl.model.network import Shape, loop_ranges

ROUNDED = 1e-15
"""Of what a rounding error is at most, for one unit of the last place (2.2e-16) of a function from a library."""
GLOBAL = (("kinetic", "J"), ("potential", "J"), ("dissipated", "W"), ("supplied", "W"))
LEDGER = ("stored", "dissipated", "supplied", "gross")
"""Rows of block audit that each ledger has behind the global ones; gross: the sum over elements of the magnitudes of
power dissipated and supplied."""


def add_audit(assembly: Assembly, model: EnergyModel, acting: Sequence[Effort]) -> tuple[tuple[str, Shape], ...]:
    """Rows kinetic, potential (J), dissipated, supplied (W), those of the ledgers, and what elements store.

    acting: every effort of the balances.  Returns the shapes of the row families of block ledger, by owner.
    """
    for name, unit in GLOBAL:
        assembly.family(EquationFamily("audit", name, name, "audit", unit, None))
    entries = tuple(_entries(model))
    units = {c.name: c.units.get("balance", "J") for c in model.coordinates}
    for entry in entries:
        if units[entry.owners[0]] == "J" if entry.owners else True:
            assembly.add("audit", entry.account, (), entry.nest, entry.expression)
    shapes: list[tuple[str, Shape]] = []
    for number, ledger in enumerate(ledgers(model, entries, acting)):
        _add_ledger(assembly, number, ledger, model, shapes)
    return tuple(shapes)


def _add_ledger(
    assembly: Assembly, number: int, ledger: Ledger, model: EnergyModel, shapes: list[tuple[str, Shape]]
) -> None:
    """The sums of a ledger, and what its elements store."""
    place = ledger.entries[0].place
    # a row of the audit for each account
    for name in LEDGER:
        power = "W" if ledger.unit == "J" else f"({ledger.unit})/s"
        unit = ledger.unit if name == "stored" else power
        label = f"{ledger.kind}: {ledger.title}"
        assembly.family(EquationFamily("audit", label, f"#ledger {number} {name}", "ledger", unit, place))
    # what an element exchanges counts for the size of the turnover alone
    for entry in ledger.entries:
        if entry.account == "exchanged":
            assembly.add("audit", f"#ledger {number} gross", (), entry.nest, call("abs", entry.expression))
            continue
        account = "stored" if entry.account in STORED else entry.account
        assembly.add("audit", f"#ledger {number} {account}", (), entry.nest, entry.expression)
    # what elements store one by one: a jump of one of them is found there
    for found in ledger.elements():
        magnitude = call("abs", found.expression)
        if found.account in POWERS:
            assembly.add("audit", f"#ledger {number} gross", (), found.nest, magnitude)
            continue
        owner = f"#ledger {number} element {len(shapes)}"
        # loops that follow each other make no rectangular family
        apart = not any(n.op == "index" for loop in found.nest for n in topological([loop.first, loop.last]))
        shape = loop_ranges(found.nest) if apart else ()
        shapes.append((owner, shape))
        label = found.place.element or ledger.label(found)
        inertia = _of_one_rate(found, model)
        kind = f"{number} inertia" if inertia else str(number)
        assembly.family(EquationFamily("ledger", label, owner, kind, ledger.unit, found.place))
        at = tuple(counter(k) for k in range(len(shape)))
        stored = _beyond_rounding(found.expression) if inertia else found.expression
        assembly.add("ledger", owner, at, found.nest, stored if len(shape) == len(found.nest) else magnitude)


def _of_one_rate(element: EnergyAccount, model: EnergyModel) -> bool:
    """Whether it is the kinetic energy of one rate, and of nothing else that moves: its sign is that of an inertia."""
    rates = local_variables(element.expression, model.mirror.rate)
    if element.account != "kinetic" or len(rates) != 1:
        return False
    return is_const(substitute(element.expression, {rates[0]: const(0.0)}), 0.0)


def _beyond_rounding(energy: Node) -> Node:
    """Zero where its rounding error may hide its sign, less by that elsewhere: sqrt(1 + f^2) - 1 of a small f."""
    if not any(n.op in ("sum", "call") for n in topological([energy])):
        return energy
    error = scale(ROUNDED, rounding(energy))
    return sub(call("max", sub(energy, error), const(0.0)), call("max", neg(add(energy, error)), const(0.0)))


def _entries(model: EnergyModel) -> Iterator[Entry]:
    """Everything that the audit sums up."""
    m = model.mirror
    moving = (m.coordinate, m.rate, m.conjugate)
    # f dT*/df - T*, and what enters by explicit time
    for term in model.function(m.coenergy):
        yield _entry("kinetic", term, sub(_along(term.expression, m.rate), term.expression), moving)
        yield _entry("supplied", term, neg(explicit(term.expression)), moving)
    for name, stored in ((m.energy, "kinetic"), (m.potential, "potential")):
        for term in model.function(name):
            yield _entry(stored, term, term.expression, moving)
            yield _entry("supplied", term, explicit(term.expression), moving)
    # stores of several branches, by what they hold
    for stored in STORED:
        for term in model.function(f"kept {stored}"):
            works = [w for w in model.works if w.account == "stored" and w.place == term.place]
            owners = tuple(n.data[0] for w in works for n in _driven(w, m.coordinate))
            yield Entry(stored, (*owners, *_filling(model, term)), term.loops, term.expression, term.place)
    # f dD/df
    for term in model.function(m.content):
        yield _entry("dissipated", term, _along(term.expression, m.rate), (m.rate,))
    # each work by its account: supplied, dissipated
    for work in (w for w in model.works if w.account != "stored"):
        driven = _driven(work, m.coordinate)
        power = [mul(derivative(work.on, q), _rate(q)) for q in driven]
        owners = tuple(n.data[0] for n in driven)
        done = mul(work.effort, add(*power))
        lost = work.account == "dissipated"
        yield Entry(work.account, owners, work.loops, neg(done) if lost else done, work.place)
    # a constraint that moves does work by its multiplier
    for row in model.rows:
        for term in row.terms if row.kind in ("phi", "psi") else ():
            still = explicit(term.expression) if row.kind == "phi" else _at_rest(term.expression, m.rate)
            multiplier = var(row.name, "kappa" if row.kind == "phi" else "mu", *row.at)
            kind = m.coordinate if row.kind == "phi" else m.rate
            owners = tuple(n.data[0] for t in row.terms for n in local_variables(t.expression, kind))
            yield Entry("supplied", owners, term.loops, mul(multiplier, still), row.place)


def _filling(model: EnergyModel, term: Term) -> Iterator[str]:
    """The coordinates through which a store beside the state functions is filled.

    They stand in its energy, in the rates of the states that it is written in, or its works are done on them by an
    implicit unknown that stands there.
    """
    m = model.mirror
    roots = [term.expression]
    states = {n.data[0] for n in local_variables(term.expression, "s")}
    roots += [t.expression for row in model.of_kind("lambda") if row.name in states for t in row.terms]
    implicit = {n.data[0] for root in roots for n in local_variables(root, "e")}
    for work in model.works:
        if work.account == "stored" and any(n.data[0] in implicit for n in local_variables(work.effort, "e")):
            roots.append(work.on)
    for root in roots:
        yield from (n.data[0] for n in local_variables(root, (m.coordinate, m.rate, m.conjugate)))


def _driven(work: Virtual, kind: str) -> list[Node]:
    """The displacements that a work is done on."""
    return local_variables(work.on, kind)


def _entry(account: str, term: Term, expression: Node, kinds: tuple[str, ...]) -> Entry:
    owners = tuple(n.data[0] for n in local_variables(term.expression, kinds))
    return Entry(account, owners, term.loops, expression, term.place)


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
