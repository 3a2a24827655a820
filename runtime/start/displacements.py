"""Displacements after a jump of the text: balances integrated over the instant.

A step of an effort across a capacitor moves charge at once, a step of a position what hangs on it.  What moves without
inertia moves by an impulse of flow, dq = the integral of f, in which finite terms do not count; so do efforts e that
stay implicit and multipliers (impulses E, Lambda):

    dF/df dq + dF/de E + dF/dkappa Lambda = 0    of balances F without inertia, of psi and gamma alike,
    M dq = 0                                     of those with inertia, and of momenta p - M f,

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
        flow, momentum = self._flows[self._column], settled.of_groups("momentum")[self._row]
        self._heavy = in_rate & flow & (settled.of_groups("dynamics") & inertial)[self._row]
        self._carried = in_y & flow & momentum
        instant = self._summed.copy()
        instant[self._row[self._heavy | self._carried]] = True
        self._place = settled.rows + np.cumsum(instant) - 1
        self.rows = settled.rows + int(instant.sum())
        answered = inertial.copy()
        answered[self._row[in_rate | (in_y & self._flows[self._column])]] = True
        self._given = settled.of_groups("phi", "dynamics", "gamma") & ~answered

    def after(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> Floats:
        """Y with the displacements behind the jump at t; as it is where nothing resists an impulse of flow.

        magnitude [unknowns]: of y.  Raises NotFiniteError.
        """
        resisting, forced, slope = self._instant(t, y, yd, magnitude)
        if not resisting.any():
            return y
        through, force = self._moved[self._column[resisting]], self._impulse[self._column[forced]]
        rows = self._place[np.append(self._row[resisting], self._row[forced])]
        columns, slopes = np.append(through, force), np.append(slope[resisting], slope[forced])
        scale = np.append(magnitude * np.where(self._follows, LOOSE, 1.0), np.ones(self.number - y.size))
        most = np.zeros(self.number)
        np.maximum.at(most, force, np.abs(slope[forced]))
        scale[most > 0.0] = 1.0 / most[most > 0.0]
        now, given = y.copy(), self._given.copy()
        open_, without = self.system.held  # what does not hold has no multiplier, and no impulse of one
        given[open_], scale[self._impulse[without]] = True, 0.0
        here = given[self._row]
        for _ in range(_ITERATIONS):
            aim = np.zeros(self.rows)
            aim[: given.size] = np.where(given, -self.system.residual(t, now, yd), 0.0)
            np.add.at(aim, rows[: through.size], -slope[resisting] * (now - y)[through])
            i, j = np.append(self._row[here], rows), np.append(self._column[here], columns)
            v = np.append(self.system.jacobian(t, now, yd)[0][here], slopes)
            step = scale * least_norm((self.rows, self.number), (i, j, v * scale[j]), aim)
            now = now + step[: y.size]
        return np.where(self._places, now, y)

    def _instant(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> tuple[Mask, Mask, Floats]:
        """Entries of the balances of the instant that resist a flow, and those of forces; slopes [entries] at flows as
        large as those of an impulse.
        """
        slope, inertia = self.system.jacobian(t, np.where(self._flows, y + magnitude, y), yd)
        at_rest = self.system.jacobian(t, y, yd)[0]
        slope = np.where(np.isfinite(slope), slope, np.where(np.isfinite(at_rest), at_rest, 0.0))
        slope = np.where(self._heavy, inertia, slope)
        summed = self._summed.copy()
        summed[self.system.held[0]] = False
        here = summed[self._row]
        resisting = (here & self._flows[self._column]) | self._heavy | self._carried
        forced = here & (self._impulse[self._column] >= 0)
        return resisting & (slope != 0.0), forced & (slope != 0.0), slope
