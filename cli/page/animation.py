"""A trace in motion: points joined by lines, and curves with a mark that follows them, as SVG that plays by itself.

Points have coordinates that are quantities or numbers; those of a trace of which nothing is said are the lengths whose
names differ by x and y.  Frames are instants at equal distances, of the Hermite interpolant where there is one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from itertools import accumulate

import numpy as np
from sysdyn.cli.failures import UsageError
from sysdyn.cli.page.curves import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, axes, frame_around, ticks
from sysdyn.cli.page.document import document
from sysdyn.cli.page.figure_sources import no_quantity
from sysdyn.cli.page.panels import COLOURS, Floats, Panel, abbreviate, curve, panels_of, time_unit, unit_text
from sysdyn.cli.page.unit_text import conversion
from sysdyn.names import trace_name
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

SCRIPT = "animation.js"
SHORT, LONG, USUAL = 2.0, 20.0, 8.0
"""Seconds: a run that lasts from SHORT to LONG plays as it was, any other in USUAL."""
RATE, FEWEST, MOST = 25.0, 50, 600
"""Frames: a second, and of one animation."""
TALLEST = 520.0
_STYLE = (
    ".animation{background:#fff;max-width:100%;height:auto}.animation .grid{stroke:#d9dee5;stroke-width:1}"
    ".animation text{font:11px system-ui,sans-serif;fill:#5f6b7a}"
)

Link = tuple[tuple[str, str], ...]
"""Points that lines join, each by the texts of its coordinates."""


@dataclass(frozen=True, slots=True)
class Film:
    """What plays: frames of a trace."""

    trace: Trace
    instants: Floats
    seconds: float

    def values(self, name: str) -> Floats | None:
        """A quantity at the instants, across gaps by a straight line; None where it is never a number."""
        time, values = curve(self.trace, name)
        known = np.isfinite(values)
        return np.interp(self.instants, time[known], values[known]) if known.any() else None

    def animate_attribute(self, attribute: str, texts: Sequence[str]) -> str:
        """The attribute of the element around takes these values, one a frame; "" where it stands still."""
        if len(set(texts)) < 2:
            return ""
        played = f'dur="{self.seconds:g}s" repeatCount="indefinite"'
        return f'<animate attributeName="{attribute}" values="{";".join(texts)}" {played}/>'


def film(trace: Trace, speed: float | None) -> Film:
    """The frames of a trace; speed: seconds of the run in one second."""
    span = float(trace.time[-1] - trace.time[0]) if trace.time.size else 0.0
    if not (math.isfinite(span) and span > 0.0):
        raise UsageError(f"{trace.path} holds no span of time: nothing moves")
    seconds = span / speed if speed is not None else span if SHORT <= span <= LONG else USUAL
    frames = int(min(max(RATE * seconds, FEWEST), MOST))
    return Film(trace, np.linspace(trace.time[0], trace.time[-1], frames + 1), seconds)


def links_of(trace: Trace, given: Sequence[str]) -> tuple[Link, ...]:
    """The links that texts `X,Y X,Y ...` say, or the points that names tell, each by itself.  UsageError."""
    return tuple(_link(trace, text) for text in given) if given else tuple((pair,) for pair in _pairs(trace))


def _pairs(trace: Trace) -> Iterator[tuple[str, str]]:
    """Lengths whose names differ by x and y."""
    lengths = [name for name in trace.names if conversion(trace[name].units, "m") is not None]
    for name in lengths:
        for k, letter in enumerate(name):
            other = name[:k] + {"x": "y", "X": "Y"}.get(letter, letter) + name[k + 1 :]
            if other != name and other in lengths:
                yield name, other
                break


def _link(trace: Trace, text: str) -> Link:
    points = []
    for point in text.split():
        x, comma, y = point.partition(",")
        if not comma or not x or not y or "," in y:
            raise UsageError(f"--link: '{point}' is no point X,Y of two quantities or numbers")
        points.append((_coordinate(trace, x), _coordinate(trace, y)))
    if not points:
        raise UsageError("--link: points X,Y of quantities or numbers are wanted")
    return tuple(points)


def _coordinate(trace: Trace, text: str) -> str:
    """A coordinate as the trace spells it, or a number."""
    name = text if text in trace.names else trace_name(text)
    if name in trace.names:
        return name
    try:
        if math.isfinite(float(text)):
            return text
    except ValueError:
        pass
    raise UsageError(f"--link: {no_quantity(trace, text, trace.names, trace.names)}")


def quantities_of(links: Sequence[Link], trace: Trace) -> set[str]:
    """Those that are coordinates of points."""
    return {text for link in links for point in link for text in point if text in trace.names}


def drawing(it: Film, links: Sequence[Link], names: Sequence[str]) -> str:
    """The whole picture: the points, and below them the curves."""
    scale, unit = time_unit([it.trace])
    parts = [_stage(it, links)] if links else []
    parts += [_curves(it, panel, scale, unit) for panel in panels_of([it.trace], names)]
    tops = [0.0, *accumulate(height for _, height in parts)]
    groups = (f'<g transform="translate(0 {top:g})">{body}</g>' for (body, _), top in zip(parts, tops, strict=False))
    low, high = it.instants[[0, -1]] * scale
    data = f'data-low="{low:.9g}" data-high="{high:.9g}" data-unit="{unit}" data-seconds="{it.seconds:.9g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" class="animation" viewBox="0 0 {WIDTH} {tops[-1]:g}"'
    lines = [f'{head} width="{WIDTH}" height="{tops[-1]:g}" {data}>', f"<style>{_STYLE}</style>"]
    return "\n".join([*lines, f'<rect width="{WIDTH}" height="{tops[-1]:g}" fill="#fff"/>', *groups, "</svg>"]) + "\n"


def page(title: str, picture: str) -> str:
    """A page that plays a picture, pauses it, and brings it to an instant."""
    controls = (
        '<p><button id="play">Pause</button> <input id="at" type="range" min="0" max="1" step="any" value="0" '
        'aria-label="instant" style="width:24rem;max-width:60%"> <output id="instant"></output></p>'
    )
    return document(title, f"<h1>{escape(title)}</h1>\n{controls}\n{picture}", script=SCRIPT)


def _stage(it: Film, links: Sequence[Link]) -> tuple[str, float]:
    """The points with their ways, in lengths that are alike along both axes."""
    units = [it.trace[t].units for link in links for point in link for t in point if t in it.trace.names]
    unit = units[0] if units else "1"
    placed = [[_place(it, point, unit) for point in link] for link in links]
    x, y = (np.concatenate([p[k] for link in placed for p in link]) for k in (0, 1))
    # both axes at one scale, with a margin
    size = max(np.ptp(x), np.ptp(y)) or max(abs(x).max(), abs(y).max()) or 1.0
    wide, tall = np.ptp(x) + 0.1 * size, np.ptp(y) + 0.1 * size
    pixels = min((WIDTH - LEFT - RIGHT) / wide, (TALLEST - TOP - BOTTOM) / tall)
    left, bottom, height = x.min() - 0.05 * size, y.min() - 0.05 * size, pixels * tall + TOP + BOTTOM
    parts = []
    # grid lines and their numbers
    for value, label in ticks(left, left + wide, 6):
        u = LEFT + pixels * (value - left)
        parts.append(f'<line class="grid" x1="{u:.1f}" x2="{u:.1f}" y1="{TOP}" y2="{height - BOTTOM:.1f}"/>')
        parts.append(f'<text x="{u:.1f}" y="{height - BOTTOM + 14:.1f}" text-anchor="middle">{label}</text>')
    for value, label in ticks(bottom, bottom + tall, 5):
        v = height - BOTTOM - pixels * (value - bottom)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{LEFT + pixels * wide:.1f}" y1="{v:.1f}" y2="{v:.1f}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{v + 4:.1f}" text-anchor="end">{label}</text>')
    parts.append(f'<text x="4" y="{TOP - 3}">[{escape(unit_text(unit) or "1")}]</text>')
    # points that belong together in one colour
    for k, link in enumerate(placed):
        across = [(LEFT + pixels * (a - left), height - BOTTOM - pixels * (b - bottom)) for a, b in link]
        parts += _drawn(it, across, COLOURS[k % len(COLOURS)])
    return "\n".join(parts), height


def _place(it: Film, point: tuple[str, str], unit: str) -> tuple[Floats, Floats]:
    """Both coordinates of a point in a unit, frame by frame; UsageError where one is of another dimension."""
    found = []
    for text in point:
        # a number in place of a quantity: a fixed point
        if text not in it.trace.names:
            found.append(np.full_like(it.instants, float(text)))
            continue
        to, values = conversion(it.trace[text].units, unit), it.values(text)
        if to is None:
            raise UsageError(f"'{text}' is in {it.trace[text].units}, other coordinates in {unit}")
        if values is None:
            raise UsageError(f"'{text}' holds no numbers: no point is there")
        found.append(to[0] * values + to[1])
    return found[0], found[1]


def _drawn(it: Film, link: Sequence[tuple[Floats, Floats]], colour: str) -> list[str]:
    """The ways of the points of a link in pixels, the line through them, the points themselves."""
    parts, frames = [], range(it.instants.size)
    for u, v in link:
        if np.ptp(u) or np.ptp(v):
            way = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(u, v, strict=True))
            parts.append(f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-opacity=".25"/>')
    if len(link) > 1:
        lines = [" ".join(f"{u[k]:.1f},{v[k]:.1f}" for u, v in link) for k in frames]
        moved = it.animate_attribute("points", lines)
        parts.append(f'<polyline points="{lines[0]}" fill="none" stroke="{colour}" stroke-width="3">{moved}</polyline>')
    for u, v in link:
        across, down = ([f"{value:.1f}" for value in at] for at in (u, v))
        moved = it.animate_attribute("cx", across) + it.animate_attribute("cy", down)
        parts.append(f'<circle cx="{across[0]}" cy="{down[0]}" r="5" fill="{colour}">{moved}</circle>')
    return parts


def _curves(it: Film, panel: Panel, scale: float, time: str) -> tuple[str, float]:
    """A panel of curves, each with its mark, and the line of the present instant."""
    curves = [(name, values) for name in panel.names if (values := it.values(name)) is not None]
    low, high = (float(t) for t in it.instants[[0, -1]] * scale)
    frame = frame_around(low, high, [values for _, values in curves])
    if frame is None:
        return f'<text x="{LEFT}" y="{TOP}">{escape(panel.names[0])}: no numbers</text>', 2.0 * TOP
    u = frame.across(it.instants * scale)
    parts = axes(frame, time, unit_text(panel.unit) or "1")
    across = [f"{value:.1f}" for value in u]
    now = f'x1="{across[0]}" x2="{across[0]}" y1="{TOP}" y2="{HEIGHT - BOTTOM}" stroke="#5f6b7a" stroke-dasharray="3 3"'
    parts.append(f"<line {now}>{it.animate_attribute('x1', across)}{it.animate_attribute('x2', across)}</line>")
    for k, (name, y) in enumerate(curves):
        colour, down = COLOURS[k % len(COLOURS)], [f"{v:.1f}" for v in frame.y_pixels(y)]
        way = " ".join(f"{a},{b}" for a, b in zip(across, down, strict=True))
        moved = it.animate_attribute("cx", across) + it.animate_attribute("cy", down)
        parts.append(f'<polyline points="{way}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        parts.append(f'<circle cx="{across[0]}" cy="{down[0]}" r="4" fill="{colour}">{moved}</circle>')
        named = f'x="{WIDTH - RIGHT - 6}" y="{TOP + 14 + 14 * k}" text-anchor="end" style="fill:{colour}"'
        parts.append(f"<text {named}>{escape(abbreviate(name, 40))}</text>")
    return "\n".join(parts), float(HEIGHT)
