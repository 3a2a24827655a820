"""`sysdyn import`: a SPICE netlist as the text of a model."""

from __future__ import annotations

import sys

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import UsageError
from sysdyn.cli.spice.model_text import ModelTextWriter
from sysdyn.cli.spice.reading import Reader
from sysdyn.cli.spice.writing import format_fast
from sysdyn.dsl.text.decoding import decode
from sysdyn.dsl.text.diagnostics import SourceText


@with_console("import")
@click.argument("file")
@click.option("-o", "output", metavar="FILE.sd", help="Default: standard output.")
def command(console: Console, file: str, output: str | None) -> int:
    """Write the SPICE netlist FILE as a model text: components for subcircuits, a scene for .tran.

    R, C, L, K, V, I (DC, SIN, PULSE, PWL, EXP), D, Q and M of level 1, E, F, G, H (POLY too), X; .param, .model,
    .subckt, .global, .ic, .temp, .options, and .include of its own folder. What cannot be said is an error with its
    line; what a model has beyond it a warning.
    """
    # `-o -` is standard output, which is the default
    output = None if output == "-" else output
    if output is not None and not output.endswith(".sd"):
        raise UsageError(f"-o {output}: a model's text ends in .sd")
    source = decode("stdin", sys.stdin.buffer) if file == "-" else SourceText.read(file)
    reader = Reader(source, console.report)
    text = ModelTextWriter(reader.netlist, source, console.report).text()
    if console.report.failed:
        return console.finish(1)
    text = format_fast(text)
    console.result = {"text": text, "output": output}
    # the text itself; else a file, and a line that says so
    if output is None:
        console.data(text, verbatim=True)
    else:
        whole_files.write(output, text)
        console.say(f"{output}: {reader.netlist.title or file}")
    return console.finish()
