"""Flights: of gaps that an impact opened, until they close again, and of what an assignment begins.

A ball that is thrown up by `when h <= 0 m { h' := -0.8*h' }` flies ever lower, without end by a finite instant.  What
rises less than counts as zero is not seen to become false, and so never becomes true again: the ball would fall through
its floor.  What the text says ends there.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.plan import Contact
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.start.restart import Restart
from sysdyn.values import dataclass

PART = tuning.SMALL
"""Of the time in which the unknowns change: how far ahead a motion is looked at."""
SEEN = 10.0
"""Times zero: what rises less may be passed over."""
LEAST = 30.0
"""Times the flight that is as high as that: a condition that becomes true sooner than that is looked at again."""


@dataclass(frozen=True, slots=True)
class Bounce:
    """A gap that an impact opened, in free flight: its value there, which is zero but for round-off (level <= 0), what
    it rises to (height), when it begins and the time until it closes again (begins, flight, s; height and flight are
    infinite where nothing pulls it back).
    """

    level: float
    height: float
    begins: float
    flight: float


def is_thrown(t: float, value: float, speed: float, pull: float) -> Bounce:
    """A gap with its value, that opens at t (s) at a speed and is pulled back."""
    # a parabola: height v^2 / 2a, flight 2v / a; without a pull back it ends nowhere
    back = speed > 0.0 and pull > 0.0
    height, flight = (0.5 * speed * speed / pull, 2.0 * speed / pull) if back else (np.inf, np.inf)
    return Bounce(min(value, 0.0), height, t, flight)


def begun_flights(t: float, values: Floats, gaps: Sequence[Contact]) -> dict[int, Bounce]:
    """The flights that begin at t (s), by rows of gaps; values [observed] there."""
    speed_of = {c.value: (float(values[c.rate]), -float(values[c.acceleration])) for c in gaps}
    return {row: is_thrown(t, float(values[row]), *motion) for row, motion in speed_of.items()}


def new(now: dict[int, Bounce], before: dict[int, Bounce]) -> list[int]:
    """The rows of gaps whose flight now is not one of before."""
    return [row for row, bounce in now.items() if before.get(row) is not bounce]


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
    # the point a short step later; without one nothing is said of flights
    later = None
    with suppress(SolverFailure, NotFiniteError):
        later = restart.struck(t + step, y + step * yd, yd)
    if later is None:
        return []
    # second differences: speed and pull of all rows
    now = observer(t, y, yd)
    one = observer(t + step, y + 0.5 * step * (yd + later[1]), later[1]) - now
    two = observer(t + 2.0 * step, y + 2.0 * step * later[1], later[1]) - now
    speed, pull = (4.0 * one - two) / (2.0 * step), (2.0 * one - two) / step**2
    found = []
    # values are on the side they have fallen from
    for row, side in falls:
        bounce = is_thrown(t, side * float(now[row]), side * float(speed[row]), side * float(pull[row]))
        # how long a flight takes whose height is only just seen
        if np.isfinite(bounce.flight):
            found.append((bounce, 2.0 * float(np.sqrt(2.0 * SEEN * observer.zero(row) / (side * pull[row])))))
    return found
