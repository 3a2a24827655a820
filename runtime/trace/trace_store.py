"""One HDF5 file of a trace: its layout, rows appended in raw float64 blocks.

/time (a dimension scale), one data set a traced quantity, /derivatives/<name>, /audit/energy, /audit/constraints, links
/audit/<member> to what else of the audit is traced, /parameters/<name>, root attributes with `final`.  A disk that
fills up raises: the handle is turned to memory before HDF5 closes the file, which otherwise ends in SIGSEGV at exit.
"""

from __future__ import annotations

import contextlib
import gc
import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.names import trace_name
from sysdyn.runtime import _core
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.model.description import Description, Floats
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.locks import lock, unlock
from sysdyn.values import dataclass

BLOCK = 1024
BEFORE: int = _core.SD_ROW_HEAD
"""Numbers of a row before its quantities (core/run/run.h)."""
HEAD = 1 << 16
"""Bytes for what is not numbers."""


@dataclass(frozen=True, slots=True)
class Column:
    """One traced quantity.  place: its element of block observe; derivative: it has one."""

    name: str
    place: int
    unit: str
    long_name: str
    derivative: bool


@dataclass(frozen=True, slots=True)
class TraceParameter:
    """A parameter as the trace keeps it."""

    name: str
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class Layout:
    """What a trace holds before its first row; observed: elements of block observe."""

    columns: tuple[Column, ...]
    observed: int
    attributes: dict[str, str | float | int]
    parameters: tuple[TraceParameter, ...]


def columns_of(description: Description) -> tuple[Column, ...]:
    """Stored quantities in the order of the rows of block observe."""
    found: list[Column] = []
    place = 0
    for k in description.rows_of("observe"):
        row = description.rows[k]
        # every element is a column where its row is stored
        for position in range(row.size):
            if row.stored:
                name = trace_name(row.name_of(position))
                label = row.name_of(position, row.label)
                found.append(Column(name, place, row.unit, label, row.rate))
            place += 1
    return tuple(found)


def in_words(error: Exception) -> str:
    """What the operating system or HDF5 says; of a file that is none of HDF5's, so."""
    said = getattr(error, "strerror", None) or (str(error).splitlines() or [type(error).__name__])[0]
    # HDF5's own words, for readers
    for sign, words in (("file signature not found", "this is no HDF5 file"), ("truncated file", "it is cut short")):
        if sign in said:
            return f"not readable as a trace: {words}"
    return str(said)


@contextlib.contextmanager
def input_output(path: Path) -> Iterator[None]:
    """Faults of the operating system and of HDF5 as TraceError."""
    try:
        yield
    except (OSError, RuntimeError, ValueError) as error:
        raise TraceError(f"{path}: {in_words(error)}") from error


def _keep(group: Any, parameters: Sequence[TraceParameter]) -> None:
    """A scalar data set with its unit each: a netlist has tens of thousands, and a copy costs a third of a new one."""
    from sysdyn.runtime.trace import hdf5

    templates: dict[str, Any] = {}
    for parameter in parameters:
        # one template for each unit, copied
        template = templates.get(parameter.unit)
        if template is None:
            template = templates[parameter.unit] = hdf5.template(group, parameter.unit)
        hdf5.copy(template, group, trace_name(parameter.name), parameter.value)


def clear(path: Path) -> None:
    """Remove the stores that killed runs left beside a trace, which is claimed: no living run has any."""
    name = re.compile(re.escape(f".{path.name}.") + r"[0-9a-f]{8}\.[ab](\.link)?")
    with contextlib.suppress(OSError), os.scandir(path.parent) as items:
        # files of this trace's name alone, and no links
        left = [item.path for item in items if name.fullmatch(item.name) and item.is_file(follow_symlinks=False)]
        for item in left:
            with contextlib.suppress(OSError):
                Path(item).unlink()


def _most() -> float:
    """Bytes that a file of this process may have."""
    # Windows has no such limits
    try:
        import resource
    except ImportError:  # Windows
        return float("inf")
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return float("inf") if limit == resource.RLIM_INFINITY else limit


@contextlib.contextmanager
def _raise_file_limit() -> Iterator[None]:
    """Files may have what the hard limit lets them have."""
    # raised while it is needed, then as before
    try:
        import resource
    except ImportError:  # Windows
        yield
        return
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limits[1], limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


class Store:
    """A file of the trace's layout.  Raises OSError, RuntimeError, ValueError where it cannot be written.

    HDF5's lock is taken off it, so that others may read the trace of a living run; a reader's own lock shows.
    """

    def __init__(self, path: Path, layout: Layout, like: Store | None = None) -> None:
        """Empty, or a copy of another store, of which all is on the disk."""
        import h5py
        from sysdyn.runtime.trace import hdf5

        self.path = path
        self._length = 0
        self._closed = False
        self._sets: list[tuple[Any, str, int]] = []
        self._room(0 if like is None else like._length)
        # a copy of what is on the disk
        if like is not None:
            shutil.copyfile(like.path, path)
        mode = "x" if like is None else "r+"
        self._file = h5py.File(path, mode, libver=("earliest", "v110"))
        # readers may open it while it grows
        with contextlib.suppress(OSError):
            unlock(self._file.id.get_vfd_handle())
        # a store that could not be made leaves no open file
        try:
            if like is None:
                hdf5.say(self._file.id, {**layout.attributes, "final": np.int64(0), "met": np.int64(0), "judged": ""})
                self._create(layout)
                self._file.flush()
            else:
                self._length = like._length
                self._sets = [(self._file[name].id, name, place) for _, name, place in like._sets]
        except (OSError, RuntimeError, ValueError):
            self.abandon()
            raise

    def is_read(self) -> bool:
        """Somebody opened it while it was the trace, and has not closed it: what is read must not change."""
        handle = self._file.id.get_vfd_handle()
        # a lock that can be had: nobody reads
        try:
            if lock(handle):  # else locks do not work here: HDF5 took none either
                unlock(handle)
        except BlockingIOError:
            return True
        except OSError:
            return False
        return False

    def _create(self, layout: Layout) -> None:
        """Lays out time, quantities with their rates, the audit and the parameters of an empty store."""
        from sysdyn.runtime.trace import hdf5

        time = self._data("time", "s", "time", None, 0)
        hdf5.make_scale(time, "time")
        for column in layout.columns:
            data = self._data(column.name, column.unit, column.long_name, time, BEFORE + column.place)
            hdf5.say(data, {"nominal": 0.0})
            group, _, member = column.name.partition(".")
            if group == "audit" and member not in ("energy", "constraints"):
                # quantities of the audit are linked where the audit is
                hdf5.link(self._file.id, f"/audit/{member}", data)
            if column.derivative:
                path = f"/derivatives/{column.name}"
                unit = f"({column.unit})/s" if column.unit != "1" else "1/s"
                name = f"time derivative of {column.long_name}"
                self._data(path, unit, name, time, BEFORE + layout.observed + column.place)
                # a quantity names its rate
                hdf5.say(data, {"derivative": path})
        for path, unit, name, place in (
            ("/audit/energy", "J", "balance of stored, dissipated and supplied energy since the start", 6),
            ("/audit/constraints", "1", "norm of the scaled constraint equations", 7),
        ):
            self._data(path, unit, name, time, place)
        if layout.parameters:
            _keep(self._file.create_group("parameters").id, layout.parameters)

    def _data(self, name: str, unit: str, long_name: str, scale: Any, place: int) -> Any:
        """A data set for the number at a place of each row."""
        from sysdyn.runtime.trace import hdf5

        data = hdf5.column(self._file.id, name, BLOCK, {"units": unit, "long_name": long_name}, scale)
        self._sets.append((data, name, place))
        return data

    def append(self, rows: Floats) -> None:
        """Appends rows and flushes."""
        from sysdyn.runtime.trace import hdf5

        # refused before anything is written
        self._room(rows.shape[0])
        first, self._length = self._length, self._length + rows.shape[0]
        for data, _, place in self._sets:
            hdf5.append(data, first, np.ascontiguousarray(rows[:, place]))
        self._file.flush()

    def _room(self, rows: int) -> None:
        """Refuses to begin what the disk, or a limit on the size of files, cannot hold."""
        blocks = rows // BLOCK + 2
        # whole blocks: HDF5 grows by these
        whole = len(self._sets) * blocks * BLOCK * 8
        need = whole // (1 if rows >= BLOCK else 4) + HEAD
        size = self.path.stat().st_size if self.path.exists() else 0
        if _most() < size + whole + HEAD:
            raise OSError(27, "the trace would outgrow the limit on the size of files")
        if shutil.disk_usage(self.path.parent).free < need:
            raise OSError(28, "no space left on the disk for the trace")

    def close_with(self, attributes: Mapping[str, Mapping[str, Any]], events: Sequence[Happened] = ()) -> None:
        """Events, attributes by data set ("/": the root), then closes the file."""
        from sysdyn.runtime.trace import hdf5

        # events are written once, at the end
        if events:
            time = hdf5.whole(self._file.id, "/events/time", np.array([e.time for e in events]))
            hdf5.say(time, {"units": "s"})
            for name in ("name", "element", "before", "after"):
                hdf5.whole(self._file.id, f"/events/{name}", [getattr(e, name) for e in events])
        # nominal values and verdicts stand there already as zeros
        for name, values in attributes.items():
            hdf5.say_again(self._file[name].id, values)
        self._file.flush()
        self._file.close()
        self._closed = True

    def close(self) -> None:
        """Closes a file to which nothing was added since it was flushed."""
        if not self._closed:
            self._closed = True
            with contextlib.suppress(Exception):
                self._file.close()

    def abandon(self) -> None:
        """Closes a file that perhaps can no longer be written: the handle is turned to memory first."""
        if self._closed:
            return
        self._closed = True
        with _raise_file_limit():
            with contextlib.suppress(Exception):
                # the file goes on in memory, where writes succeed
                handle = self._file.id.get_vfd_handle()
                copy = os.memfd_create("sysdyn-trace")
                size, offset = os.fstat(handle).st_size, 0
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
            self._sets = []
            gc.collect()
