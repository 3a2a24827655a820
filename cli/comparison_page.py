"""A verdict as one self-contained HTML page: the table, and of each offender its curves with the tube around them.

No script, no font and no picture is loaded; each picture is an SVG: the curves, and their difference.  Many rows are
drawn as the least and largest of each column of pixels, so that no spike is lost.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sysdyn.cli.diffing import headline, sentence
from sysdyn.cli.unit_text import conversion
from sysdyn.runtime.comparison.curve import Curve, Floats, bernstein, cells_at
from sysdyn.runtime.comparison.verdict import Compared, Source, Verdict

OFFENDERS = 12
"""Pictures of one verdict: the worst."""
COLUMNS = 460
WIDTH, HEIGHT = 560, 260
LEFT, RIGHT, TOP, BOTTOM = 74, 12, 14, 40

_STYLE = """
:root{color-scheme:light dark;--ink:#222b36;--soft:#5f6b7a;--line:#d9dee5;--paper:#fff;
 --ref:#1f5fa8;--test:#c2334d;--bad:#c2334d;--good:#23744e}
@media (prefers-color-scheme:dark){:root{--ink:#e3e8ef;--soft:#9aa6b5;--line:#39424e;--paper:#171c22;
 --ref:#6aa5ec;--test:#f0738a;--bad:#f0738a;--good:#5cc498}}
body{margin:2rem auto;max-width:75rem;padding:0 1.2rem;
 font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper)}
h1{font-size:1.3rem;margin:0 0 .3rem}h2{font-size:1.05rem;margin:1.6rem 0 .3rem}p{margin:.3rem 0}
.bad{color:var(--bad)}.good{color:var(--good)}.soft{color:var(--soft)}.wide{overflow-x:auto}
table{border-collapse:collapse;margin:1rem 0;font-variant-numeric:tabular-nums}
th,td{padding:.2rem .9rem .2rem 0;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}
th:nth-child(-n+2),td:nth-child(-n+2),th:last-child,td:last-child{text-align:left}th{color:var(--soft);font-weight:500}
.pair{display:flex;flex-wrap:wrap;gap:1rem}.pair svg{flex:1 1 30rem;max-width:100%;height:auto}
text{font:11px system-ui,sans-serif;fill:var(--soft)}
.grid{stroke:var(--line);stroke-width:1}.tube{fill:var(--ref);fill-opacity:.18;stroke:none}
.ref{stroke:var(--ref);stroke-width:1.6;fill:none}
.test{stroke:var(--test);stroke-width:1.4;fill:none;stroke-dasharray:5 3}
.off{stroke:var(--test);stroke-width:1.4;fill:none}
.mark{stroke:var(--ink);stroke-width:1;stroke-dasharray:2 3}
"""


def page(title: str, compared: Sequence[tuple[Source, Source, Verdict]]) -> str:
    """The whole page; each item: reference, test, their verdict."""
    body = [f"<h1>{html.escape(title)}</h1>"]
    for ref, test, verdict in compared:
        body.append(section(ref, test, verdict))
    return document(title, "\n".join(body))


def document(title: str, body: str) -> str:
    """A page around a body of HTML."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
    )


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
        parts.append(f'<h2>{html.escape(c.name)}</h2><p>{html.escape(sentence(c))}</p><div class="pair">')
        parts += _pictures(ref, test, c, *verdict.span)
        parts.append("</div>")
    if len(offenders) > OFFENDERS:
        parts.append(f'<p class="soft">… {len(offenders) - OFFENDERS} more differ</p>')
    return "\n".join(parts)


def _table(verdict: Verdict) -> str:
    heads = ("quantity", "verdict", "times the limit", "at [s]", "reference", "test", "limit", "unit")
    rows = ["<tr>" + "".join(f"<th>{h}</th>" for h in heads) + "</tr>"]
    for c in (*(t for t in verdict.traces if not t.equal), *verdict.quantities):
        w = c.worst
        ratio = "no limit" if math.isinf(w.ratio) else f"{w.ratio:.3g}"
        numbers = [_number(w.time, 6), _number(w.reference, 9), _number(w.test, 9), _number(c.limit, 3)]
        word = "good" if c.equal else "bad"
        cells = [html.escape(c.name), f'<span class="{word}">{c.status}</span>', ratio, *numbers, html.escape(c.unit)]
        rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    return '<div class="wide"><table>' + "\n".join(rows) + "</table></div>"


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}g}"


# ---- pictures


def outline(source: Source, name: str, low: float, high: float, scale: float = 1.0) -> list[tuple[Floats, Floats]]:
    """Unbroken pieces (time, values) of a quantity in a window, as many points as can be seen.

    scale: of the source's time to s.
    """
    time = source.time * scale
    a = max(int(np.searchsorted(time, low, side="left")) - 1, 0)
    b = min(int(np.searchsorted(time, high, side="right")) + 1, time.size)
    values, rates = source.read(name, a, b)
    time = time[a:b]
    if time.size > 2 * COLUMNS:
        edges = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], COLUMNS + 1)[:-1]))
        with np.errstate(invalid="ignore"):
            least, most = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
        x, y = np.repeat(time[edges], 2), np.stack([least, most], axis=1).ravel()
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
    breaks = np.flatnonzero(np.diff(np.isfinite(y).astype(int)) != 0) + 1
    pieces = zip(np.split(x, breaks), np.split(y, breaks), strict=True)
    return [(px, py) for px, py in pieces if py.size and np.isfinite(py).all()]


@dataclass(frozen=True, slots=True)
class _Frame:
    """Where values stand in a picture."""

    low: float
    high: float
    bottom: float
    top: float

    def across(self, time: Any) -> Any:
        """Pixels from the left."""
        return LEFT + (time - self.low) / (self.high - self.low) * (WIDTH - LEFT - RIGHT)

    def down(self, value: Any) -> Any:
        """Pixels from the top."""
        return HEIGHT - BOTTOM - (value - self.bottom) / (self.top - self.bottom) * (HEIGHT - TOP - BOTTOM)

    def points(self, x: Floats, y: Floats) -> list[str]:
        """A line's points."""
        return [f"{u:.1f},{v:.1f}" for u, v in zip(self.across(x), self.down(y), strict=True)]


def _framed(low: float, high: float, values: Sequence[Floats]) -> _Frame | None:
    """The frame around some values; None where there is nothing to draw."""
    if not values or not high > low:
        return None
    bottom, top = min(float(y.min()) for y in values), max(float(y.max()) for y in values)
    margin = 0.05 * (top - bottom) or 0.05 * abs(top) or 1.0
    frame = _Frame(low, high, bottom - margin, top + margin)
    return frame if math.isfinite(frame.top - frame.bottom) and frame.top > frame.bottom else None


def _pictures(ref: Source, test: Source, c: Compared, low: float, high: float) -> list[str]:
    """Reference with its tube and test over the span; their difference with the limit."""
    scale, offset = conversion(test.quantities[c.name].unit, c.unit) or (1.0, 0.0)
    seconds = (conversion(test.time_unit, ref.time_unit) or (1.0, 0.0))[0]
    one = outline(ref, c.name, low, high)
    two = [(x, y * scale + offset) for x, y in outline(test, c.name, low, high, seconds)]
    limit = c.limit if math.isfinite(c.limit) else 0.0
    frame = _framed(low, high, [y + d for _, y in one for d in (-limit, limit)] + [y for _, y in two])
    if frame is None:
        return []
    tube = [frame.points(x, y + limit) + frame.points(x, y - limit)[::-1] for x, y in one]
    body = [f'<polygon class="tube" points="{" ".join(points)}"/>' for points in tube]
    for kind, pieces in (("ref", one), ("test", two)):
        body += [f'<polyline class="{kind}" points="{" ".join(frame.points(x, y))}"/>' for x, y in pieces]
    key = '<tspan style="fill:var(--ref)">reference with its tube</tspan>'
    key += '<tspan dx="12" style="fill:var(--test)">test</tspan>'
    found = [_svg(frame, c, c.name, body, key, ref.time_unit)]
    x = np.unique(np.append(np.linspace(low, high, 4 * COLUMNS), c.worst.time if math.isfinite(c.worst.time) else low))
    y = (_values(test, c.name, x, seconds) * scale + offset) - _values(ref, c.name, x, 1.0)
    x, y = x[np.isfinite(y)], y[np.isfinite(y)]
    frame = _framed(low, high, [y, np.array([-limit, limit])]) if y.size else None
    if frame is not None:
        upper, lower = frame.down(limit), frame.down(-limit)
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


def _svg(frame: _Frame, c: Compared, label: str, body: Sequence[str], key: str, time_unit: str) -> str:
    parts = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{html.escape(label, quote=True)}">']
    parts += [*_axes(frame, time_unit, c.unit), *body]
    if frame.low <= c.worst.time <= frame.high:
        u = frame.across(c.worst.time)
        parts.append(f'<line class="mark" x1="{u:.1f}" x2="{u:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
    return "".join([*parts, f'<text x="{LEFT}" y="{HEIGHT - 6}">{key}</text></svg>'])


def _axes(frame: _Frame, time_unit: str, unit: str) -> list[str]:
    parts = []
    for value, label in _ticks(frame.low, frame.high, 6):
        u = frame.across(value)
        parts.append(f'<line class="grid" x1="{u:.1f}" x2="{u:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
        parts.append(f'<text x="{u:.1f}" y="{HEIGHT - BOTTOM + 14}" text-anchor="middle">{label}</text>')
    for value, label in _ticks(frame.bottom, frame.top, 5):
        v = frame.down(value)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{v:.1f}" y2="{v:.1f}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{v + 4:.1f}" text-anchor="end">{label}</text>')
    right = f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 6}" text-anchor="end">time [{html.escape(time_unit)}]</text>'
    return [*parts, right, f'<text x="4" y="{TOP - 3}">[{html.escape(unit)}]</text>']


def _ticks(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """Round numbers of an axis with labels that tell them apart."""
    raw = (high - low) / count
    size = 10.0 ** math.floor(math.log10(raw))
    step = next(size * k for k in (1.0, 2.0, 5.0, 10.0) if size * k >= raw * (1 - 1e-9))
    first = math.ceil(low / step)
    values = [k * step for k in range(first, first + 2 * count + 2) if k * step <= high + 1e-9 * step]
    largest = max((abs(v) for v in values), default=step)
    digits = min(max(1 + math.floor(math.log10(max(largest / step, 1.0)) + 1e-9), 1) + 1, 15)
    return [(v, f"{v:.{digits}g}") for v in values]
