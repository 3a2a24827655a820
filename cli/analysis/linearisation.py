"""The linearisation of a model: exact slopes by its inputs, of its outputs, and what the runtime makes of them.

    E dy' = A dy + B du        the form as written, or the index form asked
    dv = C dy + Cd dy' + D du

and the reduction onto the constraint manifold (`runtime/linear/tangent.py`), which holds about moving states too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.analysis.operating_point import Found, contents, own_inputs
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request.targets import Target
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.binding.sensitivity import FIRST, LAST, Sensitivity
from sysdyn.dsl.model.expression import variables
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.model.units import si_text
from sysdyn.dsl.names.symbols import nearest
from sysdyn.dsl.tree import syntax
from sysdyn.runtime.linear.modes import Eigenmode, Transfer, modes, store_shares, transfer, wide_transfer
from sysdyn.runtime.linear.pencil import Descriptor
from sysdyn.runtime.linear.states import constant, moving, quadratures
from sysdyn.runtime.linear.tangent import Given, NoLinearisation, Outputs, Reduced, Wide, integral, rows_at
from sysdyn.runtime.linear.witnessed import reduce_witnessed
from sysdyn.runtime.model.forms import FORMS, Form
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

Array = NDArray[np.float64]
Input = tuple[str, tuple[int, ...]]
_INPUT = re.compile(r"(.+?)(?:\[\s*(-?\d+(?:\s*,\s*-?\d+)*)\s*\])?")
MOVING = 1e-9
"""Largest rate of a state, in its size a second, that counts as rest."""
VELOCITIES, MOMENTA = ("m/s", "rad/s"), ("N.s", "N.m.s")
"""Units of unknowns that tell that a body moves."""


@dataclass(frozen=True, slots=True)
class Linearisation:
    """A linearisation at t [s]; moving: a state whose motion changes the matrices; steady: one that moves and does
    not; energies [modes, stores]: shares of each; units: of inputs (SI) and outputs (as traced) by name.
    """

    t: float
    y: Array
    descriptor: Descriptor
    reduced: Reduced
    modes: tuple[Eigenmode, ...]
    transfers: tuple[Transfer, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    moving: bool
    steady: bool
    stores: tuple[str, ...]
    energies: Array
    units: dict[str, str]

    def label(self, found: Transfer) -> str:
        """`x [mm] by F [N]`."""
        ends = self.outputs[found.output], self.inputs[found.input]
        units = (self.units.get(name, self.units.get(name.partition("[")[0], "1")) for name in ends)
        return " by ".join(name if u == "1" else f"{name} [{u}]" for name, u in zip(ends, units, strict=True))


def inputs_of(target: Target, prepared: Prepared, asked: Sequence[str] | None) -> tuple[Input, ...]:
    """Parameters and inputs by name and index; where none is asked the model's own inputs, element by element.

    Raises UsageError.
    """
    known = {p.name: p for p in prepared.network.parameters}
    # each element of the model's own inputs
    if asked is None:
        boxes = prepared.binding.parameters.boxes
        ranges_of = {n: [range(a, b + 1) for a, b in boxes.get(n, ())] for n in own_inputs(target, prepared.network)}
        return tuple((name, at) for name, ranges in ranges_of.items() for at in product(*ranges))
    own = [s.decl.name for s in target.model.body if isinstance(s, syntax.InputStatement)]
    found: list[Input] = []
    # `u`, `u[2]`, or a parameter
    for text in asked:
        match = _INPUT.fullmatch(text.strip())
        name = match[1] if match else text
        at = tuple(int(k) for k in match[2].split(",")) if match and match[2] else ()
        # an array by a formula, something of an element, or nothing
        if name not in known:
            if name in own:
                raise UsageError(f"input '{name}' is an array by a formula: --set {name}=[...] gives it numbers")
            near, element = nearest(name, [*known, *own]), name.partition(".")[0]
            if near is None and element in (
                s.decl.name for s in target.model.body if isinstance(s, syntax.InstanceStatement)
            ):
                how = f"an input in its formula, 'input u ... = 0' and '{element}: ...( ... + u)', moves it"
                raise UsageError(f"--inputs: '{name}' is no parameter or input, but what an element gives: {how}")
            listed = f"nearest: '{near}'" if near else f"there are: {', '.join(known) or 'none'}"
            raise UsageError(f"--inputs: there is no parameter or input '{name}'; {listed}")
        # the index lies in the array
        box = prepared.binding.parameters.boxes.get(name, ()) if known[name].shape else ()
        outside = [k for k, (first, last) in zip(at, box, strict=False) if not first <= k <= last]
        if len(at) != len(known[name].shape) or outside:
            ranges = ", ".join(f"{first}..{last}" for first, last in box)
            raise UsageError(f"--inputs: '{text}': " + (f"one element of {name}[{ranges}]" if box else "is no array"))
        found.append((name, at))
    return tuple(found)


def loose_of(found: Found) -> NDArray[np.bool_]:
    """Unknowns that nothing depends on [unknowns as written]."""
    tangible = {c.name for c in found.prepared.compiled.energies.coordinates if c.tangible}
    return quadratures(found.system, tangible)


def linearise(found: Found, inputs: Sequence[Input], index: str = "3", watched: Sequence[int] = ()) -> Linearisation:
    """The linearisation at the state of `found`; watched: places of unknowns that are outputs too, the last ones.

    Raises NoLinearisation.
    """
    state, system = found.state, found.system
    rows = rows_at(system, state)
    # of all rows by each input, up to its second rate
    slopes = [
        Sensitivity(found.prepared.compiled.form, found.binding, found.prepared.network, name, at)
        for name, at in inputs
    ]
    labels = tuple(name + (f"[{','.join(map(str, at))}]" if at else "") for name, at in inputs)
    # an input whose third rate the hidden constraints read
    if deeper := [label for label, slope in zip(labels, slopes, strict=True) if slope.deeper]:
        raise NoLinearisation(f"the equations need a third rate of {', '.join(deeper)}")
    names, out = _append_unknowns(_outputs(found, slopes), system, watched)
    by_input = tuple(
        _columns(rows.starter.settled.form, found, [(s, order) for s in slopes]) for order in range(FIRST, LAST + 1)
    )
    fixed = constant(system, state)
    # at rest, or constant matrices: the pencil of the written form gives the same eigenvalues
    still = fixed or not moving(system, state)  # the pencil of the form as written is right too
    pencil = _descriptor(system, found, slopes, out, labels) if still else None
    # on the constraint manifold, with the pencil as a witness
    small = reduce_witnessed(Given(rows, system, state, by_input, out, labels, loose_of(found)), pencil, fixed=fixed)
    own = modes(small.a, small.decomposed)
    stores, energies = _energies(found, small, own, names)
    # outputs that were added for energies alone are not shown
    kept = _requested_places(found, names)
    names, small, out = tuple(names[k] for k in kept), _rows(small, kept), _seen(out, kept)
    # the matrices of the index form that was asked for
    form = system if index == "3" else system.another(index)
    descriptor = _descriptor(form, found, slopes, out, labels)
    pairs = ((i, j) for i in range(len(names)) for j in range(len(labels)))
    transfers = tuple(_transfer(small, i, j) for i, j in pairs)
    moves, steady = _felt_moves(system, small, found)
    named = transfers, labels, names, moves, steady, stores, energies, _units(found.prepared.network)
    return Linearisation(state.t, state.y, descriptor, small, own, *named)


def _units(network: Network) -> dict[str, str]:
    inputs = {p.name: si_text(p.unit.dimension) for p in network.parameters}
    return inputs | {o.name: o.unit.text for o in network.observations}


def _append_unknowns(
    seen: tuple[tuple[str, ...], Outputs], system: System, watched: Sequence[int]
) -> tuple[tuple[str, ...], Outputs]:
    """The outputs, and unknowns behind them."""
    names, out = seen
    own = np.eye(out.by_y.shape[1])[list(watched)]
    still, none = 0.0 * own, np.zeros((len(watched), out.by_input[0].shape[1]))
    one, rate, twice = (np.vstack([part, none]) for part in out.by_input)
    both = np.vstack([out.by_y, own]), np.vstack([out.by_rate, still])
    return (*names, *(system.name(int(k)) for k in watched)), Outputs(*both, (one, rate, twice))


def _requested_places(found: Found, names: Sequence[str]) -> list[int]:
    """Places of the outputs that were asked for, without what is observed of stores alone."""
    return [k for k, name in enumerate(names) if name not in found.prepared.unasked]


def _rows(small: Reduced, kept: list[int]) -> Reduced:
    """The reduction with some of its outputs."""

    def part(wide: Wide | None) -> Wide | None:
        return None if wide is None else Wide(wide.a, wide.b, wide.c[kept], wide.d[kept], part(wide.beside))

    c, d, d1, d2 = (m[kept] for m in (small.c, small.d, small.d1, small.d2))
    return replace(small, c=c, d=d, d1=d1, d2=d2, wide=part(small.wide))


def _seen(out: Outputs, kept: list[int]) -> Outputs:
    one, rate, twice = (part[kept] for part in out.by_input)
    return Outputs(out.by_y[kept], out.by_rate[kept], (one, rate, twice))


def _energies(
    found: Found, small: Reduced, own: Sequence[Eigenmode], names: Sequence[str]
) -> tuple[tuple[str, ...], Array]:
    """Names of the stores and their shares of the energy of each mode."""
    at = {name: k for k, name in enumerate(names)}
    known = [s for s in contents(found.prepared.network) if s[1] in at and s[2] in at]
    if not known or not own:
        return (), np.zeros((len(own), 0))
    content, conjugate = (small.c[[at[s[k]] for s in known]] for k in (1, 2))
    return tuple(s[0] for s in known), store_shares(own, content, conjugate)


def _transfer(small: Reduced, i: int, j: int) -> Transfer:
    """Output i by input j."""
    improper = float(small.d1[i, j]), float(small.d2[i, j])
    if small.wide is None or small.wide.beside is None:
        return transfer(small.a, small.b[:, j], small.c[i], float(small.d[i, j]), (i, j), improper)
    one, other = ((w.a, w.b[:, j], w.c[i], w.d[i, j]) for w in (small.wide, small.wide.beside))
    return wide_transfer(one, other, (i, j), improper)


def _descriptor(
    form: System, found: Found, slopes: Sequence[Sensitivity], out: Outputs, labels: tuple[str, ...]
) -> Descriptor:
    """The matrices of an index form; what rows hold of an input besides its value is an unknown.

    z = (y, integrals s, inputs v, their rates w):  E y' - B1 v' - B2 w' = A y + B-1 s + B0 u,  s' = u,  0 = u - v,
    v' = w, each for the inputs that need it.
    """
    y, yd = found.state.for_form(form)
    jy, jyd = form.jacobian(found.state.t, y, yd)
    # slopes of rows by integral, value, rate and second rate of each input
    by = {k: -_columns(form.form, found, [(s, k) for s in slopes]) for k in range(FIRST, LAST + 1)}
    there = {k: by[k].any(axis=0) for k in by}
    # outputs may read rates of inputs too
    for k in (1, 2):
        there[k] = there[k] | out.by_input[k].any(axis=0)
    summed, valued, rated = (np.flatnonzero(m) for m in (there[FIRST], there[1] | there[2], there[2]))
    sizes = (form.unknowns, summed.size, valued.size, rated.size)
    at_y, at_s, at_v, at_w = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])
    rows, unit = form.rows, np.eye(len(labels))
    # rows of the form, then those of integrals, inputs and rates
    e, a = (np.zeros((rows + at_w.size + at_v.size + at_s.size, sum(sizes))) for _ in range(2))
    of_s, of_v, of_w = np.split(np.arange(rows, e.shape[0]), np.cumsum(sizes[1:])[:-1])
    e[:rows, at_y], e[:rows, at_v], e[:rows, at_w] = form.dense(jyd), -by[1][:, valued], -by[2][:, rated]
    a[:rows, at_y], a[:rows, at_s] = -form.dense(jy), by[FIRST][:, summed]
    e[of_s, at_s], a[of_v, at_v], a[of_w, at_w] = 1.0, -1.0, 1.0
    e[of_w, at_v[np.isin(valued, rated)]] = 1.0
    b = np.vstack([by[0], unit[summed], unit[valued], 0.0 * unit[rated]])
    # outputs do not read these directly
    wide = np.zeros((out.by_y.shape[0], sum(sizes) - out.by_y.shape[1]))
    c, cd = (np.hstack([part, wide]) for part in (out.by_y, out.by_rate))
    cd[:, at_v], cd[:, at_w] = out.by_input[1][:, valued], out.by_input[2][:, rated]
    names = (
        *form.unknown_names,
        *(integral(labels[k]) for k in summed),
        *(labels[k] for k in valued),
        *(f"rate of {labels[k]}" for k in rated),
    )
    return Descriptor(e, a, b, c, cd, out.by_input[0], names)


def _columns(form: Form, found: Found, slopes: Sequence[tuple[Sensitivity, int]]) -> Array:
    """dR/du, dR/du' or dR/du'' of the rows of a form [rows, inputs]."""
    state, description = found.state, found.system.description
    y = np.concatenate([state.y, np.zeros(form.extended - state.y.size)])
    yd = np.concatenate([state.yd, np.zeros(form.extended - state.yd.size)])
    to = np.concatenate([[0], np.cumsum([row.size for row in description.rows])])
    result = np.zeros((form.rows, len(slopes)))
    for k, (slope, order) in enumerate(slopes):
        of_block: dict[str, Array] = {}
        for block, group in FORMS[form.name]:
            if block in description.blocks:
                of_block[group] = of_block.get(group, 0.0) + slope.rows(block, order, state.t, y, yd)
        for group, family, first in form.groups:
            size = description.rows[family].size
            result[first : first + size, k] = of_block[group][to[family] : to[family + 1]]
    return result


def _outputs(found: Found, slopes: Sequence[Sensitivity]) -> tuple[tuple[str, ...], Outputs]:
    """Names of the observed quantities and their slopes; ledgers of a whole run have none."""
    form, state, system = found.prepared.compiled.form, found.state, found.system
    oracle = Oracle(form, found.binding)
    room = max(system.form.extended, system.form.written)
    y = np.concatenate([state.y, np.zeros(room - state.y.size)])
    yd = np.concatenate([state.yd, np.zeros(room - state.yd.size)])
    block = form.block("observe")
    ledgers = {s.row for k in (block.kernels if block else ()) for s in k.rows if _reads_ledger(s.expression)}
    families = [k for k, row in enumerate(form.rows) if row.block == "observe" and row.stored and k not in ledgers]
    names = tuple(form.rows[k].owner for k in families)
    parts = []
    for order in (0, 1):
        values, rows, columns = oracle.entries("observe", order, state.t, y, yd)
        full = np.zeros((int(oracle.to[-1]), room))
        np.add.at(full, (rows.astype(int), columns.astype(int)), values)
        parts.append(full[oracle.to[families]][:, : system.form.written])
    at, shape = oracle.to[families], (len(names), len(slopes))
    one, rate, twice = (
        np.array([s.rows("observe", order, state.t, y, yd)[at] for s in slopes]).T.reshape(shape)
        for order in range(LAST + 1)
    )
    return names, Outputs(parts[0], parts[1], (one, rate, twice))


def _reads_ledger(expression: object) -> bool:
    return any(n.op == "var" and n.data[1] == "audit" for n in variables(expression))  # type: ignore[arg-type]


def _felt_moves(system: System, small: Reduced, found: Found) -> tuple[bool, bool]:
    """Whether the motion changes what the matrices say, and whether there is one that goes on steadily."""
    state, lasting = found.state, _lasting(system, found)
    yd = state.yd.copy()
    yd[system.form.k_q] = state.y[system.form.k_f]
    rates = np.where(small.places >= 0, yd[small.places], 0.0)
    size = np.maximum(np.abs(state.y[small.places]), 1.0)
    rates = np.where(np.abs(rates) > MOVING * size, rates, 0.0)
    changes = small.a @ rates
    felt = np.abs(changes) > MOVING * np.maximum(np.abs(small.a) @ np.abs(rates), 1e-300)
    goes_on = rates[(small.places >= 0) & lasting[small.places]].any() or _rolls(system, found)
    return bool(felt.any()), bool(goes_on and not felt.any())


def _lasting(system: System, found: Found) -> NDArray[np.bool_]:
    """Unknowns whose going on is a motion: states, and displacements that something depends on [unknowns as written].

    Charges and volumes that pass through a circuit at rest are none.
    """
    tangible = {c.name for c in found.prepared.compiled.energies.coordinates if c.tangible}
    families, kinds = system.description.families, system.kinds[: system.form.written]
    owned = [families[int(k)].owner in tangible for k in system.family_of[: system.form.written]]
    return np.asarray((kinds == "s") | np.array(owned, dtype=bool), dtype=bool)


def _rolls(system: System, found: Found) -> bool:
    """Whether a body has a velocity or a momentum, also where no position is an unknown: of a wheel that rolls."""
    units = {c.name: (c.units, c.tangible) for c in found.prepared.compiled.energies.coordinates}
    for k in np.flatnonzero(np.abs(found.state.y[: system.form.written]) > MOVING):
        owner, kind = system.description.families[int(system.family_of[k])].owner, str(system.kinds[k])
        known, tangible = units.get(owner, ({}, False))
        if known.get(kind) in VELOCITIES or (known.get(kind) in MOMENTA and (tangible or kind == "p")):
            return True
    return False
