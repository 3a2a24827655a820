"""Redundant constraints: found at several consistent points, left out, or given the least multipliers.

The rows of J = [Phi_q; Psi_f] are looked at in the order written: one that depends on those kept before it is left out.
A row is redundant where it depends on them at the start and at three seeded consistent points nearby; where the rank is
smaller at the start alone, the configuration is singular (language, section 5).
In a system a left-out row reads "its multiplier = 0": the motion is that of the others.
"""

from __future__ import annotations

import ctypes as c

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.scales import balanced
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.runtime.numerics.least_change import solve
from sysdyn.runtime.numerics.points import normal
from sysdyn.runtime.numerics.rank import TOLERANCE, least_squares
from sysdyn.runtime.start.start import EXACT, ConsistentState
from sysdyn.runtime.start.starter import Starter, problem_of
from sysdyn.values import dataclass

Longs = NDArray[np.int64]
NONE = np.zeros(0, dtype=np.int32)
DENSE = 300
"""Constraints up to which matrices are full."""
NOISE = 1e-11
"""Entries below this part of the largest of their row are what is left of a zero."""
POINTS = 3
AMPLITUDES = (3e-2, 1e-3, 1e-5)
"""Of the displacements, to come to a nearby point."""
BESIDE = 1e-3
"""Amplitude of the displacements to points beside the start, off phi."""
NEAR = 10.0
"""Amplitudes: what the way back onto phi leads farther than this may be another singular point."""
_EPS = 1e-13
PIVOT = 1e-3
"""Of rows scaled to one: an entry that makes a row independent beyond doubt."""


@dataclass(frozen=True, slots=True)
class Reactions:
    """J of the form as written by its entries: which constraint (place in `multipliers`), which row of dynamics
    (place in `rows`), value; rows and columns scaled to one, the rows with `scale` [multipliers].  multipliers: places
    in y.
    """

    which: Ints
    place: Longs
    value: Floats
    multipliers: Longs
    rows: Ints
    scale: Floats

    @property
    def large(self) -> bool:
        """Whether J is too large to be looked at as a full matrix."""
        return self.multipliers.size > DENSE or self.rows.size > 4 * DENSE

    def full(self) -> Floats:
        """J [multipliers, rows]."""
        found = np.zeros((self.multipliers.size, self.rows.size))
        np.add.at(found, (self.which, self.place), self.value)
        return found


@dataclass(frozen=True, slots=True)
class _Places:
    """Places of multipliers in y; of each entry of J its place in the pattern, its multiplier's number, its row."""

    multipliers: Longs
    entry: Ints
    which: Ints
    row: Ints


def _reacting(system: System, idle: Ints = NONE) -> _Places:
    """The multipliers of constraints, but for the idle ones, and the reactions of each."""

    def find() -> _Places:
        pattern, mine = system.pattern, system.are("kappa", "mu").copy()
        mine[idle] = False
        columns, multipliers = pattern.columns_of(), np.flatnonzero(mine)
        entry = np.flatnonzero(mine[columns] & system.of_groups("dynamics")[pattern.row])
        places = entry, np.searchsorted(multipliers, columns[entry]), pattern.row[entry]
        return _Places(multipliers, *(place.astype(np.int32) for place in places))

    return system.once(("reacting places", idle.tobytes()), find)


def reactions(system: System, jy: Floats) -> Reactions:
    """J from the reactions of the multipliers (virtual displacements)."""
    all_ = _reacting(system, system.idle_multipliers())
    value, largest = jy[all_.entry], np.zeros(all_.multipliers.size)
    np.maximum.at(largest, all_.which, np.abs(value))
    real = np.abs(value) > NOISE * largest[all_.which]
    which, value = all_.which[real], value[real]
    rows, place = np.unique(all_.row[real], return_inverse=True)
    scale, other = sparse_factors(which, place, np.abs(value), (all_.multipliers.size, rows.size))
    return Reactions(which, place, scale[which] * value * other[place], all_.multipliers, rows, scale)


def independent(system: System, jy: Floats) -> bool:
    """Whether the constraints that hold now are few, and independent beyond doubt."""
    found = _reacting(system, system.idle_multipliers())
    number, value = found.multipliers.size, jy[found.entry]
    if not number or number > DENSE or system.rows > 4 * DENSE:
        return not number
    arrays = lib.pointer(found.which), lib.pointer(found.row), lib.pointer(value)
    sure = lib.core.sd_independent(number, system.rows, value.size, *arrays, NOISE, TOLERANCE)
    if sure < 0:
        raise MemoryError
    return bool(sure)


def dependent(found: Reactions) -> Ints:
    """Constraints (places in `multipliers`) that depend on those before them."""
    if found.large:
        return _sparse_dependent(found)
    basis, left = np.zeros((0, found.rows.size)), []
    for k, row in enumerate(found.full()):
        outside = row - basis.T @ (basis @ row)
        outside -= basis.T @ (basis @ outside)  # twice is enough (Kahan)
        size = float(np.linalg.norm(outside))
        if size <= TOLERANCE * float(np.linalg.norm(row)):  # next to nothing lies outside those kept before it
            left.append(k)
        else:
            basis = np.vstack([basis, outside / size])
    return np.asarray(left, dtype=np.int32)


def _sparse_dependent(found: Reactions) -> Ints:
    """The same from the pivots of [I J^T; J -eps]: those of the order of eps.  In any order they count the dependent
    rows; eliminated in the order written they name them.  Not asked where every row in its turn alone stands in some
    column: those are independent.
    """
    m, n = found.multipliers.size, found.rows.size
    entries = found.which.astype(np.int32), found.place.astype(np.int32), found.value
    arrays, peeled = [lib.pointer(item) for item in entries], np.zeros(m, dtype=np.int32)
    left = lib.core.sd_peel(m, n, found.which.size, *arrays, PIVOT, lib.pointer(peeled))
    if left < 0:
        raise MemoryError
    if not left:
        return NONE
    from scipy.sparse import block_array, csc_array, eye_array
    from scipy.sparse.linalg import splu

    j = csc_array((found.value, (found.which, found.place)), shape=(m, n))
    matrix = block_array([[eye_array(n), j.T], [j, -_EPS * eye_array(m)]], format="csc")
    if not (np.abs(splu(matrix, permc_spec="COLAMD").U.diagonal()) < 1e3 * _EPS).any():
        return NONE
    lu = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.flatnonzero(np.abs(lu.U.diagonal())[n:] < 1e3 * _EPS).astype(np.int32)


def _moves(system: System, state: ConsistentState) -> tuple[Floats, Floats]:
    """How large displacements are [unknowns as written], 0 for all else; seeded moves of them [POINTS, unknowns]."""
    size = balanced(system, state.y, system.jacobian(state.t, state.y, state.yd)[0]) * system.are("q")
    return size, size * system.once_if_small(("directions", size.size), lambda: normal(POINTS, size.size))


def nearby(system: System, state: ConsistentState) -> list[Floats]:
    """Y at up to POINTS seeded points near the state, displacements consistent with phi."""
    starter, found = Starter(system), []
    x = starter.unknowns(state.t, state.y, state.yd)
    size, moves = _moves(system, state)
    rows, free = starter.groups("phi"), starter.moves("q")
    for move in moves:
        for amplitude in AMPLITUDES:
            shaken = x + amplitude * np.append(move, np.zeros(x.size - move.size))
            there = solve(problem_of(starter, state.t, shaken, shaken, rows=rows, free=free), shaken)
            near = np.abs(there.x - x)[: size.size] <= NEAR * amplitude * size
            if there.residual < EXACT and near.all():
                found.append(there.x[: size.size])
                break
    return found


def vanished(system: System, state: ConsistentState) -> Ints:
    """Constraints (places in `multipliers`) whose row of J is zero at the state and not beside it: there the
    configuration is singular.  Beside: at seeded points that are not brought back onto phi, where a row that can be
    zero on phi alone (a circle of radius 0) has its size.
    """
    reacting = _reacting(system)
    entry, which, number = reacting.entry, reacting.which, reacting.multipliers.size
    if not number:
        return NONE
    a, found = np.zeros((1 + POINTS, system.form.extended)), np.zeros((1 + POINTS, number))
    a[:, : state.y.size] = state.y
    a[1:, : state.y.size] += BESIDE * _moves(system, state)[1]
    b, places = system._buffer(state.yd), (entry.size, lib.pointer(entry), lib.pointer(which), number)
    at = state.t, *a.shape, lib.pointer(a), lib.pointer(b)
    if lib.core.sd_row_sizes(c.byref(system.core), *at, *places, lib.pointer(found)):
        raise MemoryError
    system.failure.check()
    return np.flatnonzero(found[0] <= TOLERANCE * found[1:].min(axis=0)).astype(np.int32)


def combination(found: Reactions, left: Ints) -> Floats:
    """Coefficients [multipliers] of a vanishing combination of rows as written: the first left-out one and those before
    it; () where there is none.
    """
    if not left.size or found.large:
        return np.zeros(0)
    rows, last = found.full(), int(left[0])
    weights = np.append(-least_squares(rows[:last].T, rows[last]), np.eye(1, len(rows) - last)) * found.scale
    return np.asarray(weights / weights[np.argmax(np.abs(weights))])
