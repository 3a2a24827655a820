"""The speed-accuracy trade of one scene, measured: formulation x index x method x tolerance.

Received: a request, a folder for traces; handed back: `Traded`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

from sysdyn.cli.failures import UsageError
from sysdyn.cli.run import targets
from sysdyn.cli.run.running import Request, check_tolerances
from sysdyn.cli.trade.ahead import Asked, Runs, ahead
from sysdyn.cli.trade.measuring import Bench, Limits
from sysdyn.cli.trade.reference import reference
from sysdyn.cli.trade.search import Search
from sysdyn.cli.trade.traded import Combination, Measured, Refusal, Traded
from sysdyn.cli.trade.work import HISTORY
from sysdyn.dsl.text.diagnostics import Report

SECONDS = 300.0
"""Of wall time for one run where no budget is given."""

LEAST = 40
"""Steps that every run may take: the longest is a twentieth of the span."""


def trade(
    request: Request,
    report: Report,
    folder: Path,
    *,
    full: bool = False,
    budget: float | None = None,
    progress: Callable[[float, float | None], None] | None = None,
    jobs: int = 1,
) -> Traded | None:
    """Measure; None where the report says why the scene cannot run.  Raises NoReference.

    full: every combination at every tolerance; budget [s] of wall time for all; jobs: processes that make runs ahead.
    """
    check_tolerances(request)
    if request.rtol is not None or request.atol is not None:
        raise UsageError("trade chooses the tolerances: --accuracy says what is wanted")
    if request.method == "euler":
        raise UsageError("--method euler: trade compares methods that control their error")
    began = time.monotonic()
    document = targets.read(request.file, report)
    target = targets.one(document, request.file, request.model, request.scene, report)
    if target is None:
        return None
    bench = Bench(request, target, report, folder, began)
    if not bench.prepare():
        return None
    kept, known = reference(bench, budget)
    limit = None if budget is None else began + budget

    def wall() -> float:
        return SECONDS if limit is None else max(limit - time.monotonic(), 1e-3)

    combinations = list(bench.combinations())
    made_ahead: Runs = {}
    if jobs > 1:
        made_ahead = ahead([Asked(request, folder, c, kept, known.until, full, wall()) for c in combinations], jobs)

    def measure(combination: Combination, tolerance: float, most: float) -> Measured | str:
        left = wall()
        steps = max(math.ceil(most / (HISTORY * bench.size(combination)[0])), LEAST) if math.isfinite(most) else None
        made = made_ahead.get((combination, tolerance))
        if isinstance(made, str) or (made is not None and (steps is None or made.steps < steps)):
            return made
        return bench.measure(combination, tolerance, kept, known.until, Limits(steps, left))

    search = Search(bench.accuracy, known.uncertainty, measure, limit, progress)
    (search.full if full else search.thrifty)(combinations)
    return Traded(
        target.name,
        bench.accuracy,
        (bench.options.t_start, bench.options.t_end),
        search.measured,
        (*bench.refusals, *_never(search)),
        tuple((c.combination, c.closed) for c in search.climbs if c.closed not in ("", "measured", c.refused)),
        known,
        bench.judged(kept),
        search.ended,
    )


def _never(search: Search) -> list[Refusal]:
    """Combinations that do not exist."""
    refused = [(climb.combination, climb.refused) for climb in search.climbs if climb.refused]
    return [Refusal(c.formulation, reason, "", c.index, c.method, c.level) for c, reason in refused]
