"""What a picture is drawn of: traces by their files, quantities by their names."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from sysdyn.cli.failures import UsageError

if TYPE_CHECKING:
    from sysdyn.runtime.trace.trace import Trace


def label(file: str) -> str:
    """How a trace is called beside others."""
    return "stdin" if file == "-" else Path(file).stem


def opened(file: str) -> Trace:
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


def quantities(traces: list[Trace], wanted: list[str]) -> list[str]:
    """Names that are drawn, as the trace spells them."""
    from sysdyn.cli.page.panels import in_order

    known = in_order(dict.fromkeys(name for trace in traces for name in trace.names))
    if not wanted:
        if not known:
            raise UsageError(f"{traces[0].path} has no quantities: name a meter, audit/energy or audit/constraints")
        return known
    from sysdyn.dsl.names.symbols import nearest

    spelled = {name: name for name in known}
    for trace in traces:
        for meter in ("audit.energy", "audit.constraints"):
            if meter in trace:
                spelled |= {meter: meter, meter.replace(".", "/"): meter, "/" + meter.replace(".", "/"): meter}
    drawn = []
    for name in wanted:
        found = spelled.get(name) or spelled.get(name.replace("/", "\u2215"))
        if found is None:
            near = nearest(name, spelled)
            hint = f"nearest: '{near}'" if near else f"there are: {', '.join(known)}"
            raise UsageError(f"{traces[0].path} has no quantity '{name}'; {hint}")
        drawn.append(found)
    return list(dict.fromkeys(drawn))
