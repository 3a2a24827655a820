"""What jumps at an instant: one balance of the settled rows integrated over it, asked for displacements, then flows.

A step of an effort across a capacitor moves charge at once, one of a position what hangs on it; one of a velocity asks
for other flows.  Flows, and efforts e that stay implicit, have impulses then (dq = the integral of f; E), and so have
multipliers (Lambda); finite terms do not count:

    M (f+ - f-) + dF/df dq + dF/de E + dF/dkappa Lambda = 0    of balances F, and of psi and gamma, which have no M,
    M dq = 0                                                   of those with inertia, and of momenta p - M f,

while what holds between displacements and efforts, Phi_q f+ + Phi_t = 0, Psi(f+) = 0, p = M f and gammas hold behind
it: the limit of a fast rise.  So no charge passes a resistor at once, a damper takes along what hangs on it and pushes
what has inertia, and flows change least in the metric of the inertia (Gauss's principle for impulses); those that M
leaves open follow from their balances behind it, in which the others have rates.

Displacements come first: where they go does not depend on how flows jump.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.facts import Mask
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.least_change import least_measured
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.numerics.tall import free_unknowns
from sysdyn.runtime.start.settled import inertial_rows
from sysdyn.values import dataclass

FOLLOWS = ("f", "p", "e", "kappa", "mu")
FORCES = ("e", "kappa", "mu")
LOOSE = 1e3
"""Times its magnitude, what follows may jump more easily than what nothing else decides about."""
BROKEN = 1e-10
"""Of its terms: what a row is missed by, or an impulse, that is no round-off."""
ROUND_OFF = 1e-14
"""Of its magnitude: what an unknown is moved by that stays where it is."""
ITERATIONS, BALANCED = 3, 6

Entries = tuple[NDArray[Any], NDArray[Any], Floats]
"""Row, column, value.  Row 2 k is row k behind the instant, 2 k + 1 its integral; column 2 k is unknown k, 2 k + 1 its
integral over the instant, of flows and momenta their rate behind it.
"""


@dataclass(frozen=True, slots=True)
class _Rows:
    """Rows [rows] that hold behind the instant, in unknowns that move [unknowns]; the entries of those that are linear
    in moves and integrals, from dF/dy, dF/dyd and y; ease [unknowns]: times their magnitudes, how far these may move.
    """

    behind: Mask
    moves: Mask
    integrals: Callable[[Floats, Floats, Floats], Entries]
    ease: Floats | float = 1.0
    iterations: int = ITERATIONS


class Instant:
    """settled: the System in form "settled"; magnitude [unknowns], where it is asked for: of y."""

    def __init__(self, settled: System) -> None:
        self.system, kinds = settled, settled.kinds
        pattern, form = settled.pattern, settled.another("3").form
        self._row, self._column = pattern.row.astype(np.int64), pattern.columns_of()
        self._balances = settled.of_groups("dynamics")
        self._momenta = settled.of_groups("momentum")
        self._states, self._constraints = settled.of_groups("momentum", "gamma"), settled.of_groups("phi_rate", "psi")
        self._moving, self._force = np.isin(kinds, ("f", "p", "e")), np.isin(kinds, FORCES)
        self._told, self._struck = self._reacting()
        self._moved = np.full(settled.unknowns, -1, dtype=np.int64)
        self._moved[form.k_f] = form.k_q
        inertial, (in_y, in_rate) = inertial_rows(settled), settled.structural()
        self._light, self._heavy = settled.of_groups("dynamics", "psi", "gamma") & ~inertial, self._balances & inertial
        flow = (self._moved >= 0)[self._column]
        self._held = flow & in_rate & self._heavy[self._row], flow & in_y & settled.of_groups("momentum")[self._row]
        answered = inertial.copy()
        answered[self._row[in_rate | (in_y & flow)]] = True
        self._given = settled.of_groups("phi", "dynamics", "gamma") & ~answered

    def _reacting(self) -> tuple[Mask, Mask]:
        """Gammas [rows] of implicit efforts that follow from multipliers (friction on a reaction); which forces have
        impulses where flows jump [unknowns]: those efforts, and multipliers.
        """
        kinds, gammas = self.system.kinds, self.system.of_groups("gamma")[self._row]
        reactions = np.isin(kinds, ("kappa", "mu"))
        reads = np.zeros(self.system.rows, dtype=bool)
        reads[self._row[gammas & reactions[self._column]]] = True
        follows = reactions.copy()
        follows[self._column[reads[self._row] & (kinds == "e")[self._column]]] = True
        told = np.zeros(self.system.rows, dtype=bool)
        told[self._row[gammas & (follows & ~reactions)[self._column]]] = True
        return told, follows

    def broken(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> bool:
        """Whether a constraint on flows does not hold at the point, or where there are any, a momentum's."""
        flows = self._now(self._constraints)
        if not flows.any():
            return False
        flows |= self._momenta
        jy, _ = self.system.jacobian(t, y, yd)
        size = np.zeros(self.system.rows)
        np.add.at(size, self._row, np.abs(jy) * np.maximum(magnitude, np.abs(y))[self._column])
        r = np.abs(self.system.residual(t, y, yd))
        with np.errstate(all="ignore"):
            return bool((r > BROKEN * size)[flows].any())

    def _now(self, rows: Mask) -> Mask:
        """Those of the rows that hold now."""
        found = rows.copy()
        found[self.system.held[0]] = False
        return found

    def _acting(self) -> Mask:
        """Entries of forces; what does not hold has no multiplier, and no impulse of one."""
        acts = self._force.copy()
        acts[self.system.held[1]] = False
        return acts[self._column]

    def displacements(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> tuple[Floats, Floats]:
        """Y with the displacements behind the jump at t; the impulses of effort on balances with inertia [rows].

        Where nothing resists an impulse of flow the rows of displacements alone say where they are.
        """
        slope, inertia = self._slopes(t, y, yd, magnitude)
        heavy, carried = self._held
        light, flow = self._now(self._light)[self._row], (self._moved >= 0)[self._column]
        through = np.flatnonzero(((light & flow) | heavy | carried) & (np.where(heavy, inertia, slope) != 0.0))
        forced = np.flatnonzero(light & self._acting())
        at = np.append(through, forced)
        columns = np.append(2 * self._moved[self._column[through]], 2 * self._column[forced] + 1)
        integrals = 2 * self._row[at] + 1, columns, np.where(heavy, inertia, slope)[at]
        ease = np.where(np.isin(self.system.kinds, FOLLOWS), LOOSE, 1.0)
        behind = self._given.copy()
        behind[self.system.held[0]] = True  # they read "multiplier = 0"
        # dynamic variables have finite rates: what they hold, contents of stores in series among it, stays
        rows = _Rows(behind, self.system.kinds != "s", lambda *_: integrals, ease)
        found, impulse = self._jump((t, y, yd), magnitude, rows)
        found = np.where(self.system.kinds == "q", found, y)
        return found, self._pushed(slope, found - y, impulse, inertia * magnitude[self._column])

    def _slopes(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> tuple[Floats, Floats]:
        """dF/dy [entries] at flows as large as those of an impulse (at those of y where that is no number), dF/dyd."""
        slope, inertia = self.system.jacobian(t, np.where(self._moved >= 0, y + magnitude, y), yd)
        at_rest = self.system.jacobian(t, y, yd)[0]
        return np.where(np.isfinite(slope), slope, np.where(np.isfinite(at_rest), at_rest, 0.0)), inertia

    def _pushed(self, slope: Floats, moved: Floats, impulse: Floats, inertia: Floats) -> Floats:
        """What displacements that moved, and impulses of forces [unknowns], do to balances with inertia [rows]; what is
        nothing beside its terms and the impulses of flows as large as their magnitudes (inertia [entries]) is none.
        """
        by = np.where(self._moved >= 0, moved[self._moved], impulse)[self._column]
        terms = np.where(self._heavy[self._row], slope * by, 0.0)
        found, size = (np.bincount(self._row, v, self.system.rows) for v in (terms, np.abs(terms) + np.abs(inertia)))
        return np.where(np.abs(found) > BROKEN * size, found, 0.0)

    def flows(
        self, t: float, y: Floats, yd: Floats, magnitude: Floats, aims: Floats | None = None, push: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Y with flows, momenta and implicit efforts behind the impulses at t, as they are where nothing asks for
        others; the impulses [unknowns].

        aims [rows]: what the constraints on flows shall be (NotFiniteError where that comes to no numbers); push
        [rows]: what acts on balances besides; None: zero.
        """
        push, open_ = np.zeros(self.system.rows) if push is None else push, self._leaves_open(t, y, yd, magnitude)
        if aims is None and not (push.any() or open_ or self.broken(t, y, yd, magnitude)):
            return y, np.zeros(y.size)
        moving, acts = self._moving[self._column], self._acting() & self._struck[self._column]
        at = np.flatnonzero((self._balances[self._row] & (moving | acts)) | (self._told[self._row] & acts))
        rows, columns = 2 * self._row[at] + 1, 2 * self._column[at] + acts[at]
        behind, moves, ease = self._now(self._constraints) | self._states, self._moving, 1.0
        rated = at[:0]
        if open_:  # finite terms decide, rates of the others among them
            rated, ease = at[moving[at]], 1.0 / LOOSE
            behind, moves = behind | self._balances, moves | self._force
            rows, columns = np.append(rows, 2 * self._row[rated]), np.append(columns, 2 * self._column[rated] + 1)

        reacts = self._struck & (self.system.kinds != "e")
        told = self._told[self._row] if self._told.any() else None

        def integrals(jy: Floats, jyd: Floats, here: Floats) -> Entries:
            if told is not None:  # friction on a reaction that is nothing yet
                jy = np.where(told, self.system.jacobian(t, np.where(reacts, here + magnitude, here), yd)[0], jy)
            return rows, columns, np.append(np.where(acts, jy, jyd)[at], jyd[rated])

        aim = np.stack([np.zeros(self.system.rows) if aims is None else aims, -push], axis=1)
        meant = _Rows(behind, moves, integrals, ease, BALANCED if rated.size else ITERATIONS)
        begun = self._sloping(t, y, yd, magnitude)
        return self._jump((t, y, yd), magnitude, meant, begun, aim, asked=aims is not None)

    def _leaves_open(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> bool:
        """Whether inertia leaves flows open that it has: nodes that stores only tie together."""
        inertia = self.system.jacobian(t, y, yd)[1]
        inert = self._balances[self._row] & (self.system.kinds == "f")[self._column] & (inertia != 0.0)
        row, column = self._row[inert], self._column[inert]
        free = free_unknowns((self.system.rows, y.size), (row, column, inertia[inert] * magnitude[column]))
        return free is not None and bool(free[column].any())

    def _sloping(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> Floats:
        """Y with implicit efforts at their magnitudes where their laws are flat (a flat one decides about the flows),
        but for those that multipliers tell.
        """
        steepest = np.zeros(y.size)
        jy, _ = self.system.jacobian(t, y, yd)
        mine = self._states[self._row]
        np.maximum.at(steepest, self._column[mine], np.abs(jy[mine]))
        return np.where((self.system.kinds == "e") & ~self._struck & (steepest == 0.0), y + magnitude, y)

    def _jump(
        self,
        before: tuple[float, Floats, Floats],
        magnitude: Floats,
        meant: _Rows,
        begun: Floats | None = None,
        aims: Floats | float = 0.0,
        *,
        asked: bool = False,
    ) -> tuple[Floats, Floats]:
        """The least change of y that meets the rows, from where it has begun, without its round-off; impulses of forces
        [unknowns].  Where that comes to no numbers y is as it was, and there are none.

        before: t, y, yd; aims [rows, 2]: what the rows behind the instant shall be, and the integrals.  asked: numbers
        there must be, else NotFiniteError.
        """
        t, start, yd = before
        y, integral = (start if begun is None else begun), np.zeros(start.size)
        here = meant.behind[self._row] & meant.moves[self._column]
        scale = np.stack([magnitude * meant.ease, np.full(start.size, np.nan)], axis=1).ravel()
        for _ in range(meant.iterations):
            jy, jyd = (np.where(np.isfinite(item), item, 0.0) for item in self.system.jacobian(t, y, yd))
            i, j, v = meant.integrals(jy, jyd, y)
            aim = np.zeros((self.system.rows, 2)) + aims
            aim[meant.behind, 0] -= self.system.residual(t, y, yd)[meant.behind]
            change, aim = np.stack([y - start, integral], axis=1).ravel(), aim.ravel()
            np.add.at(aim, i, -v * change[j])
            i, j = np.append(2 * self._row[here], i), np.append(2 * self._column[here], j)
            try:
                step = least_measured((i, j, np.append(jy[here], v)), aim, scale)
            except NotFiniteError:
                if asked:
                    raise
                return start, np.zeros(start.size)
            y, integral = y + step[::2], integral + step[1::2]
        return np.where(np.abs(y - start) > ROUND_OFF * magnitude, y, start), np.where(self._force, integral, 0.0)
