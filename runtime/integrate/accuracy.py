"""An accuracy asked for, met by an estimate of the global error.

The same problem is integrated with falling tolerances; two runs are compared at common instants.  With
error ~ tolerance^p the error of the finer run is difference x / (1 - x), x = (ratio of the tolerances)^p; p as measured
over three runs, at most CREDIT.  The finest run is handed back with its estimate.  Each run finds the magnitudes of its
unknowns for itself: those that an earlier run met late would hide what is small early and grows.  Two runs that took
the same steps say nothing: a third takes steps of half the length at other instants.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sysdyn.runtime.integrate.request import LONGEST
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure

RUNS = 7
FINEST = 2e-14
COARSEST = 1e-3
POWER = 0.8
"""With which the next tolerance is predicted."""
CREDIT = 0.5
"""Largest power with which the finer run's error is believed to be smaller: BDF's error falls irregularly where its
order changes (measured on the harmonic oscillator: locally 0.3)."""
SAFETY = 2.5
"""Of the estimate: the instants of comparison miss some of the largest error."""
RATIO = 0.1
"""Of the tolerances of the first two runs."""
WORTH = 0.3
"""Of the last tolerance: a run with more than that says little beside it."""
ROUND_OFF = 64.0 * float(np.finfo(np.float64).eps)
"""Relative errors below this are those of the numbers themselves."""


@dataclass(frozen=True, slots=True)
class Sampled:
    """What a run hands to the comparison.  values [instants, quantities]; largest [quantities] against
    which errors are relative; steps: accepted; noise [quantities]: a quantity that stays below it is zero to round-off.
    """

    tolerance: float
    values: Floats
    largest: Floats
    steps: int
    noise: Floats | float = 0.0


@dataclass(frozen=True, slots=True)
class Achieved:
    """error_estimate: largest relative error estimated of the last run (None: nothing estimates it, and it is not
    met); below_round_off: the estimate is less than double precision resolves; met: it is within what was asked.
    """

    error_estimate: float | None
    below_round_off: bool
    met: bool
    runs: int
    tolerance: float


Run = Callable[[float, float | None], Sampled]
"""Integrates with a tolerance and a longest step as part of the span (None: the usual one)."""


def difference(coarse: Sampled, fine: Sampled, target: Floats) -> tuple[float, float]:
    """(largest relative difference, the same over the accuracy wanted) of two runs, in the finer one's sizes."""
    size = fine.largest
    use = (size != 0.0) & np.isfinite(target)  # sizes that are no numbers are used: they are not met
    if not use.any() or not fine.values.size:
        return 0.0, 0.0
    if coarse.values.shape != fine.values.shape:
        return np.inf, np.inf
    # zero by symmetry, in both runs: what is left of it is nobody's error
    use &= ~(np.maximum(np.abs(coarse.values), np.abs(fine.values)).max(axis=0) <= fine.noise)
    if not use.any():
        return 0.0, 0.0
    relative = np.abs(fine.values[:, use] - coarse.values[:, use]).max(axis=0) / size[use]
    relative = np.where(np.isfinite(relative), relative, np.inf)
    return float(relative.max()), float((relative / target[use]).max())


def _shrink(power: float, step: float) -> float:
    """Error of the finer run over its difference from the coarser one, whose tolerance is 10^step larger."""
    ratio = 10.0 ** (-power * step)
    return float(SAFETY * ratio / (1.0 - ratio))


def _achieved(estimate: float, met: bool, runs: int, tolerance: float) -> Achieved:
    """A finite estimate, or none at all."""
    if not np.isfinite(estimate):
        return Achieved(None, False, False, runs, tolerance)
    return Achieved(estimate, estimate < ROUND_OFF, met, runs, tolerance)


def _shifted(run: Run, last: Sampled, target: Floats, number: int) -> Achieved:
    """The verdict on two runs that took the same steps: what a run with other steps differs by."""
    try:
        # at most half the mean step: so the instants of the steps are others
        now = run(last.tolerance, 0.5 * min(LONGEST, 1.0 / max(last.steps, 1)))
    except SolverFailure:
        return Achieved(None, False, False, number + 1, last.tolerance)
    apart, over = difference(last, now, target)
    return _achieved(apart, over <= 1.0, number + 1, last.tolerance)


def control(run: Run, target: Floats, finest: float = FINEST, *, doubted: bool = False) -> Achieved:
    """Runs until the last one's estimated error meets `target` [quantities], at most RUNS times.

    finest: the smallest tolerance that makes sense for the method; doubted: another method failed here, and the first
    pair of runs is not believed on its own.

    Raises SolverFailure where the first runs fail.
    """
    wanted = float(np.min(target, initial=1e-4))
    tolerance = float(np.clip(wanted, finest / RATIO, COARSEST))
    try:
        last = run(tolerance, None)
    except SolverFailure as failure:
        if failure.cause in ("max_steps", "max_wall"):
            raise
        tolerance = max(1e-2 * tolerance, finest / RATIO)
        last = run(tolerance, None)
    before: float | None = None
    power, last_step = POWER, 0.0
    tolerance = max(RATIO * tolerance, finest)
    estimate, relative = np.inf, np.inf
    for number in range(2, RUNS + 1):
        try:
            now = run(tolerance, None)
        except SolverFailure as failure:
            if failure.cause in ("max_steps", "max_wall") or number == 2:
                raise
            # half the way to where it failed, while that is a smaller tolerance worth a run
            tolerance = float(np.sqrt(tolerance * last.tolerance))
            if tolerance > WORTH * last.tolerance:
                return _achieved(relative, False, number, last.tolerance)
            continue
        step = float(np.log10(last.tolerance / now.tolerance))
        apart, over = difference(last, now, target)
        if now.steps == last.steps and apart < ROUND_OFF:
            return _shifted(run, now, target, number)
        if before is not None and before > 0.0 and 0.0 < over < before and last_step > 0.0:
            power = float(np.clip(np.log10(before / over) / last_step, 0.3, 1.0))
        shrink = _shrink(min(power, CREDIT), step)
        if before is not None and over > before:
            shrink = 1.0  # no convergence seen: no credit for the smaller tolerance
        estimate, relative = over * shrink, apart * shrink
        if estimate <= 1.0 and not (doubted and number == 2):
            return _achieved(relative, True, number, now.tolerance)
        if now.tolerance <= 1.01 * finest:
            return _achieved(relative, False, number, now.tolerance)
        before, last, last_step = over, now, step
        # the tolerance at which the next run should do, with the estimate's own safety
        drop = np.clip((1.0 / max(1.5 * estimate, 1e-300)) ** (1.0 / max(power, CREDIT)), 1e-3, 0.2)
        tolerance = max(float(drop) * now.tolerance, finest)
    return _achieved(relative, False, RUNS, last.tolerance)
