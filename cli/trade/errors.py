"""The error of a trace against another as a number: `diff` of them, its worst ratio times the limit.

Errors are relative to the nominal magnitudes of the reference; rounding of the largest quantity of the same unit is no
error (as in `verify`), nor is what a value moves by within the time tolerance of the accuracy control.  Where there are
events, the instants that both traces hold are compared, without those at and between the same event of both; how far
that event is apart in both, of the span, is an error.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from sysdyn.runtime.accuracy.pairs import SHARE, TIMING
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.comparison.compare import compare
from sysdyn.runtime.comparison.curve import Floats
from sysdyn.runtime.comparison.verdict import About, Tolerance
from sysdyn.runtime.model.scales import ROUND_OFF
from sysdyn.runtime.trace.trace import Trace


def error_of(
    test: Trace,
    reference: Trace,
    judged: Collection[str],
    accuracy: float,
    until: float,
    *,
    at: Floats | None = None,
) -> float:
    """The largest relative error of the judged quantities up to `until` [s]; infinite where one is no number.

    at [s]: instants of the reference at which the other has its rows.
    """
    if not judged:
        return 0.0
    shift = _shift(test, reference, until)
    instants = at
    # events: instants near them are left out, and their own shift counts
    if shift is not None:
        events = np.array([e.time for trace in (test, reference) for e in trace.events])
        instants = np.intersect1d(test.time, reference.time)
        near = np.abs(instants[:, None] - events).min(axis=1, initial=np.inf)
        instants = instants[near > max(shift, TIMING * (until - reference.time[0]))]
        if instants.size < 2 or instants[1] > until:
            return float("inf")
    # both at the same instants, or with curves between them
    sources = [_source(trace, reference, judged, accuracy, until, instants) for trace in (reference, test)]
    span = float(sources[0].time[-1] - sources[0].time[0])
    tau = min(TIMING, SHARE * accuracy) * span
    verdict = compare(sources[0], sources[1], Tolerance(rtol=accuracy, tau=tau))
    # a quantity or a part of the span is missing
    if len(verdict.quantities) < len(judged) or any(c.status == "coverage" for c in verdict.traces):
        return float("inf")
    return max((shift or 0.0) / span, max(c.worst.ratio for c in verdict.quantities) * accuracy)


def _shift(test: Trace, reference: Trace, until: float) -> float | None:
    """How far the same events of both are apart [s], 0 where these are not the same ones; None where there are none."""
    one, two = ([e for e in trace.events if e.time <= until] for trace in (test, reference))
    if not one and not two:
        return None
    if [(e.name, e.element) for e in one] != [(e.name, e.element) for e in two]:
        return 0.0
    return max((abs(a.time - b.time) for a, b in zip(one, two, strict=True)), default=0.0)


def _source(
    trace: Trace, reference: Trace, judged: Collection[str], accuracy: float, until: float, instants: Floats | None
) -> Arrays:
    """The judged quantities up to an instant (at instants alone where given), their magnitudes the reference's."""
    within = trace.time <= until if instants is None else np.isin(trace.time, instants) & (trace.time <= until)
    largest: dict[str, float] = {}
    for name in dict.fromkeys((*reference.names, *(name for name in judged if name in reference))):  # audit.* too
        unit = reference[name].units
        largest[unit] = max(largest.get(unit, 0.0), reference[name].nominal or 0.0)
    known = [name for name in judged if name in trace]
    about = []
    for name in known:
        quantity = reference[name]
        least = ROUND_OFF * largest[quantity.units] / accuracy
        about.append(About(name, quantity.units, max(quantity.nominal or 0.0, least)))
    rates = {} if instants is not None else {name: trace[name].derivative for name in known}
    return Arrays(
        trace.time[within],
        {name: trace[name].values[within] for name in known},
        {name: np.asarray(rate)[within] for name, rate in rates.items() if rate is not None},
        about,
    )
