"""Which settings are run: all of them, or tolerances from loose to tight where a combination may still win.

Tolerances stand on a grid of half decades, number k for 10^(-k/2).  The search runs each combination at a loose one,
then always goes on with the combination that is foreseen to reach the accuracy with the least work: its next tolerance
is where its errors so far, on a line in logarithms, meet the accuracy.  One that costs more than the best so far before
it has reached the accuracy, or is foreseen to, is dropped; of the best the loosest tolerance that meets it is sought.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from sysdyn.cli.trade.trade_results import Combination, Measured, cheapest, meets

LOOSEST, FIRST, TIGHTEST = 2, 4, 24
"""Numbers of the tolerances 1e-1, 1e-2, 1e-12."""
ORDER = {"bdf": 4.0, "radau": 5.0, "rosenbrock": 5.0, "dopri": 8.0}
"""Error ~ work^-order at best: what a combination of two runs may still hope for."""
EARLY = 1.6
"""Times that order for one with a single run: loose ones take steps for kinks and corners that tight ones need too."""
HOPE = 1.5
"""Times the best work that a forecast may be: forecasts are rough."""
JUMP = 8
"""Tolerances passed over at once, at most."""
TRIES = 3
"""Runs that fail in a row before a combination is left."""
UNLIKE = 0.2
"""Of the work foreseen of its like: what a combination may hope for that has not been run."""
FLAT = (4, 0.02)
"""Numbers of tolerances over which errors that change by less than a part of themselves are none of the solver's."""
PATIENCE = 3.0
"""Of the best work: a run that takes more is stopped."""

Measure = Callable[[Combination, float, float], Measured | str]
"""(combination, tolerance, most work) -> what was measured, or why there is no such setting."""
Advance = Callable[[float, float | None], None]


def tolerance(k: int) -> float:
    """Number k of the grid."""
    return float(f"{10.0 ** (-0.5 * k):.3g}")


@dataclass(slots=True)
class Climb:
    """One combination.  runs: by number of the tolerance; closed: why nothing more is run, "" while it is open;
    refused: why nothing can be.
    """

    combination: Combination
    runs: dict[int, Measured] = field(default_factory=dict)
    closed: str = ""
    refused: str = ""


@dataclass(slots=True)
class TradeSearch:
    """The measurements of one scene.  limit: monotonic instant at which it ends, None: none; flat: levels whose errors
    no tolerance changes any more.
    """

    accuracy: float
    uncertainty: float
    measure: Measure
    limit: float | None = None
    advance: Advance | None = None
    climbs: list[Climb] = field(default_factory=list)
    flat: dict[str, float] = field(default_factory=dict)
    ended: bool = True
    began: float = field(default_factory=time.monotonic)

    @property
    def measured(self) -> tuple[Measured, ...]:
        """In the order of combinations, loose tolerances first."""
        return tuple(climb.runs[k] for climb in self.climbs for k in sorted(climb.runs))

    @property
    def best(self) -> float:
        """The least work that meets the accuracy so far."""
        found = cheapest(self.measured, self.accuracy, self.uncertainty)
        return math.inf if found is None else found.work

    def full(self, combinations: Sequence[Combination]) -> None:
        """Every combination at every tolerance; one that fails TRIES times in a row is left."""
        self.climbs = [Climb(c) for c in combinations]
        for number, climb in enumerate(self.climbs):
            failed = 0
            # from loose to tight
            for k in range(LOOSEST, TIGHTEST + 1):
                if self._late():
                    return
                self._run(climb, k, math.inf)
                if climb.closed:
                    break
                # several failures in a row
                failed = failed + 1 if climb.runs[k].error is None else 0
                if failed == TRIES:
                    climb.closed = climb.runs[k].reason
                    break
                self._tell((number + (k - LOOSEST) / (TIGHTEST - LOOSEST)) / len(self.climbs))

    def thrifty(self, combinations: Sequence[Combination]) -> None:
        """The search of this module."""
        self.climbs = [Climb(c) for c in combinations]
        while True:
            open_ = [climb for climb in self.climbs if not climb.closed]
            planned = [(self._foreseen(climb), n, climb) for n, climb in enumerate(open_)]
            if not planned or self._late():
                return
            _, _, climb = min(planned, key=lambda p: p[:2])
            k = self._next(climb)
            if k is None:
                continue
            self._run(climb, k, PATIENCE * self.best)
            self._twin(climb)
            self._tell(sum(bool(c.closed) for c in self.climbs) / len(self.climbs))

    # --- one combination ----------------------------------------------------------------------------------------

    def _next(self, climb: Climb) -> int | None:
        """The number of the next tolerance; None where the combination is closed."""
        if not climb.runs:
            return FIRST if self._worth_a_run(climb) else None
        enough = [k for k, m in climb.runs.items() if meets(m, self.accuracy, self.uncertainty)]
        if enough:
            return self._looser(climb, min(enough))
        return self._tighter(climb)

    def _worth_a_run(self, climb: Climb) -> bool:
        """Whether a combination that has not been run may win; closes it where its level or its like say no."""
        level, best = climb.combination.level, self.best
        if level in self.flat:
            climb.closed = f"errors of its level stay at {self.flat[level]:.1e}"
        elif UNLIKE * self._like(climb) > HOPE * best:
            climb.closed = f"not run: its like take more than {HOPE / UNLIKE:.2g} times the best work"
        return not climb.closed

    def _like(self, climb: Climb) -> float:
        """The least work foreseen of its like: in its formulation at its level, else at its level; 0 before any."""
        a = climb.combination
        usable = [c for c in self.climbs if any(m.usable for m in c.runs.values()) and c.combination.level == a.level]
        same = [c for c in usable if c.combination.formulation == a.formulation]
        return min((self._foreseen(c) for c in same or usable), default=0.0)

    def _looser(self, climb: Climb, k: int) -> int | None:
        """Between a tolerance that meets the accuracy and a looser one that does not."""
        if climb.runs[k].work > HOPE * self.best:
            climb.closed = f"meets the accuracy with {climb.runs[k].work / self.best:.2g} times the work"
            return None
        below = max((j for j in climb.runs if j < k), default=None)
        if below is None and k > LOOSEST:
            return max(k - 2, LOOSEST)
        if below is None or k - below == 1 or climb.runs[below].work == climb.runs[k].work:
            climb.closed = "measured"
            return None
        return (k + below) // 2

    def _tighter(self, climb: Climb) -> int | None:
        """On to where the errors are foreseen to meet the accuracy."""
        last = max(climb.runs)
        # nothing tighter
        if last == TIGHTEST:
            climb.closed = climb.runs[last].reason or "does not reach the accuracy"
            return None
        usable = [k for k in sorted(climb.runs) if climb.runs[k].usable]
        # it failed there: twice tighter, or given up
        if not usable or usable[-1] != last:
            failed = [climb.runs[k].error is None or bool(climb.runs[k].reason) for k in sorted(climb.runs)[-TRIES:]]
            if all(failed) and len(failed) == TRIES:
                climb.closed = climb.runs[last].reason
                return None
            return min(last + 2, TIGHTEST)
        # dearer than the best already, or foreseeably so
        if climb.runs[last].work >= self.best or self._foreseen(climb) > HOPE * self.best:
            error = climb.runs[last].error
            climb.closed = f"dominated: {climb.runs[last].work / self.best:.2g} of the best work at error {error:.1e}"
            return None
        # errors that do not fall any more
        if len(usable) > 1 and last - usable[-2] >= FLAT[0]:
            one, two = (climb.runs[k].error or 0.0 for k in usable[-2:])
            if abs(one - two) <= FLAT[1] * two:
                climb.closed = f"its errors stay at {two:.1e}"
                if climb.combination.level:
                    self.flat[climb.combination.level] = two
                return None
        # by the observed power of the tolerance
        over = math.log10(max(self._over(climb.runs[last]), 1.0))
        step = math.ceil(2.0 * over / self._power(climb, usable)) if math.isfinite(over) else 2
        return min(last + min(max(step, 1), JUMP), TIGHTEST)

    def _over(self, m: Measured) -> float:
        """Error of a run over the accuracy."""
        least = max(self.accuracy - self.uncertainty, 1e-3 * self.accuracy)
        return math.inf if m.error is None else m.error / least

    def _power(self, climb: Climb, usable: Sequence[int]) -> float:
        """Error ~ tolerance^power, from the last two runs."""
        if len(usable) < 2:
            return 0.8
        one, two = climb.runs[usable[-2]], climb.runs[usable[-1]]
        if not one.error or not two.error or one.error <= two.error:
            return 0.5
        return min(max(math.log10(one.error / two.error) / math.log10(one.tolerance / two.tolerance), 0.4), 1.2)

    def _foreseen(self, climb: Climb) -> float:
        """The work with which a combination is hoped to reach the accuracy."""
        usable = [climb.runs[k] for k in sorted(climb.runs) if climb.runs[k].usable]
        if not climb.runs:
            return self._like(climb)
        if not usable:
            return min(m.work for m in climb.runs.values())
        last = usable[-1]
        order = ORDER[climb.combination.method] * (EARLY if len(usable) == 1 else 1.0)
        steps = last.work - last.fixed
        if len(usable) > 2 and usable[-2].error and last.error and steps > usable[-2].work - usable[-2].fixed > 0.0:
            grown = steps / (usable[-2].work - usable[-2].fixed)
            order = min(max(math.log(usable[-2].error / last.error) / math.log(grown), 1.0), order)
        over = self._over(last)
        return last.fixed + float(steps * max(over, 1.0) ** (1.0 / order)) if math.isfinite(over) else last.work

    def _twin(self, climb: Climb) -> None:
        """Two indices of one formulation and method whose first runs took the same work to the same error are one."""
        mine = climb.runs.get(FIRST)
        if len(climb.runs) > 1 or mine is None or mine.error is None:
            return
        for other in self.climbs:
            theirs = other.runs.get(FIRST)
            if other is climb or theirs is None or other.closed.startswith("the same"):
                continue
            a, b = other.combination, climb.combination
            if (a.formulation, a.method, a.level) == (b.formulation, b.method, b.level) and (
                (mine.error, mine.statistics) == (theirs.error, theirs.statistics)
            ):
                climb.closed = f"the same as index {other.combination.index}"
                return

    # --- runs ---------------------------------------------------------------------------------------------------

    def _run(self, climb: Climb, k: int, most: float) -> None:
        found = self.measure(climb.combination, tolerance(k), most)
        if isinstance(found, str):
            climb.refused = climb.closed = found
        else:
            climb.runs[k] = found

    def _late(self) -> bool:
        if self.limit is None or time.monotonic() < self.limit:
            return False
        self.ended = False
        return True

    def _tell(self, done: float) -> None:
        if self.advance is not None:
            spent = time.monotonic() - self.began
            self.advance(done, spent * (1.0 - done) / done if done > 0.05 else None)
