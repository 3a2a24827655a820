"""Curves of traces as figures that zoom (plots.js), their data inside the page.

Numbers are little-endian float64 in base64.  Where a page would hold more than NUMBERS of them, curves are drawn as the
least and largest of equal parts of the span, so that no spike is lost.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from sysdyn.cli.page.document import document, escape
from sysdyn.cli.page.panels import Floats, Panel, curve, panels_of, styled_curves, time_unit, unit_text
from sysdyn.runtime.trace.trace import Trace

SCRIPT = "plots.js"
NUMBERS = 1_000_000
"""Of one page: 11 MB of text."""
LEAST = 2000
"""Numbers of a curve, however many curves there are."""


def page(title: str, traces: Sequence[tuple[str, Trace]], names: Sequence[str]) -> str:
    """A page of the named quantities of (label, trace) pairs."""
    how = []
    for label, trace in traces:
        run = [str(trace.attributes[a]) for a in ("formulation", "method") if trace.attributes.get(a)]
        run += [] if trace.final else ["not final"]
        how.append(f'<p class="soft">{escape(": ".join([label, ", ".join(run)] if run else [label]))}</p>')
    return document(
        title, "\n".join([f"<h1>{escape(title)}</h1>", *how, hint(), figures(traces, names)]), script=SCRIPT
    )


def hint() -> str:
    """How to zoom."""
    return (
        '<p class="soft">Wheel or drag zooms, shift-drag moves, double click resets; '
        "a click on a name hides its curve.</p>"
    )


def figures(traces: Sequence[tuple[str, Trace]], names: Sequence[str]) -> str:
    """A figure a panel, and the data; once a page."""
    panels = panels_of([t for _, t in traces], names)
    scale, unit = time_unit([t for _, t in traces])
    count = sum(name in t for _, t in traces for name in names)
    arrays = _Arrays(max(NUMBERS // max(2 * count, 1), LEAST))
    found = [_panel(panel, traces, scale, arrays) for panel in panels]
    ends = [t.time[[0, -1]] * scale for _, t in traces if t.time.size]
    low, high = (min(e[0] for e in ends), max(e[1] for e in ends)) if ends else (0.0, 1.0)
    span = [float(low), float(high) if high > low else float(low) + 1.0]
    data = {"unit": unit, "span": span, "panels": found, "arrays": arrays.texts}
    # "<" never stands in the text of a script: no name can end it
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    parts = [f'<figure class="plot" data-panel="{k}"></figure>' for k in range(len(found))]
    return "\n".join([*parts, f'<script type="application/json" id="curves">{text}</script>'])


def _panel(panel: Panel, traces: Sequence[tuple[str, Trace]], scale: float, arrays: _Arrays) -> dict[str, Any]:
    curves = []
    for name, trace, shown, colour, k in styled_curves(panel, traces):
        time, values = thin(*curve(trace, name, panel.unit), arrays.most)
        places = {"time": arrays.add(time * scale), "values": arrays.add(values)}
        curves.append({"label": shown, "colour": colour, "dash": k % 2 == 1, **places})
    name, unit = panel.names[0] if len(panel.names) == 1 else "", unit_text(panel.unit)
    label = f"{', '.join(panel.names)} over time"
    height = 320 if len(panel.names) > 3 else 250
    return {"name": name, "unit": unit, "label": label, "height": height, "curves": curves}


class _Arrays:
    """Arrays of a page, each once."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.texts: list[str] = []
        self._places: dict[bytes, int] = {}

    def add(self, values: Floats) -> int:
        """The number of an array."""
        raw = np.ascontiguousarray(values, dtype="<f8").tobytes()
        if raw not in self._places:
            self._places[raw] = len(self.texts)
            self.texts.append(base64.b64encode(raw).decode("ascii"))
        return self._places[raw]


def thin(time: Floats, values: Floats, most: int) -> tuple[Floats, Floats]:
    """At most about `most` points: the first, the last, and least and largest of equal parts of the span."""
    if time.size <= most:
        return time, values
    edges = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], most // 2 + 1)[:-1]))
    parts = np.split(np.arange(time.size), edges[1:])
    kept = {0, time.size - 1}
    for part in parts:
        inside = values[part]
        finite = np.isfinite(inside)
        if finite.all():
            kept |= {int(part[inside.argmin()]), int(part[inside.argmax()])}
        else:  # a gap stays one
            kept |= {int(part[np.argmin(finite)])}
            kept |= {int(part[f(np.where(finite, inside, e))]) for f, e in ((np.argmin, np.inf), (np.argmax, -np.inf))}
    order = np.array(sorted(kept))
    return time[order], values[order]
