"""`sysdyn check`: everything that needs no time integration, for every model and scene of a file."""

from __future__ import annotations

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import INPUT_OUTPUT, UsageError, classify
from sysdyn.cli.run import targets
from sysdyn.cli.run.checking import checked
from sysdyn.dsl.model import expression as ex


@with_console("check")
@click.argument("files", nargs=-1, required=True)
@click.option("--strict", is_flag=True, help="Warnings count as errors, and so does what cannot be run yet.")
@click.option("--allow-unsupported", is_flag=True, help="With --strict: texts may be ahead of the compiler.")
def command(console: Console, files: tuple[str, ...], strict: bool, allow_unsupported: bool) -> int:
    """Check every model and scene of FILES, the consistent start included; no C compiler is needed."""
    if allow_unsupported and not strict:
        raise UsageError("--allow-unsupported says what --strict may pass: give both")
    refused = strict and not allow_unsupported
    results, unread = [], False
    for path in files:
        try:
            results.append(_file(console, path, refused))
        except OSError as error:
            unread = True
            console.complain(classify(error)[1], INPUT_OUTPUT)
    console.result = {"files": results}
    warned = any(d.severity == "warning" for d in console.report)
    return console.finish(INPUT_OUTPUT if unread else 1 if strict and warned else 0)


def _file(console: Console, path: str, refused: bool) -> dict[str, object]:
    document = targets.read(path, console.report)
    found = []
    for target in targets.all_targets(document, console.report):
        with ex.fresh():
            summary = checked(target, console.report, refused)
        found.append(summary)
        if summary["ok"]:
            console.say(f"{path}: {target.name}: {_line(summary)}")
    if not document.models and not document.scenes and not console.report.failed:
        console.say(f"{path}: no model")
    return {"file": path, "models": list(document.models), "targets": found}


def _line(summary: dict[str, object]) -> str:
    if "index" not in summary:
        return "ok"
    counts = "coordinates {coordinates}, m1 {m1}, m2 {m2}, dof {dof}, index {index}".format(**summary)
    moved = summary["moved"]
    assert isinstance(moved, list)
    from sysdyn.cli.run.starting import shortened

    return "; ".join([f"ok: {counts}", *shortened(moved)])
