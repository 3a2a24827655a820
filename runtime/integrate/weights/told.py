"""What a method is told of each unknown that it steps: tolerance, magnitude, role in its error test."""

from __future__ import annotations

from typing import Any

import numpy as np
from sysdyn.runtime import _core
from sysdyn.runtime.integrate.methods import Method
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.integrate.weights.sizes import Sizes
from sysdyn.runtime.integrate.weights.unknown_roles import Roles
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.scales import ROUND_OFF
from sysdyn.runtime.model.system import System

UNPULLED: int = _core.SD_UNPULLED
"""Kind of a derivative (core/steppers/radau/radau.h): interpolated whatever pulls at its unknown."""


class Told:
    """roles: of what is stepped; kept: the places of these unknowns, None: all."""

    def __init__(self, system: System, request: Request, sizes: Sizes, roles: Roles, kept: Ints | None) -> None:
        self._sizes = sizes
        # below what round-off leaves of a magnitude nothing is asked: --atol 0 meets zeros
        atol = None if request.atol is None else np.maximum(request.atol, ROUND_OFF * sizes.magnitude)
        self.atol = atol if atol is None or kept is None else atol[kept]
        self.magnitude, self.met = sizes.sizes_of_method(kept)
        self.test, self.power, self.smooth = roles.test, roles.power, roles.smooth.astype(np.int8)
        if kept is not None:  # as where their rates are unknowns too: rows q' = f pull at nothing
            self.smooth[roles.smooth & system.are("q")[kept]] = UNPULLED
        self.idle = roles.idle.astype(np.int32) if system.form.scales else None
        # groups of flows that move together are tested by their differences
        grouped = roles.common >= 0
        apart = request.method == "bdf" or (request.method == "radau" and bool((roles.test[grouped] > 0).all()))
        self.groups = roles.groups() if apart and grouped.any() else None

    def tell(self, method: Method) -> None:
        """The core's structure has the addresses; the arrays live as long as this."""
        core = method.contents
        core.atol, core.magnitude, core.met = map(lib.pointer, (self.atol, self.magnitude, self.met))
        core.test, core.power = lib.pointer(self.test), lib.pointer(self.power)
        # groups one behind the other
        if self.groups is not None:
            core.common_from, core.common = map(lib.pointer, self.groups)
            core.commons = self.groups[0].size - 1
        if method.name == "radau":
            core.smooth = lib.pointer(self.smooth)

    def tell_steep(self, method: Method, linear: Any) -> None:
        """Of steep laws: what they may leave open; rows within a step are judged by the magnitudes of all unknowns."""
        linear.contents.idle = lib.pointer(self.idle)
        # rows judged at the full point
        if method.expanded:
            expanded = method.expanded.contents
            expanded.met, expanded.magnitude = lib.pointer(self._sizes.met), lib.pointer(self._sizes.magnitude)
