"""Curves over time as PNG or SVG: panels by unit, one picture of the same data always the same bytes.

Quantities of one unit share a panel where none is drowned by the others; where a trace holds derivatives and few
instants, curves are its cubic Hermite interpolant.
"""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.trace import Trace

Floats = NDArray[np.float64]

DROWNED = 12.0
"""A curve whose span is this many times smaller than its panel's is a line to the eye: it gets its own panel."""
SMOOTH = 600
"""Traces of fewer instants are interpolated: about one point a pixel."""
COLOURS = ("#1f5fa8", "#d1495b", "#2f8f6b", "#e09f3e", "#7a4fa3", "#4aa5c4", "#8c5a3c", "#6b7280")
STYLES = ("-", "--", ":", "-.")
STYLE: dict[str, Any] = {
    "axes.edgecolor": "#9aa0a6",
    "axes.grid": True,
    "axes.labelcolor": "#30343b",
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "figure.dpi": 120,
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "grid.color": "#e4e7eb",
    "grid.linewidth": 0.8,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "path.simplify": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "sysdyn",
    "text.color": "#30343b",
    "text.parse_math": False,
    "xtick.color": "#5f6670",
    "ytick.color": "#5f6670",
}


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
        found = [trace[name] for trace in traces if name in trace]
        values = np.concatenate([q.values[np.isfinite(q.values)] for q in found])
        low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
        unit = found[0].units
        panel = next((p for p in panels if p.takes(unit, low, high)), None)
        if panel is None:
            panel = Panel(unit)
            panels.append(panel)
        panel.add(name, low, high)
    return panels


def picture(traces: Sequence[tuple[str, Trace]], names: Sequence[str], kind: str) -> bytes:
    """The picture of the named quantities of (label, trace) pairs; kind is png or svg."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # says that it builds its font cache
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = panels_of([t for _, t in traces], names)
    columns = 1 if len(panels) <= 6 else 2
    rows = -(-len(panels) // columns)
    with warnings.catch_warnings(), mpl.rc_context(_style(mpl.rcParamsDefault)):
        warnings.simplefilter("ignore")  # names in scripts that the font lacks
        height = 1.0 + rows * max(1.9 if rows > 1 else 3.2, 2.6 - 0.2 * rows)
        figure = Figure(figsize=(7.2 * columns if columns == 1 else 11.0, height), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
        scale, time_unit = _time_unit([t for _, t in traces])
        for position, axis in enumerate(axes.T.flat):
            if position < len(panels):
                _draw(axis, panels[position], traces, scale)
            else:
                axis.set_visible(False)
        for column in range(columns):
            last = axes[min(rows, len(panels) - column * rows) - 1, column]
            last.set_xlabel(f"time, {time_unit}")
            last.tick_params(labelbottom=True)
        _head(axes[0], traces)
        figure.align_ylabels()
        data = io.BytesIO()
        none = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(data, format=kind, metadata=none)
    return data.getvalue()


def _style(defaults: Any) -> Any:
    """Matplotlib's own settings under ours: a person's configuration does not change a picture."""
    return {**defaults, **STYLE, "backend": "agg"}


def _head(axes: Any, traces: Sequence[tuple[str, Trace]]) -> None:
    """Titles: what was run on the left, how on the right."""
    titles = dict.fromkeys(str(t.attributes.get("title", label)) for label, t in traces)
    axes[0].set_title(" and ".join(titles), fontweight="bold", fontsize=11, pad=10)
    if len(traces) > 1:
        return
    trace = traces[0][1]
    how = [str(trace.attributes[a]) for a in ("formulation", "method") if trace.attributes.get(a)]
    if not trace.final:
        how.append("not final")
    axes[-1].set_title(", ".join(how), loc="right", fontsize=8.5, color="#7b828c", pad=10)


def _draw(axis: Any, panel: Panel, traces: Sequence[tuple[str, Trace]], scale: float) -> None:
    single = len(panel.names) == 1
    curves = []
    for j, name in enumerate(panel.names):
        for k, (label, trace) in enumerate(traces):
            if name not in trace:
                continue
            time, values = curve(trace, name)
            colour = COLOURS[(k if single else j) % len(COLOURS)]
            shown = name if len(traces) == 1 else label if single else f"{name}, {label}"
            (line,) = axis.plot(time * scale, values, STYLES[k % len(STYLES)], color=colour)
            curves.append((line, _legible(shown)))
    unit = unit_text(panel.unit)
    if single:
        axis.set_ylabel(", ".join(filter(None, [_legible(panel.names[0]), unit])))
    else:
        axis.set_ylabel(unit)
    if len(curves) > 1:
        lines, labels = zip(*curves, strict=True)
        axis.legend(lines, labels, loc="upper left", bbox_to_anchor=(1.0, 1.03), fontsize=8.5)
    axis.margins(x=0.0, y=0.08)
    axis.ticklabel_format(axis="y", scilimits=(-3, 4), useOffset=panel.high - panel.low < 1e-5 * abs(panel.high))


def curve(trace: Trace, name: str) -> tuple[Floats, Floats]:
    """Instants and values of a curve: those of the trace, or of its Hermite interpolant where it holds few."""
    quantity = trace[name]
    time, values, rate = trace.time, quantity.values, quantity.derivative
    if rate is None or not 2 <= time.size < SMOOTH or not np.all(np.diff(time) > 0.0):
        return time, values
    parts = SMOOTH // time.size + 1
    s = np.arange(parts) / parts
    h = np.diff(time)[:, None]
    left, right = values[:-1, None], values[1:, None]
    inner = (
        left * (1.0 + 2.0 * s) * (1.0 - s) ** 2
        + right * s**2 * (3.0 - 2.0 * s)
        + h * (rate[:-1, None] * s * (1.0 - s) ** 2 + rate[1:, None] * s**2 * (s - 1.0))
    )
    # beside a kink the derivative may be no number: a straight line there
    inner = np.where(np.isfinite(inner), inner, left + (right - left) * s)
    fine = time[:-1, None] + h * s
    return np.append(fine.ravel(), time[-1]), np.append(inner.ravel(), values[-1])


def _time_unit(traces: Sequence[Trace]) -> tuple[float, str]:
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


def _legible(label: str) -> str:
    """Matplotlib leaves labels that begin with '_' out of a legend."""
    return f"\u2009{label}" if label.startswith("_") else label
