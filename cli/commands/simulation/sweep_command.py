"""`sysdyn sweep`: many runs of one compiled model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import UsageError, worst
from sysdyn.cli.options import chosen, solved
from sysdyn.cli.page.columns import align
from sysdyn.cli.run.many.crew import cores
from sysdyn.cli.run.request.run_request import RunRequest, default_output
from sysdyn.cli.sweep.core_cases import KEEPS
from sysdyn.cli.sweep.one_run import Runner
from sysdyn.cli.sweep.run_records import Kept
from sysdyn.cli.sweep.study import SAMPLES, read, study
from sysdyn.cli.sweep.sweeping import Swept, axes_of, summary, sweep, to_json
from sysdyn.runtime.trace.opening import replaceable

SHOWN = 24
"""Runs in the table at most, and columns of traced quantities."""
COLUMNS = 5
KINDS = (".png", ".svg")


@with_console("sweep")
@click.argument("file")
@chosen
@solved
@click.option("--over", multiple=True, metavar="NAME=...", help="A list, a grid or a distribution; repeatable.")
@click.option("--runs", type=click.IntRange(min=1), help="Cases that are drawn of the distributions.")
@click.option("--sample", type=click.Choice(SAMPLES), help="How they are drawn. Default: random.")
@click.option("--seed", type=int, default=None, help="Of what is drawn. Default: 0.")
@click.option("--jobs", type=click.IntRange(min=1), help="Processes side by side. Default: one a core.")
@click.option("--dask", metavar="ADDRESS", help="On the workers of this Dask scheduler (tcp://host:8786).")
@click.option("--keep", type=click.Choice(tuple(KEEPS)), help="Of each run. Default: traces (thinned), with extrema.")
@click.option("--until", metavar="T", help="End of the runs; an expression, a bare number in s.")
@click.option("-o", "output", metavar="RUNS.h5", help="Default: <stem>-<scene>-sweep.h5 here.")
@click.option("--plot", metavar="FILE.png|.svg", help="Bands over time, end values over what varied.")
@click.option("--no-timings", is_flag=True, help="Leave CPU times out.")
def command(
    console: Console,
    progress: str,
    file: str,
    over: tuple[str, ...],
    runs: int | None,
    sample: str | None,
    seed: int | None,
    jobs: int | None,
    dask: str | None,
    keep: str | None,
    output: str | None,
    plot: str | None,
    no_timings: bool,
    **options: Any,
) -> int:
    """Run a scene of FILE many times, with other parameters, inputs, levels or formulations.

    --over k='1 N/m,2 N/m', k='1 N/m..10 N/m:5' (':log' for a logarithmic grid), k~'normal(4 N/m, 0.1 N/m)', or
    'level PATH'=a,b and formulation=lagrangian,hamiltonian. FILE may be a study in TOML. Results are kept as they
    come: the same command goes on where a sweep was killed.
    """
    if file == "-":
        raise UsageError("a sweep needs a file: its workers read it too")
    if plot is not None and Path(plot).suffix not in KINDS:
        raise UsageError(f"--plot '{plot}': one of {', '.join(KINDS)}")
    said: dict[str, Any] = {}
    # a study: its options are defaults of those on the command line
    if file.endswith(".toml"):
        found = read(file)
        file, said = found.file, dict(found.options)
        over = (*found.over, *over)
        options["scene"] = options["scene"] or said.pop("scene", None)
        options["model"] = options["model"] or said.pop("model", None)
    request = RunRequest(file, **options)
    kept = keep or said.get("keep") or "traces"
    if kept not in KEEPS:
        raise UsageError(f"keep = '{kept}': one of {', '.join(KEEPS)}")
    # the model is loaded once, for all runs
    runner = Runner(request, kept)
    asked = study(
        axes_of(runner, over),
        sample or said.get("sample"),
        runs if runs is not None else said.get("runs"),
        seed if seed is not None else said.get("seed", 0),
    )
    scene = runner.load_model().target.scene
    named = default_output(file, scene.name.name if scene else "", "-sweep.h5")
    target = Path(output or said.get("output") or named)
    # never over the model, nor over a file of others
    if target.suffix == ".sd" or (target.exists() and target.samefile(file)):
        raise UsageError(f"-o {target} is the model itself")
    if target.is_file() and not replaceable(target, sweep=True):
        raise UsageError(f"-o {target} exists and is no sweep of sysdyn: give another name, or remove it")
    number = jobs or said.get("jobs") or cores()
    with console.progress(progress) as line:
        swept = sweep(request, asked, target, number, line, timings=not no_timings, keep=kept, dask=dask, runner=runner)
    return _show_results(console, swept, plot)


def _show_results(console: Console, found: Swept, plot: str | None) -> int:
    """Show table, picture and failed runs of a sweep; the exit code."""
    console.result = to_json(found)
    console.results(_table(found))
    if plot is not None:
        from sysdyn.cli.sweep.sweep_picture import picture

        whole_files.write(plot, picture(found, Path(plot).suffix[1:]))
    resumed = f", {found.resumed} of them from before" if found.resumed else ""
    console.say(f"{found.output}: {len(found.cases)} runs{resumed}")
    if found.alone and len(found.cases) > SHOWN:
        console.say(f"one by one: {found.alone}")
    # the first failures with their reasons, then how many more
    for kept in found.failed[:SHOWN]:
        console.complain(f"run {kept.run} ({_settings_text(found, kept.run)}): {kept.reason}", kept.exit, kept.finding)
    if len(found.failed) > SHOWN:
        console.complain(f"and {len(found.failed) - SHOWN} more: 'reason' in {found.output}", _exit(found))
    return console.finish(_exit(found))


def _exit(found: Swept) -> int:
    """The worst of the runs' exits; a run that ended and is not met has SOLVER of its own."""
    return worst(found.exits)


def _settings_text(found: Swept, run: int) -> str:
    return ", ".join(f"{name} = {_text(value)}" for name, value in found.cases[run].items())


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _table(found: Swept) -> str:
    """Every run where they are few; else the spread of the end values."""
    if len(found.cases) <= SHOWN:
        names = list(next((k.end for k in found.kept if k.end), {}) or {})[:COLUMNS]
        varied = [_column_head(found, n) for n in found.cases[0]]
        head = ["run", *varied, *(_column_head(found, n, " at the end") for n in names), ""]
        rows = []
        for k in found.kept:
            ends = [_text((k.end or {}).get(n, "-")) for n in names]
            rows.append([str(k.run), *map(_text, found.cases[k.run].values()), *ends, _mark(k)])
        return align([head, *rows], right=range(len(head) - 1))
    rows = [
        [_column_head(found, name), *(_text(v) for v in spread.values())] for name, spread in summary(found).items()
    ]
    return align([["at the end", "least", "median", "largest"], *rows], right=(1, 2, 3))


def _column_head(found: Swept, name: str, when: str = "") -> str:
    """`x at the end [m]`."""
    return f"{name}{when}{f' [{unit}]' if (unit := found.unit(name)) else ''}"


def _mark(kept: Kept) -> str:
    if kept.exit == 0:
        return ""
    if kept.exit == 1 and kept.met:
        return "expect failed"
    return "not met" if kept.end else "failed"
