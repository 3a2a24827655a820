"""A trace in a file as a source of a comparison: rows are read when they are asked for."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from sysdyn.runtime.comparison.curve import Floats
from sysdyn.runtime.comparison.verdict import About, Incomparable, TraceEvent
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.opening import open_regular
from sysdyn.runtime.trace.trace_store import in_words

CACHE = 1 << 16
"""Bytes of chunks that HDF5 keeps of each open data set: its own default is 8 MB, and a trace has hundreds."""
EVENTS = 10_000_000
"""More are no list of events."""


class Recorded:
    """A trace of CONTRACT's layout, open for reading.  Raises TraceError (unreadable) and Incomparable (no trace)."""

    def __init__(self, path: str | Path, name: str | None = None) -> None:
        self.path = name or str(path)
        with self._faults():
            self._file: Any = open_regular(path, rdcc_nbytes=CACHE)
        try:
            with self._faults():
                self._layout()
        # a file that is no trace is closed again
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(Exception):
            self._file.close()

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        try:
            yield
        # faults of the library in words for the user
        except FileNotFoundError as error:
            raise TraceError(f"{self.path}: no such file") from error
        except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
            what = "not readable as a trace: "
            raise TraceError(f"{self.path}: {what}{in_words(error).removeprefix(what)}") from error

    def _layout(self) -> None:
        """Takes in what the file holds: time, quantities with their rates, events, attributes."""
        import h5py

        data = {name: self._file[name] for name in self._file}
        sets = {name: item for name, item in data.items() if isinstance(item, h5py.Dataset) and name != "events"}
        # any HDF5 file can be given: it may hold no trace
        if "time" not in sets:
            raise Incomparable(f"{self.path} has no data set 'time': not a trace")
        for name, item in sets.items():
            # tables and texts are no quantities
            if item.ndim != 1 or item.dtype.kind not in "fiu":
                raise Incomparable(f"{self.path}: '{name}' is no row of numbers")
        self._rates = {}
        # a quantity names the data set of its rates
        for name, item in sets.items():
            path = _text(item.attrs.get("derivative", ""))
            rate = self._file.get(path) if path else None
            if isinstance(rate, h5py.Dataset) and rate.ndim == 1 and rate.dtype.kind in "fiu":
                self._rates[name] = rate
        # a run that was killed may have flushed one row more of some of them
        length = min(item.shape[0] for item in (*sets.values(), *self._rates.values()))
        time = sets.pop("time")
        self.time: Floats = np.asarray(time[:length], dtype=np.float64)
        self.time_unit = _text(time.attrs.get("units", "s"))
        self._sets = sets
        self.quantities = {name: self._about(name, item) for name, item in sets.items()}
        self.events = self._events(data.get("events"))
        # traces of other programs have no such attributes: final and met
        self.final = bool(np.all(self._file.attrs.get("final", 1)))
        self.met = bool(np.all(self._file.attrs.get("met", 1)))
        tau = np.asarray(self._file.attrs.get("tau", math.nan))
        self.tau = float(tau) if tau.ndim == 0 and tau.dtype.kind in "fiu" and tau >= 0.0 else None

    def _about(self, name: str, item: Any) -> About:
        nominal = item.attrs.get("nominal")
        # one finite number, or none
        if nominal is not None:
            array = np.asarray(nominal)
            nominal = float(array.ravel()[0]) if array.size == 1 and array.dtype.kind in "fiu" else math.nan
            nominal = nominal or None  # a run that was killed has not yet said one
        return About(name, _text(item.attrs.get("units", "1")), nominal)

    def _events(self, found: Any) -> tuple[TraceEvent, ...]:
        """/events: a group with `time` and `name`, or rows of both."""
        # a trace without events
        if found is None:
            return ()
        # a group has members, a table has fields
        fields = found.dtype.names if hasattr(found, "dtype") else tuple(found)
        if fields is None or not {"time", "name"} <= set(fields):
            raise Incomparable(f"{self.path}: /events has no time and name")
        times, names = np.asarray(found["time"], dtype=np.float64), np.asarray(found["name"])
        # lists of unequal length, or far too long
        if times.shape != names.shape or times.ndim != 1 or times.size > EVENTS:
            raise Incomparable(f"{self.path}: /events is no list")
        return tuple(TraceEvent(float(t), _text(n)) for t, n in zip(times, names, strict=True))

    def read(self, name: str, first: int, last: int) -> tuple[Floats, Floats | None]:
        """Rows first..last-1: values and, where they are stored, rates."""
        with self._faults():
            values = np.asarray(self._sets[name][first:last], dtype=np.float64)
            rate = self._rates.get(name)
            return values, None if rate is None else np.asarray(rate[first:last], dtype=np.float64)


def _text(value: Any) -> str:
    # an attribute may be an array of one text, or bytes
    if isinstance(value, np.ndarray):
        value = value.item() if value.size == 1 else ""
    return value.decode("utf-8", "replace") if isinstance(value, bytes | np.bytes_) else str(value)
