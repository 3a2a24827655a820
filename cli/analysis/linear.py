"""The linearisation of a model: exact slopes by its inputs, of its outputs, and what the runtime makes of them.

    E dy' = A dy + B du        the form as written, or the index form asked
    dv = C dy + Cd dy' + D du

and the reduction onto the constraint manifold (`runtime/linear/tangent.py`), which holds about moving states too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.analysis.asked import Found, contents
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.targets import Target
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.binding.sensitivity import FIRST, LAST, Sensitivity
from sysdyn.dsl.model.expression import variables
from sysdyn.dsl.names.symbols import nearest
from sysdyn.dsl.tree import syntax
from sysdyn.runtime.linear.modes import Mode, Transfer, modes, stored, transfer, wide_transfer
from sysdyn.runtime.linear.pencil import Descriptor
from sysdyn.runtime.linear.states import constant, moving, quadratures
from sysdyn.runtime.linear.tangent import Given, Outputs, Reduced, Wide, integral, rows_at
from sysdyn.runtime.linear.witnessed import witnessed
from sysdyn.runtime.model.forms import FORMS, Form
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

Array = NDArray[np.float64]
Input = tuple[str, tuple[int, ...]]
_INPUT = re.compile(r"(.+?)(?:\[\s*(-?\d+(?:\s*,\s*-?\d+)*)\s*\])?")
MOVING = 1e-9
"""Largest rate of a state, in its size a second, that counts as rest."""


@dataclass(frozen=True, slots=True)
class Linear:
    """A linearisation at t [s]; moving: a state whose motion changes the matrices; steady: one that moves and does
    not; energies [modes, stores]: shares of each.
    """

    t: float
    y: Array
    descriptor: Descriptor
    reduced: Reduced
    modes: tuple[Mode, ...]
    transfers: tuple[Transfer, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    moving: bool
    steady: bool
    stores: tuple[str, ...]
    energies: Array


def inputs_of(target: Target, prepared: Prepared, asked: Sequence[str] | None) -> tuple[Input, ...]:
    """Parameters and inputs by name and index; the model's own inputs where none is asked.  Raises UsageError."""
    known = {p.name: p for p in prepared.network.parameters}
    own = [s.decl.name for s in target.model.body if isinstance(s, syntax.Input)]
    if asked is None:
        return tuple((name, ()) for name in own if name in known)
    found: list[Input] = []
    for text in asked:
        match = _INPUT.fullmatch(text.strip())
        name = match[1] if match else text
        at = tuple(int(k) for k in match[2].split(",")) if match and match[2] else ()
        if name not in known:
            if name in own:
                raise UsageError(f"input '{name}' follows a formula in time: --set {name}=... gives it a constant")
            near = nearest(name, [*known, *own])
            listed = f"nearest: '{near}'" if near else f"there are: {', '.join(known) or 'none'}"
            raise UsageError(f"--inputs: there is no parameter or input '{name}'; {listed}")
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


def linearised(found: Found, inputs: Sequence[Input], index: str = "3") -> Linear:
    """The linearisation at the state of `found`.  Raises NoLinearisation."""
    state, system = found.state, found.system
    rows = rows_at(system, state)
    slopes = [
        Sensitivity(found.prepared.compiled.form, found.binding, found.prepared.network.parameters, name, at)
        for name, at in inputs
    ]
    names, out = _outputs(found, slopes)
    labels = tuple(name + (f"[{','.join(map(str, at))}]" if at else "") for name, at in inputs)
    by_input = tuple(
        _columns(rows.starter.settled.form, found, [(s, order) for s in slopes]) for order in range(FIRST, LAST + 1)
    )
    fixed = constant(system, state)
    still = fixed or not moving(system, state)  # the pencil of the form as written is right too
    pencil = _descriptor(system, found, slopes, out, labels) if still else None
    small = witnessed(Given(rows, system, state, by_input, out, labels, loose_of(found)), pencil, fixed=fixed)
    own = modes(small.a, small.decomposed)
    stores, energies = _energies(found, small, own, names)
    kept = _asked(found, names)
    names, small, out = tuple(names[k] for k in kept), _rows(small, kept), _seen(out, kept)
    form = system if index == "3" else system.another(index)
    descriptor = _descriptor(form, found, slopes, out, labels)
    pairs = ((i, j) for i in range(len(names)) for j in range(len(labels)))
    transfers = tuple(_transfer(small, i, j) for i, j in pairs)
    moves, steady = _felt_moves(system, small, found)
    return Linear(
        state.t, state.y, descriptor, small, own, transfers, labels, names, moves, steady, stores, energies
    )


def _asked(found: Found, names: Sequence[str]) -> list[int]:
    """Places of the outputs that were asked for, without what is observed of stores alone."""
    return [k for k, name in enumerate(names) if name not in found.prepared.unasked]


def _rows(small: Reduced, kept: list[int]) -> Reduced:
    """The reduction with some of its outputs."""

    def part(wide: Wide | None) -> Wide | None:
        return None if wide is None else Wide(wide.a, wide.b, wide.c[kept], wide.d[kept], part(wide.beside))

    c, d, d1, d2 = (m[kept] for m in (small.c, small.d, small.d1, small.d2))
    return replace(small, c=c, d=d, d1=d1, d2=d2, wide=part(small.wide))


def _seen(out: Outputs, kept: list[int]) -> Outputs:
    return Outputs(out.by_y[kept], out.by_rate[kept], out.by_input[kept])


def _energies(
    found: Found, small: Reduced, own: Sequence[Mode], names: Sequence[str]
) -> tuple[tuple[str, ...], Array]:
    """Names of the stores and their shares of the energy of each mode."""
    at = {name: k for k, name in enumerate(names)}
    known = [s for s in contents(found.prepared.network) if s[1] in at and s[2] in at]
    if not known or not own:
        return (), np.zeros((len(own), 0))
    content, conjugate = (small.c[[at[s[k]] for s in known]] for k in (1, 2))
    return tuple(s[0] for s in known), stored(own, content, conjugate)


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
    """The matrices of an index form; an input that a row holds integrated has its integral for an unknown."""
    y, yd = found.state.for_form(form)
    jy, jyd = form.jacobian(found.state.t, y, yd)
    e, a = form.dense(jyd), -form.dense(jy)
    b, by_integral = (-_columns(form.form, found, [(s, order) for s in slopes]) for order in (0, FIRST))
    summed = np.flatnonzero(by_integral.any(axis=0))
    more = np.zeros((summed.size, form.unknowns))
    a = np.block([[a, by_integral[:, summed]], [more, np.zeros((summed.size, summed.size))]])
    e = np.block([[e, 0.0 * by_integral[:, summed]], [more, np.eye(summed.size)]])
    b = np.vstack([b, np.eye(len(labels))[summed]])
    wide = np.zeros((out.by_y.shape[0], e.shape[1] - out.by_y.shape[1]))
    c, cd = (np.hstack([part, wide]) for part in (out.by_y, out.by_rate))
    return Descriptor(e, a, b, c, cd, out.by_input, (*form.unknown_names, *(integral(labels[k]) for k in summed)))


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
    families = [
        k for k, row in enumerate(form.rows) if row.block == "observe" and row.stored and k not in ledgers
    ]
    names = tuple(form.rows[k].owner for k in families)
    parts = []
    for order in (0, 1):
        values, rows, columns = oracle.entries("observe", order, state.t, y, yd)
        full = np.zeros((int(oracle.to[-1]), room))
        np.add.at(full, (rows.astype(int), columns.astype(int)), values)
        parts.append(full[oracle.to[families]][:, : system.form.written])
    by_input = [s.rows("observe", 0, state.t, y, yd)[oracle.to[families]] for s in slopes]
    return names, Outputs(parts[0], parts[1], np.array(by_input).T.reshape(len(names), len(slopes)))


def _reads_ledger(expression: object) -> bool:
    return any(n.op == "var" and n.data[1] == "audit" for n in variables(expression))  # type: ignore[arg-type]


def _felt_moves(system: System, small: Reduced, found: Found) -> tuple[bool, bool]:
    """Whether the motion changes what the matrices say, and whether there is one that goes on steadily."""
    state = found.state
    yd = state.yd.copy()
    yd[system.form.k_q] = state.y[system.form.k_f]
    rates = np.where(small.places >= 0, yd[small.places], 0.0)
    size = np.maximum(np.abs(state.y[small.places]), 1.0)
    rates = np.where(np.abs(rates) > MOVING * size, rates, 0.0)
    changes = small.a @ rates
    felt = np.abs(changes) > MOVING * np.maximum(np.abs(small.a) @ np.abs(rates), 1e-300)
    return bool(felt.any()), bool(rates.any() and not felt.any())
