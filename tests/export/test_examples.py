"""The examples of models/embedding, built by their own first lines and run without sysdyn on the path."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from exported import COMPILER, MODELS, compiled
from scipy.integrate import solve_ivp

EMBEDDING = MODELS / "embedding"
SUNDIALS = ("-lsundials_ida", "-lsundials_nvecserial", "-lsundials_sunlinsoldense", "-lsundials_sunmatrixdense")
CPP = shutil.which("c++") or shutil.which("g++")
HEADER = any(os.path.isfile(f"{place}/include/ida/ida.h") for place in ("/usr", "/usr/local"))  # noqa: PTH113


def exact():
    """The end of a pendulum of 1.2 m released at 10 degrees, from its angle alone."""
    found = solve_ivp(
        lambda t, x: [x[1], -9.81 / 1.2 * np.sin(x[0])],
        (0, 4),
        [np.pi / 18, 0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    )
    return np.array([1.2 * np.sin(found.y[0, -1]), -1.2 * np.cos(found.y[0, -1])])


def export(folder, *options):
    assert compiled(folder, "seed/pendulum", "--scene", "reference", *options) == 0


def printed(command, folder, **environment):
    """The numbers of a program's output; its environment knows neither sysdyn nor this folder."""
    plain = {name: os.environ[name] for name in ("PATH", "HOME", "LD_LIBRARY_PATH") if name in os.environ}
    ran = subprocess.run(
        command, cwd=folder, env=plain | environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert ran.returncode == 0, ran.stderr
    return np.array([float(word) for word in ran.stdout.split()])


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.skipif(not HEADER, reason="no SUNDIALS: apt-get install libsundials-dev")
@pytest.mark.long
def test_ida(tmp_path):
    export(tmp_path)
    sources = [str(EMBEDDING / "ida.c"), "residual.c", "binding.c"]
    subprocess.run([COMPILER, "-I.", "-o", "run", *sources, *SUNDIALS, "-lm"], cwd=tmp_path, check=True)
    assert np.max(np.abs(printed(["./run"], tmp_path) - exact())) < 1e-6


@pytest.mark.long
def test_scipy(tmp_path):
    export(tmp_path, "--index", "0", "--backend", "numpy")
    blocked = tmp_path / "sysdyn"  # whoever imported sysdyn would fail
    blocked.mkdir()
    (blocked / "__init__.py").write_text("raise ImportError('sysdyn is not here')\n")
    found = printed([sys.executable, str(EMBEDDING / "with_scipy.py")], tmp_path, PYTHONPATH=str(tmp_path))
    assert np.max(np.abs(found - exact())) < 1e-6


@pytest.mark.skipif(COMPILER is None or CPP is None, reason="no C++ compiler")
def test_cpp(tmp_path):
    export(tmp_path, "--index", "0")
    subprocess.run([COMPILER, "-c", "residual.c", "binding.c"], cwd=tmp_path, check=True)
    source = str(EMBEDDING / "runge_kutta.cpp")
    command = [CPP, "-Wall", "-Wextra", "-Werror", "-I.", "-o", "run", source, "residual.o", "binding.o", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert np.max(np.abs(printed(["./run"], tmp_path) - exact())) < 1e-8
