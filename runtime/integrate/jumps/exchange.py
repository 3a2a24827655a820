"""Dependent constraints: which of them are left out changes as the motion turns what depends on what.

Now and then behind a step the coefficients of what depends are looked at (structure/left_out.py); where one that holds
counts much more than those left out, the method begins anew with others left out.  The motion and the reactions are the
same on both sides, and so are the multipliers that rows show, which are the least (rows/least_norm.py): nothing is seen
of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.integrate.jumps.crossing import go_on
from sysdyn.runtime.structure.left_out import TURNED, chosen, null_space, weight

if TYPE_CHECKING:
    from sysdyn.runtime.integrate.integrate import Integration

MOST = 8
"""Steps without a look."""


class Exchange:
    """Of one integration whose system can leave out others (`Switches.redundant`)."""

    def __init__(self, run: Integration) -> None:
        self.run, self._system = run, run.system.another("3")
        places = self._system.description.switches.places
        at = [int(self._system.form.at[family]) + position for family, position in places]
        self._members = np.searchsorted(np.flatnonzero(self._system.are("kappa", "mu")), at)
        self._weight, self._steps, self._looked = 1.0, 1, 0

    def steps_left(self, steps: int) -> int:
        """Steps to the next look, which no clock decides."""
        return max(self._looked + self._steps - steps, 1)

    def due(self, *, failed: bool) -> bool:
        """Whether others should be left out behind the last step; then they are, and the method begins anew.  failed:
        the next one did, so that it is looked at at once.
        """
        run, switches = self.run, self.run.system.description.switches
        n, method, before = run.system.form.written, run.method.contents, switches.active
        # looked at after so many steps
        if not failed and method.steps < self._looked + self._steps:
            return False
        y, yd = (values[:n] for values in run.method.point())
        left = np.flatnonzero(~before)
        # whether another choice would be better by now
        null = null_space(self._system, method.t, y, yd, left.size)
        passed, self._looked = max(method.steps - self._looked, 1), method.steps
        if null is None or not self._turn_left_out(weight(null[self._members], left), passed):
            return False
        with run.settler.exactly():
            # another choice of dependent constraints
            y, yd, _ = run.settler.settle(method.t, y, yd)
            active = np.ones_like(before)
            active[chosen(null[self._members])] = False
            self._leave_out(active)
            self._weight, self._steps = 1.0, 1
            found = run.settlers.across(method.t, y, yd)
        # no point with these: back
        if found is None:
            self._leave_out(before)
            return False
        # on from there with a new method state
        run.sizes.share(y)
        run.driver.leave(y, yd)
        core = run.driver.run
        every, core.every_step = core.every_step, 0  # the step's end has its row
        go_on(run, method.t, method.t, [*found])
        core.every_step = every
        return True

    def _turn_left_out(self, weight: float, passed: int) -> bool:
        """Whether those left out weigh too little, passed steps behind the last look; else half of the steps are let
        pass in which that may come.
        """
        grown = max(weight - self._weight, 0.0) / passed
        self._weight = weight
        self._steps = int(np.clip((TURNED - weight) / (2.0 * grown + 1e-300), 1.0, MOST))
        return not weight <= TURNED

    def _leave_out(self, active: NDArray[np.bool_]) -> None:
        self.run.system.description.switches.set(active)
        # explicit methods have copies of the rows
        if self.run.underlying is not None:
            self.run.underlying.switch()
