"""`sysdyn trade`: the measured speed-accuracy trade of a scene, and the cheapest setting that meets its accuracy."""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
from sysdyn import __version__
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console
from sysdyn.cli.failures import SOLVER, UsageError
from sysdyn.cli.options import scene_command, side_by_side
from sysdyn.cli.page.columns import align, fit_columns, refusals, terminal
from sysdyn.cli.run.request import lock, targets
from sysdyn.cli.run.request.run_request import RunRequest, instants_of
from sysdyn.cli.trade.pages import HEADS, cells, page, picture, verdict
from sysdyn.cli.trade.reference import NoReference
from sysdyn.cli.trade.search import tolerance
from sysdyn.cli.trade.trade_results import Combination, Measured, RefusedCombination, Traded, meets
from sysdyn.cli.trade.trading import trade
from sysdyn.dsl import load
from sysdyn.dsl.text.diagnostics import Report, SourceText

KINDS = (".html", ".png", ".svg")
SPARE = ("constraints", "energy, J", "work, ns", "steps")
"""Columns that a narrow terminal has no room for."""


@scene_command("trade", "runs")
@click.option("-o", "output", metavar="FILE.html|.png|.svg", help="The work-precision plot; a page that zooms.")
@click.option("--full", is_flag=True, help="Every combination at every tolerance from 1e-1 to 1e-12.")
@side_by_side
@click.option("--lock", "locks", is_flag=True, help="Write the choice into FILE.lock, which simulate honours.")
@click.option("--no-timings", is_flag=True, help="Leave CPU times out.")
def command(
    console: Console,
    progress: str,
    no_timings: bool,
    full: bool,
    jobs: int | None,
    locks: bool,
    output: str | None,
    max_wall: str | None,
    **options: Any,
) -> int:
    """Measure what accuracy costs for a scene of FILE, over formulation x index x method x tolerance.

    Errors are those of the traced quantities against a reference that trade makes itself: the finest run, and one by
    another method, in another formulation where there is one. Cost is CPU time and counted work, which is what the
    choice goes by. --formulation, --index, --method fix a choice; --max-wall limits the whole search; --jobs N makes
    runs ahead side by side, with equal results but for CPU times (by itself only with --full, and the reference's two:
    the search leaves most others out). A trade that was stopped goes on where it was.
    """
    target = _target(output)
    # a lock stands beside its file
    if locks and options["file"] == "-":
        raise UsageError("--lock of a text from standard input: a lock stands beside a file")
    request = RunRequest(**options)
    try:
        with tempfile.TemporaryDirectory(prefix="sysdyn-") as folder, console.progress(progress) as line:
            budget = budget_of(max_wall)
            found = trade(request, console.report, Path(folder), full=full, budget=budget, progress=line, jobs=jobs)
    except NoReference as error:
        console.complain(f"there is no reference: {error}", SOLVER, error.finding)
        return console.finish(SOLVER)
    if found is None:
        return console.unable()
    # the cheapest setting that meets the accuracy
    best = found.chosen
    use = "" if best is None else command_of(request, best, found.name)
    console.result = _result(found, use, timings=not no_timings)
    console.results(_table(found, timings=not no_timings))
    # a page or a picture of all settings
    if target is not None:
        drawn = page(found, use).encode() if target.suffix == ".html" else picture(found, target.suffix[1:])
        whole_files.write(target, drawn)
        console.say(f"{target}: {len(found.measured)} runs")
    if locks and best is not None:
        console.say(f"{_lock(request, found, best)}: {best.combination.name} for {found.name}")
    return console.finish(_report_faults(found, console, use))


def _target(output: str | None) -> Path | None:
    if output is None:
        return None
    target = Path(output)
    if target.suffix not in KINDS:
        raise UsageError(f"'{output}': a picture of a trade is one of {', '.join(KINDS)}")
    return target


def budget_of(text: str | None) -> float | None:
    """Seconds of wall time for all of it."""
    if text is None:
        return None
    report = Report()
    nothing = load.document(SourceText("--max-wall", ""), report)
    seconds = instants_of(RunRequest("", max_wall=text), nothing, report)[2]
    if seconds is None:
        raise UsageError(f"--max-wall {text}: a number of seconds, or a time with its unit")
    return seconds


def _lock(request: RunRequest, found: Traded, best: Measured) -> Path:
    """Writes the choice for its scene."""
    scene = targets.target_of(request, Report())
    assert scene is not None
    c = best.combination
    held = lock.Lock(c.formulation, c.index, c.method, c.levels, best.tolerance, found.accuracy)
    return lock.write(request.file, scene, held, __version__)


def _report_faults(found: Traded, console: Console, use: str) -> int:
    """Says what is wrong; the exit code."""
    if not found.ended:
        console.say("the budget of wall time is spent: settings that were not tried may be cheaper; ask again to go on")
    # a chaotic model: beyond some instant no error can be told
    if found.reference.until < found.span[1]:
        text = f"errors count up to {found.reference.until:g} s of {found.span[1]:g} s: beyond, the finest runs differ"
        console.say(text)
    # a combination reaches the accuracy: how to use it
    if use:
        console.results(use, verbatim=True)
        return 0
    remedy = "a looser --accuracy, or --full" if found.ended else "the budget was spent first: a longer --max-wall"
    console.complain(f"{verdict(found)}; {remedy}", SOLVER)
    return SOLVER


def command_of(request: RunRequest, best: Measured, name: str) -> str:
    """The command line that runs a setting."""
    c = best.combination
    words = ["sysdyn", "simulate", request.file]
    scene = request.scene or (name.partition(" of ")[0] if " of " in name else None)
    for option, value in (("--scene", scene), ("--model", request.model), ("--until", request.until)):
        words += [option, value] if value is not None else []
    words += ["--formulation", c.formulation, "--index", c.index, "--method", c.method, "--rtol", f"{best.tolerance:g}"]
    for option, pairs in (("--set", request.settings), ("--level", c.levels)):
        for key, value in pairs:
            words += [option, f"{key}={value}"]
    words += ["--redundancy", request.redundancy] if request.redundancy else []
    words += ["--backend", request.backend] if request.backend != "c" else []
    words += ["--no-prune"] if request.no_prune else []
    return shlex.join(words)


# --- text and data ----------------------------------------------------------------------------------------------


def _table(found: Traded, *, timings: bool) -> str:
    """One row a combination (its cheapest run that meets the accuracy, else its most accurate), and the Pareto set."""
    shown = _best_of_each(found)
    rows = [list(HEADS), *(cells(found, m) for m in found.measured if m in shown)]
    if not timings:
        rows = [[cell for k, cell in enumerate(row) if HEADS[k] != "CPU, ms"] for row in rows]
    rows, said = fit_columns(rows, SPARE, terminal())
    known = found.reference
    lines = [align(rows, right=range(4, len(rows[0]) - 1)), *([said] if said else []), *_refusal_lines(found.refusals)]
    lines.append(f"reference: {known.first}, confirmed to {known.uncertainty:.1e} by {known.second}")
    return "\n".join([*lines, verdict(found)])


def _best_of_each(found: Traded) -> list[Measured]:
    """For each combination the cheapest setting that is accurate enough, else the most accurate; then the front."""
    best: dict[Combination, Measured] = {}

    def rank(m: Measured) -> tuple[bool, float]:
        enough = meets(m, found.accuracy, found.reference.uncertainty)
        return not enough, m.work if enough else float("inf") if m.error is None else m.error

    for m in found.measured:
        if m.combination not in best or rank(m) < rank(best[m.combination]):
            best[m.combination] = m
    return [*best.values(), *found.pareto]


def _refusal_lines(refusals_: Iterable[RefusedCombination]) -> list[str]:
    """What cannot be run, those with one reason together."""
    return refusals(
        (
            r.formulation if r.index is None else f"{r.formulation} index {r.index}",
            r.reason.removeprefix(f"not expressible in {r.formulation}: "),
        )
        for r in refusals_
    )


def _result(found: Traded, use: str, *, timings: bool) -> dict[str, Any]:
    """The object of --json: settings, those that cannot be run too, the choice and the reference."""
    known, pareto = found.reference, found.pareto
    nothing = dict.fromkeys(("tolerance", "error", "cpu_s", "steps", "work", "energy", "constraints"))
    settings = [setting(m, pareto=m in pareto, timings=timings) for m in found.measured]
    for r in found.refusals:
        names = {"formulation": r.formulation, "index": r.index, "method": r.method}
        said = {"level": r.level or None, "pareto": False, "met": False, "reason": r.reason, "diagnostic": r.finding}
        settings.append({**names, **nothing, **said})
    best = found.chosen
    return {
        "settings": settings,
        "chosen": None if best is None else {**setting(best, pareto=True, timings=timings), "command": use},
        "reference": {
            "error": known.uncertainty,
            "first": known.first,
            "second": known.second,
            "until": known.until,
        },
        "accuracy": found.accuracy,
        "span": list(found.span),
        "judged": list(found.judged),
        "dropped": [
            {"formulation": c.formulation, "index": c.index, "method": c.method, "reason": why}
            for c, why in found.dropped
        ],
        "tolerances": [tolerance(2), tolerance(24)],
        "ended": found.ended,
    }


def setting(m: Measured, *, pareto: bool, timings: bool) -> dict[str, Any]:
    """One setting as JSON."""
    c = m.combination
    return {
        "formulation": c.formulation,
        "index": c.index,
        "method": c.method,
        "tolerance": m.tolerance,
        "level": c.level or None,
        "error": m.error,
        "cpu_s": m.cpu_s if timings else None,
        "steps": m.steps,
        "work": m.work,
        "energy": m.energy,
        "constraints": m.constraints,
        "pareto": pareto,
        "met": not m.reason,
        "reason": m.reason or None,
        "diagnostic": m.finding,
    }
