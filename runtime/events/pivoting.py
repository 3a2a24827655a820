"""An active set that fits: complementarity over all constraints that hold at times at once.

A guess of the active set gives flows (impulses in the metric of the inertia where they must jump) and, by the settled
rows, rates and multipliers; the first condition that does not hold (contacts.py), in the order written, changes its
member, and so on (Murty's least-index principal pivoting, which ends for a positive definite matrix and is watched for
cycles).  Of one-way flows alone, where that runs in a circle or a set contradicts itself, an implicit step says which
set is next (implicit.py).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import chain, combinations, islice

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.implicit import Implicit
from sysdyn.runtime.model.description import Floats

NEAR, BESIDE = 3, 60
"""Members that change at once, and trials, where an active set contradicts itself."""
MANY = 2
"""Diodes that change at once, at least: fewer are turned one by one."""
TRIALS = 20
"""Trials a contact, beside TRIALS for all."""
AHEAD = tuple(10.0**-k for k in range(7, 2, -1))
"""Of the time in which the unknowns change: how long an implicit step is that tells active sets apart, the shortest
first: what leaks decide about is behind it, what has moved else is less than an error.
"""
VISITS = 3
"""Of one set from one point: it is the third time that what was tried in between leads back."""

Settle = Callable[[float, Floats, Floats], tuple[Floats, Floats, Floats] | None]
"""t, y, yd -> y, yd consistent with the active set and the impulses [unknowns] that took the flows there; None: no
such point was found."""

Point = tuple[Floats, Floats]


def once(contacts: Contacts, settle: Settle) -> Settle:
    """`settle` asked once for each active set and point: ways that lead back find what was found there. Of one that
    does nothing but answer.
    """
    known = dict[tuple[float, tuple[float, ...], bytes, bytes], tuple[Floats, Floats, Floats] | None]()

    def asks(t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats, Floats] | None:
        key = t, contacts.state(), y.tobytes(), yd.tobytes()
        if key not in known:
            known[key] = settle(t, y, yd)
        return known[key]

    return asks


class NoActiveSetError(Exception):
    """No set of constraints fits; names: of those that kept changing."""

    def __init__(self, names: tuple[str, ...]) -> None:
        super().__init__(", ".join(names))
        self.names = names


class Pivoting:
    """Of a model's contacts.  singular: whether the equations with the present active set depend on each other."""

    def __init__(self, contacts: Contacts, singular: Callable[[float, Floats, Floats], bool]) -> None:
        self.contacts, self.singular = contacts, singular
        self._contradicts: set[tuple[float, ...]] = set()  # of the point that was asked last
        self._asked: tuple[float, Floats] | None = None
        self._flows = not contacts.starting and any(c.kind == "psi" for c in contacts.contacts)

    def fit(self, t: float, y: Floats, yd: Floats, settle: Settle) -> Point:
        """A consistent point whose active set fits, from the present one; NoActiveSetError."""
        self.contacts.reversed.clear()
        before, turned = (self.contacts.active.copy(), self.contacts.p.copy()), dict[int, set[bool]]()
        # one-way flows alone first: the cheap way
        found = self._among_flows(t, y, yd, settle) if self._flows else None
        if found is not None:
            return found
        self.contacts.active[:], self.contacts.p[:] = before
        self.contacts.reversed.clear()
        try:
            return self._pivot(t, y, yd, settle, turned)
        except NoActiveSetError:
            # those that turned both ways: zero may be their value
            self.contacts.open = frozenset(k for k, ways in turned.items() if len(ways) > 1)
            if not self.contacts.open:
                raise
        self.contacts.active[:], self.contacts.p[:] = before
        try:
            return self._pivot(t, y, yd, settle, turned)
        finally:
            self.contacts.open = frozenset()

    @cached_property
    def _implicit(self) -> Implicit:
        return Implicit(self.contacts, self.contacts.system.another("3"))

    def _among_flows(self, t: float, y: Floats, yd: Floats, settle: Settle) -> Point | None:
        """A consistent point where one-way flows alone turn; None: neither turning them nor a short implicit step finds
        it.
        """
        contacts, p, known = self.contacts, self.contacts.p.copy(), self.contacts.observer.largest.copy()
        turned = contacts.active.copy()
        try:
            return self._pivot(t, y, yd, settle, {}, once=True)
        except NoActiveSetError:
            contacts.p[:] = p
        # behind a short implicit step, then a longer one
        for later in AHEAD:
            contacts.active[:] = turned
            told = self.ahead(t, y, later * contacts.time)
            # rows hold only nearly: from its point, where what leaks decide about has moved for it
            for begin in () if told is None else (y, told):
                found = settle(t, begin, yd)
                if found is not None and contacts.fits(t, begin, found):
                    return found[:2]
                contacts.observer.largest[:] = known
        return None

    def ahead(self, t: float, y: Floats, h: float, at: float | None = None) -> Floats | None:
        """The point behind an implicit step of h (s), whose active set then is that of the model; at: the instant whose
        rows hold (None: at its end).
        """
        self.contacts.apply()
        # the step's own complementarity problem
        told = self._implicit.after(t + h if at is None else at, y, h)
        if told is None:
            return None
        self.contacts.active[:] = told[0]
        self.contacts.apply()
        return told[1]

    def _pivot(
        self, t: float, y: Floats, yd: Floats, settle: Settle, turned: dict[int, set[bool]], *, once: bool = False
    ) -> Point:
        """A consistent point by turning contacts that are wrong; turned: those that were turned, and whether they held;
        once: no set is tried twice, nor beside one that contradicts itself.
        """
        seen = Counter[tuple[float, ...]]()
        changed: list[int] = []
        fewest = len(self.contacts.contacts)
        block: tuple[NDArray[np.bool_], int, Floats] | None = None
        self.contacts.finite(t, y, yd)
        known = self.contacts.observer.largest.copy()
        # principal pivoting: turn what is wrong until nothing is
        for _ in range(TRIALS * (1 + len(self.contacts.contacts))):
            self.contacts.apply()
            state = self.contacts.state()
            again = state in seen
            seen[state] += 1
            # been here too often: a circle
            if seen[state] > (1 if once else VISITS):
                break
            found = self._settled_by(t, y, yd, settle)
            if found is None and block is not None:  # sources that they short: one of them alone
                self.contacts.active[:], (_, first, values), block, fewest = block[0], block, None, 0
                self.contacts.turn(first, values)
                continue
            found = found or (None if once else self._near_point(t, y, yd, settle, seen))
            if found is None:
                break
            # of a set that does not hold no size stays: where it has no rank its multipliers are without bound
            self.contacts.observer.largest[:] = known
            values = self.contacts.observer(t, found[0], found[1])
            struck = self.contacts.impulses(y, found)
            wrong = sorted({*self.contacts.wrongs(values, struck), *self.contacts.backwards(t, y, found)})
            if not wrong:
                return found[0], found[1]
            if again:  # driven back by either sense: it does not go through where other constraints hold than before
                self.contacts.through.difference_update(wrong)
            if again and self._done(t, wrong, y, found):  # from behind their impulses on
                y, yd = found[:2]
                seen.clear()
            # diodes all at once while they become fewer (Judice and Pires 1994), else the first
            several = MANY < len(wrong) < fewest and all(self.contacts.contacts[k].kind == "psi" for k in wrong)
            block = (self.contacts.active.copy(), wrong[0], values) if several else None
            fewest = min(fewest, len(wrong))
            another = (seen[state] - 1) % len(wrong)  # where the first leads back
            # the first, or all where they are many
            for k in wrong if several else wrong[another : another + 1]:
                turned.setdefault(k, set()).add(bool(self.contacts.active[k]))
                changed.append(k)
                self.contacts.turn(k, values)
        self.contacts.observer.largest[:] = known
        contacts = self.contacts.contacts
        names = dict.fromkeys(contacts[k].name for k in changed[-6:] or range(min(len(contacts), 6)))
        raise NoActiveSetError(tuple(names))

    def _done(self, t: float, wrong: Sequence[int], y: Floats, found: tuple[Floats, Floats, Floats]) -> bool:
        """Whether impulses have done what these inequalities are wrong by: one of effort has stopped what closed, and
        nothing holds it afterwards; one of flow has passed, and nothing goes on.
        """
        # gaps and frictions do not end with an impulse
        if any(self.contacts.contacts[k].kind != "psi" for k in wrong):
            return False
        held = [k for k in wrong if self.contacts.active[k]]
        # one that holds has stopped what closed
        if any(found[2][self.contacts.multiplier[k]] <= 0.0 for k in held):
            return False
        # one that lets go was passed
        passed = self.contacts.passed_impulses(t, y, found)
        return all(passed[k] > 0.0 for k in wrong if not self.contacts.active[k])

    def _near_point(
        self, t: float, y: Floats, yd: Floats, settle: Settle, seen: Counter[tuple[float, ...]]
    ) -> tuple[Floats, Floats, Floats] | None:
        """Where the active set contradicts itself (a source that two diodes short): the point of a near one, not seen
        yet, that does not: the first that fits, else the first; the active set then is that.
        """
        before, stood, first = self.contacts.active.copy(), self.contacts.state(), None
        # nearest sets first
        for turned in self._near(before):
            self.contacts.become(stood)
            self.contacts.active[list(turned)] = ~before[list(turned)]
            # a friction turned: its sense is what it was
            for k in (k for k in turned if self.contacts.contacts[k].kind == "friction"):
                self.contacts.p[self.contacts.contacts[k].sense] = float(before[k])
                self.contacts.through.update([k] if before[k] else [])
            self.contacts.apply()
            # singular, or seen: no use
            open_ = len(turned) <= NEAR and self.singular(t, y, yd)
            if open_ or self.contacts.state() in seen:
                continue
            found = self._settled_by(t, y, yd, settle)
            # fits: taken at once
            if found is not None and self.contacts.fits(t, y, found):
                return found
            # consistent: kept in case none fits
            if found is not None and first is None:
                first = found, self.contacts.state()
        if first is None:
            return None
        self.contacts.become(first[1])
        seen[self.contacts.state()] += 1
        return first[0]

    def _near(self, before: NDArray[np.bool_]) -> Iterator[Sequence[int]]:
        """Which to turn, the fewest first, inequalities that do not hold before those that do and frictions; where no
        inequality holds, all of them before.
        """
        contacts, frozen = self.contacts.contacts, self.contacts.frozen
        # inequalities that are free to turn
        free = [k for k, c in enumerate(contacts) if c.kind in ("phi", "psi") and k not in frozen]
        rest = [k for k in free if not before[k]]
        order = rest + [k for k in free if before[k]] + [k for k, c in enumerate(contacts) if c.kind == "friction"]
        nearest = (c for number in range(1, NEAR + 1) for c in combinations(order, number))
        # none holds: all at once first
        if rest == free:
            return islice(chain([rest], nearest), BESIDE)
        return chain(islice(nearest, BESIDE), [rest] if rest else [])

    def _settled_by(self, t: float, y: Floats, yd: Floats, settle: Settle) -> tuple[Floats, Floats, Floats] | None:
        """As settle; a set whose equations depend on each other, and that contradicted itself, is not tried again from
        that point.  From another it may not: two diodes short a source but where that is zero, and where all block a
        coil beside them has no current.
        """
        # another point: what contradicted itself may not
        if self._asked is None or self._asked[0] != t or not np.array_equal(self._asked[1], y):
            self._asked = t, y.copy()
            self._contradicts.clear()
        key = self.contacts.state()
        # contradicted itself at this point before
        if key in self._contradicts:
            return None
        found = settle(t, y, yd)
        # depends on itself and has no point: remembered
        if found is None and self.singular(t, y, yd):
            self._contradicts.add(key)
        return found
