import random
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.simulate import simulate
from sysdyn.runtime.trace.trace import Column, Layout, Trace, TraceParameter
from sysdyn.runtime.trace.writing import TraceWriter

HERE = Path(__file__).parent


def written(path, **options):
    manifest, binding, module = models.pendulum()
    settings = {
        "every": 0.1,
        "parameters": (TraceParameter("m", 1.13, "kg"),),
        "attributes": {"model": "pendulum"},
    }
    return simulate(manifest, binding, load(module), Options(path, 0.0, 4.0, **{**settings, **options}))


@pytest.mark.long
def test_layout(tmp_path):
    path = tmp_path / "o.h5"
    written(path)
    with h5py.File(path) as file:
        assert file["time"].is_scale
        assert file["q1"].dtype == np.float64
        assert file["q1"].dims[0][0] == file["time"]
        assert file["q1"].attrs["derivative"] == b"/derivatives/q1"
        assert file["derivatives/q1"].shape == file["time"].shape
        assert "derivative" not in file["kappa1"].attrs
        assert file["audit/energy"].attrs["units"] == b"J"
        assert file["parameters/m"][()] == 1.13
        assert file.attrs["final"] == 1
        assert h5py.check_string_dtype(file.attrs.get_id("model").dtype).length is not None
        for name in ("q1", "audit/energy"):
            assert file[name].chunks[0] >= 1024
    trace = Trace.open(path)
    assert trace.names == ("a1", "a2", "f1", "f2", "kappa1", "q1", "q2")
    assert trace.parameters["m"] == (1.13, "kg")
    assert np.asarray(trace["q1"]).shape == trace.time.shape


@pytest.mark.long
def test_parameters_are_read_without_objects_for_each(tmp_path, monkeypatch):
    """A ladder of 1000 cells has 2000: h5py's objects took two thirds of the time to open its trace."""
    path, made = tmp_path / "o.h5", []
    known = tuple(TraceParameter(f"R[{k}].R", 0.5 + k, "ohm" if k % 2 else "1") for k in range(300))
    written(path, parameters=known)
    create = h5py.Dataset.__init__
    monkeypatch.setattr(h5py.Dataset, "__init__", lambda *given, **named: (made.append(1), create(*given, **named))[1])
    trace = Trace.open(path)
    assert trace.parameters == {p.name: (p.value, p.unit) for p in known}
    assert len(made) < 50


def test_parameters_of_others_are_read_or_refused(tmp_path):
    """Whole numbers, units of any length, none at all; more than one number is none."""
    path = tmp_path / "o.h5"
    written(path)
    with h5py.File(path, "r+") as file:
        file["parameters/cells"] = 7
        file["parameters/long"] = np.float32(2.5)
        file["parameters/long"].attrs["units"] = "kg*m^2"  # of variable length
    known = Trace.open(path).parameters
    assert known == {"m": (1.13, "kg"), "cells": (7.0, "1"), "long": (2.5, "kg*m^2")}
    for wrong in ([1.0, 2.0], "text", None):
        with h5py.File(path, "r+") as file:
            if wrong is None:
                file.create_group("parameters/none")
            else:
                file["parameters/more"] = wrong
        with pytest.raises(TraceError):
            Trace.open(path)
        with h5py.File(path, "r+") as file:
            del file[f"parameters/{'none' if wrong is None else 'more'}"]


@pytest.mark.long
def test_opens_in_xarray(tmp_path):
    xarray = pytest.importorskip("xarray")
    path = tmp_path / "o.h5"
    written(path)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data["q1"].dims == ("time",)
        assert data["time"].size == 41
        assert data["q1"].attrs["units"] == "1"
        assert float(data["q1"].sel(time=4.0)) == pytest.approx(-0.12866541720223088, abs=1e-4)


def test_unwritable_paths_and_foreign_files(tmp_path):
    with pytest.raises(TraceError):
        written(tmp_path / "no" / "such" / "folder.h5")
    with pytest.raises(TraceError):
        written(tmp_path)
    with pytest.raises(TraceError, match="no regular file"):
        written("/dev/null")
    (tmp_path / "text.h5").write_text("no trace")
    for name in ("text.h5", "missing.h5"):
        with pytest.raises(TraceError):
            Trace.open(tmp_path / name)


LIMITED = """
import resource, signal, sys
import numpy as np
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.trace import Column, Layout
from sysdyn.runtime.trace.writing import TraceWriter
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
writer = TraceWriter(sys.argv[1], Layout((Column("x", 0, "m", "x", False),), 1, {"model": "m"}, ()))
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))
try:
    for k in range(100):
        writer.append(np.full((1024, 10), float(k)))
        writer.flush()
except TraceError as error:
    print("TraceError", error)
    sys.exit(5)
"""


@pytest.mark.long
def test_a_full_disk_is_an_error_and_no_signal(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(tmp_path / "o.h5")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 5, done.stderr
    assert "TraceError" in done.stdout


def test_too_little_room_is_seen_before_anything_is_written(tmp_path, monkeypatch):
    writer = TraceWriter(tmp_path / "o.h5", Layout((Column("x", 0, "m", "x", False),), 1, {}, ()))
    assert Trace.open(tmp_path / "o.h5").time.size == 0
    writer.append(np.ones((10, 10)))
    writer.flush()
    full = shutil.disk_usage(tmp_path)._replace(free=0)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: full)
    writer.append(np.ones((10, 10)))
    with pytest.raises(TraceError, match="no space"):
        writer.flush()
    assert Trace.open(tmp_path / "o.h5").time.size == 10
    assert [item.name for item in tmp_path.iterdir()] == ["o.h5"]


ENDLESS = """
import sys
sys.path.insert(0, {here!r})
import small_models as models
from sysdyn.runtime.trace import writing
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.simulate import simulate
writing.FLUSH_SECONDS = {flush}
manifest, binding, module = models.mass_spring()
print("begin", flush=True)
simulate(manifest, binding, load(module), Options({path!r}, 0.0, 1e9, every=None, rtol=1e-6))
"""


@pytest.mark.parametrize("flush", [0.8, 0.01])
@pytest.mark.long
def test_a_killed_run_leaves_a_readable_trace(tmp_path, flush):
    random.seed(int(flush * 100))
    for k in range(2):
        path = tmp_path / f"{k}.h5"
        code = textwrap.dedent(ENDLESS).format(here=str(HERE), path=str(path), flush=flush)
        process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
        process.stdout.readline()
        waited = time.monotonic()
        while not (path.exists() and path.stat().st_size > 0) and time.monotonic() - waited < 20:
            time.sleep(0.01)
        seconds = 0.3 + 1.2 * random.random()
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        trace = Trace.open(path)
        assert trace.attributes["final"] == 0
        if flush < 0.1 or seconds > 1.2:
            assert trace.time.size > 0
        assert np.isfinite(trace.time).all()
        assert (np.diff(trace.time) > 0).all()
        assert np.isfinite(trace["q_x"].values).all()
