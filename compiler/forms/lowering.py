"""EnergyModel -> DescriptorForm: what both primal formulations (and their mirrors) share.

With u the loop-local unknowns of a term, every gradient is taken once per term and scattered:

    carrier of a momentum      p' - dT*/dq + dT/dq + dV/dq + dD/df - Q          (4.14)
    any other coordinate       d/dt(dT*/df) - dT*/dq + dV/dq + dD/df - Q        (3.34); d/dt brings M f' in
    momentum                   p - dT*/df,  or dT/dp - f where T is given or the flows are solved for (legendre.py)
    reactions                  Phi_q^T kappa, Psi_f^T mu                         the multiplier rule
    phi rate, acceleration     Phi_q f + Phi_t;  Phi_q f' + Z1                   total derivatives (6.32)
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Sequence
from contextlib import nullcontext

from sysdyn.compiler.forms.assembly import Assembly
from sysdyn.compiler.forms.coverage import Cover, cover, inside, outside
from sysdyn.compiler.forms.descriptor import AUDIT, DescriptorForm, EquationFamily, Unknowns
from sysdyn.compiler.forms.efforts import Effort, efforts
from sysdyn.compiler.forms.meters.audit import add_audit
from sysdyn.compiler.forms.meters.observing import (
    add_initials,
    add_observations,
    displacement_unknowns,
    missing,
    observed_coordinates,
    pins_and_equations,
)
from sysdyn.compiler.forms.momenta import (
    coordinates_by_energy,
    coordinates_of_shared_inertia,
    inertial,
    jumping,
    resolve_momenta,
)
from sysdyn.compiler.model.energies import EnergyModel, Row, UnknownFamily
from sysdyn.compiler.model.terms import Nest, counter, local_variables
from sysdyn.dsl.model.calculus import derivative, differential, gradient, moving, parameter_rates, time_derivative
from sysdyn.dsl.model.calculus import rate as rate_of
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import Node, add, is_const, neg, ordered_variables, substitute, var, variables
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import Loop, loop_ranges
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place

HELD = "#held "
"""Before the name of a coordinate: what its flow and others hold together."""
PARALLEL = 1e-9
"""Sine of the angle between two gradients below which they have one direction."""


def lower(model: EnergyModel, formulation: str, *, legendre: bool) -> DescriptorForm:
    """The descriptor form; `legendre`: every inertial coordinate carries its momentum as an unknown, else those alone
    whose inertia jumps.
    """
    stores = coordinates_by_energy(model)
    carriers = stores | (inertial(model) if legendre else jumping(model))
    model = resolve_momenta(model, frozenset(carriers))
    form = _Lowering(model, stores, frozenset(carriers))
    # rows are declared in the order of the contract, whoever adds to them
    form.declare()
    form.kinetic()
    # efforts on each coordinate
    acting = tuple(efforts(model))
    form.efforts(acting)
    form.constraints()
    # what is read of the run
    add_observations(form.assembly, model, form.carriers)
    stored = add_audit(form.assembly, model, acting)
    # initial values of unknowns, and those of expressions as equations of the start
    pins, equations = pins_and_equations(model, form.carriers, form.families)
    add_initials(form.assembly, model, form.carriers, equations)
    form.families += missing(equations)
    # a start that moves flows moves their momenta together
    if equations or form.moves_flows():
        measured = {n.data[0] for i in model.initials if i.store for n in variables(i.target) if n.op == "var"}
        form.add_momentum_rows(coordinates_of_shared_inertia(model) - carriers - measured)
    owners = (*model.coordinates, *model.unknowns, *model.states, *model.positions)
    shapes = [(f.name, f.shape) for f in owners]
    shapes += [(e.owner, loop_ranges(e.target.nest)) for e in equations]
    shapes += [(HELD + c.name, c.shape) for c in model.coordinates]
    shapes += stored
    # the elements that the rows of one label cover
    hulls: dict[str, list[tuple[tuple[Node, ...], Nest, Place]]] = {}
    for row in model.rows:
        if row.kind != "lambda" and not row.adds:
            hulls.setdefault(row.name, []).append((row.at, row.nest, row.place))
    return DescriptorForm(
        formulation,
        tuple(form.families),
        tuple(form.assembly.rows),
        form.assembly.blocks(),
        pins,
        model.offsets,
        tuple(shapes),
        tuple((name, tuple(places)) for name, places in hulls.items()),
        tuple(form.covers),
    )


def whole(family: UnknownFamily) -> tuple[Nest, tuple[Node, ...]]:
    """The loop nest over all elements of a family, and the indices of its element there."""
    nest = tuple(Loop(f"#{k}", first, last) for k, (first, last) in enumerate(family.shape))
    return nest, tuple(counter(k) for k in range(len(nest)))


def _drift(model: EnergyModel) -> tuple[str, ...]:
    """`drift` where something reads it."""
    read = (n for quantity in model.quantities for n in variables(quantity.expression))
    return ("drift",) if any(n.op == "var" and n.data[:2] == ("drift", "audit") for n in read) else ()


def _massless(model: EnergyModel, carriers: frozenset[str]) -> frozenset[str]:
    """Coordinates whose balances of efforts are algebraic and have a rate, but for elements that a store moves with.

    Of a family only part of which a store moves with, the start leaves the rows with inertia out.  A store that moves
    with one combination of several rates (a capacitor between two nodes) gives none of them an inertia of its own.
    """
    m = model.mirror
    shapes = {c.name: c.shape for c in model.coordinates}
    moved, joined = set[str](), set[str]()
    for function, kind in ((m.coenergy, m.rate), (m.energy, m.conjugate)):
        for term in model.function(function):
            bounds = loop_ranges(term.loops)
            at = tuple(counter(k) for k in range(len(bounds)))
            rates = local_variables(term.expression, kind)
            found = joined if _of_one_combination(term.expression, rates) else moved
            found.update(n.data[0] for n in rates if not n.args or (n.args == at and bounds == shapes[n.data[0]]))
    carried = {name for name in carriers - joined if not shapes[name]}
    return frozenset(shapes) - moved - carried


def _of_one_combination(energy: Node, rates: Sequence[Node]) -> bool:
    """Whether it depends on several rates through one combination c1 r1 + c2 r2 + ...: its gradient has one direction
    wherever they are (asked at two points of random numbers; of what has no value there: no).
    """
    if len(rates) < 2:
        return False
    slopes = gradient(energy, rates)
    if len(rates) == 2 and is_const(add(*slopes), 0.0):
        return True
    drawn, known = random.Random(7), dict[Node, float]()

    def at_random() -> list[float]:
        known.update((rate, drawn.uniform(0.5, 1.5)) for rate in rates)
        return evaluate(slopes, lambda n: known.setdefault(n, drawn.uniform(0.5, 1.5)))

    try:
        one, other = at_random(), at_random()
    except (ValueError, ArithmeticError, KeyError):
        return False
    pivot, size = max(range(len(one)), key=lambda k: abs(one[k])), math.hypot(*one) * math.hypot(*other)
    return all(abs(a * other[pivot] - b * one[pivot]) < PARALLEL * size for a, b in zip(one, other, strict=True))


def _speeds(model: EnergyModel) -> dict[str, tuple[tuple[Node, ...], Node]]:
    """Indices and rate of each dynamic variable whose dynamic is one expression over its whole range."""
    rows: dict[str, list[Row]] = {}
    for row in model.of_kind("lambda"):
        rows.setdefault(row.name, []).append(row)
    single = {name: found[0] for name, found in rows.items() if len(found) == 1}
    return {
        name: (row.at, add(*(t.expression for t in row.terms)))
        for name, row in single.items()
        if all(t.loops == row.nest for t in row.terms) and all(a.op == "index" for a in row.at)
    }


def total_rate(root: Node) -> Node:
    """Total derivative by t, the derivatives of multipliers among its variables."""
    seeds = {n: rate_of(n) or var(*n.data[:2], *n.args, order=1) for n in ordered_variables(root)}
    return differential(root, parameter_rates(root) | seeds)


class _Lowering:
    """One lowering under way: the families decided, rows collected in `assembly`."""

    def __init__(self, model: EnergyModel, stores: frozenset[str], carriers: frozenset[str]) -> None:
        self.model = model
        self.stores = stores
        self.carriers = carriers
        self.massless = _massless(model, carriers)
        self.speeds = _speeds(model)
        self.assembly = Assembly()
        self.covers: list[Cover] = []
        self.families = self._families()

    def _families(self) -> list[Unknowns]:
        """Unknowns in the order of the contract: displacements, flows, momenta, states, implicit efforts, multipliers,
        audits.
        """
        m = self.model
        # an integrated psi makes nothing tangible, but its displacements are variables
        pieces = [t.expression for row in m.of_kind("phi") for t in row.terms]
        held = {n.data[0] for piece in pieces for n in local_variables(piece, m.mirror.coordinate)}
        seen = displacement_unknowns(
            m, observed_coordinates(m, self.carriers) | held | {c.name for c in m.coordinates if c.tangible}
        )
        found = [Unknowns(c.shown, "q", c.name, c.units["q"], c.place) for c in m.coordinates if c.name in seen]
        rates = [f"({c.shown})'" if c.less else f"{c.name}'" for c in m.coordinates]
        found += [Unknowns(r, "f", c.name, c.units["f"], c.place) for c, r in zip(m.coordinates, rates, strict=True)]
        found += [
            Unknowns(f"{c.name}.p", "p", c.name, c.units["p"], c.place)
            for c in m.coordinates
            if c.name in self.carriers
        ]
        found += [Unknowns(s.name, "s", s.name, s.units["s"], s.place) for s in m.states]
        found += [Unknowns(u.name, "e", u.name, u.units["e"], u.place) for u in m.unknowns]
        integrated = {offset.label for offset in m.offsets}
        for kind, row_kind in (("kappa", "phi"), ("mu", "psi")):
            names = dict.fromkeys(row.name for row in m.of_kind(row_kind))
            places = {row.name: row.place for row in reversed(m.rows)}
            # a flow constraint times its multiplier is power, also where it was integrated
            power = {n: kind == "mu" or n in integrated for n in names}
            units = {n: f"{'W' if power[n] else 'J'}/({m.labels[n]})" for n in names}
            found += [Unknowns(f"{n}.multiplier", kind, n, units[n], places[n]) for n in names]
        for point in m.positions:
            shown = point.name.removesuffix("start") + "q"
            found.append(Unknowns(shown, "start", point.name, point.units["start"], point.place))
        found += [Unknowns(f"audit.{n}", "audit", n, "J", None) for n in (*AUDIT, *_drift(m))]
        return found

    def declare(self) -> None:
        """All row families, in the order of the contract."""
        declare = self.assembly.family
        # balances, momenta, constraints, rates of states
        for c in self.model.coordinates:
            declare(EquationFamily("dynamics", c.name, c.name, "dynamics", c.units["e"], c.place))
        for c in self.model.coordinates:
            if c.name in self.carriers:
                declare(EquationFamily("momentum", c.name, c.name, "momentum", c.units["p"], c.place))
        for kind in ("phi", "psi", "gamma"):
            offset = {o.label for o in self.model.offsets} if kind == "phi" else set[str]()
            for name, rows in _by_name(self.model.of_kind(kind)).items():
                rate = all(self._has_rate(row) for row in rows)
                unit = self.model.labels[name]
                unit = f"{unit}.s" if name in offset else unit
                declare(EquationFamily(kind, name, name, kind, unit, rows[0].place, rate))
        said = _by_name(self.model.of_kind("lambda"))
        for s in self.model.states:
            rows = said.get(s.name, [])
            place = rows[0].place if rows else s.place
            declare(EquationFamily("lambda", s.name, s.name, "lambda", f"{s.units['s']}/s", place))

    def _has_rate(self, row: Row) -> bool:
        """Whether the total time derivative of every row is known: multipliers have none."""
        return not any(local_variables(t.expression, ("kappa", "mu"), None) for t in row.terms)

    def kinetic(self) -> None:
        """Momenta: M f' + ... of coordinates without, p' and the momentum row of those with one."""
        add, mirror = self.assembly.add, self.model.mirror
        for family in self.model.coordinates:
            if family.name in self.carriers:
                self._carrier(family)
        # p = dT*/df as a row, or its rate in the balance
        for term in self.model.function(mirror.coenergy):
            for rate in local_variables(term.expression, mirror.rate):
                if rate.data[0] in self.model.solved:
                    continue
                slope = derivative(term.expression, rate)
                if rate.data[0] in self.carriers - self.stores:
                    self._momentum(rate.data[0], rate.args, term.loops, neg(slope))
                else:
                    add("dynamics", rate.data[0], rate.args, term.loops, time_derivative(slope))
        # f = dT/dp where the author gave T
        for term in self.model.function(mirror.energy):
            for p in local_variables(term.expression, mirror.conjugate):
                self._momentum(p.data[0], p.args, term.loops, derivative(term.expression, p))

    def _carrier(self, family: UnknownFamily) -> None:
        """P' of the elements that a store moves with, and the momentum row of all: p, or -f where T is given."""
        m, name = self.model.mirror, family.name
        given = name in self.stores
        nest, at = whole(family)
        moved, partly = nest, cover(self.model, family, given=given)
        if partly is not None:
            self.covers.append(partly)
            moved = inside(name)
        self.assembly.add("dynamics", name, at, moved, var(name, m.conjugate, *at, order=1))
        held = var(name, m.conjugate, *at)
        # 0 = dT/dp - f and its rate are given: nothing is added to them
        if name in self.model.solved:
            zero, rate = self.model.solved[name]
            self.assembly.add("momentum", name, at, nest, zero)
            self.assembly.add("momentum_rate", name, at, nest, rate)
            return
        # p, to which the other terms of the row come
        if not given:
            self._momentum(name, at, nest, held)
            return
        # -f where T(p) is given, p at the other elements
        self._momentum(name, at, moved, neg(var(name, m.rate, *at)))
        for rest in outside(family) if partly is not None else ():
            self._momentum(name, at, rest, held)

    def _momentum(self, owner: str, at: tuple[Node, ...], nest: Nest, expression: Node) -> None:
        self.assembly.add("momentum", owner, at, nest, expression)
        self.assembly.add("momentum_rate", owner, at, nest, time_derivative(expression))

    def moves_flows(self) -> bool:
        """Whether something may move flows from their guesses at the start: constraints, or balances without inertia in
        sum.
        """
        m = self.model.mirror
        inertias = [(t.expression, local_variables(t.expression, m.rate)) for t in self.model.function(m.coenergy)]
        one = any(_of_one_combination(energy, rates) for energy, rates in inertias)
        return one or any(row.kind != "lambda" for row in self.model.rows)

    def add_momentum_rows(self, names: frozenset[str]) -> None:
        """The least change of these flows is that of the momenta which they make together: what they miss of zero, at
        the start alone, as momenta that are unknowns change there.
        """
        m = self.model.mirror
        # a row and an unknown for what the momentum misses
        for c in self.model.coordinates:
            if c.name in names:
                owner, (nest, at) = HELD + c.name, whole(c)
                self.families.append(Unknowns(owner, "unsaid", owner, f"p {c.units['e']}", c.place))
                rows = EquationFamily("initial", c.name, owner, "initial", c.units["p"], c.place, content=True)
                self.assembly.family(rows)
                self.assembly.add("initial", owner, at, nest, neg(var(owner, "unsaid", *at)))
        # dT*/df of each
        for term in self.model.function(m.coenergy):
            for rate in local_variables(term.expression, m.rate):
                if rate.data[0] in names:
                    slope = derivative(term.expression, rate)
                    self.assembly.add("initial", HELD + rate.data[0], rate.args, term.loops, slope)

    def efforts(self, acting: Iterable[Effort]) -> None:
        """Gradients, works and reactions."""
        for found in acting:
            self._effort(found)

    def constraints(self) -> None:
        """Phi, Psi, Gamma, Lambda, and the total time derivatives of all."""
        for row in self.model.rows:
            accelerates = row.kind == "phi" or self._prescribes_motion(row)
            for term in row.terms:
                expression = term.expression
                if row.kind == "lambda":
                    self.assembly.add("lambda", row.name, row.at, term.loops, neg(expression))
                    continue
                self.assembly.add(row.kind, row.name, row.at, term.loops, expression)
                self._rates(row, term.loops, expression, accelerates=accelerates)
            if row.kind == "lambda":
                own = var(row.name, "s", *row.at, order=1)
                self.assembly.add("lambda", row.name, row.at, row.nest, own)

    def _in_states(self, root: Node, what: str, place: Place | None) -> Node:
        """The expression with the rates of dynamic variables replaced by what they are: it has a rate of its own."""
        for _ in range(1 + len(self.speeds)):
            rates = [n for n in ordered_variables(root) if n.op == "var" and n.data[1:] == ("s", 1)]
            if not rates:
                return root
            if any(n.data[0] not in self.speeds for n in rates):
                break
            root = substitute(root, {n: self._speed(n) for n in rates})
        names = ", ".join(sorted(to_text(n) for n in rates))
        text = f"the rate of {what} is needed, and with it that of {names}, whose dynamic is said in parts"
        raise ModelError([Diagnostic("E518", text, place, "one dynamic over the whole range")])

    def _speed(self, rate: Node) -> Node:
        at, speed = self.speeds[rate.data[0]]
        return substitute(speed, dict(zip(at, rate.args, strict=True)))

    def _effort(self, effort: Effort) -> None:
        """A summand of the balance of a coordinate; where that is algebraic, its rate holds too."""
        on = effort.on
        self.assembly.add(effort.block, on.data[0], on.args, effort.nest, effort.value)
        if on.data[0] in self.massless:
            rate = total_rate(self._in_states(effort.value, f"the balance of {on.data[0]}", None))
            self.assembly.add("dynamics_rate", on.data[0], on.args, effort.nest, rate)

    def _prescribes_motion(self, row: Row) -> bool:
        """Whether a gamma reads displacements alone, one of what has inertia: b = sin(t) says what the acceleration
        of b is, and so which effort makes it.
        """
        if row.kind != "gamma":
            return False
        read = {v for term in row.terms for v in variables(term.expression) if v.op == "var"}
        own = {v.data[0] for v in read if v.data[1] == self.model.mirror.coordinate and not v.data[2]}
        return len(own) == len({v.data for v in read}) and bool(own - self.massless)

    def _rates(self, row: Row, nest: Nest, expression: Node, *, accelerates: bool) -> None:
        if not self._has_rate(row):
            return
        integrated = any(offset.label == row.name for offset in self.model.offsets)
        with moving(()) if integrated else nullcontext():  # its primitive took parameters for constants
            rate = time_derivative(self._in_states(expression, f"{row.kind} {row.name}", row.place))
            self.assembly.add(f"{row.kind}_rate", row.name, row.at, nest, rate)
            if accelerates:
                self.assembly.add(f"{row.kind}_acceleration", row.name, row.at, nest, time_derivative(rate))


def _by_name(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by their label, in their order."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.name, []).append(row)
    return found
