"""A trace being written: HDF5 as `sysdyn help traces` lays it down, streamed, readable after kill -9 at any moment.

Rows wait in memory and go to the file together once a second (or when there are many).  Measured: a kill within an
HDF5 flush leaves a file whose chunks lie behind its end, so no file is ever written under the trace's own name: see
TraceWriter.  The layout of the file is trace_store.py's.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.interruptions import defer_interruptions
from sysdyn.runtime.trace.opening import destination
from sysdyn.runtime.trace.trace_store import BEFORE, Column, Layout, Store, input_output

UNCHANGED = tuning.SAME
"""Part of the stored energy that is no energy turned over: its balance is round-off."""
FLUSH_SECONDS = 0.8
"""Flushed at least every second of wall time: rows arrive about every 50 ms."""
MANY = 1 << 20
"""Numbers that may wait in memory."""


class Met:
    """The largest of each stored quantity, and of the energies that went round, over the rows so far; undefined: the
    first quantity that was no number, or infinite, and when [s].
    """

    def __init__(self, columns: Sequence[Column]) -> None:
        self.columns = tuple(columns)
        self.turned_over = 0.0
        self._energies: Floats | None = None
        self.undefined: tuple[str, float] | None = None
        self._largest = np.zeros(len(self.columns))
        self._ends = np.full((2, len(self.columns)), np.nan)  # least, largest
        self._places = np.array([BEFORE + column.place for column in self.columns], dtype=np.intp)

    def take(self, rows: Floats) -> None:
        """Rows [k, 8 + 2 observed]."""
        self._energy(rows[:, 2:6])
        values = rows[:, self._places]
        size = np.abs(values)
        self._ends[0] = np.fmin(self._ends[0], np.fmin.reduce(values))
        self._ends[1] = np.fmax(self._ends[1], np.fmax.reduce(values))
        most = size.max(axis=0)
        self._largest = np.fmax(self._largest, most)
        # the first value that is no number, and when
        if self.undefined is None and not np.isfinite(most).all():
            k, place = np.argwhere(~np.isfinite(size))[0]
            self.undefined = self.columns[place].name, float(rows[k, 0])

    def _energy(self, rows: Floats) -> None:
        """Largest of kinetic energy, change of potential energy, energy dissipated and supplied (J).

        At least what round-off is beside the stored energy.
        """
        # energies are counted from the first row
        if self._energies is None:
            self._energies = np.array([0.0, rows[0, 1], 0.0, 0.0])
        with np.errstate(invalid="ignore", over="ignore"):  # energies beyond double precision: the ledger says so
            most = max(np.abs(rows - self._energies).max(), UNCHANGED * np.abs(rows[:, :2]).max())
        if np.isfinite(most):
            self.turned_over = max(self.turned_over, float(most))

    def largest(self) -> dict[str, float]:
        """Largest magnitude of each stored quantity."""
        return {column.name: float(s) for column, s in zip(self.columns, self._largest, strict=True)}

    def ranges(self) -> dict[str, float]:
        """Largest less least value of each stored quantity."""
        with np.errstate(invalid="ignore", over="ignore"):
            return dict(zip((c.name for c in self.columns), (self._ends[1] - self._ends[0]).tolist(), strict=True))


class TraceWriter:
    """A trace being written.  rows: [k, 8 + 2 observed] as core/run/run.h lays them down.

    Two stores stand beside the trace (.NAME.<token>.a, .b).  Each flush brings the one that is not visible up to date
    and then gives it the trace's name (hard link, rename): what bears the name is never being written.  Nor is what a
    reader still has open: a copy of the visible one takes its place.
    """

    def __init__(self, path: str | Path, layout: Layout, *, shown: bool = True) -> None:
        """shown: the trace stands at its path at once, else with its first flush."""
        self.path, self._layout = Path(path), layout
        self._waiting: list[Floats] = []
        self._late: list[Floats] = []  # rows that the hidden store lacks
        self._met = Met(self._layout.columns)
        self._numbers, self._flushed = 0, time.monotonic()
        self._visible: Store | None = None
        self._hidden: Store | None = None
        self.closed = False
        with input_output(self.path):
            self.path = destination(self.path)
            self._token = os.urandom(4).hex()
            # a first run is seen at once
            if shown:
                self._visible = self._store("a")
                self._publish(self._visible)

    def _store(self, which: str, like: Store | None = None) -> Store:
        return Store(self.path.with_name(f".{self.path.name}.{self._token}.{which}"), self._layout, like)

    def _publish(self, store: Store) -> None:
        """The trace's name for this store, in one step."""
        link = store.path.with_name(store.path.name + ".link")
        # a link that a killed run left
        with contextlib.suppress(FileNotFoundError):
            link.unlink()
        link.hardlink_to(store.path)
        link.replace(self.path)

    def append(self, rows: Floats) -> None:
        """Takes rows; writes and flushes when it is time."""
        if rows.size:
            self._waiting.append(rows)
            self._numbers += rows.size
            self._met.take(rows)
        # much is waiting, or the last time is long ago
        if self._numbers > MANY or time.monotonic() - self._flushed > FLUSH_SECONDS:
            self.flush()

    def seen(self) -> dict[str, float]:
        """Largest magnitude of each stored quantity."""
        return self._met.largest()

    def ranges(self) -> dict[str, float]:
        """Largest less least value of each stored quantity."""
        return self._met.ranges()

    def first_undefined(self) -> tuple[str, float] | None:
        """The first quantity that is no number, or infinite, and when [s]."""
        return self._met.undefined

    def flush(self) -> None:
        """All rows so far stand in the trace."""
        self._flushed = time.monotonic()
        # without new rows the trace stands as it is
        if self._waiting or self._visible is None:
            self._turn(None)

    def _turn(self, last: Mapping[str, Mapping[str, Any]] | None, events: Sequence[Happened] = ()) -> None:
        """The hidden store takes all rows (and last attributes, after which it is closed) and becomes visible.

        An interruption waits until that is done: half of it would be written twice.
        """
        with defer_interruptions():
            self._turned_rows(last, events)

    def _turned_rows(self, last: Mapping[str, Mapping[str, Any]] | None, events: Sequence[Happened]) -> None:
        """Writes the rows that wait to the hidden store and lets it take the trace's name; last: closing attributes."""
        new, self._waiting, self._numbers = self._waiting, [], 0
        try:
            with input_output(self.path):
                # somebody reads the hidden store: another one is made
                if self._hidden is not None and self._hidden.is_read():
                    self._drop_hidden()
                # a copy of the visible one
                if self._hidden is None:
                    self._hidden, self._late = self._store(self._other, like=self._visible), []
                rows = [*self._late, *new]
                # rows that it lacks, then those that came
                if rows:
                    self._hidden.append(np.concatenate(rows))
                # the last time: attributes and events too
                if last is not None:
                    self._hidden.close_with(last, events)
                self._publish(self._hidden)
        # no room: what fits is kept
        except TraceError as error:
            self._drop_hidden()
            kept = self._keep_what_fits(np.concatenate(new)) if new else 0
            self.discard()
            # the reader is told that the trace is not whole
            if kept:
                raise TraceError(f"{error} (the trace holds what fitted)") from error
            raise
        self._visible, self._hidden, self._late = self._hidden, self._visible, new

    @property
    def _other(self) -> str:
        """The suffix of the store that is not visible."""
        return "b" if self._visible and self._visible.path.suffix == ".a" else "a"

    def _drop_hidden(self) -> None:
        """The hidden store goes, and the room that it took with it."""
        if self._hidden is not None:
            self._hidden.abandon()
            with contextlib.suppress(OSError):
                self._hidden.path.unlink()
            self._hidden = None

    def _keep_what_fits(self, rows: Floats) -> int:
        """On a disk that is full: the first rows for which there is room reach the trace; their number."""
        count = int(rows.shape[0])
        # half of the rows, until some fit
        while count:
            store: Store | None = None
            try:
                with input_output(self.path):
                    store = self._hidden = self._store(self._other, like=self._visible)
                    store.append(rows[:count])
                    self._publish(store)
                return count
            except TraceError:
                self._drop_hidden()
                count //= 2
        return 0

    def finish(
        self,
        nominal: Mapping[str, float],
        attributes: Mapping[str, str | float | int],
        final: bool,
        events: Sequence[Happened] = (),
    ) -> None:
        """Nominal values, last attributes, `final`, events; closes the file.  One that was given up stays as it is."""
        if self.closed:
            return
        sizes = {column.name: {"nominal": float(nominal.get(column.name, 0.0))} for column in self._layout.columns}
        sizes["/audit/energy"] = {"nominal": self._met.turned_over}
        self._turn({**sizes, "/": {**attributes, "final": np.int64(final)}}, events)
        self.discard()

    def discard(self) -> None:
        """Closes without more ado; the trace stays as it was last flushed."""
        self.closed = True
        # names of stores go, the trace's own stays
        for store in (self._visible, self._hidden):
            if store is not None:
                store.close()
                with contextlib.suppress(OSError):
                    store.path.unlink()
        self._visible = self._hidden = None
