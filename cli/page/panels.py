"""How quantities of traces are laid out over time: panels by unit, curves, names of units.

Quantities of one unit share a panel where none is drowned by the others; where a trace holds derivatives,
curves are its cubic Hermite interpolant.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.failures import UsageError
from sysdyn.cli.page.unit_text import conversion
from sysdyn.runtime.comparison.curve import hermite
from sysdyn.runtime.trace.trace import Trace

Floats = NDArray[np.float64]

DROWNED = 12.0
"""A curve whose span is this many times smaller than its panel's is a line to the eye: it gets its own panel."""
SMOOTH = 2000
"""Points of a curve at least, where it is interpolated: some a pixel."""
COLOURS = ("#1f5fa8", "#d1495b", "#2f8f6b", "#e09f3e", "#7a4fa3", "#4aa5c4", "#8c5a3c", "#6b7280")


@dataclass(slots=True)
class Panel:
    """Quantities that share an axis: all of one unit."""

    unit: str
    low: float = float("inf")
    high: float = float("-inf")
    least: float = float("inf")
    names: list[str] = field(default_factory=list)

    def takes(self, unit: str, low: float, high: float) -> bool:
        """Whether a curve of that unit and range can be read here, and those already here still can."""
        if unit != self.unit:
            return False
        union = max(self.high, high) - min(self.low, low)
        smallest = min(self.least, high - low)
        return union <= DROWNED * smallest or union <= self.high - self.low == high - low

    def add(self, name: str, low: float, high: float) -> None:
        """One more curve."""
        self.names.append(name)
        self.low, self.high = min(self.low, low), max(self.high, high)
        self.least = min(self.least, high - low)


def panels_of(traces: Sequence[Trace], names: Sequence[str]) -> list[Panel]:
    """The layout: each quantity joins the first panel that takes it."""
    panels: list[Panel] = []
    for name in names:
        found = [trace for trace in traces if name in trace]
        unit = found[0][name].units
        values = np.concatenate([_values_in_unit(trace, name, unit)[0] for trace in found])
        values = values[np.isfinite(values)]
        low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
        panel = next((p for p in panels if p.takes(unit, low, high)), None)
        if panel is None:
            panel = Panel(unit)
            panels.append(panel)
        panel.add(name, low, high)
    return panels


def _values_in_unit(trace: Trace, name: str, unit: str) -> tuple[Floats, Floats | None]:
    """Values of a quantity and their derivative in a unit; UsageError where it is of another dimension."""
    quantity = trace[name]
    to = conversion(quantity.units, unit)
    if to is None:
        text = f"in {quantity.units} in {trace.path}, in {unit} in another trace"
        raise UsageError(f"'{name}' is {text}: a picture each")
    scale, offset = to
    return quantity.values * scale + offset, None if quantity.derivative is None else quantity.derivative * scale


def curve(trace: Trace, name: str, unit: str | None = None) -> tuple[Floats, Floats]:
    """Instants and values of a curve: those of the trace and, where it holds derivatives, of its Hermite interpolant
    between instants that lie far apart; between the two rows of a jump it is upright.  unit: None: its own.
    """
    time, (values, rate) = trace.time, _values_in_unit(trace, name, unit or trace[name].units)
    if rate is None or time.size < 2 or not np.all(np.diff(time) >= 0.0) or not time[-1] > time[0]:
        return time, values
    h = np.diff(time)
    parts = 1 + (SMOOTH * h / (time[-1] - time[0])).astype(int)
    piece = np.repeat(np.arange(h.size), parts)
    s = (np.arange(piece.size) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[piece]
    left, right = values[piece], values[piece + 1]
    with np.errstate(all="ignore"):
        inner, _ = hermite(s, h[piece], left, right, rate[piece], rate[piece + 1])
        # beside a kink the derivative may be no number: a straight line there
        inner = np.where(np.isfinite(inner), inner, left + (right - left) * s)
    inner[s == 0.0] = left[s == 0.0]
    return np.append(time[piece] + h[piece] * s, time[-1]), np.append(inner, values[-1])


def styled_curves(panel: Panel, traces: Sequence[tuple[str, Trace]]) -> Iterator[tuple[str, Trace, str, str, int]]:
    """Curves of a panel: name, trace, label, colour and the number of the dashes, that of the trace; where colours come
    again dashes go on.
    """
    single = len(panel.names) == 1
    for j, name in enumerate(panel.names):
        for k, (label, trace) in enumerate(traces):
            if name in trace:
                shown = name if len(traces) == 1 else label if single else f"{name}, {label}"
                colour = k if single else j
                again = colour // len(COLOURS) * (1 if single else len(traces))
                yield name, trace, shown, COLOURS[colour % len(COLOURS)], k + again


def in_order(names: Iterable[str]) -> list[str]:
    """Names with numbers in them as numbers count: x[2] before x[10]."""
    parts = {name: re.split(r"(\d+)", name) for name in names}
    return sorted(parts, key=lambda name: [(int(p), p) if k % 2 else (0, p) for k, p in enumerate(parts[name])])


def abbreviate(name: str, most: int) -> str:
    """A name in at most so many characters: its beginning and its end."""
    return name if len(name) <= most else f"{name[: most - most // 3 - 1]}…{name[-(most // 3) :]}"


def time_unit(traces: Sequence[Trace]) -> tuple[float, str]:
    """The unit in which the longest run has a handy length."""
    span = max((float(t.time[-1] - t.time[0]) for t in traces if t.time.size), default=1.0)
    for scale, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
        if span * scale >= 0.3:
            return scale, unit
    return 1e9, "ns"


def unit_text(unit: str) -> str:
    """A unit as it is printed: 'kg.m2.s-2' is 'kg·m²·s⁻²'."""
    if unit in ("1", ""):
        return ""
    found = []
    for before, character in zip(" " + unit, unit, strict=False):
        raised = (character in "0123456789-" and before not in " .(/*") or (character.isdigit() and before == "-")
        found.append(character.translate(_RAISED) if raised else "·" if character == "." else character)
    return "".join(c for c in found if c != "^")


_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
