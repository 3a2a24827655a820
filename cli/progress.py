"""A progress line with the time left, on runs of over a second; a long forecast is said whatever the mode."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

LONG = 600.0
"""Seconds left that are said at once."""
RUN = "of integration lie ahead: --max-wall, a looser --accuracy or a shorter span would shorten it"
SEARCH = "of search lie ahead: fewer --tries would shorten it"


class ProgressLine:
    """Writes to standard error: over itself on a terminal, every ten seconds elsewhere; a `with` takes it away.
    ahead: what takes long.
    """

    def __init__(self, mode: str, ahead: str = RUN) -> None:
        self._ahead = ahead
        self._terminal = sys.stderr.isatty()
        self._on = mode == "always" or (mode == "auto" and self._terminal)
        self._began = time.monotonic()
        self._last = 0.0
        self._shown = False
        self._warns = mode != "never"

    def __call__(self, fraction: float, left: float | None) -> None:
        """Fraction of the span done, seconds left (None: not known yet)."""
        if self._warns and left is not None and left > LONG:
            self._warns = False
            self.clear()
            sys.stderr.write(f"about {_duration(left)} {self._ahead}\n")
            sys.stderr.flush()
        now = time.monotonic()
        wait = 0.2 if self._terminal else 10.0 if self._shown else 0.0
        if not self._on or now - self._began < 1.0 or now - self._last < wait:
            return
        self._last, self._shown = now, True
        remaining = "" if left is None else f", {_duration(left)} left"
        text = f"{100.0 * fraction:5.1f} %{remaining}"
        sys.stderr.write(f"\r{text:<40}" if self._terminal else f"{text}\n")
        sys.stderr.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()

    def clear(self) -> None:
        """Take the line away."""
        if self._shown and self._terminal:
            sys.stderr.write("\r" + " " * 40 + "\r")
            sys.stderr.flush()


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
