"""Fewer rows for the same curves: what a cubic between kept rows tells within a limit is left out.

Begins with the ends (and both sides of jumps) and divides a stretch at its worst row until the difference between the
Hermite cubic of the kept rows and every cell of the full curve, bounded by Bernstein coefficients, is within the limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.comparison.curve import Curve, Floats, Ints, bernstein, whole_cells

CLOSE = tuning.INSTANT
"""Of the span: rows nearer than this are the two sides of a jump or kink."""


def thin_rows(curves: Sequence[Curve], limits: Floats, kept_as: Sequence[Curve] | None = None) -> Ints:
    """Rows to keep of curves on one time [n]; limits [curves]: largest difference in each one's unit.

    kept_as: the same rows with the rates that are kept (those of a curve without rates are estimated).
    """
    kept_as = curves if kept_as is None else kept_as
    time = curves[0].time
    span = float(time[-1] - time[0])
    # rows of one instant (jumps) make no cell
    cell = np.flatnonzero(np.diff(time) > 0.0)
    if not cell.size:
        return np.arange(time.size)
    full = np.stack([whole_cells(c, cell) for c in curves])  # [curves, 4, cells]
    scale = np.where(limits > 0.0, limits, np.finfo(float).tiny)[:, None, None]
    row = np.searchsorted(cell, np.arange(time.size))  # first cell at or after a row
    # rows close to each other (events) are kept, and the ends
    near = np.flatnonzero(np.diff(time) <= CLOSE * span)
    kept = set(near.tolist()) | set((near + 1).tolist()) | {0, time.size - 1}
    starts = sorted(kept)
    waiting = list(pairwise(starts))
    # divide and conquer: a stretch is one cubic, or is cut where that is worst
    while waiting:
        a, b = waiting.pop()
        if b - a < 2:
            continue
        part = slice(row[a], row[b])
        left, right = time[cell[part]], time[cell[part] + 1]
        ends = np.array([a, b])
        zero = np.zeros(left.size, dtype=np.int64)
        with np.errstate(over="ignore", invalid="ignore"):
            whole = np.stack([bernstein(_interpolate(c, ends), zero, left, right) for c in kept_as])
            off = np.nan_to_num(np.abs(whole - full[:, :, part]) / scale, nan=np.inf).max(axis=(0, 1))
        # within the limit: no row between is needed
        if off.max() <= 1.0:
            continue
        # at the worst row, but never at an end
        worst = int(cell[row[a] + int(np.argmax(off))])
        middle = min(max(worst + (worst - a < b - worst), a + 1), b - 1)
        kept.add(middle)
        waiting += [(a, middle), (middle, b)]
    return np.array(sorted(kept), dtype=np.int64)


def _interpolate(curve: Curve, rows: Ints) -> Curve:
    return Curve(curve.time[rows], curve.values[rows], None if curve.rates is None else curve.rates[rows])


def estimated_rates(time: Floats, values: Floats, limit: float) -> Floats:
    """Rates [n] of a quantity that has none stored, from the parabola through each row and its neighbours.

    NaN (a line) where the cubic that follows from them leaves the line between two rows by more than the limit.
    """
    if time.size < 3:
        return np.full(time.size, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        h = np.diff(time)
        slope = np.diff(values) / h
        # slope of the parabola at its middle row; at the ends by extrapolation
        inner = (h[1:] * slope[:-1] + h[:-1] * slope[1:]) / (h[:-1] + h[1:])
        first, last = 2.0 * slope[0] - inner[0], 2.0 * slope[-1] - inner[-1]
        rates = np.concatenate([[first], inner, [last]])
        # the cubic leaves the line by at most 4/27 h (|m0 - s| + |m1 - s|)
        off = 4.0 / 27.0 * h * (np.abs(rates[:-1] - slope) + np.abs(rates[1:] - slope))
    # a kink or a jump: lines on both sides
    bad = np.flatnonzero(~(off <= limit))
    rates[bad] = rates[bad + 1] = np.nan
    return rates


def round_to_step(values: Floats, step: float) -> Floats:
    """Values as multiples of the power of two at or below a step: off by at most half of it, and short when packed."""
    # no step: values as they are
    if not (step > 0.0 and np.isfinite(step)):
        return values
    unit = 2.0 ** np.floor(np.log2(step))
    with np.errstate(over="ignore", invalid="ignore"):
        found = np.round(values / unit) * unit
    # overflow: the value itself
    return np.where(np.isfinite(found), found, values)
