"""Where the runs of one simulation keep their rows: in the trace's file, or in memory.

In a file the first run streams into the trace itself; a finer run into a neighbour `.NAME.part` that takes its place
when it is finished: whatever is killed, a readable trace stands at the path.  Of a finished run that a finer one
follows at once, the last second waits in memory.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.trace.claim import claim_trace
from sysdyn.runtime.trace.interruptions import defer_interruptions
from sysdyn.runtime.trace.opening import destination
from sysdyn.runtime.trace.trace import Quantity, Trace
from sysdyn.runtime.trace.trace_store import BEFORE, Layout, clear, input_output
from sysdyn.runtime.trace.writing import Met, TraceWriter

Attributes = Mapping[str, str | float | int]


class Writer(Protocol):
    """A trace being written; see TraceWriter."""

    closed: bool

    def append(self, rows: Floats) -> None:
        """Takes rows [k, 8 + 2 observed]."""

    def flush(self) -> None:
        """All rows so far stand in the trace."""

    def seen(self) -> dict[str, float]:
        """Largest magnitude of each stored quantity."""

    def ranges(self) -> dict[str, float]:
        """Largest less least value of each stored quantity."""

    def first_undefined(self) -> tuple[str, float] | None:
        """The first quantity that is no number, or infinite, and when [s]."""

    def finish(
        self, nominal: Mapping[str, float], attributes: Attributes, final: bool, events: Sequence[Happened] = ()
    ) -> None:
        """Nominal values, last attributes, `final`, events."""

    def discard(self) -> None:
        """Closes without more ado."""


class HeldWriter:
    """A trace that is written in memory; `trace` once it is finished."""

    def __init__(self, layout: Layout) -> None:
        self._layout, self._met = layout, Met(layout.columns)
        self._rows: list[Floats] = []
        self._asked = 0
        self.closed = False
        self.trace: Trace | None = None

    def append(self, rows: Floats) -> None:
        """Takes rows [k, 8 + 2 observed]."""
        if rows.size:
            self._rows.append(rows)

    def flush(self) -> None:
        """There is nothing behind."""

    def seen(self) -> dict[str, float]:
        """Largest magnitude of each stored quantity."""
        return self._taken_rows().largest()

    def ranges(self) -> dict[str, float]:
        """Largest less least value of each stored quantity."""
        return self._taken_rows().ranges()

    def first_undefined(self) -> tuple[str, float] | None:
        """The first quantity that is no number, or infinite, and when [s]."""
        return self._taken_rows().undefined

    def _taken_rows(self) -> Met:
        """Of all rows so far: of runs that are not kept nobody asks."""
        # rows that came since the last time
        while self._asked < len(self._rows):
            self._met.take(self._rows[self._asked])
            self._asked += 1
        return self._met

    def finish(
        self, nominal: Mapping[str, float], attributes: Attributes, final: bool, events: Sequence[Happened] = ()
    ) -> None:
        """The trace as `Trace.open` would read it from a file."""
        if self.closed:
            return
        layout = self._layout
        width = BEFORE + 2 * layout.observed
        rows = np.concatenate(self._rows) if self._rows else np.zeros((0, width))
        data = {
            c.name: Quantity(
                c.name,
                rows[:, BEFORE + c.place].copy(),
                c.unit,
                float(nominal.get(c.name, 0.0)),
                rows[:, BEFORE + layout.observed + c.place].copy() if c.derivative else None,
            )
            for c in layout.columns
        }
        # the audit stands in the head of each row
        energy = Quantity("audit.energy", rows[:, 6].copy(), "J", self._taken_rows().turned_over, None)
        constraints = Quantity("audit.constraints", rows[:, 7].copy(), "1", None, None)
        data |= {"audit.energy": energy, "audit.constraints": constraints}
        known = {**layout.attributes, **attributes, "final": int(final)}
        parameters = {p.name: (p.value, p.unit) for p in layout.parameters}
        self.trace = Trace("", rows[:, 0].copy(), known, parameters, data, tuple(events))
        self.discard()

    def discard(self) -> None:
        """The rows are let go."""
        self.closed, self._rows = True, []


class MemoryKeeping:
    """Runs that keep their rows in memory."""

    path: Path | None = None

    @contextlib.contextmanager
    def claim(self) -> Iterator[None]:
        """Nobody else can see it."""
        yield

    def writer(self, layout: Layout, first: bool) -> HeldWriter:
        """Of the next run."""
        return HeldWriter(layout)

    def take(self, writer: Writer, before: Writer) -> None:
        """A finished run takes the place of the one before it."""
        before.discard()

    def drop(self, writer: Writer) -> None:
        """A run failed beside one that is finished."""
        writer.discard()


class Files:
    """Runs that keep their rows in the trace at a path."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        with input_output(self.path):
            self._target = destination(self.path)
        self._part = self._target.with_name(f".{self._target.name}.part")

    @contextlib.contextmanager
    def claim(self) -> Iterator[None]:
        """Holds the trace for this process, without what killed runs left beside it."""
        with claim_trace(self._target):
            self._clear()
            try:
                yield
            finally:  # of a writer that was interrupted while it was made nobody else knows
                with defer_interruptions():
                    self._clear()

    def _clear(self) -> None:
        for place in (self._target, self._part):
            clear(place)

    def writer(self, layout: Layout, first: bool) -> TraceWriter:
        """Of the next run; first: into the trace itself."""
        return TraceWriter(self._target if first else self._part, layout, shown=first)

    def take(self, writer: Writer, before: Writer) -> None:
        """A finished run's file takes the trace's name; it keeps writing its last attributes to it."""
        assert isinstance(writer, TraceWriter)
        before.discard()
        writer.path.replace(self._target)
        writer.path = self._target

    def drop(self, writer: Writer) -> None:
        """A run failed beside one that is finished, whose trace stays."""
        assert isinstance(writer, TraceWriter)
        writer.discard()
        with contextlib.suppress(OSError):
            writer.path.unlink()


Keeping = Files | MemoryKeeping


def keeping(output: str | Path | None) -> Keeping:
    """In memory where there is no path."""
    return MemoryKeeping() if output is None else Files(output)
