"""Interpolation tables as numbers: piecewise cubics of one argument, bilinear grids of two.

One argument, n breakpoints: the breakpoints, then n + 1 rows (c0, c1, c2, c3) of powers of the distance from the left
breakpoint; row 0 holds before the first breakpoint (distance from it), row n after the last.  pchip: Fritsch & Carlson
1980, slopes by the weighted harmonic mean, three-point formula at the ends; cubic: not-a-knot spline.
Two arguments: both breakpoint lists, then the values row by row.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.dsl.model.network import Table

Array = NDArray[np.float64]
ROUND_OFF = 1e-12
"""Of a table's range: what its argument may pass the end by."""


def numbers(table: Table) -> Array:
    """What stands in p for a table."""
    axes = [np.asarray(points, dtype=float) for points in table.points]
    values = np.asarray(table.values, dtype=float)
    if len(axes) == 1:
        rows = coefficients(axes[0], values, table.method, table.outside)
        return np.concatenate((_lookup_points(axes[0], table.outside), rows.ravel()))
    return np.concatenate((axes[0], axes[1], values))


def _lookup_points(x: Array, outside: str) -> Array:
    """The breakpoints that pieces are looked up by: of a table that stops, the last one still belongs to its piece."""
    if outside != "stop":
        return x
    return np.append(x[:-1], x[-1] + ROUND_OFF * (x[-1] - x[0]))


def coefficients(x: Array, z: Array, method: str, outside: str) -> Array:
    """(n + 1, 4) coefficients of the pieces, those before and after the data included (no numbers: it stops)."""
    h = np.diff(x)
    if method == "hold":
        inner = np.zeros((len(h), 4))
        inner[:, 0] = z[:-1]
        slopes = np.zeros(len(x))
    else:
        secants = np.diff(z) / h
        slopes = _slopes(x, z, h, secants, method)
        inner = _hermite(z, h, secants, slopes) if method != "linear" else _lines(z, secants)
    ends = np.zeros((2, 4))
    ends[:, 0] = z[0], z[-1]
    if outside == "extend":
        ends[:, 1] = slopes[0], slopes[-1]
    if outside == "stop":
        ends[:] = np.nan
    return np.concatenate((ends[:1], inner, ends[1:]))


def _lines(z: Array, secants: Array) -> Array:
    inner = np.zeros((len(secants), 4))
    inner[:, 0] = z[:-1]
    inner[:, 1] = secants
    return inner


def _hermite(z: Array, h: Array, secants: Array, slopes: Array) -> Array:
    """Cubic pieces with given values and slopes at both ends."""
    left, right = slopes[:-1], slopes[1:]
    c2 = (3 * secants - 2 * left - right) / h
    c3 = (left + right - 2 * secants) / h**2
    return np.stack((z[:-1], left, c2, c3), axis=1)


def _slopes(x: Array, z: Array, h: Array, secants: Array, method: str) -> Array:
    """Slopes at the breakpoints (of linear: those at the two ends count)."""
    if method == "linear" or len(x) == 2:
        return np.concatenate((secants[:1], secants))
    if method == "pchip":
        return _monotone(h, secants)
    return _not_a_knot(x, h, secants)


def _monotone(h: Array, d: Array) -> Array:
    slopes = np.zeros(len(h) + 1)
    w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    same = d[:-1] * d[1:] > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (w1 + w2) / (w1 / d[:-1] + w2 / d[1:])
    slopes[1:-1] = np.where(same, mean, 0.0)
    slopes[0] = _end(h[0], h[1], d[0], d[1])
    slopes[-1] = _end(h[-1], h[-2], d[-1], d[-2])
    return slopes


def _end(h0: float, h1: float, d0: float, d1: float) -> float:
    """Three-point slope at an end, cut so that the data's shape is kept."""
    slope = ((2 * h0 + h1) * d0 - h0 * d1) / (h0 + h1)
    if np.sign(slope) != np.sign(d0):
        return 0.0
    return 3 * d0 if np.sign(d0) != np.sign(d1) and abs(slope) > 3 * abs(d0) else slope


def _not_a_knot(x: Array, h: Array, d: Array) -> Array:
    """Slopes of the spline whose third derivative is continuous at the second and last but one breakpoint."""
    n = len(x)
    if n == 3:  # one parabola
        first = d[0] - h[0] * (d[1] - d[0]) / (h[0] + h[1])
        return np.array([first, 2 * d[0] - first, 2 * d[1] - (2 * d[0] - first)])
    lower, main, upper, right = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    lower[1:-1], main[1:-1], upper[1:-1] = h[1:], 2 * (h[:-1] + h[1:]), h[:-1]
    right[1:-1] = 3 * (h[1:] * d[:-1] + h[:-1] * d[1:])
    main[0], upper[0], s = h[1], h[0] + h[1], h[0] + h[1]
    right[0] = ((h[0] + 2 * s) * h[1] * d[0] + h[0] ** 2 * d[1]) / s
    main[-1], lower[-1], s = h[-2], h[-1] + h[-2], h[-1] + h[-2]
    right[-1] = (h[-1] ** 2 * d[-2] + (2 * s + h[-1]) * h[-2] * d[-1]) / s
    return _tridiagonal(lower, main, upper, right)


def _tridiagonal(lower: Array, main: Array, upper: Array, right: Array) -> Array:
    """Gaussian elimination without pivoting: the matrix is close to diagonally dominant."""
    main, right = main.copy(), right.copy()
    for k in range(1, len(main)):
        factor = lower[k] / main[k - 1]
        main[k] -= factor * upper[k - 1]
        right[k] -= factor * right[k - 1]
    solution = right / main
    for k in range(len(main) - 2, -1, -1):
        solution[k] = (right[k] - upper[k] * solution[k + 1]) / main[k]
    return solution


def evaluate(table: Table, arguments: list[Any], orders: tuple[int, ...]) -> Any:
    """Values of a table or of its derivatives, straight from the definition (the emitters' oracle)."""
    if len(arguments) > 1:
        return _bilinear(table, arguments, orders)
    u, order = np.asarray(arguments[0], dtype=float), orders[0]
    x = np.asarray(table.points[0], dtype=float)
    rows = coefficients(x, np.asarray(table.values, dtype=float), table.method, table.outside)
    piece = np.sum(u[..., None] >= _lookup_points(x, table.outside), axis=-1)
    distance = u - x[np.maximum(piece - 1, 0)]
    value = np.zeros_like(u)
    for power in range(order, 4):
        value = value + rows[piece, power] * np.prod(np.arange(power - order + 1, power + 1)) * distance ** (
            power - order
        )
    return value


def _bilinear(table: Table, arguments: list[Any], orders: tuple[int, ...]) -> Any:
    """Bilinear interpolation in two arguments and its first derivatives; higher ones are zero."""
    x, z = (np.asarray(points, dtype=float) for points in table.points)
    g = np.asarray(table.values, dtype=float).reshape(len(x), len(z))
    if max(orders) > 1:
        return np.zeros(np.broadcast(*arguments).shape)
    parts = []
    # in each argument the cell, and the weights of its two ends
    for axis, u, order in zip((x, z), arguments, orders, strict=True):
        held = np.clip(u, axis[0], axis[-1]) if table.outside != "extend" else np.asarray(u)
        i = np.clip(np.searchsorted(axis, held, side="right") - 1, 0, len(axis) - 2)
        h = axis[i + 1] - axis[i]
        pair = (1 - (held - axis[i]) / h, (held - axis[i]) / h) if order == 0 else (-1 / h, 1 / h)
        # a clamped argument has no slope; beyond a table that stops there is no value
        live = np.where((held != u) & (order > 0), 0.0, 1.0)
        if table.outside == "stop":
            live = np.where(held != u, np.nan, live)
        parts.append((i, live * pair[0], live * pair[1]))
    (i, a0, a1), (j, b0, b1) = parts
    return a0 * (b0 * g[i, j] + b1 * g[i, j + 1]) + a1 * (b0 * g[i + 1, j] + b1 * g[i + 1, j + 1])
