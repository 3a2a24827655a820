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
    found: NDArray[np.bool_] = system.differential(jyd)
    row, column = system.pattern.row[jyd != 0.0], system.pattern.columns_of()[jyd != 0.0]
    left = np.ones(row.size, dtype=bool)
    while left.any():  # a row with but one derivative determines it
        single = np.bincount(row[left], minlength=system.rows) == 1
        known = np.zeros(system.unknowns, dtype=bool)
        known[column[left & single[row]]] = True
        if not known.any():
            break
        left &= ~known[column]
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


def determined(system: System, start: ConsistentState) -> NDArray[np.bool_]:
    """[observed]: elements of block observe whose derivative follows from the equations."""
    y, yd = start.for_form(system)
    _, jyd = system.jacobian(start.t, y, yd)
    moved = {family.owner for family in system.description.families if family.kind == "p"}
    inert = np.array([family.kind == "f" and family.owner in moved for family in system.description.families] + [False])
    free = ~(unique(system, jyd) | inert[system.family_of])
    random = np.random.default_rng(0)
    found: NDArray[np.bool_] | None = None
    for size in (0.0, MOVED):
        there = y + size * (np.abs(y) + MOVED) * random.uniform(0.5, 1.0, y.size)
        other = yd + free * random.uniform(1.0, 2.0, y.size) * np.where(yd != 0.0, np.abs(yd), 1.0)
        with np.errstate(all="ignore"):
            one = system.observe_rate(start.t, there, yd)
            two = system.observe_rate(start.t, there, other)
        same = (one == two) | np.isnan(one) | np.isnan(two)
        found = same if found is None else found & same
    assert found is not None
    return found
