"""The metric in which the multipliers nu of the stabilised form move displacements.

With rows q' - f + Phi_q^T nu alone metres and radians mix, and the steps depend on the unit of length.  The rows are
multiplied by one factor a unit: the largest inertia of the flows of that unit (then the change of q is about the least
in the metric of the inertia), or, where some unit has none, one over the largest magnitude squared.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.inertia import own_inertia
from sysdyn.runtime.model.scales import group_maximum
from sysdyn.runtime.model.system import System

SQUARED = 1e-70, 1e70
"""Magnitudes whose squares, and quotients of these, are numbers."""


def kinematic_scale(system: System, magnitude: Floats, jy: Floats, jyd: Floats) -> Floats:
    """Factor of each row q' - f; 1 where all displacements have one unit."""
    form = system.form
    size = group_maximum(system, np.abs(own_inertia(system, jy, jyd)))[form.k_f]
    # no inertia in some rows: by magnitudes instead
    if not (size > 0.0).all() or not np.isfinite(size).all():
        size = np.clip(group_maximum(system, magnitude)[form.k_q], *SQUARED) ** -2.0
    return np.asarray(size / size.min(initial=np.inf))
