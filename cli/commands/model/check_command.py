"""`sysdyn check`: everything that needs no time integration, for every model and scene of a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import INPUT_OUTPUT, UsageError, classify
from sysdyn.cli.options import FORMATS, side_by_side
from sysdyn.cli.run.check.checking import Checked, file_checked
from sysdyn.cli.run.many.crew import Lost, each
from sysdyn.cli.run.request import targets
from sysdyn.dsl.text.diagnostics import ModelError


@with_console("check")
@click.argument("files", nargs=-1, required=True)
@click.option("--strict", is_flag=True, help="Warnings count as errors, and so does what cannot be run yet.")
@click.option("--allow-unsupported", is_flag=True, help="With --strict: texts may be ahead of the compiler.")
@click.option("--fix", is_flag=True, help="Write the remedies that leave no choice into FILES, and show the changes.")
@click.option("--watch", is_flag=True, help="Check again whenever a file changes, until interrupted.")
@click.option("--explain", is_flag=True, help="Say of each model whether it is passive, and by which elements.")
@click.option("--output-format", type=click.Choice(FORMATS), help="Form of the findings. Default: full.")
@side_by_side
def command(
    console: Console,
    files: tuple[str, ...],
    strict: bool,
    allow_unsupported: bool,
    fix: bool,
    watch: bool,
    explain: bool,
    output_format: str | None,
    jobs: int | None,
) -> int:
    """Check every model and scene of FILES, the consistent start included; no C compiler is needed.

    FILES may be folders (all .sd files below them) and patterns ('models/**/*.sd'). The forms concise, github, junit
    and sarif go to standard output.
    """
    # folders and patterns become files
    given, files = files, tuple(targets.files(files))
    console.explain = explain
    _form(console, output_format, files)
    if allow_unsupported and not strict:
        raise UsageError("--allow-unsupported says what --strict may pass: give both")
    if fix and "-" in files:
        raise UsageError("--fix writes files: standard input is none")
    refused = strict and not allow_unsupported
    # once
    if not watch:
        return _all(console, files, refused, jobs, strict=strict, fix=fix)
    if "-" in files or console.as_json or output_format in ("junit", "sarif"):
        raise UsageError("--watch prints findings as they come: no standard input, --json, junit or sarif")
    from sysdyn.cli.run.check import watching

    seen = watching.stamps(given)
    # then whenever a file changes
    while True:  # until it is interrupted
        console.renew()
        code = _all(console, tuple(targets.files(given)), refused, jobs, strict=strict, fix=fix)
        console.say(f"exit {code}; waiting for a change of {', '.join(given)}")
        seen = watching.wait_for_change(given, watching.stamps(given) if fix else seen)


def _all(console: Console, files: Sequence[str], refused: bool, jobs: int | None, *, strict: bool, fix: bool) -> int:
    """Check the files and show what was found; the exit code."""
    results, unread = [], False

    # a file is mended before it is checked
    def mend_and_check(asked: tuple[str, bool, bool]) -> Checked:
        """In this process, behind the repair."""
        try:
            changes = {"fixed": _mend_file(console, asked[0])} if fix else {}
        except OSError as error:
            return Checked(unread=classify(error)[1])
        except ModelError as error:
            return Checked(tuple(error.diagnostics))
        found = file_checked(asked)
        return found if found.result is None else replace(found, result=found.result | changes)

    asked = [(path, refused, console.explain) for path in files]
    # in processes, in the order of the files
    for path, found in zip(
        files, each(file_checked, asked, 1 if fix or "-" in files else jobs, mend_and_check), strict=True
    ):
        # a process that died is no finding
        if isinstance(found, Lost):
            raise RuntimeError(f"the process that checked {path} died ({found.how})")
        console.report.extend(found.found)
        for said, text in found.said:
            (console.data if said == "data" else console.say)(text)
        results += [] if found.result is None else [found.result]
        # a file that cannot be read
        if found.unread is not None:
            unread = True
            console.complain(found.unread, INPUT_OUTPUT)
    console.result = {"files": results}
    wrong = {d.place.file for d in console.report if d.severity == "error" and d.place is not None}
    console.summary = f" in {len(wrong)} of {len(files)} files" if len(files) > 1 else ""
    warned = any(d.severity == "warning" for d in console.report)
    return console.finish(INPUT_OUTPUT if unread else 1 if strict and warned else 0)


def _mend_file(console: Console, path: str) -> list[dict[str, object]]:
    """Mend a file in place; the findings that were mended."""
    from sysdyn.cli import whole_files
    from sysdyn.cli.commands.model.fmt_command import difference
    from sysdyn.cli.run.check.mending import mend
    from sysdyn.dsl.text.diagnostics import SourceText
    from sysdyn.dsl.text.source import real

    source = SourceText.read(path)
    text, done = mend(source)
    if done:
        whole_files.replace(real(Path(path)), text)
        if console.format is None:
            console.data("".join(difference(source, text, "fixed")), verbatim=True)
        console.say(f"{path}: {len(done)} of its findings mended")
    return [d.to_json() for d in done]


def _form(console: Console, chosen: str | None, files: tuple[str, ...]) -> None:
    """Let the console show findings in the form asked for."""
    # the page for people, unless --json is given
    if chosen is None or chosen == "full":
        if chosen and console.as_json:
            raise UsageError("--json and --output-format full: one of them")
        return
    if chosen != "json" and console.as_json:
        raise UsageError(f"--json and --output-format {chosen}: one of them")
    if chosen == "json":
        console.as_json = True
        return
    from sysdyn.cli.page import finding_formats

    # junit alone needs the names of files: those without findings pass
    forms = {"concise": finding_formats.concise, "github": finding_formats.github, "sarif": finding_formats.sarif}
    console.format = forms.get(chosen) or (lambda found, plain: finding_formats.junit(found, plain, files))
