"""How short stability alone would keep the steps of the explicit method, told from the Jacobian where a run starts."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState

BOUNDARY = 6.1
"""Of h |lambda|: where the region of stability of DOP853 ends (`BOUNDARY` of core/steppers/explicit/dopri.c)."""
MANY = 200
"""Steps that it would have to take at least: twice as many as a stiff run of it may still (`HELD` of way.py)."""
SMALL = 30
"""Unknowns up to which eigenvalues cost less than the steps by which the method itself would tell."""
RESOLVED = 1e-9
"""Of the largest of 1 / (shift - eigenvalue): less is round-off of what is infinite."""

LATER = (0.137, 0.419, 0.761)
"""Parts of the span at which sources show themselves beside the start: what they ask for no start says."""


def _driven(system: System, t: float, span: float, y: Floats, yd: Floats) -> bool:
    """Whether the equations depend on time itself."""
    first = system.residual(t, y, yd)
    return any(not np.array_equal(system.residual(t + part * span, y, yd), first) for part in LATER)


def stable_step(system: System, start: ConsistentState, t_end: float) -> float | None:
    """The step (s) to which the fastest decay at the start of a run to t_end would hold the explicit method.

    None where these are few steps, or where something oscillates or grows as fast, or comes from outside, with which
    steps go in any case.  system: of index 1 at most.  Eigenvalues s of J + s E by those of
    (J + a E)^-1 E, which are 1 / (a - s), and 0 for what is undifferentiated.
    """
    span = t_end - start.t
    if not 0 < system.unknowns <= SMALL or not 0.0 < span < np.inf:
        return None
    shift, (y, yd) = BOUNDARY * MANY / span, start.for_form(system)
    with np.errstate(all="ignore"):
        jy, jyd = (system.dense(part) for part in system.jacobian(start.t, y, yd))
        if _driven(system, start.t, span, y, yd):
            return None
        try:
            found = np.linalg.eigvals(np.linalg.solve(jy + shift * jyd, jyd))
        except np.linalg.LinAlgError:
            return None
    size = np.abs(found)
    finite = found[size > RESOLVED * size.max(initial=0.0)]
    rates = shift - 1.0 / finite if finite.size else finite
    decay = float(np.max(-rates.real, initial=0.0))
    if not decay > shift or max(np.max(np.abs(rates.imag), initial=0.0), np.max(rates.real, initial=0.0)) > decay:
        return None
    return BOUNDARY / decay
