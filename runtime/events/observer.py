"""Values of block observe at points, with what they are accurate against."""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core, tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System

SMALL = tuning.SAME
"""Of the largest value and terms met of a row: what is less is zero."""
ROUNDING: float = _core.ROUNDING
"""Of the terms of a value: what a sum of a few is rounded by.  Unknowns that are solved for are known to SMALL only."""
ASSIGNED, TIMED = range(1, 3)
LEAST = 1e-24
"""In SI units: a value that has never been more has no size yet; round-off of what is held at zero is less still."""


class Observer:
    """largest [observed]: of values and of the terms of their expressions, at the points asked for; small [observed]:
    of it, what counts as zero, but of what is `exact` [observed]: TIMED, what time alone moves; ASSIGNED, what an
    assignment has put so close to zero that it would be, until it has crossed or gone away.
    """

    def __init__(self, system: System) -> None:
        self._number = system.observed_rows("observe")[1]
        self._calls = [system.observer(name) for name in ("observe", "observe_scale")]
        self._y, self._yd = np.zeros(system.form.extended), np.zeros(system.form.extended)
        self._out = np.zeros(max(self._number, 1))
        self._pointers = [lib.pointer(item) for item in (self._y, self._yd, self._out)]
        self._functions: dict[int, Any] = {}
        self.largest, self.terms = np.full(self._number, LEAST), np.zeros(self._number)
        self.small, self.exact = np.full(self._number, SMALL), np.zeros(self._number + 1, dtype=np.int32)
        families = [system.description.rows[k] for k in system.description.rows_of("observe")]
        self._units = [family.unit for family in families for _ in range(family.size)]
        self.groups: list[NDArray[np.int64]] = []

    def _rows(self, call: lib.Call | None, t: float) -> Floats:
        self._out[:] = 0.0
        if call is not None:
            # a function pointer for each compiled block
            if call.rows not in self._functions:
                self._functions[call.rows] = lib.ROWS(call.rows)
            self._functions[call.rows](c.addressof(call.frame), t, *self._pointers)
        return self._out[: self._number].copy()

    def __call__(self, t: float, y: Floats, yd: Floats) -> Floats:
        """Values [observed] at y, yd [unknowns as written or more]; `terms` [observed]: magnitudes of theirs."""
        n = min(y.size, self._y.size)
        self._y[:n], self._yd[:n] = y[:n], yd[:n]
        values = self._rows(self._calls[0], t)
        scale = self.terms = self._rows(self._calls[1], t)
        size = np.maximum(np.abs(values), np.abs(scale))
        # the largest so far, in groups of one kind
        np.fmax(self.largest, np.where(np.isfinite(size), size, 0.0), out=self.largest)
        for rows in self.groups:
            self.largest[rows] = self.largest[rows].max()
        return values

    def know(self, largest: Floats) -> None:
        """Take sizes that others met."""
        np.fmax(self.largest, largest, out=self.largest)

    def alike(self, rows: Sequence[int]) -> None:
        """Rows of one size: what one has never met, another has (a diode that has not conducted yet)."""
        if len(rows) > 1:
            self.groups.append(np.asarray(rows, dtype=np.int64))

    def unit(self, row: int) -> str:
        """The unit of a row."""
        return self._units[row]

    def zeros(self, rows: NDArray[np.int64]) -> Floats:
        """Below them values of the rows are zero."""
        found: Floats = np.where(self.exact[rows] > 0, ROUNDING, self.small[rows]) * self.largest[rows]
        return found

    def zero(self, row: int) -> float:
        """Below it a value of the row is zero."""
        return float(ROUNDING if self.exact[row] else self.small[row]) * float(self.largest[row])

    def rounding(self, rows: NDArray[np.int64], here: Floats) -> Floats:
        """What the values of rows that were asked last are rounded by; here [rows]: these."""
        found: Floats = ROUNDING * np.maximum(self.terms[rows], np.abs(here))
        return found
