"""Order of elimination of the saddle-point matrix [D, G^T; G, -eps] of a least change (core/system/settle.h).

What follows from the state pivots in a row of G that it belongs to, and that row's multiplier in the other's column: so
pivots stay what they are where slopes of constraints, which links turn, come and go.  What has no such pivot, a
multiplier of what the state alone enters or of a constraint on rates, comes behind all others: by then it has one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.patterns import Pattern, Places, compress
from sysdyn.runtime.numerics.matching import match_rows
from sysdyn.runtime.numerics.ordering import SMALL, Order, any_order, least_fill


def saddle_order(pattern: Pattern, state: NDArray[np.bool_], own: Callable[[], Ints]) -> Order:
    """pattern: symmetric, moves (unknowns and rates) before rows of G; state [moves]: what carries it; own: the row of
    G of each other move [moves], -1: not known, asked for where it matters.
    """
    order, number = any_order(pattern), pattern.unknowns
    # small: any pivots
    if number <= SMALL:
        return order
    # each move that follows pivots in its row of G, and that row in the move
    mine = _pivots(pattern, state, own())
    of = np.empty_like(mine)
    of[mine] = np.arange(number, dtype=np.int32)
    permuted, _ = compress(number, number, [Places(of[pattern.row], pattern.columns_of())])
    # rows of G that nothing pairs: only -eps on the diagonal
    faint = (mine == np.arange(number)) & (mine >= state.size)
    columns, filled = least_fill(permuted, _ahead(permuted, faint))
    # fills more: any pivots
    if filled > order.filled:
        return order
    return Order(columns, filled, True, mine, order.columns, 2 * order.filled, faint=True)


def _pivots(pattern: Pattern, state: NDArray[np.bool_], own: Ints) -> Ints:
    """The row of the matrix that pivots in each column, by its pattern."""
    row, column, moves = pattern.row, pattern.columns_of(), state.size
    follow = np.flatnonzero(~state)
    number = np.full(moves, -1)
    number[follow] = np.arange(follow.size)
    # entries of rows of G by moves that follow
    told = np.flatnonzero((row >= moves) & (column < moves))
    told = told[~state[column[told]]]
    rows, _ = compress(pattern.unknowns - moves, follow.size, [Places(row[told] - moves, number[column[told]])])
    match = match_rows(rows, _once_each(own[follow]))
    found = np.arange(pattern.unknowns, dtype=np.int32)
    one, other = follow[match >= 0], moves + match[match >= 0]
    found[one], found[other] = other, one
    return found


def _ahead(pattern: Pattern, faint: NDArray[np.bool_]) -> Pattern:
    """Of columns without an entry of their own, or a faint one [unknowns]: those that give it to them stand ahead."""
    # columns without an entry of their own, or with a faint one
    row, column, number = pattern.row, pattern.columns_of(), pattern.unknowns
    later = np.ones(number, dtype=bool)
    later[column[row == column]] = False
    later |= faint
    into, out = (np.flatnonzero(later[one] & ~later[other]) for one, other in ((column, row), (row, column)))
    # those that have an entry on both sides
    back = column[out].astype(np.int64) * number + row[out]
    given = into[np.isin(row[into].astype(np.int64) * number + column[into], back)]
    return compress(number, number, [Places(column[given], row[given])])[0]


def _once_each(own: Ints) -> Ints:
    """Rows of G [moves] without those that several moves have."""
    number = np.bincount(own[own >= 0], minlength=1)
    return np.where((own >= 0) & (number[np.maximum(own, 0)] == 1), own, -1).astype(np.int32)
