"""What of this machine sysdyn lives on: versions, compiler, cache, trace files, and a small run of known result."""

from __future__ import annotations

import importlib.metadata
import math
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import sysdyn
from sysdyn import distribution
from sysdyn.cli.options import BACKENDS
from sysdyn.values import dataclass

NEEDED = ("click", "h5py", "lark", "matplotlib", "numpy", "scipy", "sympy")
ROOM = 100 << 20
"""Bytes that should be free for traces and compiled models."""
SWING = """## A swing of known period.
model swing {
  coord x: translation = 1 m
  energy T* = 1/2*(2 kg)*x'^2
  energy V = 1/2*(8 N/m)*x^2
  init x' = 0 m/s
}

scene once of swing {
  time 0 s to 3 s
  accuracy 1e-6
  trace x
}
"""
NEAR = 1e-5
"""Error of the small run, of its amplitude: ten times the accuracy that it asks for."""


@dataclass(frozen=True, slots=True)
class HealthFinding:
    """One thing looked at; state is ok, warning (a part of the product is slower or missing) or error."""

    name: str
    state: str
    said: str
    help: str | None = None


def examine() -> Iterator[HealthFinding]:
    """Look at everything; what raises is a finding too."""
    looks: tuple[tuple[str, Callable[[], Iterator[HealthFinding]]], ...] = (
        ("versions", _versions),
        ("core", _core),
        ("compiler", _compiler),
        ("cache", _cache),
        ("trace files", _hdf5),
        ("run", _runs),
    )
    for name, look in looks:
        try:
            yield from look()
        except Exception as error:  # whatever this machine does: it is what was asked
            yield HealthFinding(name, "error", f"{type(error).__name__}: {error}")


def _versions() -> Iterator[HealthFinding]:
    """Versions of sysdyn, Python and packages; another project's files in the same place."""
    yield HealthFinding("sysdyn", "ok", f"{sysdyn.__version__}, {Path(__file__).parents[2]}")
    others = list(importlib.metadata.distributions(name=distribution.TAKEN))
    if others:
        other = f"{distribution.TAKEN} {others[0].version}, {others[0].locate_file('')}"
        yield HealthFinding(
            "sysdyn", "error", "another project's files are in the same folder", distribution.advise(other)
        )
    yield HealthFinding("python", "ok", f"{platform.python_version()}, {sys.executable}; {platform.platform()}")
    found, missing = [], []
    for name in NEEDED:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    yield HealthFinding("packages", "ok", ", ".join(found))
    if missing:
        yield HealthFinding("packages", "error", f"not there: {', '.join(missing)}", f"pip install {' '.join(missing)}")


def _core() -> Iterator[HealthFinding]:
    try:
        from sysdyn.runtime import _core as core
    except ImportError as error:
        yield HealthFinding("core", "error", str(error), f"install {distribution.NAME} again: the core is built then")
        return
    yield HealthFinding("core", "ok", str(core.__file__))


def _compiler() -> Iterator[HealthFinding]:
    """Whether a C compiler is there and makes a library, and how long it takes."""
    from sysdyn.compiler.program import build

    help_ = "install gcc or clang, or set CC; until then models run by --backend numpy"
    try:
        command, options = build.compiler()
        began = time.monotonic()
        built = build.build(f"/* {os.getpid()} {time.time_ns()} */\nint sd_doctor(void) {{ return 1; }}\n")
        built.unlink(missing_ok=True)
        said = f"{' '.join((*command, *options))}, a library in {time.monotonic() - began:.2f} s"
        yield HealthFinding("compiler", "ok", said)
    except build.BuildError as error:
        first = error.output.strip().splitlines()[:1]
        yield HealthFinding("compiler", "warning", ": ".join([str(error), *first]), help_)


def _cache() -> Iterator[HealthFinding]:
    """Where compiled models are kept, how many and how large; a warning where it is not the folder asked for."""
    from sysdyn.compiler.program import cache

    folder, wanted = cache.folder(), cache.requested_folder()
    entries = [p.stat().st_size for p in folder.glob("model-*.so")]
    said = f"{folder}: {len(entries)} models, {sum(entries) / 1e6:.1f} of {cache.limit() / 1e6:.0f} MB"
    if folder != wanted:
        help_ = "a folder that is yours alone and writable: SYSDYN_CACHE=..."
        yield HealthFinding(
            "cache", "warning", f"{wanted} cannot be used; models are compiled anew in each process", help_
        )
    yield HealthFinding("cache", "ok", said)


def _hdf5() -> Iterator[HealthFinding]:
    """Whether trace files can be written and read, and the room for them."""
    import shutil

    import h5py

    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "probe.h5"
        with h5py.File(path, "w", libver=("earliest", "v110")) as file:
            file["x"] = [1.0, 2.0]
        with h5py.File(path) as file:
            assert list(file["x"]) == [1.0, 2.0]
        free = shutil.disk_usage(place).free
    yield HealthFinding("trace files", "ok", f"HDF5 {h5py.version.hdf5_version}, h5py {h5py.__version__}")
    if free < ROOM:
        yield HealthFinding("disk", "warning", f"{free / 1e6:.0f} MB are free in {tempfile.gettempdir()}", "TMPDIR=...")


def _runs() -> Iterator[HealthFinding]:
    """A swing by both backends against its cosine."""
    for backend in BACKENDS:
        yield _run(backend)


def _run(backend: str) -> HealthFinding:
    """A swing of three seconds by one backend against its closed form."""
    from sysdyn.cli.run.request.run_request import RunRequest
    from sysdyn.cli.run.running import run
    from sysdyn.dsl.text.diagnostics import Report

    began, report = time.monotonic(), Report()
    with tempfile.TemporaryDirectory() as place:
        model = Path(place) / "swing.sd"
        model.write_text(SWING, encoding="utf-8")
        ran = run(RunRequest(str(model), backend=backend, output=str(Path(place) / "swing.h5")), report)
        end = math.nan if ran is None else float(ran.outcome.traced["x"].values[-1])
    took = time.monotonic() - began
    name = f"run ({backend})"
    # it does not run here
    if ran is None or report.failed:
        return HealthFinding(name, "error", "; ".join(f"{d.code}: {d.message}" for d in report) or "it did not run")
    error = abs(end - math.cos(2.0 * 3.0))
    said = f"a swing of 3 s in {took:.2f} s, off by {error:.1e} of its amplitude"
    notes = [d.message for d in report if d.code == "N609"]
    # it runs, and is wrong
    if not error <= NEAR:
        return HealthFinding(name, "error", said, "this machine computes something else than others: please report it")
    return HealthFinding(name, "warning", "; ".join([said, *notes])) if notes else HealthFinding(name, "ok", said)
