"""Rows of a large sparse matrix, as many as unknowns or more: what they determine, and what they leave open.

By factors of the rows themselves (core/linear/dense/tall.h).  Matrices are shape [rows, unknowns] and entries
(i, j, v), the rows of size one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.patterns import Pattern, Places, compress
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.runtime.numerics.ordering import tall_order
from sysdyn.runtime.numerics.points import uniform
from sysdyn.runtime.numerics.products import pieces
from sysdyn.values import dataclass

Entries = tuple[Any, Any, Floats]
PIVOT = tuning.HALF_OF_ITS_DIGITS
"""Least pivot, as part of its column, of an unknown that rows determine; with less the least norm has a say."""
FILLED = 12
"""Entries of factors for one of the matrix from which those of the saddle point are no worse."""
OPEN = tuning.UNSEEN
"""Of a unit vector: a part of it that is open."""
MEMORY = 2
"""What the core answers where it has none."""


@dataclass(frozen=True, slots=True)
class Columns:
    """The matrix by those of its columns that are used [unknowns]: pattern, values [entries]; rows: of it; the pattern
    may have more, which are empty.
    """

    rows: int
    used: NDArray[np.bool_]
    pattern: Pattern
    values: Floats

    def arrays(self) -> tuple[NDArray[Any], ...]:
        """What the core is told of it; the caller keeps them alive."""
        return self.pattern.column, self.pattern.row, self.values

    def whole(self, found: Floats, *, rest: float = 0.0) -> Floats:
        """Of all unknowns, `rest` those of columns without entries."""
        if self.used.all():
            return found
        whole = np.full(self.used.size, rest)
        whole[self.used] = found
        return whole

    def entries(self) -> Entries:
        """Of the matrix with all unknowns."""
        columns = self.pattern.columns_of()
        return self.pattern.row, columns if self.used.all() else np.flatnonzero(self.used)[columns], self.values

    def residual(self, x: Floats, aim: Floats) -> Floats:
        """What aim [rows] is more than A x [rows]; x: of all unknowns."""
        found = np.zeros(self.rows)
        x = np.ascontiguousarray(x if self.used.all() else x[self.used])
        places = (lib.pointer(item) for item in self.arrays())
        lib.core.sd_miss(self.rows, x.size, *places, *map(lib.pointer, (aim, x, found)))
        return found


def by_columns(shape: tuple[int, int], entries: Entries, *, fewer: bool) -> Columns | None:
    """fewer: rows may be fewer than the columns that are used, and empty ones make up for it; else there is none."""
    i, j, v = entries
    # entries that are zero have no place
    if np.count_nonzero(v) < v.size:
        here = v != 0.0
        i, j, v = i[here], j[here], v[here]
    used = np.zeros(shape[1], dtype=bool)
    used[j] = True
    rows, unknowns = shape[0], int(used.sum())
    # more unknowns than rows: empty rows make up for it, or there is no such matrix
    if unknowns > rows:
        if not fewer:
            return None
        rows = unknowns
    # entries stand in order: they are taken as they are
    if _in_order(i, j):
        begin = np.empty(unknowns + 1, dtype=np.int32)
        begin[0], begin[-1] = 0, j.size
        begin[1:-1] = np.flatnonzero(j[1:] != j[:-1])
        begin[1:-1] += 1
        row, values = np.ascontiguousarray(i, dtype=np.int32), np.ascontiguousarray(v, dtype=np.float64)
        return Columns(shape[0], used, Pattern(rows, unknowns, begin, row), values)
    # else sorted and added up
    number = np.cumsum(used, dtype=np.int32) - 1
    pattern, (slot,) = compress(rows, unknowns, [Places(i, number[j])])
    values = np.bincount(slot, weights=v, minlength=pattern.entries).astype(np.float64, copy=False)
    return Columns(shape[0], used, pattern, values)


def _in_order(i: Any, j: Any) -> bool:
    """Whether entries stand by columns, and by rows in each, as those of a pattern do: they need not be copied."""
    for here in pieces(j.size - 1):
        behind = slice(here.start + 1, min(here.stop + 1, j.size))
        before = slice(here.start, behind.stop - 1)
        if not ((j[behind] > j[before]) | ((j[behind] == j[before]) & (i[behind] > i[before]))).all():
            return False
    return True


def determine(
    shape: tuple[int, int],
    entries: Entries,
    aim: Floats,
    met: Callable[[Floats], bool] = lambda _: True,
    idle: NDArray[np.bool_] | None = None,
) -> Floats | None:
    """The u that rows determine, unknowns that stand in none of them zero; None where they leave others open, or it is
    not `met`: rows in excess are not looked at.  By factors where rows do not determine one unknown after the other.

    idle: unknowns [mask] that rows may leave open, as long as they move none but these: some of those are zero then.
    """
    columns = by_columns(shape, entries, fewer=idle is not None)
    return None if columns is None else solve_columns(columns, aim, met, idle)


def solve_columns(
    columns: Columns,
    aim: Floats,
    met: Callable[[Floats], bool] = lambda _: True,
    idle: NDArray[np.bool_] | None = None,
) -> Floats | None:
    """The solution of a tall system by its columns; None where the rows leave it open, or `met` refuses it."""
    # empty rows that were added ask for nothing
    more = columns.pattern.rows - columns.rows
    if more:
        aim = np.append(aim, np.zeros(more))
    # by substitution first, then by factors
    for way in (_substitute, _factor if idle is None else _determine_open(idle)):
        found = np.zeros(columns.pattern.unknowns)
        failed = way(columns, aim, found)
        # a solution that misses counts as none
        if failed == MEMORY:
            raise MemoryError
        whole = None if failed else columns.whole(found)
        if whole is not None and met(whole):
            return whole
    return None


def _substitute(columns: Columns, aim: Floats, found: Floats) -> int:
    places, rows = (lib.pointer(item) for item in columns.arrays()), columns.pattern.rows
    return int(lib.core.sd_substituted(rows, found.size, *places, PIVOT, lib.pointer(aim), lib.pointer(found)))


def _factor(
    columns: Columns, aim: Floats | None, found: Floats | None, idle: Ints | None = None, along: Floats | None = None
) -> int:
    """Of core/linear/dense/tall.h."""
    pattern, arrays = columns.pattern, (*columns.arrays(), tall_order(columns.pattern), idle)
    limits, answers = (PIVOT, FILLED * pattern.entries), (aim, found, along)
    places, last = ([lib.pointer(item) for item in some] for some in (arrays, answers))
    return int(lib.core.sd_determined(pattern.rows, pattern.unknowns, *places, *limits, *last))


def _determine_open(idle: NDArray[np.bool_]) -> Callable[[Columns, Floats, Floats], int]:
    """A factorisation of columns with unknowns that may be left open."""

    def factor(columns: Columns, aim: Floats, found: Floats) -> int:
        own, along = idle[columns.used], _generic(found.size)
        failed = _factor(columns, aim, found, own.astype(np.int32), along)  # A along = 0: what it moves is open
        return failed or int((np.abs(along[~own]) > OPEN * np.abs(along).max(initial=0.0)).any())

    return factor


def _generic(number: int) -> Floats:
    """Numbers of which no row's coefficients make zero by chance; half to one."""
    return np.asarray(0.75 + 0.25 * np.cos(2.0 * np.pi * uniform(number)))


def left_open(shape: tuple[int, int], entries: Entries) -> Floats | None:
    """A direction [unknowns] of length one (largest entry) that rows leave open, a random one of them: an unknown that
    some of them move is moved by it.  Zero where rows determine everything; None where that would cost too much.
    """
    columns = by_columns(shape, entries, fewer=True)
    assert columns is not None
    # a random direction: it shows whatever is open
    found = _generic(columns.pattern.unknowns)
    failed = _factor(columns, None, None, along=found)
    if failed == MEMORY:
        raise MemoryError
    if failed:
        return None
    whole = columns.whole(found, rest=1.0)
    # the largest entry has size one
    whole /= max(np.abs(whole).max(initial=0.0), 1e-300)
    return whole


def free_unknowns(shape: tuple[int, int], entries: Entries) -> NDArray[np.bool_] | None:
    """Unknowns that rows of any size leave open; None where that would cost too much."""
    i, j, v = (item[entries[2] != 0.0] for item in entries)
    if (np.bincount(i, minlength=1) <= 1).all():  # each row determines its own
        open_ = np.ones(shape[1], dtype=bool)
        open_[j] = False
        return open_
    # equilibrated: no factor depends on units
    row, column = sparse_factors(i, j, np.abs(v), shape)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = v * row[i] * column[j]
    free = left_open(shape, (i, j, np.where(np.isfinite(scaled), scaled, 1.0)))  # what no factor scales is there
    return None if free is None else np.abs(free) > OPEN
