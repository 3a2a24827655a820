"""The energy activity of each element over a scene: the integral of its absolute power (Louca and Stein).

The energy that went through an element since the start, or that a statement holds, is a curve E(t); the integral of
abs(dE/dt) is its total variation.  A trace holds E and its rate at accepted steps and at instants between them, so E
is a cubic in each cell, and the variation of a cubic is known in closed form by its extremes.  One run gives all
elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.report.balance import BalancePart, add_observations, shares
from sysdyn.cli.run.prepare import prepare
from sysdyn.cli.run.request.run_request import RunRequest, of_these_alone, options_of
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import Ran, integrate, ready
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Place, Report
from sysdyn.runtime.accuracy.options import Progress
from sysdyn.runtime.trace.trace import Quantity, Trace
from sysdyn.values import dataclass

Floats = NDArray[np.float64]
CELLS = 400
"""Of a scene at least: the steps of a method of high order are too long for one cubic each."""


@dataclass(frozen=True, slots=True)
class Activity:
    """One element or statement.  name: of the branch ("" of a statement); role: held, out, in, through; activity [J];
    share: of the sum over all but what couplings pass on (theirs is taken of the same sum); energy [J]: over the scene
    stored, dissipated, supplied, absorbed; domain: where.
    """

    label: str
    name: str
    role: str
    activity: float
    share: float
    energy: float
    domain: str
    place: Place


@dataclass(frozen=True, slots=True)
class Activities:
    """Those of a scene, the largest first; ran: the run in which they were measured."""

    items: tuple[Activity, ...]
    total: float
    ran: Ran


def activities(
    request: RunRequest,
    target: Target,
    report: Report,
    folder: Path,
    began: float,
    progress: Progress | None,
    limit: float | None = None,
) -> Activities | None:
    """The activities of all elements; None where the report says why there are none.

    limit: seconds of wall time from `began`.
    """
    with ex.fresh():
        prepared = ready(replace(request, no_prune=True), target, report)
        options = options_of(request, target, prepared, report, began, progress) if prepared else None
        if prepared is None or options is None or report.failed:
            return None
        # an integral of power for each part
        network, parts = add_observations(prepared.network)
        if not parts:
            report.error("E608", "the powers of the elements cannot be written: there is none, or they are too many",
                         prepared.network.place)  # fmt: skip
            return None
        own = prepared.network.traced
        # many instants: activity is an integral of an absolute value
        cells = np.linspace(options.t_start, options.t_end, CELLS + 1)[1:-1]
        options = replace(
            options,
            output=folder / "activity.h5",
            every=None,
            at=tuple(cells),
            watch=None,
            sampled_at=(),
            max_wall=limit,
        )
        # the accuracy is that of the author's own quantities
        options = of_these_alone(options, own)
        inner = Report()
        rich = prepare(network, inner, formulation=prepared.formulation, backend=prepared.backend, traced=True)
        ran = None if rich is None else integrate(target, rich, options, inner)
    # stopped: no activities
    if ran is None or not ran.outcome.final:
        report.extend(inner)
        return None
    return _rank_activities(ran.outcome.traced, parts, ran)


def _rank_activities(trace: Trace, parts: Sequence[BalancePart], ran: Ran) -> Activities:
    """Activities of all parts with their shares, the largest first."""
    found = [(part, variation(trace.time, trace[part.name])) for part in parts]
    total = float(sum(value for part, value in found if part.role != "through"))
    # shares of jumps follow those of the parts, and are no part of the model
    energies = {part.name: share.energy for part, share in zip(parts, shares(trace, parts), strict=False)}
    items = [
        Activity(
            part.label, part.branch, part.role, value,
            value / total if total > 0.0 else 0.0, energies[part.name], part.domain, part.place,
        )
        for part, value in found
    ]  # fmt: skip
    return Activities(tuple(sorted(items, key=lambda a: -a.activity)), total, ran)


def variation(time: Floats, quantity: Quantity) -> float:
    """Total variation of a traced curve: cubics where its rate is known, lines elsewhere."""
    y, rate = quantity.values, quantity.derivative
    if time.size < 2:
        return 0.0
    h, a, b = np.diff(time), y[:-1], y[1:]
    straight = np.abs(b - a)
    if rate is None:
        return float(straight.sum())
    da, db = rate[:-1] * h, rate[1:] * h
    known = np.isfinite(da) & np.isfinite(db) & (h > 0.0)
    # y = a + da s + (3 d - 2 da - db) s^2 + (da + db - 2 d) s^3, d = b - a; its slope is a parabola in s
    d = b - a
    c3, c2 = da + db - 2.0 * d, 3.0 * d - 2.0 * da - db
    found = np.zeros_like(straight)
    last = a.copy()
    for s in _extremes(3.0 * c3, 2.0 * c2, da):
        value = a + s * (da + s * (c2 + s * c3))
        found += np.abs(value - last)
        last = value
    found += np.abs(b - last)
    return float(np.where(known, found, straight).sum())


def _extremes(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats]:
    """Both zeros of a s^2 + b s + c within [0, 1], ascending; 0 where there is none."""
    with np.errstate(all="ignore"):
        root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
        q = -0.5 * (b + np.where(b >= 0.0, root, -root))
        zeros = [np.where(b * b >= 4.0 * a * c, s, 0.0) for s in (q / a, c / q)]
    inside = [np.where(np.isfinite(s) & (s > 0.0) & (s < 1.0), s, 0.0) for s in zeros]
    return np.minimum(*inside), np.maximum(*inside)
