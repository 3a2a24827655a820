"""A thinned trace as a file: CONTRACT's layout without chunks, the same bytes for the same content."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.trace.trace_store import input_output


def write_trace(path: Path, trace: Arrays, attributes: Mapping[str, str | float | int], most: float) -> int:
    """Write a trace in one piece, packed where it is larger than `most` bytes; its size.  Raises TraceError.

    A packed file has the file format of HDF5 1.10, whose index of one chunk costs nothing.  The path keeps what it
    held where the result is still larger.
    """
    for packed in (False, True):
        size = _written(path, trace, attributes, packed, most)
        if size <= most:
            break
    return size


def _written(path: Path, trace: Arrays, attributes: Mapping[str, str | float | int], packed: bool, most: float) -> int:
    """Write a trace beside its place and put it there where it has at most `most` bytes; its size."""
    import h5py
    from sysdyn.runtime.trace import hdf5

    part = path.with_suffix(".h5.part")
    with input_output(path):
        try:
            with h5py.File(part, "w", libver=("v110" if packed else "earliest", "v110")) as file:
                hdf5.say(file.id, {**attributes, "final": 1})
                time = _data(file, packed, "time", trace.time, "s", "time")
                time.make_scale("time")
                # each quantity with unit, nominal value, and its rate where there is one
                for name, values in trace.values.items():
                    about = trace.quantities[name]
                    data = _data(file, packed, name, values, about.unit, name)
                    hdf5.say(data.id, {"nominal": _nominal(trace, name)})
                    data.dims[0].attach_scale(time)
                    if name in trace.rates:
                        unit = "1/s" if about.unit == "1" else f"({about.unit})/s"
                        rate = f"/derivatives/{name}"
                        _data(file, packed, rate, trace.rates[name], unit, f"time derivative of {name}")
                        hdf5.say(data.id, {"derivative": rate})
                # instants and names of events
                if trace.events:
                    _data(file, packed, "/events/time", np.array([e.time for e in trace.events]), "s", "time of events")
                    names = np.array([e.name.encode() for e in trace.events])
                    file.create_dataset("/events/name", data=names, track_times=False)
            size = part.stat().st_size
            if size <= most:
                part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    return size


def _nominal(trace: Arrays, name: str) -> float:
    nominal = trace.quantities[name].nominal
    return float(np.max(np.abs(trace.values[name]), initial=0.0)) if nominal is None else nominal


def _data(file: Any, packed: bool, name: str, values: Any, unit: str, long_name: str) -> Any:
    from sysdyn.runtime.trace import hdf5

    how = {"chunks": (len(values),), "compression": 9, "shuffle": True} if packed and len(values) else {}
    data = file.create_dataset(name, data=values, track_times=False, **how)
    hdf5.say(data.id, {"units": unit, "long_name": long_name})
    return data
