"""The trace: HDF5 as CONTRACT.md lays it down, written in raw float64 blocks, readable after kill -9.

/time (a dimension scale), one data set a traced quantity, /derivatives/<name>, /audit/energy, /audit/constraints,
/parameters/<name>, root attributes with `final`.  Rows wait in memory and go to the file together once a second (or
when there are many), each time followed by a flush: between flushes the file on disk does not change.  `time` is
written first, so a reader that meets data sets of unequal length takes the shortest.
A disk that fills up raises TraceError: the file handle is turned to memory before HDF5 closes it, which otherwise ends
in SIGSEGV at exit.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import resource
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.runtime.description import Description, Floats, element
from sysdyn.runtime.failures import TraceError

FLUSH_SECONDS = 0.8
"""Flushed at least every second of wall time: rows arrive about every 50 ms."""
BLOCK = 1024
MANY = 1 << 20
"""Numbers that may wait in memory."""


@dataclass(frozen=True, slots=True)
class Column:
    """One traced quantity.  place: its element of block observe; derivative: it has one."""

    name: str
    place: int
    unit: str
    long_name: str
    derivative: bool


def columns_of(description: Description) -> tuple[Column, ...]:
    """Stored quantities in the order of the rows of block observe."""
    found: list[Column] = []
    place = 0
    for k in description.rows_of("observe"):
        row = description.rows[k]
        for position in range(row.size):
            if row.stored:
                name = element(row.name, row.shape, position).replace("/", "\u2215")
                label = element(row.label or row.name, row.shape, position)
                found.append(Column(name, place, row.unit, label, row.rate))
            place += 1
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter as the trace keeps it."""

    name: str
    value: float
    unit: str


def _text(value: str) -> Any:
    """A fixed-length UTF-8 string for an attribute."""
    import h5py

    data = value.encode("utf-8") or b" "
    return np.array(data, dtype=h5py.string_dtype("utf-8", len(data)))


@contextlib.contextmanager
def _input_output(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, RuntimeError, ValueError) as error:
        raise TraceError(f"{path}: {error}") from error


class TraceWriter:
    """A trace being written.  rows: [k, 8 + 2 observed] as core/run.h lays them down."""

    def __init__(
        self,
        path: str | Path,
        columns: Sequence[Column],
        observed: int,
        attributes: Mapping[str, str | float | int],
        parameters: Sequence[Parameter] = (),
    ) -> None:
        self.path = Path(path)
        self._columns, self._observed = tuple(columns), observed
        self._waiting: list[Floats] = []
        self._numbers, self._flushed = 0, time.monotonic()
        self.length = 0
        self.closed = False
        with _input_output(self.path):
            self._create(attributes, parameters)

    def _create(self, attributes: Mapping[str, str | float | int], parameters: Sequence[Parameter]) -> None:
        import h5py

        self._file = h5py.File(self.path, "w", libver=("earliest", "v110"), track_order=False)
        try:
            for name, value in attributes.items():
                self._file.attrs[name] = _text(value) if isinstance(value, str) else value
            self._file.attrs["final"] = np.int64(0)
            self._time = self._data("time", "s", "time", None)
            self._time.make_scale("time")
            self._sets = [(self._time, 0)]
            for column in self._columns:
                data = self._data(column.name, column.unit, column.long_name, self._time)
                data.attrs["nominal"] = 0.0
                self._sets.append((data, 8 + column.place))
                if column.derivative:
                    path = f"/derivatives/{column.name}"
                    unit = f"({column.unit})/s" if column.unit != "1" else "1/s"
                    rate = self._data(path, unit, f"time derivative of {column.long_name}", self._time)
                    data.attrs["derivative"] = _text(path)
                    self._sets.append((rate, 8 + self._observed + column.place))
            for path, unit, name, place in (
                (
                    "/audit/energy",
                    "J",
                    "balance of stored, dissipated and supplied energy since the start",
                    6,
                ),
                ("/audit/constraints", "1", "norm of the scaled constraint equations", 7),
            ):
                self._sets.append((self._data(path, unit, name, self._time), place))
            for parameter in parameters:
                data = self._file.create_dataset(
                    f"/parameters/{parameter.name.replace('/', chr(0x2215))}",
                    data=parameter.value,
                    track_times=False,
                )
                data.attrs["units"] = _text(parameter.unit)
            self._file.flush()
        except (OSError, RuntimeError, ValueError):
            self._abandon()
            raise

    def _data(self, name: str, unit: str, long_name: str, scale: Any) -> Any:
        data = self._file.create_dataset(
            name,
            shape=(0,),
            maxshape=(None,),
            chunks=(BLOCK,),
            dtype="f8",
            fillvalue=np.nan,
            track_times=False,
        )
        data.attrs["units"] = _text(unit)
        data.attrs["long_name"] = _text(long_name)
        if scale is not None:
            data.dims[0].attach_scale(scale)
        return data

    def append(self, rows: Floats) -> None:
        """Takes rows; writes and flushes when it is time."""
        if rows.size:
            self._waiting.append(rows)
            self._numbers += rows.size
        if self._numbers > MANY or time.monotonic() - self._flushed > FLUSH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """All rows so far are in the file and on their way to the disk."""
        self._flushed = time.monotonic()
        if not self._waiting:
            return
        rows = np.concatenate(self._waiting)
        self._waiting, self._numbers = [], 0
        first, self.length = self.length, self.length + rows.shape[0]
        try:
            with _input_output(self.path):
                self._room(rows.shape[0])
                for data, place in self._sets:
                    data.resize((self.length,))
                    data[first:] = rows[:, place]
                self._file.flush()
        except TraceError:
            self._abandon()
            raise

    def _room(self, rows: int) -> None:
        """Refuses to begin what the disk cannot hold."""
        blocks = rows // BLOCK + 2
        need = len(self._sets) * blocks * BLOCK * 8 // (1 if rows >= BLOCK else 4) + (1 << 16)
        disk = os.statvfs(self.path.parent)
        if disk.f_bavail * disk.f_frsize < need:
            raise OSError(28, "no space left on the disk for the trace")

    def finish(
        self,
        nominal: Mapping[str, float],
        attributes: Mapping[str, str | float | int],
        final: bool,
    ) -> None:
        """Nominal values, last attributes, `final`; closes the file."""
        self.flush()
        try:
            with _input_output(self.path):
                for column in self._columns:
                    self._file[column.name].attrs["nominal"] = float(nominal.get(column.name, 0.0))
                for name, value in attributes.items():
                    self._file.attrs[name] = _text(value) if isinstance(value, str) else value
                self._file.attrs["final"] = np.int64(final)
                self._file.flush()
                self._file.close()
        except TraceError:
            self._abandon()
            raise
        self.closed = True

    def _abandon(self) -> None:
        """Closes a file that can no longer be written: the handle is turned to memory first."""
        if self.closed:
            return
        self.closed = True
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        with contextlib.suppress(Exception):
            resource.setrlimit(resource.RLIMIT_FSIZE, (limits[1], limits[1]))
            handle = self._file.id.get_vfd_handle()
            copy = os.memfd_create("sysdyn-trace")
            size = os.fstat(handle).st_size
            offset = 0
            while offset < size:
                sent = os.sendfile(copy, handle, offset, size - offset)
                if sent == 0:
                    break
                offset += sent
            os.dup2(copy, handle)
            os.close(copy)
        with contextlib.suppress(Exception):
            self._file.close()
        # every handle of the file dies while its writes still succeed
        self._sets, self._time = [], None
        gc.collect()
        with contextlib.suppress(Exception):
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)

    def discard(self) -> None:
        """Closes without finishing; the file stays as it was last flushed."""
        if not self.closed:
            with contextlib.suppress(Exception):
                self._file.close()
            self.closed = True


@dataclass(frozen=True, slots=True)
class Quantity:
    """A traced quantity: an array with its unit, nominal magnitude and derivative (None: not known)."""

    name: str
    values: Floats
    units: str
    nominal: float | None
    derivative: Floats | None

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.values, dtype=dtype, copy=True) if copy or dtype is not None else self.values

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, key: Any) -> Any:
        return self.values[key]

    def __iter__(self) -> Iterator[float]:
        return iter(self.values)


def _plain(value: Any) -> Any:
    if isinstance(value, bytes | np.bytes_):
        return value.decode("utf-8")
    return value.item() if isinstance(value, np.generic) else value


@dataclass(frozen=True, slots=True)
class Trace:
    """A trace read from a file: trace["q1"], trace.time [s], trace.names, trace.attributes."""

    path: str
    time: Floats
    attributes: dict[str, Any]
    parameters: dict[str, tuple[float, str]]
    _data: dict[str, Quantity]

    @classmethod
    def open(cls, file: str | Path) -> Trace:
        """Reads a whole trace, also of a run that was killed.  Raises TraceError."""
        import h5py

        path = Path(file)
        with _input_output(path), h5py.File(path, "r") as source:
            data = {name: item for name, item in source.items() if isinstance(item, h5py.Dataset)}
            if "time" not in data:
                raise ValueError("no data set 'time': not a trace")
            group = {
                f"{key}.{name}": item for key in ("audit",) for name, item in source.get(key, {}).items()
            }
            rates = dict(source.get("derivatives", {}).items())
            length = min(
                item.shape[0] for item in (*data.values(), *group.values(), *rates.values()) if item.ndim == 1
            )
            quantities = {}
            for name, item in (*data.items(), *group.items()):
                if name == "time" or item.ndim != 1:
                    continue
                path_of = _plain(item.attrs.get("derivative", ""))
                rate = np.asarray(source[path_of][:length]) if path_of and path_of in source else None
                quantities[name] = Quantity(
                    name,
                    np.asarray(item[:length]),
                    str(_plain(item.attrs.get("units", "1"))),
                    _plain(item.attrs["nominal"]) if "nominal" in item.attrs else None,
                    rate,
                )
            parameters = {
                name: (float(item[()]), str(_plain(item.attrs.get("units", "1"))))
                for name, item in source.get("parameters", {}).items()
            }
            attributes = {name: _plain(value) for name, value in source.attrs.items()}
            return cls(str(path), np.asarray(data["time"][:length]), attributes, parameters, quantities)

    @property
    def names(self) -> tuple[str, ...]:
        """Traced quantities (without the audit)."""
        return tuple(name for name in self._data if not name.startswith("audit."))

    def __getitem__(self, name: str) -> Quantity:
        return self._data[name.removeprefix("/").replace("audit/", "audit.") if "audit" in name else name]

    def __contains__(self, name: str) -> bool:
        return name in self._data

    @property
    def final(self) -> bool:
        """The run ended as asked."""
        return bool(self.attributes.get("final", 1))

    @property
    def statistics(self) -> dict[str, Any]:
        """Counters of the run."""
        return dict(json.loads(self.attributes.get("statistics", "{}")))
