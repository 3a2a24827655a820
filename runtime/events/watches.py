"""The rows of block observe whose side of zero is watched, as columns: all of a plan's, and those of one instant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.events.kinks import SLIDES
from sysdyn.runtime.events.locate import Numbers
from sysdyn.runtime.events.plan import Contact, Kink, Plan
from sysdyn.runtime.model.description import Floats
from sysdyn.values import dataclass

HOLDS, FREE = 1, -1
"""When a row of a contact is watched: while it holds, while it does not; 0: always."""
BOUNDED = ("friction", "planar")
"""Kinds of contacts with a bound, below which no effort is within it."""


@dataclass(frozen=True, slots=True)
class Watched:
    """A row of block observe on the side 1 or -1 of zero; relation, contact or kink: whose it is, the others -1."""

    relation: int
    contact: int
    row: int
    side: int
    kink: int = -1


@dataclass(frozen=True, slots=True)
class Watches:
    """Columns [watches]: relation, contact, kink, row and side of each, as of `Watched`; rate: the row of its rate, -1
    where it has none.
    """

    relation: Numbers
    contact: Numbers
    kink: Numbers
    row: Numbers
    side: Numbers
    rate: Numbers

    def __len__(self) -> int:
        return self.row.size

    def __getitem__(self, k: int) -> Watched:
        columns = self.relation, self.contact, self.row, self.side, self.kink
        return Watched(*(int(column[k]) for column in columns))

    def each(self, mask: NDArray[np.bool_]) -> list[Watched]:
        """Some of them one by one."""
        return [self[k] for k in np.flatnonzero(mask).tolist()]

    def select(self, mask: NDArray[np.bool_]) -> Watches:
        """Some of them."""
        columns = self.relation, self.contact, self.kink, self.row, self.side, self.rate
        return Watches(*(column[mask] for column in columns))

    def place(self, one: Watched) -> int:
        """The number of one among them."""
        same = (self.row == one.row) & (self.side == one.side) & (self.kink == one.kink)
        return int(np.flatnonzero(same & (self.relation == one.relation) & (self.contact == one.contact))[0])


class Candidates:
    """Every watch that a plan may ask for, in the order of relations, contacts and kinks."""

    def __init__(self, plan: Plan) -> None:
        relations = [k for k, r in enumerate(plan.relations) if r.moves]
        # relations from either side
        found = [(k, -1, -1, plan.relations[k].row, side, -1, 0, -1) for k in relations for side in (1, -1)]
        ends = [len(found)]
        for k, c in enumerate(plan.contacts):
            # contacts by the rows that end how they stand
            found += [(-1, k, -1, row, 1, rate, when, sense) for row, rate, when, sense in _of_contact(c)]
        ends.append(len(found))
        for k, kink in enumerate(plan.kinks):
            # laws by the sides of their branches
            found += [(-1, -1, k, row, side, rate, 0, -1) for row, side, rate in _of_kink(kink)]
        table = np.array(found, dtype=np.int64).reshape(len(found), 8).T
        *columns, self._when, self._sense = table
        self._all = Watches(*columns)
        self._relations, self._contacts, self._kinks = (
            slice(begin, end) for begin, end in zip([0, *ends], [*ends, len(found)], strict=True)
        )
        kinks, rows = self._all.kink[self._kinks], self._all.row[self._kinks]
        self._branch = np.array([k.branch for k in plan.kinks], dtype=np.int64)[kinks]
        self._slides = rows != np.array([k.value for k in plan.kinks], dtype=np.int64)[kinks]

    def now(self, side: Floats, holds: NDArray[np.bool_], out: NDArray[np.bool_], p: Floats) -> Watches:
        """Those of relations on a side [relations] (of one on neither side both), of contacts that hold or do not
        [contacts], but for those that are `out`, and of the branches that stand in p.
        """
        every = self._all
        related, touched, bent = (part.start < part.stop for part in (self._relations, self._contacts, self._kinks))
        kept = np.zeros(len(every), dtype=bool)
        # on its side, or on neither
        if related:
            part = self._relations
            kept[part] = every.side[part] * side[every.relation[part]] >= 0.0
        # for those that hold, those that do not, or both
        if touched:
            part, contact = self._contacts, every.contact[self._contacts]
            stands = np.where(holds[contact], HOLDS, FREE)
            kept[part] = ~out[contact] & ((self._when[part] == 0) | (self._when[part] == stands))
        # the branch that is on, or its sliding surface
        if bent:
            part, branch = self._kinks, p[self._branch]
            kept[part] = np.where(self._slides, branch == SLIDES, (branch != SLIDES) & (branch != -every.side[part]))
        found = every.select(kept)
        # a friction's side is its sense
        slips = np.flatnonzero(self._sense[kept] >= 0)
        found.side[slips] = np.where(p[self._sense[kept][slips]] < 0.0, -1, 1)
        return found


def _of_contact(c: Contact) -> list[tuple[int, int, int, int]]:
    """(row, row of its rate, when, place of the sense that is its side) of what is watched of a contact."""
    found: list[tuple[int, int, int, int]] = []
    # sticks within both bounds, slips until it stops
    if c.kind == "friction":
        found = [(c.upper, -1, HOLDS, -1), (c.lower, -1, HOLDS, -1), (c.value, c.rate, FREE, c.sense)]
    # within its circle, slips until it stops
    elif c.kind == "planar":
        found = [(c.upper, -1, HOLDS, -1), (c.value, c.rate, FREE, -1)]
    # a multiplier that turns negative, a value that does
    elif c.kind in ("phi", "psi"):
        found = [(c.multiplier, -1, HOLDS, -1), (c.value, c.rate, FREE, -1)]
    # a bound that may sink below zero
    if c.moves and c.kind in BOUNDED:
        found.append((c.bound, -1, 0, -1))
    return found


def _of_kink(kink: Kink) -> list[tuple[int, int, int]]:
    """(row, side, row of its rate): of its value, and, where it may slide, of its sense."""
    found = [(kink.value, 1, kink.rate), (kink.value, -1, kink.rate)]
    return [*found, (kink.above, 1, -1), (kink.below, 1, -1)] if kink.above >= 0 else found
