"""`sysdyn check`: everything that needs no time integration, for every model and scene of a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import INPUT_OUTPUT, UsageError, classify
from sysdyn.cli.run import targets
from sysdyn.cli.run.checking import checked
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import ModelError

FORMATS = ["full", "concise", "json", "github", "junit", "sarif"]


@with_console("check")
@click.argument("files", nargs=-1, required=True)
@click.option("--strict", is_flag=True, help="Warnings count as errors, and so does what cannot be run yet.")
@click.option("--allow-unsupported", is_flag=True, help="With --strict: texts may be ahead of the compiler.")
@click.option("--fix", is_flag=True, help="Write the remedies that leave no choice into FILES, and show the changes.")
@click.option("--watch", is_flag=True, help="Check again whenever a file changes, until interrupted.")
@click.option("--explain", is_flag=True, help="Say of each model whether it is passive, and by which elements.")
@click.option("--output-format", type=click.Choice(FORMATS), help="Form of the findings. Default: full.")
def command(
    console: Console,
    files: tuple[str, ...],
    strict: bool,
    allow_unsupported: bool,
    fix: bool,
    watch: bool,
    explain: bool,
    output_format: str | None,
) -> int:
    """Check every model and scene of FILES, the consistent start included; no C compiler is needed.

    FILES may be folders (all .sd files below them) and patterns ('models/**/*.sd'). The forms concise, github, junit
    and sarif go to standard output.
    """
    given, files = files, tuple(targets.files(files))
    console.explain = explain
    _form(console, output_format, files)
    if allow_unsupported and not strict:
        raise UsageError("--allow-unsupported says what --strict may pass: give both")
    if fix and "-" in files:
        raise UsageError("--fix writes files: standard input is none")
    refused = strict and not allow_unsupported
    if not watch:
        return _all(console, files, refused, strict=strict, fix=fix)
    if "-" in files or console.as_json or output_format in ("junit", "sarif"):
        raise UsageError("--watch prints findings as they come: no standard input, --json, junit or sarif")
    from sysdyn.cli.run import watching

    seen = watching.stamps(given)
    while True:  # until it is interrupted
        console.renew()
        code = _all(console, tuple(targets.files(given)), refused, strict=strict, fix=fix)
        console.say(f"exit {code}; waiting for a change of {', '.join(given)}")
        seen = watching.changed(given, watching.stamps(given) if fix else seen)


def _all(console: Console, files: Sequence[str], refused: bool, *, strict: bool, fix: bool) -> int:
    """Check the files and show what was found; the exit code."""
    results, unread = [], False
    for path in files:
        try:
            changes = _fixed(console, path) if fix else []
            results.append(_file(console, path, refused) | ({"fixed": changes} if fix else {}))
        except OSError as error:
            unread = True
            console.complain(classify(error)[1], INPUT_OUTPUT)
        except ModelError as error:  # a file that is no text does not hide the others
            console.report.extend(error.diagnostics)
    console.result = {"files": results}
    wrong = {d.place.file for d in console.report if d.severity == "error" and d.place is not None}
    console.summary = f" in {len(wrong)} of {len(files)} files" if len(files) > 1 else ""
    warned = any(d.severity == "warning" for d in console.report)
    return console.finish(INPUT_OUTPUT if unread else 1 if strict and warned else 0)


def _fixed(console: Console, path: str) -> list[dict[str, object]]:
    """Mend a file in place; the findings that were mended."""
    from sysdyn.cli.commands.fmt_command import difference, replace
    from sysdyn.cli.run.mending import mended
    from sysdyn.dsl.text.diagnostics import SourceText

    source = SourceText.read(path)
    text, done = mended(source)
    if done:
        replace(Path(path), text)
        if console.format is None:
            console.data("".join(difference(source, text, "fixed")), verbatim=True)
        console.say(f"{path}: {len(done)} of its findings mended")
    return [d.to_json() for d in done]


def _form(console: Console, chosen: str | None, files: tuple[str, ...]) -> None:
    """Let the console show findings in the form asked for."""
    if chosen is None or chosen == "full":
        if chosen and console.as_json:
            raise UsageError("--json and --output-format full: one of them")
        return
    if chosen != "json" and console.as_json:
        raise UsageError(f"--json and --output-format {chosen}: one of them")
    if chosen == "json":
        console.as_json = True
        return
    from sysdyn.cli.page import findings

    forms = {"concise": findings.concise, "github": findings.github, "sarif": findings.sarif}
    console.format = forms.get(chosen) or (lambda found, plain: findings.junit(found, plain, files))


def _file(console: Console, path: str, refused: bool) -> dict[str, object]:
    document = targets.read(path, console.report)
    wrong = [d.place.span for d in console.report if d.severity == "error" and d.place and d.place.file == path]
    found = []
    for target in targets.all_targets(document, console.report):
        with ex.fresh():
            summary = checked(target, console.report, refused)
        items = [item.span for item in (target.model, target.scene) if item is not None]
        if any(i.start <= span.start < i.end for span in wrong for i in items):
            summary["ok"] = False  # a slip that was read as it was meant is still to be mended
        found.append(summary)
        if summary["ok"]:
            console.say(f"{path}: {target.name}: {_line(summary)}")
            if console.explain:
                console.data(f"{path}: {target.name}: " + _passivity(summary))
    if not document.models and not document.scenes and not console.report.failed:
        console.say(f"{path}: no model")
    return {"file": path, "models": list(document.models), "targets": found}


def _passivity(summary: dict[str, object]) -> str:
    found = summary.get("passivity")
    return "not compiled" if not isinstance(found, dict) else "\n".join(found["lines"])


def _line(summary: dict[str, object]) -> str:
    if "index" not in summary:
        return "ok"
    counts = "coordinates {coordinates}, m1 {m1}, m2 {m2}, dof {dof}, index {index}".format(**summary)
    moved = summary["moved"]
    assert isinstance(moved, list)
    from sysdyn.cli.run.starting import shortened

    return "; ".join([f"ok: {counts}", *shortened(moved)])
