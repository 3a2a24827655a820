"""Nominal values of unknowns and of traced quantities, by the rows that determine them.

A quantity may be zero by symmetry: then it has no size of its own, and what round-off leaves of it is nobody's error.
How much may be excused so is bounded by the accuracy asked times its nominal value.  That is not the largest value of
its unit, which can be 1e61 A in a diode across a source while the quantity is 1 mA: each unknown is paired with one
row, by a matching on the largest entries (Duff and Koster 2001), and its nominal value is the largest of
- its own peak, and what the other terms of its row make of it;
- the peaks of its like among all that it depends on by such rows: what is left of a signal behind many stages answers
  to the signal;
- where it is zero whatever acts (a velocity that friction holds), what all rows make of it in which it stands.

Received: a system, its last point, peaks of its unknowns; returned: nominal values, in SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.model.scales import alike
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.runtime.numerics.matching import match_rows
from sysdyn.runtime.numerics.points import uniform

PIVOT = tuning.PIVOT
"""Of the largest entry of its column, equilibrated: what may pair an unknown with a row (a usual threshold pivot)."""
HOPS = tuning.HOPS
"""Pairs in a row along which a nominal value is handed on: balance, momentum, flow."""
STEP, TRIES = 2.0**-12, 3
"""Of the nominal values: the step of a slope; directions in which it is taken, so that no two moves cancel in all."""


def nominals_of_unknowns(system: System, point: tuple[float, Floats, Floats], peaks: Floats, step: float) -> Floats:
    """Nominal value of each unknown [unknowns] at a point (t in s, y, yd); peaks [unknowns]: largest |y| met; step [s]:
    a typical one, by which rates count.  Only the peaks where the Jacobian has entries that are no numbers.
    """
    rows, columns = system.pattern.row, system.pattern.columns_of()
    jy, jyd = system.jacobian(*point)
    with np.errstate(all="ignore"):
        # a rate counts by what it moves the unknown within a step
        entry = np.abs(jy) + np.abs(jyd) / step
    if not np.isfinite(entry).all():
        return peaks.copy()
    # each unknown has a row that determines it: of f = p/m that is f
    row_of = _pair(system, entry)
    nominal, paired = peaks.copy(), row_of >= 0
    own = rows == row_of[columns]  # the entry at which an unknown meets its row
    pivot = np.zeros(system.unknowns)
    # the entry by which the row is solved for its unknown
    pivot[columns[own]] = entry[own]
    zero = _zero(system, point[0], np.abs(jy), entry, row_of)[columns] & (entry > 0.0)
    # nominal values pass from row to row, HOPS of them at most
    for _ in range(HOPS):
        terms = np.zeros(system.rows)
        with np.errstate(over="ignore"):
            term = entry * nominal[columns]
            # the largest other term of each row, and what it makes of the row's unknown
            np.maximum.at(terms, rows[~own], term[~own])
            made = np.divide(terms[row_of], pivot, out=np.zeros(system.unknowns), where=paired & (pivot > 0.0))
            np.maximum.at(terms, rows, term)
            # a zero by balance: it counts by the terms of the rows that read it
            np.maximum.at(made, columns[zero], (terms[rows] / np.where(zero, entry, 1.0))[zero])
        np.fmax(nominal, np.where(np.isfinite(made), made, 0.0), out=nominal)
    return np.fmax(nominal, _of_its_like(system, entry > 0.0, row_of, nominal))


def _of_its_like(system: System, there: NDArray[np.bool_], row_of: Ints, nominal: Floats) -> Floats:
    """Largest nominal value of the same kind and unit among those that an unknown depends on [unknowns]."""
    from scipy.sparse import coo_matrix  # 60 ms, which few runs need
    from scipy.sparse.csgraph import connected_components

    # which row determines which unknown, turned around
    rows, columns = system.pattern.row, system.pattern.columns_of()
    of_row = np.full(system.rows, -1, dtype=np.int32)
    of_row[row_of[row_of >= 0]] = np.flatnonzero(row_of >= 0)
    joins = there & (of_row[rows] >= 0)
    # a graph: from what a row reads to what it determines
    to, since = of_row[rows[joins]], columns[joins]
    graph = coo_matrix((np.ones(to.size), (since, to)), shape=(system.unknowns,) * 2)
    # unknowns that determine each other share what is largest among them
    count, part = connected_components(graph, connection="strong")
    kind = alike(system)
    largest = np.zeros((count, int(kind.max(initial=0)) + 1))
    np.maximum.at(largest, (part, kind), nominal)
    # edges between these parts, each once
    between = np.unique(np.stack([part[since], part[to]])[:, part[since] != part[to]], axis=1)
    # the largest passes along the edges until nothing grows
    while between.size:
        before = largest.copy()
        np.maximum.at(largest, between[1], before[between[0]])
        if np.array_equal(before, largest):
            break
    found: Floats = largest[part, kind]
    return found


def _zero(system: System, t: float, algebraic: Floats, entry: Floats, row_of: Ints) -> NDArray[np.bool_]:
    """Unknowns [unknowns] that are zero whatever acts: the row of each is homogeneous, reads its value, and no others
    stand in it but such as are zero themselves.
    """
    rows, columns = system.pattern.row, system.pattern.columns_of()
    nothing = np.zeros(system.unknowns)
    # a homogeneous row: zero where all unknowns are
    with np.errstate(all="ignore"):
        homogeneous = system.residual(t, nothing, nothing) == 0.0
    own = rows == row_of[columns]
    reads = np.zeros(system.unknowns, bool)
    # its own unknown enters by value, not by rate alone
    reads[columns[own]] = (algebraic[own] > 0.0) & homogeneous[rows[own]]
    there = (entry > 0.0) & ~own
    zero = np.zeros(system.unknowns, bool)
    while True:
        # rows whose other unknowns are all zero add theirs; until none is added
        others = np.bincount(rows[there & ~zero[columns]], minlength=system.rows)
        more = reads & ~zero & (others[row_of] == 0)
        if not more.any():
            return zero
        zero |= more


def _pair(system: System, entry: Floats) -> Ints:
    """The row of each unknown [unknowns], along entries that are large in their column as far as they suffice; -1:
    none.
    """
    pattern = system.pattern
    rows, columns = pattern.row, pattern.columns_of()
    # equilibrated, so that units do not decide what is large
    row, column = sparse_factors(rows, columns, entry, (system.rows, system.unknowns))
    scaled = entry * row[rows] * column[columns]
    largest = np.zeros(system.unknowns)
    np.maximum.at(largest, columns, scaled)
    large = (scaled >= PIVOT * largest[columns]) & (scaled > 0.0)
    begin = np.concatenate([[0], np.cumsum(np.bincount(columns[large], minlength=system.unknowns))]).astype(np.int32)
    # first along large entries, then along any
    first = match_rows(Pattern(system.rows, system.unknowns, begin, np.ascontiguousarray(rows[large], dtype=np.int32)))
    return match_rows(pattern, first)


def nominals_of_quantities(system: System, point: tuple[float, Floats, Floats], nominal: Floats, step: float) -> Floats:
    """What nominal values of the unknowns [unknowns], and rates that reach them in a step (s), make of each observed
    quantity [observed], to first order.
    """
    t, y, yd = point
    n = system.form.written
    with np.errstate(all="ignore"):
        here = system.observe(t, y[:n], yd[:n])
        found = np.zeros(here.size)
        # random signs: sums of many terms do not cancel by chance
        for k in range(TRIES):
            signs = np.where(uniform(n, 0, k * n) < 0.5, -1.0, 1.0)
            by = STEP * signs * nominal[:n]
            moved = system.observe(t, y[:n] + by, yd[:n] + by / step)
            np.fmax(found, np.abs(moved - here) / STEP, out=found)
    return np.where(np.isfinite(found), found, 0.0)
