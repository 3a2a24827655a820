"""Flights that an assignment begins: a condition that became true, and is sent back by flows or states that it sets.

A ball that is thrown up by `when h <= 0 m { h' := -0.8*h' }` flies ever lower, without end by a finite instant.  What
rises less than counts as zero is not seen to become false, and so never becomes true again: the ball would fall through
its floor.  What the text says ends there.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from sysdyn.runtime.events.bounces import Bounce, thrown
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.start.restart import Restart

PART = 1e-3
"""Of the time in which the unknowns change: how far ahead a motion is looked at."""
SEEN = 10.0
"""Times zero: what rises less may be passed over."""
LEAST = 30.0
"""Times the flight that is as high as that: a condition that becomes true sooner than that is looked at again."""


def flights(
    observer: Observer,
    restart: Restart,
    t: float,
    point: tuple[Floats, Floats],
    time: float,
    falls: Sequence[tuple[int, int]],
) -> list[tuple[Bounce, float]]:
    """The flights from a point at t (s) of rows that have fallen through zero from their side (row, side), and how long
    one that rises just high enough takes (s); none of those that nothing pulls back.  time (s): in which the unknowns
    change.
    """
    (y, yd), step = point, PART * time
    later = None
    with suppress(SolverFailure, NotFiniteError):
        later = restart.struck(t + step, y + step * yd, yd)
    if later is None:
        return []
    now = observer(t, y, yd)
    one = observer(t + step, y + 0.5 * step * (yd + later[1]), later[1]) - now
    two = observer(t + 2.0 * step, y + 2.0 * step * later[1], later[1]) - now
    speed, pull = (4.0 * one - two) / (2.0 * step), (2.0 * one - two) / step**2
    found = []
    for row, side in falls:
        bounce = thrown(side * float(now[row]), side * float(speed[row]), side * float(pull[row]))
        if np.isfinite(bounce.flight):
            found.append((bounce, 2.0 * float(np.sqrt(2.0 * SEEN * observer.zero(row) / (side * pull[row])))))
    return found
