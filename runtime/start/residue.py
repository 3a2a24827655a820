"""What a source at its peak leaves of a rate: round-off, which is no size.

The rate of 325 V sin(w t + pi/2) is 6e-12 V/s at t = 0, and balanced by rates as small it would be the size of what
other rows need 1e3 A/s of: no step would find these, and a search that may not move them moves the state.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.start.equations import HIDDEN

RESIDUE = tuning.SAME
"""Of what a row's free term is at other times: round-off of a zero."""
LATER = (0.6180339887, 6.180339887e6)
"""s: such times, in no simple ratio to a period; for what turns in years too."""
PART = 1 << 16
"""Rows that are looked at together: of a large model the room counts."""


def _largest(values: Floats) -> float:
    size = np.abs(values)
    return float(np.max(size, where=np.isfinite(size), initial=0.0))


def _between(size: Floats, most: float) -> NDArray[np.bool_]:
    return (size > 0.0) & (size < most)


class Rows(Protocol):
    """Equations of a start."""

    guess: Floats

    def residual(self, t: float, x: Floats) -> Floats:
        """All rows [rows]."""

    def groups(self, *names: str) -> NDArray[np.bool_]:
        """Rows of the named groups."""


class Residue:
    """Of one search: free terms at other times are asked for once, where there is something to tell."""

    def __init__(self) -> None:
        self._later: tuple[float, Floats] | None = None

    def cleared(self, rows: Rows, t: float, free: Floats) -> Floats:
        """Free terms [rows] at t, without what is left of a zero in rows of rates."""
        # in parts: of a large model no copy
        parts = [slice(k, k + PART) for k in range(0, free.size, PART)]
        largest = max((_largest(free[part]) for part in parts), default=0.0)
        tiny = [k.start + np.flatnonzero(_between(np.abs(free[k]), RESIDUE * largest)) for k in parts]
        places = np.concatenate([np.zeros(0, dtype=np.int64), *tiny])
        places = places[rows.groups(*HIDDEN)[places]] if places.size else places
        # nothing tiny in rows of rates
        if not places.size:
            return free
        left = free.copy()
        left[places[np.abs(free[places]) < RESIDUE * self._at_other_times(rows, t)[places]]] = 0.0
        return left

    def _at_other_times(self, rows: Rows, t: float) -> Floats:
        """The largest of each free term beside the guess [rows]."""
        # residuals at other instants, once for each t
        if self._later is None or self._later[0] != t:
            found = [np.abs(rows.residual(t + beyond, rows.guess)) for beyond in LATER]
            self._later = t, np.max([np.where(np.isfinite(size), size, 0.0) for size in found], axis=0)
        return self._later[1]
