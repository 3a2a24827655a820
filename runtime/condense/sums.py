"""e = c + T z: what leaves the system as constant sums of what stays, by the numbers of one run.

Stretches of families whose sums read stretches of families become one loop each in the core, whatever their number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.condense.composition import Composition, composed, places_of, ranges
from sysdyn.runtime.condense.elimination import Elimination, Mask
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

LONG, MOST_ALIKE = 64, 2
"""Unknowns of a stretch that is asked whether each of its terms, so many at most, has one factor."""


@dataclass(frozen=True, slots=True)
class Sums:
    """e = c + T z of one set of numbers.  place, constant [eliminated]; start, source, factor: the terms of each, of
    unknowns kept or before it; kept: places of z; unread: of what is neither.
    """

    place: Ints
    constant: Floats
    start: Ints
    source: Ints
    factor: Floats
    kept: Ints
    unread: Ints

    def composed(self, unknowns: int) -> Composition:
        """T by rows, of z."""
        number, later = numbers_of(unknowns, self.kept), numbers_of(unknowns, self.place)
        return composed(self.start, number[self.source], later[self.source])

    def places(self) -> Sums:
        """What of it is no number, and no term: of a large system the room counts."""
        nothing, none = np.zeros(0, dtype=np.int32), np.zeros(0)
        return Sums(self.place, none, nothing, nothing, none, self.kept, self.unread)

    def same(self, other: Sums) -> bool:
        """Whether the numbers are those of another one of the same structure, bit for bit."""
        return bool((self.factor == other.factor).all() and (self.constant == other.constant).all())


def sums(system: System, found: Elimination, jy: Floats, constant: Floats) -> Sums:
    """The numbers of an elimination: jy [entries]; constant [rows]: the rows where all unknowns are zero."""
    pivot = jy[found.pivot]
    rest = constant[found.row]
    factor = -jy[found.entry] / np.repeat(pivot, np.diff(found.start))
    left = np.ones(system.unknowns, dtype=bool)
    left[found.place] = left[found.unread] = False
    source = system.pattern.columns_of()[found.entry]
    kept = places_of(left)
    return Sums(found.place, -rest / pivot, found.start, source, factor, kept, found.unread)


def numbers_of(size: int, places: NDArray[np.integer]) -> Ints:
    """Of each place its number among these [size]; -1 elsewhere."""
    found = np.full(size, -1, dtype=np.int32)
    found[places] = np.arange(places.size, dtype=np.int32)
    return found


class Straights:
    """Stretches of eliminated unknowns whose terms read stretches, as the core has them: array, number."""

    def __init__(self, found: Sums) -> None:
        count, number = np.diff(found.start), found.place.size
        same = np.diff(found.place) == 1
        same &= np.diff(count) == 0
        # within a stretch each term reads one further than the term above it
        inner = np.repeat(np.concatenate([[False], same]), count)
        above = np.arange(found.source.size, dtype=np.int32)
        above -= np.repeat(np.append(np.int32(0), count[:-1]), count)
        steps = np.ones(found.source.size, dtype=bool)
        steps[inner] = found.source[inner] == found.source[above[inner]] + 1
        broken = np.zeros(number, dtype=bool)
        owner = np.repeat(np.arange(number, dtype=np.int32), count)
        broken[owner[~steps]] = True
        begin: NDArray[np.integer] = np.flatnonzero(np.concatenate([[True], ~same])[:number] | broken)
        unlike = np.zeros(number, dtype=bool)
        unlike[owner[inner][found.factor[inner] != found.factor[above[inner]]]] = True
        begin = self._cut(begin, unlike)
        ends = np.append(begin[1:], number)
        made = (lib.Straight * max(begin.size, 1))()
        order = np.arange(found.factor.size, dtype=np.int32)
        for low, high in zip(begin.tolist(), ends.tolist(), strict=True):
            terms, entry = int(count[low]), int(found.start[low])
            block = order[entry : entry + terms * (high - low)]
            block[:] = block.reshape(high - low, terms).T.ravel()
        self._begin, self._order, self._some = begin, order, np.zeros(begin.size, dtype=bool)
        self._factors, self._constants = np.zeros(order.size), np.zeros(number)
        terms_of, offset = count[begin], np.cumsum(count[begin]) - count[begin]
        self._source = found.source[ranges(found.start[begin], terms_of)]
        at, first = lib.pointer(self._factors), lib.pointer(self._source)
        assert at is not None
        assert first is not None
        self._sources = first
        for k, (low, high, source) in enumerate(zip(begin.tolist(), ends.tolist(), offset.tolist(), strict=True)):
            place, entry = int(found.place[low]), int(found.start[low])
            made[k] = lib.Straight(
                place, high - low, int(count[low]), 0, 1, 1, first + 4 * source, at + 8 * entry, None
            )
        self.array, self.number = made, int(begin.size)
        long = np.flatnonzero((ends - begin >= LONG) & (terms_of > 0) & (terms_of <= MOST_ALIKE))
        sizes = (ends - begin)[long] * terms_of[long]
        entries = found.start[begin[long]]
        self._long = [tuple(map(int, line)) for line in zip(long, entries, sizes, strict=True)]

    @staticmethod
    def _cut(begin: NDArray[np.integer], unlike: Mask) -> NDArray[np.integer]:
        """Where stretches begin, once long ones are cut where factors change, if these are few: an end of a line."""
        unlike[begin] = False
        changes = np.add.reduceat(unlike, begin, dtype=np.int64) if begin.size else begin
        length = np.diff(np.concatenate([begin, [unlike.size]]))
        unlike &= np.repeat(changes * LONG <= length, length)
        return np.union1d(begin, np.flatnonzero(unlike))

    def renew(self, found: Sums) -> None:
        """Takes the numbers of other sums of the same structure."""
        self._factors[:] = found.factor[self._order]
        self._constants[:] = found.constant
        base = lib.pointer(self._constants)
        assert base is not None
        some = np.logical_or.reduceat(found.constant != 0.0, self._begin) if self._begin.size else self._some
        for k in np.flatnonzero(some != self._some):
            self.array[int(k)].constant = base + 8 * int(self._begin[k]) if some[k] else None
        self._some = some
        for number, entry, size in self._long:
            factor = self._factors[entry : entry + size].reshape(self.array[number].terms, -1)
            self.array[number].alike = factor.shape[1] if (factor == factor[:, :1]).all() else 0

    def mark(self, name: str, read: Mask) -> None:
        """Says by the field of that name which stretches hold an unknown that is read [unknowns], or that such a one is
        a sum of.
        """
        wanted = read.copy()
        for k in range(self.number - 1, -1, -1):  # sums come behind what they read
            own = self.array[k]
            here = bool(wanted[own.place : own.place + own.number].any())
            setattr(own, name, int(here))
            if here:
                first = (own.source - self._sources) // 4
                for source in self._source[first : first + own.terms].tolist():
                    wanted[source : source + own.number] = True

    def fix(self) -> None:
        """Lets go of what only other numbers would need, of factors that repeat one, of constants that are all zero."""
        self._order = self._order[:0].copy()
        kept = np.ones(self._factors.size, dtype=bool)
        for number, entry, size in self._long:
            if length := self.array[number].alike:
                kept[entry : entry + size].reshape(-1, length)[:, 1:] = False
                self.array[number].alike = 1
        place = np.append(np.int32(0), np.cumsum(kept, dtype=np.int32))
        old = lib.pointer(self._factors)
        self._factors = self._factors[kept]
        new = lib.pointer(self._factors)
        assert old is not None
        assert new is not None
        for k in range(self.number):
            self.array[k].factor = new + 8 * int(place[(self.array[k].factor - old) // 8])
        if not self._some.any():
            self._constants = self._constants[:0].copy()
