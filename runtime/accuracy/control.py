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
from sysdyn.runtime.accuracy.estimate import DEAR, LENGTHY, STRETCH, ErrorEstimate, is_held
from sysdyn.runtime.accuracy.laws import Law
from sysdyn.runtime.accuracy.pairs import ROUND_OFF, RunSample, difference, have_diverged
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


Run = Callable[[float, float], RunSample]
"""Integrates with a tolerance and a longest step as part of the span."""


def _achievement(estimate: float, met: bool, runs: int, tolerance: float, *, lost: bool = False) -> Achieved:
    """A finite estimate, or none at all."""
    # two runs that cannot be compared: no estimate, never met
    if not np.isfinite(estimate):
        return Achieved(None, False, runs, tolerance, lost)
    return Achieved(estimate, met, runs, tolerance, lost)


def _verdict_on_like_steps(run: Run, last: RunSample, target: Floats, number: int) -> Achieved:
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


def _draft(run: Run, tolerance: float, law: Law) -> RunSample:
    """The first run; where it fails, once more with smaller tolerances, where it is strained with a tame one."""
    tried = 0
    # looser at first, where that fails finer: a coarse step may leave the domain of a law
    while True:
        try:
            return run(min(max(RETRIED[tried] * tolerance, law.finest) / law.ratio, law.loosest), DRAFT * LONGEST)
        except SolverFailure as failure:
            tried += 1
            # what a limit of work or of time stopped, or stiffness, no tolerance mends
            if tried == len(RETRIED) or _is_limited(failure) or failure.cause == "stiff":
                raise
            # strained, or the last try: the tolerance at which runs have converged
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
    # nothing finite wanted: as for 1e-4
    wanted = float(np.min(target, initial=1.0))
    tolerance = law.tolerance(wanted if wanted < 1.0 else 1e-4) if first is None else max(first, law.finest)
    last = _draft(run, min(tolerance, TAME * law.ratio) if tame else tolerance, law)
    estimate, longest = ErrorEstimate(law, target), LONGEST
    # a draft of hardly more steps than its longest allows: the motion asks for none
    still = last.steps <= 1.0 / (DRAFT * LONGEST) + QUIET
    shorter: float | None = None
    number, away = 1, False
    # the draft's steps say how long the run is, and a law's power depends on that
    if first is None and wanted < 1.0:
        tolerance = law.tolerance(wanted, last.steps)
    # a draft at its loosest may be followed by a larger drop than the usual ratio
    ratio = max(law.ratio, TENTH) if last.tolerance >= law.loosest else law.ratio
    tolerance = max(min(tolerance, ratio * last.tolerance), law.far * last.tolerance, law.finest)
    while number < RUNS:
        number += 1
        now = _finer(run, last, tolerance, longest, law, compared=bool(np.isfinite(estimate.over)))
        # a finer run failed and was not worth another try
        if now is None:
            break
        apart = estimate.compare(last, now, shorter)
        # the same steps and the same values: the tolerance has no effect
        if now.steps == last.steps and apart < ROUND_OFF:
            return _verdict_on_like_steps(run, now, target, number)
        away = have_diverged(last, now, target)
        # met, and by more than one pair where one alone is not believed
        if estimate.met and not ((doubted or estimate.stalled) and estimate.alone) and not away:
            return _achievement(estimate.apart, True, number, now.tolerance)
        # a method on trial whose next run would cost too much: left to the next method
        dear = estimate.lost or estimate.next_tolerance(now.tolerance) <= DEAR
        if law.brief and dear and now.steps < LENGTHY:
            return _achievement(estimate.apart, False, number, now.tolerance, lost=estimate.lost)
        before, still = still, is_held(now, longest)
        # both runs held by the longest step: the tolerance says nothing, shorter steps do
        held, finest = before and still, now.tolerance <= 1.01 * law.finest
        # the finest tolerance is reached: no finer run is left
        if finest and not held:
            last = now
            break
        # steps are shortened where they, not the tolerance, decide the error
        shorter = estimate.shorter() if held and (finest or not estimate.root) else None
        last, longest = now, longest * (shorter or 1.0 / STRETCH)
        # runs that ran away from each other are not followed loosely
        tolerance = min(estimate.next_tolerance(now.tolerance), TAME if away else 1.0)
    if estimate.met and not away:  # doubted, and no finer run can tell: one with other steps can
        return _verdict_on_like_steps(run, last, target, number)
    return _achievement(estimate.apart, False, number, last.tolerance)


def _finer(
    run: Run, last: RunSample, tolerance: float, longest: float, law: Law, *, compared: bool
) -> RunSample | None:
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
            # a limit of work or time; or nothing to compare with after all tries
            if _is_limited(failure) or (not compared and tried == len(RETRIED)):
                raise
            # the first failure at an event may be chance: a little finer passes
            by_chance = tried == 1 and failure.cause in CHANCES
        if not compared:  # there is nothing to hand back yet: as coarse as will do, else a little finer
            coarse = law.ratio * last.tolerance
            tolerance = coarse if tolerance < WORTH * coarse and tried == 1 else WORTH * tolerance
            continue
        # half way in decades of tolerance
        between = float(np.sqrt(tolerance * last.tolerance))
        # hardly finer than the last run: not worth it
        if between > WORTH * last.tolerance and not by_chance:
            return None
        # finer by chance, or the geometric mean
        tolerance = between if between <= WORTH * last.tolerance else WORTH * tolerance
