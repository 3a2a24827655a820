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


@dataclass(slots=True)
class _Mark:
    work: int
    part: float
    done: int
    t: float


class Creeping:
    """span: of the run; t: of its last accepted point [s]; tried: another method follows."""

    def __init__(self, span: float, t: float, work: Statistics, *, draft: bool, tried: bool = False) -> None:
        self._span = span
        limits = (*(DRAFT if draft else RUN), *([TRIAL] if tried else []))
        self._marks = [_Mark(most, part, _done(work), t) for most, part in limits]

    def goes_on(self, t: float, work: Statistics) -> bool:
        """Whether it may be asked for more."""
        done = _done(work)
        for mark in self._marks:
            if done - mark.done < mark.work:
                continue
            if t - mark.t < mark.part * self._span:
                return False
            mark.done, mark.t = done, t
        return True


def _done(work: Statistics) -> int:
    return max(work.steps, work.residual_evaluations // TRIED)
