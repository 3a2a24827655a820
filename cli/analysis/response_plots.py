"""Bode, Nyquist, step response, poles and zeros, root locus as one picture: PNG, SVG, or a page around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from sysdyn.cli.analysis.answers import Answer, Locus
from sysdyn.cli.analysis.linearisation import Linearisation
from sysdyn.cli.page.document import document, escape, table
from sysdyn.cli.page.panels import COLOURS
from sysdyn.cli.page.picture import drawing

Draw = Callable[[Any], None]
MOST = 8
"""Transfer functions in one picture: as many as there are colours."""
TALL = 1e3
"""Nyquist curves are cut where they leave this many times their middle size."""


def picture(
    title: str, linear: Linearisation, found: Sequence[Answer], locus: Locus | None, kinds: Sequence[str], kind: str
) -> bytes:
    """kinds: of bode, nyquist, step, poles, locus; kind: png or svg."""
    found = found[:MOST]
    panels: list[Draw] = []
    # a panel for each kind that has something to show
    if "bode" in kinds and found:
        panels += [lambda axis: _magnitude(axis, found), lambda axis: _phase(axis, found)]
    if "nyquist" in kinds and found:
        panels.append(lambda axis: _nyquist(axis, found))
    if "step" in kinds and found:
        panels.append(lambda axis: _step(axis, found))
    if "poles" in kinds and (linear.modes or found):
        panels.append(lambda axis: _poles(axis, linear))
    if locus is not None and locus.curves.size:
        panels.append(lambda axis: _locus(axis, locus))
    columns = 1 if len(panels) == 1 else 2
    rows = max(-(-len(panels) // columns), 1)

    # panels in two columns; a place that is left over is hidden
    def draw(figure: Any) -> None:
        axes = list(figure.subplots(rows, columns, squeeze=False).flat)
        for axis, panel in zip(axes, panels, strict=False):
            panel(axis)
        for axis in axes[len(panels) :]:
            axis.set_visible(False)
        figure.suptitle(title, fontweight="bold", fontsize=11, x=0.01, ha="left")

    return drawing((5.4 * columns + 0.6, 0.5 + 3.3 * rows), kind, draw)


def page(title: str, svg: bytes, tables: Sequence[tuple[str, Sequence[Sequence[str]]]]) -> bytes:
    """A page of a picture and tables (heading, rows with their heads)."""
    drawn = svg.decode()
    parts = [f"<h1>{escape(title)}</h1>", drawn[drawn.index("<svg") :]]
    for heading, rows in tables:
        cells = [[escape(cell) for cell in row] for row in rows]
        parts += [f"<h2>{escape(heading)}</h2>", table(cells[0], cells[1:], left=(0,))]
    return document(title, "\n".join(parts)).encode()


def _curves(axis: Any, found: Sequence[Answer], draw: Callable[[Answer], tuple[Any, Any]]) -> None:
    for k, answer in enumerate(found):
        x, y = draw(answer)
        axis.plot(x, y, color=COLOURS[k % len(COLOURS)], label=answer.label)
    if len(found) > 1:
        _legend(axis)


def _legend(axis: Any) -> None:
    """On a ground through which curves shine."""
    axis.legend(fontsize=8, frameon=True, framealpha=0.8, edgecolor="none")


def _magnitude(axis: Any, found: Sequence[Answer]) -> None:
    _curves(axis, found, lambda a: (a.frequencies.w, _drawable(a.frequencies.magnitude)))
    axis.set(xscale="log", xlabel="frequency, rad/s", ylabel="magnitude, dB", title=_title(found))
    _plain(axis)
    for k, a in enumerate(found):
        if a.margins.w_gain is not None:
            axis.axvline(a.margins.w_gain, color=COLOURS[k % len(COLOURS)], linewidth=0.7, linestyle=":")


def _phase(axis: Any, found: Sequence[Answer]) -> None:
    _curves(axis, found, lambda a: (a.frequencies.w, a.frequencies.phase))
    axis.set(xscale="log", xlabel="frequency, rad/s", ylabel="phase, deg")
    _plain(axis)
    low, high = axis.get_ylim()
    step = 45.0 if high - low <= 400.0 else 90.0
    axis.set_yticks(np.arange(np.floor(low / step), np.ceil(high / step) + 1) * step)


def _plain(axis: Any) -> None:
    """Powers of ten as numbers: names are no mathematics to our pictures."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.margins(x=0.0)


def _drawable(values: Any) -> Any:
    return np.where(np.isfinite(values), values, np.nan)


def _nyquist(axis: Any, found: Sequence[Answer]) -> None:
    """Curves of the frequency response in the complex plane, and the point -1 where it lies within."""
    limit = 0.0
    for k, answer in enumerate(found):
        value = answer.frequencies.value
        # what grows beyond all others near a pole is cut off
        size = TALL * float(np.median(np.abs(value))) if value.size else 1.0
        kept = np.where(np.abs(value) <= size, value, np.nan)
        colour = COLOURS[k % len(COLOURS)]
        axis.plot(kept.real, kept.imag, color=colour, label=answer.label)
        axis.plot(kept.real, -kept.imag, color=colour, linestyle="--", linewidth=0.9)
        limit = max(limit, float(np.nanmax(np.abs(kept), initial=0.0)))
    if limit < 50.0:
        axis.plot([-1.0], [0.0], "+", color="#b00020", markersize=9, label="-1")
        _legend(axis)
    axis.set(xlabel="Re G", ylabel="Im G", title="Nyquist (dashed: w < 0)")
    axis.set_aspect("equal", adjustable="datalim")


def _step(axis: Any, found: Sequence[Answer]) -> None:
    _curves(axis, found, lambda a: (a.time, a.step))
    axis.set(xlabel="time, s", ylabel="step response", title="" if len(found) > 1 else _title(found))
    axis.margins(x=0.0)


def _title(found: Sequence[Answer]) -> str:
    return found[0].label if len(found) == 1 else ""


def _poles(axis: Any, linear: Linearisation) -> None:
    """Eigenvalues as crosses, zeros of the transfer functions as circles."""
    values = np.array([m.eigenvalue for m in linear.modes])
    axis.axvline(0.0, color="#9aa0a6", linewidth=0.8)
    axis.axhline(0.0, color="#9aa0a6", linewidth=0.8)
    axis.plot(values.real, values.imag, "x", color="#30343b", markersize=7, label="eigenvalues")
    for t in linear.transfers[:MOST]:
        if t.zeros.size:
            name = f"zeros, {linear.label(t)}"
            colour = COLOURS[linear.transfers.index(t) % len(COLOURS)]
            axis.plot(t.zeros.real, t.zeros.imag, "o", fillstyle="none", color=colour, label=name)
    _plane(axis)
    _legend(axis)


def _plane(axis: Any) -> None:
    axis.set(xlabel="Re s, 1/s", ylabel="Im s, 1/s")
    low, high = axis.get_xlim()
    if high < 0.05 * (high - low):  # the border of stability stands in the picture
        axis.set_xlim(low, 0.08 * (high - low))


def _locus(axis: Any, locus: Locus) -> None:
    """Eigenvalues as curves over a parameter, both ends marked."""
    axis.axvline(0.0, color="#9aa0a6", linewidth=0.8)
    for k in range(locus.curves.shape[1]):
        curve = locus.curves[:, k]
        axis.plot(curve.real, curve.imag, ".-", color=COLOURS[k % len(COLOURS)], markersize=3, linewidth=1.0)
    for place, mark, name in ((0, "x", "from"), (-1, "s", "to")):
        ends = locus.curves[place]
        value = f"{name} {locus.values[place]:.4g}"
        axis.plot(ends.real, ends.imag, mark, color="#30343b", fillstyle="none", label=value, linestyle="")
    _plane(axis)
    unit = "" if locus.unit == "1" else f", {locus.unit}"
    axis.set_title(f"eigenvalues over {locus.parameter}{unit}")
    _legend(axis)
