"""What ends a smooth piece: what is watched of one run, when it changes first, when the next sample is."""

from __future__ import annotations

from typing import Any

import numpy as np
from sysdyn.runtime import _core, tuning
from sysdyn.runtime.events.bounces import Bounce
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.kinks import Kinks
from sysdyn.runtime.events.locate import Dense, Edges, crossing
from sysdyn.runtime.events.observer import SMALL, TIMED, Observer
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.events.watches import Candidates, Watched, Watches
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System

NOTHING = tuning.CANCELS
"""Of the span: no time."""
FALLEN: float = _core.FALLEN
"""Of what else counts as zero, and of the height of its flight: a gap that an impact opened closes again below it."""


class Watching:
    """side [relations]: 1 or -1 of zero, 0 on neither."""

    def __init__(self, plan: Plan, system: System, span: tuple[float, float]) -> None:
        self.plan, self.system, self.span = plan, system, span
        self.p, self.nothing = system.description.p, NOTHING * (span[1] - span[0])
        self.observer = Observer(system)
        self.observer.exact[[r.row for r in plan.relations if r.ticks]] = TIMED
        self.contacts = Contacts(plan, system, self.observer, self.p)
        self.kinks = Kinks(plan.kinks, self.observer, self.p)
        self.side = np.ones(len(plan.relations))
        self._bounces: dict[int, Bounce] = {}
        self.next = np.zeros(max(len(plan.sampled), 1), dtype=np.int64)
        self._candidates = Candidates(plan)
        self._frozen = np.isin(np.arange(len(plan.contacts)), list(self.contacts.frozen))

    @property
    def bounces(self) -> dict[int, Bounce]:
        """By rows, gaps that an impact opened, until they close: they are open until then."""
        return self._bounces

    @bounces.setter
    def bounces(self, bounces: dict[int, Bounce]) -> None:
        self.observer.small[list(self._bounces)] = SMALL
        self._bounces = bounces
        self.observer.small[list(bounces)] = FALLEN * SMALL

    def all_watched(self) -> Watches:
        """Everything whose change ends a piece: a relation on neither side yet is watched on both."""
        contacts = self.contacts
        return self._candidates.now(self.side, contacts.active, contacts.barred | self._frozen, self.p)

    def core(self) -> tuple[Any, int]:
        """What is watched as the core's array, and how many watches there are."""
        watched = self.all_watched()
        array: Any = (lib.Watch * max(len(watched), 1))()
        columns = np.frombuffer(array, dtype=np.dtype(lib.Watch))[: len(watched)]
        edges = self._edges(watched)
        columns["row"], columns["side"], columns["tolerance"] = edges.row, edges.side, edges.small - edges.level
        return array, len(watched)

    def first_crossing(self, dense: Dense, begin: float, end: float) -> tuple[float, list[Watched]] | None:
        """The first instant in begin..end at which something watched changes, and which; None where nothing does."""
        watched = self.all_watched()
        found = crossing(dense, self._edges(watched), begin, end)
        return None if found is None else (found[0], [watched[k] for k in found[1]])

    def turned_relations(self, t: float, y: Floats, yd: Floats) -> list[Watched]:
        """The relations that an instant at which the text jumps leaves on another side."""
        values, watched = self.observer(t, y, yd), self.all_watched()
        other = watched.side * values[watched.row] < -self.observer.zeros(watched.row)
        return watched.each(other & (watched.relation >= 0))

    def _edges(self, watched: Watches) -> Edges:
        """What each watched value may fall by unseen (behind an impact nearly nothing, for bounces become small), the
        value at which it begins (that of a bounce, else zero), and what its rate is beside at rest, once it is let go.
        """
        rows = watched.row
        small, level, still = self.observer.zeros(rows), np.zeros(rows.size), np.zeros(rows.size)
        # gaps in flight are watched by their own heights
        if self.bounces:
            thrown, number = list(self.bounces), self.observer.largest.size
            height, begins, flies = np.full(number, np.inf), np.zeros(number), np.zeros(number, dtype=bool)
            height[thrown] = [b.height for b in self.bounces.values()]
            begins[thrown] = [b.level for b in self.bounces.values()]
            flies[thrown] = True
            small = np.minimum(small, FALLEN * height[rows])
            level = begins[rows]
            still = np.where(flies[rows] & (watched.rate >= 0), self.observer.zeros(watched.rate), 0.0)
        return Edges(rows, watched.side, watched.rate, small, level, still)

    def low_flights(self, t: float, unseen: float) -> tuple[float, float]:
        """How long (s) the shortest takes of the bounces under way at t (s) that rise less than `unseen` times the
        largest value of their gap, and when (s) the first of them must have ended; inf where there is none.
        """
        largest = self.observer.largest
        # bounces that rise less than steps see, and are not over yet
        low = [b for row, b in self.bounces.items() if b.height < unseen * largest[row]]
        low = [b for b in low if t + self.nothing < b.begins + 2.0 * b.flight]
        first = min((b.begins + 2.0 * b.flight for b in low), default=np.inf)
        return min((b.flight for b in low), default=np.inf), first

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
            # one instant by two formulas: counted up to now
            while self.span[0] + int(self.next[k]) * s.period <= t + self.nothing:
                self.next[k] += 1
                found.append(k)
        return list(dict.fromkeys(found))
