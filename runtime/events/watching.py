"""What ends a smooth piece: what is watched of one run, when it changes first, when the next sample is."""

from __future__ import annotations

from typing import Any

import numpy as np
from sysdyn.runtime.events.bounces import Bounce
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.kinks import Kinks
from sysdyn.runtime.events.locate import Dense, crossing
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

BOUNDED = ("friction", "planar")
"""Kinds of contacts with a bound, below which no effort is within it."""
NOTHING = 1e-12
"""Of the span: no time."""
FALLEN = 1e-4
"""Of what else counts as zero, and of the height of its flight: a gap that an impact opened closes again below it."""


@dataclass(frozen=True, slots=True)
class Watched:
    """A row of block observe on the side 1 or -1 of zero; relation, contact or kink: whose it is, the others -1."""

    relation: int
    contact: int
    row: int
    side: int
    kink: int = -1


class Watching:
    """side [relations]: 1 or -1 of zero, 0 on neither; bounces: by rows, gaps that an impact opened."""

    def __init__(self, plan: Plan, system: System, span: tuple[float, float]) -> None:
        self.plan, self.system, self.span = plan, system, span
        self.p, self.nothing = system.description.p, NOTHING * (span[1] - span[0])
        self.observer = Observer(system)
        self.contacts = Contacts(plan, system, self.observer, self.p)
        self.kinks = Kinks(plan.kinks, self.observer, self.p)
        self.side = np.ones(len(plan.relations))
        self.bounces: dict[int, Bounce] = {}
        self.next = np.zeros(max(len(plan.sampled), 1), dtype=np.int64)

    def watched(self) -> list[Watched]:
        """Everything whose change ends a piece: a relation on neither side yet is watched on both."""
        found: list[Watched] = []
        for k, (r, side) in enumerate(zip(self.plan.relations, self.side, strict=True)):
            if r.moves:
                found += [Watched(k, -1, r.row, s) for s in ((int(side),) if side else (1, -1))]
        for k, c in enumerate(self.plan.contacts):
            sticks = bool(self.contacts.active[k])
            if self.contacts.barred[k] or k in self.contacts.frozen:
                continue
            if c.kind == "friction":
                rows = ((c.upper, 1), (c.lower, 1)) if sticks else ((c.value, int(self.p[c.sense]) or 1),)
                found += [Watched(-1, k, row, side) for row, side in rows]
            elif c.kind == "planar":
                found.append(Watched(-1, k, c.upper if sticks else c.value, 1))
            elif c.kind in ("phi", "psi"):
                found.append(Watched(-1, k, c.multiplier if sticks else c.value, 1))
            if c.moves and c.kind in BOUNDED:
                found.append(Watched(-1, k, c.bound, 1))
        for k in range(len(self.plan.kinks)):
            found += [Watched(-1, -1, row, side, k) for row, side in self.kinks.rows(k)]
        return found

    def core(self) -> Any:
        """The same as the core's array."""
        found = self.watched()
        array = (lib.Watch * max(len(found), 1))()
        for k, w in enumerate(found):
            array[k] = lib.Watch(w.row, w.side, self._least(w) - self._level(w))
        return array

    def crossed(self, dense: Dense, begin: float, end: float) -> tuple[float, list[Watched]] | None:
        """The first instant in begin..end at which something watched changes, and which; None where nothing does."""
        watched = self.watched()
        still = [self.observer.zero(self.rate(w)) * (w.row in self.bounces) for w in watched]  # let go, at rest
        rows = [(w.row, w.side, self._least(w), self.rate(w), self._level(w), still[k]) for k, w in enumerate(watched)]
        found = crossing(dense, rows, begin, end)
        return None if found is None else (found[0], [watched[k] for k in found[1]])

    def turned(self, t: float, y: Floats, yd: Floats) -> list[Watched]:
        """The relations that an instant at which the text jumps leaves on another side."""
        values = self.observer(t, y, yd)
        found = [w for w in self.watched() if w.relation >= 0]
        return [w for w in found if w.side * values[w.row] < -self.observer.zero(w.row)]

    def _least(self, watched: Watched) -> float:
        """What a watched value may fall by unseen: behind an impact nearly nothing, for bounces become small."""
        zero, bounce = self.observer.zero(watched.row), self.bounces.get(watched.row)
        return zero if bounce is None else FALLEN * min(zero, bounce.height)

    def _level(self, watched: Watched) -> float:
        """The value at which what is watched begins: that of a bounce, else zero."""
        bounce = self.bounces.get(watched.row)
        return 0.0 if bounce is None else bounce.level

    def flight(self, unseen: float) -> float:
        """Time (s) until the first bounce ends that rises less than `unseen` times the largest value of its gap."""
        low = (b.flight for row, b in self.bounces.items() if b.height < unseen * self.observer.largest[row])
        return min(low, default=np.inf)

    def rate(self, watched: Watched) -> int:
        """The row of the rate of what is watched, where there is one."""
        if watched.kink >= 0:
            kink = self.plan.kinks[watched.kink]
            return kink.rate if watched.row == kink.value else -1
        if watched.contact < 0:
            return -1
        contact = self.plan.contacts[watched.contact]
        return contact.rate if watched.row == contact.value else -1

    # -- samples -------------------------------------------------------------------------------------------------

    def next_sample(self) -> float:
        """The next instant of an `every`."""
        t0 = self.span[0]
        times = (t0 + n * s.period for n, s in zip(self.next.tolist(), self.plan.sampled, strict=False))
        return min(times, default=np.inf)

    def due(self, t: float) -> list[int]:
        """Numbers of the samples at t (one instant by two formulas is one), which are counted."""
        found = []
        for k, s in enumerate(self.plan.sampled):
            while self.span[0] + int(self.next[k]) * s.period <= t + self.nothing:
                self.next[k] += 1
                found.append(k)
        return list(dict.fromkeys(found))
