"""`sysdyn verify`: one scene in every formulation that can express it and by two methods, in one table."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from sysdyn.cli.console import Console
from sysdyn.cli.failures import INTERRUPTED, SOLVER, worst
from sysdyn.cli.options import scene_command, side_by_side
from sysdyn.cli.page.columns import align, fit_columns, refusals, terminal

if TYPE_CHECKING:
    from sysdyn.cli.verify.agreement import Gap
    from sysdyn.cli.verify.verify_results import Disagreement, RefusedFormulation, Verified, VerifiedRun

SPARE = ("constraints", "energy J", "estimate", "index")
"""Columns that a narrow terminal has no room for."""


@scene_command("verify", "runs", "are compared")
@click.option("-o", "output", metavar="DIR", help="Keep the traces there, as FORMULATION-METHOD.h5.")
@side_by_side
@click.option("--full", is_flag=True, help="Do not take reduced sizes from the ci.toml above FILE's folder.")
@click.option("--no-timings", is_flag=True, help="Leave CPU times out.")
def command(
    console: Console, progress: str, no_timings: bool, full: bool, jobs: int | None, output: str | None, **options: Any
) -> int:
    """Run a scene of FILE in every formulation that can express it, by two methods, and compare the traces.

    The methods are bdf and radau; where the scene or --method names another, that one and bdf.

    Two runs agree where every traced quantity differs by less than 10 x accuracy x its nominal magnitude, up to the
    horizon: the instant at which the reference differs by that much from its own run at a tenth of the accuracy.
    --formulation and --method choose the reference; limits hold for each run.  Exit 1 where runs disagree, 3 where a
    ledger of a run is off or the solver stops; what the scene expects is listed, and never decides.  Formulations run
    side by side where that pays, with equal results.
    """
    from sysdyn.cli.run.request.run_request import RunRequest
    from sysdyn.cli.run.request.sizes import sizes
    from sysdyn.cli.verify.verification import verify

    request = RunRequest(timings=not no_timings, **options)
    # large models run at the sizes that their folder names for this
    path, reduced = (Path(), ()) if full else sizes(request.file)
    given = {name for name, _ in request.settings}
    reduced = tuple((name, value) for name, value in reduced if name not in given)
    if reduced:
        console.say(f"sizes of {path.parent.name}/{path.name}: {', '.join(f'{n} = {v}' for n, v in reduced)}")
    request = replace(request, settings=(*reduced, *request.settings))
    # traces are kept where a folder is named
    folder = None if output is None else Path(output)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    with console.progress(progress) as line:
        found = verify(request, console.report, folder, line, jobs)
    if found is None:
        return console.unable()
    console.result = _result(found, keep=output is not None, timings=not no_timings)
    console.results(_table(found, timings=not no_timings))
    code = _report_faults(found, console)
    if found.interrupted:
        console.complain("interrupted: these are the runs so far", INTERRUPTED)
        code = worst((code, INTERRUPTED))
    return console.finish(code)


def _report_faults(found: Verified, console: Console) -> int:
    """Says what is wrong; the exit code."""
    from sysdyn.cli.run.start.starting import first_lines

    code = 0
    # disagreements
    for text in _complaints(found):
        console.complain(text, 1)
        code = 1
    # runs that are not met
    for text in first_lines(_doubts(found)):
        console.complain(text, SOLVER)
        code = SOLVER
    # balances that are off
    for text in first_lines(_ledger_lines(found)):
        console.complain(text, SOLVER)
        code = SOLVER
    for text in _warnings(found):
        console.say(text)
    # runs that stopped
    for run in found.failures:
        console.complain(f"{run.name}: {run.failure}", SOLVER, run.finding)
        code = SOLVER
    # nothing traced, or nothing that all runs have
    if not found.compared:
        why = "; ".join(f"{name}: {reason}" for name, reason in found.left_out) or "the scene traces nothing"
        console.complain(f"there is nothing to compare ({why}); 'trace NAME, ...' in the scene", SOLVER)
        return SOLVER
    # chaotic from the start on, or too coarse
    if found.beyond is not None and not found.horizon > found.span[0]:
        text = f"{found.beyond.variable} of {found.by} differs at two accuracies from the start on"
        console.complain(f"the traces cannot be compared: {text}; a smaller --accuracy", SOLVER)
        return SOLVER
    return code


def _complaints(found: Verified) -> list[str]:
    """Lines on what disagrees: starts, traces of runs that are met, compiled rows."""
    from sysdyn.cli.run.start.starting import first_lines

    pairs = []
    for d in found.disagreements:
        if d.doubted:
            continue
        pairs.append(f"{d.one.name} and {d.other.name} disagree: {_disagreement_text(d)}")
    carriers = [
        f"{' and '.join(t.backends)} disagree in {t.formulation}: row {t.row} by {t.difference:.1e} of itself"
        for t in found.twins
        if not t.agree
    ]
    begun = [
        f"{run.name} begins elsewhere than {found.runs[0].name}: {_values(found, gap)}" for run, gap in found.apart
    ]
    return [*begun, *first_lines(pairs), *carriers]


def _values(found: Verified, gap: Gap) -> str:
    """Those of a quantity in the reference and another run."""
    unit = found.runs[0].trace[gap.variable].units
    a, b = (f"{value:.6g}{'' if unit == '1' else f' {unit}'}" for value in gap.values)
    return f"{gap.variable} is {b}, not {a}"


def _starts(found: Verified) -> list[str]:
    """How the formulations begin, in one line; none where one begins alone."""
    if not found.starts:
        return []
    if found.apart:
        return ["starts: " + "; ".join(f"{run.formulation}: {_values(found, gap)}" for run, gap in found.apart)]
    _, worst = max(found.starts, key=lambda pair: pair[1].ratio)
    return [f"starts: {len(found.starts) + 1} formulations begin alike ({worst.variable} apart by {worst.ratio:.2g})"]


def _doubts(found: Verified) -> list[str]:
    """Differences from runs that are not met by their own estimate: nothing is known from them."""
    return [
        f"{' and '.join(run.name for run in d.doubted)}: not met by its own estimate, and apart from "
        f"{(d.one if d.other in d.doubted else d.other).name}: {_disagreement_text(d)}"
        for d in found.disagreements
        if d.doubted
    ]


def _ledger_lines(found: Verified) -> list[str]:
    """Ledgers that are off, a line each."""
    return [
        f"{run.name}: the {m.what} ledger is off by {m.value:.2g} {m.unit}, {m.limit:.2g} {m.unit} is allowed, "
        f"most at {m.element}"
        for run in found.runs
        for m in run.unbalanced
    ]


def _disagreement_text(d: Disagreement) -> str:
    gap, unit = d.gap, d.one.trace[d.gap.variable].units
    a, b = (f"{value:.6g}{'' if unit == '1' else f' {unit}'}" for value in gap.values)
    worst = f"{gap.variable} is {a} and {b} at {gap.time:.6g} s, {gap.ratio:.3g} times what is allowed"
    return worst if gap.first in (None, gap.time) else f"{worst} (first at {gap.first:.6g} s)"


def _warnings(found: Verified) -> list[str]:
    """Warnings of the runs, each once with the runs that have it."""
    names: dict[str, list[str]] = {}
    for run in (*found.runs, found.finer):
        unmet = ("the accuracy asked for was not reached by its own estimate",) if run.inaccurate else ()
        for text in (*run.outcome.warnings, *unmet):
            names.setdefault(text, []).append(run.name)
    return [f"{', '.join(dict.fromkeys(runs))}: {text}" for text, runs in names.items()]


def _table(found: Verified, *, timings: bool) -> str:
    """The table, with what stands above and below it."""
    from sysdyn.cli.verify.verification import TIMES

    head = ["formulation", "method", "index", "accuracy", "steps", "CPU ms", "estimate", "energy J", "constraints"]
    rows = [[*head, "apart", "worst", "at s"]]
    for run, gap in zip((*found.runs, found.finer), found.worst, strict=True):
        rows.append([*_cells(run), *_gap_cells(run, gap, found)])
    if not timings:
        rows = [[cell for k, cell in enumerate(row) if k != 5] for row in rows]
    accuracy, (t0, t1) = found.runs[0].accuracy, found.span
    lines = [f"{found.name}: {t0:g} s to {t1:g} s, apart in units of {TIMES:g} x {accuracy:g} x nominal"]
    rows, said = fit_columns(rows, SPARE, terminal())
    columns = len(rows[0])
    lines += [align(rows, right={*range(2, columns)} - {columns - 2}), *([said] if said else [])]
    lines += [*_starts(found), *_refusal_lines(found)]
    lines += [f"not compared: {name}: {reason}" for name, reason in found.left_out]
    if found.twins:
        apart = max(found.twins, key=lambda t: t.difference)
        lines.append(f"residuals of {' and '.join(apart.backends)}: {apart.difference:.1e} apart")
    return "\n".join([*lines, _horizon(found), _verdict(found)])


def _refusal_lines(found: Verified) -> list[str]:
    """Formulations left out, those with one reason together."""

    def reason(r: RefusedFormulation) -> str:
        text = r.reason.removeprefix(f"not expressible in {r.formulation}: ").removeprefix(f"{r.formulation} of ")
        return "not supported yet" if r.code == "E608" else f"{r.code} {text}"

    return refusals((r.formulation, reason(r)) for r in found.refusals)


def _cells(run: VerifiedRun) -> list[str]:
    o = run.outcome
    estimate = "-" if o.error_estimate is None else f"{o.error_estimate:.1e}"
    effort = [str(o.statistics["steps"]), f"{1e3 * o.timings['cpu_integrate_s']:.3g}"]
    meters = [f"{run.energy:.1e}", f"{run.constraints:.1e}"]
    return [run.formulation, run.method, o.index, f"{run.accuracy:.0e}", *effort, estimate, *meters]


def _gap_cells(run: VerifiedRun, gap: Gap | None, found: Verified) -> list[str]:
    first = "the reference" if run is found.runs[0] else ""
    if run.failure:
        return ["-", ", ".join(filter(None, (first, "stopped early"))), f"{run.outcome.reached:.4g}"]
    if first:
        return ["-", first, "-"]
    return ["-", "-", "-"] if gap is None else [f"{gap.ratio:.2g}", gap.variable, f"{gap.time:.4g}"]


def _horizon(found: Verified) -> str:
    if found.beyond is None:
        return f"horizon: {found.horizon:g} s"
    what = f"then {found.beyond.variable} of {found.by} differs at two accuracies"
    return f"horizon: {max(found.horizon, found.span[0]):g} s of {found.span[1]:g} s, {what}"


def _verdict(found: Verified) -> str:
    """One line: how many runs agree, or that they do not."""
    ended = [run for run in found.runs if not run.failure]
    number = len(ended)
    # runs that are met and differ, or twins that do
    if found.apart or any(not d.doubted for d in found.disagreements) or not all(t.agree for t in found.twins):
        return f"{number} runs: they disagree"
    # only runs that have not reached their accuracy differ
    if found.disagreements:
        return f"{number} runs, of which some are not met: the others agree"
    if len(ended) == len(found.runs):
        return f"{number} runs agree on {len(found.compared)} quantities"
    stopped = f"{len(found.runs) - number} of {len(found.runs)} runs stopped early"
    # one run agrees with nothing
    if number < 2:
        return f"{stopped}: nothing is known from them"
    return f"{stopped}: the other {number} agree on {len(found.compared)} quantities"


def _result(found: Verified, *, keep: bool, timings: bool) -> dict[str, Any]:
    """The object of --json."""
    runs = [
        _run_object(run, gap, keep=keep, timings=timings)
        for run, gap in zip((*found.runs, found.finer), found.worst, strict=True)
    ]
    return {
        "runs": runs,
        "disagreements": [
            {
                "runs": [{"formulation": r.formulation, "method": r.method} for r in (d.one, d.other)],
                **asdict(d.gap),
            }
            for d in found.disagreements
        ],
        "starts": [{"formulation": run.formulation, **asdict(gap)} for run, gap in found.starts],
        "horizon": found.horizon,
        "compared": list(found.compared),
        "not_compared": [{"variable": name, "reason": reason} for name, reason in found.left_out],
        "not_expressible": [asdict(r) for r in found.refusals],
        "backends": [
            {"formulation": t.formulation, "difference": t.difference, "row": t.row, "ok": t.agree} for t in found.twins
        ],
    }


def _run_object(run: VerifiedRun, gap: Gap | None, *, keep: bool, timings: bool) -> dict[str, Any]:
    """A run as an object of --json."""
    o = run.outcome
    return {
        "formulation": run.formulation,
        "method": run.method,
        "index": o.index,
        "accuracy": run.accuracy,
        "final": o.final,
        "reached": o.reached,
        "statistics": o.statistics,
        "timings": o.timings if timings else {},
        "error_estimate": o.error_estimate,
        "energy": run.energy,
        "met": not run.unbalanced and o.final,
        "not_met": [m.to_json() for m in run.unbalanced],
        "constraints": run.constraints,
        "worst": None if gap is None else asdict(gap),
        "expects": [{"text": text, "ok": ok} for text, ok in run.expects],
        "warnings": list(o.warnings),
        "failure": run.failure,
        "diagnostic": run.finding,
        "trace": str(o.trace) if keep else None,
    }
