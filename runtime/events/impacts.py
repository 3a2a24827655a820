"""Impacts: impulses where gaps close, by Newton's law.

    impulse >= 0,  flow+ >= aim,  one of both with equality;  aim = -restitution flow of a gap that closes, else 0

of all gaps that are closed and of all one-way flows at once.  That is the least change of the flows in the metric of
the inertia under flow+ >= aim; the active set grows by what is violated most and gives up what would pull (Lawson and
Hanson 1974, chapter 23), so that it never says anything twice.  Aims that contradict each other, in a closed chain of
contacts, or that would make energy are zero.  Dry friction gives way: a finite effort has no impulse, unless a reaction
tells its bound.  Then it has one within the bound that the impulses tell (Coulomb's law).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.pivoting import TRIALS, NoActiveSetError
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.held_rows import multiplier_row
from sysdyn.runtime.model.system import System

UNSEEN = 16.0 * float(np.finfo(float).eps)
"""Of the terms of a gap: a flight lower than that."""

FED = tuning.SMALL
"""Of the work of impulses there and back: more than round-off, and than flows miss their aims by."""

Strike = Callable[[float, Floats, Floats, Floats], tuple[Floats, Floats]]
"""t, y, yd, aims [rows of the system that finds impulses] -> y after impulses that bring the flow rows to their aims;
the impulses [unknowns].
"""


class _Struck(NamedTuple):
    """What impulses of some contacts make: y and values behind them, the impulses [contacts], how far the flows are
    from their aims, in zeros of theirs, and which impulses pull; whole: all impulses [unknowns].
    """

    struck: list[int]
    y: Floats
    values: Floats
    impulses: Floats
    whole: Floats
    off: dict[int, float]
    pulls: list[int]

    @property
    def contradicts(self) -> bool:
        """Whether it does not do what it says: the same flows are asked for twice."""
        return any(abs(self.off[k]) > 1.0 for k in self.struck)

    @property
    def fits(self) -> bool:
        """Whether all impulses push and their aims are met."""
        return not self.pulls and not self.contradicts


class _Blow(NamedTuple):
    """An instant: t, y, yd before it, how impulses are found and in whose rows, the aims of the flows of the contacts
    that take part.
    """

    point: tuple[float, Floats, Floats]
    strike: Strike
    system: System
    aim: dict[int, float]


class Impacts:
    """The impacts of a run.  rest: see plan.Plan; fastest [contacts]: speed at which each gap closed at most; closed:
    the gaps that did at last.
    """

    def __init__(self, contacts: Contacts, rest: float) -> None:
        self.contacts, self.rest = contacts, rest
        self.closed: list[int] = []
        self.fastest = np.zeros(len(contacts.contacts))

    def after(self, t: float, y: Floats, yd: Floats, strike: Strike, system: System, *, blow: bool) -> Floats:
        """Y after the impacts of the gaps that close, or after a blow; the active set is then that of the impulses.

        system: in whose rows `strike` takes its aims.
        """
        contacts, zero = self.contacts, self.contacts.observer.zero
        values, terms = contacts.observer(t, y, yd), contacts.observer.terms.copy()
        # contacts whose gaps are closed
        near = [k for k in range(len(contacts.contacts)) if k not in contacts.frozen and self._near(k, values)]
        speed = {k: float(values[self._flow(k)]) for k in near if contacts.contacts[k].kind == "phi"}
        # of these, the gaps that close
        closing = self.closed = [k for k in speed if speed[k] < -zero(self._flow(k))]
        # neither impact nor blow
        if not (closing or (blow and near)):
            return y
        aim = dict.fromkeys(near, 0.0)
        # Newton's law: the speed behind is -e times that before
        for k in closing:
            c, back = contacts.contacts[k], -contacts.contacts[k].restitution * speed[k]
            self.fastest[k] = max(self.fastest[k], -speed[k])
            # what rises less than round-off of its gap cannot be told from rest
            risen = back * back > -2.0 * values[c.acceleration] * UNSEEN * terms[c.value]
            aim[k] = back if risen and back > max(self.rest * self.fastest[k], zero(c.rate)) else 0.0
        # frictions of a finite bound bear no impulse
        for k in contacts.finite(t, y, yd):
            if contacts.active[k]:
                contacts.slip(k, 0.0)
        found = self._among_frictions(_Blow((t, y, yd), strike, system, aim))
        # energy out of nothing: once more without bouncing
        if self._feeds(found, values):
            aim = dict.fromkeys(near, 0.0)
            found = self._among_frictions(_Blow((t, y, yd), strike, system, aim))
        # those that stay closed hold
        for k in near:
            contacts.active[k] = aim[k] == 0.0 and found.values[self._flow(k)] <= zero(self._flow(k))
        contacts.apply()
        return found.y

    def _feeds(self, found: _Struck, before: Floats) -> bool:
        """Whether the impulses do work, as those of several gaps may by Newton's law: what a wall gives back to a ball
        it gives to another one that just left it too.
        """
        flows = [self._flow(k) for k in range(found.impulses.size)]
        given, speeds = found.impulses, np.stack([before[flows], found.values[flows]])
        return bool(given @ speeds.sum(axis=0) > FED * (given @ np.abs(speeds).sum(axis=0)))

    def _near(self, k: int, values: Floats) -> bool:
        """Whether an impulse may come of a contact: a gap that is closed, whatever flow an inequality may stop."""
        c, contacts = self.contacts.contacts[k], self.contacts
        closed = c.kind == "phi" and (contacts.active[k] or values[c.value] <= contacts.observer.zero(c.value))
        return bool(closed or c.kind == "psi") and not contacts.bar(k, values)

    def _flow(self, k: int) -> int:
        """The row of the flow that an impulse changes."""
        contact = self.contacts.contacts[k]
        return contact.rate if contact.kind == "phi" else contact.value

    def _among_frictions(self, blow: _Blow) -> _Struck:
        """Behind the impulses, those of friction among them whose bound they tell (Coulomb's law): it stops what it
        would turn back, and slides where holding needs more than its bound.
        """
        contacts = self.contacts
        # frictions whose bound is told by reactions take part in the impulse
        told = [k for k, c in enumerate(contacts.contacts) if c.kind == "friction"]
        told = [k for k in told if k not in contacts.finite(*blow.point)]
        for _ in range(TRIALS * (1 + len(told))):
            found = self._struck(blow)
            # one after the other until all fit Coulomb's law
            k = next((k for k in told if self._gives_wrong(k, found, blow)), None)
            if k is None:
                return found
            held = contacts.active[k]
            # from sticking to a slip, or back
            contacts.slip(k, float(np.sign(self._impulse(k, found, blow)[0])) if held else 0.0)
            contacts.active[k] = not held
        # frictions that turn without end
        raise NoActiveSetError(tuple(contacts.contacts[k].name for k in told))

    def _gives_wrong(self, k: int, found: _Struck, blow: _Blow) -> bool:
        """Whether a friction that holds has more than its bound, or one that slides has turned back."""
        contacts, contact = self.contacts, self.contacts.contacts[k]
        # slides: not backwards
        if not contacts.active[k]:
            slip = float(contacts.p[contact.sense]) * found.values[contact.value]
            return bool(slip < -contacts.observer.zero(contact.value))
        # sticks: within its bound
        impulse, bound = self._impulse(k, found, blow)
        return bool(abs(impulse) > bound + contacts.impulse(contact))

    def _impulse(self, k: int, found: _Struck, blow: _Blow) -> Floats:
        """What a friction that holds has given, and its bound: both are linear in impulses."""
        contact, (t, y, yd), system = self.contacts.contacts[k], blow.point, self.contacts.system
        reactions = system.are("kappa", "mu", "e")[: y.size]
        values = [system.observe(t, np.where(reactions, given, y), yd) for given in (found.whole, 0.0 * y)]
        return np.subtract(*values)[[contact.multiplier, contact.bound]]

    def _struck(self, blow: _Blow) -> _Struck:
        """Behind the impulses of inequalities, with the frictions that hold as they are."""
        aim, of = blow.aim, partial(self._effect_of, blow)
        now, seen = of([]), set[frozenset[int]]()
        had = now.impulses
        # complementarity over impulses, by turning one at a time
        for _ in range(TRIALS * (1 + len(aim))):
            if now.pulls:  # as far on the way as none does: what comes to nothing there is let go
                part = {k: had[k] / (had[k] - now.impulses[k]) for k in now.pulls}
                first = min(part, key=part.__getitem__)
                had = had + part[first] * (now.impulses - had)
                now = of([k for k in now.struck if k != first])
                continue
            # none pulls: impulses so far are the best known
            had = np.maximum(now.impulses, 0.0)
            worst = max(now.off, key=now.off.__getitem__)
            # all part as they should
            if now.off[worst] <= 1.0:
                return now
            before, now = now, of([*now.struck, worst])
            if now.contradicts:  # what is said by others already takes the place of one of them
                instead = {j: of([*(k for k in before.struck if k != j), worst]) for j in before.struck}
                # those that cannot strike together with the worst
                jammed = [worst, *(j for j, one in instead.items() if not one.contradicts)]
                now = next((one for one in instead.values() if one.fits and frozenset(one.struck) not in seen), now)
                seen.add(frozenset(now.struck))
                if now.contradicts and any(aim[k] > 0.0 for k in jammed):  # a closed chain: nothing can part there
                    return self._struck(blow._replace(aim=aim | dict.fromkeys(jammed, 0.0)))
        # no set of impulses fits
        raise NoActiveSetError(tuple(self.contacts.contacts[k].name for k in aim))

    def _effect_of(self, blow: _Blow, struck: list[int]) -> _Struck:
        """What impulses of these alone make."""
        contacts, zero = self.contacts, self.contacts.observer.zero
        point, aim = blow.point, blow.aim
        # these strike, the others not
        for k in aim:
            contacts.active[k] = k in struck
        contacts.apply()
        y, impulses = blow.strike(*point, self._aims(blow, struck))
        values, now = contacts.observer(point[0], y, point[2]), impulses[contacts.multiplier]
        # how far each is from the speed it should have
        off = {k: (aim[k] - values[self._flow(k)]) / zero(self._flow(k)) for k in aim}
        # strikes that would have to pull
        pulls = [k for k in struck if now[k] < -contacts.impulse(contacts.contacts[k])]
        own = np.where(np.isin(np.arange(now.size), struck), now, 0.0)
        return _Struck(struck, y, values, own, impulses, off, pulls)

    def _aims(self, blow: _Blow, struck: list[int]) -> Floats:
        """What the rows phi_rate shall be: -value' there."""
        system, aim = blow.system, blow.aim
        aims = np.zeros(system.rows)
        first = {(group, family): row for group, family, row in system.form.groups}
        # only gaps that bounce aim at a speed
        for k in (k for k in struck if aim[k] > 0.0):
            family, position = self.contacts.switches.places[self.contacts.contacts[k].number]
            row = first["phi_rate", multiplier_row(system.description, family)] + position
            aims[row] = -aim[k]
        return aims
