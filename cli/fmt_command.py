"""`sysdyn fmt`: the canonical layout of model texts."""

from __future__ import annotations

import difflib
import os
import sys
import tempfile
from pathlib import Path

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.dsl.decoding import decode
from sysdyn.dsl.diagnostics import SourceText
from sysdyn.dsl.format import format_text
from sysdyn.dsl.parse import parse


@with_console("fmt")
@click.argument("files", nargs=-1, required=True)
@click.option("--check", is_flag=True, help="Write nothing; exit 1 where a file is not in the canonical layout.")
@click.option("--diff", is_flag=True, help="Write nothing; print what would change.")
def command(console: Console, files: tuple[str, ...], check: bool, diff: bool) -> int:
    """Bring FILES into the canonical layout, in place ('-': from standard input to standard output).

    A file whose text has syntax errors is left as it is.
    """
    changed = []
    for name in files:
        source = decode("<stdin>", sys.stdin.buffer) if name == "-" else SourceText.read(name)
        tree, problems = parse(source)
        console.report.extend(problems)
        if any(d.severity == "error" for d in problems):
            continue
        text = format_text(tree)
        if text != source.text:
            changed.append(name)
        if diff:
            console.data("".join(_difference(source, text)))
        elif name == "-" and not check:
            console.data(text)
        elif text != source.text and not check:
            _replace(Path(name), text)
    for name in changed:
        console.say(f"{name}: {'not in the canonical layout' if check or diff else 'formatted'}")
    console.result = {"changed": changed}
    return console.finish(1 if check and changed else 0)


def _difference(source: SourceText, text: str) -> list[str]:
    before, after = source.text.splitlines(keepends=True), text.splitlines(keepends=True)
    return list(difflib.unified_diff(before, after, source.name, f"{source.name} (formatted)"))


def _replace(path: Path, text: str) -> None:
    """Write beside the file, then rename: a file is never half written."""
    target = path.resolve()
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=".", suffix=".sd")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as stream:
            stream.write(text)
        os.chmod(temporary, target.stat().st_mode)  # noqa: PTH101
        os.replace(temporary, target)  # noqa: PTH105
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
