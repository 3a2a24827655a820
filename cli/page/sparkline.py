"""Quantities of a trace as lines of text: name, unit, least, largest, and the curve in eight heights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sysdyn.cli.page.columns import align
from sysdyn.cli.page.panels import Floats, curve, time_unit, unit_text
from sysdyn.runtime.trace.trace import Trace

HEIGHTS = "▁▂▃▄▅▆▇█"
NARROW = 16
"""Columns that a curve has at least."""


def summary(traces: Sequence[tuple[str, Trace]], names: Sequence[str], width: int) -> str:
    """One line a quantity (and trace), at most `width` columns wide where names leave room."""
    rows: list[tuple[str, ...]] = [("quantity", "unit", "min", "max")]
    curves: list[tuple[Floats, Floats]] = []
    for name in names:
        # a row for each trace that has the quantity
        for label, trace in traces:
            if name not in trace:
                continue
            values = trace[name].values[np.isfinite(trace[name].values)]
            ends = told_apart(float(values.min()), float(values.max())) if values.size else ("-", "-")
            shown = name if len(traces) == 1 else f"{name}, {label}"
            rows.append((_plain(shown), _plain(unit_text(trace[name].units)) or "1", *ends))
            curves.append(curve(trace, name))
    heads = align(rows, right=(2, 3)).split("\n")
    # numbers first: curves take the columns that are left
    room = max(map(len, heads))
    wide = max(width - room - 2, NARROW)
    scale, unit = time_unit([t for _, t in traces])
    low, high = span(traces)
    over = f"{' to '.join(told_apart(low * scale, high * scale))} {unit}"
    lines = [f"{heads[0].ljust(room)}  {over}"]
    lines += [
        f"{head.ljust(room)}  {sparkline(t, v, low, high, wide)}".rstrip()
        for head, (t, v) in zip(heads[1:], curves, strict=True)
    ]
    return "\n".join(lines)


def told_apart(low: float, high: float) -> tuple[str, str]:
    """Two numbers in five digits, or in as many as show that they differ."""
    return next(
        texts
        for digits in range(5, 18)
        if len(set(texts := (f"{low:.{digits}g}", f"{high:.{digits}g}"))) > 1 or low == high or digits == 17
    )


def _plain(name: str) -> str:
    """A name without signs that steer a terminal."""
    return "".join(c if c.isprintable() else "\ufffd" for c in name)


def span(traces: Sequence[tuple[str, Trace]]) -> tuple[float, float]:
    """First and last instant of all traces, s."""
    ends = [t.time[[0, -1]] for _, t in traces if t.time.size]
    return (float(min(e[0] for e in ends)), float(max(e[1] for e in ends))) if ends else (0.0, 0.0)


def sparkline(time: Floats, values: Floats, low: float, high: float, width: int) -> str:
    """A curve over low..high in `width` columns: the middle of its range in each; a blank where it has no value."""
    finite = np.isfinite(values)
    if not finite.any() or not high > low:
        return ""
    least, most = float(values[finite].min()), float(values[finite].max())
    edges = np.linspace(low, high, width + 1)
    inner = np.interp(edges, time, values, left=np.nan, right=np.nan)
    all_time = np.concatenate([time, edges])
    all_values = np.concatenate([values, inner])
    column = np.clip(((all_time - low) / (high - low) * width).astype(int), 0, width - 1)
    text = []
    for k in range(width):
        here = all_values[column == k]
        here = here[np.isfinite(here)]
        if not here.size:
            text.append(" ")
            continue
        part = ((here.min() + here.max()) / 2.0 - least) / (most - least) if most > least else 0.5
        text.append(HEIGHTS[min(int(part * len(HEIGHTS)), len(HEIGHTS) - 1)])
    return "".join(text)
