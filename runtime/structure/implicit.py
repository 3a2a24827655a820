"""Whether the gammas determine the implicit unknowns at a state (language, E505).

A gamma may leave out its own unknown (a controlled flow source does), and its slope may vanish at a point (a valve at
rest): then the rest of the model must determine the unknown.  Where it does not, the matrix of Newton's iteration is
singular there and regular beside it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.scales import balanced
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import equilibrated
from sysdyn.runtime.numerics.rank import decomposed
from sysdyn.runtime.start.start import ConsistentState

NUDGES = (1e-3, 1e-6, 1e-9)
"""Moves of an implicit unknown, as parts of its size: the least is small enough for the exponential of a diode."""
VANISHING = 1e-7
"""A slope below this part of the one beside it vanishes."""

DENSE = 600
"""Rows up to which the matrix is looked at."""


def undetermined(system: System, state: ConsistentState) -> tuple[str, ...]:
    """Implicit unknowns whose gammas have no slope in them at the state; system: the form as written."""
    y, yd = state.for_form(system)
    implicit = np.flatnonzero(system.are("e"))
    if not implicit.size:
        return ()
    gamma = system.of_groups("gamma")
    columns = system.pattern.columns_of()

    def slopes(point: Floats) -> Floats:
        values = np.where(gamma[system.pattern.row], np.abs(system.jacobian(state.t, point, yd)[0]), 0.0)
        largest = np.zeros(system.unknowns)
        np.maximum.at(largest, columns, values)
        return np.asarray(largest[implicit])

    clean = state.without_noise(y)
    size = balanced(system, clean, system.jacobian(state.t, clean, yd)[0])[implicit]
    here = slopes(y)
    found = np.ones(implicit.size, dtype=bool)
    for nudge in NUDGES:
        there = slopes(_moved(y, implicit, nudge * size))
        found &= np.isfinite(there) & (there > 0.0) & (here <= VANISHING * there)
    if not found.any() or system.rows > DENSE:
        return ()
    beside = _moved(y, implicit[found], NUDGES[-1] * size[found])
    iterated = (system.dense(np.add(*system.jacobian(state.t, point, yd))) for point in (y, beside))
    at, off = (decomposed(matrix)[1][-1] for matrix in equilibrated(*iterated))
    if at > VANISHING * off:
        return ()
    return tuple(system.name(int(k)) for k in implicit[found])


def _moved(y: Floats, places: NDArray[np.intp], by: Floats) -> Floats:
    found = y.copy()
    found[places] += by
    return found
