"""Laws whose branch follows the sign of a switching function: which branch holds from an instant on.

The branch stands in p (forms/corners/frozen.py): LIVE as the text says, ABOVE and BELOW zero, SLIDES on zero, RESTS
on zero with the value of the law there.  A branch fits where its function has that sign, or is zero and does not move
to the other side; where both branches drive it back, the law slides between them (Filippov 1988), and leaves by the
side whose sense reaches 1.  Where a law that jumps is on zero, no branch drives it back, and its own value there (0 of
sign) leaves the function without a rate, it rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from sysdyn.runtime import _core, tuning
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.plan import Happened, Kink

if TYPE_CHECKING:
    from sysdyn.runtime.events.watches import Watched
from sysdyn.runtime.model.description import Floats

BELOW, LIVE, ABOVE = map(float, range(-1, 2))
SLIDES, RESTS = float(_core.SD_BRANCH_SLIDES), float(_core.SD_BRANCH_RESTS)
WORDS = {LIVE: "= 0", ABOVE: "> 0", BELOW: "< 0", SLIDES: "slides", RESTS: "= 0"}
TURNS = 4
"""Of one kink at one instant: more, and its branches contradict each other."""
FULL = tuning.SAME
"""Of a sense: what it may pass its end by."""


class NoBranchError(Exception):
    """No branch of these laws fits: kinks; pushed: both branches drive it back, yet it cannot slide."""

    def __init__(self, names: tuple[str, ...], *, pushed: bool) -> None:
        super().__init__(", ".join(names))
        self.names, self.pushed = names, pushed


class Kinks:
    """The branches of a model; p: its parameters, where they stand."""

    def __init__(self, kinks: tuple[Kink, ...], observer: Observer, p: Floats) -> None:
        self.kinks, self.observer, self.p = kinks, observer, p
        self.peaks = any(kink.passage for kink in kinks)
        self._turned: dict[int, list[float]] = {}
        self._tried: set[int] = set()  # whether they rest, at this instant

    def state(self) -> list[float]:
        """The branches."""
        return [float(self.p[k.branch]) for k in self.kinks]

    def rows(self, k: int) -> Sequence[tuple[int, int]]:
        """Rows of kink k, and the sides of zero whose other one ends a piece."""
        kink, branch = self.kinks[k], self.p[self.kinks[k].branch]
        # sliding: until either side pulls away
        if branch == SLIDES:
            return ((kink.above, 1), (kink.below, 1))
        # on a branch: its own side; live: both
        return ((kink.value, int(branch)),) if branch in (ABOVE, BELOW) else ((kink.value, 1), (kink.value, -1))

    def cross(self, k: int, row: int, side: int) -> None:
        """What kink k becomes where the row has changed its side."""
        kink = self.kinks[k]
        # off its sliding surface, or across zero
        sliding = self.p[kink.branch] == SLIDES
        branch = (ABOVE if row == kink.above else BELOW) if sliding else float(-side)
        self.p[kink.branch] = branch
        self._turned[k] = [branch]
        self._tried.add(k)

    def begin_instant(self) -> None:
        """A new instant: nothing has turned yet."""
        self._turned, self._tried = {}, set()

    def begin(self, values: Floats) -> bool:
        """Branches by the values of a start at which all are live; whether a law jumps, so that all is found anew."""
        for kink in self.kinks:
            # at its surface: a law that jumps begins above, others are live
            on = abs(values[kink.value]) <= self.observer.zero(kink.value)
            self.p[kink.branch] = (ABOVE if kink.jumps else LIVE) if on else np.sign(values[kink.value])
        self.begin_instant()
        return any(kink.jumps for kink in self.kinks)

    def leave(self, values: Floats) -> None:
        """What slides is let go where a jump (of the text, of what an event assigned) has left its surface."""
        # pushed off its surface
        for kink in self.kinks:
            if self.p[kink.branch] == SLIDES and abs(values[kink.value]) > self.observer.zero(kink.value):
                self.p[kink.branch] = float(np.sign(values[kink.value]))

    def turn(self, values: Floats) -> bool:
        """Turns the first kink whose branch does not fit; whether there was one."""
        for k, kink in enumerate(self.kinks):
            better = self._better(k, kink, values)
            if better is None:
                continue
            # rests: not tried again at this instant
            if better == RESTS:
                self._tried.add(k)
            # from one side to the other: counted
            elif self.p[kink.branch] != RESTS:
                seen = self._turned.setdefault(k, [])
                seen.append(better)
                # too often: no branch fits
                if len(seen) > TURNS:
                    raise NoBranchError(self._name_of(), pushed=kink.jumps)
            self.p[kink.branch] = better
            return True
        return False

    def _name_of(self) -> tuple[str, ...]:
        return tuple(f"{self.kinks[k].name} ({self.kinks[k].element})" for k in self._turned)

    def _better(self, k: int, kink: Kink, values: Floats) -> float | None:
        """The branch that kink k should have; None where it fits."""
        branch, zero = float(self.p[kink.branch]), self.observer.zero
        value = float(values[kink.value])
        # live: as long as it is at zero
        if branch == LIVE:
            return None if abs(value) <= zero(kink.value) else float(np.sign(value))
        # slides: as long as both sides push back
        if branch == SLIDES:
            if values[kink.above] < -FULL:
                return ABOVE
            return BELOW if values[kink.below] < -FULL else None
        # rests: until something moves
        if branch == RESTS:
            moves = value if abs(value) > zero(kink.value) else self._moves(kink, values)
            return float(np.sign(moves)) if moves else None
        # well on its side
        if branch * value > zero(kink.value):
            return None
        # at its surface: it stays there unless its rate leads away
        if branch * value >= -zero(kink.value):
            if kink.rate < 0 or branch * values[kink.rate] >= -zero(kink.rate):
                return RESTS if kink.jumps and k not in self._tried else None
            if kink.above >= 0 and branch in self._turned.get(k, ()):
                return SLIDES  # it came from the other side, and is driven back to it
        return -branch

    def only_peaks(self, which: Sequence[Watched]) -> bool:
        """Whether begins and ends of peaks alone are what crosses."""
        return all(w.kink >= 0 and self.kinks[w.kink].passage > 0.0 for w in which)

    def passing(self, before: Sequence[float], values: Floats) -> float:
        """How long (s) the shortest of the peaks takes that have begun since branches were `before`; inf: none has."""
        # peaks that have just begun
        begun = [
            kink
            for kink, was in zip(self.kinks, before, strict=True)
            if kink.passage and kink.rate >= 0 and was == BELOW and self.p[kink.branch] == ABOVE
        ]
        # how long each takes at its rate
        rates = [abs(float(values[kink.rate])) for kink in begun]
        return min((k.passage / rate for k, rate in zip(begun, rates, strict=True) if rate > 0.0), default=np.inf)

    def _moves(self, kink: Kink, values: Floats) -> float:
        """The rate of a function that has one, 0 where it is nothing."""
        rate = float(values[kink.rate]) if kink.rate >= 0 else 0.0
        return 0.0 if abs(rate) <= self.observer.zero(kink.rate) else rate

    def changes(self, t: float, before: Sequence[float]) -> list[Happened]:
        """What has changed."""
        found = []
        for kink, was in zip(self.kinks, before, strict=True):
            now = float(self.p[kink.branch])
            # peaks make no entries
            if now != was and not kink.passage:
                found.append(Happened(t, kink.name, kink.element, WORDS[was], WORDS[now]))
        return found
