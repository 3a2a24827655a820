"""Redundant constraints: found at several consistent points, left out, or given the least multipliers.

The rows of J = [Phi_q; Psi_f] are looked at in the order written: one that depends on those kept before it is left out:
J^T, eliminated in that order, has no pivot in its column (J of any size: core/linear/dense/tall.h).
A row is redundant where it depends on them at the start and at three seeded consistent points nearby; where the rank is
smaller at the start alone, the configuration is singular (language, section 5).
In a system a left-out row reads "its multiplier = 0": the motion is that of the others.
"""

from __future__ import annotations

import ctypes as c

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.patterns import Places, compress
from sysdyn.runtime.model.scales import balanced_sizes
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.runtime.numerics.gauss_newton import solve
from sysdyn.runtime.numerics.points import normal, uniform
from sysdyn.runtime.numerics.rank import TOLERANCE
from sysdyn.runtime.start.corrections import EXACT
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.start.starter import Starter
from sysdyn.values import dataclass

Longs = NDArray[np.int64]
NONE = np.zeros(0, dtype=np.int32)
NOISE = tuning.DEPENDENT
"""Entries below this part of the largest of their row are what is left of a zero."""
POINTS = 3
AMPLITUDES = (3e-2, 1e-3, 1e-5)
"""Of the displacements, to come to a nearby point."""
BESIDE = tuning.SMALL
"""Amplitude of the displacements to points beside the start, off phi."""
NEAR = 10.0
"""Amplitudes: what the way back onto phi leads farther than this may be another singular point."""
PIVOT = tuning.SMALL
"""Of rows scaled to one: an entry that makes a row independent beyond doubt."""


@dataclass(frozen=True, slots=True)
class Reactions:
    """J of the form as written by its entries: which constraint (place in `multipliers`), which of the model's `rows`
    it acts on, value; lines scaled to one, those of constraints with `scale` [multipliers].  multipliers: places in y.
    """

    which: Ints
    row: Ints
    value: Floats
    multipliers: Longs
    rows: int
    scale: Floats


@dataclass(frozen=True, slots=True)
class _Places:
    """Places of multipliers in y; of each entry of J its place in the pattern, its multiplier's number, its row."""

    multipliers: Longs
    entry: Ints
    which: Ints
    row: Ints


def _reacting(system: System, idle: Ints) -> _Places:
    """The multipliers of constraints but for these (places in y), and the reactions of each."""

    def find() -> _Places:
        pattern, mine = system.pattern, system.are("kappa", "mu").copy()
        mine[idle] = False
        columns, multipliers = pattern.columns_of(), np.flatnonzero(mine)
        # reactions: entries of multipliers in the balances
        entry = np.flatnonzero(mine[columns] & system.of_groups("dynamics")[pattern.row])
        places = entry, np.searchsorted(multipliers, columns[entry]), pattern.row[entry]
        return _Places(multipliers, *(place.astype(np.int32) for place in places))

    return system.once(("reacting places", idle.tobytes()), find)


def reactions(system: System, jy: Floats, *, every: bool = False) -> Reactions:
    """J from the reactions of the multipliers (virtual displacements) of constraints that hold now, or of every one."""
    all_ = _reacting(system, NONE if every else system.idle_multipliers())
    # entries beside the largest of a multiplier count
    value, largest = jy[all_.entry], np.zeros(all_.multipliers.size)
    np.maximum.at(largest, all_.which, np.abs(value))
    real = np.abs(value) > NOISE * largest[all_.which]
    which, value = all_.which[real], value[real]
    row = all_.row[real]
    # equilibrated, so that one threshold serves
    scale, other = sparse_factors(which, row, np.abs(value), (all_.multipliers.size, system.rows))
    return Reactions(which, row, scale[which] * value * other[row], all_.multipliers, system.rows, scale)


def dependent(found: Reactions) -> Ints:
    """Constraints (places in `multipliers`) that depend on those before them.  Not asked where every row in its turn
    alone stands in some column: those are independent.
    """
    # rows that stand alone in a column are peeled off; the rest is asked
    m, peeled = found.multipliers.size, np.zeros(found.multipliers.size, dtype=np.int32)
    entries, own = (lib.pointer(item) for item in (found.which, found.row, found.value)), 1.0 + uniform(m)
    left = lib.core.sd_peel(m, found.rows, found.value.size, *entries, PIVOT, lib.pointer(peeled))
    if left < 0:
        raise MemoryError
    return np.flatnonzero(_vanishing_combinations(found, own) == own).astype(np.int32) if left else NONE


def _vanishing_combinations(found: Reactions, weights: Floats) -> Floats:
    """Coefficients [multipliers] with which rows of J vanish: of rows that depend on those before them as given, of the
    others such that these make up for them.  J^T is eliminated in the order written: there they have no pivot.
    """
    m = weights.size
    pattern, (slot,) = compress(max(m, found.rows), m, [Places(found.row, found.which)])
    values, weights = np.bincount(slot, found.value, pattern.entries), weights.copy()
    order = np.arange(m, dtype=np.int32)
    arrays = (lib.pointer(item) for item in (pattern.column, pattern.row, values, order))
    if lib.core.sd_determined(pattern.rows, m, *arrays, None, TOLERANCE, 0, None, None, lib.pointer(weights)):
        raise MemoryError
    return weights


def _moves(system: System, state: ConsistentState) -> tuple[Floats, Floats]:
    """How large displacements are [unknowns as written], 0 for all else; seeded moves of them [POINTS, unknowns].

    Their geometry alone tells: beside forces that are round-off a balance would make an angle 1e13 rad.
    """
    slope = np.where(
        system.of_groups("phi")[system.pattern.row], system.slopes(state.t, state.y, state.yd, rate=False), 0.0
    )
    size = balanced_sizes(system, state.y, slope) * system.are("q")
    return size, size * system.once_if_small(("directions", size.size), lambda: normal(POINTS, size.size))


def nearby(system: System, state: ConsistentState) -> list[Floats]:
    """Y at up to POINTS seeded points near the state, displacements consistent with phi."""
    starter, found = Starter(system), []
    x = starter.unknowns(state.t, state.y, state.yd)
    size, moves = _moves(system, state)
    rows, free = starter.groups("phi"), starter.moves("q")
    # seeded moves, smaller until the point returns to phi
    for move in moves:
        for amplitude in AMPLITUDES:
            shaken = x + amplitude * np.append(move, np.zeros(x.size - move.size))
            there = solve(problem_of(starter, state.t, shaken, shaken, rows=rows, free=free), shaken)
            # consistent again, and near: not another branch
            near = np.abs(there.x - x)[: size.size] <= NEAR * amplitude * size
            if there.residual < EXACT and near.all():
                found.append(there.x[: size.size])
                break
    return found


def vanishing_constraints(system: System, state: ConsistentState) -> Ints:
    """Constraints (places in `multipliers`) whose row of J is zero at the state and not beside it: there the
    configuration is singular.  Beside: at seeded points that are not brought back onto phi, where a row that can be
    zero on phi alone (a circle of radius 0) has its size.
    """
    reacting = _reacting(system, system.idle_multipliers())
    entry, which, number = reacting.entry, reacting.which, reacting.multipliers.size
    if not number:
        return NONE
    beside = BESIDE * _moves(system, state)[1]
    # the state, then points beside it
    a, found = np.zeros((1 + POINTS, system.form.extended)), np.zeros((1 + POINTS, number))
    a[:, : state.y.size] = state.y
    a[1:, : state.y.size] += beside
    del beside  # of a large model the room counts
    b, places = system._buffer(state.yd), (entry.size, lib.pointer(entry), lib.pointer(which), number)
    at = state.t, *a.shape, lib.pointer(a), lib.pointer(b)
    if lib.core.sd_row_sizes(c.byref(system.core), *at, *places, lib.pointer(found)):
        raise MemoryError
    system.failure.check()
    return np.flatnonzero(found[0] <= TOLERANCE * found[1:].min(axis=0)).astype(np.int32)


def combination(found: Reactions, left: Ints) -> Floats:
    """Coefficients [multipliers], the largest 1, of a combination of rows as written that vanishes: of those of `left`,
    which depend on those before them, and of the independent ones.
    """
    weights = np.zeros(found.multipliers.size)
    weights[left] = 1.0 + uniform(left.size)
    weights = _vanishing_combinations(found, weights) * found.scale
    return np.asarray(weights / weights[np.argmax(np.abs(weights))])
