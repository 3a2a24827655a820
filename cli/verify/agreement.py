"""Traces of one scene compared at the instants that both hold.

A quantity of two traces differs where |a - b| > bound * nominal, nominal the smaller of what both store: a run that
explodes shall not widen what is allowed.  Rounding of the largest quantity of the same unit is no difference, and
between an event of one and the same event of the other nothing is compared: the sides of a jump differ.
Received: traces, bounds by name; handed back: the worst place of each quantity, and the instant up to which two agree.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.accuracy.common_instants import late_by
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.scales import ROUND_OFF
from sysdyn.runtime.trace.trace import Quantity, Trace
from sysdyn.values import dataclass

Places = NDArray[np.intp]
Bounds = Mapping[str, float]
"""Difference allowed of each compared quantity, relative to its nominal magnitude."""


@dataclass(frozen=True, slots=True)
class Gap:
    """The worst place of a quantity.  time [s]; first [s]: where it differs first (None: nowhere); ratio: difference
    over what is allowed; values of both traces in its unit.
    """

    variable: str
    time: float
    first: float | None
    ratio: float
    values: tuple[float, float]


def gaps(one: Trace, other: Trace, bounds: Bounds, until: float) -> tuple[Gap, ...]:
    """The worst place of each quantity up to `until` [s], worst first; () where there is no common instant."""
    (times, here, there), ratios = _ratios(one, other, bounds)
    inside = times <= until
    if not inside.any():
        return ()
    found = []
    for name, ratio in ratios.items():
        k = int(np.argmax(ratio[inside]))
        values = float(one[name].values[here[k]]), float(other[name].values[there[k]])
        apart = times[inside & (ratio > 1.0)]
        found.append(Gap(name, float(times[k]), float(apart[0]) if apart.size else None, float(ratio[k]), values))
    return tuple(sorted(found, key=lambda gap: -gap.ratio))


def horizon(one: Trace, other: Trace, bounds: Bounds) -> tuple[float, Gap | None]:
    """The last common instant [s] before any quantity differs, and what differs after it; -inf where there is none."""
    (times, *_), ratios = _ratios(one, other, bounds)
    apart = np.zeros(times.size, dtype=bool)
    for ratio in ratios.values():
        apart |= ratio > 1.0
    if not apart.any():
        both = np.intersect1d(one.time, other.time)  # with an event at the end too
        return (float(both[-1]) if times.size else -np.inf), None
    first = int(np.argmax(apart))
    there = [gap for gap in gaps(one, other, bounds, float(times[first])) if gap.ratio > 1.0]
    return (float(times[first - 1]) if first else -np.inf), there[0]


def _common(one: Trace, other: Trace) -> tuple[Floats, Places, Places]:
    """Instants of both traces, and their places in each; none between an event of one and the same of the other."""
    times, here, there = np.intersect1d(one.time, other.time, return_indices=True)
    first, second = (np.unique([event.time for event in trace.events]) for trace in (one, other))
    use = late_by(times, first, second, float(np.ptp(times)) if times.size else 0.0) == 0.0
    return times[use], here[use].astype(np.intp), there[use].astype(np.intp)


def _ratios(one: Trace, other: Trace, bounds: Bounds) -> tuple[tuple[Floats, Places, Places], dict[str, Floats]]:
    """Common instants and their places, and there the ratio of difference to bound of each quantity; not a number
    counts as infinite.
    """
    times, here, there = _common(one, other)
    ratios = {}
    largest = [_largest(one), _largest(other)]
    for name, bound in bounds.items():
        nominals = [n for n in (_nominal(one[name]), _nominal(other[name])) if n > 0.0]
        least = ROUND_OFF * min(trace.get(one[name].units, 0.0) for trace in largest)
        size = max(bound * min(nominals, default=0.0), least)
        apart = np.abs(one[name].values[here] - other[name].values[there])
        ratio = apart / size if size > 0.0 else np.where(apart == 0.0, 0.0, np.inf)
        ratios[name] = np.where(np.isnan(ratio), np.inf, ratio)
    return (times, here, there), ratios


def _largest(trace: Trace) -> dict[str, float]:
    """The largest nominal magnitude among the quantities of each unit."""
    found: dict[str, float] = {}
    for name in trace.names:
        found[trace[name].units] = max(found.get(trace[name].units, 0.0), _nominal(trace[name]))
    return found


def _nominal(quantity: Quantity) -> float:
    """As stored; the largest magnitude where it is not."""
    if quantity.nominal is not None:
        return quantity.nominal
    return float(np.max(np.abs(quantity.values), initial=0.0))
