"""What the core passes by itself where a text without events jumps or bends (core/run/events/corners.h)."""

from __future__ import annotations

import ctypes as c
from typing import TYPE_CHECKING, Any

import numpy as np
from sysdyn.runtime.integrate.jumps.crossing import JUMP
from sysdyn.runtime.integrate.jumps.segments import core_pieces
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.scales import GROUP, ROUND_OFF, SWEEPS, UNKNOWN, alike, noisy
from sysdyn.runtime.model.system import LARGE
from sysdyn.runtime.start.restart import STILL

if TYPE_CHECKING:
    from sysdyn.runtime.integrate.integrate import Integration


def serves(run: Integration) -> bool:
    """Whether the core can pass instants of this run: more than one piece, and nothing gains by impulses."""
    # one piece, events, or large: not here
    if len(run.segments) < 2 or run.pieces is not None or run.system.unknowns > LARGE:
        return False
    whole = run.forms is None or run.settlers.whole_form == "settled"
    return whole and run.driver.impulses is None


class CornerPassing:
    """The core's structure for one run."""

    def __init__(self, run: Integration) -> None:
        self._keep: list[Any] = []
        self.core = lib.Corners(still=STILL, differs=max(run.request.rtol, JUMP), unknown_size=UNKNOWN)
        core, method = self.core, run.method.contents
        core.round_off, core.part, core.sweeps = ROUND_OFF, GROUP, SWEEPS
        core.time, core.resolves = run.sizes.time, run.sizes.resolves
        core.t_end = c.addressof(method) + type(method).t_end.offset
        core.expanded = c.addressof(run.method.expanded.contents) if run.method.expanded else None
        pieces = core_pieces(run.segments)
        self._keep.append(pieces)
        core.piece, core.pieces = c.addressof(pieces), len(pieces)
        self._sizes(run)
        self._roles(run)
        self._room(run)
        run.driver.run.corners = c.addressof(core)

    @property
    def at(self) -> int:
        """Number of the present piece."""
        return int(self.core.at)

    @at.setter
    def at(self, number: int) -> None:
        self.core.at = number

    def _array(self, values: Any, dtype: Any) -> int | None:
        """The address of values as the core reads them."""
        self._keep.append(np.ascontiguousarray(values, dtype=dtype))
        return lib.pointer(self._keep[-1])

    def _sizes(self, run: Integration) -> None:
        core, sizes = self.core, run.sizes
        core.unknowns, own = run.system.unknowns, sizes.own
        core.magnitude, core.met, core.resolved = map(lib.pointer, (sizes.magnitude, sizes.met, sizes.resolution))
        # sizes of a method that steps fewer unknowns
        if own is not None:
            core.keeps, core.kept = own[0].size, self._array(own[0], np.int32)
            core.own_magnitude, core.own_met = map(lib.pointer, own[1:])

    def _roles(self, run: Integration) -> None:
        core, system = self.core, run.system
        masks = run.roles.state, run.roles.differential, run.sizes.unnamed
        core.state, core.differential, core.unnamed = (self._array(mask, np.int32) for mask in masks)
        group = alike(system)
        core.group, core.groups = self._array(group, np.int32), int(group.max(initial=-1)) + 1
        core.system = c.addressof(system.core)
        core.constraint, core.balance, core.multiplier, core.flow = (self._array(m, np.uint8) for m in noisy(system))

    def _room(self, run: Integration) -> None:
        """Room for the core: a Jacobian, noise and groups of the unknowns, observed values, points on both sides."""
        core, system = self.core, run.system
        for name in ("jy", "jyd"):
            setattr(core, name, self._array(np.zeros(system.pattern.entries + 1), np.float64))
        core.open = self._array(np.zeros(system.unknowns), np.float64)
        core.largest = self._array(np.zeros(core.groups + 1), np.float64)
        core.seen = self._array(np.zeros(run.driver.observed + 1), np.float64)
        number = max(system.unknowns, system.form.extended) + 8
        y, yd = run.y, run.yd  # what no row reads stays as it is there
        # two points, and rates
        for name, values in (("y", y), ("yd", yd), ("before", y[:0]), ("before_d", y[:0]), ("rate", y[:0])):
            room = np.zeros(number)
            room[: values.size] = values
            setattr(core, name, self._array(room, np.float64))
