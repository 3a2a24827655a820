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
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.inertia import with_flows
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.points import uniform
from sysdyn.runtime.numerics.tall import free_unknowns
from sysdyn.runtime.start.start import ConsistentState

MOVED = tuning.SMALL
"""Relative move of the start: a coefficient that vanishes there by chance does not vanish beside it."""


def unique(system: System, jyd: Floats) -> NDArray[np.bool_]:
    """[unknowns]: derivatives that F = 0 determines: none moves along what dF/dyd leaves open; of matrices for which
    that would cost too much all that occur.
    """
    # entries of rates that occur at the start
    there = jyd != 0.0
    row, column, value = system.pattern.row[there], system.pattern.columns_of()[there], jyd[there]
    free = free_unknowns((system.rows, system.unknowns), (row, column, value))
    return np.isin(np.arange(system.unknowns), column) if free is None else ~free


def determined_rates(system: System, start: ConsistentState) -> NDArray[np.bool_]:
    """[observed]: elements of block observe whose derivative follows from the equations."""
    y, yd = start.for_form(system)
    jyd = system.slopes(start.t, y, yd, rate=True)
    # rates that are open; of momenta the flows follow
    free = ~unique(system, jyd)
    free[with_flows(system)[1]] = False  # functions of the tested momenta
    found = np.ones(system.observed_rows("observe_rate")[1], dtype=bool)
    if not free.any():
        return found
    # at the state and beside it: with other open rates the same values, or no numbers
    for k, size in enumerate((0.0, MOVED)):
        part, times = (uniform(y.size, place, k * y.size) for place in (0, 1))
        there = y + size * (np.abs(y) + MOVED) * (0.5 + 0.5 * part)
        other = yd + free * (1.0 + times) * np.where(yd != 0.0, np.abs(yd), 1.0)
        with np.errstate(all="ignore"):
            one = system.observe_rate(start.t, there, yd)
            two = system.observe_rate(start.t, there, other)
        found &= (one == two) | np.isnan(one) | np.isnan(two)
    return found
