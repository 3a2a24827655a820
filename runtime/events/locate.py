"""The first instant within a step at which something watched changes: bracketed on a grid, then Ridders.

Ridders' method on the settled dense output: it needs no derivative and never leaves the bracket (Ridders 1979).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core, tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.values import dataclass

PARTS: int = _core.SD_PARTS
"""Of a step, as core/run/run.h looks at it."""
ITERATIONS = 60
AT_ONCE = tuning.UNSEEN
"""Of what is searched: a moment."""

Numbers = NDArray[np.int64]
Dense = Callable[[float], Floats]
"""t (s) -> values [observed] there."""


@dataclass(frozen=True, slots=True)
class Edges:
    """Columns [watches]: row, side, row of its rate or -1, tolerance, level <= 0, tolerance of its rate: each changes
    where side*value - level falls below -tolerance.  A bounce begins at the value that the impact before it left, which
    is zero but for round-off: that is its level, until it has been above zero.  So the round-off of many bounces does
    not add up.
    """

    row: Numbers
    side: Numbers
    rate: Numbers
    small: Floats
    level: Floats
    still: Floats


def crossing(dense: Dense, edges: Edges, begin: float, end: float) -> tuple[float, list[int]] | None:
    """The first instant, and the numbers of the watches that change there; None where none does.  Where what is found
    turns others may have changed before, and be back at the end.
    """
    # on a grid: what falls and rises within one part is not seen
    grid = [begin + (end - begin) * k / PARTS for k in range(1, PARTS)] + [end]
    low, before = begin, dense(begin)
    for high in grid:
        values = dense(high)
        hit = _falling(edges, before, values)
        # the first of those that fall; again as long as others fell before it
        while hit:
            t, which = _first(dense, edges, hit, (low, before), (high, values))
            known, high, values = set(hit), t, dense(t)
            # done where nothing else fell before it
            hit = _falling(edges, before, values)
            if not low < t or known.issuperset(hit):
                return t, which
        low, before = high, values
    return None


def _falling(edges: Edges, low: Floats, high: Floats) -> list[int]:
    """Which watches change between two points; what leaves zero upwards, or at rest (a contact that lets go begins to
    part by its jerk alone), and does not fall at the end, has not: a first step of order 1 may pull it below.
    """
    side, rate = edges.side, edges.rate
    # what is above zero falls through zero, else through its level
    levels = np.where(side * low[edges.row] > 0.0, 0.0, edges.level)
    fell = np.flatnonzero(side * high[edges.row] - levels < -edges.small)
    side, row, rate, level = side[fell], edges.row[fell], rate[fell], levels[fell]
    # begins at zero and rises at both ends: no fall
    begins = (rate >= 0) & (side * low[row] <= level + edges.small[fell])
    rises = begins & (np.minimum(side * low[rate], side * high[rate]) >= -edges.still[fell])
    return [int(k) for k in fell[~rises]]


def _first(
    dense: Dense,
    edges: Edges,
    hit: list[int],
    low: tuple[float, Floats],
    high: tuple[float, Floats],
) -> tuple[float, list[int]]:
    """The first instant at which any of these watches falls through its level, and those that fall there."""
    found = {}
    for k in hit:
        found[k] = _instant(dense, edges, k, low, high)
    first = min(found.values())
    # to a few units of round-off at one instant
    same = 8.0 * float(np.spacing(max(abs(low[0]), abs(high[0]))))
    return first, [k for k in hit if found[k] <= first + same]


def _instant(dense: Dense, edges: Edges, k: int, low: tuple[float, Floats], high: tuple[float, Floats]) -> float:
    """Where watch k falls through zero; what begins at zero and rises (a bounce lower than the tolerance) falls from
    its crest, or, where that is round-off too, through its tolerance.
    """
    row, side, rate = (int(column[k]) for column in (edges.row, edges.side, edges.rate))
    small, level, value = float(edges.small[k]), float(edges.level[k]), side * float(low[1][row])
    # above zero: zero itself counts
    level = 0.0 if value > 0.0 else level
    begin, value = low[0], value - level
    # rises first: from its crest on
    if value <= 0.0 and rate >= 0 and side * float(low[1][rate]) > 0.0 > side * float(high[1][rate]):
        lower, upper = ((at, side * float(values[rate])) for at, values in (low, high))
        begin = _root(dense, rate, side, lower, upper)
        top = side * float(dense(begin)[row])
        level = 0.0 if top > 0.0 else level
        value = top - level
        # even the crest is round-off: by its tolerance
        if value <= 0.0:
            value, level = value + small, level - small
    return _root(dense, row, side, (begin, value), (high[0], side * float(high[1][row]) - level), level)


def _root(
    dense: Dense, row: int, side: int, low: tuple[float, float], high: tuple[float, float], level: float = 0.0
) -> float:
    """Where side*value - level falls through zero; low where it is not above zero there already, nor a
    moment behind.
    """
    (a, fa), (b, fb) = low, high
    if fa <= 0.0:  # it may rise before it falls
        behind = a + AT_ONCE * (b - a)
        fa = side * float(dense(behind)[row]) - level
        if not (a < behind and fa > 0.0):
            return a
        a = behind
    # Ridders' method: bisection and an exponential factor
    for _ in range(ITERATIONS):
        middle = 0.5 * (a + b)
        if not a < middle < b:
            break
        fm = side * float(dense(middle)[row]) - level
        root = math.sqrt(fm * fm - fa * fb)
        # the root by Ridders, between the ends
        t = middle + (middle - a) * fm / root if root else middle
        if fm > 0.0:
            a, fa = middle, fm
        else:
            b, fb = middle, fm
        # between the ends, unless round-off puts it outside
        if a < t < b:
            ft = side * float(dense(t)[row]) - level
            if ft > 0.0:
                a, fa = t, ft
            else:
                b, fb = t, ft
        # the interval is down to round-off
        if b - a <= 2.0 * float(np.spacing(max(abs(a), abs(b)))) or fb == 0.0:
            break
    return b
