"""Magnitudes of the unknowns: what relative tolerances and scaled matrices refer to.

A magnitude is the nominal value of the manifest where it names one.  Else the largest of |y| at the start, a
thousandth of the largest |y| among unknowns of the same kind and unit, and |y'| over a hundredth of the span.
Unknowns that are zero with all of that take the magnitude that balances the rows they stand in: the other terms
of the row, and how far the row itself moves with t over the span (sources that start at zero).
While a run tracks magnitudes they grow with max |y|; a second run starts with the maxima of the first.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.description import Floats
from sysdyn.runtime.system import System

GROUP = 1e-3
SPAN = 1e-2
NOISE = 1e-6
"""Values below this part of what balances their rows are round-off, or zero by chance."""
_SAMPLES = 16
_SWEEPS = 8


def excitation(system: System, t0: float, t_end: float, y: Floats, yd: Floats) -> Floats:
    """How far each row moves with t alone over the span [rows]."""
    base = system.residual(t0, y, yd)
    most = np.zeros(system.rows)
    for k in range(1, _SAMPLES + 1):
        now = system.residual(t0 + (t_end - t0) * (k - 0.382) / _SAMPLES, y, yd)
        most = np.fmax(most, np.where(np.isfinite(now), np.abs(now - base), 0.0))
    return most


def propagate(
    magnitude: Floats, rows: np.ndarray, columns: np.ndarray, size: Floats, excited: Floats
) -> Floats:
    """Fills zeros of `magnitude` [unknowns] so that their terms balance the others of their rows.

    rows, columns, size [entries]: |coefficient| of each place; excited [rows]: magnitude of the rows' free terms.
    """
    found = magnitude.copy()
    places = size > 0.0
    rows, columns, size = rows[places], columns[places], size[places]
    for _ in range(_SWEEPS):
        missing = found == 0.0
        if not missing.any():
            break
        row = excited.copy()
        np.maximum.at(row, rows, size * found[columns])
        wanted = missing[columns] & (row[rows] > 0.0)
        smallest = np.full(found.size, np.inf)
        np.minimum.at(smallest, columns[wanted], row[rows[wanted]] / size[wanted])
        found = np.where(missing & np.isfinite(smallest), smallest, found)
    return found


def group_maximum(system: System, values: Floats) -> Floats:
    """Largest value among the unknowns of the same kind and unit."""
    families = system.description.families
    keys: dict[tuple[str, str], int] = {}
    number = np.empty(len(families) + 1, dtype=np.int64)
    for k, family in enumerate(families):
        number[k] = keys.setdefault((family.kind, family.unit), len(keys))
    number[-1] = len(keys)
    group = number[system.family_of]
    largest = np.zeros(len(keys) + 1)
    np.maximum.at(largest, group, values)
    return largest[group]


def magnitudes(system: System, t0: float, t_end: float, y: Floats, yd: Floats) -> Floats:
    """Magnitude of each unknown [unknowns], all positive."""
    span = max(t_end - t0, 0.0) or 1.0
    state = np.isin(system.kinds, ("q", "f", "p", "s"))
    known = np.abs(y) + np.where(state, SPAN * span * np.abs(yd), 0.0)
    known = np.maximum(known, GROUP * group_maximum(system, known))
    known = np.where(np.isfinite(known), known, 0.0)
    found = np.where(system.nominal > 0.0, system.nominal, known)
    jy, jyd = system.jacobian(t0, y, yd)
    size = np.abs(jy) + np.abs(jyd) / (SPAN * span)
    size = np.where(np.isfinite(size), size, 0.0)
    excited = excitation(system, t0, t_end, y, yd)
    pattern = system.pattern
    # what follows from the state is balanced against it, so that round-off of a start does not pass for a magnitude
    balanced = propagate(np.where(state, found, 0.0), pattern.row, pattern.columns_of(), size, excited)
    found = np.where(found > NOISE * balanced, found, balanced)
    found = np.where(found == 0.0, group_maximum(system, found), found)
    tiny = np.finfo(np.float64).tiny * 1e30
    return np.where(found > tiny, found, 1.0)
