"""What a source at its peak leaves of a rate: round-off, which is no size.

The rate of 325 V sin(w t + pi/2) is 6e-12 V/s at t = 0, and balanced by rates as small it would be the size of what
other rows need 1e3 A/s of: no step would find these, and a search that may not move them moves the state.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats

HIDDEN = ("dynamics_rate", "momentum_rate", "phi_rate", "phi_acceleration", "psi_rate", "gamma_rate")
"""Groups of rows that are derivatives of others."""
RESIDUE = 1e-9
"""Of what a row's free term is at other times: round-off of a zero."""
LATER = (0.6180339887, 6.180339887e6)
"""s: such times, in no simple ratio to a period; for what turns in years too."""


class Rows(Protocol):
    """Equations of a start."""

    guess: Floats

    def residual(self, t: float, x: Floats) -> Floats:
        """All rows [rows]."""

    def groups(self, *names: str) -> NDArray[np.bool_]:
        """Rows of the named groups."""


class Residue:
    """Of one search: free terms at other times are asked for once, where there is something to tell."""

    def __init__(self, rows: Rows) -> None:
        self._rows = rows
        self._later: tuple[float, Floats] | None = None

    def cleared(self, t: float, free: Floats) -> Floats:
        """Free terms [rows] at t, without what is left of a zero in rows of rates."""
        size = np.abs(free)
        tiny = (size > 0.0) & (size < RESIDUE * np.max(size, where=np.isfinite(size), initial=0.0))
        tiny &= self._rows.groups(*HIDDEN)
        if not tiny.any():
            return free
        return np.where(tiny & (size < RESIDUE * self._at_other_times(t)), 0.0, free)

    def _at_other_times(self, t: float) -> Floats:
        """The largest of each free term beside the guess [rows]."""
        if self._later is None or self._later[0] != t:
            found = [np.abs(self._rows.residual(t + beyond, self._rows.guess)) for beyond in LATER]
            self._later = t, np.max([np.where(np.isfinite(size), size, 0.0) for size in found], axis=0)
        return self._later[1]
