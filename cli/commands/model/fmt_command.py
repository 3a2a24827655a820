"""`sysdyn fmt`: the canonical layout of model texts."""

from __future__ import annotations

import difflib
import sys
from pathlib import Path

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import INPUT_OUTPUT, classify
from sysdyn.dsl.format.format import format_text
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.decoding import decode
from sysdyn.dsl.text.diagnostics import SourceText
from sysdyn.dsl.text.source import real


@with_console("fmt")
@click.argument("files", nargs=-1, required=True)
@click.option("--check", is_flag=True, help="Write nothing; exit 1 where a file is not in the canonical layout.")
@click.option("--diff", is_flag=True, help="Write nothing; print what would change.")
def command(console: Console, files: tuple[str, ...], check: bool, diff: bool) -> int:
    """Bring FILES into the canonical layout, in place ('-': from standard input to standard output).

    A file whose text has syntax errors is left as it is.
    """
    changed, unread = [], False
    for name in files:
        try:
            differs = _one(console, name, check=check, diff=diff)
        except OSError as error:
            unread = True
            console.complain(classify(error)[1], INPUT_OUTPUT)
            continue
        if differs:
            changed.append(name)
            console.say(f"{name}: {'not in the canonical layout' if check or diff else 'formatted'}")
    console.result = {"changed": changed}
    return console.finish(INPUT_OUTPUT if unread else 1 if check and changed else 0)


def _one(console: Console, name: str, *, check: bool, diff: bool) -> bool:
    """Whether a file is in another layout; it is brought into the canonical one, unless that was not asked for."""
    source = decode("<stdin>", sys.stdin.buffer) if name == "-" else SourceText.read(name)
    tree, problems = parse(source)
    console.report.extend(problems)
    # a text that cannot be read has no layout
    if any(d.severity == "error" for d in problems):
        return False
    text = format_text(tree)
    if diff:
        console.data("".join(difference(source, text)), verbatim=True)
    # standard input comes out on standard output
    elif name == "-" and not check:
        console.data(text, verbatim=True)
    # a file that is in layout keeps its time of change
    elif text != source.text and not check:
        whole_files.replace(real(Path(name)), text)
    return text != source.text


def difference(source: SourceText, text: str, what: str = "formatted") -> list[str]:
    """The lines of a unified diff from a file to what is made of it."""
    before, after = source.text.splitlines(keepends=True), text.splitlines(keepends=True)
    return list(difflib.unified_diff(before, after, source.name, f"{source.name} ({what})"))
