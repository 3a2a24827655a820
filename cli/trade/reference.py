"""What errors of a scene are taken from: a run at the finest tolerance, and another way's beside it.

The second is by another method, in another formulation where there is one.  How far they are apart is what is known of
either; where that is more than a tenth of the accuracy a third run decides between them, and where the best pair is
still apart, errors are taken up to the instant until which it is not (the horizon, as in `verify`).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from sysdyn.cli.run.many.crew import Beside
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.trade.errors import error_of
from sysdyn.cli.trade.measuring import Bench, Limits, Said, bench_of
from sysdyn.cli.trade.trade_results import Combination, TradeReference
from sysdyn.cli.verify.agreement import horizon
from sysdyn.runtime.accuracy.laws import LAWS
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

FINEST = {"bdf": 1e-13, "radau": 1e-14, "dopri": 3e-14}
"""Tolerances of the runs; finer ones meet round-off."""
SURE = 0.1
"""Of the accuracy: what two runs may be apart."""
ENOUGH = 0.03
"""Of the accuracy: the error of the coarsest reference that is tried, by the law of its method."""
STEPS = 200_000
"""Of a reference's run: more, and a coarser one will do."""
PART, SECONDS = 0.15, 120.0
"""Of the budget of wall time, for one run; without a budget, seconds."""


@dataclass(frozen=True, slots=True)
class _Run:
    name: str
    trace: Trace
    steps: tuple[int, int]


_Tried = tuple[_Run | None, list[tuple[str, Said | None]]]
"""A run; where there is none, why, and the finding of that."""


class NoReference(Exception):  # noqa: N818 (a name of the house)
    """No two runs agree anywhere; the message says how far they are apart, or why there are none.

    finding: of the first run that failed.
    """

    def __init__(self, message: str, finding: Said | None = None) -> None:
        self.finding = finding
        super().__init__(message)


def reference(bench: Bench, budget: float | None, jobs: int | None = 1) -> tuple[Trace, TradeReference]:
    """The reference's trace and what is known of it.  budget [s] of wall time.  Raises NoReference.

    jobs: 1: one run after the other; else the second way runs beside the first, once that has been long.
    """
    runs: list[_Run] = []
    reasons: list[tuple[str, Said | None]] = []
    best: tuple[float, _Run, _Run] | None = None
    sure = SURE * bench.accuracy
    ways = list(_ways(bench))
    with closing(Beside(_run_finest, (bench.request, bench.folder, ways[1], budget), jobs)) as beside:
        # ways to run the scene, as unlike as there are
        for number, combination in enumerate(ways):
            made = beside.answer() if number == 1 else None
            run, said = made or _finest(bench, combination, budget, len(runs))
            reasons += said
            if run is None:
                continue
            # the nearest pair of runs that stepped differently
            for other in runs:
                apart = error_of(
                    run.trace, other.trace, bench.judged_quantities(other.trace), bench.accuracy, bench.options.t_end
                )
                if run.steps != other.steps and (best is None or apart < best[0]):  # equal steps are no second opinion
                    best = apart, other, run
            runs.append(run)
            # near enough, or tried enough
            if best is not None and (best[0] <= sure or len(runs) == 3):
                break
    # no two runs to be compared
    if best is None:
        said = "; ".join(dict.fromkeys(text for text, _ in reasons))
        finding = next((found for _, found in reasons if found), None)
        raise NoReference(said or "there is but one way to run this scene", finding)
    uncertainty, first, second = best
    until = bench.options.t_end
    # apart somewhere: up to there they agree
    if uncertainty > sure:
        until, _ = horizon(first.trace, second.trace, dict.fromkeys(bench.judged_quantities(first.trace), sure))
        if not until > bench.options.t_start:
            text = f"{first.name} and {second.name} at their finest are {uncertainty:.1e} apart"
            raise NoReference(f"{text}: too much for an accuracy of {bench.accuracy:.0e}")
        judged = bench.judged_quantities(first.trace)
        uncertainty = error_of(second.trace, first.trace, judged, bench.accuracy, until)
    return first.trace, TradeReference(first.name, second.name, uncertainty, until)


def _ways(bench: Bench) -> Iterator[Combination]:
    """Ways to the reference: cheap and different ones first."""
    names, level = bench.names, bench.full
    other = names[1] if len(names) > 1 else names[0]
    yield Combination(names[0], "0", "dopri", level)
    yield Combination(other, "2", "radau", level)
    yield Combination(names[0], "2", "bdf", level)
    if other != names[0]:
        yield Combination(names[0], "2", "radau", level)


def _run_finest(asked: tuple[RunRequest, Path, Combination, float | None]) -> _Tried:
    """A run at the finest tolerance in a process of its own."""
    request, folder, combination, budget = asked
    return _finest(bench_of(request, folder), combination, budget, 1)


def _finest(bench: Bench, combination: Combination, budget: float | None, number: int) -> _Tried:
    """A run at the finest tolerance that ends in time; None where none does, and why."""
    law, tolerance = LAWS[combination.method], FINEST[combination.method]
    coarsest = max(law.tolerance(ENOUGH * bench.accuracy), tolerance)
    wall = SECONDS if budget is None else max(PART * budget, 1e-3)
    while True:
        began = time.monotonic()
        ran, reason, said = bench.trace(combination, tolerance, Limits(STEPS, wall), name=f"reference{number}")
        if ran is not None and ran.outcome.final:
            counts = ran.outcome.statistics
            steps = counts["steps"], counts["residual_evaluations"]
            return _Run(f"{combination.name} at {tolerance:.0e}", ran.outcome.traced, steps), []
        if ran is None or tolerance >= coarsest:
            return None, [(f"{combination.name}: {reason}", said)]
        late = time.monotonic() - began >= 0.5 * wall
        tolerance = coarsest if late else min(100.0 * tolerance, coarsest)
