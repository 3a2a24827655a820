"""Curves over time as stored: rows of time, value and, where known, rate; between rows a cubic or a line.

Cubic Hermite interpolation where both rows of a cell have a rate, linear else (then both slopes are the secant's).
On a part [a, b] of a cell the curve is kept as its Bernstein coefficients: its values lie between the least and the
largest of them, and its extremum follows from the quadratic derivative in closed form
(Farin, Curves and Surfaces for CAGD, 5.1 and 6.1).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.values import dataclass

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Curve:
    """time [n] s, not falling (equal instants: a jump); values [n]; rates [n] unit/s, NaN where unknown."""

    time: Floats
    values: Floats
    rates: Floats | None = None


def cells_at(time: Floats, instants: Floats) -> Ints:
    """The cell [time[k], time[k+1]] whose interior, or left end, holds each instant [m]; k clipped to 0..n-2."""
    k = np.searchsorted(time, instants, side="right") - 1
    return np.clip(k, 0, max(time.size - 2, 0)).astype(np.int64)


def bernstein(curve: Curve, cell: Ints, left: Floats, right: Floats) -> Floats:
    """Coefficients [4, m] of the curve on parts [left, right] of its cells [m]; NaN where a row is not finite."""
    # ends of the cells
    t0, y0, y1 = curve.time[cell], curve.values[cell], curve.values[cell + 1]
    h = curve.time[cell + 1] - t0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        secant = (y1 - y0) / h
        # without rates: lines
        if curve.rates is None:
            m0 = m1 = secant
        else:
            # a cubic by values and rates; a line where a rate is missing
            m0, m1 = curve.rates[cell], curve.rates[cell + 1]
            line = ~(np.isfinite(m0) & np.isfinite(m1))
            if line.any():
                m0, m1 = np.where(line, secant, m0), np.where(line, secant, m1)
        # Bernstein coefficients from values and slopes at both ends of the part
        third = (right - left) / 3.0
        ya, ma = hermite((left - t0) / h, h, y0, y1, m0, m1)
        yb, mb = hermite((right - t0) / h, h, y0, y1, m0, m1)
        return np.stack([ya, ya + third * ma, yb - third * mb, yb])


def whole_cells(curve: Curve, cell: Ints) -> Floats:
    """Coefficients [4, m] of whole cells: `bernstein` without its evaluation, bit for bit the rows' own values."""
    # ends of the cells, and a third of their widths times the slopes
    y0, y1 = curve.values[cell], curve.values[cell + 1]
    h = curve.time[cell + 1] - curve.time[cell]
    with np.errstate(invalid="ignore", over="ignore"):
        third = (y1 - y0) / 3.0
        # without rates: lines
        if curve.rates is None:
            return np.stack([y0, y0 + third, y1 - third, y1])
        a, b = curve.rates[cell] * (h / 3.0), curve.rates[cell + 1] * (h / 3.0)
        line = ~(np.isfinite(a) & np.isfinite(b))
        if line.any():
            a, b = np.where(line, third, a), np.where(line, third, b)
        return np.stack([y0, y0 + a, y1 - b, y1])


def hermite(x: Floats, h: Floats, y0: Floats, y1: Floats, m0: Floats, m1: Floats) -> tuple[Floats, Floats]:
    """Value and slope at x (0..1 over the cell); exact at the ends."""
    u = 1.0 - x
    value = u * u * ((1.0 + 2.0 * x) * y0 + x * h * m0) + x * x * ((1.0 + 2.0 * u) * y1 - u * h * m1)
    slope = 6.0 * x * u * (y1 - y0) / h + u * (1.0 - 3.0 * x) * m0 + x * (1.0 - 3.0 * u) * m1
    return value, slope


def turning_points(b: Floats) -> Floats:
    """Where the derivative vanishes, x in 0..1 [2, m]; NaN where there is none inside."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        d0, d1, d2 = b[1] - b[0], b[2] - b[1], b[3] - b[2]
        # d0 (1-x)^2 + 2 d1 x (1-x) + d2 x^2 = p x^2 + 2 q x + d0
        p, q = d0 - 2.0 * d1 + d2, d1 - d0
        w = -(q + np.copysign(np.sqrt(q * q - p * d0), q))  # the root without cancellation; the other is d0 / w
        x = np.stack([w / p, d0 / w])
        return np.where((x > 0.0) & (x < 1.0), x, np.nan)


def value_at(b: Floats, x: Floats) -> Floats:
    """Values at x (0..1) of the cubics [4, m]."""
    u = 1.0 - x
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(((b[0] * u + 3.0 * b[1] * x) * u + 3.0 * b[2] * x * x) * u + b[3] * x * x * x)


def largest(b: Floats) -> Floats:
    """Largest value [m] on each part; NaN where it is not defined."""
    top = np.maximum(b[0], b[3])
    return np.asarray(np.fmax(top, np.fmax(*value_at(b, turning_points(b)))))


def largest_magnitude(b: Floats) -> tuple[Floats, Floats]:
    """(largest absolute value [m], its place x in 0..1 [m])."""
    inner = turning_points(b)
    # candidates: both ends and the turning points inside
    x = np.stack([np.zeros(b.shape[1]), np.ones(b.shape[1]), inner[0], inner[1]])
    size = np.abs(np.stack([b[0], b[3], *value_at(b, inner)]))
    at = np.argmax(np.where(np.isnan(size), -1.0, size), axis=0)
    here = np.arange(b.shape[1])
    return size[at, here], x[at, here]


def with_extrema(curve: Curve) -> Curve:
    """The curve with a row more at each of its extrema: monotone in every cell."""
    # cells of no width (jumps) have no inside
    cell = np.flatnonzero(np.diff(curve.time) > 0.0)
    b = whole_cells(curve, cell)
    x = turning_points(b)
    # the turning points that exist, as rows in time
    where, found = np.nonzero(np.isfinite(x))
    at = x[where, found]
    start = curve.time[cell[found]]
    time = start + at * (curve.time[cell[found] + 1] - start)
    values = value_at(b[:, found], at)
    # rates of every row on both sides: rows are doubled so that lines and cubics may meet
    order = np.lexsort((time, cell[found]))
    place = cell[found][order] + 1
    rates = curve.rates if curve.rates is not None else np.full(curve.time.size, np.nan)
    return Curve(
        np.insert(curve.time, place, time[order]),
        np.insert(curve.values, place, values[order]),
        np.insert(rates, place, np.zeros(place.size)),
    )
