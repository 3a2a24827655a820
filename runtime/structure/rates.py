"""Which traced quantities have a derivative that the equations determine.

The rate of an unknown whose derivative does not occur in the equations (an implicit effort, the flow of a massless
coordinate; one of two flows whose difference alone is differentiated) is but the slope of the integrator's polynomial,
which no error test sees: a cubic Hermite interpolant made of it leaves the solution by far more than the values do.  A
quantity whose derivative depends on such a rate has none.
Flows of coordinates with a momentum of their own are functions of the tested momenta: their rates are as good as those.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.inertia import with_flows
from sysdyn.runtime.model.patterns import read_only
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import TOLERANCE, null_space
from sysdyn.runtime.start.start import ConsistentState

LARGE = 400
"""Unknowns coupled by their derivatives: of more all count as determined, the null space would cost too much."""
MOVED = 1e-3
"""Relative move of the start: a coefficient that vanishes there by chance does not vanish beside it."""


def unique(system: System, jyd: Floats) -> NDArray[np.bool_]:
    """[unknowns]: derivatives that F = 0 determines: none moves along the null space of dF/dyd."""
    there = jyd != 0.0
    found, left = system.once_if_small(("known rates", there.tobytes()), lambda: _single(system, there))
    if left.any():
        return _coupled(system, jyd, found.copy(), left)
    return found


def _single(system: System, there: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """[unknowns]: derivatives that occur; [entries that are there]: those that no row with but one left determines."""
    row, column = system.pattern.row[there], system.pattern.columns_of()[there]
    found, left = np.zeros(system.unknowns, dtype=bool), np.ones(row.size, dtype=bool)
    found[column] = True
    while left.any():  # a row with but one derivative determines it
        single = np.bincount(row[left], minlength=system.rows) == 1
        known = np.zeros(system.unknowns, dtype=bool)
        known[column[left & single[row]]] = True
        if not known.any():
            break
        left &= ~known[column]
    return read_only(found), left


def _coupled(
    system: System, jyd: Floats, found: NDArray[np.bool_], left: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """`found` without the rates that move along the null space of the rows left."""
    row, column = system.pattern.row[jyd != 0.0], system.pattern.columns_of()[jyd != 0.0]
    columns, at = np.unique(column[left], return_inverse=True)
    if not 0 < columns.size <= LARGE:
        return found
    rows, where = np.unique(row[left], return_inverse=True)
    matrix = np.zeros((rows.size, columns.size))
    matrix[where, at] = jyd[jyd != 0.0][left]
    by_row, by_column = factors(matrix)
    null = null_space(by_row[:, None] * matrix * by_column) * by_column[:, None]
    moves = np.abs(null) > np.sqrt(TOLERANCE) * np.max(np.abs(null), initial=0.0)
    found[columns[np.any(moves, axis=1)]] = False
    return found


def _inert(system: System) -> NDArray[np.bool_]:
    """Flows of coordinates with a momentum of their own [unknowns]."""
    found = np.zeros(system.unknowns, dtype=bool)
    for _, flows in with_flows(system):
        found[flows] = True
    return read_only(found)


def _read(system: System) -> NDArray[np.bool_]:
    """Unknowns whose rates block observe_rate reads, as far as it is told [unknowns]."""
    kernels = system.description.blocks.get("observe_rate", ())
    if any(kernel.rates is None for kernel in kernels):
        return read_only(np.ones(system.unknowns, dtype=bool))
    families = frozenset[int]().union(*(kernel.rates for kernel in kernels if kernel.rates is not None))
    return read_only(np.isin(system.family_of, sorted(families)))


def _nudges(number: int) -> list[tuple[Floats, Floats]]:
    """Parts by which values are moved, and times by which rates are, at the start and beside it."""
    random = np.random.default_rng(0)
    return [(random.uniform(0.5, 1.0, number), random.uniform(1.0, 2.0, number)) for _ in range(2)]


def determined(system: System, start: ConsistentState) -> NDArray[np.bool_]:
    """[observed]: elements of block observe whose derivative follows from the equations."""
    y, yd = start.for_form(system)
    _, jyd = system.jacobian(start.t, y, yd)
    free = ~(unique(system, jyd) | system.once("inert", lambda: _inert(system)))
    if not (free & system.once("rates observed", lambda: _read(system))).any():
        return np.ones(system.observed_rows("observe_rate")[1], dtype=bool)
    nudges = system.once_if_small("nudges", lambda: _nudges(y.size))
    found: NDArray[np.bool_] | None = None
    for size, (part, times) in zip((0.0, MOVED), nudges, strict=True):
        there = y + size * (np.abs(y) + MOVED) * part
        other = yd + free * times * np.where(yd != 0.0, np.abs(yd), 1.0)
        with np.errstate(all="ignore"):
            one = system.observe_rate(start.t, there, yd)
            two = system.observe_rate(start.t, there, other)
        same = (one == two) | np.isnan(one) | np.isnan(two)
        found = same if found is None else found & same
    assert found is not None
    return found
