"""The work-precision plot of a trade as PNG, SVG and as a page that zooms, with the table of all settings.

Error across, work upwards, both in logarithms; one line a combination, the Pareto set in black, the chosen setting
ringed, the accuracy asked as a vertical line.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from sysdyn.cli.page.columns import spent
from sysdyn.cli.page.document import document, escape, table
from sysdyn.cli.page.panels import COLOURS
from sysdyn.cli.page.picture import drawing
from sysdyn.cli.page.plots import SCRIPT, hint
from sysdyn.cli.trade.trade_results import Combination, Measured, Traded

MARKERS = {"dopri": "o", "radau": "s", "bdf": "^", "rosenbrock": "D"}
STROKES: dict[str, Any] = {"2": "-", "3": ":", "2v": "-.", "1": "--", "0": (0, (1, 1))}
LEAST = 1e-16
"""Errors below are drawn there."""


def curves(found: Traded) -> dict[Combination, list[Measured]]:
    """Usable settings by combination, those with the least error first."""
    lines: dict[Combination, list[Measured]] = {}
    for m in found.measured:
        if m.usable:
            lines.setdefault(m.combination, []).append(m)
    return {c: sorted(line, key=lambda m: (m.error, m.work)) for c, line in lines.items()}


def _error(m: Measured) -> float:
    return max(m.error or 0.0, LEAST)


def colours(found: Traded) -> dict[str, str]:
    """A colour a formulation."""
    names = dict.fromkeys(c.formulation for c in curves(found))
    return {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(names)}


def picture(found: Traded, kind: str) -> bytes:
    """PNG or SVG; one trade always the same bytes but for what was measured in seconds (nothing of it is drawn)."""
    colour = colours(found)

    # a curve for each combination, work over error
    def draw(figure: Any) -> None:
        axis = figure.subplots()
        for c, line in curves(found).items():
            axis.plot(
                [_error(m) for m in line],
                [m.work for m in line],
                linestyle=STROKES[c.index],
                marker=MARKERS[c.method],
                color=colour[c.formulation],
                alpha=0.75,
                markersize=4.0,
                linewidth=1.0,
            )
        _pareto(axis, found)
        axis.set_xscale("log")
        axis.set_yscale("log")
        _ticks(axis)
        axis.set_xlabel("largest relative error of the traced quantities")
        axis.set_ylabel("work, ns of one machine")
        axis.set_title(found.name, fontweight="bold", fontsize=11, pad=10)
        axis.set_title(_uncertainty_text(found), loc="right", fontsize=8.5, color="#7b828c", pad=10)
        _legend(axis, found, colour)

    return drawing((8.6, 5.0), kind, draw)


def _uncertainty_text(found: Traded) -> str:
    return f"reference known to {found.reference.uncertainty:.0e}"


def _ticks(axis: Any) -> None:
    """Decades across, 1, 2 and 5 upwards, as plain numbers (a name of a user is no formula, nor is anything else)."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.xaxis.set_major_locator(LogLocator(10.0, numticks=9))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0e}"))
    axis.yaxis.set_major_locator(LogLocator(10.0, (1.0, 2.0, 5.0), numticks=9))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
    for side in (axis.xaxis, axis.yaxis):
        side.set_minor_formatter(NullFormatter())


def _pareto(axis: Any, found: Traded) -> None:
    """The Pareto set as stairs, the chosen setting, the accuracy, what the reference resolves."""
    best = found.pareto
    axis.plot(
        [_error(m) for m in best], [m.work for m in best], color="#14171c", linewidth=1.8, drawstyle="steps-pre",
        marker=".", markersize=6.0, zorder=3,
    )  # fmt: skip
    axis.axvline(found.accuracy, color="#14171c", linewidth=0.9, linestyle=(0, (5, 3)))
    axis.axvspan(LEAST / 10.0, max(found.reference.uncertainty, LEAST), color="#eceff3", zorder=0)
    errors = [_error(m) for m in found.measured if m.usable] or [1.0]
    axis.set_xlim(max(*errors, found.accuracy) * 3.0, min(*errors, found.accuracy) / 3.0)
    if found.chosen is not None:
        axis.plot([_error(found.chosen)], [found.chosen.work], "o", markersize=13, fillstyle="none", color="#14171c")


def _legend(axis: Any, found: Traded, colour: dict[str, str]) -> None:
    """What colours, strokes and marks mean."""
    from matplotlib.lines import Line2D

    drawn = list(curves(found))
    keys = [Line2D([], [], color=shade, label=name, linewidth=2.5) for name, shade in colour.items()]
    grey = "#5f6670"
    for index in dict.fromkeys(c.index for c in drawn):
        keys.append(Line2D([], [], color=grey, linestyle=STROKES[index], label=f"index {index}"))
    for method in dict.fromkeys(c.method for c in drawn):
        keys.append(Line2D([], [], color=grey, linestyle="", marker=MARKERS[method], label=method))
    keys.append(Line2D([], [], color="#14171c", linewidth=1.8, marker=".", label="Pareto set"))
    if found.chosen is not None:
        ring = Line2D([], [], color="#14171c", label="chosen", linestyle="", marker="o", markersize=10)
        ring.set_fillstyle("none")
        keys.append(ring)
    keys.append(Line2D([], [], color="#14171c", linewidth=0.9, linestyle=(0, (5, 3)), label="accuracy asked"))
    axis.legend(handles=keys, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8.5)


# --- the page ---------------------------------------------------------------------------------------------------


def page(found: Traded, command: str) -> str:
    """The choice, the figure, the table of all settings.  command: that uses the choice, "" where there is none."""
    known = found.reference
    until = "" if known.until >= found.span[1] else f" up to {known.until:g} s"
    parts = [
        f"<h1>{escape(found.name)}</h1>",
        f"<p><strong>{escape(verdict(found))}</strong></p>",
        f"<pre>{escape(command)}</pre>" if command else "",
        f'<p class="soft">Errors are relative to the magnitudes of {escape(", ".join(found.judged))}{until}, from '
        f"{escape(known.first)}, which {escape(known.second)} confirms to {known.uncertainty:.1e}. Work is counted, "
        "in ns of one machine: the same on every other.</p>",
        hint(),
        _figure(found),
        table(HEADS, [[escape(cell) for cell in cells(found, m)] for m in found.measured], left=(0, 1, 2, 3, 12)),
    ]
    refused = [f"{r.formulation} {r.index or ''} {r.method or ''}: {r.reason}" for r in found.refusals]
    dropped = [f"{c.name}: {why}" for c, why in found.dropped]
    for title, lines in (("Not possible", refused), ("Given up early", dropped)):
        if lines:
            listed = "".join(f"<li>{escape(line)}</li>" for line in lines)
            parts.append(f'<details><summary>{title}: {len(lines)}</summary><ul class="soft">{listed}</ul></details>')
    return document(found.name, "\n".join(parts), script=SCRIPT)


HEADS = (
    "", "formulation", "index", "method", "tolerance", "error", "work, ns", "of the least", "CPU, ms", "steps",
    "energy, J", "constraints", "",
)  # fmt: skip
"""The last column: the level where there are several, and why a run may not be chosen."""


def cells(found: Traded, m: Measured) -> list[str]:
    """One setting as a row: > chosen, * of the Pareto set."""
    mark = ">" if m is found.chosen else "*" if m in found.pareto else ""
    least = min((p.work for p in found.measured if p.usable), default=math.nan)
    error = "-" if m.error is None else f"{m.error:.1e}"
    numbers = [f"{m.tolerance:.1e}", error, f"{m.work:.3g}", f"{m.work / least:.2f}", f"{1e3 * m.cpu_s:.3g}"]
    meters = ["-" if x is None else f"{x:.1e}" for x in (m.energy, m.constraints)]
    c = m.combination
    reason = m.reason if len(m.reason) <= 60 else m.reason[:57] + "..."
    reason = ", ".join(filter(None, (c.level, reason)))
    return [mark, c.formulation, c.index, c.method, *numbers, str(m.steps), *meters, reason]


def verdict(found: Traded) -> str:
    """One sentence: what was chosen."""
    m = found.chosen
    if m is None:
        return f"no setting that was tried meets the accuracy {found.accuracy:.0e}"
    return (
        f"the cheapest of {len(found.measured)} runs that meets {found.accuracy:.0e}: {m.combination.name} at "
        f"{m.tolerance:.1e}, error {m.error:.1e}, {spent(m.cpu_s)} of CPU"
    )


def _figure(found: Traded) -> str:
    """The data of plots.js: logarithms, so that its straight axes do."""
    arrays: list[str] = []

    # numbers as base64 of doubles
    def add(values: Sequence[float]) -> int:
        raw = np.ascontiguousarray(np.log10(np.asarray(values)), dtype="<f8").tobytes()
        arrays.append(base64.b64encode(raw).decode("ascii"))
        return len(arrays) - 1

    def entry(label: str, line: Sequence[Measured], **more: object) -> dict[str, object]:
        places = {"time": add([_error(m) for m in line]), "values": add([m.work for m in line])}
        return {"label": label, "dash": False, **places, **more}

    colour = colours(found)
    drawn = [entry(c.name, line, colour=colour[c.formulation], marks=True) for c, line in curves(found).items()]
    stairs = list(reversed(found.pareto))
    drawn.append(entry("Pareto set", stairs, colour="currentColor", marks=True))
    # a ring around the choice
    if found.chosen is not None:
        drawn.append(entry("chosen", [found.chosen], colour="currentColor", dots=9))
    # the span holds all errors and the accuracy
    errors = [math.log10(_error(m)) for m in found.measured if m.usable] or [0.0]
    low, high = min(*errors, math.log10(found.accuracy)), max(*errors, math.log10(found.accuracy))
    panel = {"name": "work", "unit": "", "label": "work over error", "height": 440, "curves": drawn}
    data = {
        "unit": "", "across": "largest relative error", "lg": True, "span": [low - 0.3, high + 0.3], "panels": [panel],
        "arrays": arrays,
    }  # fmt: skip
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    return f'<figure class="plot" data-panel="0"></figure>\n<script type="application/json" id="curves">{text}</script>'
