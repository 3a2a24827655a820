"""The tube in value and time: how far one curve lies outside the tube around another.

At instant t the tube around r reaches from min r - eps to max r + eps over the instants within tau of t.  Inside a cell
in which no row or extremum of r, moved by tau, lies, max r over the window is the largest of r(t - tau), r(t + tau) and
the rows within; so s is inside where the least of three cubics is at most eps.  Cells for which the bound of that does
not decide are halved.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.comparison.curve import (
    Curve,
    Floats,
    Ints,
    bernstein,
    cells_at,
    largest,
    value_at,
    with_extrema,
)
from sysdyn.values import dataclass

HALVINGS = 16
"""What is then undecided counts as outside: it is within 2^-16 of a cell of the tube's border."""
MANY = 1 << 18
"""Cells that may wait for a decision."""


@dataclass(frozen=True, slots=True)
class Outside:
    """distance [m] from the band of each cell (0 inside it, without eps), and where it is largest [m] s."""

    distance: Floats
    time: Floats


def outside(ref: Curve, test: Curve, left: Floats, right: Floats, moment: Floats, eps: float, tau: float) -> Outside:
    """How far the curves leave each other's tube in cells [left, right], ascending; the larger of both directions.

    moment [m] s: where the curves differ most in each cell.  Both curves reach tau beyond the cells where they exist
    there.  Cells hold no row of either curve inside.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        # each curve against the tube of the other: neither may leave it
        one = _one_way(with_extrema(ref), test, left, right, moment, eps, tau)
        two = _one_way(with_extrema(test), ref, left, right, moment, eps, tau)
    first = one.distance >= two.distance
    return Outside(np.where(first, one.distance, two.distance), np.where(first, one.time, two.time))


def band(curve: Curve, instant: float, tau: float) -> tuple[float, float]:
    """Least and largest value of a curve within tau of an instant; (inf, -inf) where it has none there."""
    time = curve.time
    # rows within tau, then values at the edges
    inside = curve.values[np.searchsorted(time, instant - tau) : np.searchsorted(time, instant + tau, side="right")]
    found = list(inside[np.isfinite(inside)])
    edges = np.array([t for t in (instant - tau, instant, instant + tau) if time[0] <= t <= time[-1]])
    # a curve of one instant has no cells
    if time.size > 1 and edges.size and time[-1] > time[0]:
        cell = cells_at(time, edges)
        b = bernstein(curve, cell, edges, edges)[0]
        found += list(b[np.isfinite(b)])
    return (min(found), max(found)) if found else (np.inf, -np.inf)


def _one_way(r: Curve, s: Curve, left: Floats, right: Floats, moment: Floats, eps: float, tau: float) -> Outside:
    """Distance of s from the band around r; r is monotone in its cells."""
    left, right, owner = _divide_cells(r, left, right, moment, tau)
    distance = np.zeros(int(owner[-1]) + 1 if owner.size else 0)
    time = np.zeros_like(distance)
    tables = (_Ranges(r.values), _Ranges(-r.values))

    def record(owner: Ints, found: Floats, at: Floats) -> None:
        order = np.argsort(found, kind="stable")  # the last write wins: the largest
        o, f, a = owner[order], found[order], at[order]
        # better than what this cell has
        better = f > distance[o]
        distance[o[better]], time[o[better]] = f[better], a[better]

    for halving in range(HALVINGS + 1):
        if not left.size:
            break
        # bound from above, sampled from below
        bound, sampled, at = _excess(r, s, left, right, tau, tables)
        record(owner, sampled, at)
        # undecided: the samples are inside, the bound is not
        open_ = (bound > eps) & (sampled <= eps)
        # too many or too small: the bound counts
        if halving == HALVINGS or 2 * np.count_nonzero(open_) > MANY:
            record(owner[open_], bound[open_], at[open_])
            break
        left, right, owner = left[open_], right[open_], owner[open_]
        middle = 0.5 * (left + right)
        # a part that cannot be halved is as good as decided
        whole = (middle > left) & (middle < right)
        record(owner[~whole], bound[open_][~whole], left[~whole])
        left, middle, right, owner = left[whole], middle[whole], right[whole], owner[whole]
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
        owner = np.concatenate([owner, owner])
    return Outside(distance, time)


def _divide_cells(r: Curve, left: Floats, right: Floats, moment: Floats, tau: float) -> tuple[Floats, Floats, Ints]:
    """Cells divided at `moment` and at rows of r, moved by tau or not; owner: the cell that each part is of."""
    # all instants at which the band changes its shape
    cuts = np.concatenate([moment, r.time, r.time - tau, r.time + tau])
    cell = np.searchsorted(left, cuts, side="right") - 1
    inside = (cell >= 0) & (cuts > left[cell]) & (cuts < right[cell])
    starts = np.concatenate([left, cuts[inside]])
    owner = np.concatenate([np.arange(left.size), cell[inside]])
    order = np.lexsort((starts, owner))
    starts, owner = starts[order], owner[order]
    last = np.append(owner[1:] != owner[:-1], True)
    # of each part the end is the begin of the next, of the last the cell's
    ends = np.where(last, right[owner], np.append(starts[1:], 0.0))
    proper = ends > starts
    proper |= right[owner] <= left[owner]
    return starts[proper], ends[proper], owner[proper].astype(np.int64)


def _excess(
    r: Curve, s: Curve, left: Floats, right: Floats, tau: float, tables: tuple[_Ranges, _Ranges]
) -> tuple[Floats, Floats, Floats]:
    """(upper bound [m] of the distance in each part, the distance sampled at both ends and the middle, where) ."""
    middle = 0.5 * (left + right)
    # s on each part, as Bernstein coefficients
    own = bernstein(s, cells_at(s.time, middle), left, right)
    sides = []
    # r shifted by tau both ways: the band's edges where r is monotone
    for shift in (-tau, tau):
        there = middle + shift
        b = bernstein(r, cells_at(r.time, there), left + shift, right + shift)
        # beyond r's ends there is no edge
        b[:, (there < r.time[0]) | (there > r.time[-1])] = np.nan
        sides.append(b)
    # rows of r within tau: the extrema in the band
    low = np.searchsorted(r.time, middle - tau, side="left")
    high = np.searchsorted(r.time, middle + tau, side="right")
    bound, sampled = np.zeros(left.size), np.zeros((3, left.size))
    x = np.array([0.0, 0.5, 1.0])
    # above the band, then below it
    for sign, table in zip((1.0, -1.0), tables, strict=True):
        top = table.largest(low, high)
        # s is above the band only where it is above all three
        differences = [sign * (own - b) for b in sides] + [sign * own - top]
        bounds = [np.where(np.isnan(d).any(axis=0), np.inf, largest(d)) for d in differences]
        bound = np.maximum(bound, np.minimum.reduce(bounds))
        for k, place in enumerate(x):
            values = [value_at(d, np.full(left.size, place)) for d in differences]
            least = np.minimum.reduce([np.where(np.isnan(v), np.inf, v) for v in values])
            sampled[k] = np.maximum(sampled[k], least)
    worst = np.argmax(sampled, axis=0)
    return bound, sampled[worst, np.arange(left.size)], left + x[worst] * (right - left)


class _Ranges:
    """Largest of any range of rows (a sparse table, made as far as it is asked for)."""

    def __init__(self, values: Floats) -> None:
        self._levels = [np.where(np.isfinite(values), values, -np.inf)]

    def largest(self, low: Ints, high: Ints) -> Floats:
        """Largest of rows low..high-1 [m]; -inf where there is none."""
        count = high - low
        found = np.full(count.size, -np.inf)
        level = np.frexp(np.maximum(count, 1).astype(np.float64))[1] - 1
        for k in np.unique(level[count > 0]):
            # levels are built when they are first needed
            while len(self._levels) <= k:
                last, step = self._levels[-1], 1 << (len(self._levels) - 1)
                self._levels.append(np.maximum(last[:-step], last[step:]))
            here = (level == k) & (count > 0)
            table = self._levels[k]
            found[here] = np.maximum(table[low[here]], table[high[here] - (1 << int(k))])
        return found
