"""`sysdyn reduce`: the energy activity of each element of a scene, and the model without what it does not need."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console
from sysdyn.cli.failures import SOLVER, UsageError
from sysdyn.cli.options import scene_command
from sysdyn.cli.page.columns import align
from sysdyn.cli.reduce.activity import Activities
from sysdyn.cli.reduce.reduction import Cost, ReducedModel, reduce
from sysdyn.cli.report.balance import WORDS
from sysdyn.cli.run.request.run_request import RunRequest

KINDS = (".png", ".svg")
BAR = 24
"""Characters of the longest bar."""


@scene_command("reduce", "runs")
@click.option("-o", "output", metavar="FILE.sd", help="The reduced text. Default: <stem>-reduced.sd beside FILE.")
@click.option("--plot", metavar="FILE.png|.svg", help="Activities as bars, and where the energy went.")
@click.option("--activity", "only", is_flag=True, help="The table of activities alone.")
@click.option("--no-timings", is_flag=True, help="Leave CPU times out.")
def command(
    console: Console, progress: str, no_timings: bool, only: bool, plot: str | None, output: str | None,
    max_wall: str | None, **options: Any,
) -> int:  # fmt: skip
    """Measure which elements a scene of FILE needs, and write the model without the others.

    The activity of an element is the integral of its absolute power over the scene. The least active are left out, or
    their ends are joined, one after the other; a change is kept where the traced quantities stay within the accuracy of
    those of the full model.
    """
    from sysdyn.cli.commands.simulation.trade_command import budget_of

    request = RunRequest(**options)
    # the reduced text has to go somewhere
    if request.file == "-" and output is None and not only:
        raise UsageError("a text from standard input: -o names the reduced one")
    if output is not None and Path(output).suffix != ".sd":
        raise UsageError(f"-o {output}: a model's text ends in .sd")
    target = Path(output) if output else Path(request.file).parent / f"{Path(request.file).stem}-reduced.sd"
    # never over the model
    if target.exists() and Path(request.file).exists() and target.samefile(request.file):
        raise UsageError(f"-o {target} is the model itself")
    if plot is not None and Path(plot).suffix not in KINDS:
        raise UsageError(f"--plot '{plot}': a picture of activities is one of {', '.join(KINDS)}")
    # traces of trials go with the folder
    with tempfile.TemporaryDirectory(prefix="sysdyn-") as folder, console.progress(progress) as line:
        found = reduce(request, console.report, Path(folder), only=only, budget=budget_of(max_wall), progress=line)
    if found is None:
        return console.unable() if console.report.failed else console.finish(SOLVER)
    # a text is written where something was left out
    kept = any(t.kept for t in found.trials)
    console.result = _result(found, str(target) if kept else None, timings=not no_timings)
    console.results(_activity(found.found))
    if plot is not None:
        from sysdyn.cli.reduce.sankey import picture

        whole_files.write(plot, picture(found.found, found.name, Path(plot).suffix[1:]))
        console.say(plot)
    if not only:
        console.results(_summary(found, target, kept=kept, timings=not no_timings))
        if kept:
            whole_files.write(target, found.text)
    return console.finish(0)


def _activity(found: Activities) -> str:
    rows = [["element or statement", "", "activity, J", "share", "sum", ""]]
    most = max((a.share for a in found.items), default=0.0)
    total = 0.0
    for a in found.items:
        total += a.share if a.role != "through" else 0.0
        bar = "#" * round(BAR * a.share / most) if most > 0.0 else ""
        sum_ = "" if a.role == "through" else f"{100.0 * total:.3f} %"
        rows.append([a.label, WORDS[a.role], f"{a.activity:.4g}", f"{100.0 * a.share:.3f} %", sum_, bar])
    return align(rows, right=(2, 3, 4))


def _summary(found: ReducedModel, target: Path, *, kept: bool, timings: bool) -> str:
    """A table of the trials, and what the reduction came to."""
    rows = [["change", "", "share", "error", ""]]
    for t in found.trials:
        # - where no run was made
        error = "-" if t.error is None else f"{t.error:.1e}"
        reason = t.reason if len(t.reason) <= 70 else t.reason[:67] + "..."
        rows.append([t.label, t.how, f"{100.0 * t.share:.3f} %", error, "kept" if t.kept else reason])
    lines = ["", align(rows, right=(2, 3))] if found.trials else [""]
    if not found.ended:
        lines.append("the budget of wall time is spent: elements that were not tried may go too")
    number = sum(t.kept for t in found.trials)
    # nothing could go: no target was written
    if not kept:
        return "\n".join([*lines, f"{found.name}: every element that was tried is needed for {found.accuracy:.0e}"])
    gone = "1 element is" if number == 1 else f"{number} elements are"
    lines.append(f"{found.name}: {gone} not needed for {found.accuracy:.0e}; error {found.error:.1e}")
    if found.full and found.reduced:
        lines.append(_costs(found.full, found.reduced, timings=timings))
    return "\n".join([*lines, f"{target}"])


def _costs(full: Cost, reduced: Cost, *, timings: bool) -> str:
    text = f"unknowns {full.unknowns} -> {reduced.unknowns}, steps {full.steps} -> {reduced.steps}"
    if timings and reduced.cpu_s > 0.0:
        times = full.cpu_s / reduced.cpu_s
        text += f", CPU {1e3 * full.cpu_s:.3g} -> {1e3 * reduced.cpu_s:.3g} ms ({times:.2g} times as fast)"
    return text


def _result(found: ReducedModel, target: str | None, *, timings: bool) -> dict[str, Any]:
    """The object of --json: activities, trials, costs."""

    def cost(c: Cost | None) -> dict[str, Any] | None:
        if c is None:
            return None
        return {"unknowns": c.unknowns, "steps": c.steps, "cpu_s": c.cpu_s if timings else None}

    return {
        "activity": [
            {
                "element": a.label, "role": WORDS[a.role], "activity": a.activity, "share": a.share,
                "energy": a.energy, "domain": a.domain, "file": a.place.file, "line": a.place.start[0],
            }
            for a in found.found.items
        ],
        "total": found.found.total,
        "accuracy": found.accuracy,
        "trials": [
            {
                "element": t.label, "change": t.how, "activity": t.activity, "share": t.share, "error": t.error,
                "kept": t.kept, "reason": t.reason or None,
            }
            for t in found.trials
        ],
        "error": found.error,
        "full": cost(found.full),
        "reduced": cost(found.reduced),
        "file": target,
        "ended": found.ended,
    }  # fmt: skip
