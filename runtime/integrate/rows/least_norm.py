"""The least multipliers of redundant constraints, at every point that is written (core/system/least_norm.h)."""

from __future__ import annotations

import ctypes as c
from typing import Any

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.patterns import Places, compress
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.ordering import column_order


class LeastMultipliers:
    """settled: the System in form "settled", in whose rows of dynamics the reactions stand."""

    def __init__(self, settled: System) -> None:
        self.system = settled
        pattern = settled.pattern
        columns = pattern.columns_of()
        # multipliers, and where they stand in balances
        place = np.flatnonzero(settled.are("kappa", "mu")).astype(np.int32)
        source = np.flatnonzero(settled.of_groups("dynamics")[pattern.row] & np.isin(columns, place))
        rows, coordinate = np.unique(pattern.row[source], return_inverse=True)
        # [1 A; A' -1] of multipliers and balances
        m, n = place.size, rows.size
        which, behind = np.searchsorted(place, columns[source]), m + coordinate.astype(np.int64)
        every = np.arange(m + n)
        parts = [Places(which, behind), Places(behind, which), Places(every, every)]
        self.pattern, slots = compress(m + n, m + n, parts)
        order = column_order(self.pattern)
        self._keep = [
            item if item is None else np.ascontiguousarray(item, dtype=np.int32)
            for item in (place, source, coordinate, *slots, order)
        ]
        self.linear = lib.core.sd_linear_new(
            m + n, *(lib.pointer(item) for item in (self.pattern.column, self.pattern.row, self._keep[-1]))
        )
        self.core: Any = lib.core.sd_least_norm_new(c.byref(settled.core), self.linear, m, n) if self.linear else None
        # no room in the core
        if not self.core:
            raise MemoryError
        core = self.core.contents
        core.entries = source.size
        names = ("place", "source", "coordinate", "slot", "slot_t", "slot_diagonal")
        for name, item in zip(names, self._keep, strict=False):
            setattr(core, name, lib.pointer(item))

    @property
    def address(self) -> Any:
        """Of the core's structure, void *."""
        return c.cast(c.pointer(self.core.contents), c.c_void_p)

    def apply(self, t: float, y: Floats, yd: Floats) -> Floats:
        """Y [unknowns as written] with the least multipliers."""
        a, b = self.system._buffer(y), self.system._buffer(yd)
        lib.core.sd_least_norm_apply(self.core, t, lib.pointer(a), lib.pointer(b))
        self.system.failure.check()
        return a[: self.system.unknowns]

    def __del__(self) -> None:
        if getattr(self, "core", None):
            lib.core.sd_least_norm_free(self.core)
        if getattr(self, "linear", None):
            lib.core.sd_linear_free(self.linear)
