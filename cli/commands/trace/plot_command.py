"""`sysdyn plot`: quantities of traces over time, as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.page.columns import terminal
from sysdyn.cli.page.figure_sources import destination, label, open_trace, quantities

if TYPE_CHECKING:
    from sysdyn.runtime.trace.trace import Trace

KINDS = (".png", ".svg", ".html")
WIDTH = 100
"""Columns of a summary that goes to no terminal."""


@with_console("plot")
@click.argument("trace")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("-o", "output", metavar="FILE.png|.svg|.html", help="Default: the trace's name with .png, here.")
def command(console: Console, trace: str, names: tuple[str, ...], output: str | None) -> int:
    """Draw quantities of TRACE over time: those named, or all of them.

    Further traces may follow TRACE (names of existing .h5 files): they are drawn over the first.
    audit/energy and audit/constraints are the meters of the run. An .html zooms: wheel, drag, double click. Without -o
    a summary goes to standard output too: one line a quantity.
    """
    files = [trace, *(name for name in names if _is_trace(name))]
    wanted = list(dict.fromkeys(name for name in names if not _is_trace(name)))
    traces = [(label(file), open_trace(file)) for file in files]
    target, kind = destination(trace, output, console, KINDS, "a picture")
    drawn = quantities([t for _, t in traces], wanted)
    data = _drawn(traces, drawn, kind)
    if output is None and not console.quiet:
        from sysdyn.cli.page.sparkline import summary

        console.data(summary(traces, drawn, terminal() or WIDTH))
    whole_files.write(target, data)
    if target != "-":
        console.say(f"{target}: {', '.join(drawn)}")
    console.result = {"picture": target, "traces": files, "quantities": drawn}
    return console.finish()


def _drawn(traces: list[tuple[str, Trace]], names: list[str], kind: str) -> bytes:
    if kind == ".html":
        from sysdyn.cli.page.plots import page

        titles = dict.fromkeys(str(t.attributes.get("title", label)) for label, t in traces)
        return page(" and ".join(titles), traces, names).encode()
    from sysdyn.cli.page.picture import picture  # matplotlib: half a second that a wrong name need not wait for

    return picture(traces, names, kind.removeprefix("."))


def _is_trace(name: str) -> bool:
    return name.endswith(".h5") and Path(name).is_file()
