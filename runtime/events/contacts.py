"""What each constraint that holds at times asks for, and whether it stands as it may.

    phi, psi     value >= 0,  multiplier >= 0,  their product 0
    friction     abs(multiplier) <= bound where value = 0;  else the effort bound*sense, sense = sign(value)

Sets that fit are found by pivoting.py; gaps that close are struck before (impacts.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.events.inequalities import BEYOND, BODIES, Inequalities
from sysdyn.runtime.events.mates import mates
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.plan import Contact, Plan
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.held_rows import switch_rows
from sysdyn.runtime.model.system import System

FAINT = tuning.SMALL
"""Of the magnitude of an unknown."""
UNTOLD = tuning.SAME
"""Change of a bound by reactions of one that is round-off."""

BESIDE = 1e-20
"""m/s and the like: a flow in the plane that is no flow yet, and has a direction."""
WIDER = 4.0
"""Times that flow, where steps leave more open of the speed than it covers."""
SHORTEST = 1e-150
"""Seconds; the square of less is no double."""
EDGE = 2.0
"""Times what is zero of a flow: within it is what an event is located by, and what a step ends beyond."""


Standing = tuple[NDArray[np.bool_], NDArray[np.bool_]]
"""Which hold, and whose sense is upwards [contacts]."""


class Contacts:
    """The active set and the senses of a model; p: its parameters, where senses stand; starting: a start is sought."""

    def __init__(self, plan: Plan, system: System, observer: Observer, p: Floats, *, starting: bool = False) -> None:
        self.contacts = contacts = plan.contacts
        self.starting = starting
        self.system, self.observer, self.p = system, observer, p
        self.switches = system.description.switches
        self.active: NDArray[np.bool_] = np.zeros(len(contacts), dtype=bool)
        self.barred: NDArray[np.bool_] = np.zeros(len(contacts), dtype=bool)
        self._finite: frozenset[int] | None = None
        # wrong open and closed (pivoting.py): zero of its value is none of its multiplier, any value above zero is open
        self.open: frozenset[int] = frozenset()
        self.through: set[int] = set()  # frictions whose value goes through zero
        self.reversed: set[int] = set()  # those that have turned back, as long as one active set is sought
        # idle ones that stand against their guard, for something would be open else (determined.py)
        self.spared: frozenset[int] = frozenset()
        self.time = 0.0
        self.resolution = 0.0  # the tolerance of the steps, of the largest flows
        places = self.switches.places
        # values of one kind and unit are measured by the largest of them
        kinds = {(c.kind, observer.unit(c.value)) for c in contacts}
        for kind in sorted(kinds):
            same = [c for c in contacts if (c.kind, observer.unit(c.value)) == kind]
            for name in ("value", "rate"):
                observer.alike([getattr(c, name) for c in same])
            # what friction bears is of the size of its bound, before it has ever held too
            observer.alike([row for c in same for row in (c.multiplier, c.bound) if row >= 0])
        # a contact has a multiplier where it is a switch, none where a relation holds it
        own = [places[k.number] if k.hold < 0 else None for k in contacts]
        self.multiplier = [-1 if at is None else int(system.form.at[at[0]]) + at[1] for at in own]
        self.frozen = mates(plan, system, self.multiplier)
        # parameters that say the sense of a friction, and whether a relation holds
        self._sensed, self._sense = _places((k, c.sense) for k, c in enumerate(contacts))
        self._kept, self._hold = _places((k, c.hold) for k, c in enumerate(contacts))
        self._switched, self._number = _places((k, c.number if c.hold < 0 else -1) for k, c in enumerate(contacts))
        self._follow = np.array([k for k, c in enumerate(contacts) if c.kind == "follows"], dtype=np.int64)
        self._inequalities = Inequalities(contacts, self.multiplier, self.frozen)

    def size(self, magnitude: Floats, time: float) -> None:
        """Least sizes of values, rates and multipliers: FAINT of those of the unknowns (magnitude [unknowns]) and of a
        change of them in `time` (s), so that noise is no size where nothing has happened yet.
        """
        self.time = time = max(time, SHORTEST)
        kinds, largest = self.system.kinds, self.observer.largest
        # gaps are displacements, one-way flows are flows
        for contact, place in zip(self.contacts, self.multiplier, strict=True):
            own = kinds == ("q" if contact.kind == "phi" else "f")
            alike = own & (self._units == self.observer.unit(contact.value))
            size = FAINT * float(magnitude[: kinds.size][alike if alike.any() else own].max(initial=0.0))
            rows = ((contact.value, size), (contact.rate, size / time), (contact.acceleration, size / time / time))
            loaded = FAINT * float(magnitude[place]) if place >= 0 else 0.0
            for row, least in (*rows, (contact.multiplier, loaded)):
                if row >= 0:
                    largest[row] = max(largest[row], least)

    @cached_property
    def _units(self) -> NDArray[np.str_]:
        """Of the unknowns."""
        families = self.system.description.families
        return np.array([families[k].unit if k >= 0 else "" for k in self.system.family_of])

    @cached_property
    def _one_way(self) -> tuple[int, ...]:
        """The inequalities of a flow that can hold."""
        return tuple(k for k, c in enumerate(self.contacts) if c.kind == "psi" and self.multiplier[k] >= 0)

    @cached_property
    def _flows(self) -> dict[int, NDArray[np.bool_]]:
        """Of each of these: the flows [unknowns as written] of the units of those in its row.  (The dual of a flow that
        the text names is an effort, and 1/s is rad/s.)
        """
        rows, _, numbers, _ = switch_rows(self.system.description, self.system.form)
        # the row in which it says that its value is zero
        column, row, flows = self.system.pattern.columns_of(), self.system.pattern.row, self.system.are("f", "s")
        found = {}
        # units of the flows in that row
        for k in self._one_way:
            own = np.zeros(self.system.rows, dtype=bool)
            own[rows[numbers == self.contacts[k].number]] = True
            units = {str(self._units[at]) for at in column[own[row]].tolist() if flows[at]}
            alike = np.array([unit in units for unit in self._units.tolist()])
            found[k] = (flows & alike)[: self.system.form.written]
        return found

    def impulses(self, y: Floats, found: tuple[Floats, Floats, Floats]) -> Floats:
        """Those that took y to what was found [unknowns as written], zero of inequalities of flows where these moved by
        no more than what is zero of one: located at its edge, a current may be stopped that is none.
        """
        struck = found[2]
        # one-way flows that hold and have stopped something
        holding = [k for k in self._one_way if self.active[k] and struck[self.multiplier[k]] < 0.0]
        if not holding:
            return struck
        struck, moved = struck.copy(), np.abs(found[0] - y)
        # zero where what it stopped was no flow
        for k in holding:
            most = moved[: self._flows[k].size][self._flows[k]].max(initial=0.0)
            if most <= EDGE * self.observer.zero(self.contacts[k].value):
                struck[self.multiplier[k]] = 0.0
        return struck

    def begin(self) -> None:
        """Nothing holds and nothing slips: where a start is sought from."""
        self.active[:], self.p[self._sense] = False, 0.0
        self.apply()

    def obey(self, values: Floats) -> None:
        """What guards say holds or is not there, whatever stood against them; values: of the observer."""
        self.spared = frozenset()
        # a guard says whether it holds at all
        for k, contact in enumerate(self.contacts):
            if contact.kind == "guarded":
                self.active[k] = bool(values[contact.guard])
            # barred: its guard says that it is not there
            elif self.bar(k, values):
                self.active[k] = False

    def take(self, switches: NDArray[np.bool_]) -> None:
        """The active set of the switches as it is given."""
        self.active[self._switched], self.active[self._kept] = switches[self._number], self.p[self._hold] != 0.0
        self.switches.set(switches)

    def apply(self) -> None:
        """The systems of the model follow the active set."""
        now = np.zeros(len(self.switches.places), dtype=bool)
        # those that mates make superfluous stand for good
        for k, holds in self.frozen.items():
            self.active[k] = holds
        # what follows a planar friction holds with it
        self.active[self._follow] = self.active[self._follow - 1]
        now[self._number], self.p[self._hold] = self.active[self._switched], self.active[self._kept]
        self.switches.set(now)

    def state(self) -> tuple[float, ...]:
        """The active set and the senses [contacts each]."""
        senses = np.zeros(len(self.contacts))
        senses[self._sensed] = self.p[self._sense]
        return tuple(np.concatenate([self.active, senses]).tolist())

    def become(self, state: tuple[float, ...]) -> None:
        """The active set and the senses as `state` gave them."""
        holds, senses = np.reshape(np.array(state), (2, len(self.contacts)))
        self.active[:], self.p[self._sense] = holds != 0.0, senses[self._sensed]
        self.apply()

    def standing(self) -> Standing:
        """What words are about: which hold, and whose sense is upwards [contacts]."""
        up = np.zeros(len(self.contacts), dtype=bool)
        up[self._sensed] = self.p[self._sense] > 0.0
        return self.active.copy(), up

    def changed_contacts(self, before: Standing) -> dict[int, tuple[str, str]]:
        """How contacts stood and stand that do otherwise, by their numbers."""
        now = self.standing()
        differ = np.flatnonzero((before[0] != now[0]) | (before[1] != now[1])).tolist()
        was, is_ = ([self.contacts[k].word(holds=bool(h[k]), up=bool(u[k])) for k in differ] for h, u in (before, now))
        return {k: (w, i) for k, w, i in zip(differ, was, is_, strict=True) if w != i}

    def word(self, k: int) -> str:
        """How a contact stands."""
        contact = self.contacts[k]
        return contact.word(holds=bool(self.active[k]), up=contact.sense >= 0 and bool(self.p[contact.sense] > 0.0))

    # -- what does not fit ---------------------------------------------------------------------------------------

    def flip(self, k: int, values: Floats) -> None:
        """The other state of a contact."""
        contact = self.contacts[k]
        self.active[k] = not self.active[k]
        # a friction that lets go slips in the sense in which it was loaded
        if contact.kind == "friction":
            self.p[contact.sense] = 0.0 if self.active[k] else np.sign(values[contact.multiplier]) or 1.0
        # in the plane: along the direction in which it was loaded
        elif contact.kind == "planar":
            self._direct(contact, values[list(contact.aim[2:4])])
            self.p[contact.sense] = 0.0 if self.active[k] else 1.0

    def slip(self, k: int, sense: float) -> None:
        """Dry friction at its bound in a sense."""
        self.active[k] = False
        self.p[self.contacts[k].sense] = sense

    def _direct(self, contact: Contact, along: Floats) -> None:
        """The direction of a slip in the plane, as a flow."""
        size = float(np.hypot(*along))
        # a slip without direction keeps the last one
        if size > 0.0:
            self.p[list(contact.direction)] = max(BESIDE, self._unresolved_speed(contact)) * along / size

    def _unresolved_speed(self, contact: Contact) -> float:
        """The speed (m/s and the like) that steps leave open of friction in the plane: of the largest terms of its
        flows, as a block on a moving table has the speed of the table.
        """
        return self.resolution * float(np.hypot(*self.observer.largest[list(contact.aim[:2])]))

    def _moves(self, contact: Contact, values: Floats) -> bool:
        """Whether the speed of friction in the plane is one."""
        speed = contact.aim[4]
        covered = float(np.hypot(*self.p[list(contact.direction)]))
        return bool(
            values[speed] > max(self.observer.zero(speed), self._unresolved_speed(contact), WIDER / 2 * covered)
        )

    def halting(self, touched: Sequence[int]) -> list[int]:
        """The contacts of those touched which slip in a plane."""
        return [k for k in touched if self.contacts[k].kind == "planar" and not self.active[k]]

    def halt(self, k: int, values: Floats) -> None:
        """A slip that comes to rest: where its flows are round-off, the law is that of those in `values`, shortly
        before.
        """
        contact = self.contacts[k]
        self.p[list(contact.direction)] = values[list(contact.aim[:2])]

    def wrong(self, values: Floats, impulses: Floats) -> int:
        """The first contact whose condition does not hold; -1 where all do."""
        return next(self.wrongs(values, impulses), -1)

    def fits(self, t: float, y: Floats, found: tuple[Floats, Floats, Floats]) -> bool:
        """Whether every condition holds at what was found (y, yd, impulses) behind y."""
        values, struck = self.observer(t, *found[:2]), self.impulses(y, found)
        return self.wrong(values, struck) < 0 and not self.backwards(t, y, found)

    def wrongs(self, values: Floats, impulses: Floats) -> Iterator[int]:
        """Contacts whose condition does not hold."""
        plain = self._inequalities
        # inequalities all at once, others one by one
        asked = np.ones(len(self.contacts), dtype=bool)
        asked[plain.number] = plain.wrong(values, impulses, self)
        asked[self._follow] = False
        asked[list(self.frozen)] = False
        for k in np.flatnonzero(asked).tolist():
            contact = self.contacts[k]
            test = _TESTS.get(contact.kind, Contacts._unilateral)
            # against its guard: wrong, but where something would be open without it
            if self.against(k, values):
                if not (k in self.spared and self.idle(k, values)):
                    yield k
            # its guard alone decides
            elif contact.kind == "guarded" or self.barred[k]:
                continue
            elif test(self, k, contact, values, self._impulse_on(k, impulses)):
                yield k

    def against(self, k: int, values: Floats) -> bool:
        """Whether a contact stands otherwise than its guard says."""
        contact = self.contacts[k]
        if contact.kind == "guarded":
            return bool(values[contact.guard]) != bool(self.active[k])
        return self.bar(k, values) and bool(self.active[k])

    def idle(self, k: int, values: Floats) -> bool:
        """Whether a contact does nothing, whatever its guard says: it bears nothing, and its value is zero."""
        rows = self.contacts[k].value, self.contacts[k].multiplier
        return all(abs(values[row]) <= self.observer.zero(row) for row in rows)

    def rests(self, k: int, values: Floats) -> bool:
        """Whether it does nothing, nor is about to: its rate is zero too."""
        rate = self.contacts[k].rate
        return self.idle(k, values) and bool(abs(values[rate]) <= self.observer.zero(rate))

    def _impulse_on(self, k: int, impulses: Floats) -> float:
        """That of a contact; of friction in the plane its size."""
        if self.multiplier[k] < 0:
            return 0.0
        own = float(impulses[self.multiplier[k]])
        return float(np.hypot(own, impulses[self.multiplier[k + 1]])) if self.contacts[k].kind == "planar" else own

    def bar(self, k: int, values: Floats) -> bool:
        """Whether the guard of an inequality says that it is not there."""
        guard = self.contacts[k].guard
        self.barred[k] = guard >= 0 and self.contacts[k].kind != "guarded" and not values[guard]
        return bool(self.barred[k])

    def _unilateral(self, k: int, c: Contact, values: Floats, impulse: float) -> bool:
        """Whether a contact is wrong as it is: one that holds pulls, or one that is open closes."""
        zero = self.observer.zero
        # one that holds: it must not pull
        if self.active[k]:
            return bool(impulse < -self.impulse(c) or values[c.multiplier] < -zero(c.multiplier))
        # open: above zero nothing is wrong
        if values[c.value] > (0.0 if k in self.open else zero(c.value)):
            return False
        # far below zero: what a step has missed
        if c.kind == "phi" and values[c.value] < -self._beyond(c):
            return True
        # a one-way flow that is negative, or begins to be
        if c.kind == "psi":
            return bool(values[c.value] < -zero(c.value) or values[c.rate] < -zero(c.rate))
        # a gap at zero closes by its speed, or at rest by its acceleration
        closing = values[c.rate] < -zero(c.rate)
        return bool(closing or (values[c.rate] <= zero(c.rate) and values[c.acceleration] < -zero(c.acceleration)))

    def _beyond(self, c: Contact) -> float:
        """How much less than nothing a gap cannot be, whatever it does next; one caught in flight is so by little."""
        return self.observer.zero(c.value) if self.starting else BEYOND * float(self.observer.largest[c.value])

    def impulse(self, c: Contact) -> float:
        """Below it an impulse is zero: that of a multiplier over the time in which things change, and what takes a flow
        that is zero to nothing, by the inertia that the largest multipliers and rates tell.
        """
        flow, change = (c.rate, c.acceleration) if c.kind == "phi" else (c.value, c.rate)
        # by inertia: what a multiplier of the largest size stops in a unit of time
        zero, largest = self.observer.zero, self.observer.largest
        stops = BODIES * zero(flow) / largest[change] if largest[change] > 0.0 else 0.0
        return max(zero(c.multiplier) * self.time, float(stops * largest[c.multiplier]))

    def _friction(self, k: int, c: Contact, values: Floats, impulse: float) -> bool:
        """Whether friction is wrong as it is: what sticks is beyond its bound, or what slides turns back."""
        zero, sense = self.observer.zero, float(self.p[c.sense])
        if values[c.bound] == 0.0:  # no friction: it does not hold, whatever holds the bodies (a latch, another law)
            return bool(self.active[k] or sense == 0.0)
        # sticks: within its bound
        if self.active[k]:
            beyond = abs(values[c.multiplier]) > values[c.bound] + zero(c.multiplier)
            return bool(beyond or self._is_overstrained(k, impulse))
        # neither sticks nor slips: a sense is to be chosen
        if sense == 0.0:
            return True
        # slips: not back, nor about to turn back
        slip = sense * values[c.value]
        return bool(slip < -zero(c.value) or (slip <= zero(c.value) and sense * values[c.rate] < -zero(c.rate)))

    def finite(self, t: float, y: Floats, yd: Floats) -> frozenset[int]:
        """The frictions whose bound no reaction tells: no impulse is within it."""
        if self._finite is None:
            # the bound with other reactions: one that does not change is known beforehand
            reactions = self.system.are("kappa", "mu", "e")[: y.size]
            bounds = [self.system.observe(t, np.where(reactions, y + s, y), yd) for s in (-1.0, 0.0, 1.0)]
            frictions = (k for k, c in enumerate(self.contacts) if c.kind in ("friction", "planar"))
            self._finite = frozenset(k for k in frictions if np.ptp([self._bound(k, b) for b in bounds]) <= UNTOLD)
        return self._finite

    def _is_overstrained(self, k: int, impulse: float) -> bool:
        """Whether friction that holds takes an impulse, which it has not got."""
        return bool(self._finite and k in self._finite and abs(impulse) > self.impulse(self.contacts[k]))

    def _bound(self, k: int, values: Floats) -> float:
        """What a friction holds at most."""
        c = self.contacts[k]
        return float(values[c.bound] if c.kind == "friction" else values[c.upper] + np.hypot(*values[list(c.aim[2:4])]))

    def _planar(self, k: int, c: Contact, values: Floats, impulse: float) -> bool:
        zero = self.observer.zero
        # sticks: within its bound, in any direction
        if self.active[k]:
            return bool(values[c.upper] < -zero(c.multiplier) or self._is_overstrained(k, impulse))
        # slips without direction
        if self.p[c.sense] == 0.0:
            return True
        # slips: its speed has not turned back
        return bool(values[c.value] < 0.0 or (not self._moves(c, values) and values[c.rate] < -zero(c.rate)))

    def passed_impulses(self, t: float, y: Floats, found: tuple[Floats, Floats, Floats]) -> Floats:
        """Impulses of flow [contacts]: what passed inequalities of flows where displacements jumped; none at a start,
        where they are sought.
        """
        form, passed = self.system.form, np.zeros(len(self.contacts))
        moved = (found[0] - y)[form.k_q]
        # at a start impulses are sought, not known
        if self.starting or not moved.any():
            return passed
        # flows that the jump of displacements makes, and none
        still = found[0].copy()
        still[form.k_f] = 0.0
        flowing = still.copy()
        flowing[form.k_f] = moved
        rows = [c.value for c in self.contacts]
        both = (self.system.observe(t, point, found[1])[rows] for point in (flowing, still))
        # what passed a gap is no flow
        return np.asarray(np.where([c.kind == "psi" for c in self.contacts], np.subtract(*both), 0.0))

    def backwards(self, t: float, y: Floats, found: tuple[Floats, Floats, Floats]) -> list[int]:
        """Open inequalities of flows through which an impulse went backwards."""
        passed, zero = self.passed_impulses(t, y, found), self.observer.zero
        least = [-zero(c.value) * self.time for c in self.contacts]
        return [int(k) for k in np.flatnonzero((passed < least) & ~self.active & ~self.barred)]

    def turn(self, k: int, values: Floats) -> None:
        """What a wrong contact becomes: a friction that slips without a sense takes that of its speed."""
        contact = self.contacts[k]
        # a planar friction that slips the wrong way takes the direction of its speed
        if contact.kind == "planar" and not self.active[k]:
            if self._moves(contact, values):
                self._direct(contact, values[list(contact.aim[:2])])
                self.p[contact.sense] = 1.0
                return
            # or widens what is covered, for it goes on
            if self.p[contact.sense] != 0.0 and values[contact.rate] >= -self.observer.zero(contact.rate):
                self.p[list(contact.direction)] *= WIDER  # it slips on: what steps leave open has turned it
                return
        slips = contact.kind == "friction" and not self.active[k]
        # it goes through zero: the other sense
        if slips and k in self.through:
            self.p[contact.sense] = -self.p[contact.sense] or np.sign(values[contact.rate]) or 1.0
            return
        # moves with the wrong sense: that of its speed, once
        if slips and abs(values[contact.value]) > self.observer.zero(contact.value) and k not in self.reversed:
            if self.p[contact.sense] != 0.0:
                self.reversed.add(k)
            self.p[contact.sense] = np.sign(values[contact.value])
            return
        # all others: hold or let go
        self.flip(k, values)


_TESTS = {"friction": Contacts._friction, "planar": Contacts._planar}


def _places(pairs: Iterable[tuple[int, int]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The numbers of contacts that have a place, and the places."""
    found = [pair for pair in pairs if pair[1] >= 0]
    numbers, places = np.array(found, dtype=np.int64).reshape(len(found), 2).T
    return numbers, places
