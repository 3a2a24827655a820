"""A sweep as a picture: bands over time where there are traces, end values over what varied."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from sysdyn.cli.page.panels import COLOURS
from sysdyn.cli.page.picture import drawing
from sysdyn.cli.sweep.run_records import Kept
from sysdyn.cli.sweep.sweeping import Swept

MOST = 4
"""Quantities, and names that vary, in one picture."""
FEW = 8
"""Runs that are drawn one by one, not as bands."""


def picture(found: Swept, kind: str) -> bytes:
    """PNG or SVG: a row a traced quantity; runs that are not met in red crosses."""
    kept = found.kept
    names = list(next((k.end for k in kept if k.end), {}) or {})[:MOST]
    over = list(found.cases[0])[:MOST]
    bands = any(k.traces for k in kept)
    columns = len(over) + bands
    size = (2.4 + 3.1 * columns, 1.0 + 2.2 * max(len(names), 1))

    # a row for each quantity: bands over time, then ends over each parameter
    def draw(figure: Any) -> None:
        axes = figure.subplots(max(len(names), 1), columns, squeeze=False, sharex="col")
        for row, name in enumerate(names):
            if bands:
                _bands(axes[row, 0], found, kept, name)
            for k, varied in enumerate(over):
                _scatter(axes[row, k + bands], found, kept, name, varied)
            axes[row, 0].set_ylabel(_label(found, name))
        for k, varied in enumerate(over):
            axes[-1, k + bands].set_xlabel(_label(found, varied))
        if bands:
            axes[-1, 0].set_xlabel("time, s")
        shown = ": all, 80 %, median" if len(found.cases) > FEW else ""
        axes[0, 0].set_title(f"{len(found.cases)} runs" + (shown if bands else ": at the end"))
        if bands:
            axes[0, 1].set_title("at the end")

    return drawing(size, kind, draw)


def _label(found: Swept, name: str) -> str:
    return ", ".join(filter(None, (name, found.unit(name))))


def _bands(axis: Any, found: Swept, kept: Sequence[Kept], name: str) -> None:
    """Curves of few runs, or quantiles of many, over time."""
    some = [k for k in kept if k.met and k.time and k.traces]
    if not some:
        return
    time = max((k.time or [] for k in some), key=len)
    # runs that ended earlier have no place in a quantile
    whole = [k for k in some if k.time == time]
    table = np.array([k.traces[name] for k in whole if k.traces])
    if len(found.cases) <= FEW:
        for k, curve in zip(whole, table, strict=True):
            axis.plot(time, curve, color=_colour(found, k.run))
        return
    low, ten, middle, ninety, high = np.quantile(table, [0.0, 0.1, 0.5, 0.9, 1.0], axis=0)
    axis.fill_between(time, low, high, color=COLOURS[0], alpha=0.15, linewidth=0)
    axis.fill_between(time, ten, ninety, color=COLOURS[0], alpha=0.3, linewidth=0)
    axis.plot(time, middle, color=COLOURS[0])


def _scatter(axis: Any, found: Swept, kept: Sequence[Kept], name: str, varied: str) -> None:
    """End values; bands stand beside them, so that these share the scale of their quantity alone."""
    drawn: dict[tuple[str, str], list[tuple[Any, Any]]] = {}
    for k in kept:
        if k.end:
            how = ("o", _colour(found, k.run)) if k.met else ("x", "#c2334d")
            drawn.setdefault(how, []).append((found.cases[k.run][varied], k.end[name]))
    for (marker, colour), points in drawn.items():
        axis.plot(*zip(*points, strict=True), marker, color=colour, markersize=3.0, alpha=0.7)


def _colour(found: Swept, run: int) -> str:
    """Of a run: its own where they are few."""
    return COLOURS[run if len(found.cases) <= FEW else 0]
