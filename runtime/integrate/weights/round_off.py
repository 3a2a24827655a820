"""What round-off leaves of quantities that are zero.

Rows are met to eps times their largest term, no better: unknowns are known to what the inverse of the Jacobian of a
step makes of that (backward error analysis: Higham, Accuracy and Stability of Numerical Algorithms, 2002, chapter 7).
What is zero counts in a row as the largest of its kind and unit would: beside that it is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints, statements
from sysdyn.runtime.model.scales import alike, group_maxima, group_maximum
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.runtime.numerics.least_change import least_norm
from sysdyn.runtime.numerics.points import normal

EPS = float(np.finfo(np.float64).eps)
PROBES = 4
"""Errors of the rows that are tried."""
MARGIN = 64.0
"""Times what they make of a quantity."""
BESIDE = tuning.UNSEEN
"""Of the largest of each unknown: how far beside the end they are asked too."""
PIVOT = tuning.PIVOT
"""Of the largest of its column: what an elimination takes as a pivot."""
HOPS = tuning.HOPS
"""Pivots in a row: balance, momentum, flow."""


class LeftOpen(NamedTuple):
    """What round-off leaves open of each quantity [observed]; of what a ledger stores, dissipates, is supplied with
    [ledgers, 4].
    """

    quantities: Floats
    ledgers: Floats

    def balances(self, span: float) -> Floats:
        """Of the balance of each ledger over `span` (s)."""
        return np.asarray(self.ledgers[:, 0] + span * self.ledgers[:, 1:3].sum(axis=1))


def left_open(system: System, t: float, last: tuple[Floats, Floats, Floats], step: float) -> LeftOpen:
    """What round-off leaves open in a run that ended at t (s) in steps of `step` (s).

    last: its last y and yd [unknowns], the largest |y| met of each kind and unit.  Zero where the Jacobian says
    nothing, or that nothing at all is known: not even what the text gives some unknown at the start (where constraints
    lose rank their multipliers were so large, in steps that are over).
    """
    y, yd, met = *last[:2], last[2][alike(system)]
    k_q, k_f = system.form.k_q, system.form.k_f
    # faster than that it was in shorter steps, which are over
    met[k_f] = np.minimum(met[k_f], np.maximum(2.0 * met[k_q] / step, np.abs(y[k_f])))
    # what jumps where the run ended (a floor of what is whole there) is open there, and not beside it
    places = y, y + BESIDE * met
    beside = tuple((place, system.observe(t, place, yd), system.ledgers(t, place, yd)) for place in places)
    found = LeftOpen(*map(np.zeros_like, beside[0][1:]))
    given = _initial_sizes(system)
    said = given > 0.0
    # several random errors of the rows
    for change in _changes(system, (t, y, yd), met, step):
        # more than what the text gave: nothing is known
        if (np.abs(change)[said] > given[said]).any():
            return LeftOpen(*map(np.zeros_like, found))
        opened = [np.full_like(largest, np.inf) for largest in found]
        # at both places: the smaller effect counts
        for place, *before in beside:
            moved = t, place + change, yd + change / step
            for least, now, was in zip(opened, (system.observe(*moved), system.ledgers(*moved)), before, strict=True):
                with np.errstate(invalid="ignore"):  # of what has no bounds
                    np.fmin(least, MARGIN * np.abs(now - was), out=least)
            del moved  # of a large system the room counts
        # the largest effect of all errors
        for largest, least in zip(found, opened, strict=True):
            np.fmax(largest, np.where(np.isfinite(least), least, 0.0), out=largest)
        del change, opened
    return found


def open_unknowns(system: System, t: float, y: Floats, yd: Floats, step: float) -> Floats:
    """What round-off leaves open of each unknown [unknowns] at a point, in steps of `step` (s); zero where the Jacobian
    says nothing.
    """
    found = np.zeros(system.unknowns)
    for change in _changes(system, (t, y, yd), group_maximum(system, np.abs(y)), step):
        np.fmax(found, np.abs(change), out=found)
    return found


def _changes(system: System, point: tuple[float, Floats, Floats], met: Floats, step: float) -> Iterator[Floats]:
    """Changes of the unknowns [unknowns] by which rows at a point (t, y, yd) are off by their round-off; met
    [unknowns]: how large each counts in a row.
    """
    scaled = _scaled_jacobian(system, point, met, step)
    # no slopes: nothing is said
    if scaled is None:
        return
    entries, of_column, counts = scaled
    # errors of the size of round-off, in rows that have terms
    for probe in range(PROBES):
        error = EPS * np.where(counts, normal(system.rows, behind=probe * system.rows), 0.0)
        change = of_column * least_norm((system.rows, system.unknowns), entries, error)
        del error
        yield change
        del change


def _scaled_jacobian(
    system: System, point: tuple[float, Floats, Floats], met: Floats, step: float
) -> tuple[tuple[Ints, Ints, Floats], Floats, NDArray[np.bool_]] | None:
    """The Jacobian of a step by its entries, in magnitudes of unknowns and terms of rows; these magnitudes [unknowns];
    which rows have terms [rows].  None where there are numbers that are none.
    """
    t, y, yd = point
    rows, columns = system.pattern.row, system.pattern.columns_of()
    jy, jyd = system.jacobian(t, y, yd)
    size = np.zeros(system.rows)
    # terms of each row, by values and by rates
    with np.errstate(all="ignore"):
        terms = np.abs(jy) * met[columns]
        terms += np.abs(jyd) * np.maximum(np.abs(yd), met / step)[columns]
        np.maximum.at(size, rows, terms)
        jyd /= step
        jy += jyd
    values = jy
    del terms, jy, jyd  # of a large system the room counts, here and below
    # beyond the domain of a law
    if not (np.isfinite(values).all() and np.isfinite(size).all()):
        return None
    size, brought = _terms_of_elimination(system, (rows, columns, values), size)
    # in magnitudes: what an elimination leaves of the largest unknown is no change of one that is small by its unit; a
    # unit of which there is no more than its round-off has no magnitude of its own
    met = np.where(met > EPS * brought, met, brought)
    of_row, of_column = np.where(size > 0.0, size, 1.0), np.where(met > 0.0, met, 1.0)
    with np.errstate(all="ignore"):
        values *= of_column[columns]
        values /= of_row[rows]
    return ((rows, columns, values), of_column, size > 0.0) if np.isfinite(values).all() else None


def _initial_sizes(system: System) -> Floats:
    """Largest initial value that the text gives an unknown of its kind and unit [unknowns]."""
    values, *_ = statements(system.form.at, system.unknowns, system.description.initial)
    return group_maxima(system, np.abs(values))[alike(system)]


def _terms_of_elimination(system: System, entries: tuple[Ints, Ints, Floats], size: Floats) -> tuple[Floats, Floats]:
    """Terms [rows] with those that elimination brings into a row, of the rows that are pivots of its columns; what it
    brings there of each unknown [unknowns].
    """
    # equilibrated, to tell the pivots of the columns
    rows, columns, values = entries
    row, column = sparse_factors(rows, columns, np.abs(values), (system.rows, system.unknowns))
    with np.errstate(over="ignore"):
        scaled = np.abs(values) * row[rows] * column[columns]
    largest, brought = np.zeros(system.unknowns), np.zeros(system.unknowns)
    np.maximum.at(largest, columns, scaled)
    pivot = (scaled >= PIVOT * largest[columns]) & (values != 0.0)
    # from row to unknown to row, HOPS times
    for _ in range(HOPS):
        np.maximum.at(brought, columns[pivot], size[rows[pivot]] / np.abs(values[pivot]))
        np.maximum.at(size, rows, np.abs(values) * brought[columns])
    return size, brought
