"""The first instant within a step at which something watched changes: bracketed on a grid, then Ridders.

Ridders' method on the settled dense output: it needs no derivative and never leaves the bracket (Ridders 1979).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from sysdyn.runtime.model.description import Floats

PARTS = 4
"""Of a step, as core/run/run.h looks at it."""
ITERATIONS = 60
AT_ONCE = 1e-6
"""Of what is searched: a moment."""

Dense = Callable[[float], Floats]
"""t (s) -> values [observed] there."""
Watch = tuple[int, int, float, int, float, float]
"""(row, side, tolerance, row of its rate or -1, level <= 0, tolerance of its rate): it changes where side*value - level
falls below -tolerance. A bounce begins at the value that the impact before it left, which is zero but for round-off:
that is its level, else the round-off of many bounces adds up to a fall.
"""


def crossing(dense: Dense, watches: Sequence[Watch], begin: float, end: float) -> tuple[float, list[int]] | None:
    """The first instant, and the numbers of the watches that change there; None where none does.  Where what is found
    turns others may have changed before, and be back at the end.
    """
    grid = [begin + (end - begin) * k / PARTS for k in range(1, PARTS)] + [end]
    low, before = begin, dense(begin)
    for high in grid:
        values = dense(high)
        hit = [k for k, watch in enumerate(watches) if _falls(watch, before, values)]
        while hit:
            t, which = _first(dense, watches, hit, (low, before), (high, values))
            known, high, values = set(hit), t, dense(t)
            hit = [k for k, watch in enumerate(watches) if _falls(watch, before, values)]
            if not low < t or known.issuperset(hit):
                return t, which
        low, before = high, values
    return None


def _falls(watch: Watch, low: Floats, high: Floats) -> bool:
    """Whether a watch changes between two points; what leaves zero upwards, or at rest (a contact that lets go begins
    to part by its jerk alone), and does not fall at the end, has not: a first step of order 1 may pull it below.
    """
    row, side, small, rate, level, still = watch
    rises = rate >= 0 and side * low[row] <= level + small and min(side * low[rate], side * high[rate]) >= -still
    return bool(side * high[row] - level < -small and not rises)


def _first(
    dense: Dense,
    watches: Sequence[Watch],
    hit: list[int],
    low: tuple[float, Floats],
    high: tuple[float, Floats],
) -> tuple[float, list[int]]:
    found = {}
    for k in hit:
        found[k] = _instant(dense, watches[k], low, high)
    first = min(found.values())
    same = 8.0 * float(np.spacing(max(abs(low[0]), abs(high[0]))))
    return first, [k for k in hit if found[k] <= first + same]


def _instant(dense: Dense, watch: Watch, low: tuple[float, Floats], high: tuple[float, Floats]) -> float:
    """Where a watch falls through zero; what begins at zero and rises (a bounce lower than the tolerance) falls from
    its crest, or, where that is round-off too, through its tolerance.
    """
    row, side, small, rate, level, _ = watch
    begin, value = low[0], side * float(low[1][row]) - level
    if value <= 0.0 and rate >= 0 and side * float(low[1][rate]) > 0.0 > side * float(high[1][rate]):
        lower, upper = ((at, side * float(values[rate])) for at, values in (low, high))
        begin = _root(dense, rate, side, lower, upper)
        value = side * float(dense(begin)[row]) - level
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
    for _ in range(ITERATIONS):
        middle = 0.5 * (a + b)
        if not a < middle < b:
            break
        fm = side * float(dense(middle)[row]) - level
        root = math.sqrt(fm * fm - fa * fb)
        t = middle + (middle - a) * fm / root if root else middle
        if fm > 0.0:
            a, fa = middle, fm
        else:
            b, fb = middle, fm
        if a < t < b:
            ft = side * float(dense(t)[row]) - level
            if ft > 0.0:
                a, fa = t, ft
            else:
                b, fb = t, ft
        if b - a <= 2.0 * float(np.spacing(max(abs(a), abs(b)))) or fb == 0.0:
            break
    return b
