"""The metric in which the multipliers nu of the stabilised form move displacements.

With rows q' - f + Phi_q^T nu alone metres and radians mix, and the steps depend on the unit of length.  The rows are
multiplied by one factor a unit: the largest inertia of the flows of that unit (then the change of q is about the least
in the metric of the inertia), or, where some unit has none, one over the largest magnitude squared.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.scales import group_maximum
from sysdyn.runtime.model.system import System


def own_inertia(system: System, jy: Floats, jyd: Floats) -> Floats:
    """Diagonal of M = d2T*/df2 at the places of the flows [unknowns]; 0 where there is none.

    jy, jyd [entries]: dF/dy, dF/dyd.  M stands in the rows of dynamics (Lagrange), minus M in those of momentum.
    """
    found = np.zeros(system.unknowns)
    families = system.description.families
    flows = {family.owner: k for k, family in enumerate(families) if family.kind == "f"}
    columns = system.pattern.columns_of()
    for values, name in ((jyd, "dynamics"), (jy, "momentum")):
        place = np.full(system.rows, -1, dtype=np.int64)
        for group, family, first in system.form.groups:
            row = system.description.rows[family]
            flow = flows.get(row.owner)
            if group == name and flow is not None and families[flow].size == row.size:
                place[first : first + row.size] = system.form.at[flow] + np.arange(row.size)
        mine = place[system.pattern.row] == columns
        np.maximum.at(found, columns[mine], np.abs(values[mine]))
    return found


def light(system: System, jy: Floats, jyd: Floats) -> NDArray[np.bool_]:
    """Displacements without inertia where others have some [unknowns]."""
    found, form = np.zeros(system.unknowns, dtype=bool), system.form
    inertia = own_inertia(system, jy, jyd)[form.k_f]
    found[form.k_q] = (inertia == 0.0) & bool((inertia > 0.0).any())
    return found


def kinematic_scale(system: System, magnitude: Floats, jy: Floats, jyd: Floats) -> Floats:
    """Factor of each row q' - f; 1 where all displacements have one unit."""
    form = system.form
    size = group_maximum(system, own_inertia(system, jy, jyd))[form.k_f]
    if not (size > 0.0).all() or not np.isfinite(size).all():
        size = group_maximum(system, magnitude)[form.k_q] ** -2.0
    return np.asarray(size / size.min(initial=np.inf))
