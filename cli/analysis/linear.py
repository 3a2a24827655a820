"""The linearisation of a model: exact slopes by its inputs, of its outputs, and what the runtime makes of them.

    E dy' = A dy + B du        the form as written, or the index form asked
    dv = C dy + Cd dy' + D du

and the reduction onto the constraint manifold (`runtime/linear/tangent.py`), which holds about moving states too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

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
from sysdyn.runtime.linear import precise
from sysdyn.runtime.linear.modes import Mode, Transfer, modes, stored, transfer, wide_transfer
from sysdyn.runtime.linear.pencil import motions, surely_parted, widely_parted
from sysdyn.runtime.linear.tangent import (
    NoLinearisation,
    Outputs,
    Reduced,
    Rows,
    Wide,
    candidates_of,
    chosen_states,
    constant,
    integral,
    lost,
    moving,
    quadratures,
    reduced,
    rows_at,
    widely_reduced,
)
from sysdyn.runtime.linear.witness import CONTRAST, Witness, agrees, spread, witness
from sysdyn.runtime.model.forms import FORMS, Form
from sysdyn.runtime.model.system import System

Array = NDArray[np.float64]
Input = tuple[str, tuple[int, ...]]
_INPUT = re.compile(r"(.+?)(?:\[\s*(-?\d+(?:\s*,\s*-?\d+)*)\s*\])?")
COUNTED = 200
"""Unknowns up to which the states are counted twice."""
MOVING = 1e-9
"""Largest rate of a state, in its size a second, that counts as rest."""


@dataclass(frozen=True, slots=True)
class Descriptor:
    """E dy' = A dy + B du; dv = C dy + Cd dy' + D du; states [unknowns]: names of y."""

    e: Array
    a: Array
    b: Array
    c: Array
    cd: Array
    d: Array
    states: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Linear:
    """A linearisation at t [s]; moving: a state that is not at rest; energies [modes, stores]: shares of each."""

    t: float
    y: Array
    descriptor: Descriptor
    reduced: Reduced
    modes: tuple[Mode, ...]
    transfers: tuple[Transfer, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    moving: bool
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
    small = _witnessed(found, rows, slopes, by_input, out, labels)
    own = modes(small.a, small.decomposed)
    stores, energies = _energies(found, small, own, names)
    kept = _asked(found, names)
    names, small, out = tuple(names[k] for k in kept), _rows(small, kept), _seen(out, kept)
    form = system if index == "3" else system.another(index)
    descriptor = _descriptor(form, found, slopes, out, labels)
    pairs = ((i, j) for i in range(len(names)) for j in range(len(labels)))
    transfers = tuple(_transfer(small, i, j) for i, j in pairs)
    moves = _felt_moves(system, small, found)
    return Linear(state.t, state.y, descriptor, small, own, transfers, labels, names, moves, stores, energies)


def _witnessed(
    found: Found,
    rows: Rows,
    slopes: Sequence[Sensitivity],
    by_input: tuple[Array, ...],
    out: Outputs,
    labels: tuple[str, ...],
) -> Reduced:
    """The reduction; of linear equations one that the pencil's determinant does not contradict.  NoLinearisation."""
    system, loose, small, why = found.system, loose_of(found), None, None
    fixed = constant(system, found.state)
    still = fixed or not moving(system, found.state)  # the pencil of the form as written is right too
    pencil = _descriptor(system, found, slopes, out, labels) if still else None
    try:
        small = _reduced(found, rows, by_input, out, labels, loose, pencil)
    except NoLinearisation as error:
        why = error
    seen = witness(pencil.e, pencil.a) if fixed and pencil is not None else None
    if seen is not None and pencil is not None and (small is None or seen.contradicts(_values(small))):
        if seen.certain:
            small = _in_many_digits(found, pencil, loose, seen.states)
            lasting = small is not None and not seen.contradicts(_values(small))
        else:
            other = _chosen_in_many_digits(found, rows, by_input, out, labels)
            held = [part for part in (small, other) if part is not None and agrees(pencil.e, pencil.a, _values(part))]
            doubtful = spread(pencil.e, pencil.a) > CONTRAST or not _singular(pencil)
            small, lasting = held[0] if held else small, bool(held) or not doubtful
        if not lasting:
            raise why or _contradicted(seen)
    if small is None:
        assert why is not None
        raise why
    return small


def _contradicted(seen: Witness) -> NoLinearisation:
    """What is said where the modes found are not those of the equations."""
    cause = "the modes found are not those of the equations"
    if not seen.certain:
        cause = "the entries of the equations, rounded, do not hold all modes"
    return NoLinearisation(
        f"{cause}: sizes of elements are too many decades apart; another --formulation may hold them, "
        "or leave out the elements whose time constants are farthest from the rest"
    )


def _chosen_in_many_digits(
    found: Found, rows: Rows, by_input: tuple[Array, ...], out: Outputs, labels: tuple[str, ...]
) -> Reduced | None:
    """The reduction by the rows that hold, its states chosen in many digits; None where there is none."""
    try:
        return widely_reduced(rows, found.system, found.state, by_input, out, labels, loose_of(found))
    except NoLinearisation:
        return None


def _singular(form: Descriptor) -> bool:
    """Whether the pencil leaves unknowns open, in double precision."""
    try:
        motions(form.e, form.a)
    except NoLinearisation:
        return True
    return False


def _values(small: Reduced) -> NDArray[np.complex128]:
    return np.array([mode.eigenvalue for mode in modes(small.a, small.decomposed)], dtype=np.complex128)


def _in_many_digits(found: Found, form: Descriptor, loose: NDArray[np.bool_], states: int) -> Reduced | None:
    """The reduction of the pencil with its states chosen in many digits; None where it is too large for that."""
    system, n = found.system, found.system.form.written
    known = candidates_of(system, found.state, n)
    shown = system.kinds[known] == "q"
    groups = (known[shown & ~loose[known]], known[~shown & ~loose[known]], known[loose[known]])
    matrices = (form.e, form.a, form.b, form.c, form.cd, form.d)
    try:
        small = widely_parted(matrices, (*groups, np.arange(n, len(form.states))), states)
    except NoLinearisation:
        return None
    if small is None:
        return None
    names = tuple(form.states[int(k)] for k in small.places)
    return replace(small, names=names, places=np.where(small.places < n, small.places, -1))


def _reduced(
    found: Found,
    rows: Rows,
    by_input: tuple[Array, ...],
    out: Outputs,
    labels: tuple[str, ...],
    loose: NDArray[np.bool_],
    pencil: Descriptor | None,
) -> Reduced:
    """The reduction by the rows that hold, or by the pencil where that holds too and knows more.  NoLinearisation."""
    system, small = found.system, None
    try:
        small = reduced(rows, system, found.state, by_input, out, labels, loose)
    except NoLinearisation:
        if pencil is None:
            raise
    if pencil is not None and (small is None or _fewer(found, small)):
        small = _of_pencil(found, pencil, loose)
    assert small is not None
    if small.unsure is not None and pencil is not None:  # the pencil may know it better
        small = _surer(small, found, pencil, loose)
    if small.unsure is not None:
        precise.refuse_lost(precise.eigenvalues(small.a), precise.eigenvalues(small.unsure), lost)
    return small


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


def _fewer(found: Found, small: Reduced) -> bool:
    """Whether the pencil, in the unit of time in which its ranks are plainest, has another number of states."""
    y, yd = found.state.for_form(found.system)
    jy, jyd = found.system.jacobian(found.state.t, y, yd)
    if found.system.unknowns > COUNTED:
        return False
    try:
        space = motions(found.system.dense(jyd), -found.system.dense(jy))[0]
    except NoLinearisation:
        return False
    return int(space.shape[1]) != int((small.places >= 0).sum())


def _of_pencil(found: Found, form: Descriptor, loose: NDArray[np.bool_]) -> Reduced:
    """The reduction where constraints are hidden deeper than rows are differentiated: by the pencil itself."""
    system = found.system
    spaces = motions(form.e, form.a)
    n = system.form.written
    known = candidates_of(system, found.state, n)
    extra = np.arange(n, len(form.states))
    chosen = np.concatenate([chosen_states(system, spaces[0], spaces[2], known, loose), extra])[: spaces[0].shape[1]]
    names = tuple(form.states[int(k)] for k in chosen)
    matrices = (form.e, form.a, form.b, form.c, form.cd, form.d)
    small = surely_parted(matrices, chosen, spaces, names)
    return replace(small, places=np.where(small.places < n, small.places, -1))


def _surer(small: Reduced, found: Found, form: Descriptor, loose: NDArray[np.bool_]) -> Reduced:
    """The reduction of the pencil, where it is one in many digits with as many states."""
    try:
        other = _of_pencil(found, form, loose)
    except NoLinearisation:
        return small
    return other if other.wide is not None and other.places.size == small.places.size else small


def _felt_moves(system: System, small: Reduced, found: Found) -> bool:
    """Whether the motion changes what the matrices say: not where all that moves goes on steadily."""
    state = found.state
    yd = state.yd.copy()
    yd[system.form.k_q] = state.y[system.form.k_f]
    rates = np.where(small.places >= 0, yd[small.places], 0.0)
    size = np.maximum(np.abs(state.y[small.places]), 1.0)
    rates = np.where(np.abs(rates) > MOVING * size, rates, 0.0)
    changes = small.a @ rates
    return bool((np.abs(changes) > MOVING * np.maximum(np.abs(small.a) @ np.abs(rates), 1e-300)).any())
