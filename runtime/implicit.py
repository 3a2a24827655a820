"""Whether the gammas determine the implicit unknowns at a state (language, E505).

A gamma may leave out its own unknown (a controlled flow source does): then the rest of the model determines it.  But
where the unknown stands in a gamma and the slope there vanishes, Newton's iteration has nothing to hold on to.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.start import ConsistentState
from sysdyn.runtime.system import System

NUDGE = 1e-3
"""Relative move of an implicit unknown, small enough for the exponential of a diode."""
VANISHING = 1e-7
"""A slope below this part of the one beside it vanishes."""


def undetermined(system: System, state: ConsistentState) -> tuple[str, ...]:
    """Implicit unknowns whose gammas have no slope in them at the state; system: the form as written."""
    y, yd = state.for_form(system)
    implicit = np.flatnonzero(system.kinds == "e")
    if not implicit.size:
        return ()
    gamma = np.zeros(system.rows, dtype=bool)
    for group, family, first in system.form.groups:
        if group == "gamma":
            gamma[first : first + system.description.rows[family].size] = True
    beside = y.copy()
    beside[implicit] += NUDGE * (1.0 + np.abs(y[implicit]))
    columns = system.pattern.columns_of()
    slopes = []
    for point in (y, beside):
        values = np.where(gamma[system.pattern.row], np.abs(system.jacobian(state.t, point, yd)[0]), 0.0)
        largest = np.zeros(system.unknowns)
        np.maximum.at(largest, columns, values)
        slopes.append(largest[implicit])
    found = (slopes[1] > 0.0) & (slopes[0] <= VANISHING * slopes[1])
    return tuple(system.name(int(k)) for k in implicit[found])
