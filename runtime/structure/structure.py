"""Structural facts at a consistent point, after the parameters are bound.

Differential index of the form as written, from the pencil dF/dyd yd' + dF/dy y at the point: rows without yd are
differentiated until dF/dyd is nonsingular (shuffle algorithm, Luenberger 1978); ranks by singular values of the
equilibrated matrices.  Larger models: the inverse of dF/dy + cj dF/dyd grows like cj^(index - 1) with cj above every
frequency of the model; below some, what is fast passes for a constraint.
Freedom: rank of [Phi_q; Psi_f], taken from the reactions of the multipliers (virtual displacements).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.events.kinks import SLIDES
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import RowLabel
from sysdyn.runtime.model.held_rows import multiplier_row
from sysdyn.runtime.model.scales import balanced_sizes
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.equilibrate import equilibrate, sparse_factors
from sysdyn.runtime.numerics.ordering import net_order_of
from sysdyn.runtime.numerics.points import normal
from sysdyn.runtime.numerics.rank import CERTAIN, TOLERANCE, count, singular_decomposition, singular_values
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.redundancy import combination, dependent, nearby, reactions, vanishing_constraints
from sysdyn.values import dataclass

DENSE = tuning.DENSE
SMALL = tuning.IN_THE_CORE
"""Unknowns up to which the core looks at a pencil first (core/linear/dense/dense.h)."""
MAX_INDEX, USUAL = 6, 2
"""An index up to USUAL is believed at once.  Where entries lie far apart ranks come out too small, and it too large
(operational amplifiers: 4 for 2): then it is the least of that as written and that in sizes of the unknowns.
"""
ROUSED = tuning.PERCENT
"""Slopes of steep laws, as part of the largest term of their row, where only structure is asked."""

GENERIC = tuning.GENERIC
POINTS = tuple(GENERIC * 10.0**power for power in (3, -3, 6, -6, 9, -9))
"""At which a pencil is looked at, after equilibration: at GENERIC first."""
RATES = tuple(10.0**k for k in range(16, 0, -4))
"""cj (1/s) at which the growth of the inverse is asked for: the first one that tells."""
CLEAR = 0.1
"""What a growth may miss a power of cj by, in decades a decade."""
RESOLVED = tuning.SAME
"""Least pivot, as part of its column, of factors that tell: where cj is too large, sums of rows in which the rates
cancel are round-off."""
SIDES = 2
BESIDE = tuning.SMALL
"""Of their magnitudes: how far beside a point what it leaves open is looked at."""
WAYS = 6


@dataclass(frozen=True, slots=True)
class Structure:
    """index: of the form as written, None where the pencil is singular (undetermined: names of unknowns in its null
    vector; where there is an index the pencil is singular at the start alone, and laws are monotone).  coordinates n,
    m1, m2: coordinates and constraint rows; rank of [Phi_q; Psi_f]; dof, redundant, configuration_dof as the language
    defines them; dependent: labels of a dependent group with its coefficients.  singular: rank that the start lacks and
    points near it have; left_out: (family, position) of the multipliers of constraints that depend on those written
    before them.
    """

    index: int | None
    undetermined: tuple[str, ...]
    coordinates: int
    m1: int
    m2: int
    rank: int
    dof: int
    configuration_dof: int
    redundant: int
    dependent: tuple[tuple[RowLabel, float], ...]
    singular: int = 0
    left_out: tuple[tuple[int, int], ...] = ()

    @property
    def counts(self) -> dict[str, int | None]:
        """What is told of a model, and claimed by `expect static`."""
        names = "coordinates", "m1", "m2", "dof", "configuration_dof", "redundant", "index"
        return {name: getattr(self, name) for name in names}


def _rows_to_one(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    size = np.maximum(np.abs(a).max(axis=1, initial=0.0), np.abs(b).max(axis=1, initial=0.0))
    size = np.where(size > 0.0, size, 1.0)[:, None]
    return a / size, b / size


def pencil_index(e: Floats, b: Floats) -> int | None:
    """Index of e x' + b x = 0 [n, n]; None where the pencil is singular (or the index above MAX_INDEX)."""
    e, b = equilibrate(e, b)
    n = e.shape[0]
    # one differentiation more as long as dE/dy' is singular
    for index in range(MAX_INDEX + 1):
        u, sigma, _ = singular_decomposition(e)
        # rank 0 where nothing is left of e
        rank = count(sigma) if sigma.max(initial=0.0) > TOLERANCE else 0
        if rank == n:
            return index
        top, bottom = u[:, :rank].T, u[:, rank:].T
        # the rows without derivatives are differentiated
        e = np.vstack([top @ e, bottom @ b])
        b = np.vstack([top @ b, np.zeros((n - rank, n))])
        e, b = _rows_to_one(e, b)
    return None


def null_vectors(e: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Columns [n, k] that the pencil e x' + b x [n, n] maps to zero and rows [k, n] that map it to zero; k = 0 where it
    is regular.

    A singular pencil is singular at every cj; a regular one whose entries lie far apart is badly scaled at most.
    """
    # at one generic step; others only where that seems singular
    e, b = equilibrate(e, b)
    u, sigma, vt = singular_decomposition(b + GENERIC * e)
    rank = count(sigma, CERTAIN)
    if rank < sigma.size and any(_regular(b + cj * e) for cj in POINTS):
        rank = sigma.size
    return vt[rank:].T, u[:, rank:].T


def _regular(matrix: Floats) -> bool:
    sigma = singular_values(equilibrate(matrix)[0])
    return count(sigma, CERTAIN) == sigma.size


def null_place(system: System, jy: Floats, jyd: Floats) -> tuple[tuple[str, ...], int]:
    """Unknowns in the null vectors of dF/dy + cj dF/dyd, () where it is regular; its row."""
    columns, rows = null_vectors(system.dense(jyd), system.dense(jy))
    if not columns.size:
        return (), -1
    null = np.abs(columns).max(axis=1)
    names = tuple(system.name(int(k)) for k in np.flatnonzero(null > 1e-6 * null.max()))
    return names, int(np.argmax(np.abs(rows[-1]))) if rows.size else -1


def _growth_index(system: System, matrix: list[Floats]) -> int | None:
    """Index from the growth of (dF/dy + cj dF/dyd)^-1 b over cj (large models); matrix: both [entries], which are taken
    out and spent.
    """
    jyd, jy = matrix.pop(), matrix.pop()
    pattern, order = system.pattern, net_order_of(system)
    columns = pattern.columns_of()
    row, column = sparse_factors(pattern.row, columns, np.abs(jy) + np.abs(jyd), (pattern.rows, pattern.unknowns))
    scale = row[pattern.row]
    scale *= column[columns]
    del columns, row, column
    for values in (jy, jyd):
        values *= scale
    # rates alone differ from step to step
    moving = np.flatnonzero(jyd).astype(np.int32)
    rates = jyd[moving]
    del scale, values, jyd
    linear = order.linear(pattern)
    if system.unknowns > LARGE:  # the room counts; the factors hold to the pattern at hand
        system.put_away(whole=True)
    try:
        # where one rate does not tell, the next
        for rate in RATES:
            index = _growth(linear, jy, (moving, rates), rate)
            if index is not None:
                return index
    finally:
        lib.core.sd_linear_free(linear)
    return None


def _growth(linear: Any, jy: Floats, jyd: tuple[Ints, Floats], rate: float) -> int | None:
    """The index by the growth from cj = rate to ten times that; None where it does not tell.  jy: dF/dy [entries], jyd:
    where dF/dyd is not zero, and what it is there, equilibrated.

    The larger cj comes first: there sums of rows lose most, and the pivots that it finds serve the other one.
    """
    sizes, least = [], 1.0
    moving, rates = jyd
    values = lib.reader(linear.contents.scaled, jy.size)  # of a large one the room counts
    # two steps, a factor of ten apart
    for cj in (10.0 * rate, rate):
        values[:] = jy
        values[moving] += cj * rates
        size, pivot = _inverse(linear, values)
        if not (np.isfinite(size) and size > 0.0):
            return None
        least = min(least, pivot)
        sizes.append(size)
    # the inverse grows with the power index - 1
    growth = float(np.log10(sizes[0] / sizes[1]))
    tells = least >= RESOLVED and abs(growth - round(growth)) <= CLEAR
    return round(growth) + 1 if (tells or rate == RATES[-1]) and 0 <= round(growth) + 1 <= MAX_INDEX else None


def _inverse(linear: Any, values: Floats) -> tuple[float, float]:
    """Largest entry of A^-1 b for SIDES sides b, infinite where A (by its entries) is singular; least pivot."""
    if lib.core.sd_linear_factor(linear, lib.pointer(values), None):
        return np.inf, 0.0
    random, largest = np.random.default_rng(3), 0.0
    for _ in range(SIDES):
        side = random.standard_normal(int(linear.contents.n))
        lib.core.sd_linear_solve(linear, lib.pointer(side))
        largest = np.maximum(largest, np.abs(side, out=side).max())  # no number where one is none
    return float(largest), float(linear.contents.smallest)


def _place(system: System, multiplier: int) -> tuple[int, int]:
    """Family of a multiplier and its position there."""
    family = int(system.family_of[multiplier])
    return family, multiplier - int(system.form.at[family])


def _label(system: System, multiplier: int) -> RowLabel:
    """Label of the constraint of a multiplier."""
    family, position = _place(system, multiplier)
    return system.description.rows[multiplier_row(system.description, family)].label_at(position)


def _rouse_slopes(system: System, t: float, jy: Floats) -> Floats:
    """dF/dy [entries] in sizes of the unknowns, with slopes of steep laws that are nearly zero here as large as they
    are elsewhere: a diode at rest determines its voltage as well as one that conducts.
    """
    rows = system.pattern.row
    largest = np.zeros(system.rows)
    np.maximum.at(largest, rows, np.abs(jy))
    # numbers that no symmetry makes dependent
    least = ROUSED * (1.0 + np.arange(jy.size) / max(jy.size, 1)) * largest[rows]
    # steep laws that are asleep, and not zero for good
    asleep = system.steep_rows(t)[rows] & (np.abs(jy) < least) & (jy != 0.0)
    return np.where(asleep, np.copysign(least, jy), jy)


def _small_index(system: System, jy: Floats, jyd: Floats) -> int:
    """`pencil_index` of a small regular pencil, in the core; -1 where it has none, or more must be asked."""
    pattern = system.pattern
    jy, jyd = np.ascontiguousarray(jy), np.ascontiguousarray(jyd)
    places = lib.pointer(pattern.column), lib.pointer(pattern.row)
    return int(lib.core.sd_pencil_index(pattern.unknowns, *places, lib.pointer(jyd), lib.pointer(jy), MAX_INDEX))


def index_of(system: System, state: ConsistentState) -> tuple[int | None, tuple[str, ...]]:
    """Index of the form as written, and the unknowns that the pencil leaves open at the state: where they are open
    there alone the index is that beside it.
    """
    if system.unknowns > DENSE:  # of a large model the room counts: nobody holds its point meanwhile
        return _growth_index(system, list(system.jacobian(state.t, *state.for_form(system)))), ()
    point = state.t, *state.for_form(system)
    # undetermined at the state: what holds beside it
    index, undetermined = _index_at(system, *point)
    return _index_beside(system, *point, undetermined) if undetermined else index, undetermined


def _index_beside(system: System, t: float, y: Floats, yd: Floats, undetermined: tuple[str, ...]) -> int | None:
    """Index of a pencil that is singular at a point, and regular wherever undetermined efforts and flows are beside it,
    in one sense: laws that are flat there alone (turbulent valves at rest, side by side) determine what passes, for
    they are monotone.  At a fold the sense changes: None.
    """
    # efforts and flows that are open
    moved = [k for k in np.flatnonzero(system.are("e", "f")).tolist() if system.name(k) in undetermined]
    if not moved:
        return None
    size, senses, found = balanced_sizes(system, y, system.jacobian(t, y, yd)[0])[moved], set[float](), None
    # ways to both sides of the state
    for way in normal(WAYS, len(moved)):
        for side in (BESIDE, -BESIDE):
            beside = y.copy()
            beside[moved] += side * size * way
            found = _index_at(system, t, beside, yd)[0]
            jy, jyd = (system.dense(slopes) for slopes in system.jacobian(t, beside, yd))
            # the sign of the determinant: another one is a fold
            senses.add(float(np.linalg.slogdet(equilibrate(jy + GENERIC * jyd)[0])[0]))
            if found is None or len(senses) > 1:
                return None
    return found


def _index_at(system: System, t: float, y: Floats, yd: Floats) -> tuple[int | None, tuple[str, ...]]:
    """Index at a point, and the unknowns that the pencil leaves open there."""
    if system.unknowns == 0:
        return 0, ()
    jy, jyd = system.jacobian(t, y, yd)
    least = None
    # small and square: in the core, with an answer that is sure up to USUAL
    if system.unknowns <= SMALL and system.rows == system.unknowns:
        found = _small_index(system, jy, jyd)
        if 0 <= found <= USUAL:
            return found, ()
        least = found if found >= 0 else None
    size = balanced_sizes(system, y, jy)[system.pattern.columns_of()]
    undetermined: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    # as it is, in sizes of the unknowns, with steep laws awake
    looks = (jy, jyd), (jy * size, jyd * size), (_rouse_slopes(system, t, jy * size), jyd * size)
    for at, rates in looks[0 if least is None else 1 :]:
        names = null_place(system, at, rates)[0]
        index = None if names else pencil_index(system.dense(rates), system.dense(at))
        known = [k for k in (least, index) if k is not None]
        if known and (at is not jy or known[0] <= USUAL):
            return min(known), ()
        least, undetermined = index, undetermined or names
    # regular, and entries lie too far apart for ranks
    index = None if names else _growth_index(system, list(looks[-1]))
    return index, () if index is not None else undetermined


def _sliding_index(system: System, state: ConsistentState) -> tuple[int | None, tuple[str, ...]]:
    """The index that the model may come to where laws slide that can (whose sense their function's rate contains), or
    set-valued relations turn.
    """
    p, (index, undetermined) = system.description.p, index_of(system, state)
    # laws that can slide do, relations that can hold do: one after the other
    others = [(place, SLIDES) for place in system.description.branches]
    others += [(place, 1.0 - p[place]) for place in system.description.holds]
    for place, other in others:
        before = p[place]
        p[place] = other
        most, _ = index_of(system, state)
        p[place] = before
        if index is not None and most == 2:
            index = max(index, most)
    return index, undetermined


def _highest_index(system: System, state: ConsistentState) -> tuple[int | None, tuple[str, ...]]:
    """The index that the model may come to, with every constraint that may hold, as far as they are independent."""
    switches = system.description.switches
    # nothing holds at times
    index, undetermined = _sliding_index(system, state)
    if not switches.places or index is None:
        return index, undetermined
    before = switches.active.copy()
    # all hold that may, but for those that then depend on others
    try:
        switches.set(np.ones_like(before))
        y, yd = state.for_form(system)
        found = reactions(system, system.slopes(state.t, y, yd, rate=False))
        left = {_place(system, int(found.multipliers[k])) for k in dependent(found)}
        switches.set(np.array([before[k] or place not in left for k, place in enumerate(switches.places)]))
        most, _ = index_of(system, state)
    finally:
        switches.set(before)
    return (index if most is None else max(index, most)), undetermined


def structure(system: System, state: ConsistentState) -> Structure:
    """Facts of a model at a consistent state; system: any form."""
    system = system if system.form.name == "3" else system.another("3")
    index, undetermined = _highest_index(system, state)
    found = reactions(system, system.slopes(state.t, *state.for_form(system), rate=False))
    left = dependent(found)
    zero = vanishing_constraints(system, state)
    lowest = np.union1d(left, zero).size if zero.size else left.size
    # dependent here: whether they are so beside the state
    if left.size:
        # a rank that is smaller here alone is the configuration's, not the constraints'
        for point in nearby(system, state):
            there = reactions(system, system.jacobian(state.t, point, state.for_form(system)[1])[0])
            fewer = dependent(there)
            if fewer.size < left.size:
                found, left = there, fewer
    # a row that is zero wherever phi holds, but not beside it, is no combination of others
    if left.size and zero.size:
        left = np.setdiff1d(left, np.setdiff1d(zero, found.which)).astype(np.int32)
    lost = lowest - int(left.size)
    n = int(system.are("f").sum())
    # multipliers of what does not hold do not count
    idle = system.idle_multipliers()
    m1, m2 = (int(system.are(kind).sum() - system.are(kind)[idle].sum()) for kind in ("kappa", "mu"))
    places = found.multipliers
    rank, rank_q = m1 + m2 - int(left.size), m1 - int(system.are("kappa")[places[left]].sum())
    weights = combination(found, left[:1]) if left.size else np.zeros(0)
    group = tuple((_label(system, int(places[k])), float(weights[k])) for k in np.flatnonzero(np.abs(weights) > 1e-8))
    names = tuple(_place(system, int(places[k])) for k in left)
    if system.unknowns > LARGE:
        system.spare()
        system.trim(LARGE)
    return Structure(index, undetermined, n, m1, m2, rank, n - rank, n - rank_q, int(left.size), group, lost, names)
