"""Sums of sums: unknowns that are sums of kept ones and of each other, as sums of kept ones alone.

What stands where follows from the structure; the numbers are those of the terms, multiplied along each
way and added up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.patterns import number_pairs
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Composition:
    """T by rows: start [eliminated + 1], source [entries] places among the kept ones, ascending in each row.

    direct: (entry, term) of what reads a kept unknown itself; levels: (entry, term, entry read) of what reads one
    through an unknown whose row is complete by then.
    """

    start: Ints
    source: Ints
    direct: tuple[Ints, Ints]
    levels: tuple[tuple[Ints, Ints, Ints], ...]

    def places(self) -> Composition:
        """Where the entries of T stand, without what their values are made of: of a large system the room counts."""
        nothing = np.zeros(0, dtype=np.int32)
        return Composition(self.start, self.source, (nothing, nothing), ())

    def values(self, factor: Floats) -> Floats:
        """The entries of T [entries] by the factors of the terms."""
        found = np.zeros(self.source.size)
        # rows that read kept unknowns alone, then those that read them through others
        entry, term = self.direct
        np.add.at(found, entry, factor[term])
        for entry, term, through in self.levels:
            np.add.at(found, entry, factor[term] * found[through])
        return found


def places_of(mask: NDArray[np.bool_]) -> Ints:
    """Where a mask holds, in numbers half as long as NumPy's own: of a large system the room counts."""
    return np.flatnonzero(mask).astype(np.int32)


def ranges(first: Ints, count: NDArray[np.integer]) -> Ints:
    """first[k], first[k] + 1, ... of each k, one behind the other."""
    begin = np.asarray(first - (np.cumsum(count) - count), dtype=np.int32)
    found = np.repeat(begin, count)
    found += np.arange(found.size, dtype=np.int32)
    return found


def compose_definitions(start: Ints, kept: Ints, through: Ints) -> Composition:
    """Start [eliminated + 1]: the terms of each row; kept, through [terms]: the kept unknown that a term reads, or the
    eliminated one, whose row stands before; -1.
    """
    # the row of each term, and how many sums stand between it and kept unknowns
    number = start.size - 1
    owner = np.repeat(np.arange(number, dtype=np.int32), np.diff(start))
    depth = _depth(number, owner, through)
    rows, columns, terms, read = ([np.zeros(0, dtype=np.int32)] for _ in range(4))
    first, count = np.zeros(number, dtype=np.int32), np.zeros(number, dtype=np.int32)
    level: list[Ints] = [np.zeros(0, dtype=np.int32)]
    at = 0
    # level by level: what a row reads through another one is known by then
    for k in range(int(depth.max(initial=-1)) + 1):
        mine = depth[owner] == k
        direct, indirect = places_of(mine & (kept >= 0)), places_of(mine & (through >= 0))
        # a term that reads a defined unknown has as many parts as that has entries
        many = count[through[indirect]]
        entry = ranges(first[through[indirect]], many)
        term = np.concatenate([direct, np.repeat(indirect, many)])
        places = np.concatenate(columns)
        row, column = owner[term], np.concatenate([kept[direct], places[entry]])
        # one entry of T for each kept unknown that a row reads
        slot, begin, each = number_pairs(row, column, number, int(column.max(initial=-1)) + 1)
        size = np.diff(begin)
        own = places_of(size > 0)
        rows.append(np.repeat(own, size[own]))
        columns.append(each)
        # where the entries of these rows stand among all so far
        first[own], count[own] = at + begin[own], size[own]
        terms.append(term)
        read.append(np.concatenate([np.full(direct.size, -1, dtype=np.int32), entry]))
        slot += at
        level.append(slot)
        at += each.size
    # all levels in the order of the rows
    row, column = np.concatenate(rows), np.concatenate(columns)
    final, starts, source = number_pairs(row, column, number, int(column.max(initial=-1)) + 1)
    del row, column, rows, columns
    parts = [(final[slot], term, by) for slot, term, by in zip(level, terms, read, strict=True)]
    # terms by themselves, and terms times an entry of a level before
    direct_entry = np.concatenate([entry[by < 0] for entry, _, by in parts])
    direct_term = np.concatenate([term[by < 0] for _, term, by in parts])
    levels = tuple((entry[by >= 0], term[by >= 0], final[by[by >= 0]]) for entry, term, by in parts if (by >= 0).any())
    return Composition(starts, source, (direct_entry, direct_term), levels)


def _depth(number: int, owner: Ints, through: Ints) -> Ints:
    """How many rows stand between each row and kept unknowns alone [eliminated]."""
    depth, use = np.zeros(number, dtype=np.int32), through >= 0
    while True:
        before = depth.copy()
        np.maximum.at(depth, owner[use], 1 + depth[through[use]])
        if (depth == before).all():
            return depth
