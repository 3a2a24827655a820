"""Whether a run gets on: work done against the part of the span that it took it through."""

from __future__ import annotations

from sysdyn.runtime.integrate.request import Statistics
from sysdyn.values import dataclass

TRIED = 10
"""Residuals that cost as much as a step at which Newton's method converges at once."""
RUN, DRAFT = ((20_000, 1e-8), (200_000, 1e-5)), ((20_000, 1e-6),)
"""Steps, or residuals of so many, in which a run, a draft must get this part of the span further: else it would take
for ever (2e12 to the end, 2e10, of a draft 2e10)."""
TRIAL = (5_000, 1e-4)
"""The same of a run that another method follows (5e7)."""
ASKED = 1000
"""Steps from one look to the next; where none succeed, the work of ten times as many."""
STRAINED = 0.45
"""Of the steps of a window: where Newton fails in more, the tolerance says little of what a run finds (of bdf's on
steep laws, in windows of 200, runs that came to their end had up to 0.17, others 0.5).
"""


class Windows:
    """Stretches of steps in which Newton's failures are counted: of so many as the first one and a quarter of those
    before.
    """

    def __init__(self, first: int, work: Statistics) -> None:
        self._first = first
        self._begin(work)

    def _begin(self, work: Statistics) -> None:
        self._steps, self._failed = work.steps, work.newton_failures
        self._end = work.steps + self._first + work.steps // 4

    def steps_left(self, steps: int) -> int:
        """Steps to the end of the one at hand."""
        return max(self._end - steps, 1)

    def is_strained(self, work: Statistics) -> bool:
        """Whether one has ended in which Newton failed too often."""
        # the window is not over
        if work.steps < self._end:
            return False
        # more failures than a part of its steps
        often = work.newton_failures - self._failed > STRAINED * (work.steps - self._steps)
        self._begin(work)
        return often


@dataclass(slots=True)
class _Mark:
    work: int
    part: float
    done: int
    t: float


class Creeping:
    """span: of the run; t: of its last accepted point [s]; tried: another method follows."""

    def __init__(self, span: float, t: float, work: Statistics, *, draft: bool, tried: bool = False) -> None:
        self._span, self._asked = span, _done(work)
        limits = (*(DRAFT if draft else RUN), *([TRIAL] if tried else []))
        self._marks = [_Mark(most, part, _done(work), t) for most, part in limits]

    def steps_left(self, steps: int) -> int:
        """Steps to the next look, which no clock decides."""
        return ASKED - steps % ASKED

    def goes_on(self, t: float, work: Statistics) -> bool:
        """Whether it may be asked for more."""
        done = _done(work)
        # asked every so many steps only
        if work.steps % ASKED and done < self._asked + TRIED * ASKED:
            return True
        self._asked = done
        # work against progress, by several windows
        for mark in self._marks:
            if done - mark.done < mark.work:
                continue
            # too much work for too little of the span
            if t - mark.t < mark.part * self._span:
                return False
            mark.done, mark.t = done, t
        return True


def _done(work: Statistics) -> int:
    return max(work.steps, work.residual_evaluations // TRIED)
