"""An accuracy asked for, met by an estimate of the global error.

A draft with longer steps is followed by a run at the tolerance that should do, a fifth to a thirtieth of it or, where
the draft took many steps, less, and both are compared at instants of the draft's own rows; a run behind them at
instants of the last one's.  Where little happens in a draft of radau, the run behind it is one of the bdf.
With error ~ tolerance^p the error of the finer run is difference x / (1 - x), x = (ratio of the tolerances)^p; p as
measured over three runs, at most what the method's law credits; where it is more than errors ever fall with, one of the
runs is good by chance, and the last is as much better than the first as is credited.  Where the estimate misses what
was asked, a finer run follows and is compared with the last one.
The finest run is handed back with its estimate; laws.py says what tolerances promise.
Each run finds the magnitudes of its unknowns for itself: those that an earlier run met late would hide what is small
early and grows.  Two runs that took the same steps say nothing: a third takes steps of half the length elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from sysdyn.runtime.accuracy.laws import Law
from sysdyn.runtime.accuracy.pairs import ROUND_OFF, Sampled, difference, left_at_rest, parted, passed_over
from sysdyn.runtime.integrate.request import LONGEST
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.values import dataclass

RUNS = 7
TENTH = 0.1
"""Of the tolerance of a draft as loose as any: a run with less need not follow."""
RETRIED = (1.0, 0.1, 1e-2)
"""Of the tolerance of a first run: the next ones where it fails."""
WORTH = 0.3
"""Of the last tolerance: a run with more than that says little beside it."""
CHANCES = ("newton", "error_test", "singular")
"""Of a step at an event: another tolerance may pass there."""
ROOT = 0.5
"""Part of what is credited where a quantity ends as a root of the state, from the pair on that shows it."""
SHORT = 60
"""Steps of a run below which its error does not follow its tolerance as theory says."""
FIRST_DROP = 1e-2
AIM, LEFT = 2.0, 0.3
"""How far below what was asked the next run aims, and the most that is left of its tolerance."""
DIFFER, FAR_OFF, DEEP, MORE, DEEPEST = 0.3, 10.0, 3.0, 1.7, 1e-6
"""Difference of two runs, and times what was asked, that says only that they have nothing in common (the phase of a
relaxation oscillation is lost), their tolerances less than these decades apart: the next one is then as small as
takes MORE times the steps, by what the last drop cost, at least this part.  Where that has nothing in common with the
run before either, a hundredth of it follows (with 2 times and without that van der Pol costs 1.03 of it)."""
SLOWEST = 0.6
"""The least power with which errors are taken to fall when the next tolerance is chosen."""
STRETCH = 1.5
"""Of the longest step of a run over that of a finer one: where it, and not the tolerance, holds both, their steps still
differ, and the error of a method of order 5 or more by as much as ten times the tolerance makes it."""
DRAFT = 3.0
"""Longest step of a draft over that of the run behind it: its tolerance holds its error, and where the longest step
holds both runs, what no step can see differs by more than the safety.  CPU of a price's two runs over that with 1.5:
0.97 (46 seed models), with 5 the same."""
HOLDS, SHORTEN = 1.2, 1.0 / 32.0
"""Steps of a run over those of the longest length, up to which that length holds them and the tolerance does not (what
algebra alone determines has no error that a step could test), in both runs of a pair; the least that the next run's is
of it."""
BY_STEPS, TOWARDS, ENOUGH = 2.0, 2.5, 20_000
"""The power of the steps with which such errors fall at least, and mostly (rates of what is interpolated: 2.3 to 3);
steps of a run behind which none is shortened."""
TAME = 1e-6
"""Tolerance of the next run at most where the first two ran away alike (Robertson's falls through zero), and of a
draft where Newton's failures say so before."""
LENGTHY, DEAR = 1000, 1e-8
"""Steps of a run in which so much happens that every method's loose runs have nothing in common, and a finer one costs
less than another method's draft (the ring modulator at 1e-2, 1e-3, 1e-6: 0.10, 0.16, 0.6 s for 0.27, 0.63, 1.1);
tolerance below which methods of more stages or steps cost less."""
UNSEEN = 0.5
"""Of an error, what is credited at most to a finer run whose steps are hardly shorter."""
ALIKE = 1.1
"""Times the steps of the coarser run: with no more than that events hold most, where both are as far off."""
AT_EVENTS, SLOW, STALLS = 0.2, 0.5, 0.5
"""Where events happen: the power by which is told (of 475 such pairs 14 were over 1.5 times what the credit told, one
what this does); a power measured, below which no smaller tolerance is credited, for knocks make of errors what they
make of phases; part of the difference before, from which on a pair does not show that errors fall, and the next is not
believed on its own (play: 0.17, 0.18, 0.0055 of runs that were 0.016 off), unless it agrees BY_FAR better."""
BY_FAR = 1e-3
MET = 1.0 - 1e-15
"""Of what was asked: what is told of a run that meets it, at most."""
SURE = 2.0
"""Of what is told, the safety at least."""
LAST, BY_CHANCE = 10.0, 1.5
"""Times the finest tolerance: behind such a run there is none that tells; the power of its errors that is believed."""
STEPPED = 5.0
"""Power of the steps with which what is told falls at most."""
TINY = 1e-30
"""An estimate beside what was asked below which it counts as none."""
QUIET, AGREE = 5, 2.0
"""Steps of a draft beyond those of its longest step, up to which little happens in it: a lighter method follows, and
a run of its own differs from the draft by its own error, AGREE times of which is the estimate (on 175 runs of eleven
models the estimate was 1 to 13 times the error, mostly 2).  With one step more two of three such runs came to nothing;
CPU of 36 rows of drafts with 11 to 13 steps over that with 7: with 6 0.98, with 5 1.01, with 4 1.24; with 6 the voice
coil at 1e-2, whose run of the bdf comes to nothing, is dearer by a third."""
LIGHTLY = 1e-5
"""Of accuracies below a method of low order is not tried: at 1e-6 every second model takes it too many steps."""


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


@dataclass(frozen=True, slots=True)
class Lighter:
    """A method whose runs cost less where little happens.  law: how its errors follow its tolerance; take: the runs go
    on with it; leave: they go on with the method before, compared with the run before.
    """

    law: Law
    take: Callable[[], None]
    leave: Callable[[], None]


Run = Callable[[float, float], Sampled]
"""Integrates with a tolerance and a longest step as part of the span."""


def _shrink(law: Law, power: float, step: float, coarse: Sampled, fine: Sampled) -> float:
    """Error of the finer run over its difference from the coarser one, whose tolerance is 10^step times larger; beyond
    law.far nothing more is credited.  Of longer steps the tolerance says nothing, of hardly shorter ones where events
    happen, which may hold them.
    """
    longer, jumps = fine.steps / max(coarse.steps, 1), fine.jumps
    ratio = max(10.0 ** (-power * step), law.far**law.credit)
    if longer <= ALIKE if jumps else longer < 1.0 and not law.order:
        ratio = max(ratio, UNSEEN)
    if law.order:
        order = law.order if fine.steps >= LENGTHY else min(law.order, law.fronts)
        ratio = max(ratio, min(max(longer, 1.0) ** -order, UNSEEN))
    return float(law.safety * ratio / (1.0 - ratio))


def _achieved(estimate: float, met: bool, runs: int, tolerance: float, *, lost: bool = False) -> Achieved:
    """A finite estimate, or none at all."""
    if not np.isfinite(estimate):
        return Achieved(None, False, runs, tolerance, lost)
    return Achieved(estimate, met, runs, tolerance, lost)


def _shifted(run: Run, last: Sampled, target: Floats, number: int) -> Achieved:
    """The verdict on two runs that took the same steps: what a run with other steps differs by."""
    try:
        # at most half the mean step: so the instants of the steps are others
        now = run(last.tolerance, 0.5 * min(LONGEST, 1.0 / max(last.steps, 1)))
    except SolverFailure:
        return Achieved(None, False, number + 1, last.tolerance)
    apart, over = difference(last, now, target)
    return _achieved(apart, over <= 1.0, number + 1, last.tolerance)


def _limited(failure: SolverFailure) -> bool:
    """It ended because the caller wanted it to."""
    return failure.cause in ("max_steps", "max_wall")


def _draft(run: Run, tolerance: float, law: Law) -> Sampled:
    """The first run; where it fails, once more with smaller tolerances, where it is strained with a tame one."""
    tried = 0
    while True:
        try:
            return run(min(max(RETRIED[tried] * tolerance, law.finest) / law.ratio, law.loosest), DRAFT * LONGEST)
        except SolverFailure as failure:
            tried += 1
            if tried == len(RETRIED) or _limited(failure) or failure.cause == "stiff":
                raise
            if failure.cause == "strained":
                tolerance = min(tolerance, TAME * law.ratio / RETRIED[tried])


class _Estimate:
    """The estimate of the last of two runs, and the power with which the errors fall.

    over: beside what was asked, as it mostly is; apart: what is told, relative, hardly ever less than it is, but no
    more than what was asked where that is met; alone: no pair before says how errors fall; stalled: the pair before
    did not show that they do; root: a quantity ends as a root of the state: what tolerances do for it comes before
    shorter steps.
    """

    def __init__(self, law: Law, target: Floats) -> None:
        self.law, self.target = law, target
        self.over = self.apart = np.inf
        self._deep, self.lost, self._unknown, self.alone = 1.0, False, False, True
        self.stalled = self._stalls = False
        self._before: tuple[float, float] | None = None
        self._power: float | None = None
        self.root = False

    def compare(self, coarse: Sampled, fine: Sampled, shorter: float | None = None) -> float:
        """Takes the pair in; returns the plain difference.  shorter: the longest step of the finer over that of the
        coarser run, where it holds both.
        """
        step = float(np.log10(coarse.tolerance / fine.tolerance))
        apart, over = difference(coarse, fine, self.target)
        left, left_over = left_at_rest(coarse, fine, self.target, known=self.root)
        self.root |= left > 0.0
        if self.root and step > 0.0:
            shorter = None
        self.stalled = self._stalls and self._before is not None and over > BY_FAR * self._before[0]
        self.alone = shorter is None and (self._before is None or self.stalled)
        lost = apart > DIFFER and over > FAR_OFF
        self._unknown = lost and (step >= DEEP or self.lost)
        self._deep = _affordable(coarse, fine) if lost and not self._unknown else 1.0
        self.lost = lost
        shrink, luck, slow, self._stalls = None, 1.0, False, False
        credit = self.law.credit if fine.steps >= SHORT else min(self.law.credit, self.law.short)
        credit *= ROOT if self.root else 1.0
        if shorter is not None:
            part = shorter ** (ROOT * BY_STEPS if self.root else BY_STEPS)
            shrink = self.law.safety * part / (1.0 - part)
        elif self._before is not None:
            over_before, step_before = self._before
            self._stalls = fine.jumps and over > STALLS * over_before
            slow = fine.jumps and over > 0.0 and over > over_before * 10.0 ** (-SLOW * step_before)
            if over > over_before or slow:
                shrink, slow = 1.0, True  # no convergence seen: no credit for the smaller tolerance
            elif over > 0.0 and np.isfinite(over_before):
                power = np.log10(over_before / over) / step_before
                self._power = float(np.clip(power, 0.3, 1.0))
                if power > self._fastest(fine):  # by chance: the pair before speaks for the last run
                    luck = 10.0 ** ((power - credit) * step_before)
        if shrink is None:
            power = credit if self._power is None else min(self._power, credit)
            shrink = _shrink(self.law, power, step, coarse, fine)
        self._before = (over, step) if shorter is None and not lost else None  # what is lost has no power
        least = self.law.least * fine.tolerance
        shrink *= luck
        told = self._told(step, coarse, fine) if shorter is None and not slow else SURE
        told = max(shrink, min(told, MET / over)) if over > 0.0 else shrink
        self.apart, self.over = max(apart * told, least), max(over * shrink, least / float(np.min(self.target)))
        self.apart, self.over = max(self.apart, left), max(self.over, left_over)
        off, off_over = passed_over(coarse, fine, self.target, self.law.safety * UNSEEN / (1.0 - UNSEEN))
        self.apart, self.over = max(self.apart, off), max(self.over, off_over)
        return apart

    def _told(self, step: float, coarse: Sampled, fine: Sampled) -> float:
        """Error of the finer run over its difference from the coarser one, at most; step: decades of tolerance."""
        law = self.law
        power = min(law.sure, AT_EVENTS) if fine.jumps else law.sure
        ratio = max(10.0 ** (-power * step), law.far**power, (fine.steps / max(coarse.steps, 1)) ** -STEPPED)
        ratio = min(ratio, UNSEEN)
        return float(max(law.safety, SURE) * ratio / (1.0 - ratio))

    def _fastest(self, fine: Sampled) -> float:
        """The power beyond which differences fall by chance; with events at the finest tolerances round-off is what is
        left, which events that follow from each other let grow.
        """
        last = fine.jumps and fine.tolerance <= LAST * self.law.finest
        return min(self.law.fastest, BY_CHANCE) if last else self.law.fastest

    def shorter(self) -> float:
        """How much shorter the longest step of the next run is where that is what holds the steps."""
        return float(np.clip((AIM * self.over) ** (-1.0 / TOWARDS), SHORTEN, 1.0 / STRETCH))

    def next_tolerance(self, tolerance: float) -> float:
        """The tolerance at which the next run should do, with the estimate's own safety.

        What a draft beyond all bounds says of the run behind it is not taken for more than FIRST_DROP.
        """
        if self._unknown:  # the coarser run says nothing of a much finer one: another beside that will
            return max(FIRST_DROP * tolerance, self.law.finest)
        power = self.law.power if self._power is None else max(self._power, SLOWEST)
        drop = max(AIM * self.over, TINY) ** (-1.0 / power)
        least, most = (FIRST_DROP, self.law.little) if self._power is None else (1e-3, LEFT)
        return max(min(float(np.clip(drop, least, most)), self._deep) * tolerance, self.law.finest)


def _affordable(coarse: Sampled, fine: Sampled) -> float:
    """Part of the tolerance at which a run takes MORE times the steps, as they grew between the two."""
    growth = np.log(max(fine.steps, 1) / max(coarse.steps, 1)) / np.log(coarse.tolerance / fine.tolerance)
    return float(np.clip(MORE ** (-1.0 / max(growth, 1e-2)), DEEPEST, FIRST_DROP))


def _held(run: Sampled, longest: float) -> bool:
    """Whether the longest step, and not the tolerance, holds the steps."""
    return run.steps * longest < HOLDS and run.steps < ENOUGH


def _quiet(draft: Sampled) -> bool:
    """Whether little happens in a draft."""
    return draft.steps <= 1.0 / (DRAFT * LONGEST) + QUIET


def _agreed(run: Run, draft: Sampled, lighter: Lighter, target: Floats, wanted: float) -> Achieved | None:
    """What a run of the lighter method is worth behind a draft in which little happens: a pair of two methods, whose
    errors have nothing in common.  None where much happens, or where it fails or misses: the method before goes on.
    """
    if not _quiet(draft):
        return None
    lighter.take()
    try:
        now = run(lighter.law.tolerance(wanted), LONGEST)
    except SolverFailure as failure:
        if failure.cause == "max_wall":
            raise
    else:
        apart, over = difference(draft, now, target)
        if AGREE * over <= 1.0 and not parted(draft, now, target):
            return _achieved(AGREE * apart, True, 2, now.tolerance)
    lighter.leave()
    return None


def control(
    run: Run,
    target: Floats,
    law: Law,
    *,
    doubted: bool = False,
    tame: bool = False,
    first: float | None = None,
    lighter: Lighter | None = None,
) -> Achieved:
    """Runs until the last one's estimated error meets `target` [quantities], at most RUNS times.

    doubted: another method failed here, and a pair of runs is not believed on its own; tame: loose runs are
    known to have nothing in common here; first: the tolerance of the run behind the draft, where one is known that
    does; lighter: takes over where little happens.

    Raises SolverFailure where the first runs fail.
    """
    wanted = float(np.min(target, initial=1.0))
    tolerance = law.tolerance(wanted if wanted < 1.0 else 1e-4) if first is None else max(first, law.finest)
    last = _draft(run, min(tolerance, TAME * law.ratio) if tame else tolerance, law)
    estimate, longest = _Estimate(law, target), LONGEST
    still = _quiet(last)
    shorter: float | None = None
    number, away = 1, False
    if first is None and wanted < 1.0:
        tolerance = law.tolerance(wanted, last.steps)
    ratio = max(law.ratio, TENTH) if last.tolerance >= law.loosest else law.ratio
    tolerance = max(min(tolerance, ratio * last.tolerance), law.far * last.tolerance, law.finest)
    usual = first is None and LIGHTLY <= wanted < 1.0 and not doubted
    light = _agreed(run, last, lighter, target, wanted) if lighter is not None and usual else None
    if light is not None:
        return light
    while number < RUNS:
        number += 1
        now = _finer(run, last, tolerance, longest, law, compared=bool(np.isfinite(estimate.over)))
        if now is None:
            break
        apart = estimate.compare(last, now, shorter)
        if now.steps == last.steps and apart < ROUND_OFF:
            return _shifted(run, now, target, number)
        away = parted(last, now, target)
        if estimate.over <= 1.0 and not ((doubted or estimate.stalled) and estimate.alone) and not away:
            return _achieved(estimate.apart, True, number, now.tolerance)
        dear = estimate.lost or estimate.next_tolerance(now.tolerance) <= DEAR
        if law.brief and dear and now.steps < LENGTHY:
            return _achieved(estimate.apart, False, number, now.tolerance, lost=estimate.lost)
        before, still = still, _held(now, longest)
        held, finest = before and still, now.tolerance <= 1.01 * law.finest
        if finest and not held:
            last = now
            break
        shorter = estimate.shorter() if held and (finest or not estimate.root) else None
        last, longest = now, longest * (shorter or 1.0 / STRETCH)
        tolerance = min(estimate.next_tolerance(now.tolerance), TAME if away else 1.0)
    if estimate.over <= 1.0 and not away:  # doubted, and no finer run can tell: one with other steps can
        return _shifted(run, last, target, number)
    return _achieved(estimate.apart, False, number, last.tolerance)


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
            if _limited(failure) or (not compared and tried == len(RETRIED)):
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
