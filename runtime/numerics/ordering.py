"""Column orders for the sparse factorisation: exact degrees for small matrices, approximate ones for others.

Small matrices get the least degree of A^T A with rows merged as they are eliminated (George & Ng, SIAM J. Sci. Stat.
Comput. 8, 1987): what partial pivoting may fill is known from the pattern.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import addressof
from functools import cached_property
from typing import Any

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.own_rows import own_rows
from sysdyn.runtime.model.patterns import Pattern, Places, compress
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.matching import match_rows
from sysdyn.values import dataclass

DENSE = 16
"""Largest dense matrix: above, the matrices of models are so sparse that the sparse LU is the cheaper one (measured on
twelve models of 8 to 150 unknowns: steps of radau by up to 46 %, of the bdf by up to 23 %); below, little is
gained, and full pivoting is the safer one near singular positions."""
LEAVING = 50
"""The same of matrices whose columns may be left without a pivot, which the dense LU alone does."""
SMALL = 100
"""Unknowns up to which degrees are exact."""


SHORT = 8
"""Entries of factors an unknown, from which on a net is worth rows of its own: on a grid of 30 x 30 a bdf takes 5.0
ms for 7.7, a radau 7.7 for 12.9."""
GAIN = 0.6
"""Part of what any pivots may fill that pairs promise to fill, for them to be tried: where a row does not pivot in its
own column they fill more than they promise."""


@dataclass(frozen=True)
class Order:
    """How square matrices of one pattern are eliminated: columns [unknowns] one after the other, None: dense.

    filled: entries of a factor at most.  paired: row own[k] (None: k) pivots in column k wherever its entry will do;
    where such factors have more than `most` entries (0: however many) the columns are taken as in `otherwise`, for any
    pivots.  faint: its entry does however small it is, of quasi-definite matrices, whose solutions are then refined.
    """

    columns: Ints | None
    filled: int = 0
    paired: bool = False
    own: Ints | None = None
    otherwise: Ints | None = None
    most: int = 0
    faint: bool = False

    @cached_property
    def core(self) -> lib.Order:
        """As the core has it."""
        arrays = map(lib.pointer, (self.columns, self.own, self.otherwise, self.position))
        return lib.Order(*arrays, self.most, self.paired + self.faint)

    @cached_property
    def position(self) -> Ints | None:
        """Of each column in the order [unknowns], where factors that pivot as it says have none of their own."""
        # own rows, or any pivots: no fixed position
        if not self.paired or self.own is not None or self.columns is None:
            return None
        found = np.empty_like(self.columns)
        found[self.columns] = np.arange(found.size, dtype=found.dtype)
        return found

    @property
    def address(self) -> int:
        """Of that."""
        return addressof(self.core)

    def linear(self, pattern: Pattern) -> Any:
        """The core's factorisation of such matrices: the caller frees it, and keeps pattern and order alive."""
        return self._make_order(lib.core.sd_linear_ordered, pattern)

    def complex_linear(self, pattern: Pattern) -> int:
        """Factors of complex matrices of a pattern in this order: their address."""
        return int(self._make_order(lib.core.sd_linear_z_ordered, pattern))

    def _make_order(self, make: Callable[..., Any], pattern: Pattern) -> Any:
        made = make(pattern.unknowns, lib.pointer(pattern.column), lib.pointer(pattern.row), self.address)
        if not made:
            raise MemoryError
        return made


def order_of(system: System) -> Order:
    """Elimination order of a form's matrices for any pivots, found once a text."""
    return system.once("order", lambda: any_order(system.pattern, leaving=bool(system.form.scales)))


def net_order_of(system: System) -> Order:
    """The order of a system's matrices, with rows of their own where that fills less, of a large net."""
    return system.once(("order", "net"), lambda: with_pairs(system.pattern, order_of(system), lambda: own_rows(system)))


def with_pairs(pattern: Pattern, order: Order, given: Callable[[], Ints | None] = lambda: None) -> Order:
    """An order for any pivots, or, of a large net, one of A + A^T, rows permuted such that each unknown has its own.

    A grid of 300 x 300 as written fills 26 million places by the first, 7 by the second.  given: rows of
    unknowns that are known [unknowns], -1: any; asked for where they matter.
    """
    n = pattern.unknowns
    # small, or hardly any fill: any pivots serve
    if n <= SMALL or order.filled <= SHORT * n:
        return order
    # a row for each unknown, those that are known first
    own = match_rows(pattern, given())
    if (own < 0).any():
        return order
    of = np.empty(n, dtype=np.int32)
    # rows permuted so that these stand on the diagonal
    of[own] = np.arange(n, dtype=np.int32)
    permuted, _ = compress(n, n, [Places(of[pattern.row], pattern.columns_of())])
    columns, filled = _large(neighbours(permuted))
    # taken only where it fills clearly less
    return order if filled > GAIN * order.filled else Order(columns, filled, True, own, order.columns, order.filled)


def any_order(pattern: Pattern, *, leaving: bool = False) -> Order:
    """`column_order` with what it may fill."""
    # exact degrees for small matrices
    if pattern.unknowns <= SMALL:
        return Order(column_order(pattern, leaving=leaving))
    return Order(*_large(pattern))


def column_order(pattern: Pattern, *, leaving: bool = False) -> Ints | None:
    """Elimination order [unknowns] of a square matrix, None where it is small enough for the dense LU.

    leaving: columns may be left without a pivot.
    """
    # the dense LU needs no order
    if pattern.unknowns <= (LEAVING if leaving else DENSE):
        return None
    return least_degree(pattern) if pattern.unknowns <= SMALL else _large(pattern)[0]


def paired_order(pattern: Pattern) -> Ints | None:
    """An elimination order [unknowns] where row k belongs to unknown k and pivots there: least degree of A + A^T (a
    grid of 100 x 100 fills 371000 places by it, 646000 by the order for any pivots).

    A matrix with a row for each pair of neighbours has A + A^T for its square, and its column order is that one (Davis,
    Gilbert, Larimore & Ng, ACM Trans. Math. Softw. 30, 2004, SYMAMD).  Lines are eliminated from both ends at once: a
    step of bdf costs 0.85, one of radau 0.8 of what it does from one end.
    """
    # as for any pivots
    if pattern.unknowns <= SMALL:
        return column_order(pattern)
    order, _ = _large(neighbours(pattern))
    places = lib.pointer(pattern.column), lib.pointer(pattern.row)
    # no room in the core
    if lib.core.sd_both_ends(pattern.unknowns, *places, lib.pointer(order)) < 0:
        raise MemoryError
    return order


def symmetric_order(pattern: Pattern, *, faint: bool = False) -> Order:
    """Of a large matrix whose pattern is symmetric: least fill of A + A^T, every row in its own column."""
    return Order(*_large(neighbours(pattern)), paired=True, faint=faint)


def neighbours(pattern: Pattern) -> Pattern:
    """A row for each two unknowns of which one stands in the row of the other, with both."""
    # each edge once, whichever row it stands in
    row, column = pattern.row, pattern.columns_of()
    apart = row != column
    low, high = np.minimum(row, column)[apart], np.maximum(row, column)[apart]
    n = pattern.unknowns
    edges, _ = compress(n, n, [Places(low, high)])
    # an edge is a row with two entries
    number = np.arange(edges.entries, dtype=np.int32)
    ends = [Places(number, edges.row), Places(number, edges.columns_of())]
    return compress(edges.entries, n, ends)[0]


def least_degree(pattern: Pattern) -> Ints:
    """The columns [unknowns], each that whose elimination can fill least; sets of columns are bits of integers."""
    n, columns = pattern.unknowns, pattern.columns_of()
    # rows as bits of columns; which rows hold each column
    rows: dict[int, int] = {}
    holding: list[set[int]] = [set() for _ in range(n)]
    for row, column in zip(pattern.row.tolist(), columns.tolist(), strict=True):
        rows[row] = rows.get(row, 0) | 1 << column
        holding[column].add(row)

    def degree(c: int) -> int:
        reached = 0
        for row in holding[c]:
            reached |= rows[row]
        return reached.bit_count()

    degrees = {c: degree(c) for c in range(n)}
    found = []
    # the column of least degree, its rows merged into one
    while degrees:
        best = min(degrees, key=lambda c: (degrees[c], c))
        del degrees[best]
        found.append(best)
        merged, kept = 0, min(holding[best], default=-1)
        for row in holding[best]:
            merged |= rows.pop(row)
        merged &= ~(1 << best)
        # nothing is left of its rows
        if kept < 0 or not merged:
            continue
        rows[kept] = merged
        # only neighbours change their degree
        gone, touched = holding[best] - {kept}, [c for c in degrees if merged >> c & 1]
        for c in touched:
            holding[c] -= gone
            holding[c].add(kept)
        for c in touched:
            degrees[c] = degree(c)
    return np.array(found, dtype=np.int32)


def tall_order(pattern: Pattern) -> Ints:
    """An elimination order [unknowns] of a matrix that has more rows than columns, always sparse."""
    return least_degree(pattern) if pattern.unknowns <= SMALL else _large(pattern)[0]


def least_fill(pattern: Pattern, ahead: Pattern | None = None) -> tuple[Ints, int]:
    """Least degree of A + A^T, and the entries of a factor.  ahead: rows of each of its columns are unknowns that come
    behind it.
    """
    return _large(neighbours(pattern), ahead)


def _large(pattern: Pattern, ahead: Pattern | None = None) -> tuple[Ints, int]:
    """An elimination order [unknowns] by approximate degrees, in the core (core/linear/order/order.h), and what it
    fills at most.
    """
    found, filled = np.zeros(pattern.unknowns, dtype=np.int32), np.zeros(1, dtype=np.int64)
    answers = lib.pointer(found), lib.pointer(filled)
    places = pattern.column, pattern.row, *((None, None) if ahead is None else (ahead.column, ahead.row))
    if lib.core.sd_column_order(pattern.rows, pattern.unknowns, *map(lib.pointer, places), *answers):
        raise MemoryError
    return found, int(filled[0])
