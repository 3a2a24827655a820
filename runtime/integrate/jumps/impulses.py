"""What dynamic variables that no other row reads gain over an instant at which a state jumps: energies, momenta.

    s' = g(t, y, y')      s+ - s- = int_0^1 dg/dz(y(r)) . dz/dr dr,     z = (y', flows that are pulses, forces)

An instant is the limit of a fast rise r = 0..1 along which what the text tells goes straight from its value before to
that behind.  Impulses are what such a rise integrates: of rates the jumps of flows and momenta, of flows those of
displacements, of forces what the balances ask for (start/instant.py); finite terms do not count.  What is a flow times
a force so is its impulse times the mean of the other, of linear stores; of others y(r) is followed.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.facts import Mask
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.least_change import least_measured
from sysdyn.runtime.start.integrated import integrated
from sysdyn.runtime.start.restart import STILL
from sysdyn.values import dataclass

BROKEN = tuning.SAME
"""Of the largest terms: what a row is missed by along the straight way, which then is not the rise."""
GAUSS = tuple(0.5 + sign * np.sqrt(1.0 / 12.0) for sign in (-1.0, 1.0))
"""Points of Gauss's rule of degree 3: exact for powers of linear elements along a straight way."""
PARTS = tuple(1 << k for k in range(9))
"""Steps of the classical method of order 4 along a curved way, until two agree within AGREED of the largest gain."""
AGREED = tuning.HALF_OF_ITS_DIGITS
AWAY = tuning.UNSEEN
"""Of its magnitude: by how much the end of a curved way may be elsewhere."""
STEEP = tuning.UNSEEN
"""Of a power: by what it may differ with pulses in the place of finite flows and forces."""
RISE = 1e-9
"""s: of pulses that are told from what is finite."""

_Slopes = tuple[Floats, Floats]


@dataclass(frozen=True, slots=True)
class Side:
    """A side of an instant: t (s), y, yd [unknowns as written], parameters."""

    t: float
    y: Floats
    yd: Floats
    p: Floats


class Impulses:
    """states: the dynamic variables that no other row reads, rows: those of their rates.  system: of the run."""

    def __init__(self, system: System, unread: Ints, *, assigned: bool) -> None:
        """unread: displacements that the run does not integrate; assigned: events assign flows or dynamic variables,
        by impulses from nowhere.
        """
        # the form in which integrals stand beside what jumps
        self._assigned = assigned
        settled = self.system = system.another("settled")
        over = self._over = integrated(settled)
        self._row, self._column, in_y, in_rate = over.row, over.column, over.in_y, over.in_rate
        self._in_y, self._in_rate, (self.rows, self.states) = in_y, in_rate, over.unread
        form, self._moved = settled.another("3").form, np.where(np.isin(over.moved, unread), -1, over.moved)
        self._read = self._may_pulse()
        # unknowns with inertia: their rates are impulses
        inertia = in_rate & settled.of_groups("dynamics", "gamma")[self._row]
        inertia |= in_y & settled.of_groups("momentum")[self._row] & (settled.kinds == "f")[self._column]
        inert = np.isin(np.arange(settled.unknowns), self._column[inertia])
        # displacements tell the pulses of their flows
        self._given = over.force | ((settled.kinds == "f") & (self._moved < 0) & ~inert)
        self._pulses = over.pulses(self._moved, self._given)
        open_ = np.isin(np.arange(settled.unknowns), unread)  # their flows are given, their places nobody keeps
        # rows that balance impulses, rows that hold throughout
        self._balances, self._others = self._by_order(open_)
        forced = np.isin(np.arange(settled.rows), self._row[in_y & over.force[self._column]])
        self._laws = settled.of_groups("gamma") & ~forced  # at each point too where their flows are no pulses
        # what a jump of them carries: displacements, inertial flows, contents
        self._carries = ((settled.kinds == "q") & ~open_) | inert | over.contents
        held = form.k_q[inert[form.k_f]]
        self._stays = np.isin(np.arange(settled.unknowns), np.concatenate([self.states, held, unread]))

    @property
    def any(self) -> bool:
        """Whether an instant may do something to dynamic variables by impulses."""
        return bool(self.states.size or self._read.size)

    def _may_pulse(self) -> Ints:
        """Rows of rates that may have impulses, of dynamic variables that other rows read and that do not gain by them
        (start/instant.py).
        """
        rates, pulses = self.system.of_groups("lambda") & ~self._over.rates, self._over.force | (self._moved >= 0)
        found = self._row[rates[self._row] & self._in_y & pulses[self._column]]
        return np.setdiff1d(found, self.rows)

    def _by_order(self, open_: Mask) -> tuple[Mask, Mask]:
        """Rows that impulses meet, integrated over an instant; rows that hold at each point of the rise, none of which
        reads open displacements.
        """
        # rows whose rates or flows are pulses, rows of integrals themselves
        settled, flow = self.system, (self._moved >= 0)[self._column]
        moved, own = np.zeros((2, settled.rows), dtype=bool)
        moved[self._row[self._in_rate | (self._in_y & flow)]], own[self.rows] = True, True
        own[self._read] = True
        integrated = settled.of_groups("dynamics", "gamma", "psi") | (settled.of_groups("lambda") & ~own)
        # flows given from outside pulse in rows of velocities too
        told = np.zeros(settled.rows, dtype=bool)
        told[self._row[(self._given & (settled.kinds == "f"))[self._column] & self._in_y]] = True
        integrated |= settled.of_groups("phi_rate") & told
        places = np.isin(np.arange(settled.rows), self._row[self._in_y & open_[self._column]])
        held = settled.of_groups("phi", "phi_rate", "psi", "momentum") & ~places
        return integrated, held | (settled.of_groups("dynamics", "gamma") & ~moved)

    def gains(self, before: Side, behind: Side, magnitude: Floats) -> Floats:
        """s+ - s- [states]; zero of what an event assigns.  magnitude [unknowns].  SolverFailure where a power has no
        integral (pulses of flow through a resistance), and where what jumps is no answer of the balances.
        """
        # what moves less than counts stays
        way, none = behind.y - before.y, np.zeros(self.states.size)
        way[np.abs(way) <= STILL * magnitude] = 0.0
        # what an event assigns gains nothing by itself
        assigned, way[self.states] = way[self.states] != 0.0, 0.0
        # nothing that carries jumps
        if not way[self._carries].any():
            return none
        others = self._others | (self._laws & ~self._rows_of_pulses(way))
        found, balanced, faithful = self._straight(before, behind, way, others)
        # not straight: along the rise as the rows bend it
        if not (balanced and faithful):
            curved = self._gains_along_rise(before, behind, way, (magnitude, others))
            if curved is None and not self._assigned:
                raise SolverFailure("unbalanced", behind.t, 0.0)
            found = found if curved is None else curved
        return np.where(assigned, 0.0, found)

    def _rows_of_pulses(self, way: Floats) -> Mask:
        """Rows [rows] that read flows which are pulses."""
        found = np.zeros(self.system.rows, dtype=bool)
        found[self._row[self._in_y & (self._pulse(way) != 0.0)[self._column]]] = True
        return found

    # -- the rise ------------------------------------------------------------------------------------------------

    def _slopes(self, sides: tuple[Side, Side], part: float, y: Floats, pulse: Floats | float = 0.0) -> _Slopes:
        """dF/dy, dF/dyd [entries] at y, text and parameters a part of their way along; pulse [unknowns]: of flows,
        of forces.
        """
        p, own = self.system.description.p, self.system.description.p.copy()
        found = []
        # text and parameters of each side
        for side in sides:
            if (side.p != p).any():
                p[:] = side.p
            found.append(self.system.jacobian(side.t, y + pulse, side.yd))
        if (own != p).any():
            p[:] = own
        (jy, jyd), (ky, kyd) = found
        return (1.0 - part) * jy + part * ky, (1.0 - part) * jyd + part * kyd

    def _terms(self, slopes: _Slopes, way: Floats, impulse: Floats | float = 0.0) -> Floats:
        """What rows gain [terms of the pulses] by moves of y along the way and impulses [unknowns]."""
        gains = np.stack([way, np.zeros(way.size) + impulse], axis=1).ravel()
        return self._pulses.values(*slopes) * gains[self._pulses.column]

    def _sums_of_terms(self, terms: Floats) -> Floats:
        """Of terms, the sums [rows]."""
        return np.asarray(np.bincount(self._pulses.row, terms, self.system.rows), dtype=np.float64)

    def _pulse(self, way: Floats) -> Floats:
        """Flows [unknowns] that are pulses, integrated."""
        return np.where(self._moved >= 0, way[self._moved], 0.0)

    def _rate(self, terms: Floats) -> Floats:
        """What the states gain [states]: their rows read s' - g."""
        return -self._sums_of_terms(terms)[self.rows]

    # -- straight ------------------------------------------------------------------------------------------------

    def _straight(self, before: Side, behind: Side, way: Floats, others: Mask) -> tuple[Floats, bool, bool]:
        """The gains [states] where all unknowns go straight; whether impulses balance there, and others [rows] hold."""
        gained, balanced, faithful = np.zeros(self.states.size), True, True
        # Gauss points of the way
        for part in GAUSS:
            y = before.y + part * way
            slopes = self._slopes((before, behind), part, y)
            impulse, met = self._impulse(slopes, way)
            rate = self._rate(terms := self._terms(slopes, way, impulse))
            # variables that others read must not jump
            self._still(terms, behind.t)
            fast = self._fast(terms, way, impulse)
            # flows that are pulses: a power that grows with them has no integral
            if fast.any():
                with np.errstate(all="ignore"):
                    pulsed = self._terms(self._slopes((before, behind), part, y, fast), way, impulse)
                    self._finite(rate, self._rate(pulsed), behind.t)
            gained += 0.5 * rate
            balanced &= met
            faithful &= self._holds((before, behind), part, y, others)
        return gained, balanced, faithful

    def _fast(self, terms: Floats, way: Floats, impulse: Floats) -> Floats:
        """Flows and forces [unknowns] in a rise that takes RISE; impulses that are nothing beside the largest term of a
        balance are round-off.
        """
        size = np.where(self._balances[self._pulses.row], np.abs(terms), 0.0)
        own = (self._pulses.column % 2 == 1) & (size > BROKEN * size.max(initial=0.0))
        counts = np.isin(np.arange(way.size), self._pulses.column[own] // 2)
        return (self._pulse(way) + np.where(counts, impulse, 0.0)) / RISE

    def _still(self, terms: Floats, t: float) -> None:
        """SolverFailure where a dynamic variable that others read has a rate with an impulse: it would jump."""
        rows = self._read
        # no variable is read by others
        if not rows.size:
            return
        left, size = (self._sums_of_terms(w)[rows] for w in (terms, np.abs(terms)))
        if (missed := np.abs(left) > BROKEN * size).any():
            raise SolverFailure("pulsed", t, 0.0, self._state_of(rows[np.argmax(missed)]))

    def _state_of(self, row: int) -> str:
        """The name of the dynamic variable whose rate a row tells."""
        own = self._in_rate & (self._row == row) & (self.system.kinds == "s")[self._column]
        return self.system.name(int(self._column[own][0]))

    def _finite(self, rate: Floats, pulsed: Floats, t: float) -> None:
        """SolverFailure where a rate grows with what is a pulse itself."""
        endless = np.abs(pulsed - rate) > STEEP * np.maximum(np.abs(rate), np.abs(pulsed))
        if endless.any():
            raise SolverFailure("endless", t, 0.0, self.system.name(int(self.states[np.argmax(endless)])))

    def _impulse(self, slopes: _Slopes, way: Floats) -> tuple[Floats, bool]:
        """Impulses of forces, and pulses of flows that no displacement tells [unknowns], that rows ask for along the
        way; whether these are met.
        """
        # impulses that balance the rates of the way, least of all
        pulses = self._pulses
        at = np.flatnonzero(self._balances[pulses.row] & (pulses.column % 2 == 1))
        aim = -self._sums_of_terms(self._terms(slopes, way))
        entries = pulses.row[at], pulses.column[at] // 2, pulses.values(*slopes)[at]
        impulse = least_measured(entries, aim, np.full(way.size, np.nan))
        terms = np.where(self._balances[pulses.row], self._terms(slopes, way, impulse), 0.0)
        size, left = self._sums_of_terms(np.abs(terms)), self._sums_of_terms(terms)
        return impulse, bool((np.abs(left) <= BROKEN * size.max(initial=0.0))[self._balances].all())

    def _holds(self, sides: tuple[Side, Side], part: float, y: Floats, others: Mask) -> bool:
        """Whether rows without impulses hold at y, where the text and all else asked are a part of their way along."""
        before, behind = sides
        ends = [self.system.residual(behind.t, z, behind.yd)[others] for z in (before.y, y, behind.y)]
        off = ends[1] - (1.0 - part) * ends[0] - part * ends[2]
        return bool((np.abs(off) <= BROKEN * (np.abs(ends[0]) + np.abs(ends[2]))).all())

    # -- curved --------------------------------------------------------------------------------------------------

    def _gains_along_rise(self, before: Side, behind: Side, way: Floats, along: tuple[Floats, Mask]) -> Floats | None:
        """The gains [states] along the rise itself; None where rows do not tell it: it ends elsewhere.  along:
        magnitudes [unknowns], rows [rows] that hold at each point.
        """
        (magnitude, others), last = along, None
        # the way in parts, ever finer, until gains agree
        size = np.maximum(magnitude, np.abs(way))
        for number in PARTS:
            y, gained = self._integrate_rise((before, behind), size, others, number)
            if last is not None and (np.abs(gained - last) <= AGREED * np.abs(gained).max(initial=0.0)).all():
                # where the rise ends must be the point behind
                near = np.abs(y - before.y - way) <= AWAY * size
                return gained if near[self._carries].all() else None
            last = gained
        return None

    def _integrate_rise(
        self, sides: tuple[Side, Side], size: Floats, others: Mask, number: int
    ) -> tuple[Floats, Floats]:
        """Y [unknowns] and gains [states] at the end, in a number of steps of the classical Runge-Kutta method."""
        before, behind = sides
        y, gained, step = before.y.copy(), np.zeros(self.states.size), 1.0 / number
        # rows at each point, moved from one side to the other
        ends = [self.system.residual(behind.t, z, behind.yd) for z in (before.y, behind.y)]
        asked = np.where(others, ends[1] - ends[0], 0.0)
        for k in range(number):
            way, total, gain = np.zeros(y.size), np.zeros(y.size), np.zeros(self.states.size)
            # classical Runge-Kutta
            for part, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
                at = y + part * step * way
                slopes = self._slopes(sides, (k + part) * step, at)
                way, impulse = self._direction(slopes, asked, size, others)
                total += weight / 6.0 * way
                gain += weight / 6.0 * self._rate(self._terms(slopes, way, impulse))
            y, gained = y + step * total, gained + step * gain
        return y, gained

    def _direction(self, slopes: _Slopes, asked: Floats, size: Floats, holds: Mask) -> tuple[Floats, Floats]:
        """What y moves by along the rise, and the impulses [unknowns]: what the rows ask for, at least of all."""
        # rows of impulses, rows of positions, of what may move
        pulses = self._pulses
        over = np.flatnonzero(self._balances[pulses.row] & ~self._stays[pulses.column // 2])
        here = np.flatnonzero(holds[self._row] & self._in_y & ~self._stays[self._column])
        i = np.append(2 * self._row[here], 2 * pulses.row[over] + 1)
        j = np.append(2 * self._column[here], pulses.column[over])
        v = np.append(slopes[0][here], pulses.values(*slopes)[over])
        aim = np.stack([asked, np.zeros(asked.size)], axis=1).ravel()
        found = least_measured((i, j, v), aim, np.stack([size, np.full(size.size, np.nan)], axis=1).ravel())
        return found[::2], found[1::2]
