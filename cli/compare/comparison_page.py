"""A verdict as one self-contained HTML page: the table, and of each offender its curves with the tube around them.

No script, no font and no picture is loaded; each picture is an SVG: the curves, and their difference.  Many rows are
drawn as the least and largest of each column of pixels, so that no spike is lost.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

import numpy as np
from sysdyn.cli.compare.diffing import headline, sentence
from sysdyn.cli.page.curves import (
    BOTTOM,
    COLUMNS,
    HEIGHT,
    LEFT,
    RIGHT,
    TOP,
    WIDTH,
    PlotFrame,
    axes,
    frame_around,
    outline,
)
from sysdyn.cli.page.document import document, table
from sysdyn.cli.page.unit_text import conversion
from sysdyn.runtime.comparison.curve import Curve, Floats, bernstein, cells_at
from sysdyn.runtime.comparison.verdict import Compared, Source, Verdict

OFFENDERS = 12
"""Pictures of one verdict: the worst."""


def page(title: str, compared: Sequence[tuple[Source, Source, Verdict]]) -> str:
    """The whole page; each item: reference, test, their verdict."""
    body = [f"<h1>{html.escape(title)}</h1>"]
    for ref, test, verdict in compared:
        body.append(section(ref, test, verdict))
    return document(title, "\n".join(body))


def section(ref: Source, test: Source, verdict: Verdict) -> str:
    """One verdict: its first line, its table, its pictures."""
    word = "good" if verdict.equal else "bad"
    limit = f"{verdict.atol:g} + {verdict.rtol:g} × nominal within {verdict.tau:.3g} s"
    parts = [
        f'<p class="{word}"><strong>{html.escape(headline(verdict))}</strong></p>',
        f'<p class="soft">limit: {limit}; {verdict.points[0]} and {verdict.points[1]} instants</p>',
        _table(verdict),
    ]
    parts += [f'<p class="soft">{html.escape(note)}</p>' for note in verdict.notes]
    offenders = [c for c in verdict.quantities if c.status in ("differs", "nonfinite")]
    for c in offenders[:OFFENDERS]:
        parts.append(f'<h3>{html.escape(c.name)}</h3><p>{html.escape(sentence(c))}</p><div class="pair">')
        parts += _pictures(ref, test, c, *verdict.span)
        parts.append("</div>")
    if len(offenders) > OFFENDERS:
        parts.append(f'<p class="soft">… {len(offenders) - OFFENDERS} more differ</p>')
    return "\n".join(parts)


def _table(verdict: Verdict) -> str:
    """Rows of what differs and of all quantities, the worst instant of each."""
    heads = ("quantity", "verdict", "times the limit", "at [s]", "reference", "test", "limit", "unit")
    rows = []
    for c in (*(t for t in verdict.traces if not t.equal), *verdict.quantities):
        w = c.worst
        ratio = "no limit" if math.isinf(w.ratio) else f"{w.ratio:.3g}"
        numbers = [_number(w.time, 6), _number(w.reference, 9), _number(w.test, 9), _number(c.limit, 3)]
        word = "good" if c.equal else "bad"
        status = f'<span class="{word}">{c.status}</span>'
        rows.append([html.escape(c.name), status, ratio, *numbers, html.escape(c.unit)])
    return table(heads, rows, left=(0, 1, 7))


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}g}"


# ---- pictures


def _pictures(ref: Source, test: Source, c: Compared, low: float, high: float) -> list[str]:
    """Reference with its tube and test over the span; their difference with the limit."""
    scale, offset = conversion(test.quantities[c.name].unit, c.unit) or (1.0, 0.0)
    seconds = (conversion(test.time_unit, ref.time_unit) or (1.0, 0.0))[0]
    # both traces in units of the reference
    one = outline(ref, c.name, low, high)
    two = [(x, y * scale + offset) for x, y in outline(test, c.name, low, high, seconds)]
    limit = c.limit if math.isfinite(c.limit) else 0.0
    frame = frame_around(low, high, [y + d for _, y in one for d in (-limit, limit)] + [y for _, y in two])
    if frame is None:
        return []
    # the reference plus and minus the limit
    tube = [frame.points(x, y + limit) + frame.points(x, y - limit)[::-1] for x, y in one]
    body = [f'<polygon class="tube" points="{" ".join(points)}"/>' for points in tube]
    for kind, pieces in (("ref", one), ("test", two)):
        body += [f'<polyline class="{kind}" points="{" ".join(frame.points(x, y))}"/>' for x, y in pieces]
    key = '<tspan style="fill:var(--ref)">reference with its tube</tspan>'
    key += '<tspan dx="12" style="fill:var(--test)">test</tspan>'
    found = [_svg(frame, c, c.name, body, key, ref.time_unit)]
    x = np.unique(np.append(np.linspace(low, high, 4 * COLUMNS), c.worst.time if math.isfinite(c.worst.time) else low))
    # the difference, at points of its own
    y = (_values(test, c.name, x, seconds) * scale + offset) - _values(ref, c.name, x, 1.0)
    x, y = x[np.isfinite(y)], y[np.isfinite(y)]
    frame = frame_around(low, high, [y, np.array([-limit, limit])]) if y.size else None
    if frame is not None:
        upper, lower = frame.y_pixels(limit), frame.y_pixels(-limit)
        size = f'x="{LEFT}" y="{upper:.1f}" width="{WIDTH - LEFT - RIGHT}" height="{max(lower - upper, 0.5):.1f}"'
        body = [f'<rect class="tube" {size}/>', f'<polyline class="off" points="{" ".join(frame.points(x, y))}"/>']
        key = '<tspan style="fill:var(--ref)">limit</tspan>'
        key += '<tspan dx="12" style="fill:var(--test)">test - reference</tspan>'
        found.append(_svg(frame, c, f"difference of {c.name}", body, key, ref.time_unit))
    return found


def _values(source: Source, name: str, x: Floats, scale: float) -> Floats:
    """Values of a quantity at instants x [m] s; NaN outside its span."""
    time = source.time * scale
    if time.size < 2:
        return np.full(x.size, np.nan)
    values, rates = source.read(name, 0, time.size)
    curve = Curve(time, values, None if rates is None else rates / scale)
    found = bernstein(curve, cells_at(time, x), x, x)[0]
    return np.where((x >= time[0]) & (x <= time[-1]), found, np.nan)


def _svg(frame: PlotFrame, c: Compared, label: str, body: Sequence[str], key: str, time_unit: str) -> str:
    parts = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{html.escape(label, quote=True)}">']
    parts += [*axes(frame, time_unit, c.unit), *body]
    if frame.low <= c.worst.time <= frame.high:
        u = frame.across(c.worst.time)
        parts.append(f'<line class="mark" x1="{u:.1f}" x2="{u:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
    return "".join([*parts, f'<text x="{LEFT}" y="{HEIGHT - 6}">{key}</text></svg>'])
