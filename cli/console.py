"""What a command shows: diagnostics and messages on standard error, data or one JSON object on standard output."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import click
from sysdyn.cli.failures import OF_RUNS, SOLVER, USAGE, envelope, plain, printable_message, worst
from sysdyn.cli.progress import RUN, ProgressLine
from sysdyn.cli.streams import put
from sysdyn.dsl.text.diagnostics import Diagnostic, Edit, ModelError, Report, limit_findings

WHEN = ("auto", "always", "never")
ROUTINE = ("N501", "N601", "N602", "N603", "N604")
ALWAYS = ("W921",)
"""Shown under --quiet too: a file that somebody relies on is not read."""

F = TypeVar("F", bound=Callable[..., Any])


class Console:
    """The output of one command."""

    def __init__(self, command: str, *, as_json: bool, quiet: bool, color: str) -> None:
        self.command = command
        self.as_json = as_json
        self.quiet = quiet
        plain = bool(os.environ.get("NO_COLOR")) or not sys.stderr.isatty()
        self.color = color == "always" or (color == "auto" and not plain)
        self.report = Report()
        self.explain = False
        self.summary = ""
        """Behind the number of errors: where they are, of several files."""
        self.format: Callable[[Sequence[Diagnostic], Sequence[dict[str, object]]], str] | None = None
        """Another form of the findings (those of texts, those without a place), for standard output."""
        self.result: dict[str, Any] = {}
        self._plain: list[dict[str, object]] = []
        self._results: list[tuple[str, bool]] = []

    def renew(self) -> None:
        """Forget what was found: another round begins."""
        self.report = Report()
        self.result = {}
        self._plain = []
        self._results = []

    def progress(self, mode: str = "auto", ahead: str = RUN) -> ProgressLine:
        """A progress line, of which a quiet command shows nothing; mode: of --progress; ahead: what takes long."""
        return ProgressLine("never" if self.quiet else mode, ahead)

    def say(self, message: str) -> None:
        """A message for the person at the terminal."""
        if not (self.quiet or self.as_json):
            put(printable_message(message) + "\n", "stderr")

    def complain(self, message: str, code: int, found: dict[str, Any] | None = None) -> None:
        """A message with the exit code that it leads to; --quiet does not silence it.

        found: of one run among several, what its finding says to --json: code, place and help.
        """
        self._plain.append(plain(message, code) if found is None else {**found, "message": message})
        if not (self.as_json or self.format):
            put(printable_message(f"sysdyn: {message}") + "\n", "stderr")

    def data(self, text: str, *, verbatim: bool = False) -> None:
        """Data that was asked for; verbatim: the user's own text, which may go to a file."""
        if not self.as_json and text:
            text = text if verbatim and not sys.stdout.isatty() else printable_message(text)
            put(text if text.endswith("\n") else text + "\n")

    def results(self, text: str, *, verbatim: bool = False) -> None:
        """What a command came to; under --quiet only where it is the reason for an exit other than 0."""
        if self.quiet:
            self._results.append((text, verbatim))
        else:
            self.data(text, verbatim=verbatim)

    def finish(self, code: int = 0) -> int:
        """Show the findings; the exit code (1 where there are errors)."""
        found = limit_findings(self.report.diagnostics)
        # an error in what was typed is a wrong usage, one in a file is not
        if self.report.failed:
            typed = any(d.severity == "error" and d.place and d.place.source.typed for d in self.report)
            code = worst((code or 1, USAGE if typed else 0))
        # results that were held back until it was clear how it ends
        for text, verbatim in self._results if code else ():
            self.data(text, verbatim=verbatim)
        # one object, whatever happened
        if self.as_json:
            diagnostics = [*(d.to_json() for d in found), *self._plain]
            if self.command == "check":
                self.result["edits"] = [edit_to_json(k, d.edit) for k, d in enumerate(found) if d.edit is not None]
            put(json.dumps(finite(envelope(self.command, code, diagnostics, self.result)), allow_nan=False) + "\n")
        # a form for other programs
        elif self.format is not None:
            kept = [d for d in found if d.severity == "error" or not (self.quiet or self._routine(d))]
            self.data(self.format(kept, self._plain), verbatim=True)
        else:
            self._render(found)
        return code

    def unable(self) -> int:
        """`finish` where the findings say why there is no result; a run that stopped is no error of the model."""
        stopped = any(d.severity == "error" and d.code in OF_RUNS for d in self.report)
        return self.finish(SOLVER if stopped else 1)

    def _routine(self, diagnostic: Diagnostic) -> bool:
        """Notes on what the compiler did by rule: for --json, and for whoever asks by --explain."""
        return diagnostic.code in ROUTINE and not self.explain

    def _render(self, found: Iterable[Diagnostic]) -> None:
        from sysdyn.dsl.text.render import render

        shown = [d for d in found if d.severity == "error" or d.code in ALWAYS or not (self.quiet or self._routine(d))]
        for diagnostic in shown:
            put(render(diagnostic, color=self.color) + "\n", "stderr")
        errors = sum(d.severity == "error" for d in self.report)
        if errors > 1 or (errors and self.summary):
            put(f"{errors} error{'s' * (errors > 1)}{self.summary}\n", "stderr")


def edit_to_json(number: int, edit: Edit) -> dict[str, object]:
    """A change of the text that mends a finding, by the finding's place in `diagnostics`; `--fix` makes the same."""
    (line, column), (end_line, end_column) = edit.place.start, edit.place.end
    place = {"file": edit.place.file, "line": line, "column": column, "end_line": end_line, "end_column": end_column}
    return {"diagnostic": number, **place, "text": edit.text}


def finite(value: Any) -> Any:
    """A value of JSON: infinities and what is not a number become null."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def with_console(name: str) -> Callable[[F], Callable[..., Any]]:
    """Add --json, --quiet and --color; the command receives a Console and returns the exit code."""

    def decorate(function: F) -> Callable[..., Any]:
        @click.option("--json", "as_json", is_flag=True, help="Print one JSON object (version 1).")
        @click.option("-q", "--quiet", is_flag=True, help="Errors only.")
        @click.option("--color", type=click.Choice(WHEN), default="auto", help="Coloured messages.")
        def command(as_json: bool, quiet: bool, color: str, **options: Any) -> int:
            console = Console(name, as_json=as_json, quiet=quiet, color=color)
            try:
                code = function(console, **options)
            except ModelError as error:
                console.report.extend(error.diagnostics)
                return console.finish(1)
            assert isinstance(code, int)
            return code

        command.__doc__ = function.__doc__
        # click lists decorators from the inside out: the function's own options stand before these three
        command.__dict__["__click_params__"] += getattr(function, "__click_params__", [])
        return click.command(name)(command)

    return decorate
