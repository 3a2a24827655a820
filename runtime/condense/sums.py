"""e = c + T z: what leaves the system as constant sums of what stays, by the numbers of one run.

Stretches of families whose sums read stretches of families become one loop each in the core, whatever their number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.condense.composition import Composition, compose_definitions, places_of, ranges
from sysdyn.runtime.condense.elimination import Elimination, Mask
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

LONG, MOST_ALIKE = 64, 2
"""Unknowns of a stretch that is asked whether each of its terms, so many at most, has one factor."""
LINE = np.dtype(lib.Straight)
"""lib.Straight, for all stretches at once."""


@dataclass(frozen=True, slots=True)
class ConstantSums:
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

    def composition(self, unknowns: int) -> Composition:
        """T by rows, of z."""
        number, later = numbers_of(unknowns, self.kept), numbers_of(unknowns, self.place)
        return compose_definitions(self.start, number[self.source], later[self.source])

    def places(self) -> ConstantSums:
        """What of it is no number, and no term: of a large system the room counts."""
        nothing, none = np.zeros(0, dtype=np.int32), np.zeros(0)
        return ConstantSums(self.place, none, nothing, nothing, none, self.kept, self.unread)

    def same(self, other: ConstantSums) -> bool:
        """Whether the numbers are those of another one of the same structure, bit for bit."""
        return bool((self.factor == other.factor).all() and (self.constant == other.constant).all())


def sums(system: System, found: Elimination, jy: Floats, constant: Floats) -> ConstantSums:
    """The numbers of an elimination: jy [entries]; constant [rows]: the rows where all unknowns are zero."""
    # row: pivot e + rest + sum factor z = 0, solved for e
    pivot = jy[found.pivot]
    rest = constant[found.row]
    factor = -jy[found.entry] / np.repeat(pivot, np.diff(found.start))
    # what is neither defined nor unread is kept
    left = np.ones(system.unknowns, dtype=bool)
    left[found.place] = left[found.unread] = False
    source = system.pattern.columns_of()[found.entry]
    kept = places_of(left)
    return ConstantSums(found.place, -rest / pivot, found.start, source, factor, kept, found.unread)


def numbers_of(size: int, places: NDArray[np.integer]) -> Ints:
    """Of each place its number among these [size]; -1 elsewhere."""
    found = np.full(size, -1, dtype=np.int32)
    found[places] = np.arange(places.size, dtype=np.int32)
    return found


class Straights:
    """Stretches of eliminated unknowns whose terms read stretches, as the core has them: array, number."""

    def __init__(self, found: ConstantSums) -> None:
        # places and numbers of terms that go on by one make a stretch
        count, number = np.diff(found.start), found.place.size
        same = np.diff(found.place) == 1
        same &= np.diff(count) == 0
        # within a stretch each term reads one further than the term above it
        inner = np.repeat(np.concatenate([[False], same]), count)
        above = np.arange(found.source.size, dtype=np.int32)
        above -= np.repeat(np.append(np.int32(0), count[:-1]), count)
        steps = np.ones(found.source.size, dtype=bool)
        steps[inner] = found.source[inner] == found.source[above[inner]] + 1
        # a term whose place does not go on by one begins another stretch
        broken = np.zeros(number, dtype=bool)
        owner = np.repeat(np.arange(number, dtype=np.int32), count)
        broken[owner[~steps]] = True
        begin: NDArray[np.integer] = np.flatnonzero(np.concatenate([[True], ~same])[:number] | broken)
        # factors that change within a stretch
        unlike = np.zeros(number, dtype=bool)
        unlike[owner[inner][found.factor[inner] != found.factor[above[inner]]]] = True
        begin = self._cut(begin, unlike)
        # lengths and first terms of the stretches
        length = np.diff(np.append(begin, number))
        terms, entry = count[begin], found.start[begin]
        self._begin, self._some = begin, np.zeros(begin.size, dtype=bool)
        self._order = self._by_terms(found.factor.size, entry, length, terms)
        self._factors, self._constants = np.zeros(self._order.size), np.zeros(number)
        self._source, offset = found.source[ranges(entry, terms)], np.cumsum(terms) - terms
        self.array, self.number = (lib.Straight * max(begin.size, 1))(), int(begin.size)
        lines = self._lines = np.frombuffer(memoryview(self.array), dtype=LINE)[: begin.size]
        # the table that the core reads: addresses of sources, factors, constants
        lines["place"], lines["number"], lines["terms"] = found.place[begin], length, terms
        lines["audited"] = lines["rated"] = 1
        lines["source"] = self._source.ctypes.data + self._source.itemsize * offset
        lines["factor"] = self._factors.ctypes.data + self._factors.itemsize * entry.astype(np.int64)
        # long stretches of few terms may have one factor for all
        long = np.flatnonzero((length >= LONG) & (terms > 0) & (terms <= MOST_ALIKE))
        sizes = length[long] * terms[long]
        self._long = [tuple(map(int, line)) for line in zip(long, entry[long], sizes, strict=True)]

    @staticmethod
    def _by_terms(entries: int, entry: Ints, length: Ints, terms: Ints) -> Ints:
        """Entries in the order of the core: of each stretch all first terms, then all second ones."""
        order = np.arange(entries, dtype=np.int32)
        turned = np.flatnonzero((length > 1) & (terms > 1))
        for low, n, m in zip(entry[turned].tolist(), length[turned].tolist(), terms[turned].tolist(), strict=True):
            block = order[low : low + n * m]
            block[:] = block.reshape(n, m).T.ravel()
        return order

    @staticmethod
    def _cut(begin: NDArray[np.integer], unlike: Mask) -> NDArray[np.integer]:
        """Where stretches begin, once long ones are cut where factors change, if these are few: an end of a line."""
        # the begin of a stretch is a cut already
        unlike[begin] = False
        changes = np.add.reduceat(unlike, begin, dtype=np.int64) if begin.size else begin
        length = np.diff(np.concatenate([begin, [unlike.size]]))
        # cut only where the pieces stay long
        unlike &= np.repeat(changes * LONG <= length, length)
        return np.union1d(begin, np.flatnonzero(unlike))

    def renew(self, found: ConstantSums) -> None:
        """Takes the numbers of other sums of the same structure."""
        self._factors[:] = found.factor[self._order]
        self._constants[:] = found.constant
        # a stretch whose constants are all zero has no address of them
        some = np.logical_or.reduceat(found.constant != 0.0, self._begin) if self._begin.size else self._some
        there = self._constants.ctypes.data + self._constants.itemsize * self._begin
        self._lines["constant"] = np.where(some, there, 0)
        self._some = some
        # factors that are the same along a stretch are read once
        for number, entry, size in self._long:
            factor = self._factors[entry : entry + size].reshape(self.array[number].terms, -1)
            self.array[number].alike = factor.shape[1] if (factor == factor[:, :1]).all() else 0

    def mark(self, name: str, read: Mask) -> None:
        """Says by the field of that name which stretches hold an unknown that is read [unknowns], or that such a one is
        a sum of.
        """
        # backwards: a sum that is read reads its sources
        wanted, here = bytearray(read), bytearray(self.number)
        parts = (self._lines[part].tolist() for part in ("place", "number", "terms"))
        source, behind = self._source.tolist(), self._source.size
        for k, (place, number, terms) in reversed(list(enumerate(zip(*parts, strict=True)))):
            behind -= terms  # sums come behind what they read
            # one is read: the whole stretch is evaluated
            if 1 in wanted[place : place + number]:
                here[k] = 1
                for first in source[behind : behind + terms]:
                    wanted[first : first + number] = bytes([1]) * number
        self._lines[name] = np.frombuffer(here, dtype=np.uint8)

    def fix(self) -> None:
        """Lets go of what only other numbers would need, of factors that repeat one, of constants that are all zero."""
        self._order = self._order[:0].copy()
        # of factors that are alike the first one stays
        kept = np.ones(self._factors.size, dtype=bool)
        for number, entry, size in self._long:
            if length := self.array[number].alike:
                kept[entry : entry + size].reshape(-1, length)[:, 1:] = False
                self.array[number].alike = 1
        # addresses move as entries leave
        place = np.append(np.int32(0), np.cumsum(kept, dtype=np.int32))
        size = self._factors.itemsize
        at = (self._lines["factor"].astype(np.int64) - self._factors.ctypes.data) // size
        self._factors = self._factors[kept]
        self._lines["factor"] = self._factors.ctypes.data + size * place[at].astype(np.int64)
        if not self._some.any():
            self._constants = self._constants[:0].copy()
