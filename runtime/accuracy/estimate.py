"""What two runs at different tolerances say of the finer one's error.

With error ~ tolerance^p the error of the finer run is difference x / (1 - x), x = (ratio of the tolerances)^p; p as
measured over three runs, at most what the method's law credits (laws.py); where it is more than errors ever fall with,
one of the runs is good by chance, and the last is as much better than the first as is credited.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.accuracy.laws import Law
from sysdyn.runtime.accuracy.pairs import RunSample, before_fronts, difference, left_at_rest, passed_over
from sysdyn.runtime.model.description import Floats

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
HOLDS, SHORTEN = 1.2, 1.0 / 32.0
"""Steps of a run over those of the longest length, up to which that length holds them and the tolerance does not (what
algebra alone determines has no error that a step could test), in both runs of a pair; the least that the next run's is
of it."""
BY_STEPS = 2.0
"""Power with which errors fall at least where the longest step holds both runs."""
TOWARDS, ENOUGH = 2.5, 20_000
"""The power of the steps with which such errors mostly fall (rates of what is interpolated: 2.3 to 3); steps of a run
behind which none is shortened."""
LENGTHY, DEAR = 1000, 1e-8
"""Steps of a run in which so much happens that every method's loose runs have nothing in common, and a finer one costs
less than another method's draft (the ring modulator at 1e-2, 1e-3, 1e-6: 0.10, 0.16, 0.6 s for 0.27, 0.63, 1.1);
tolerance below which methods of more stages or steps cost less."""
APART, HELD = 1.8, 7.0
"""Decades between two tolerances from which on, where events happen, methods of no counted order are doubted whose
steps are shorter by less than makes of errors, with that power, what is credited (play by radau: a hundredth of the
tolerance took 1.35 times the steps, and left half of the error, told as an eighth)."""
UNSEEN = 0.5
"""Of an error, what is credited at most to a finer run whose steps are hardly shorter."""
ALIKE = 1.1
"""Times the steps of the coarser run: with no more than that events hold most, where both are as far off."""
AT_EVENTS, SLOW, STALLS = 0.2, 0.5, 0.5
"""Where events happen: the power by which is told (of 475 such pairs 14 were over 1.5 times what the credit told, one
what this does); a power measured, below which no smaller tolerance is credited, for knocks make of errors what they
make of phases; part of the difference before, from which on a pair does not show that errors fall, and the next is not
believed on its own (play: 0.17, 0.18, 0.0055 of runs that were 0.016 off), unless it agrees BY_FAR better."""
BY_FAR = tuning.SMALL
OTHERS, GROWN = 0.1, 1.3
"""Part of the events by which two runs differ, and times the steps that the smaller tolerance asks of the order, from
which on the finer run has met what the other has not seen: nothing is credited then.  Of 1329 runs of knocks, clutches
and belts 21 take a third run by it, 10 of which were met and up to 6 times further off than was asked."""
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


def is_held(run: RunSample, longest: float) -> bool:
    """Whether the longest step, and not the tolerance, holds the steps."""
    return run.steps * longest < HOLDS and run.steps < ENOUGH


def _shrink(law: Law, power: float, step: float, coarse: RunSample, fine: RunSample) -> float:
    """Error of the finer run over its difference from the coarser one, whose tolerance is 10^step times larger; beyond
    law.far nothing more is credited.  Of longer steps the tolerance says nothing, of hardly shorter ones where events
    happen, which may hold them.
    """
    longer, jumps = fine.steps / max(coarse.steps, 1), fine.jumps
    ratio = max(10.0 ** (-power * step), law.far**law.credit)
    # steps that hardly shorten: the tolerance did not decide them
    if longer <= ALIKE if jumps else longer < 1.0 and not law.order:
        ratio = max(ratio, UNSEEN)
    # a method whose error follows its steps: their ratio to the power of its order
    if law.order:
        order = law.order if fine.steps >= LENGTHY else min(law.order, law.fronts)
        ratio = max(ratio, min(max(longer, 1.0) ** -order, UNSEEN))
    # |e_fine| = r |e_coarse|, hence e_fine / difference = r / (1 - r)
    return float(law.safety * ratio / (1.0 - ratio))


def _doubt(law: Law, shrink: float, step: float, coarse: RunSample, fine: RunSample) -> float:
    """Times the estimate: what must be within what was asked, where events happen, which may hold the steps."""
    if not fine.jumps:
        return 1.0
    # what the steps alone make believe
    ratio = min(max(fine.steps / max(coarse.steps, 1), 1.0) ** -HELD, UNSEEN)
    held = not law.order and step > APART and law.safety * ratio / (1.0 - ratio) > shrink
    return SURE if held else max(SURE / law.safety, 1.0)


def _unlike(law: Law, coarse: RunSample, fine: RunSample) -> bool:
    """Whether the finer run has met what the other has not seen."""
    # the finer run has other events
    if abs(fine.jumps - coarse.jumps) > OTHERS * max(fine.jumps, coarse.jumps):
        return True
    # of steps that say nothing: too few, or too many to be chance
    if not law.order or not SHORT <= fine.steps < LENGTHY:
        return False
    # steps grow with the tolerance to -1/order; far more have met something
    asked: float = (coarse.tolerance / fine.tolerance) ** (1.0 / law.order)
    return fine.steps > GROWN * asked * coarse.steps


def _affordable(coarse: RunSample, fine: RunSample) -> float:
    """Part of the tolerance at which a run takes MORE times the steps, as they grew between the two."""
    growth = np.log(max(fine.steps, 1) / max(coarse.steps, 1)) / np.log(coarse.tolerance / fine.tolerance)
    return float(np.clip(MORE ** (-1.0 / max(growth, 1e-2)), DEEPEST, FIRST_DROP))


class ErrorEstimate:
    """The estimate of the last of two runs, and the power with which the errors fall.

    over: beside what was asked, as it mostly is; apart: what is told, relative, hardly ever less than it is, but no
    more than what was asked where that is met; alone: no pair before says how errors fall; stalled: the pair before
    did not show that they do, or the finer run has met what the other has not seen; met: what
    was asked is, beyond doubt; root: a quantity ends as a root of the state: what tolerances do for it comes before
    shorter steps.
    """

    def __init__(self, law: Law, target: Floats) -> None:
        self.law, self.target = law, target
        self.over = self.apart = np.inf
        self.met = False
        self._deep, self.lost, self._unknown, self.alone = 1.0, False, False, True
        self.stalled = self._stalls = False
        self._before: tuple[float, float] | None = None
        self._power: float | None = None
        self.root = False

    def compare(self, coarse: RunSample, fine: RunSample, shorter: float | None = None) -> float:
        """Takes the pair in; returns the plain difference.  shorter: the longest step of the finer over that of the
        coarser run, where it holds both.
        """
        step = float(np.log10(coarse.tolerance / fine.tolerance))
        apart, over = difference(coarse, fine, self.target)
        # what comes to rest at zero has an error of its own
        left, left_over = left_at_rest(coarse, fine, self.target, known=self.root)
        self.root |= left > 0.0
        # at a root the tolerance decides, whatever the steps
        if self.root and step > 0.0:
            shorter = None
        # the last pair stalled and this one is worse by far
        self.stalled = self._stalls and self._before is not None and over > BY_FAR * self._before[0]
        self.alone = shorter is None and (self._before is None or self.stalled)
        # the pair has hardly a digit in common: unconverged
        lost = apart > DIFFER and over > FAR_OFF
        self._unknown = lost and (step >= DEEP or self.lost)
        self._deep = _affordable(coarse, fine) if lost and not self._unknown else 1.0
        self.lost = lost
        shrink, luck, slow, unseen, self._stalls = None, 1.0, False, False, False
        # a short run earns less credit
        credit = self.law.credit if fine.steps >= SHORT else min(self.law.credit, self.law.short)
        credit *= ROOT if self.root else 1.0
        # both held by the longest step: the error follows the steps
        if shorter is not None:
            part = shorter ** (BY_STEPS * (ROOT if self.root else 1.0))
            shrink = self.law.safety * part / (1.0 - part)
        # a pair before: the observed power counts
        elif self._before is not None:
            over_before, step_before = self._before
            self._stalls = fine.jumps > 0 and over > STALLS * over_before
            slow = fine.jumps > 0 and over > 0.0 and over > over_before * 10.0 ** (-SLOW * step_before)
            if over > over_before or slow:
                # no convergence seen: no credit for the smaller tolerance; either may be the better one
                shrink, slow, unseen = 1.0, True, True
            # the observed power, within bounds
            elif over > 0.0 and np.isfinite(over_before):
                power = np.log10(over_before / over) / step_before
                self._power = float(np.clip(power, 0.3, 1.0))
                if power > self._fastest(fine):  # by chance: the pair before speaks for the last run
                    luck = 10.0 ** ((power - credit) * step_before)
        # no pair before, but events or steps that the coarser run has not seen
        if shrink is None and _unlike(self.law, coarse, fine):
            shrink, slow, unseen = 1.0, True, True
            self.stalled |= self.law.damps
        # nothing observed: the law's own power
        if shrink is None:
            power = credit if self._power is None else min(self._power, credit)
            shrink = _shrink(self.law, power, step, coarse, fine)
        self._before = (over, step) if shorter is None and not lost else None  # what is lost has no power
        # no estimate below what the method leaves at this tolerance
        least = self.law.least * fine.tolerance
        shrink *= luck
        # the estimate shown is the safer of two; the decision takes the observed one
        told = self._error_ratio(step, coarse, fine) if shorter is None and not slow else SURE
        told = max(shrink, min(told, MET / over)) if over > 0.0 else shrink
        self.apart, self.over = max(apart * told, least), max(over * shrink, least / float(np.min(self.target)))
        self.apart, self.over = max(self.apart, left), max(self.over, left_over)
        # what a first step passed over
        off, off_over = passed_over(coarse, fine, self.target, self.law.safety * UNSEEN / (1.0 - UNSEEN))
        self.apart, self.over = max(self.apart, off), max(self.over, off_over)
        # what one step of the coarser run passed over
        off, off_over = before_fronts(coarse, fine, self.target)
        self.apart, self.over = max(self.apart, shrink * off), max(self.over, shrink * off_over)
        doubt = SURE if unseen else _doubt(self.law, shrink, step, coarse, fine)
        self.met = doubt * self.over <= 1.0
        # not met: the estimate shown has the doubt in it
        if not self.met:
            self.apart *= doubt
        return apart

    def _error_ratio(self, step: float, coarse: RunSample, fine: RunSample) -> float:
        """Error of the finer run over its difference from the coarser one, at most; step: decades of tolerance."""
        law = self.law
        # errors at events fall slower
        power = min(law.sure, AT_EVENTS) if fine.jumps else law.sure
        ratio = max(10.0 ** (-power * step), law.far**power, (fine.steps / max(coarse.steps, 1)) ** -STEPPED)
        ratio = min(ratio, UNSEEN)
        return float(max(law.safety, SURE) * ratio / (1.0 - ratio))

    def _fastest(self, fine: RunSample) -> float:
        """The power beyond which differences fall by chance; with events at the finest tolerances round-off is what is
        left, which events that follow from each other let grow.
        """
        last = fine.jumps > 0 and fine.tolerance <= LAST * self.law.finest
        return min(self.law.fastest, BY_CHANCE) if last else self.law.fastest

    def shorter(self) -> float:
        """How much shorter the longest step of the next run is where that is what holds the steps."""
        most = 1.0 / STRETCH
        return float(np.clip((AIM * self.over) ** (-1.0 / TOWARDS), SHORTEN, most)) if self.over else most

    def next_tolerance(self, tolerance: float) -> float:
        """The tolerance at which the next run should do, with the estimate's own safety.

        What a draft beyond all bounds says of the run behind it is not taken for more than FIRST_DROP.
        """
        if self._unknown:  # the coarser run says nothing of a much finer one: another beside that will
            return max(FIRST_DROP * tolerance, self.law.finest)
        # the observed power, or the law's before one is known
        power = self.law.power if self._power is None else max(self._power, SLOWEST)
        # error ~ tolerance^power: the drop that brings it to AIM of the target
        drop = max(AIM * self.over, TINY) ** (-1.0 / power)
        # a first drop is bounded on both sides, a later one may be small
        least, most = (FIRST_DROP, self.law.little) if self._power is None else (1e-3, LEFT)
        return max(min(float(np.clip(drop, least, most)), self._deep) * tolerance, self.law.finest)
