"""Flows and momenta after a jump of the constraints: the least change in the metric of the inertia.

A constraint that steps in time (a velocity source switched on) asks for flows that differ from those before.  The
impulses Lambda of the constraints bring them about:

    M (f+ - f-) + Phi_q^T Lambda_phi + Psi_f^T Lambda_psi = 0,    Phi_q f+ + Phi_t = 0,    Psi(f+) = 0

with the displacements held (Gauss's principle for impulses).  The rows are those of the settled system, so that the
same lines serve p = M f, stores given as f(p) and flows without inertia, which take no impulse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import Mask, System
from sysdyn.runtime.numerics.least_change import least_norm
from sysdyn.runtime.numerics.rank import count, decomposed, least_squares

BROKEN = 1e-10
"""Scaled residual of a constraint row above which its constraint has jumped."""
LARGE = 1500
"""Rows or unknowns up to which inertia is asked for what it leaves open."""
_ITERATIONS, _BALANCED = 3, 6


class Impulses:
    """settled: the System in form "settled"; magnitude [unknowns] of y; rate [unknowns] of yd."""

    def __init__(self, settled: System) -> None:
        self.system = settled
        self._flow_rows = settled.of_groups("phi_rate", "psi")
        self._state_rows = settled.of_groups("momentum", "gamma")
        self._balance = settled.of_groups("dynamics")
        kinds = settled.kinds
        self._moving = np.isin(kinds, ("f", "p", "e"))
        self._impulse = np.isin(kinds, ("kappa", "mu"))
        self._columns = settled.pattern.columns_of()
        self._rows = settled.pattern.row.astype(np.int64)

    def broken(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> bool:
        """Whether a constraint on flows does not hold at the point."""
        if not self._flows().any():
            return False
        jy, _ = self.system.jacobian(t, y, yd)
        size = np.zeros(self.system.rows)
        np.add.at(size, self._rows, np.abs(jy) * np.maximum(magnitude, np.abs(y))[self._columns])
        r = np.abs(self.system.residual(t, y, yd))
        with np.errstate(all="ignore"):
            return bool((r > BROKEN * size)[self._flows()].any())

    def _flows(self) -> Mask:
        """Rows of constraints on flows that hold now."""
        found = self._flow_rows.copy()
        found[self.system.held[0]] = False
        return found

    def after(
        self, t: float, y: Floats, yd: Floats, magnitude: Floats, aims: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Y with flows, momenta and implicit efforts after the impulses at t; the impulses [unknowns].

        aims [rows]: what the constraints on flows shall be; None: zero.
        """
        y, start = self._sloping(t, y, yd, magnitude), y.copy()
        impulse = np.zeros(y.size)
        use = self._flows() | self._state_rows | self._balance
        acts = self._impulse.copy()
        acts[self.system.held[1]] = False
        number = np.cumsum(use) - 1
        balance, moving = self._balance[self._rows], self._moving[self._columns]
        for _ in range(_ITERATIONS):
            jy, jyd = self.system.jacobian(t, y, yd)
            value = np.where(moving, np.where(balance, jyd, jy), np.where(balance & acts[self._columns], jy, 0.0))
            value = np.where(use[self._rows] & np.isfinite(value), value, 0.0)
            r = self.system.residual(t, y, yd)
            if aims is not None:
                r -= aims
            moved = np.where(self._impulse, impulse, y - start)
            r[self._balance] = 0.0
            np.add.at(r, self._rows[balance], (value * moved[self._columns])[balance])
            step = self._solve(value, -r[use], number, magnitude)
            y[self._moving] += step[self._moving]
            impulse[self._impulse] += step[self._impulse]
        return y, impulse

    def balanced(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> Floats:
        """Y with the flows that inertia leaves open (directions n with M n = 0: nodes that stores only tie together)
        where their balances n^T F hold, M f being what it is.  Raises NotFiniteError.
        """
        jyd = self.system.jacobian(t, y, yd)[1]
        heavy = self._balance[self._rows] & (self.system.kinds == "f")[self._columns] & (jyd != 0.0)
        rows, flows = np.unique(self._rows[heavy]), np.unique(self._columns[heavy])
        if not rows.size or max(self.system.rows, y.size) > LARGE:
            return y
        inertia = self.system.dense(jyd)[np.ix_(rows, flows)] * magnitude[flows]
        size = np.abs(inertia).max(axis=1)
        left, sigma, right = decomposed(inertia / size[:, None])
        known = count(sigma)
        if known == flows.size:
            return y
        ways = np.zeros((y.size, flows.size - known))
        ways[flows] = magnitude[flows, None] * right[known:].T
        follows = np.isin(self.system.kinds, ("f", "e", "kappa", "mu"))
        follows[flows] = False
        ways = np.hstack([ways, np.diag(magnitude)[:, follows]])
        others = (self._flows() | self._state_rows | self._balance) & ~np.isin(np.arange(self.system.rows), rows)
        sums = np.vstack([np.zeros((rows.size - known, self.system.rows)), np.eye(self.system.rows)[others]])
        sums[: rows.size - known, rows] = (left[:, known:] / size[:, None]).T
        for _ in range(_BALANCED):
            slopes = sums @ self.system.dense(self.system.jacobian(t, y, yd)[0]) @ ways
            most = np.abs(slopes).max(axis=1, initial=0.0)
            most = np.where(most > 0.0, most, 1.0)
            aim = sums @ self.system.residual(t, y, yd) / most
            y = y - ways @ least_squares(slopes / most[:, None], aim)
        return y

    def _sloping(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> Floats:
        """Y with implicit efforts at their magnitudes where their laws are flat: a flat one decides about the flows."""
        steepest = np.zeros(y.size)
        jy, _ = self.system.jacobian(t, y, yd)
        mine = self._state_rows[self._rows]
        np.maximum.at(steepest, self._columns[mine], np.abs(jy[mine]))
        return np.where((self.system.kinds == "e") & (steepest == 0.0), y + magnitude, y)

    def _solve(self, value: Floats, aim: Floats, number: NDArray[np.int64], magnitude: Floats) -> Floats:
        """Least change [unknowns] of those that take part, in magnitudes; impulses in what they act on."""
        take = value != 0.0
        columns, place = np.unique(self._columns[take], return_inverse=True)
        step = np.zeros(self.system.unknowns)
        if not columns.size:
            return step
        most = np.zeros(columns.size)
        np.maximum.at(most, place, np.abs(value[take]))
        scale = np.where(self._impulse[columns], 1.0 / most, magnitude[columns])
        entries = number[self._rows[take]], place, value[take] * scale[place]
        step[columns] = scale * least_norm((aim.size, columns.size), entries, aim)
        return step
