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
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.least_change import solve
from sysdyn.runtime.numerics.points import normal
from sysdyn.runtime.numerics.rank import TOLERANCE, least_squares
from sysdyn.runtime.start.start import EXACT, ConsistentState
from sysdyn.runtime.start.starter import Starter, weighted
from sysdyn.values import dataclass

Longs = NDArray[np.int64]
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

    which: Longs
    place: Longs
    value: Floats
    multipliers: Longs
    rows: Longs
    scale: Floats


def reactions(system: System, jy: Floats, kinds: tuple[str, ...] = ("kappa", "mu")) -> Reactions:
    """J from the reactions of the multipliers of those kinds (virtual displacements)."""
    pattern = system.pattern
    columns = pattern.columns_of()
    idle = system.idle_multipliers()
    multipliers, mine = system.once(("reacting", kinds, idle.tobytes()), lambda: _of(system, kinds, idle))
    take = mine[jy[mine] != 0.0]
    which, value = np.searchsorted(multipliers, columns[take]), jy[take]
    largest = np.zeros(multipliers.size)
    np.maximum.at(largest, which, np.abs(value))
    real = np.abs(value) > NOISE * largest[which]
    take, which, value = take[real], which[real], value[real]
    rows, place = np.unique(pattern.row[take].astype(np.int64), return_inverse=True)
    scale = np.ones(multipliers.size)
    for _ in range(4):
        for number, index in ((multipliers.size, which), (rows.size, place)):
            size = np.zeros(number)
            np.maximum.at(size, index, np.abs(value))
            shrink = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
            value = value * shrink[index]
            scale *= shrink if index is which else 1.0
    return Reactions(which, place, value, multipliers, rows, scale)


def independent(system: System, jy: Floats) -> bool:
    """Whether the constraints that hold now are few, and independent beyond doubt."""
    idle = system.idle_multipliers()
    key = "reacting places", idle.tobytes()
    multipliers, mine, row, column = system.once(key, lambda: _reacting_places(system, idle))
    if not multipliers or multipliers > DENSE or system.rows > 4 * DENSE:
        return not multipliers
    value = jy[mine]
    arrays = lib.pointer(row), lib.pointer(column), lib.pointer(value)
    found = lib.core.sd_independent(multipliers, system.rows, value.size, *arrays, NOISE, TOLERANCE)
    if found < 0:
        raise MemoryError
    return bool(found)


def _reacting_places(system: System, idle: Ints) -> tuple[int, Longs, Ints, Ints]:
    """How many multipliers react; the places of J's entries in the pattern, the multiplier and the row of each."""
    multipliers, mine = _of(system, ("kappa", "mu"), idle)
    which = np.searchsorted(multipliers, system.pattern.columns_of()[mine])
    return multipliers.size, mine, which.astype(np.int32), system.pattern.row[mine].astype(np.int32)


def _of(system: System, kinds: tuple[str, ...], idle: Ints) -> tuple[Longs, Longs]:
    """Multipliers of those kinds but for the idle ones, and the places in the pattern of their reactions."""
    reacting = system.are(*kinds).copy()
    reacting[idle] = False
    multipliers = np.flatnonzero(reacting)
    pattern, mine = system.pattern, np.zeros(system.unknowns, dtype=bool)
    mine[multipliers] = True
    return multipliers, np.flatnonzero(mine[pattern.columns_of()] & system.of_groups("dynamics")[pattern.row])


def dependent(found: Reactions) -> Ints:
    """Constraints (places in `multipliers`) that depend on those before them."""
    m, n = found.multipliers.size, found.rows.size
    if m == 0:
        return np.zeros(0, dtype=np.int32)
    if m > DENSE or n > 4 * DENSE:
        return _sparse_dependent(found)
    rows = np.zeros((m, n))
    np.add.at(rows, (found.which, found.place), found.value)
    basis = np.zeros((0, n))
    left = []
    for k, row in enumerate(rows):
        size = float(np.linalg.norm(row))
        rest = row
        for _ in range(2):  # twice is enough (Kahan)
            rest = rest - basis.T @ (basis @ rest)
        # a row depends on those kept before it where next to nothing of it lies outside them
        if float(np.linalg.norm(rest)) <= TOLERANCE * size or size == 0.0:
            left.append(k)
        else:
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
    return np.asarray(left, dtype=np.int32)


def _sparse_dependent(found: Reactions) -> Ints:
    """The same from the pivots of [I J^T; J -eps]: those of the order of eps.  In any order they count the dependent
    rows; eliminated in the order written they name them.
    """
    if not _left(found):
        return np.zeros(0, dtype=np.int32)
    from scipy.sparse import block_array, csc_array, eye_array
    from scipy.sparse.linalg import splu

    m, n = found.multipliers.size, found.rows.size
    j = csc_array((found.value, (found.which, found.place)), shape=(m, n))
    matrix = block_array([[eye_array(n), j.T], [j, -_EPS * eye_array(m)]], format="csc")
    pivots = np.abs(splu(matrix, permc_spec="COLAMD").U.diagonal())
    if not (pivots < 1e3 * _EPS).any():
        return np.zeros(0, dtype=np.int32)
    lu = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.flatnonzero(np.abs(lu.U.diagonal())[n:] < 1e3 * _EPS).astype(np.int32)


def _left(found: Reactions) -> int:
    """How many rows of J are left when those are taken away that alone stand in some column: they are independent."""
    m, n = found.multipliers.size, found.rows.size
    which, place = found.which.astype(np.int32), found.place.astype(np.int32)
    arrays = lib.pointer(which), lib.pointer(place), lib.pointer(found.value)
    peeled = np.zeros(m, dtype=np.int32)
    left = int(lib.core.sd_peel(m, n, which.size, *arrays, PIVOT, lib.pointer(peeled)))
    if left < 0:
        raise MemoryError
    return left


def nearby(system: System, state: ConsistentState) -> list[Floats]:
    """Y at up to POINTS seeded points near the state, displacements consistent with phi."""
    starter = Starter(system, remember=True)
    x = np.concatenate([state.y, state.yd[starter.rates]])
    q = starter.moves(("q",))[: x.size]
    size = np.where(q, starter.scale(state.t, x), 0.0)
    random = np.random.default_rng(12)
    found = []
    for _ in range(POINTS):
        direction = random.standard_normal(x.size)
        for amplitude in AMPLITUDES:
            shaken = x + amplitude * size * direction
            rows = starter.groups("phi")
            if rows.any() and q.any():
                scale, weight = starter.scale(state.t, shaken), np.ones(shaken.size)
                problem = weighted(starter, state.t, shaken, rows=rows, free=q, scale=scale, weight=weight)
                solution = solve(problem, shaken)
                if not solution.residual < EXACT or np.any(np.abs(solution.x - x) > NEAR * amplitude * size):
                    continue
                shaken = solution.x
            found.append(starter.expand(shaken)[0])
            break
    return found


def vanished(system: System, state: ConsistentState) -> Ints:
    """Constraints (places in `multipliers`) whose row of J is zero at the state and not beside it: there the
    configuration is singular.  Beside: at seeded points that are not brought back onto phi, where a row that can be
    zero on phi alone (a circle of radius 0) has its size.
    """
    y, yd = state.for_form(system)
    take, which, number = system.once("sizes of J", lambda: _reacting(system))
    if not number:
        return np.zeros(0, dtype=np.int32)

    def sizes(points: Floats) -> Floats:
        """The largest entry of each row of J, as written, at points [k, unknowns]: [k, number]."""
        found = np.zeros((len(points), number))
        a, b = np.zeros((len(points), system.form.extended)), system._buffer(yd)
        a[:, : points.shape[1]] = points
        places = take.size, lib.pointer(take), lib.pointer(which), number, lib.pointer(found)
        at = state.t, *a.shape, lib.pointer(a), lib.pointer(b)
        if lib.core.sd_row_sizes(c.byref(system.core), *at, *places):
            raise MemoryError
        system.failure.check()
        return found

    anywhere = y + np.maximum(np.abs(y), 1.0) * _directions(system, 1)[0, : y.size]
    here, elsewhere = sizes(np.stack([y, anywhere]))
    straight = (here > 0.0) & (here == elsewhere)
    if straight.all():  # rows of J that are the same everywhere vanish nowhere
        return np.zeros(0, dtype=np.int32)
    starter = system.starter or Starter(system, remember=True)
    x = np.concatenate([state.y, state.yd[starter.rates]])
    size = np.where(starter.moves(("q",))[: x.size], starter.scale(state.t, x), 0.0)
    shaken = (x + BESIDE * size * _directions(system, POINTS)[:, : x.size])[:, : starter.n]
    there = sizes(shaken).min(axis=0, initial=np.inf)
    return np.flatnonzero(here <= TOLERANCE * there).astype(np.int32)


def _directions(system: System, number: int) -> Floats:
    """Directions [number, 2 unknowns] without a pattern, always the same."""
    return system.once_if_small(("directions", number), lambda: normal(number, 2 * system.form.written))


def _reacting(system: System) -> tuple[Ints, Ints, int]:
    """Places in the pattern of J's entries, the multiplier of each, and how many of these there are."""
    multipliers, take = _of(system, ("kappa", "mu"), np.zeros(0, dtype=np.int32))
    which = np.searchsorted(multipliers, system.pattern.columns_of()[take])
    return take.astype(np.int32), which.astype(np.int32), multipliers.size


def combination(found: Reactions, left: Ints) -> Floats:
    """Coefficients [multipliers] of a vanishing combination of rows as written: the first left-out one and those before
    it; () where there is none.
    """
    m, n = found.multipliers.size, found.rows.size
    if not left.size or m > DENSE or n > 4 * DENSE:
        return np.zeros(0)
    rows = np.zeros((m, n))
    np.add.at(rows, (found.which, found.place), found.value)
    last = int(left[0])
    weights = np.zeros(m)
    weights[:last] = -least_squares(rows[:last].T, rows[last])
    weights[last] = 1.0
    weights *= found.scale
    weights /= weights[np.argmax(np.abs(weights))]
    return weights
