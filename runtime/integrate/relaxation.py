"""How far unknowns get from a start, by the motion linearised there.

A rate says little of a quantity that relaxes at once: 1 V on 1 uH behind 1 ohm makes 0.5 uWb, not 1 V times the time
scale of the rest.  Magnitudes taken from rates alone would hide such a transient from the error test.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.ordering import order_of

RUNGS, RATIO = 4, 1e-3
"""Times that are tried: each this part of the one before, down to 1e-9 of the time scale."""


def displacement(system: System, jy: Floats, jyd: Floats, yd: Floats) -> Callable[[float], Floats]:
    """The function of a time tau (s) that says how far each unknown gets within it [unknowns].

    jy, jyd [entries]: dF/dy, dF/dyd at the start; yd [unknowns]: the rates there.  Of steps h <= tau by implicit Euler,
    (jyd/h + jy) (y - y0) = jyd yd, the largest |y - y0|, at most tau |yd|.
    """

    def far(tau: float) -> Floats:
        bound = tau * np.abs(yd)
        if not (np.isfinite(jy).all() and np.isfinite(jyd).all() and yd.any()):
            return bound
        pattern = system.pattern
        places = pattern.column, pattern.row, order_of(system)
        linear = lib.core.sd_linear_new(pattern.unknowns, *map(lib.pointer, places))
        if not linear:
            raise MemoryError
        moved = np.zeros(yd.size)
        push = np.zeros(system.rows)
        np.add.at(push, pattern.row, jyd * yd[pattern.columns_of()])
        for h in tau * RATIO ** np.arange(RUNGS):
            values = np.ascontiguousarray(jy + jyd / h)
            if lib.core.sd_linear_factor(linear, lib.pointer(values), None) == 0:
                step = push.copy()
                lib.core.sd_linear_solve(linear, lib.pointer(step))
                moved = np.fmax(moved, np.abs(step))
            else:
                moved = bound
        lib.core.sd_linear_free(linear)
        return np.asarray(np.where(np.isfinite(moved), np.minimum(moved, bound), bound))

    return far
