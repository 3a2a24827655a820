"""Gaps that an impact opened, until they close again."""

from __future__ import annotations

import numpy as np
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Bounce:
    """A gap that an impact opened, in free flight: its value there, which is zero but for round-off (level <= 0), what
    it rises to (height), and the time until it closes again (flight, s; both infinite where nothing pulls it back).
    """

    level: float
    height: float
    flight: float


def thrown(value: float, speed: float, pull: float) -> Bounce:
    """A gap with its value, that opens at a speed and is pulled back."""
    back = speed > 0.0 and pull > 0.0
    height, flight = (0.5 * speed * speed / pull, 2.0 * speed / pull) if back else (np.inf, np.inf)
    return Bounce(min(value, 0.0), height, flight)
