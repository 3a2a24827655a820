"""Two runs of one simulation beside each other: how far apart they are, at instants they share.

Receives what each run hands over (`RunSample`); returns the difference of every quantity, relative to the finer run's
sizes, and that beside the accuracy asked.  No difference counts: within the time tolerance, of round-off, and at once
beside a jump.  What both did unseen between the instants, or where they ran away alike, is said.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.values import dataclass

UNSEEN, ALIKE = 100.0, 0.3
"""A quantity that was so many times larger than at any instant of comparison did something between them: two runs must
agree on how large it was within this part."""
TIMING, SHARE = tuning.INSTANT, tuning.SMALL
"""Of the span: the time tolerance of comparisons, as that of `diff`; and of the accuracy asked at most."""
RUNAWAY = 1e3
"""Times the round-off of a run: that of the next one is not believed to be more (a step of 1e-17 s, thrown off by an
exponential, leaves magnitudes beside which everything is zero)."""
LOST = tuning.PERCENT
"""Of what it is: where two runs differ by more they hardly share a digit."""
FALLS, FAINT = 0.3, 100.0
"""Of a quantity that is zero: of its largest in the run before at most; times what is round-off beside its unit."""
PARTED, MUCH = 10.0, 0.3
"""Of all that a quantity was before, times; and of what it is: a difference by more is of runs that parted."""
STILL = 3.0
"""Times a difference: less than that is nothing beside it."""
LOOSE = 1e-5
"""Tolerances above, with which two runs may run away alike (Robertson's falls through zero)."""
ABOUT = 2
"""Instants before and behind one, whose values are those that a run takes about there."""
BEND = 4.0
"""Of the slopes between steps beside a row: rates beyond are of what relaxes at once."""
ROUND_OFF = 64.0 * float(np.finfo(np.float64).eps)
"""Relative errors below this are those of the numbers themselves."""
LARGEST = float(np.finfo(np.float64).max)


@dataclass(frozen=True, slots=True)
class RunSample:
    """What a run hands to the comparison.  values [instants, quantities] at the instants of the run before it; largest
    [quantities] against which errors are relative; steps: accepted; noise [quantities]: a quantity that stays below it
    is zero; left_open(): the same by the equations, for two runs that share no digit of one; between [instants,
    quantities]: what no difference counts more than, but for what it is beyond `jump` [quantities], the largest at an
    event, between an event of this run and the same one of the run before it (None: no instant is); late [instants,
    quantities]: what the dense output of each value moves by within the time tolerance (TIMING): on a steep front no
    more is asked; there: values and late at instants of its own, for the run behind it (None: those are the same);
    jumps: how many events happened; passed [instants, 2]: where a first step behind a restart passes over what relaxes
    at once, how many times as long it is, and the most that this may be, of its largest; zeros elsewhere; front
    [quantities]: how far off the run before is where it passes over in one step what this one takes many for (None:
    nowhere).
    """

    tolerance: float
    values: Floats
    largest: Floats
    steps: int
    noise: Floats | float = 0.0
    left_open: Callable[[], Floats] | None = None
    between: Floats | None = None
    late: Floats | float = 0.0
    there: tuple[Floats, Floats | float] | None = None
    jump: Floats | float = np.inf
    jumps: int = 0
    passed: Floats | None = None
    front: Floats | None = None

    @property
    def own(self) -> tuple[Floats, Floats | float]:
        """Values and late at its own instants."""
        return (self.values, self.late) if self.there is None else self.there


def distance_of_runs(coarse: RunSample, fine: RunSample) -> Floats:
    """How far two runs' values are from each other [instants, quantities], within the time tolerance, both ways: what
    one of them has must be between values that the other one takes about there.  At the end, where a quantity grows
    without bound (x' = x^2 at its pole), its rate allows any difference, but only one of them has been so far.  Between
    the instants of one event in both, a value on one side of a jump is no error of one on the other: what counts is how
    far it moves meanwhile, and all that is more than the jump.
    """
    values, late = coarse.own
    late = np.minimum(np.fmax(np.fmax(late, fine.late), 0.0), LARGEST)  # no number: no time tolerance
    over = np.fmax(_outside(values, fine.values, late), _outside(fine.values, values, late))
    over = np.fmax(over, 0.0 * fine.values * values)
    return over if fine.between is None else np.fmax(np.minimum(over, fine.between), over - fine.jump)


def _outside(values: Floats, others: Floats, late: Floats) -> Floats:
    """How far values are from those that the others [instants, quantities] take at most ABOUT instants away and no
    farther than `late` from what they are.
    """
    low, high = others.copy(), others.copy()
    # the band of the values at neighbouring instants
    for k in range(1, min(ABOUT, len(others) - 1) + 1):
        for found, least in ((low, np.fmin), (high, np.fmax)):
            found[k:] = least(found[k:], others[:-k])
            found[:-k] = least(found[:-k], others[k:])
    # outside that band, widened by the time tolerance
    return np.fmax(np.fmax(low, others - late) - values, values - np.fmin(high, others + late))


def lateness(time: Floats, values: Floats, rates: Floats, tolerance: float) -> Floats:
    """What values at steps [rows, quantities] move by within a time tolerance (s): as their rates say, but no faster
    than BEND times what the steps beside them show; a motion that relaxes at once makes of any error a rate without
    bound.
    """
    # one row: its rate alone
    if len(time) < 2:
        return tolerance * np.abs(rates)
    with np.errstate(all="ignore"):
        # secants on both sides of a row, of which the flatter counts
        slopes = np.abs(np.diff(values, axis=0) / np.diff(time)[:, None])
    slopes = np.vstack([slopes[:1], np.fmin(slopes[:-1], slopes[1:]), slopes[-1:]])
    return tolerance * np.fmin(np.abs(rates), BEND * slopes)


def zero(coarse: RunSample, fine: RunSample, target: Floats) -> NDArray[np.bool_]:
    """Quantities [quantities] of which both runs have round-off alone, by symmetry or a balance: it is nobody's error.

    Beside others of their unit they are seen at once, also where they fall with the tolerance: then they are errors of
    what cancels.  Where two runs miss the target the equations are asked.
    """
    # the largest value that either run has seen
    before, now = (np.abs(values).max(axis=0) for values in (coarse.own[0], fine.values))
    seen = np.maximum(before, now)
    found = np.isfinite(seen)  # an infinite value is no zero beside an infinite noise
    # noise of a run that ran away is not believed
    noise = np.minimum(fine.noise, RUNAWAY * np.asarray(coarse.noise))
    found &= (seen <= noise) | ((now <= FALLS * before) & (now <= FAINT * noise))
    # the equations are asked, once, where what is left would decide
    if fine.left_open is not None:
        with np.errstate(invalid="ignore"):  # values that are no numbers
            far = distance_of_runs(coarse, fine).max(axis=0)
        lost = ~found & (far > target * fine.largest) & (far > LOST * seen)
        if lost.any():
            found |= lost & (seen <= fine.left_open())
    return np.asarray(found)


def _has_size(coarse: RunSample, fine: RunSample, target: Floats) -> NDArray[np.bool_]:
    """Quantities [quantities] that are asked for, and more than round-off."""
    return np.asarray((fine.largest != 0.0) & np.isfinite(target) & ~zero(coarse, fine, target))


def difference(coarse: RunSample, fine: RunSample, target: Floats) -> tuple[float, float]:
    """(largest relative difference, the same over the accuracy wanted) of two runs, in the finer one's sizes."""
    # quantities of size zero, or of which nothing is asked, do not count
    size = fine.largest
    use = (size != 0.0) & np.isfinite(target)  # sizes that are no numbers are used: they are not met
    if not use.any() or not fine.values.size:
        return 0.0, 0.0
    before = coarse.own[0]
    # rows at other instants: the runs have nothing in common
    if before.shape != fine.values.shape:
        return np.inf, np.inf
    # zeros by symmetry are no errors
    use &= ~zero(coarse, fine, target)
    if not use.any():
        return 0.0, 0.0
    seen = np.maximum(np.abs(before), np.abs(fine.values)).max(axis=0)[use]
    with np.errstate(all="ignore"):
        # sizes that differ by far: the runs saw different motions
        unlike = (size[use] > UNSEEN * seen) & (np.abs(size - coarse.largest)[use] > ALIKE * size[use])
        relative = distance_of_runs(coarse, fine)[:, use].max(axis=0, initial=0.0) / size[use]
    relative = np.where(np.isfinite(relative) & ~unlike, relative, np.inf)
    return float(relative.max()), float((relative / target[use]).max())


def before_fronts(coarse: RunSample, fine: RunSample, target: Floats) -> tuple[float, float]:
    """How far two runs are apart, relative, and that over the accuracy wanted, where the coarser one passes over a
    front in one step.
    """
    if fine.front is None or not fine.front.any():
        return 0.0, 0.0
    use = _has_size(coarse, fine, target)
    relative = fine.front[use] / fine.largest[use]
    return float(relative.max(initial=0.0)), float((relative / target[use]).max(initial=0.0))


def passed_over(coarse: RunSample, fine: RunSample, target: Floats, credit: float) -> tuple[float, float]:
    """The error of the finer run, relative, and that over the accuracy wanted, where a first step passes over what
    relaxes at once; zeros elsewhere.  There two runs begin alike, however far both are off: what they differ by grows
    with the time since then, and with what their steps differ by.  The error is credit times what that makes of a whole
    step, but no more than the equations and the dense output are from each other since its begin.
    """
    # no step passes over anything, or rows that are elsewhere
    if fine.passed is None or not fine.passed.any() or coarse.own[0].shape != fine.values.shape:
        return 0.0, 0.0
    at = fine.passed[:, 0] > 0.0
    use = _has_size(coarse, fine, target)
    if not use.any():
        return 0.0, 0.0
    # length of the step over what relaxes, and the bound by the dense output
    longer, most = fine.passed[at].T
    before = coarse.passed
    # the length of the coarser run's step over it
    beside = before[at, 0] if before is not None and len(before) == len(at) else np.zeros(longer.size)
    with np.errstate(all="ignore"):  # steps of one length, of a run that does not pass over it: 0, infinite
        longer = longer / np.fmin(np.abs(1.0 - longer / beside), 1.0)
        relative = (np.abs(coarse.own[0] - fine.values) / fine.largest)[at][:, use]
        off = np.fmin(credit * longer[:, None] * relative, most[:, None])
        off[~np.isfinite(relative)] = 0.0  # where one is no number that is said
    return float(off.max()), float((off / target[use]).max())


def left_at_rest(coarse: RunSample, fine: RunSample, target: Floats, *, known: bool = False) -> tuple[float, float]:
    """Where two runs are farthest apart where a quantity comes to rest at zero, from there to the end: the most that is
    left of it in the finer one, relative to its size, and that over the accuracy wanted; zeros elsewhere.  What ends in
    finite time is a root of the state (the flow of a vessel that runs empty), whose error is the root of the state's,
    and all that is left.  known: a pair before showed that something does; then two runs may by chance be as far from
    zero, and what they hardly share a digit of is left.
    """
    before, size = coarse.own[0], fine.largest
    # other instants, or jumps
    if before.shape != fine.values.shape or len(before) < 2 or fine.jumps:
        return 0.0, 0.0  # what jumps may be nothing between its jumps
    use = _has_size(coarse, fine, target)  # round-off has not come to rest
    if not use.any():
        return 0.0, 0.0
    with np.errstate(all="ignore"):
        far = distance_of_runs(coarse, fine)[:, use]
        over = far / (size * target)[use]
    # runs that agree, or are no numbers
    if not np.isfinite(over).all() or not over.any():
        return 0.0, 0.0
    # where the two are farthest apart
    row, column = np.unravel_index(np.argmax(over), over.shape)
    # what is left of both from there to the end
    left, seen = (np.abs(values[row:, use][:, column]).max() for values in (fine.values, before))
    still = (1.0 / LOST if known else STILL) * far[row, column]
    # not at rest: more than a trace is left of it
    if not (max(left, seen) <= still and max(left, seen, STILL * far[row, column]) < MUCH * size[use][column]):
        return 0.0, 0.0
    return float(left / size[use][column]), float(left / (size * target)[use][column])


def have_diverged(coarse: RunSample, fine: RunSample, target: Floats) -> bool:
    """Whether two runs differ somewhere by PARTED times all that a quantity was since its start, and by much of what it
    is: then they ran away, and that both end alike, beside what has become of them, says little.  At fine tolerances a
    front that begins at next to nothing looks alike, and nothing runs away.
    """
    before, values = coarse.own[0], fine.values
    # at fine tolerances, or without common rows, nothing is said
    if fine.tolerance <= LOOSE or before.shape != values.shape or len(values) < 2:
        return False
    with np.errstate(all="ignore"):
        # all that it was so far, against how far the runs are apart
        most = np.maximum.accumulate(np.abs(values), axis=0)[:-1]
        now = np.maximum(np.abs(values), np.abs(before))[1:]
        away = distance_of_runs(coarse, fine)[1:] > np.maximum(PARTED * most, MUCH * now)
    # what begins at round-off is no motion that ran away
    away &= np.abs(values[0]) > fine.noise
    return bool(away.any()) and bool((away & ~zero(coarse, fine, target)).any())
