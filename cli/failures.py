"""From an exception to a message and an exit code: the only place that knows both."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import traceback
from collections.abc import Iterable, Sequence
from pathlib import Path

import click
from sysdyn.cli.streams import flush, silence

USAGE, SOLVER, FAULT, INPUT_OUTPUT, INTERRUPTED = 2, 3, 4, 5, 130
OF_RUNS = ("E920", "E921", "E930", "E931", "E932", "E933", "E934")
"""Findings of a run that stopped or is not met."""
OF_CLAIMS = ("E907", "E909")
"""Findings of what a scene expects of its run."""
_PRECEDENCE = (INTERRUPTED, FAULT, INPUT_OUTPUT, USAGE, SOLVER, 1, 0)
"""Of exits that hold together, the one that counts first."""


def worst(codes: Iterable[int]) -> int:
    """The exit that counts of several; 0 of none."""
    return min(codes, key=_PRECEDENCE.index, default=0)


class UsageError(click.UsageError):
    """Wrong usage that is found after the options are read."""


def instead(name: str, known: Iterable[str], listed: Sequence[str] | None = None) -> str:
    """What may be meant by a name that there is not: the nearest of those known, else all (or those listed)."""
    from sysdyn.dsl.names.symbols import nearest

    names = list(known)
    near = nearest(name, names)
    return f"nearest: '{near}'" if near else f"there are: {', '.join(names if listed is None else listed) or 'none'}"


def report_failure(error: BaseException, arguments: Sequence[str]) -> int:
    """Print what went wrong (as JSON where asked for) and return the exit code; where that cannot be printed either,
    the code of input and output.
    """
    if isinstance(error, SystemExit):
        if isinstance(error.__context__, BrokenPipeError):  # click's own way
            return 0
        return error.code if isinstance(error.code, int) else 1
    code, message = classify(error)
    try:
        _say(error, code, message, arguments)
        flush()
    except OSError as other:
        silence()
        with contextlib.suppress(OSError):
            print(f"sysdyn: {classify(other)[1]}", file=sys.stderr, flush=True)
        return code if code in (INTERRUPTED, FAULT) else INPUT_OUTPUT
    return code


def _say(error: BaseException, code: int, message: str, arguments: Sequence[str]) -> None:
    """Print what ended the command: as JSON where that was asked for, else a line for a reader."""
    if type(error).__name__ == "NoArgsIsHelpError":  # `sysdyn` alone: the message is the help
        print(message, file=sys.stderr)
        return
    # also where the command line could not be read
    if "--json" in arguments or _asks_for_json(arguments):
        command = next((a for a in arguments if not a.startswith("-")), None)
        print(json.dumps(envelope(command, code, [plain(message, code)], {})))
    # no error: the user ended it
    elif code == INTERRUPTED:
        print("interrupted", file=sys.stderr)
    else:
        print(printable_message(f"sysdyn: {message}"), file=sys.stderr)
        if isinstance(error, click.UsageError) and error.ctx is not None:
            print(f"try '{error.ctx.command_path} --help'", file=sys.stderr)
    # a traceback for those who look for the fault
    if code == FAULT and os.environ.get("SYSDYN_DEBUG"):
        traceback.print_exception(error)


def _asks_for_json(arguments: Sequence[str]) -> bool:
    """`--output-format json`, however it is spelled."""
    joined = "\0".join(arguments)
    return "--output-format\0json" in joined or "--output-format=json" in joined


def classify(error: BaseException) -> tuple[int, str]:
    """Exit code and message."""
    if _is_interruption(error):
        return INTERRUPTED, "interrupted"
    # wrong options
    if isinstance(error, click.UsageError):
        return USAGE, error.format_message()
    if isinstance(error, click.ClickException):
        return INPUT_OUTPUT, error.format_message()
    # `| head`: no error
    if isinstance(error, BrokenPipeError):
        silence()
        return 0, "the reader of the output went away"
    # files
    if isinstance(error, OSError):
        name = f"{error.filename}: " if error.filename else ""
        return INPUT_OUTPUT, f"{name}{error.strerror or error}"
    # the run is too large for this machine
    if isinstance(error, MemoryError):
        return SOLVER, ": ".join(filter(None, ("there is no memory left", str(error))))
    if type(error).__name__ == "TraceError":
        return INPUT_OUTPUT, str(error)
    # anything else is ours
    how = f"{_where(error)}SYSDYN_DEBUG=1 shows the way there; please report it with the model"
    return FAULT, f"a fault in sysdyn: {type(error).__name__}: {error} ({how})"


def _is_interruption(error: BaseException | None) -> bool:
    """By Ctrl-C, which Python wraps into an error of its own where it falls into the making of a class."""
    while error is not None:
        if isinstance(error, (KeyboardInterrupt, click.Abort)):
            return True
        error = error.__cause__
    return False


def _where(error: BaseException) -> str:
    """The innermost line on the way to an exception."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith("<")]
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}; " if frames else ""


def printable_message(message: str) -> str:
    """A message for a terminal: names of files, models and data sets may hold control characters."""
    from sysdyn.dsl.text.render import printable

    return "\n".join(printable(line) for line in message.split("\n"))


def plain(message: str, code: int) -> dict[str, object]:
    """A finding without a place in a text."""
    kinds = {USAGE: "usage", SOLVER: "solver", FAULT: "fault", INPUT_OUTPUT: "input_output", INTERRUPTED: "interrupted"}
    fields = dict.fromkeys(("help", "file", "line", "column", "end_line", "end_column"))
    return {"code": kinds.get(code, "error"), "severity": "error", "message": message, **fields, "related": []}


def envelope(command: str | None, code: int, diagnostics: Sequence[object], result: object) -> dict[str, object]:
    """The object that --json prints, version 1."""
    return {
        "version": 1,
        "command": command,
        "ok": code == 0,
        "exit": code,
        "diagnostics": list(diagnostics),
        "result": result,
    }
