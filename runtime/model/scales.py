"""Magnitudes of the unknowns: what relative tolerances and scaled matrices refer to.

A magnitude is the nominal value of the manifest where it names one.  Else the largest of |y| at the start, |y'| times
the time scale of the start (never the span alone: a long run would call everything small), and a thousandth of these
among unknowns of the same kind and unit.
Unknowns that are zero with all of that take the magnitude that balances the rows they stand in: the other terms
of the row, and how far the row itself moves with t over the span (sources that start at zero).
During a run magnitudes grow with max |y|; a second run starts with the maxima of the first.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.balance import Balance
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.inertia import compliance
from sysdyn.runtime.model.patterns import read_only
from sysdyn.runtime.model.system import System

ROUND_OFF = 1e-12
"""Of the largest quantity of the same unit: smaller ones are what is left of a zero."""
NOTHING = 1e-14
"""Of the largest of the same kind and unit: less is what arithmetic leaves of a zero."""
FRESH = 1e-9
"""Of what a rate makes of a quantity in the time scale known so far: a start below this part of it is round-off."""
UNKNOWN = 1.0
"""Magnitude of what is zero with all that could size it."""
GROUP = 1e-3
SPAN = 1e-2
NOISE = 1e-6
"""Values below this part of what balances their rows are round-off, or zero by chance."""
QUIET = 1e-9
"""Efforts below this part of (largest energy) / q are round-off."""
_SAMPLES = 16
_PARTS = np.array([1e-6, *((np.arange(_SAMPLES) + 0.618) / _SAMPLES)])
"""Of the span: where rows are asked how far they moved, the first to tell how fast."""
_HOLDS = ("phi", "psi")
"""Beginnings of the names of groups of constraints."""
_SWEEPS = 8


def _grouped(system: System, y: Floats, moves: Floats, compliance: Floats) -> Floats:
    """What is not zero at the start counts as it is, be it ever so small: it may grow.  Zeros count as what they move
    in the time scale of the start, and as GROUP of their like at least.
    """
    known = np.maximum(np.abs(y), moves)
    largest = compliance * group_maximum(system, known / compliance)
    return np.where(np.abs(y) > NOTHING * largest, known, np.maximum(known, GROUP * largest))


def excitation(system: System, t0: float, t_end: float, y: Floats, yd: Floats) -> tuple[Floats, float]:
    """How far each row moves with t alone over the span [rows]; shortest time in which one does so [s]."""
    moves, a, b = np.zeros(max(system.rows, 1)), system._buffer(y), system._buffer(yd)
    point = t0, t_end - t0, lib.pointer(a), lib.pointer(b)
    parts = lib.pointer(_PARTS), _PARTS.size
    quick = lib.core.sd_excitation(c.byref(system.core), *point, *parts, NOISE, lib.pointer(moves))
    system.failure.check()
    return moves[: system.rows], float(quick)


def time_scale(system: System, span: float, y: Floats, yd: Floats, excited: float) -> float:
    """Shortest of: a hundredth of the span, y / y', sqrt(q / f'), the time scale of what moves with t (s)."""
    found = min(SPAN * span, excited)
    state = system.are("q", "f", "p", "s")
    form, size, rate = system.form, group_maximum(system, np.abs(y)), np.abs(yd)
    # values that are nothing beside what their rate makes of them are round-off
    real = state & (size > FRESH * rate * found) & (rate > 0.0)
    found = min(found, float((size[real] / rate[real]).min(initial=np.inf)))
    both = (size[form.k_q] > 0.0) & (rate[form.k_f] > 0.0)
    return min(found, float(np.sqrt(size[form.k_q][both] / rate[form.k_f][both]).min(initial=np.inf)))


def _flows(system: System, found: Floats, span: float) -> Floats:
    """Flows at rest, and not accelerated but by round-off: a small part of what would move their q in the span."""
    form = system.form
    least = 0.1 * found[form.k_q] / (span or 1.0)
    result = found.copy()
    quiet = found[form.k_f] < NOISE * least
    result[form.k_f[quiet]] = GROUP * least[quiet]
    return result


def balance(system: System) -> Balance:
    """The rows of a system's Jacobian."""
    pattern = system.pattern
    return system.once("balance", lambda: Balance(system.rows, pattern.row, pattern.columns_of(), alike(system)))


def _efforts(system: System, found: Floats, row: Floats) -> Floats:
    """Least effort that counts in each row of dynamics [rows]: a tiny part of the largest energy over its q."""
    i, columns = system.once("efforts", lambda: _displaced(system))
    least, q = np.zeros(system.rows), found[columns]
    least[i] = QUIET * (row[i] * q).max(initial=0.0) / np.where(q > 0.0, q, np.inf)
    return least


def _displaced(system: System) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of dynamics, and the places of their displacements."""
    form, description = system.form, system.description
    places = {description.families[k].owner: k for k in description.families_of("q")}
    rows = [np.zeros(0, dtype=np.int64)]
    columns = [np.zeros(0, dtype=np.int64)]
    for group, family, first in form.groups:
        owner = description.rows[family].owner
        number = description.rows[family].size
        if group == "dynamics" and owner in places and description.families[places[owner]].size == number:
            rows.append(first + np.arange(number))
            columns.append(form.at[places[owner]] + np.arange(number))
    return np.concatenate(rows), np.concatenate(columns)


def alike(system: System) -> NDArray[np.int64]:
    """Number of the kind and unit of each unknown [unknowns]; read-only."""
    return system.once("alike", lambda: _alike(system))


def _alike(system: System) -> NDArray[np.int64]:
    families = system.description.families
    keys: dict[tuple[str, str], int] = {}
    number = np.empty(len(families) + 1, dtype=np.int64)
    for k, family in enumerate(families):
        number[k] = keys.setdefault((family.kind, family.unit), len(keys))
    number[-1] = len(keys)
    return read_only(number[system.family_of])


def group_maximum(system: System, values: Floats) -> Floats:
    """Largest value among the unknowns of the same kind and unit."""
    return _group_maximum(alike(system), values)


def _group_maximum(group: NDArray[np.int64], values: Floats) -> Floats:
    largest = np.zeros(int(group.max(initial=0)) + 1)
    np.maximum.at(largest, group, values)
    return largest[group]


def balanced(system: System, y: Floats, jy: Floats) -> Floats:
    """Size of each unknown at a point [unknowns], all positive: |y|, or what balances its rows."""
    size = np.where(np.isfinite(jy), np.abs(jy), 0.0)
    found = balance(system).propagate(np.abs(y), size, np.zeros(system.rows), largest=True)
    found = np.maximum(found, GROUP * group_maximum(system, found))
    return np.where(found > 0.0, found, 1.0)


def unresolved(system: System, y: Floats, jy: Floats) -> Floats:
    """What round-off leaves open of each unknown [unknowns]: of the terms of the constraints that it stands in.

    A charge of 1e-17 C in a sum with one of 0.1 C is known to 1e-17 C, whatever tolerance is asked of it.
    """
    rows, columns = system.pattern.row, system.pattern.columns_of()
    constraint = system.of_groups(*(g for g in dict.fromkeys(g for g, _, _ in system.form.groups) if g[:3] in _HOLDS))
    take = constraint[rows] & np.isfinite(jy) & (jy != 0.0)
    i, j, slope = rows[take], columns[take], np.abs(jy[take])
    size = np.zeros(system.rows)
    np.maximum.at(size, i, slope * np.abs(y[j]))
    found = np.zeros(system.unknowns)
    np.maximum.at(found, j, np.finfo(np.float64).eps * size[i] / slope)
    return found


def noise(system: System, y: Floats, jy: Floats, time: float) -> Floats:
    """What round-off leaves open of each unknown [unknowns] in steps of `time` (s): flows are differences of their
    displacements over it, and multipliers balance what flows make of that.
    """
    rows, columns = system.pattern.row.astype(np.int64), system.pattern.columns_of()
    form, found = system.form, unresolved(system, y, jy)
    found[form.k_f] = np.maximum(found[form.k_f], found[form.k_q] / time)
    balance = system.of_groups("dynamics")
    slope = np.where(np.isfinite(jy), np.abs(jy), 0.0)
    take = balance[rows] & (slope > 0.0)
    i, j, slope = rows[take], columns[take], slope[take]
    multiplier = system.are("kappa", "mu", "e")[j]
    leading = np.zeros(system.rows)
    np.maximum.at(leading, i[multiplier], slope[multiplier])
    told = multiplier & (slope >= GROUP * leading[i])
    for _ in range(_SWEEPS):
        row = np.zeros(system.rows)
        np.maximum.at(row, i, slope * np.where(multiplier | system.are("f")[j], found[j], 0.0))
        before = found.copy()
        np.maximum.at(found, j[told], row[i[told]] / slope[told])
        if (found == before).all():
            break
    return found


def _with_momentum(system: System) -> NDArray[np.bool_]:
    """Unknowns of coordinates whose momenta are unknowns [unknowns]; read-only."""
    return system.once("with momentum", lambda: _own_momentum(system))


def _own_momentum(system: System) -> NDArray[np.bool_]:
    families = system.description.families
    owners = {family.owner for family in families if family.kind == "p"}
    member = np.array([*(family.owner in owners for family in families), False])
    return read_only(np.asarray(member[system.family_of]))


def magnitudes(
    system: System, t0: float, t_end: float, y: Floats, yd: Floats, far: Callable[[float], Floats] | None = None
) -> tuple[Floats, float]:
    """Magnitude of each unknown [unknowns], all positive, and the time scale of the start [s].

    far: how far each unknown gets within a time; None: as its rate says.
    """
    span = max(t_end - t0, 0.0) or 1.0
    y, yd = (np.where(np.isfinite(item), item, 0.0) for item in (y, yd))
    state = system.are("q", "f", "p", "s")
    excited, quick = excitation(system, t0, t0 + span, y, yd)
    tau = time_scale(system, span, y, yd, quick)
    jy, jyd = system.jacobian(t0, y, yd)
    # flows without inertia follow from the rest
    carries = state & (~system.are("f") | system.differential(jyd) | _with_momentum(system))
    moves = np.where(carries, tau * np.abs(yd) if far is None else far(tau), 0.0)
    known = np.maximum(np.abs(y), moves)
    form = system.form
    flows = np.maximum(known, GROUP * group_maximum(system, known))[form.k_f]
    moves[form.k_q[np.abs(y[form.k_f]) < QUIET * flows]] = 0.0  # rates that are round-off
    known = _grouped(system, y, moves, compliance(system, jy, jyd))
    found = np.where(system.nominal > 0.0, system.nominal, known)
    found = _flows(system, found, span)
    size = np.abs(jy) + np.abs(jyd) / tau
    size = np.where(np.isfinite(size), size, 0.0)
    rows, columns, own = system.pattern.row, system.pattern.columns_of(), balance(system)
    # what round-off leaves of a zero is nothing beside what the sources will make of it
    driven = own.propagate(np.zeros(found.size), size, excited, capped=True)
    found = np.where(carries & (found < ROUND_OFF * driven), driven, found)
    # momenta and dynamic variables are balanced against flows, what follows from the state against all of it: so
    # round-off of a start does not pass for a magnitude
    kept = np.where(system.are("q", "f") & carries, found, 0.0)
    balanced = own.propagate(kept, size, excited, largest=True, capped=True)
    found = np.where(~system.are("p", "s") | (found > NOISE * balanced), found, balanced)
    kept = np.where(carries, found, 0.0)
    row = excited.copy()
    np.maximum.at(row, rows, size * kept[columns])
    excited = np.maximum(excited, _efforts(system, found, row))
    balanced = own.propagate(kept, size, excited, capped=True)
    found = np.where(found > NOISE * balanced, found, balanced)
    found = np.where(found == 0.0, group_maximum(system, found), found)
    found[form.k_q] = np.where(found[form.k_q] == 0.0, tau * found[form.k_f], found[form.k_q])
    tiny = np.finfo(np.float64).tiny * 1e30
    return np.where(found > tiny, found, UNKNOWN), tau


def confirmed(system: System, span: float, met: Floats, magnitude: Floats) -> Floats:
    """Magnitudes after a run [unknowns]: the largest |y| it met and a thousandth of that among unknowns of the same
    kind and unit, where that is less than it went by and not round-off.  Multipliers keep theirs: what they met may be
    round-off altogether.
    """
    found = _flows(system, np.maximum(met, GROUP * group_maximum(system, met)), span)
    free = system.are("q", "f", "p", "s") & (system.nominal == 0.0)
    return np.where(free, np.clip(found, NOISE * magnitude, magnitude), magnitude)
