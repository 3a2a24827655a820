"""What the runs of one simulation have cost so far, and how long they will still take."""

from __future__ import annotations

import json
import time
from typing import Any

from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import Statistics

FORETOLD = 0.01
"""Of the span: when a forecast is made."""
BEHIND = 1.5
"""Work of the run behind a draft over the draft's: a tenth of the tolerance at the orders of the methods."""


class Accounts:
    """statistics, cpu and wall (s): of all runs; last: statistics of the last, smooth: whether its motion was; began,
    run (s): when the simulation and the run under way began; forecast (s): made once, of the whole.
    """

    def __init__(self, options: Options) -> None:
        self.options = options
        self.statistics, self.last = Statistics(), Statistics()
        self.smooth = False
        self.cpu = self.wall = 0.0
        self.began = self.run = time.monotonic()
        self.forecast: float | None = None

    def begin(self) -> None:
        """A run begins."""
        self.run = time.monotonic()

    def add(self, integration: Integration) -> None:
        """The run under way has ended."""
        self.cpu += integration.cpu
        self.wall += time.monotonic() - self.run
        self.last, self.smooth = integration.work
        self.statistics = self.statistics + self.last

    def take(self, other: Accounts) -> None:
        """What other runs of the same simulation cost."""
        self.statistics, self.cpu = self.statistics + other.statistics, self.cpu + other.cpu
        self.wall += other.wall

    def wall_left(self) -> float | None:
        """Seconds that runs may still take."""
        most = self.options.max_wall
        return None if most is None else most - (time.monotonic() - self.began)

    def progress(self, t: float, *, another: bool) -> None:
        """A run has come to t (s); another: a run behind it is foreseen."""
        options = self.options
        # a span of one instant is done as soon as it begins
        span = options.t_end - options.t_start
        fraction = (t - options.t_start) / span if span > 0.0 else 1.0
        left = self._seconds_left(fraction, another=another)
        if options.progress is not None:
            options.progress(fraction, left)

    def _seconds_left(self, fraction: float, *, another: bool) -> float | None:
        """Seconds to the end of the runs that are foreseen; None before a hundredth of the first."""
        # too early to extrapolate from, or at the end
        if not FORETOLD <= fraction < 1.0:
            return None if fraction < 1.0 else 0.0
        # seconds grow in proportion to the part of the span that is done
        spent = time.monotonic() - self.run
        whole = spent / fraction
        left = whole - spent + (BEHIND * whole if another else 0.0)
        # the first forecast is kept: `--timings` compares it with what came
        if self.forecast is None:
            self.forecast = time.monotonic() - self.began + left
        return left

    def attributes(self, error_estimate: float | None) -> dict[str, str]:
        """Statistics and timings as JSON."""
        found = {"statistics": json.dumps(self.statistics_object(error_estimate))}
        if self.options.timings:
            found["timings"] = json.dumps(self.timings())
        return found

    def statistics_object(self, error_estimate: float | None) -> dict[str, Any]:
        """The counters of all runs, with the estimate."""
        counted = {name: getattr(self.statistics, name) for name in Statistics.__slots__}
        return {**counted, "error_estimate": error_estimate}

    def timings(self) -> dict[str, float]:
        """cpu_integrate_s, wall_integrate_s, cpu_compile_s, wall_total_s; forecast_s of a longer one."""
        # a command began before its runs: reading and compiling count too
        began = self.options.wall_began
        total = time.monotonic() - (self.began if began is None else began)
        foretold = {} if self.forecast is None else {"forecast_s": self.forecast}
        return {
            **foretold,
            "cpu_integrate_s": self.cpu,
            "wall_integrate_s": self.wall,
            "cpu_compile_s": self.options.cpu_compile,
            "wall_total_s": total,
        }
