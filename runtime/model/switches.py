"""Constraints that hold at times: which of them hold now, and their rows in each index form where they do not.

A constraint that does not hold keeps its rows and its multiplier, and the rows read "multiplier = 0" (held_rows.py does
the same for redundant ones, for good).  So every active set has one pattern, one order of elimination and one set of
unknowns: a switch changes a few numbers in the core's structures.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sysdyn.runtime.model.system import System


class Switches:
    """Which of the constraints at `places` (family, position of the multiplier) hold: `active` [places]; redundant:
    they depend on each other, and those that do not hold hold with the others.
    """

    def __init__(self, places: tuple[tuple[int, int], ...], *, redundant: bool = False) -> None:
        self.places, self.redundant = places, redundant
        self.active: NDArray[np.bool_] = np.ones(len(places), dtype=bool)
        self._systems: WeakSet[System] = WeakSet()

    def join(self, system: System) -> None:
        """A system that follows."""
        self._systems.add(system)

    def set(self, active: NDArray[np.bool_]) -> None:
        """These hold from now on, in every system of the model."""
        if (active == self.active).all():
            return
        self.active = active.copy()
        for system in self._systems:
            system.switch()
