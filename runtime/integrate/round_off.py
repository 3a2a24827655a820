"""What round-off leaves of quantities that are zero.

Rows are met to eps times their largest term, no better: unknowns are known to what the inverse of the Jacobian of a
step makes of that (backward error analysis: Higham, Accuracy and Stability of Numerical Algorithms, 2002, chapter 7).
What is zero counts in a row as the largest of its kind and unit would: beside that it is known.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.scales import group_maximum
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.least_change import least_norm
from sysdyn.runtime.numerics.points import normal

EPS = float(np.finfo(np.float64).eps)
PROBES = 4
"""Errors of the rows that are tried."""
MARGIN = 64.0
"""Times what they make of a quantity."""


def left_open(system: System, t: float, last: tuple[Floats, Floats, Floats], step: float) -> Floats:
    """What round-off leaves open of each quantity [observed] of a run that ended at t (s) in steps of `step` (s).

    last [unknowns]: its last y and yd, the largest |y| met.  Zero where the Jacobian says nothing.
    """
    y, yd, met = *last[:2], group_maximum(system, last[2])
    rows, columns = system.pattern.row, system.pattern.columns_of()
    jy, jyd = system.jacobian(t, y, yd)
    with np.errstate(all="ignore"):
        terms = np.abs(jy) * met[columns] + np.abs(jyd) * np.maximum(np.abs(yd), met / step)[columns]
        of_step = jy + jyd / step
    size, before = np.zeros(system.rows), system.observe(t, y, yd)
    np.maximum.at(size, rows, terms)
    found = np.zeros_like(before)
    if not (np.isfinite(of_step).all() and np.isfinite(size).all()):
        return found
    for error in normal(PROBES, system.rows):
        change = least_norm((system.rows, system.unknowns), (rows, columns, of_step), EPS * size * error)
        moved = system.observe(t, y + change, yd + change / step)
        np.fmax(found, np.abs(moved - before), out=found)
    return MARGIN * found
