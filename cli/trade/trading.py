"""The speed-accuracy trade of one scene, measured: formulation x index x method x tolerance.

Received: a request, a folder for traces; handed back: `Traded`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.many.crew import company
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest, check_tolerances
from sysdyn.cli.trade import work
from sysdyn.cli.trade.ahead import MeasurementRequest, ahead
from sysdyn.cli.trade.measuring import Bench, Limits
from sysdyn.cli.trade.reference import reference
from sysdyn.cli.trade.search import FIRST, TradeSearch, tolerance
from sysdyn.cli.trade.trade_journal import journal as journal_of
from sysdyn.cli.trade.trade_results import Combination, Measured, RefusedCombination, Runs, Traded
from sysdyn.dsl.text.diagnostics import Report

SECONDS = 300.0
"""Of wall time for one run where no budget is given."""

LEAST = 40
"""Steps that every run may take: the longest is a twentieth of the span."""


def _check_request(request: RunRequest) -> None:
    """UsageError where what a trade chooses is said already."""
    check_tolerances(request)
    if request.rtol is not None or request.atol is not None:
        raise UsageError("trade chooses the tolerances: --accuracy says what is wanted")
    if request.method == "euler":
        raise UsageError("--method euler: trade compares methods that control their error")


def trade(
    request: RunRequest,
    report: Report,
    folder: Path,
    *,
    full: bool = False,
    budget: float | None = None,
    progress: Callable[[float, float | None], None] | None = None,
    jobs: int | None = 1,
) -> Traded | None:
    """Measure; None where the report says why the scene cannot run.  Raises NoReference.

    A trade that was stopped goes on where it was (trade_journal.py).
    full: every combination at every tolerance; budget [s] of wall time for all; jobs: processes that make runs ahead;
    None: where it pays, which it does not where the search leaves most combinations out.
    """
    _check_request(request)
    began = time.monotonic()
    target = targets.target_of(request, report)
    if target is None:
        return None
    request = targets.with_text(request, target)
    bench = Bench(request, target, report, folder, began)
    if not bench.prepare():
        return None
    # what a trade that was stopped has measured
    journal = journal_of(request, target)
    kept, known = (journal.reference if journal else None) or reference(bench, budget, jobs)
    first = time.monotonic() - began
    if journal is not None and journal.reference is None:
        journal.refer(kept, known)
    limit = None if budget is None else began + budget

    def wall() -> float:
        return SECONDS if limit is None else max(limit - time.monotonic(), 1e-3)

    combinations = list(bench.combinations())
    # runs that are made already: by a trade that was stopped, or side by side before the search asks for them
    made_before: Runs = dict(journal.runs) if journal else {}
    left = [c for c in combinations if full or (c, tolerance(FIRST)) not in made_before]
    # runs ahead pay where all combinations are measured
    number = jobs or (company(first) if full else 1)
    if number > 1:
        asked = [MeasurementRequest(request, folder, c, kept, known.until, full, wall()) for c in left]
        for runs in ahead(asked, number):
            for (combination, at), found in runs.items():
                if made_before.setdefault((combination, at), found) is found and journal is not None:
                    journal.take(combination, at, found)

    # from the journal, unless it was cut off by a limit that is wider here
    def measure(combination: Combination, tolerance: float, most: float) -> Measured | str:
        left = wall()
        step = work.step(bench.size(combination), combination.method)
        steps = max(math.ceil(most / step), LEAST) if math.isfinite(most) and step > 0.0 else None
        made = made_before.get((combination, tolerance))
        if made is None or (isinstance(made, Measured) and steps is not None and made.steps >= steps):
            made = bench.measure(combination, tolerance, kept, known.until, Limits(steps, left))
        if journal is not None and (combination, tolerance) not in journal.runs:
            journal.take(combination, tolerance, made)
        return made

    # one of two orders: everything, or the cheapest first
    search = TradeSearch(bench.accuracy, known.uncertainty, measure, limit, progress)
    (search.full if full else search.thrifty)(combinations)
    if journal is not None and search.ended:
        journal.remove()
    return Traded(
        target.name,
        bench.accuracy,
        (bench.options.t_start, bench.options.t_end),
        search.measured,
        (*bench.refusals, *_never(search)),
        tuple((c.combination, c.closed) for c in search.climbs if c.closed not in ("", "measured", c.refused)),
        known,
        bench.judged_quantities(kept),
        search.ended,
    )


def _never(search: TradeSearch) -> list[RefusedCombination]:
    """Combinations that do not exist."""
    refused = [(climb.combination, climb.refused) for climb in search.climbs if climb.refused]
    return [RefusedCombination(c.formulation, reason, None, c.index, c.method, c.level) for c, reason in refused]
