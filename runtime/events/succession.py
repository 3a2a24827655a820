"""Which constraints hold behind an event, and the point with them: impacts, the active set, ties between sets.

Received: a point before, what was touched.  Returned: the consistent point from which the next piece begins.  What
followed from an active set and what touched it is remembered, and tried first when that happens again.
"""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.determined import Determined
from sysdyn.runtime.events.impacts import UNSEEN, Impacts
from sysdyn.runtime.events.memory import Memory
from sysdyn.runtime.events.pivoting import NoActiveSetError, Settle, once
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.start.instant import UnbalancedError
from sysdyn.runtime.start.restart import Restart

AHEAD = tuple(10.0**-k for k in range(9, 1, -2))
"""Of the time in which the unknowns change: how far ahead a tie between active sets is looked at."""

Point = tuple[Floats, Floats]


class Succession:
    """Of one run.  restart: consistent points of it, told before it is asked; blow: a flow was assigned since."""

    def __init__(self, plan: Plan, contacts: Contacts, determined: Determined) -> None:
        self.plan, self.contacts, self.observer, self.p = plan, contacts, contacts.observer, contacts.p
        self.determined, self.impacts = determined, Impacts(contacts, plan.rest)
        self.restart: Restart | None = None
        self.blow = False
        self._memory = Memory(contacts)
        self._impacts = any(c.kind in ("phi", "planar") for c in plan.contacts)

    @property
    def _restart(self) -> Restart:
        assert self.restart is not None
        return self.restart

    def after(self, t: float, y: Floats, yd: Floats, touched: Sequence[int], *, stalled: bool) -> tuple[Point, bool]:
        """The consistent point with the constraints that hold from now on, and whether they were sought: what followed
        before is not; NoActiveSetError.  stalled: no time has passed since the last event.

        Where no set fits it is asked once more from the point brought to round-off under what stood: the rows of a
        draft hold only nearly, and what is left over is taken for a multiplier (a diode that lets go before a
        capacitor).
        """
        stood = self.contacts.state()
        try:
            return self._after(t, y, yd, touched, stalled=stalled)
        except NoActiveSetError:
            self.contacts.become(stood)
            y, yd, done = self._restart.settler.moved(t, y, yd)
            if not done:
                raise
            return self._after(t, y, yd, touched, stalled=True)

    def _after(self, t: float, y: Floats, yd: Floats, touched: Sequence[int], *, stalled: bool) -> tuple[Point, bool]:
        """The consistent point behind the event from this very point, and whether its set was sought."""
        restart = self._restart
        # a new instant: frictions may go through zero again
        self.contacts.through.clear()
        self._guards(t, y, yd)
        stood = self.contacts.state()
        # what followed the last time, unless time stands still
        known = None if stalled else self._recall_set(t, (y, yd), stood, touched)
        if known is not None:
            return known, False
        y = self.impacts.after(t, y, yd, self._strike, restart.instant.system, blow=self.blow)
        self.blow = False
        values = self.observer(t, y, yd)
        # what was touched turns first
        for k in touched:
            self._let_through(k, t, y, yd)
            if self.contacts.contacts[k].kind != "phi" or self.contacts.active[k]:
                self.contacts.turn(k, values)
        self.contacts.apply()
        found = self.determined.fit(t, y, yd, once(self.contacts, restart.struck), touched)
        # the set may be the old one again
        still = touched if self.contacts.state() == stood else ()
        if self._is_tied(t, found, still):
            found = self._ahead(t, found, self.contacts.state()) or found
        elif not stalled and self._beside_idle(t, found, stood):  # twice at an instant would go round in a circle
            found = self._handed_on(t, found)
        # sets that impacts do not lead to are remembered
        if not self._impacts:
            self._memory.learn(stood, touched, self.contacts.state())
        return self._close_gaps(t, found), True

    def _let_through(self, k: int, t: float, y: Floats, yd: Floats) -> None:
        """Whether the value of a relation goes through zero: neither it nor its rate follows the sense at once."""
        contacts, contact = self.contacts, self.contacts.contacts[k]
        # no relation, or one that holds
        if contact.hold < 0 or contacts.active[k]:
            return
        ends = self._slipping(k, t, y, yd)
        # both senses leave it where it is
        least = [self.observer.zero(row) for row in (contact.value, contact.rate)]
        if len(ends) == 2 and (np.abs(ends[0] - ends[1]) <= least).all():
            contacts.through.add(k)

    def _slipping(self, k: int, t: float, y: Floats, yd: Floats) -> list[Floats]:
        """Value and rate of a friction that slips in the sense 1, and -1; fewer where there is no such point."""
        contacts, contact = self.contacts, self.contacts.contacts[k]
        ends, stood = list[Floats](), contacts.state()
        for sense in (1.0, -1.0):
            contacts.slip(k, sense)
            contacts.apply()
            found = self._restart.struck(t, y, yd)
            if found is not None:
                ends.append(self.observer(t, *found[:2])[[contact.value, contact.rate]])
        contacts.become(stood)
        return ends

    def driving_friction(self, t: float, y: Floats, yd: Floats, values: Floats) -> str | None:
        """The name of a friction that slips, and whose bound a reaction tells, that would push along: it has the sign
        that its text gives it.
        """
        contacts, zero = self.contacts, self.observer.zero
        # relations that are free and move
        free = {k for k, c in enumerate(contacts.contacts) if c.hold >= 0 and not contacts.active[k]}
        slips = {k for k in free if abs(values[(row := contacts.contacts[k].value)]) > zero(row)}
        return self.driving(t, y, yd, slips - contacts.finite(t, y, yd)) if slips else None

    def acts(self, k: int, t: float, y: Floats, yd: Floats) -> bool:
        """Whether the rate of what a friction slips by is another one in the other sense."""
        ends, least = self._slipping(k, t, y, yd), self.observer.zero(self.contacts.contacts[k].rate)
        return len(ends) == 2 and bool(abs(ends[0][1] - ends[1][1]) > least)

    def driving(self, t: float, y: Floats, yd: Floats, among: Set[int] | None = None) -> str | None:
        """The name of a friction (among: of some) that would push what slips along: its bound is negative, or its sign
        is wrong.
        """
        for k, contact in enumerate(self.contacts.contacts):
            if contact.kind == "friction" and (among is None or k in among):
                ends = self._slipping(k, t, y, yd)
                # slipping one way accelerates that way: it drives
                if len(ends) == 2 and ends[0][1] - ends[1][1] > self.observer.zero(contact.rate):
                    return contact.name
        return None

    def _close_gaps(self, t: float, point: Point) -> Point:
        """The point with gaps that hold brought to nothing: one that is caught in flight is only nearly closed."""
        values = self.observer(t, *point)
        gaps = [c.value for k, c in enumerate(self.plan.contacts) if c.kind == "phi" and self.contacts.active[k]]
        # closed to round-off
        if not any(abs(values[gap]) > UNSEEN * self.observer.terms[gap] for gap in gaps):
            return point
        y, yd, done = self._restart.settler.moved(t, *point)
        return (y, yd) if done else point

    def _recall_set(self, t: float, point: Point, stood: tuple[float, ...], touched: Sequence[int]) -> Point | None:
        """The point with the active set that followed when this happened before, where it fits; None where not."""
        after = self._memory.recall(stood, touched)
        # something new in some part of the model
        if after is None:
            return None
        before = self.contacts.active.copy(), self.p.copy()
        # the point of that set
        self.contacts.become(after)
        found = self._restart.struck(t, *point)
        if found is not None:
            # it must fit, and leave nothing open
            fits = self.contacts.fits(t, point[0], found)
            fits = fits and (bool(touched) or self._is_decided(before[0], self.observer(t, *found[:2])))
            if fits and self.determined.leaves(t, *found[:2]) == 0:
                return found[0], found[1]
        self.contacts.active[:], self.p[:] = before
        self.contacts.apply()
        return None

    def _is_decided(self, before: NDArray[np.bool_], values: Floats) -> bool:
        """Whether the inequalities that turned could not have stayed as they were `before`: what would hold and open
        alike at this instant (a diode that conducts beside a capacitor) stays where nothing touched it.
        """
        active, zero = self.contacts.active, self.observer.zero
        turned = [k for k in np.flatnonzero(active != before) if self.plan.contacts[k].kind in ("phi", "psi")]
        held = [self.plan.contacts[k] for k in turned if active[k]]
        open_ = [self.plan.contacts[k] for k in turned if not active[k]]
        return all(values[c.multiplier] > zero(c.multiplier) for c in held) and all(
            values[c.value] > zero(c.value) or values[c.rate] > zero(c.rate) for c in open_
        )

    def _is_tied(self, t: float, point: Point, touched: Sequence[int]) -> bool:
        """Whether something touched may hold or not at this instant, but a gap that has bounced; or friction that is
        at its bound while others hold what it joins.
        """
        values, zero = self.observer(t, *point), self.observer.zero
        contacts = [self.contacts.contacts[k] for k in touched]
        stick = self.contacts.active
        slips = [c for c, sticks in zip(self.plan.contacts, stick, strict=True) if c.kind == "friction" and not sticks]
        idle = any(abs(values[c.value]) <= zero(c.value) and abs(values[c.rate]) <= zero(c.rate) for c in slips)
        return idle or any(c.kind != "phi" or abs(values[c.rate]) <= zero(c.rate) for c in contacts)

    def _handed_on(self, t: float, point: Point) -> Point:
        """The point with the active set that fits a little later, where that fits at t too; else the point itself."""
        here = self.contacts.state()
        ahead = self._ahead(t, point, here)
        # a little later it fits, and at t too
        if ahead is not None and self.contacts.fits(t, ahead[0], (*ahead, np.zeros_like(ahead[0]))):
            return ahead
        self.contacts.become(here)
        return point

    def _beside_idle(self, t: float, point: Point, stood: tuple[float, ...]) -> bool:
        """Whether something opened beside a one-way flow that was open and carries nothing, nor begins to: where all of
        a bridge blocks one diode holds its load, and hands it on to another when the source goes through zero.  Both
        open is a set that fits at that very instant alone.  (Not so of their duals, which hold: `_later` moves what
        stands for a flow there by its rate at t, and of a flow at rest that is none.)
        """
        values, active = self.observer(t, *point), self.contacts.active
        open_ = [k for k, c in enumerate(self.plan.contacts) if c.kind == "psi" and not c.dual and not active[k]]
        opened = any(stood[k] for k in open_)
        return opened and any(not stood[k] and self.contacts.rests(k, values) for k in open_)

    def _ahead(self, t: float, point: Point, stood: tuple[float, ...]) -> Point | None:
        """The point with the active set that fits a little later, None where none differs.

        At t itself the old set fits as well as the new one: a multiplier that is zero and falls.  A set that leaves
        something open (both arms of a bridge) is one that nothing has told apart yet: it is taken where none is better.
        """
        y, yd = point
        kept, open_ = (self.contacts.active.copy(), self.p.copy()), None
        nowhere = set[tuple[float, ...]]()  # sets that have no point there

        def quickly(t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats, Floats] | None:
            """As `struck` without a search; a set that has no point at one instant has none at the next."""
            state = self.contacts.state()
            found = None if state in nowhere else self._restart.struck(t, y, yd, quickly=True)
            if found is None:
                nowhere.add(state)
            return found

        # ever later, until sets are told apart
        for later in AHEAD:
            time = later * self.contacts.time
            found = self._later(t, time, (y, yd), stood, quickly)
            # determined: taken
            if found is not None and self.determined.leaves(t, *found) == 0:
                return found
            # leaves something open: second best
            if found is not None and open_ is None:
                open_ = found, self.contacts.active.copy(), self.p.copy()
            self.contacts.active[:], self.p[:] = kept
            self.contacts.apply()
        # no later instant tells them apart
        if open_ is None:
            return None
        self.contacts.active[:], self.p[:] = open_[1:]
        self.contacts.apply()
        return open_[0]

    def _later(self, t: float, time: float, point: Point, stood: tuple[float, ...], quickly: Settle) -> Point | None:
        """The point at t with the active set that fits `time` (s) later; None where that is the one that stood, or
        none is found `quickly`: it only tells sets apart.
        """
        # straight on, then with the mean rate
        y, yd = point
        found = self._restart.struck(t + time, y + time * yd, yd)
        # a flow that begins at rest moves by time^2 alone; a gap that such a move closes is another event's
        straight = self._restart.settler.system.are("q")
        mean = yd if found is None else np.where(straight, yd, 0.5 * (yd + found[1]))
        try:
            self.determined.fit(t + time, y + time * mean, yd, once(self.contacts, quickly))
        except NoActiveSetError:
            return None
        found = self._restart.struck(t, y, yd) if self.contacts.state() != stood else None
        return None if found is None else (found[0], found[1])

    def _strike(self, t: float, y: Floats, yd: Floats, aims: Floats) -> Point:
        try:
            return self._restart.instant.flows(t, y, yd, self._restart.magnitude(y.size), aims)
        except NotFiniteError as error:
            raise SolverFailure("nonfinite", t, 0.0) from error
        except UnbalancedError as error:
            raise self._restart.failure(t, error) from error

    def _guards(self, t: float, y: Floats, yd: Floats) -> None:
        self.contacts.obey(self.observer(t, y, yd))
        self.contacts.apply()
