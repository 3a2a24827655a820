"""Displacements after a jump of the text: balances integrated over the instant.

A step of an effort across a capacitor moves charge at once, a step of a position what hangs on it.  What moves without
inertia moves by an impulse of flow, dq = the integral of f, in which finite terms do not count; so do efforts e that
stay implicit and multipliers (impulses E, Lambda):

    dF/df dq + dF/de E + dF/dkappa Lambda = 0    of balances F without inertia, of psi and gamma alike

while what holds between displacements and efforts holds behind it: the limit of a fast rise.  So no charge passes a
resistor at once, and a damper takes along what hangs on it.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import Mask, System
from sysdyn.runtime.numerics.least_change import least_norm
from sysdyn.runtime.start.settled import inertial_rows

FOLLOWS = ("f", "p", "e", "kappa", "mu")
FORCES = ("e", "kappa", "mu")
LOOSE = 1e3
"""Times its magnitude, what follows may jump more easily than a displacement that nothing else decides about."""
_ITERATIONS = 3


class Displacements:
    """settled: the System in form "settled".

    Unknowns of the jump: y, impulses of FORCES.  Rows: the settled ones without flows and rates, by which those are
    found; the balances of the instant.
    """

    def __init__(self, settled: System) -> None:
        self.system, n = settled, settled.unknowns
        pattern, form = settled.pattern, settled.another("3").form
        self._row, self._column = pattern.row.astype(np.int64), pattern.columns_of()
        kinds = settled.kinds
        self._follows, self._places = np.isin(kinds, FOLLOWS), kinds == "q"
        forces = np.isin(kinds, FORCES)
        self._impulse = np.where(forces, n + np.cumsum(forces) - 1, -1)
        self.number = n + int(forces.sum())
        self._moved = np.full(n, -1, dtype=np.int64)
        self._moved[form.k_f] = form.k_q
        self._flows = self._moved >= 0
        inertial, (in_y, in_rate) = inertial_rows(settled), settled.structural()
        self._summed = settled.of_groups("dynamics", "psi", "gamma") & ~inertial
        answered = inertial.copy()
        answered[self._row[in_rate | (in_y & self._flows[self._column])]] = True
        self._given = settled.of_groups("phi", "dynamics", "gamma") & ~answered

    def after(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> Floats:
        """Y with the displacements behind the jump at t; as it is where nothing resists an impulse of flow.

        magnitude [unknowns]: of y.  Raises NotFiniteError.
        """
        fast = np.where(self._flows, y + magnitude, y)
        resisting, forced, slope = self._instant(t, y, yd, fast)
        if not resisting.any():
            return y
        place = self.system.rows + np.cumsum(self._summed) - 1
        through, force = self._moved[self._column[resisting]], self._impulse[self._column[forced]]
        rows = np.concatenate([place[self._row[resisting]], place[self._row[forced]]])
        columns = np.concatenate([through, force])
        slopes = np.concatenate([slope[resisting], slope[forced]])
        scale = np.append(magnitude * np.where(self._follows, LOOSE, 1.0), np.ones(self.number - y.size))
        most = np.zeros(self.number)
        np.maximum.at(most, force, np.abs(slope[forced]))
        scale[most > 0.0] = 1.0 / most[most > 0.0]
        now = y.copy()
        aim = np.zeros(self.system.rows + int(self._summed.sum()))
        for _ in range(_ITERATIONS):
            here = self._given[self._row]
            i, j = np.append(self._row[here], rows), np.append(self._column[here], columns)
            v = np.append(self.system.jacobian(t, now, yd)[0][here], slopes)
            aim[:] = 0.0
            aim[: self.system.rows] = np.where(self._given, -self.system.residual(t, now, yd), 0.0)
            np.add.at(aim, rows[: through.size], -slope[resisting] * (now - y)[through])
            step = scale * least_norm((aim.size, self.number), (i, j, v * scale[j]), aim)
            now = now + step[: y.size]
        return np.where(self._places, now, y)

    def _instant(self, t: float, y: Floats, yd: Floats, fast: Floats) -> tuple[Mask, Mask, Floats]:
        """Entries of the balances of the instant that resist a flow, and those of forces; slopes [entries] at `fast`,
        whose flows are large as those of an impulse are.
        """
        slope = self.system.jacobian(t, fast, yd)[0]
        at_rest = self.system.jacobian(t, y, yd)[0]
        slope = np.where(np.isfinite(slope), slope, np.where(np.isfinite(at_rest), at_rest, 0.0))
        summed = self._summed.copy()
        summed[self.system.held[0]] = False
        here = summed[self._row] & (slope != 0.0)
        return here & self._flows[self._column], here & (self._impulse[self._column] >= 0), slope
