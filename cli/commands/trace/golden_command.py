"""`sysdyn golden`: record, check, accept and list the golden traces of a project."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import SOLVER, USAGE, UsageError, worst
from sysdyn.cli.options import BACKENDS, FORMULATIONS, Setting, of_file, side_by_side
from sysdyn.cli.page.columns import align
from sysdyn.cli.plain_files import inside, project
from sysdyn.dsl.text.source import real

if TYPE_CHECKING:
    from sysdyn.cli.golden.book import Accepted, GoldenScene
    from sysdyn.cli.golden.golden_checks import Case, Mutant
    from sysdyn.cli.golden.recording import GoldenRecord
    from sysdyn.cli.run.request.run_request import RunRequest

RTOL = 2e-4
"""At 1e-3 a change of 1 % in a parameter of middling influence goes unnoticed."""
SIZE = 100.0


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Golden traces: results of a project's models that are kept and checked.

    Each model has a folder golden/NAME with golden.toml (tolerances, reasons), and for each scene a thinned trace and
    its structure. Keep the folder in git and let CI run 'sysdyn golden check'. Each of the commands takes --json,
    --quiet and --color.
    """


def _add(name: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    def decorate(function: Callable[..., int]) -> Callable[..., int]:
        made = with_console("golden")(function)
        assert isinstance(made, click.Command)
        made.name = name
        command.add_command(made)
        return function

    return decorate


_folder = click.option("--folder", default="golden", show_default=True, metavar="DIR", help="The golden folder.")


@_add("record")
@click.argument("file")
@of_file
@click.option("--name", metavar="NAME", help="Folder of the model below the golden folder. Default: the file's name.")
@click.option("--rtol", type=float, default=RTOL, show_default=True, metavar="R", help="Times the nominal magnitude.")
@click.option("--atol", type=float, default=0.0, show_default=True, metavar="A", help="In each quantity's own unit.")
@click.option("--until", metavar="T", help="End of the run; an expression, a bare number in s.")
@click.option("--formulation", type=click.Choice(FORMULATIONS[:-1]), help="This one alone. Default: all that can.")
@click.option("--set", "settings", type=Setting(), multiple=True, help="Parameter or input; repeatable.")
@click.option("--size", type=float, default=SIZE, show_default=True, metavar="KB", help="Largest size of the trace.")
@side_by_side
@_folder
def record(
    console: Console,
    name: str | None,
    rtol: float,
    atol: float,
    size: float,
    jobs: int | None,
    folder: str,
    **asked: Any,
) -> int:
    """Record a scene of FILE as golden.

    Measures the reference's own error (a hundredth of its tolerance, a second method) and refuses a tolerance below
    ten times that; runs every formulation that can express the scene.
    """
    from sysdyn.cli.golden.book import BOOK, Accepted, GoldenScene, read
    from sysdyn.cli.run.request import targets
    from sysdyn.cli.run.request.run_request import RunRequest

    request = RunRequest(**asked)
    if not (0.0 < rtol < 1.0 and 0.0 <= atol < math.inf):
        raise UsageError(f"--rtol {rtol:g} --atol {atol:g}: between 0 and 1, and not negative")
    if request.file == "-":
        raise UsageError("a golden trace belongs to a model in a file")
    target = targets.target_of(request, console.report)
    # the report says why
    if target is None:
        return console.finish(1)
    # a golden is of one scene, or of a model without
    scene, model = target.scene.name.name if target.scene else None, target.model.name.name
    request = replace(request, scene=scene, model=None if scene else model)
    label, file = scene or model, Path(request.file)
    place = Path(folder) / (name or file.stem)
    # goldens of one model stand in one folder
    known = read(place) if (place / BOOK).is_file() else ()
    if not inside(file, project(Path(folder))):
        raise UsageError(f"{file} is outside of the project, {project(Path(folder))}: --folder gives its own")
    if any(real(g.model) != real(file) for g in known):
        raise UsageError(f"{place} is of {known[0].model}: --name gives another folder")
    if any(g.name == label for g in known):
        raise UsageError(f"{place.name}/{label} is recorded already: 'sysdyn golden accept' renews it, with a reason")
    # the record, with its own error measured
    found = _record_or_exit(console, request, rtol, atol, jobs)
    if isinstance(found, int):
        return console.finish(found)
    said = request.settings, request.until
    golden = GoldenScene(place, file, label, scene or "", rtol, atol, 0, 0, 0, 0, 0, (), *said)
    golden = _golden(golden, found, Accepted("recorded", f"first record, {found.method}"))
    code = _keep(console, golden, found, size)
    console.result = {
        "golden": golden.label,
        "trace": str(golden.trace),
        "error": golden.error,
        "rtol": golden.rtol,
        "accuracy": golden.accuracy,
        "points": int(found.trace.time.size),
        "formulations": list(golden.formulations),
    }
    if code == 0:
        kept = golden.trace.stat().st_size / 1e3
        console.say(f"{golden.label}: {found.trace.time.size} instants, {kept:.0f} kB")
    return console.finish(code)


@_add("check")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--formulation", "formulations", type=click.Choice(FORMULATIONS[:-1]), multiple=True, help="Repeatable.")
@click.option("--method", "methods", type=click.Choice(["bdf", "radau", "auto"]), multiple=True, help="Repeatable.")
@click.option("--backend", "backends", type=click.Choice(BACKENDS), multiple=True, help="Repeatable. Default: c.")
@side_by_side
@click.option("--junit", "junit_file", metavar="FILE", help="Write the results as JUnit XML.")
@click.option("--html", "html_file", metavar="FILE", help="Write one page with pictures of what differs.")
@click.option("--mutate", "mutants", is_flag=True, help="Change each parameter by 1 %: which goldens do not notice?")
@click.option("--pages", is_flag=True, hidden=True)
@_folder
def check(
    console: Console,
    names: tuple[str, ...],
    formulations: tuple[str, ...],
    methods: tuple[str, ...],
    backends: tuple[str, ...],
    jobs: int | None,
    junit_file: str | None,
    html_file: str | None,
    mutants: bool,
    pages: bool,
    folder: str,
) -> int:
    """Run the models and compare them with their golden traces (all of them, or those named)."""
    from sysdyn.cli.golden import book

    goldens = book.find(Path(folder), names)
    # whether goldens notice changes of parameters
    if mutants:
        return _mutants(console, goldens, jobs)
    from sysdyn.cli.golden.jobs import GoldenJob, in_processes

    drawn = bool(html_file) or pages
    cases = []
    # as they come
    for found in in_processes([GoldenJob(g, formulations, methods, backends or ("c",), drawn) for g in goldens], jobs):
        cases += found
        for case in found:
            console.say(f"{'ok' if case.exit == 0 else 'FAILED':6} {case.label}: {case.message} ({case.seconds:.1f} s)")
    return _report(console, cases, junit_file, html_file, pages)


def _report(console: Console, cases: Sequence[Case], junit_file: str | None, html_file: str | None, pages: bool) -> int:
    """Show what the checks found, as text, JUnit and page; the exit code."""
    from sysdyn.cli.golden.changes import page
    from sysdyn.cli.golden.golden_checks import checkable
    from sysdyn.cli.page.junit import junit

    wrong = sorted((c for c in cases if c.exit), key=lambda c: -c.ratio)
    console.result = {
        "checks": [checkable(c) | ({"page": c.page} if pages else {}) for c in cases],
        "failed": len(wrong),
    }
    if junit_file:
        whole_files.write(junit_file, junit([(c.label, c.seconds, c.cases) for c in cases]))
    if html_file:
        whole_files.write(html_file, page(cases))
    if not console.quiet and "-" not in (junit_file, html_file):
        if wrong:
            console.data(f"{len(wrong)} of {len(cases)} checks failed; worst: {wrong[0].label}: {wrong[0].message}")
            for case in wrong:
                console.data("\n".join(f"  {case.label}: {text}" for _, text in case.cases if text is not None))
        else:
            near = max((c.ratio for c in cases), default=0.0)
            console.data(f"all {len(cases)} checks passed, the nearest at {near:.2g} of its limit")
    return console.finish(worst(c.exit for c in cases))


def _mutants(console: Console, goldens: Sequence[GoldenScene], jobs: int | None) -> int:
    """`check --mutate`: exit 1 where a golden does not notice a change that it could have noticed."""
    from dataclasses import asdict

    from sysdyn.cli.golden.jobs import mutate_golden
    from sysdyn.cli.run.many.crew import each

    found: list[Mutant] = []
    code = 0
    # each golden's parameters changed by 1 %
    for golden, made in zip(goldens, each(mutate_golden, goldens, jobs), strict=True):
        mutants, stopped = made if isinstance(made, tuple) else ([], (SOLVER, f"its process died ({made.how})"))
        for mutant in mutants:
            found.append(mutant)
            word = {True: "noticed", False: "MISSED", None: "skipped"}[mutant.noticed]
            by = "" if mutant.noticed is None else f", {mutant.ratio:.3g} of the limit"
            console.say(f"{word:8} {mutant.golden} {mutant.parameter}{by}")
        # a run that stopped, or a process that died
        if stopped is not None:
            console.complain(f"{golden.label}: {stopped[1]}", stopped[0])
            code = worst((code, stopped[0]))
    # a parameter of zero cannot be changed by a share
    tried = [m for m in found if m.noticed is not None]
    missed = [m for m in found if m.noticed is False]
    zeros = len(found) - len(tried)
    console.result = {
        "mutants": [asdict(m) for m in found],
        "tried": len(tried),
        "noticed": sum(bool(m.noticed) for m in tried),
        "insensitive": sum(m.insensitive for m in tried),
    }
    if not console.quiet:
        counts = console.result
        some = f", {counts['insensitive']} have no effect" if counts["insensitive"] else ""
        console.data(f"{counts['noticed']} of {len(tried)} changes of 1 % are noticed{some}")
        for m in missed:
            console.data(f"  {m.golden}: {m.parameter}: {m.reason}")
        if zeros:
            console.data(f"  {zeros} parameter{' is' if zeros == 1 else 's are'} 0: a share of that changes nothing")
    return console.finish(worst((code, int(any(m.noticed is False and not m.insensitive for m in found)))))


@_add("accept")
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@click.option("--reason", metavar="TEXT", help="Why the change is right; kept in golden.toml.")
@click.option("--rtol", type=float, metavar="R", help="Another tolerance.")
@click.option("--size", type=float, default=SIZE, show_default=True, metavar="KB", help="Largest size of the trace.")
@side_by_side
@_folder
def accept(
    console: Console,
    names: tuple[str, ...],
    reason: str | None,
    rtol: float | None,
    size: float,
    jobs: int | None,
    folder: str,
) -> int:
    """Show what changed in the goldens NAME... and, with a reason, record them anew."""
    from sysdyn.cli.golden import book
    from sysdyn.cli.golden.changes import what_changed

    if reason is not None and not reason.strip():
        raise UsageError("--reason is empty: say why the change is right")
    if rtol is not None and not 0.0 < rtol < 1.0:
        raise UsageError(f"--rtol {rtol:g}: between 0 and 1")
    code, changes = 0, []
    goldens = book.find(Path(folder), names)
    renewed = [golden if rtol is None else replace(golden, rtol=rtol) for golden in goldens]
    # recorded anew, compared with what is kept
    for golden, wanted, found in zip(goldens, renewed, _record_each(console, renewed, jobs), strict=True):
        if isinstance(found, int):
            code = worst((code, found))
            continue
        change, text = what_changed(golden, wanted, found)
        changes.append({"golden": golden.label, "change": change})
        if not console.quiet:
            console.data(f"{golden.label}: {text}")
        # nothing changed
        if change is None:
            continue
        # shown, and refused
        if reason is None:
            code = worst((code, USAGE))
            continue
        accepted = book.Accepted(reason.strip(), change)
        code = worst((code, _keep(console, _golden(wanted, found, accepted), found, size)))
    console.result = {"changes": changes, "reason": reason}
    if code == USAGE:
        console.complain("nothing is recorded without a reason: --reason 'why the change is right'", USAGE)
    return console.finish(code)


def _record_each(console: Console, goldens: Sequence[GoldenScene], jobs: int | None) -> Iterator[GoldenRecord | int]:
    """The record of each golden, made anew; the exit code after saying why there is none."""
    from sysdyn.cli.golden.jobs import record_again
    from sysdyn.cli.run.many.crew import Lost, each

    for golden, made in zip(goldens, each(record_again, goldens, jobs), strict=True):
        died = isinstance(made, Lost)
        said, found = ([], (SOLVER, f"{golden.label}: its process died ({made.how})")) if died else made
        for line in said:
            console.say(line)
        if isinstance(found, tuple):
            console.complain(found[1], found[0])
            yield found[0]
        else:
            yield found


@_add("list")
@_folder
def list_(console: Console, folder: str) -> int:
    """List the goldens: tolerance, measured error, size, formulations, last reason."""
    from sysdyn.cli.golden import book

    goldens = book.find(Path(folder))
    rows = [("golden", "rtol", "error", "kB", "formulations", "last reason")]
    items = []
    # a line each, from the book and the trace's size
    for g in goldens:
        size = g.trace.stat().st_size / 1e3 if g.trace.is_file() else math.nan
        reason = g.accepted[-1].reason if g.accepted else ""
        rows.append((g.label, f"{g.rtol:g}", f"{g.error:.1e}", f"{size:.0f}", ", ".join(g.formulations), reason))
        items.append(
            {
                "golden": g.label,
                "model": str(g.model),
                "scene": g.scene,
                "rtol": g.rtol,
                "atol": g.atol,
                "tau": g.tau,
                "error": g.error,
                "bytes": None if math.isnan(size) else round(size * 1e3),
                "formulations": list(g.formulations),
                "accepted": [{"reason": a.reason, "change": a.change} for a in g.accepted],
            }
        )
    console.result = {"goldens": items}
    console.data(align(rows))
    return console.finish()


# ---- what record and accept share


def _record_or_exit(
    console: Console, request: RunRequest, rtol: float, atol: float, jobs: int | None
) -> GoldenRecord | int:
    """The record; the exit code after saying why there is none."""
    from sysdyn.cli.golden import recording
    from sysdyn.cli.golden.runs import Stopped

    try:
        return recording.record(request, rtol, atol, console.say, jobs)
    except (recording.Refused, Stopped) as error:
        code = getattr(error, "code", 1)
        console.complain(str(error), code)
        return code


def _golden(golden: GoldenScene, found: GoldenRecord, accepted: Accepted) -> GoldenScene:
    """A golden with what was measured, and why it is right."""
    return replace(
        golden,
        tau=found.tau,
        accuracy=found.accuracy,
        error=found.error,
        energy=found.energy,
        constraints=found.constraints,
        formulations=tuple(found.structure),
        accepted=(*golden.accepted, accepted),
    )


def _keep(console: Console, golden: GoldenScene, found: GoldenRecord, size: float) -> int:
    """Write trace, structure and golden.toml; the exit code."""
    from sysdyn.cli.golden import book
    from sysdyn.cli.golden.trace_file import write_trace

    golden.folder.mkdir(parents=True, exist_ok=True)
    attributes: dict[str, str | float | int] = {
        "Conventions": "CF-1.11",
        "title": golden.label,
        "source": "sysdyn golden",
        "scene": golden.scene,
        "rtol": golden.rtol,
        "atol": golden.atol,
        "tau": golden.tau,
        "error": float(f"{golden.error:.2e}"),
    }
    # written beside, and dropped where it is too large
    need = write_trace(golden.trace, found.trace, attributes, size * 1e3) / 1e3
    if need > size:
        message = f"{golden.label} would be {need:.0f} kB, more than {size:g}"
        console.complain(f"{message}: fewer quantities, a looser --rtol, a shorter scene, or --size {need + 1:.0f}", 1)
        return 1
    structure = {"version": 1, "scene": golden.scene, "formulations": found.structure}
    whole_files.write(golden.structure, json.dumps(structure, indent=1) + "\n")
    book.write(golden)
    return 0
