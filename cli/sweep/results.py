"""The file of a sweep: HDF5 with a dimension `run`, opens in xarray.

run; set.NAME what varied; end.NAME, min.NAME, max.NAME of each traced quantity; trace.NAME [run, time] where the scene
has an interval (thinned); exit, met, reason, method, error_estimate, steps, cpu_s.  What was not run is NaN, exit -1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.cli.sweep.one_run import Kept
from sysdyn.cli.sweep.study import Case


def write(
    path: Path,
    cases: Sequence[Case],
    done: Mapping[int, Kept],
    units: Mapping[str, str],
    attributes: Mapping[str, Any],
    *,
    timings: bool,
) -> None:
    """Writes beside and renames: the file at the path is always whole."""
    import h5py

    part = path.with_name(f".{path.name}.part")
    with h5py.File(part, "w", libver=("earliest", "v110")) as file:
        for name, value in attributes.items():
            file.attrs[name] = value
        file.attrs["final"] = np.int64(len(done) == len(cases))
        run = file.create_dataset("run", data=np.arange(len(cases)), track_times=False)
        run.make_scale("run")
        for name, column, unit in _columns(cases, done, units, timings=timings):
            data = file.create_dataset(name, data=_fixed(column), track_times=False)
            data.dims[0].attach_scale(run)
            if unit is not None:
                data.attrs["units"] = unit
        _traces(file, run, len(cases), done, units)
    part.replace(path)


def _fixed(column: Any) -> Any:
    """Texts as fixed-length UTF-8."""
    import h5py

    if column.dtype != object:
        return column
    texts = [str(v).encode("utf-8") for v in column]
    return np.array(texts, dtype=h5py.string_dtype("utf-8", max(1, *map(len, texts))))


def _columns(
    cases: Sequence[Case], done: Mapping[int, Kept], units: Mapping[str, str], *, timings: bool
) -> list[tuple[str, Any, str | None]]:
    """(name, values [run], unit) of every data set of one dimension."""
    found: list[tuple[str, Any, str | None]] = []
    for name in cases[0]:
        values = [case[name] for case in cases]
        number = all(isinstance(v, float) for v in values)
        column = np.array(values, dtype=float if number else object)
        found.append((f"set.{name}".replace("/", "\u2215"), column, units.get(name)))
    rows = [done.get(k) for k in range(len(cases))]
    for group, label in (("end", "end"), ("least", "min"), ("most", "max")):
        for name in _traced(done):
            column = np.array([_number(r, group, name) for r in rows])
            found.append((f"{label}.{name}", column, units.get(name)))
    estimates = [np.nan if r is None or r.error_estimate is None else r.error_estimate for r in rows]
    plain: list[tuple[str, Any]] = [
        ("exit", np.array([-1 if r is None else r.exit for r in rows])),
        ("met", np.array([0 if r is None else int(r.met) for r in rows])),
        ("reason", np.array(["not run yet" if r is None else r.reason for r in rows], dtype=object)),
        ("method", np.array(["" if r is None else r.method for r in rows], dtype=object)),
        ("steps", np.array([0 if r is None else r.steps for r in rows])),
        ("error_estimate", np.array(estimates)),
    ]
    if timings:
        plain.append(("cpu_s", np.array([np.nan if r is None else r.cpu_s for r in rows])))
    return [*found, *((name, column, None) for name, column in plain)]


def _traced(done: Mapping[int, Kept]) -> list[str]:
    return list(next((r.end for _, r in sorted(done.items()) if r.end), {}) or {})


def _number(kept: Kept | None, group: str, name: str) -> float:
    values = None if kept is None else getattr(kept, group)
    return float("nan") if values is None else float(values.get(name, float("nan")))


def _traces(file: Any, run: Any, number: int, done: Mapping[int, Kept], units: Mapping[str, str]) -> None:
    """trace.NAME [run, time] on the instants of the longest run; a run that ended earlier is NaN behind its end."""
    some = [r for r in done.values() if r.time and r.traces]
    if not some:
        return
    longest = max(some, key=lambda r: len(r.time or ()))
    assert longest.time is not None
    time = file.create_dataset("time", data=np.array(longest.time), track_times=False)
    time.make_scale("time")
    time.attrs["units"] = "s"
    for name in _traced(done):
        table = np.full((number, len(longest.time)), np.nan)
        for r in some:
            assert r.time is not None
            assert r.traces is not None
            if r.time == longest.time[: len(r.time)]:
                table[r.run, : len(r.time)] = r.traces[name]
        data = file.create_dataset(f"trace.{name}", data=table, track_times=False)
        data.dims[0].attach_scale(run)
        data.dims[1].attach_scale(time)
        if name in units:
            data.attrs["units"] = units[name]
