"""Runs of a trade made ahead by processes side by side; the search then takes them in its own order.

Its decisions are those that it makes alone: a run is taken where it is the very run that would be made, limit of its
steps included, and made anew where it is not.  Ahead go all runs of every combination (--full), else the first of each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from sysdyn.cli.run.many.crew import Lost, as_ready
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.trade.measuring import Limits, bench_of
from sysdyn.cli.trade.search import FIRST, TradeSearch, tolerance
from sysdyn.cli.trade.trade_results import Combination, Measured, Runs
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

STEPS = 20_000
"""Of a first run made ahead at most: one that takes more may be one that the search never makes."""


@dataclass(frozen=True, slots=True)
class MeasurementRequest:
    """Runs of one combination.  reference, until [s]: what errors are taken from; wall [s]: of one run."""

    request: RunRequest
    folder: Path
    combination: Combination
    reference: Trace
    until: float
    full: bool
    wall: float


def _runs(asked: MeasurementRequest) -> Runs:
    """In a process of its own."""
    bench, found = bench_of(asked.request, asked.folder), Runs()

    def measure(combination: Combination, tolerance: float, most: float) -> Measured | str:
        limits = Limits(None if asked.full else STEPS, asked.wall)
        made = bench.measure(combination, tolerance, asked.reference, asked.until, limits)
        found[combination, tolerance] = made
        return made

    if asked.full:
        TradeSearch(bench.accuracy, 0.0, measure).full([asked.combination])
    else:
        made = measure(asked.combination, tolerance(FIRST), 0.0)
        if isinstance(made, Measured) and made.error is None:
            found.clear()  # stopped perhaps by the limit of its steps
    return found


def ahead(asked: Sequence[MeasurementRequest], jobs: int) -> Iterator[Runs]:
    """The runs of all combinations, as they are ready; what a process died of is left to the search."""
    for _, runs in as_ready(_runs, asked, jobs):
        if not isinstance(runs, Lost):
            yield runs
