"""Traces of files compared: from two paths to a verdict, and a verdict as text, as JSON and as JUnit."""

from __future__ import annotations

import contextlib
import math
import sys
import tempfile
from collections.abc import Iterator
from typing import Any

from sysdyn.cli.page.columns import align
from sysdyn.cli.page.unit_text import conversion
from sysdyn.runtime.comparison.compare import compare
from sysdyn.runtime.comparison.curve import Floats
from sysdyn.runtime.comparison.recorded import Recorded
from sysdyn.runtime.comparison.verdict import About, Compared, Source, Tolerance, TraceEvent, Verdict
from sysdyn.runtime.trace.opening import regular
from sysdyn.values import dataclass

SHOWN = 20
"""Quantities within their limit that the table lists."""


@contextlib.contextmanager
def open_trace(file: str) -> Iterator[Recorded]:
    """A trace of a file, or of standard input where it is '-'.  Raises TraceError, OSError, Incomparable."""
    if file != "-":
        regular(file)  # a plainer message than HDF5's where there is none
        with Recorded(file) as trace:
            yield trace
        return
    with tempfile.NamedTemporaryFile(suffix=".h5") as copy:
        copy.write(sys.stdin.buffer.read())
        copy.flush()
        with Recorded(copy.name, "<stdin>") as trace:
            yield trace


def differences(ref: Source, test: Source, tolerance: Tolerance) -> Verdict:
    """The verdict, units converted where their dimensions agree.  Raises Incomparable."""
    return compare(ref, test, tolerance, conversion)


@dataclass(frozen=True, slots=True)
class Common:
    """A source of which only some quantities are seen."""

    whole: Source
    quantities: dict[str, About]

    @property
    def time(self) -> Floats:
        """Instants."""
        return self.whole.time

    @property
    def time_unit(self) -> str:
        """Unit of time."""
        return self.whole.time_unit

    @property
    def events(self) -> tuple[TraceEvent, ...]:
        """Events."""
        return self.whole.events

    def read(self, name: str, first: int, last: int) -> tuple[Floats, Floats | None]:
        """Rows first..last-1."""
        return self.whole.read(name, first, last)


def common(source: Source, names: set[str]) -> Source:
    """The quantities of these names alone."""
    return Common(source, {name: about for name, about in source.quantities.items() if name in names})


# ---- text


def headline(verdict: Verdict) -> str:
    """One line: the worst, when, how many times over the limit."""
    worst = verdict.worst
    if worst is None:
        return "equal"
    if verdict.equal:
        count = len(verdict.quantities)
        where = f"nearest to its limit {worst.name}{_time_text(worst)}, {worst.worst.ratio:.2g} of it"
        return f"equal: {count} quantit{'y' if count == 1 else 'ies'}; {where}"
    return f"differs: {sentence(worst)}"


def sentence(c: Compared) -> str:
    """What is wrong with one quantity."""
    w = c.worst
    match c.status:
        # beyond the tube
        case "differs":
            unit = "" if c.unit == "1" else f" {c.unit}"
            values = f"{w.test:.9g}{unit}, reference {w.reference:.9g}{unit}, limit {c.limit:.3g}{unit}"
            return f"{c.name}{_time_text(c)} is {_times(w.ratio)} over the limit: {values}" + (c.note and f"; {c.note}")
        # another span, or other events
        case "coverage" | "events":
            over = f", {_times(w.ratio)} over the limit" if math.isfinite(w.ratio) else ""
            return f"{c.name}: {c.note}{over}"
        # one has it and the other does not; another unit; not finite
        case _:
            words = {"unit": "is of another unit", "nonfinite": "cannot be within a limit"}
            word = words.get(c.status, f"is {c.status}")
            return f"{c.name}{_time_text(c)} {word}: {c.note}"


def table(verdict: Verdict, shown: int = SHOWN) -> str:
    """All that differs and the quantities nearest to their limits, aligned."""
    differing = [c for c in (*verdict.traces, *verdict.quantities) if not c.equal]
    equal = [c for c in verdict.quantities if c.equal]
    rows: list[tuple[str, ...]] = [
        ("quantity", "verdict", "times limit", "at [s]", "reference", "test", "limit", "unit")
    ]
    rows += [_row(c) for c in (*differing, *equal[:shown])]
    lines = [align(rows, right=range(2, 7))]
    if len(equal) > shown:
        lines.append(f"... {len(equal) - shown} more within their limits")
    lines += [f"note: {note}" for note in verdict.notes]
    lines.append(
        f"limit: {verdict.atol:g} + {verdict.rtol:g} x nominal within {verdict.tau:.3g} s, "
        f"{verdict.points[0]} and {verdict.points[1]} instants"
    )
    return "\n".join(lines)


def _row(c: Compared) -> tuple[str, ...]:
    w = c.worst

    def number(value: float, digits: int) -> str:
        return "-" if math.isnan(value) and c.status != "nonfinite" else f"{value:.{digits}g}"

    ratio = "no limit" if math.isinf(w.ratio) else f"{w.ratio:.3g}"
    values = number(w.reference, 9), number(w.test, 9)
    time = "-" if math.isnan(w.time) else f"{w.time:.6g}"
    return c.name, c.status, ratio, time, *values, "-" if math.isnan(c.limit) else f"{c.limit:.3g}", c.unit


def _time_text(c: Compared) -> str:
    return "" if math.isnan(c.worst.time) else f" at {c.worst.time:.9g} s"


def _times(ratio: float) -> str:
    if math.isinf(ratio):
        return "infinitely"
    return f"{ratio:.3g} times" if ratio >= 1.1 else f"{ratio:.6g} times"


# ---- data


def as_json(verdict: Verdict) -> dict[str, Any]:
    """The `result` of --json; a ratio of null has no limit that would allow it."""
    worst = verdict.worst
    return {
        "equal": verdict.equal,
        "worst": None
        if worst is None
        else {"variable": worst.name, "time": worst.worst.time, "ratio": worst.worst.ratio, "status": worst.status},
        "variables": [_object(c) for c in verdict.quantities],
        "traces": [_object(c) for c in verdict.traces],
        "tolerance": {"rtol": verdict.rtol, "atol": verdict.atol, "tau": verdict.tau},
        "span": list(verdict.span),
        "points": list(verdict.points),
        "notes": list(verdict.notes),
    }


def _object(c: Compared) -> dict[str, Any]:
    """A compared quantity as an object of --json."""
    w = c.worst
    return {
        "name": c.name,
        "status": c.status,
        "equal": c.equal,
        "ratio": w.ratio,
        "time": w.time,
        "reference": w.reference,
        "test": w.test,
        "limit": c.limit,
        "nominal": c.nominal,
        "unit": c.unit,
        "note": c.note,
    }


def cases(verdict: Verdict) -> list[tuple[str, str | None]]:
    """(name, what is wrong or None) of each quantity and of the traces as a whole."""
    return [(c.name, None if c.equal else sentence(c)) for c in (*verdict.traces, *verdict.quantities)]
