"""Curves over time as PNG or SVG: panels by unit, one picture of the same data always the same bytes."""

from __future__ import annotations

import io
import logging
import os
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from sysdyn.cli.page.panels import Panel, abbreviate, curve, panels_of, styled_curves, time_unit, unit_text
from sysdyn.dsl.text.render import printable
from sysdyn.runtime.trace.trace import Trace

MOST = 22
"""Characters of a name beside an axis; twice as many in a legend."""
LINES = 10
"""Of a legend; more stand in columns."""
STYLES = ("-", "--", ":", "-.")
STYLE: dict[str, Any] = {
    "axes.axisbelow": True,
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


def picture(traces: Sequence[tuple[str, Trace]], names: Sequence[str], kind: str) -> bytes:
    """The picture of the named quantities of (label, trace) pairs; kind is png or svg."""
    panels = panels_of([t for _, t in traces], names)
    columns = 1 if len(panels) <= 6 else 2
    rows = -(-len(panels) // columns)
    height = 1.0 + rows * max(1.9 if rows > 1 else 3.2, 2.6 - 0.2 * rows)

    def draw(figure: Any) -> None:
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
        scale, unit = time_unit([t for _, t in traces])
        for position, axis in enumerate(axes.T.flat):
            if position < len(panels):
                _draw(axis, panels[position], traces, scale)
            else:
                axis.set_visible(False)
        for column in range(columns):
            last = axes[min(rows, len(panels) - column * rows) - 1, column]
            last.set_xlabel(f"time, {unit}")
            last.tick_params(labelbottom=True)
        _head(axes[0], traces)
        figure.align_ylabels()

    return drawing((7.2 * columns if columns == 1 else 11.0, height), kind, draw)


def drawing(size: tuple[float, float], kind: str, draw: Callable[[Any], None]) -> bytes:
    """The bytes of a figure of a size (inches) that `draw` fills; kind: png or svg.

    Under our settings, not a person's, and without a date: one picture of the same data is always the same bytes.
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # says that it builds its font cache
    window = os.environ.pop("MPLBACKEND", None)  # none of ours opens one: whether it is there is nothing to us
    try:
        import matplotlib as mpl
    finally:
        os.environ |= {} if window is None else {"MPLBACKEND": window}
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with warnings.catch_warnings(), mpl.rc_context(_style(mpl.rcParamsDefault)):
        warnings.simplefilter("ignore")  # names in scripts that the font lacks
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure)
        data = io.BytesIO()
        figure.savefig(data, format=kind, metadata={"Date": None} if kind == "svg" else {"Software": None})
    return data.getvalue()


def _style(defaults: Any) -> Any:
    """Matplotlib's own settings under ours: a person's configuration does not change a picture."""
    return {**defaults, **STYLE, "backend": "agg"}


def _head(axes: Any, traces: Sequence[tuple[str, Trace]]) -> None:
    """Titles: what was run on the left, how on the right."""
    titles = dict.fromkeys(str(t.attributes.get("title", label)) for label, t in traces)
    axes[0].set_title(_legible(" and ".join(titles)), fontweight="bold", fontsize=11, pad=10)
    if len(traces) > 1:
        return
    trace = traces[0][1]
    how = [str(trace.attributes[a]) for a in ("formulation", "method") if trace.attributes.get(a)]
    if not trace.final:
        how.append("not final")
    axes[-1].set_title(_legible(", ".join(how)), loc="right", fontsize=8.5, color="#7b828c", pad=10)


def _draw(axis: Any, panel: Panel, traces: Sequence[tuple[str, Trace]], scale: float) -> None:
    """Draw the curves of a panel, with a legend where there are several."""
    curves = []
    for name, trace, label, colour, k in styled_curves(panel, traces):
        time, values = curve(trace, name, panel.unit)
        (line,) = axis.plot(time * scale, values, STYLES[k % len(STYLES)], color=colour)
        curves.append((line, _legible(abbreviate(label, 2 * MOST))))
    unit = unit_text(panel.unit)
    if len(panel.names) == 1:
        axis.set_ylabel(", ".join(filter(None, [_legible(abbreviate(panel.names[0], MOST)), unit])))
    else:
        axis.set_ylabel(unit)
    if len(curves) > 1:
        lines, labels = zip(*curves, strict=True)
        columns = -(-len(curves) // LINES)
        axis.legend(lines, labels, loc="upper left", bbox_to_anchor=(1.0, 1.03), fontsize=8.5, ncols=columns)
    axis.margins(x=0.0, y=0.08)
    axis.ticklabel_format(axis="y", scilimits=(-3, 4), useOffset=panel.high - panel.low < 1e-5 * abs(panel.high))


def _legible(label: str) -> str:
    """A name as it is drawn: control characters are no XML; what begins with '_' Matplotlib leaves out of a legend."""
    label = printable(label)
    return f"\u2009{label}" if label.startswith("_") else label
