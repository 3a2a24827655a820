"""Static SVG pictures of curves: the frame, its axes, and as many points of a curve as can be seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from sysdyn.runtime.comparison.curve import Curve, Floats, bernstein, cells_at
from sysdyn.runtime.comparison.verdict import Source
from sysdyn.values import dataclass

COLUMNS = 460
WIDTH, HEIGHT = 560, 260
LEFT, RIGHT, TOP, BOTTOM = 74, 12, 14, 40


def outline(source: Source, name: str, low: float, high: float, scale: float = 1.0) -> list[tuple[Floats, Floats]]:
    """Unbroken pieces (time, values) of a quantity in a window, as many points as can be seen.

    scale: of the source's time to s.
    """
    time = source.time * scale
    # the window, and an instant beyond it on each side
    a = max(int(np.searchsorted(time, low, side="left")) - 1, 0)
    b = min(int(np.searchsorted(time, high, side="right")) + 1, time.size)
    values, rates = source.read(name, a, b)
    time = time[a:b]
    # many points: least and largest of each column
    if time.size > 2 * COLUMNS:
        edges = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], COLUMNS + 1)[:-1]))
        with np.errstate(invalid="ignore"):
            least, most = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
        x, y = np.repeat(time[edges], 2), np.stack([least, most], axis=1).ravel()
    # few: the curve between them
    elif time.size > 1 and time[-1] > time[0]:
        grid = np.linspace(max(low, time[0]), min(high, time[-1]), COLUMNS)
        curve = Curve(time, values, None if rates is None else rates / scale)
        inner = bernstein(curve, cells_at(time, grid), grid, grid)[0]
        x, y = np.concatenate([grid, time]), np.concatenate([inner, values])
        order = np.argsort(x, kind="stable")
        x, y = x[order], y[order]
    else:
        x, y = time, values
    inside = (x >= low) & (x <= high)
    x, y = x[inside], y[inside]
    # what is no number interrupts the line
    breaks = np.flatnonzero(np.diff(np.isfinite(y).astype(int)) != 0) + 1
    pieces = zip(np.split(x, breaks), np.split(y, breaks), strict=True)
    return [(px, py) for px, py in pieces if py.size and np.isfinite(py).all()]


@dataclass(frozen=True, slots=True)
class PlotFrame:
    """Where values stand in a picture."""

    low: float
    high: float
    bottom: float
    top: float

    def across(self, time: Any) -> Any:
        """Pixels from the left."""
        return LEFT + (time - self.low) / (self.high - self.low) * (WIDTH - LEFT - RIGHT)

    def y_pixels(self, value: Any) -> Any:
        """Pixels from the top."""
        return HEIGHT - BOTTOM - (value - self.bottom) / (self.top - self.bottom) * (HEIGHT - TOP - BOTTOM)

    def points(self, x: Floats, y: Floats) -> list[str]:
        """A line's points."""
        return [f"{u:.1f},{v:.1f}" for u, v in zip(self.across(x), self.y_pixels(y), strict=True)]


def frame_around(low: float, high: float, values: Sequence[Floats]) -> PlotFrame | None:
    """The frame around some values; None where there is nothing to draw."""
    if not values or not high > low:
        return None
    bottom, top = min(float(y.min()) for y in values), max(float(y.max()) for y in values)
    margin = 0.05 * (top - bottom) or 0.05 * abs(top) or 1.0
    frame = PlotFrame(low, high, bottom - margin, top + margin)
    return frame if math.isfinite(frame.top - frame.bottom) and frame.top > frame.bottom else None


def axes(frame: PlotFrame, time_unit: str, unit: str) -> list[str]:
    """Grid, ticks and units."""
    parts = []
    for value, label in ticks(frame.low, frame.high, 6):
        u = frame.across(value)
        parts.append(f'<line class="grid" x1="{u:.1f}" x2="{u:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
        parts.append(f'<text x="{u:.1f}" y="{HEIGHT - BOTTOM + 14}" text-anchor="middle">{label}</text>')
    for value, label in ticks(frame.bottom, frame.top, 5):
        v = frame.y_pixels(value)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{v:.1f}" y2="{v:.1f}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{v + 4:.1f}" text-anchor="end">{label}</text>')
    right = f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 6}" text-anchor="end">time [{escape(time_unit)}]</text>'
    return [*parts, right, f'<text x="4" y="{TOP - 3}">[{escape(unit)}]</text>']


def ticks(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """Round numbers of an axis with labels that tell them apart."""
    raw = (high - low) / count
    size = 10.0 ** math.floor(math.log10(raw))
    step = next(size * k for k in (1.0, 2.0, 5.0, 10.0) if size * k >= raw * (1 - 1e-9))
    first = math.ceil(low / step)
    values = [k * step for k in range(first, first + 2 * count + 2) if k * step <= high + 1e-9 * step]
    largest = max((abs(v) for v in values), default=step)
    digits = min(max(1 + math.floor(math.log10(max(largest / step, 1.0)) + 1e-9), 1) + 1, 15)
    return [(v, f"{v:.{digits}g}") for v in values]
