"""What a picture is drawn of, traces by their files and quantities by their names, and the file that it goes to."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sysdyn.cli.failures import UsageError, instead
from sysdyn.names import trace_name

if TYPE_CHECKING:
    from sysdyn.cli.console import Console
    from sysdyn.runtime.trace.trace import Trace


def label(file: str) -> str:
    """How a trace is called beside others."""
    return "stdin" if file == "-" else Path(file).stem


def destination(trace: str, output: str | None, console: Console, kinds: tuple[str, ...], what: str) -> tuple[str, str]:
    """Where it goes and its kind, by default the trace's name with the first one, here; UsageError of any other kind.

    kinds: ends of names, with the dot; what: this command makes, as a message says.
    """
    # standard output has no end of a name: the first kind
    if output == "-":
        if console.as_json:
            raise UsageError("-o - and --json both want standard output")
        return output, kinds[0]
    target = Path(output) if output is not None else Path(f"{label(trace)}{kinds[0]}")
    if target.suffix.lower() not in kinds:
        raise UsageError(f"'{target}': {what} is one of {', '.join(kinds)}")
    return str(target), target.suffix.lower()


def open_trace(file: str) -> Trace:
    """The trace of a file, or of standard input."""
    from sysdyn.runtime.trace.opening import regular
    from sysdyn.runtime.trace.trace import Trace

    if file != "-":
        regular(file)  # a plainer message than HDF5's where there is none
        return Trace.open(file)
    with tempfile.NamedTemporaryFile(suffix=".h5") as copy:
        copy.write(sys.stdin.buffer.read())
        copy.flush()
        return Trace.open(copy.name)


def no_quantity(trace: Trace, name: str, known: Iterable[str], listed: Sequence[str]) -> str:
    """That a trace has none of that name; known: those that may be meant."""
    return f"{trace.path} has no quantity '{name}'; {instead(name, known, listed)}"


def quantities(traces: list[Trace], wanted: list[str]) -> list[str]:
    """Names that are drawn, as the trace spells them."""
    from sysdyn.cli.page.panels import in_order

    known = in_order(dict.fromkeys(name for trace in traces for name in trace.names))
    # all that was traced
    if not wanted:
        if not known:
            raise UsageError(f"{traces[0].path} has no quantities: name a meter, audit/energy or audit/constraints")
        return known
    spelled = {name: name for name in known}
    # ledgers under either spelling
    for trace in traces:
        for meter in ("audit.energy", "audit.constraints"):
            if meter in trace:
                spelled |= {meter: meter, meter.replace(".", "/"): meter, "/" + meter.replace(".", "/"): meter}
    drawn = []
    # as the trace spells it, once each
    for name in wanted:
        found = spelled.get(name) or spelled.get(trace_name(name))
        if found is None:
            raise UsageError(no_quantity(traces[0], name, spelled, known))
        drawn.append(found)
    return list(dict.fromkeys(drawn))
