"""Runs of a trade made ahead by processes side by side; the search then takes them in its own order.

Its decisions are those that it makes alone: a run is taken where it is the very run that would be made, limit of its
steps included, and made anew where it is not.  Ahead go all runs of every combination (--full), else the first of each.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

from sysdyn.cli.run import targets
from sysdyn.cli.run.crew import Lost, each
from sysdyn.cli.run.running import Request
from sysdyn.cli.trade.measuring import Bench, Limits
from sysdyn.cli.trade.search import FIRST, Search, tolerance
from sysdyn.cli.trade.traded import Combination, Measured, Runs
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

STEPS = 20_000
"""Of a first run made ahead at most: one that takes more may be one that the search never makes."""
_benches: dict[tuple[Request, Path], Bench] = {}


@dataclass(frozen=True, slots=True)
class Asked:
    """Runs of one combination.  reference, until [s]: what errors are taken from; wall [s]: of one run."""

    request: Request
    folder: Path
    combination: Combination
    reference: Trace
    until: float
    full: bool
    wall: float


def _bench(request: Request, folder: Path) -> Bench:
    """The settings of the scene, once a process."""
    key = request, folder
    if key not in _benches:
        report, own = Report(), folder / f"ahead-{os.getpid()}"
        own.mkdir(exist_ok=True)
        target = targets.one(targets.read(request.file, report), request.file, request.model, request.scene, report)
        assert target is not None
        _benches[key] = Bench(request, target, report, own, time.monotonic())
        _benches[key].prepare()
    return _benches[key]


def _runs(asked: Asked) -> Runs:
    """In a process of its own."""
    bench, found = _bench(asked.request, asked.folder), Runs()

    def measure(combination: Combination, tolerance: float, most: float) -> Measured | str:
        limits = Limits(None if asked.full else STEPS, asked.wall)
        made = bench.measure(combination, tolerance, asked.reference, asked.until, limits)
        found[combination, tolerance] = made
        return made

    if asked.full:
        Search(bench.accuracy, 0.0, measure).full([asked.combination])
    else:
        made = measure(asked.combination, tolerance(FIRST), 0.0)
        if isinstance(made, Measured) and made.error is None:
            found.clear()  # stopped perhaps by the limit of its steps
    return found


def ahead(asked: Sequence[Asked], jobs: int) -> Runs:
    """The runs of all combinations; what a process died of is left to the search."""
    found = Runs()
    for _, runs in each(_runs, asked, jobs):
        if not isinstance(runs, Lost):
            found |= runs
    return found
