"""Values of block observe at points, with what they are accurate against."""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System

SMALL = 1e-9
"""Of the largest value and terms met of a row: what is less is zero."""


class Observer:
    """largest [observed]: of values and of the terms of their expressions, at the points asked for."""

    def __init__(self, system: System) -> None:
        self._number = system.observed_rows("observe")[1]
        self._calls = [system.observer(name) for name in ("observe", "observe_scale")]
        self._y, self._yd = np.zeros(system.form.extended), np.zeros(system.form.extended)
        self._out = np.zeros(max(self._number, 1))
        self.largest = np.zeros(self._number)

    def _rows(self, call: lib.Call | None, t: float) -> Floats:
        self._out[:] = 0.0
        if call is not None:
            function = lib.ROWS(call.rows)
            function(c.addressof(call.frame), t, *map(lib.pointer, (self._y, self._yd, self._out)))
        return self._out[: self._number].copy()

    def __call__(self, t: float, y: Floats, yd: Floats) -> Floats:
        """Values [observed] at y, yd [unknowns as written or more]."""
        n = min(y.size, self._y.size)
        self._y[:n], self._yd[:n] = y[:n], yd[:n]
        values = self._rows(self._calls[0], t)
        scale = self._rows(self._calls[1], t)
        size = np.maximum(np.abs(values), np.abs(scale))
        self.largest = np.fmax(self.largest, np.where(np.isfinite(size), size, 0.0))
        return values

    def know(self, largest: Floats) -> None:
        """Take sizes that others met."""
        self.largest = np.fmax(self.largest, largest)

    def zero(self, row: int) -> float:
        """Below it a value of the row is zero."""
        return SMALL * float(self.largest[row])

    def zeros(self, rows: Sequence[int]) -> Floats:
        """The same of several rows."""
        return SMALL * self.largest[np.asarray(rows, dtype=np.int64)]
