"""What changes within the first step behind an event, and is of its dense output alone: which needs a shorter step.

Received: what falls through zero within the step, where, and where the step begins and ends.  Returned: the step that
would do.  What relaxes at once, behind a long first step, is no part of what the polynomial of its stages knows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from sysdyn.runtime.integrate.jumps.modes import AT_ONCE, EARLY
from sysdyn.runtime.model.description import Floats

if TYPE_CHECKING:
    from sysdyn.runtime.events.handler import Handler
    from sysdyn.runtime.events.watches import Watched
    from sysdyn.runtime.integrate.integrate import Integration

PARTS = 8
"""Steps in the place of one that misled; that a bounce takes at least (radau and dopri follow a parabola in one)."""
SOON = 0.1
"""Of what the dense output does not know: where another event is at once the next steps are shorter."""
WIDER = 2.0
"""Times the time of a change from the begin: a step within which it is seen again, where it is of the motion."""
FEW = 60
"""First steps behind others within one that was too long, which are taken again: what is less than a run resolves turns
to and fro for ever.
"""
NARROW = 1e3
"""Spacings of t: a step that is no longer is not parted again."""
LOOKS = 4
"""Parts of a step at whose ends what falls within it is looked at."""

Step = tuple[float, float, float]
"""Begin, an instant at which something changes, end (s)."""


class FirstStep:
    """Of one run.  values: of block observe, settled, at an instant (s) of the last step."""

    def __init__(self, run: Integration, handler: Handler, values: Callable[[float], Floats]) -> None:
        self.run, self.handler, self._values = run, handler, values
        self._part = EARLY.get(run.request.method, 0.0)
        self._begin, self._until, self._others = -np.inf, -np.inf, 0
        """The begin (s) of the last first step that was too long, where the one about it ends, how many there are."""

    def shorter(self, which: Sequence[Watched], step: Step) -> float:
        """The length (s) of a step that would do where what changes is of the dense output; 0 where it is of the
        motion.
        """
        begin, t, end = step
        # too short to be divided
        if end - begin <= NARROW * float(np.spacing(end)):
            return 0.0
        # another piece has begun
        if begin >= self._until:
            self._begin, self._until, self._others = begin, -np.inf, 0
        # early in the step, where dense output says little: step only there
        if self._others <= FEW and AT_ONCE * self.handler.nothing < t - begin < self._unknown_time(which, step):
            self._others += int(begin != self._begin)
            self._begin, self._until = begin, self._until if self._until > begin else end
            return WIDER * (t - begin)
        # further below zero than it was ever large: the polynomial bends, not the motion
        return (end - begin) / PARTS if self._overshoots(which, begin, end) else 0.0

    def at_once(self, which: Sequence[Watched], step: Step) -> bool:
        """Whether it is so near to the begin that steps behind it are to be shorter."""
        return step[1] - step[0] < SOON * self._unknown_time(which, step)

    def _unknown_time(self, which: Sequence[Watched], step: Step) -> float:
        """How much (s) of the step the dense output says nothing of, but for gaps, which inertia leads."""
        contacts = self.handler.contacts
        gaps = (w.contact >= 0 and contacts.contacts[w.contact].kind == "phi" for w in which)
        # gaps in flight have inertia: their dense output is right
        flies = all(gap and not contacts.active[w.contact] for gap, w in zip(gaps, which, strict=True))
        return 0.0 if flies else self._part * (step[2] - step[0])

    def _overshoots(self, which: Sequence[Watched], begin: float, end: float) -> bool:
        """Whether what falls within the step lies further below zero there than it has ever been large, at either end
        of the step too: a transient too short for such a step, which a stiff law settles, bends the polynomial of its
        stages.
        """
        largest = [self.handler.observer.largest[w.row] for w in which]
        looks = [self._values(begin + (end - begin) * k / LOOKS) for k in range(LOOKS + 1)]
        ends = [max(most, *(abs(looks[k][w.row]) for k in (0, -1))) for w, most in zip(which, largest, strict=True)]
        return any(-w.side * v[w.row] > most for v in looks[1:-1] for w, most in zip(which, ends, strict=True))
