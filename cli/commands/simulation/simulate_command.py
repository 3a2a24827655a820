"""`sysdyn simulate`: text in, trace out."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console
from sysdyn.cli.failures import UsageError
from sysdyn.cli.options import scene_command
from sysdyn.cli.page.columns import spent
from sysdyn.cli.progress import ProgressLine

if TYPE_CHECKING:
    from sysdyn.cli.run.request.run_request import RunRequest
    from sysdyn.cli.run.running import Ran

SHOWN = 4
"""Conserved quantities that the summary lists."""


@scene_command("simulate", "run", "the trace holds")
@click.option("-o", "output", metavar="TRACE.h5", help="Default: <stem>-<scene>.h5 here.")
@click.option("--accuracy-check", is_flag=True, help="A second run by another method must agree.")
@click.option("--no-timings", is_flag=True, help="Leave wall and CPU times out of the trace.")
def command(console: Console, progress: str, no_timings: bool, **options: Any) -> int:
    """Simulate a scene of FILE and write its trace."""
    from sysdyn.cli.run.request.run_request import RunRequest
    from sysdyn.cli.run.running import run
    from sysdyn.cli.run.start.starting import change_lines, first_lines, strategy_note

    request = RunRequest(timings=not no_timings, **options)
    if request.output == "-" and console.as_json:
        raise UsageError("-o - and --json both want standard output")
    with console.progress(progress) as line:
        # HDF5 to standard output is made in a file first
        ran = (
            _simulate_to_stream(request, console, line)
            if _streams(request.output)
            else run(request, console.report, line)
        )
    if ran is None:
        return console.unable()
    console.result = _result(ran)
    # how the start was found, what it moved, what the run warns of
    found = strategy_note(ran.started.state)
    moves = first_lines(change_lines(ran.prepared, ran.started.state))
    for text in (*moves, *([found] if found else []), *ran.outcome.warnings):
        console.say(text)
    # expectations of a run that is not met are shown, and not judged
    if ran.outcome.judgement is not None and not ran.outcome.met:
        for claim in ran.claims:
            found = "" if claim.value is None else f": {claim.value:.9g} at {claim.time:.9g} s"
            console.say(f"expect {claim.text}{found} (of a run that is not met: not judged)")
    console.say(_summary(ran))
    return console.finish(ran.exit)


def _streams(output: str | None) -> bool:
    """Whether a trace is wanted where no file is: standard output, a pipe, a device."""
    if output is None or output == "-":
        return output == "-"
    path = Path(output)
    return path.exists() and not path.is_file() and not path.is_dir()


def _simulate_to_stream(request: RunRequest, console: Console, line: ProgressLine) -> Ran | None:
    """HDF5 cannot be streamed: the trace is made in a folder of its own and copied."""
    import tempfile

    from sysdyn.cli.run.running import run

    assert request.output is not None
    with tempfile.TemporaryDirectory(prefix="sysdyn-") as folder:
        path = Path(folder) / "trace.h5"
        try:
            ran = run(replace(request, output=str(path)), console.report, line)
            return ran and replace(ran, outcome=replace(ran.outcome, trace=Path(request.output)))
        finally:  # what was computed before an interruption, too
            if path.is_file():
                whole_files.write(request.output, path.read_bytes())


def _summary(ran: Ran) -> str:
    """Two or three lines: how the run was made, its steps and error, what is conserved, where the trace is."""
    o = ran.outcome
    s, t = o.statistics, o.timings
    estimate = "" if o.error_estimate is None else f", estimated error {o.error_estimate:.1e}"
    estimate = ", estimated error below round-off" if o.below_round_off else estimate
    form = {"None": "not known"} | ({"2": "2 (stabilised)"} if ran.started.facts.index == 3 else {})
    method = f"{o.method} ({o.reason})" if o.reason else o.method
    how = (ran.prepared.formulation, method, f"index {form.get(str(o.index), o.index)}", ran.prepared.backend)
    balance, missed = _last(o.samples.energy), _last(o.samples.constraints)
    meters = [f"energy balance {balance:.2e} J"] if math.isfinite(balance) else []  # a draft left behind has none
    meters += [f"constraints {missed:.1e}"] if math.isfinite(missed) else []
    began = ran.started.state.t
    span = f"{o.reached:g} s" if began == 0.0 else f"{began:.12g} s to {o.reached:.12g} s"
    lines = [
        f"{ran.target.name}: {', '.join(how)}",
        f"  {span} in {s['steps']} steps, {spent(t['cpu_integrate_s'])} of CPU{estimate}",
        *([f"  {', '.join(meters)}"] if meters else []),
        *(f"  {text}" for text in _conservation_lines(ran)),
        f"  {o.trace}{'' if o.final else ' (not final)'}{'' if o.met or not o.final else ' (not met)'}",
    ]
    return "\n".join(lines)


def _conservation_lines(ran: Ran) -> list[str]:
    """A line on each of the first quantities that should keep their value."""
    found = ran.outcome.judgement.conserved if ran.outcome.judgement else ()
    lines = [f"conserved: {b.title}, {b.value:.1e} of {b.turnover:.3g} {b.unit}" for b in found[:SHOWN]]
    return [*lines, f"conserved: {len(found) - SHOWN} more, see --json"] if len(found) > SHOWN else lines


def _last(values: Any) -> float:
    return float(values[-1]) if len(values) else float("nan")


def _result(ran: Ran) -> dict[str, Any]:
    """The object of --json."""
    from sysdyn.cli.run.start.starting import change_lines

    o = ran.outcome
    return {
        "trace": str(o.trace),
        "final": o.final,
        "reached": o.reached,
        "formulation": ran.prepared.formulation,
        "method": o.method,
        "index": o.index,
        "start_strategy": ran.started.state.strategy,
        "statistics": o.statistics,
        "timings": o.timings,
        "error_estimate": o.error_estimate,
        "below_round_off": o.below_round_off,
        "met": o.met,
        "judged": list(o.judgement.judged) if o.judgement else [],
        "not_met": [missed.to_json() for missed in o.judgement.not_met] if o.judgement else [],
        "conserved": o.judgement.conserved_quantities() if o.judgement else [],
        "expects": [asdict(c) for c in ran.claims],
        "moved": change_lines(ran.prepared, ran.started.state),
        "warnings": list(o.warnings),
        "failure": ran.failure,
    }
