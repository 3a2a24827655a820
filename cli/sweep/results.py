"""The file of a sweep: HDF5 with a dimension `run`, opens in xarray.

run; set.NAME what varied; end.NAME, min.NAME, max.NAME of each traced quantity; trace.NAME [run, time] where the scene
has an interval (thinned); exit, met, reason, method, error_estimate, steps, cpu_s.  What was not run is NaN, exit -1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.cli import whole_files
from sysdyn.cli.sweep.run_records import Done
from sysdyn.cli.sweep.study import Case
from sysdyn.names import trace_name


def write(
    path: Path,
    cases: Sequence[Case],
    done: Done,
    units: Mapping[str, str],
    attributes: Mapping[str, Any],
    *,
    timings: bool,
) -> None:
    """Laid down in memory: HDF5 does not survive a disk that takes no more."""
    import h5py

    with h5py.File(path.name, "w", driver="core", backing_store=False, libver=("earliest", "v110")) as file:
        for name, value in attributes.items():
            file.attrs[name] = value
        file.attrs["final"] = np.int64(len(done) == len(cases))
        run = file.create_dataset("run", data=np.arange(len(cases)), track_times=False)
        run.make_scale("run")
        # columns over the runs
        for name, column, unit in _columns(cases, done, units, timings=timings):
            data = file.create_dataset(name, data=_fixed_length(column), track_times=False)
            data.dims[0].attach_scale(run)
            if unit is not None:
                data.attrs["units"] = unit
        _traces(file, run, len(cases), done, units)
        # then written at once, beside its place
        file.flush()
        whole_files.write(path, file.id.get_file_image())


def _fixed_length(column: Any) -> Any:
    """Texts as fixed-length UTF-8."""
    import h5py

    if column.dtype != object:
        return column
    texts = [str(v).encode("utf-8") for v in column]
    return np.array(texts, dtype=h5py.string_dtype("utf-8", max(1, *map(len, texts))))


def _columns(
    cases: Sequence[Case], done: Done, units: Mapping[str, str], *, timings: bool
) -> list[tuple[str, Any, str | None]]:
    """(name, values [run], unit) of every data set of one dimension."""
    found: list[tuple[str, Any, str | None]] = []
    for name in cases[0]:
        values = [case[name] for case in cases]
        plain = all(isinstance(v, float) for v in values)
        column = np.array(values, dtype=float if plain else object)
        found.append((trace_name(f"set.{name}"), column, units.get(name)))
    number = len(cases)
    for group, label in (("end", "end"), ("least", "min"), ("most", "max")):
        found += [(f"{label}.{name}", column, units.get(name)) for name, column in done.columns(group, number)]
    beside = _plain(done, number).items()
    return [*found, *((name, column, None) for name, column in beside if timings or name != "cpu_s")]


def _plain(done: Done, number: int) -> dict[str, Any]:
    """What every run has, by name: values [number]."""
    table: dict[str, Any] = {
        "exit": np.full(number, -1),
        "met": np.zeros(number, dtype=int),
        "reason": np.full(number, "not run yet", dtype=object),
        "method": np.full(number, "", dtype=object),
        "steps": np.zeros(number, dtype=int),
        "error_estimate": np.full(number, np.nan),
        "cpu_s": np.full(number, np.nan),
    }
    for k, r in done.singles.items():
        estimate = np.nan if r.error_estimate is None else r.error_estimate
        values = r.exit, int(r.met), r.reason, r.method, r.steps, estimate, r.cpu_s
        for name, value in zip(table, values, strict=True):
            table[name][k] = value
    for b in done.blocks:
        columns = 0, 1, "", b.method, b.steps, b.estimate, b.cpu_s
        for name, column in zip(table, columns, strict=True):
            table[name][b.runs] = column
    return table


def _traces(file: Any, run: Any, number: int, done: Done, units: Mapping[str, str]) -> None:
    """trace.NAME [run, time] on the instants of the longest run; a run that ended earlier is NaN behind its end."""
    some = [r for r in done.singles.values() if r.time and r.traces]
    blocks = [b for b in done.blocks if b.time.size]
    times = [np.array(r.time) for r in some] + [b.time for b in blocks]
    if not times:
        return
    # instants of all runs are the same up to their end
    longest = max(times, key=len)
    time = file.create_dataset("time", data=longest, track_times=False)
    time.make_scale("time")
    time.attrs["units"] = "s"
    for name in done.names():
        table = np.full((number, len(longest)), np.nan)
        # runs by themselves, then blocks of the core
        for r in some:
            assert r.time is not None
            assert r.traces is not None
            if np.array_equal(r.time, longest[: len(r.time)]):
                table[r.run, : len(r.time)] = r.traces[name]
        for b in blocks:
            if np.array_equal(b.time, longest[: b.time.size]):
                table[b.runs, : b.time.size] = b.traces[:, b.names.index(name)]
        data = file.create_dataset(f"trace.{name}", data=table, track_times=False)
        data.dims[0].attach_scale(run)
        data.dims[1].attach_scale(time)
        if name in units:
            data.attrs["units"] = units[name]
