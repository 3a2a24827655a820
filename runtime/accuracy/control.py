"""An accuracy asked for, met by an estimate of the global error.

A draft with longer steps is followed by a run at the tolerance that should do, a fifth to a thirtieth of it or, where
the draft took many steps, less, and both are compared at instants of the draft's own rows; a run behind them at
instants of the last one's.
Where the estimate (estimate.py) misses what was asked, a finer run follows and is compared with the last one.  The
finest run is handed back with its estimate; laws.py says what tolerances promise.
Each run finds the magnitudes of its unknowns for itself, though none larger than the run before has met: those that it
met late would hide what is small early and grows, those that were never met what is small always.  Two runs that took
the same steps say nothing: a third takes steps of half the length elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from sysdyn.runtime.accuracy.estimate import DEAR, LENGTHY, STRETCH, Estimate, is_held
from sysdyn.runtime.accuracy.laws import Law
from sysdyn.runtime.accuracy.pairs import ROUND_OFF, Sampled, difference, have_diverged
from sysdyn.runtime.integrate.request import LONGEST
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.values import dataclass

RUNS = 7
TENTH = 0.1
"""Of the tolerance of a draft as loose as any: a run with less need not follow."""
RETRIED = tuple(10.0**-k for k in range(3))
"""Of the tolerance of a first run: the next ones where it fails; the last of a draft is tame."""
WORTH = 0.3
"""Of the last tolerance: a run with more than that says little beside it."""
CHANCES = ("newton", "error_test", "singular")
"""Of a step at an event: another tolerance may pass there."""
DRAFT = 3.0
"""Longest step of a draft over that of the run behind it: its tolerance holds its error, and where the longest step
holds both runs, what no step can see differs by more than the safety.  CPU of a price's two runs over that with 1.5:
0.97 (46 seed models), with 5 the same."""
TAME = 1e-6
"""Tolerance of the next run at most where the first two ran away alike (Robertson's falls through zero), and of a
draft where Newton's failures say so before."""
QUIET = 5
"""Steps of a draft beyond those of its longest step, up to which that length holds them."""


@dataclass(frozen=True, slots=True)
class Achieved:
    """error_estimate: largest relative error estimated of the last run (None: nothing estimates it, and it is not
    met); met: it is within what was asked; lost: the last two runs had nothing in common.
    """

    error_estimate: float | None
    met: bool
    runs: int
    tolerance: float
    lost: bool = False

    @property
    def below_round_off(self) -> bool:
        """The estimate is less than double precision resolves."""
        return self.error_estimate is not None and bool(self.error_estimate < ROUND_OFF)


Run = Callable[[float, float], Sampled]
"""Integrates with a tolerance and a longest step as part of the span."""


def _achievement(estimate: float, met: bool, runs: int, tolerance: float, *, lost: bool = False) -> Achieved:
    """A finite estimate, or none at all."""
    if not np.isfinite(estimate):
        return Achieved(None, False, runs, tolerance, lost)
    return Achieved(estimate, met, runs, tolerance, lost)


def _verdict_on_like_steps(run: Run, last: Sampled, target: Floats, number: int) -> Achieved:
    """The verdict on two runs that took the same steps: what a run with other steps differs by."""
    try:
        # at most half the mean step: so the instants of the steps are others
        now = run(last.tolerance, 0.5 * min(LONGEST, 1.0 / max(last.steps, 1)))
    except SolverFailure:
        return Achieved(None, False, number + 1, last.tolerance)
    apart, over = difference(last, now, target)
    return _achievement(apart, over <= 1.0, number + 1, last.tolerance)


def _is_limited(failure: SolverFailure) -> bool:
    """It ended because the caller wanted it to, or no time is left."""
    return failure.late or failure.cause in ("max_steps", "max_wall")


def _draft(run: Run, tolerance: float, law: Law) -> Sampled:
    """The first run; where it fails, once more with smaller tolerances, where it is strained with a tame one."""
    tried = 0
    while True:
        try:
            return run(min(max(RETRIED[tried] * tolerance, law.finest) / law.ratio, law.loosest), DRAFT * LONGEST)
        except SolverFailure as failure:
            tried += 1
            if tried == len(RETRIED) or _is_limited(failure) or failure.cause == "stiff":
                raise
            if failure.cause == "strained" or tried == len(RETRIED) - 1:
                tolerance = min(tolerance, TAME * law.ratio / RETRIED[tried])


def control(
    run: Run,
    target: Floats,
    law: Law,
    *,
    doubted: bool = False,
    tame: bool = False,
    first: float | None = None,
) -> Achieved:
    """Runs until the last one's estimated error meets `target` [quantities], at most RUNS times.

    doubted: another method failed here, and a pair of runs is not believed on its own; tame: loose runs are
    known to have nothing in common here; first: the tolerance of the run behind the draft, where one is known that
    does.

    Raises SolverFailure where the first runs fail.
    """
    wanted = float(np.min(target, initial=1.0))
    tolerance = law.tolerance(wanted if wanted < 1.0 else 1e-4) if first is None else max(first, law.finest)
    last = _draft(run, min(tolerance, TAME * law.ratio) if tame else tolerance, law)
    estimate, longest = Estimate(law, target), LONGEST
    still = last.steps <= 1.0 / (DRAFT * LONGEST) + QUIET
    shorter: float | None = None
    number, away = 1, False
    if first is None and wanted < 1.0:
        tolerance = law.tolerance(wanted, last.steps)
    ratio = max(law.ratio, TENTH) if last.tolerance >= law.loosest else law.ratio
    tolerance = max(min(tolerance, ratio * last.tolerance), law.far * last.tolerance, law.finest)
    while number < RUNS:
        number += 1
        now = _finer(run, last, tolerance, longest, law, compared=bool(np.isfinite(estimate.over)))
        if now is None:
            break
        apart = estimate.compare(last, now, shorter)
        if now.steps == last.steps and apart < ROUND_OFF:
            return _verdict_on_like_steps(run, now, target, number)
        away = have_diverged(last, now, target)
        if estimate.met and not ((doubted or estimate.stalled) and estimate.alone) and not away:
            return _achievement(estimate.apart, True, number, now.tolerance)
        dear = estimate.lost or estimate.next_tolerance(now.tolerance) <= DEAR
        if law.brief and dear and now.steps < LENGTHY:
            return _achievement(estimate.apart, False, number, now.tolerance, lost=estimate.lost)
        before, still = still, is_held(now, longest)
        held, finest = before and still, now.tolerance <= 1.01 * law.finest
        if finest and not held:
            last = now
            break
        shorter = estimate.shorter() if held and (finest or not estimate.root) else None
        last, longest = now, longest * (shorter or 1.0 / STRETCH)
        tolerance = min(estimate.next_tolerance(now.tolerance), TAME if away else 1.0)
    if estimate.met and not away:  # doubted, and no finer run can tell: one with other steps can
        return _verdict_on_like_steps(run, last, target, number)
    return _achievement(estimate.apart, False, number, last.tolerance)


def _finer(run: Run, last: Sampled, tolerance: float, longest: float, law: Law, *, compared: bool) -> Sampled | None:
    """A run with a smaller tolerance; where it fails half the way to it, while that is worth a run, or once a little
    further: at an event a step fails by chance.

    compared: there is an estimate without it; else its failure is raised.
    """
    tried = 0
    while True:
        try:
            return run(tolerance, longest)
        except SolverFailure as failure:
            tried += 1
            if _is_limited(failure) or (not compared and tried == len(RETRIED)):
                raise
            by_chance = tried == 1 and failure.cause in CHANCES
        if not compared:  # there is nothing to hand back yet: as coarse as will do, else a little finer
            coarse = law.ratio * last.tolerance
            tolerance = coarse if tolerance < WORTH * coarse and tried == 1 else WORTH * tolerance
            continue
        between = float(np.sqrt(tolerance * last.tolerance))
        if between > WORTH * last.tolerance and not by_chance:
            return None
        tolerance = between if between <= WORTH * last.tolerance else WORTH * tolerance
