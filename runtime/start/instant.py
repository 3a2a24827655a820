"""What jumps at an instant: one balance of the settled rows integrated over it, asked for displacements, then flows.

A step of an effort across a capacitor moves charge at once, one of a position what hangs on it; one of a velocity asks
for other flows.  Flows, and efforts e that stay implicit, have impulses then (dq = the integral of f; E), and so have
multipliers (Lambda); finite terms do not count:

    M (f+ - f-) + dF/df dq + dF/de E + dF/dkappa Lambda = 0    of balances F, and of psi and gamma, which have no M,
    M dq = 0                                                   of those with inertia, and of momenta p - M f,
    s+ - s- = dg/df dq + dg/de E + dg/dkappa Lambda            of rates s' = g that constants make,

M its mean along the way, while what holds between displacements and efforts, Phi_q f+ + Phi_t = 0, Psi(f+) = 0,
p = M f and gammas hold behind it: the limit of a fast rise.  So no charge passes a resistor at once, a damper takes
along what hangs on it and pushes what has inertia, and flows change least in the metric of the inertia (Gauss's
principle for impulses); those that M leaves open follow from their balances behind it, in which the others have rates.

Displacements come first: where they go does not depend on how flows jump.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.facts import Mask
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.least_change import least_measured
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.numerics.tall import free_unknowns
from sysdyn.runtime.start.hidden import Hidden, hidden
from sysdyn.runtime.start.integrated import BROKEN, integrated, missed
from sysdyn.runtime.start.settled import inertial_rows
from sysdyn.values import dataclass

FOLLOWS = ("f", "p", "e", "kappa", "mu")
LOOSE = 1.0 / tuning.SMALL
"""Times its magnitude, what follows may jump more easily than what nothing else decides about."""
ROUND_OFF = tuning.BY_SUMS
"""Of its magnitude: what an unknown is moved by that stays where it is."""
ITERATIONS = 30
CONVERGED = tuning.MET
"""Of their magnitudes: a step of Newton's method behind which the next is round-off."""
POINTS = 24
"""Of Gauss's rule, by which powers up to the 47th have their mean."""

Entries = tuple[NDArray[Any], NDArray[Any], Floats, Floats]
"""Row, column, value, its mean over the way so far.  Row 2 k is row k behind the instant, 2 k + 1 its integral; column
2 k is unknown k, 2 k + 1 its integral over the instant, of flows and momenta their rate behind it.
"""


@functools.cache
def _gauss() -> tuple[Floats, Floats]:
    """Points in -1..1 and weights of the rule: found where something first jumps."""
    return np.polynomial.legendre.leggauss(POINTS)


class UnbalancedError(Exception):
    """row: one whose integral over an instant nothing meets."""

    def __init__(self, row: int) -> None:
        super().__init__(row)
        self.row = row


@dataclass(frozen=True, slots=True)
class Asked:
    """What a jump is asked for.  behind [rows]: what holds behind the instant, in what moves [unknowns]; met [rows]:
    whose integrals must be met; integrals: entries linear in moves and integrals, from dF/dy, dF/dyd and y; ease
    [unknowns]: times their magnitudes, how far these may move; sums: of rows that hold behind the instant too.
    """

    behind: Mask
    moves: Mask
    met: Mask
    integrals: Callable[[Floats, Floats, Floats], Entries]
    ease: Floats | float
    sums: Hidden | None = None


class Instant:
    """settled: the System in form "settled"; magnitude [unknowns], where it is asked for: of y."""

    def __init__(self, settled: System) -> None:
        self.system, kinds = settled, settled.kinds
        over = self._over = integrated(settled)
        # which rows balance, which hold, which react
        self._row, self._column, self._moved = over.row, over.column, over.moved
        self._balances = settled.of_groups("dynamics")
        self._loose = self._without_displacement()
        self._integrated = over.force | self._loose
        self._pulses = over.pulses(over.moved, self._integrated)
        self._momenta = settled.of_groups("momentum")
        self._states, self._constraints = settled.of_groups("momentum", "gamma"), settled.of_groups("phi_rate", "psi")
        self._moving = np.isin(kinds, ("f", "p", "e")) | over.contents
        self._told, self._struck = self._reacting()
        # rows with and without inertia
        inertial, in_y, in_rate = inertial_rows(settled), over.in_y, over.in_rate
        self._light, self._heavy = settled.of_groups("dynamics", "psi", "gamma") & ~inertial, self._balances & inertial
        flow = (self._moved >= 0)[self._column]
        self._held = flow & in_rate & self._heavy[self._row], flow & in_y & settled.of_groups("momentum")[self._row]
        answered = inertial.copy()
        answered[self._row[in_rate | (in_y & flow)]] = True
        # rows behind the instant that nothing answers by a pulse
        self._given = settled.of_groups("phi", "dynamics", "gamma") & ~answered

    def _without_displacement(self) -> Mask:
        """Flows [unknowns] of no displacement and without inertia (of a source in a loop of stores): what passes them
        at once is an integral of their own.
        """
        over = self._over
        # flows with inertia
        inert = np.zeros(self.system.unknowns, dtype=bool)
        rates = over.in_rate & self._balances[self._row]
        inert[self._column[rates | self.system.of_groups("momentum")[self._row]]] = True
        found: Mask = (self.system.kinds == "f") & (over.moved < 0) & ~inert
        return found

    def _reacting(self) -> tuple[Mask, Mask]:
        """Gammas [rows] of implicit efforts that follow from multipliers (friction on a reaction) or that contents of
        stores gain; which forces have impulses where flows jump [unknowns]: those efforts, and multipliers.
        """
        kinds, gammas = self.system.kinds, self.system.of_groups("gamma")[self._row]
        reactions = np.isin(kinds, ("kappa", "mu"))
        # gammas that read multipliers
        reads = np.zeros(self.system.rows, dtype=bool)
        reads[self._row[gammas & reactions[self._column]]] = True
        follows = reactions.copy()
        # efforts that contents gain
        reads |= self._over.rates
        follows[self._column[reads[self._row] & (kinds == "e")[self._column]]] = True
        told = np.zeros(self.system.rows, dtype=bool)
        told[self._row[gammas & (follows & ~reactions)[self._column]]] = True
        return told, follows

    def broken(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> bool:
        """Whether a constraint on flows does not hold at the point, or where there are any, a momentum's."""
        flows = self._now(self._constraints)
        # no constraint on flows holds now
        if not flows.any():
            return False
        flows |= self._momenta
        jy, _ = self.system.jacobian(t, y, yd)
        size = np.zeros(self.system.rows)
        np.add.at(size, self._row, np.abs(jy) * np.maximum(magnitude, np.abs(y))[self._column])
        # off by more than its terms allow
        r = np.abs(self.system.residual(t, y, yd))
        with np.errstate(all="ignore"):
            return bool((r > BROKEN * size)[flows].any())

    def unbounded(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> tuple[str, int] | None:
        """The row at the point of a store that holds something, though its law lets it hold one value, whatever its
        effort or flow (a capacitance that becomes zero): its energy had no bound, no fast rise leads on ("overfull");
        a row that is no number ("nonfinite"); None: there is none.
        """
        contents, sloping = np.isin(self.system.kinds, ("q", "p", "s")), np.zeros(self.system.rows, dtype=bool)
        for at in (y, y + magnitude):  # where a law is flat at rest alone it holds more
            slope = self.system.jacobian(t, at, yd)[0]
            sloping[self._row[(slope != 0.0) & ~contents[self._column]]] = True
        # terms of the row at the point
        size = np.bincount(self._row, np.abs(slope) * np.maximum(magnitude, np.abs(y))[self._column], self.system.rows)
        off = np.where(self._now(self._states), np.abs(self.system.residual(t, y, yd)), 0.0)
        full = np.isposinf(off) | (~sloping & (off > BROKEN * size))
        # too much, or no number
        for cause, wrong in (("overfull", full), ("nonfinite", np.isnan(off))):
            if wrong.any():
                return cause, int(np.argmax(wrong))
        return None

    def _now(self, rows: Mask) -> Mask:
        """Those of the rows that hold now."""
        found = rows.copy()
        found[self.system.held[0]] = False
        return found

    def _acting(self) -> Mask:
        """Forces [unknowns]; what does not hold has no multiplier, and no impulse of one."""
        acts = self._over.force.copy()
        acts[self.system.held[1]] = False
        return acts

    def _taken(self, rows: Mask, moves: Mask, acts: Mask) -> NDArray[np.int64]:
        """Terms of rows [rows] in unknowns that move, and that have impulses [unknowns]."""
        pulses = self._pulses
        unknown, integral = np.divmod(pulses.column, 2)
        return np.flatnonzero(rows[pulses.row] & np.where(integral == 1, acts[unknown], moves[unknown]))

    def displacements(
        self, t: float, y: Floats, yd: Floats, magnitude: Floats, *, sums: bool = False
    ) -> tuple[Floats, Floats]:
        """Y with the displacements behind the jump at t; the impulses of effort on balances with inertia [rows]; sums:
        what rows say together holds behind it too.

        Where nothing resists an impulse of flow the rows of displacements alone say where they are.
        """
        # slopes at the point, inertia besides
        slope, inertia = self._slopes(t, y, yd, magnitude)
        heavy, carried = self._held
        jumps, met = (self.system.kinds == "q") | self._over.contents, self._now(self._light) | self._over.rates
        # pulses of what may jump, and inertia that resists
        taken, held = self._taken(met, jumps, self._acting() | self._loose), np.flatnonzero(heavy | carried)
        i = 2 * np.append(self._pulses.row[taken], self._row[held]) + 1
        j = np.append(self._pulses.column[taken], 2 * self._moved[self._column[held]])
        v = np.append(self._pulses.values(slope, inertia)[taken], np.where(heavy, inertia, slope)[held])
        # what follows moves freely
        ease = np.where(np.isin(self.system.kinds, FOLLOWS), LOOSE, 1.0)
        behind = self._given.copy()
        behind[self.system.held[0]] = True  # they read "multiplier = 0"
        # other dynamic variables have finite rates: what they hold, contents of stores in series among it, stays
        moves = (self.system.kinds != "s") | jumps
        asked = Asked(behind, moves, met, lambda *_: (i, j, v, v), ease)
        found, impulse = self._jump((t, y, yd), magnitude, asked)
        together = self._hidden(slope, jumps) if sums else None
        # sums that the point does not meet are asked for too
        if together is not None and self._unmet(together, t, found, yd, magnitude):
            found, impulse = self._jump((t, y, yd), magnitude, replace(asked, sums=together))
        found = np.where(jumps, found, y)
        return found, self._pushed(slope, found - y, impulse, inertia * magnitude[self._column])

    def _hidden(self, slope: Floats, jumps: Mask) -> Hidden | None:
        """What rows without inertia say together of what jumps [unknowns] behind the instant."""
        light = self._now(self._light | self.system.of_groups("phi_rate"))
        answers = (self.system.kinds == "f") | self._acting()
        return hidden((self._row, self._column, slope), light, answers, jumps)

    def _unmet(self, sums: Hidden, t: float, y: Floats, yd: Floats, magnitude: Floats) -> bool:
        """Whether a sum of rows is not met at the point by more than round-off of its terms."""
        jy = self.system.jacobian(t, y, yd)[0]
        terms = np.abs(jy) * np.maximum(np.abs(y), magnitude)[self._column]
        size = np.abs(sums.weights) @ np.bincount(self._row, terms, self.system.rows)
        return bool((np.abs(sums.of(self.system.residual(t, y, yd))) > BROKEN * size).any())

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
        # nothing asks for other flows
        if aims is None and not (push.any() or open_ or self.broken(t, y, yd, magnitude)):
            return y, np.zeros(y.size)
        # momenta and flows jump together, by impulses
        moves, behind, ease = self._moving, self._now(self._constraints) | self._states, 1.0
        met, pulses = self._balances | self._over.rates | self._told, self._pulses
        taken = self._taken(met, moves, self._acting() & self._struck)
        i, j = 2 * pulses.row[taken] + 1, pulses.column[taken]
        rated = taken[j % 2 == 0]
        # laws that bend: the mean slope along the way counts
        curved = bool((~self._over.affine[pulses.row[rated]]).any())
        rated = rated[self._balances[pulses.row[rated]]] if open_ else rated[:0]
        if open_:  # finite terms decide, rates of the others among them
            behind, moves, ease = behind | self._balances, moves | self._over.force, 1.0 / LOOSE
            i, j = np.append(i, 2 * pulses.row[rated]), np.append(j, pulses.column[rated] + 1)
        at = np.append(taken, rated)
        told = self._told[self._row] if self._told.any() else None
        brings = np.isin(np.arange(y.size), self._column[self._over.rates[self._row]])  # a law may be flat at rest
        reacts = self._struck & ((self.system.kinds != "e") | brings)

        def integrals(jy: Floats, jyd: Floats, here: Floats) -> Entries:
            if told is not None:  # friction on a reaction that is nothing yet
                jy = np.where(told, self.system.jacobian(t, np.where(reacts, here + magnitude, here), yd)[0], jy)
            slopes = pulses.values(jy, jyd)[at]
            # straight: the slope is the mean
            if not curved:
                return i, j, slopes, slopes
            means = pulses.values(jy, self._mean(t, (y, here), yd, jyd))
            return i, j, slopes, np.append(means[taken], slopes[taken.size :])

        aim = np.stack([np.zeros(self.system.rows) if aims is None else aims, -push], axis=1)
        begun = self._sloping(t, y, yd, magnitude)
        asked = Asked(behind, moves, met, integrals, ease)
        return self._jump((t, y, yd), magnitude, asked, begun=begun, aims=aim, sure=aims is not None)

    def _mean(self, t: float, way: tuple[Floats, Floats], yd: Floats, jyd: Floats) -> Floats:
        """Mean of dF/dyd [entries] along the straight way, jyd at its end: times the jumps of flows and contents what
        momenta and contents of nonlinear stores jump by, whatever the way is.
        """
        begin, end = way
        # the slope does not change along the way
        if np.array_equal(jyd, self.system.jacobian(t, 0.5 * (begin + end), yd)[1], equal_nan=True):
            return jyd
        # Gauss points of the way
        parts, weights = _gauss()
        at = (begin + 0.5 * (1.0 + part) * (end - begin) for part in parts.tolist())
        found = 0.5 * np.asarray(weights) @ [self.system.jacobian(t, y, yd)[1] for y in at]
        return np.where(np.isfinite(found), found, 0.0)

    def _leaves_open(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> bool:
        """Whether inertia leaves flows open that it has: nodes that stores only tie together."""
        inertia = self.system.jacobian(t, y, yd)[1]
        inert = self._balances[self._row] & (self.system.kinds == "f")[self._column] & (inertia != 0.0)
        row, column = self._row[inert], self._column[inert]
        # flows that inertia and nothing else determines
        free = free_unknowns((self.system.rows, y.size), (row, column, inertia[inert] * magnitude[column]))
        return free is not None and bool(free[column].any())

    def _sloping(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> Floats:
        """Y with implicit efforts at their magnitudes where their laws are flat (a flat one decides about the flows),
        but for those that multipliers tell.
        """
        steepest = np.zeros(y.size)
        jy, _ = self.system.jacobian(t, y, yd)
        # rows of states by implicit efforts: flat where no slope is left
        mine = self._states[self._row]
        np.maximum.at(steepest, self._column[mine], np.abs(jy[mine]))
        return np.where((self.system.kinds == "e") & ~self._struck & (steepest == 0.0), y + magnitude, y)

    def _with(self, here: Any, integrals: Any, jy: Floats, asked: Asked) -> tuple[Any, Any, Floats]:
        """Entries of what holds behind the instant, of single rows (here) and of sums, and of integrals."""
        parts = [here]
        # sums of rows by what moves and is no flow
        if asked.sums is not None:
            moves = np.flatnonzero((asked.moves & (self.system.kinds != "f") & ~self._over.force)[self._column])
            parts.append(asked.sums.entries(self._row[moves], self._column[moves], jy[moves]))
        i, j, v = (np.concatenate([part[k] for part in parts]) for k in range(3))
        return np.append(2 * i, integrals[0]), np.append(2 * j, integrals[1]), np.append(v, integrals[2])

    def _jump(
        self,
        before: tuple[float, Floats, Floats],
        magnitude: Floats,
        asked: Asked,
        *,
        begun: Floats | None = None,
        aims: Floats | float = 0.0,
        sure: bool = False,
    ) -> tuple[Floats, Floats]:
        """The least change of y that meets the rows, from where it has begun, without its round-off; impulses of forces
        [unknowns]; UnbalancedError.  Where that comes to no numbers y is as it was, and there are none.

        before: t, y, yd; aims [rows, 2]: what the rows behind the instant shall be, and the integrals.  sure: numbers
        there must be, else NotFiniteError.
        """
        t, start, yd = before
        y, integral, step = start if begun is None else begun, np.zeros(start.size), np.inf
        # entries of rows that hold behind the instant
        here = asked.behind[self._row] & asked.moves[self._column]
        # magnitudes, and impulses without one
        scale = np.stack([magnitude * asked.ease, np.full(start.size, np.nan)], axis=1).ravel()
        # Newton's method on rows and integrals at once
        for _ in range(ITERATIONS):
            jy, jyd = (np.where(np.isfinite(item), item, 0.0) for item in self.system.jacobian(t, y, yd))
            i, j, v, mean = asked.integrals(jy, jyd, y)
            aim = np.zeros((self.system.rows, 2)) + aims
            left = self.system.residual(t, y, yd)
            aim[asked.behind, 0] -= left[asked.behind]
            # sums beside single rows
            if asked.sums is not None:
                aim = np.append(aim, np.outer(-asked.sums.of(left), (1.0, 0.0)), axis=0)
            change, aim = np.stack([y - start, integral], axis=1).ravel(), aim.ravel()
            np.add.at(aim, i, -mean * change[j])
            # converged: what is left says whether it balances
            if step <= CONVERGED:
                break
            entries = self._row[here], self._column[here], jy[here]
            try:
                move = least_measured(self._with(entries, (i, j, v), jy, asked), aim, scale)
            except NotFiniteError:
                # no numbers: as it was, unless there must be some
                if sure:
                    raise
                return start, np.zeros(start.size)
            y, integral = y + move[::2], integral + move[1::2]
            step = float((np.abs(move[::2]) / np.maximum(magnitude, np.abs(y))).max(initial=0.0))
        wanted, aim = (np.zeros((self.system.rows, 2)) + aims).ravel(), aim[: 2 * self.system.rows]
        # impulses are as large as what they balance
        size = np.fmax(scale, np.stack([np.maximum(np.abs(y), np.abs(start)), 0.0 * y], axis=1).ravel())
        off = np.where(asked.met, missed((i, j, mean), size, (aim, wanted))[1::2], 0.0)
        # a balance over the instant that is not met
        if off.any():
            raise UnbalancedError(int(np.argmax(off)))
        return np.where(np.abs(y - start) > ROUND_OFF * magnitude, y, start), np.where(self._integrated, integral, 0.0)
