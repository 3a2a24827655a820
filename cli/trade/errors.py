"""The error of a trace against another as a number: `diff` of them, its worst ratio times the limit.

Errors are relative to the nominal magnitudes of the reference; rounding of the largest quantity of the same unit is no
error (as in `verify`), nor is what a value moves by within the time tolerance of the accuracy control.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.comparison.compare import compare
from sysdyn.runtime.comparison.verdict import About, Tolerance
from sysdyn.runtime.integrate.accuracy import SHARE, TIMING
from sysdyn.runtime.model.scales import ROUND_OFF
from sysdyn.runtime.trace.trace import Trace


def error_of(test: Trace, reference: Trace, judged: Collection[str], accuracy: float, until: float) -> float:
    """The largest relative error of the judged quantities up to `until` [s]; infinite where one is no number."""
    if not judged:
        return 0.0
    sources = [_source(trace, reference, judged, accuracy, until) for trace in (reference, test)]
    span = float(sources[0].time[-1] - sources[0].time[0])
    tau = min(TIMING, SHARE * accuracy) * span
    verdict = compare(sources[0], sources[1], Tolerance(rtol=accuracy, tau=tau))
    if len(verdict.quantities) < len(judged) or any(c.status == "coverage" for c in verdict.traces):
        return float("inf")
    return max(c.worst.ratio for c in verdict.quantities) * accuracy


def _source(trace: Trace, reference: Trace, judged: Collection[str], accuracy: float, until: float) -> Arrays:
    """The judged quantities up to an instant, their magnitudes those of the reference."""
    within = trace.time <= until
    largest: dict[str, float] = {}
    for name in reference.names:
        unit = reference[name].units
        largest[unit] = max(largest.get(unit, 0.0), reference[name].nominal or 0.0)
    known = [name for name in judged if name in trace]
    about = []
    for name in known:
        quantity = reference[name]
        least = ROUND_OFF * largest[quantity.units] / accuracy
        about.append(About(name, quantity.units, max(quantity.nominal or 0.0, least)))
    rates = {name: trace[name].derivative for name in known}
    return Arrays(
        trace.time[within],
        {name: trace[name].values[within] for name in known},
        {name: np.asarray(rate)[within] for name, rate in rates.items() if rate is not None},
        about,
    )
