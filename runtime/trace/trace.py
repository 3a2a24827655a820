"""The trace, read again: quantities with their units over time, of a whole run or of one that was killed.

How it is written: writing.py; the layout of the file is trace_store.py's.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from sysdyn.names import trace_name
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.opening import of_sweep, open_regular
from sysdyn.runtime.trace.trace_store import BEFORE, Column, Layout, Store, TraceParameter, columns_of, input_output
from sysdyn.values import dataclass

__all__ = ["Column", "Layout", "Quantity", "Trace", "TraceParameter", "columns_of"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Quantity(NDArrayOperatorsMixin):
    """A traced quantity: an array with its unit, nominal magnitude and derivative (None: not known)."""

    name: str
    values: Floats
    units: str
    nominal: float | None
    derivative: Floats | None

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.values, dtype=dtype, copy=True) if copy or dtype is not None else self.values

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        plain = [i.values if isinstance(i, Quantity) else i for i in inputs]
        return getattr(ufunc, method)(*plain, **options)

    def __getattr__(self, name: str) -> Any:
        """What arrays have: `shape`, `max()`, ..."""
        # copying and pickling ask for private names
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.values, name)

    def __repr__(self) -> str:
        finite = self.values[np.isfinite(self.values)]
        span = f", {finite.min():.6g} to {finite.max():.6g}" if finite.size else ""
        return f"<{self.name} [{self.units}]: {len(self.values)} values{span}>"

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, key: Any) -> Any:
        return self.values[key]

    def __iter__(self) -> Iterator[float]:
        return iter(self.values)


@contextlib.contextmanager
def _raise_trace_errors(path: Path) -> Iterator[None]:
    """What h5py raises of a file whose layout makes no sense as TraceError."""
    # a layout that no trace has
    try:
        yield
    except (KeyError, TypeError, AttributeError, OverflowError, MemoryError) as error:
        raise TraceError(f"{path}: not readable as a trace: {error}") from error


def _plain(value: Any) -> Any:
    if isinstance(value, bytes | np.bytes_):
        return value.decode("utf-8")
    return value.item() if isinstance(value, np.generic) else value


def _events(group: Any) -> tuple[Happened, ...]:
    texts = ([_plain(v) for v in group[name][()]] for name in ("name", "element", "before", "after"))
    return tuple(Happened(float(t), *said) for t, *said in zip(group["time"][()], *texts, strict=True))


def _is_row(item: Any) -> bool:
    """One number an instant."""
    return getattr(item, "ndim", 0) == 1 and item.dtype.kind in "fiu"


@dataclass(frozen=True, slots=True, repr=False)
class Trace:
    """A trace read from a file: trace["q1"], trace.time [s], trace.names, trace.attributes."""

    path: str
    time: Floats
    attributes: dict[str, Any]
    parameters: dict[str, tuple[float, str]]
    _data: dict[str, Quantity]
    events: tuple[Happened, ...] = ()

    def __repr__(self) -> str:
        title = self.attributes.get("title", self.path)
        span = f", {self.time[0]:.6g} s to {self.time[-1]:.6g} s" if len(self.time) else ""
        return f"<trace of {title}: {', '.join(self.names[:6])}; {len(self.time)} instants{span}>"

    @classmethod
    def open(cls, file: str | Path) -> Trace:
        """Reads a whole trace, also of a run that was killed.  Raises TraceError."""
        import h5py
        from sysdyn.runtime.trace.hdf5 import scalars

        path = Path(file)
        with _raise_trace_errors(path), input_output(path), open_regular(path) as source:
            data = {name: item for name, item in source.items() if isinstance(item, h5py.Dataset)}
            if "time" not in data:
                raise ValueError("no data set 'time': not a trace")
            if of_sweep(source):
                raise ValueError("the runs of a sweep, not a trace")
            if not _is_row(data["time"]):
                raise ValueError("'time' is no row of numbers: not a trace")
            group = {
                f"{key}.{name}": item
                for key in ("audit",)
                for name, item in source.get(key, {}).items()
                if isinstance(item, h5py.Dataset)
            }
            rates = {n: item for n, item in source.get("derivatives", {}).items() if isinstance(item, h5py.Dataset)}
            # a run that was killed may have flushed one row more of some of them
            length = min(item.shape[0] for item in (*data.values(), *group.values(), *rates.values()) if _is_row(item))
            quantities = {}
            # quantities, and the audit by its path
            for name, item in (*data.items(), *group.items()):
                if name == "time" or not _is_row(item):
                    continue
                # rates stand at the path that the quantity names
                path_of = _plain(item.attrs.get("derivative", ""))
                known: Any = source[path_of] if path_of and path_of in source else None
                rate = np.asarray(known[:length]) if _is_row(known) else None
                quantities[name] = Quantity(
                    name,
                    np.asarray(item[:length]),
                    str(_plain(item.attrs.get("units", "1"))),
                    _plain(item.attrs["nominal"]) if "nominal" in item.attrs else None,
                    rate,
                )
            parameters = scalars(source["parameters"]) if "parameters" in source else {}
            attributes = {name: _plain(value) for name, value in source.attrs.items()}
            events = _events(source["events"]) if "events" in source else ()
            return cls(str(path), np.asarray(data["time"][:length]), attributes, parameters, quantities, events)

    def save(self, file: str | Path) -> None:
        """Writes the trace to a file, in the layout of `sysdyn simulate`.  Raises TraceError."""
        names, width = self.names, len(self.names)
        columns = [
            Column(name, k, self[name].units, name, self[name].derivative is not None) for k, name in enumerate(names)
        ]
        rows = np.full((self.time.size, BEFORE + 2 * width), np.nan)
        # the head of a row: instant and audit
        rows[:, 0] = self.time
        for place, name in ((6, "audit.energy"), (7, "audit.constraints")):
            rows[:, place] = self[name]
        for column in columns:
            rows[:, BEFORE + column.place] = self[column.name]
            if column.derivative:
                rows[:, BEFORE + width + column.place] = self[column.name].derivative
        # numbers and attributes as they were read
        parameters = tuple(TraceParameter(name, value, unit) for name, (value, unit) in self.parameters.items())
        nominal = {n: {"nominal": self[n].nominal} for n in names if self[n].nominal is not None}
        energy = {"/audit/energy": {"nominal": self["audit.energy"].nominal or 0.0}}
        closing = [name for name in ("final", "met", "judged") if name in self.attributes]
        last: dict[str, Any] = {name: self.attributes[name] for name in closing}
        path = Path(file)
        with input_output(path):
            # an old trace at this path goes
            path.unlink(missing_ok=True)
            store = Store(path, Layout(tuple(columns), width, self.attributes, parameters))
            store.append(rows)
            store.close_with({**nominal, **energy, "/": last}, self.events)

    def to_xarray(self) -> Any:
        """An xarray.Dataset over `time`: quantities and the audit with units and nominal magnitudes.

        Needs xarray, which sysdyn itself does not.
        """
        import xarray

        data = {
            name: ("time", q.values, {"units": q.units} | ({} if q.nominal is None else {"nominal": q.nominal}))
            for name, q in self._data.items()
        }
        time = ("time", self.time, {"units": "s", "long_name": "time"})
        return xarray.Dataset(data, coords={"time": time}, attrs=dict(self.attributes))

    def to_pandas(self) -> Any:
        """A pandas.DataFrame over `time` [s]; `attrs["units"]` holds the unit of each column.  Needs pandas."""
        import pandas

        index = pandas.Index(self.time, name="time")
        frame = pandas.DataFrame({name: q.values for name, q in self._data.items()}, index=index)
        frame.attrs["units"] = {name: q.units for name, q in self._data.items()}
        return frame

    @property
    def names(self) -> tuple[str, ...]:
        """Traced quantities (without the audit)."""
        return tuple(name for name in self._data if not name.startswith("audit."))

    def _key(self, name: str) -> str:
        """The name as it stands in the file: '/' in a quotient is U+2215 there."""
        # the audit by its path or by its name
        if "audit" in name:
            name = name.removeprefix("/").replace("audit/", "audit.")
        spelled = trace_name(name)
        return spelled if name not in self._data and spelled in self._data else name

    def __getitem__(self, name: str) -> Quantity:
        return self._data[self._key(name)]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._key(name) in self._data

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    @property
    def final(self) -> bool:
        """The run ended as asked."""
        return bool(np.all(self.attributes.get("final", 1)))

    @property
    def met(self) -> bool:
        """The run met what it judged itself by; a trace that does not say counts as met."""
        return bool(np.all(self.attributes.get("met", 1)))

    @property
    def judged(self) -> tuple[str, ...]:
        """What the run judged itself by: accuracy, energy, invariants."""
        return tuple(str(self.attributes.get("judged", "")).split())

    @property
    def conserved(self) -> list[dict[str, Any]]:
        """What should have kept its value: {what, drift: how far it went, of: the sum of its parts at most, unit}."""
        return list(json.loads(self.attributes.get("conserved", "[]")))

    @property
    def statistics(self) -> dict[str, Any]:
        """Counters of the run."""
        return dict(json.loads(self.attributes.get("statistics", "{}")))

    @property
    def timings(self) -> dict[str, float]:
        """CPU and wall seconds of the run; empty where they were not asked for."""
        return dict(json.loads(self.attributes.get("timings", "{}")))
