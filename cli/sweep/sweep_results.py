"""The results of a sweep in memory: arrays by name, as xarray or pandas."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.opening import open_regular


class Sweep(Mapping[str, NDArray[Any]]):
    """Runs of a sweep: arrays [run] or [run, time] by the names of its file (`set.k`, `end.x`, `trace.x`, `met`, ...).

    units: by name; attributes: of the file; failed: (run, exit, reason) of runs that did not end as asked, were not
    met, or whose expectations failed.
    """

    def __init__(self, arrays: dict[str, NDArray[Any]], units: dict[str, str], attributes: dict[str, Any]) -> None:
        self._arrays, self.units, self.attributes = arrays, units, attributes

    @classmethod
    def open(cls, file: str | Path) -> Sweep:
        """Of a file that `sysdyn sweep` wrote.  TraceError where it is none, OSError where it cannot be read, or where
        it names other files.
        """
        with open_regular(file) as found:
            if "run" not in found or "exit" not in found:
                raise TraceError(f"{file} holds no runs of a sweep")
            arrays = {name: _read(found[name]) for name in found}
            units = {name: _text(found[name].attrs["units"]) for name in found if "units" in found[name].attrs}
            attributes = {name: _text(value) for name, value in found.attrs.items()}
        return cls(arrays, units, attributes)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __repr__(self) -> str:
        over = ", ".join(name.removeprefix("set.") for name in self if name.startswith("set."))
        title = self.attributes.get("title", "sweep")
        return f"<{title}: {self['run'].size} runs over {over}, {len(self.failed)} failed>"

    @property
    def failed(self) -> tuple[tuple[int, int, str], ...]:
        """(run, exit, reason)."""
        some = np.flatnonzero(self["exit"] != 0)
        return tuple((int(k), int(self["exit"][k]), str(self["reason"][k])) for k in some)

    def to_xarray(self) -> Any:
        """An xarray.Dataset with the dimensions run and time."""
        import xarray

        found = {
            name: (("run", "time")[: values.ndim], values, {"units": self.units[name]} if name in self.units else {})
            for name, values in self.items()
            if name not in ("run", "time")
        }
        coordinates = {name: self[name] for name in ("run", "time") if name in self}
        return xarray.Dataset(found, coordinates, self.attributes)

    def to_pandas(self) -> Any:
        """A pandas.DataFrame, a row a run; traces are left out."""
        import pandas

        plain = {name: values for name, values in self.items() if values.ndim == 1 and name not in ("run", "time")}
        return pandas.DataFrame(plain, index=pandas.Index(self["run"], name="run"))


def _read(data: Any) -> NDArray[Any]:
    values = data[()]
    if values.dtype.kind in "SO":
        return np.array([_text(v) for v in values], dtype=object)
    return np.asarray(values)


def _text(value: Any) -> Any:
    return value.decode("utf-8") if isinstance(value, bytes) else value
