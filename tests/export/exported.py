"""Compiles models of `models/` into folders, and calls what was written as an outsider does."""

import ctypes
import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from sysdyn.cli.main import run

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "models"
FLAGS = ("-std=c11", "-O1", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno")
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
_POINTER = ctypes.POINTER(ctypes.c_double)


class Outside:
    """A compiled export through ctypes: the functions of sysdyn_model.h on NumPy arrays."""

    def __init__(self, folder):
        self.folder = Path(folder)
        library = self.folder / "model.so"
        sources = [str(self.folder / name) for name in ("residual.c", "binding.c")]
        subprocess.run([COMPILER, *FLAGS, "-Wall", "-Wextra", "-Werror", "-o", library, *sources, "-lm"], check=True)
        self.library = ctypes.CDLL(str(library))
        self.binding = json.loads((self.folder / "binding.json").read_text())
        self.n, self.entries, self.parameters, self.outputs_number = (
            ctypes.c_int32.in_dll(self.library, f"sd_n_{name}").value
            for name in ("unknowns", "entries", "parameters", "outputs")
        )
        self.t0 = ctypes.c_double.in_dll(self.library, "sd_t0").value
        self.p0, self.y0, self.yd0, self.scale = (
            self._array(ctypes.c_double, name, size)
            for name, size in (("p0", self.parameters), ("y0", self.n), ("yd0", self.n), ("scale", self.n))
        )
        self.column = self._array(ctypes.c_int32, "colptr", self.n + 1)
        self.row = self._array(ctypes.c_int32, "rowind", self.entries)
        self.places = {item["name"]: item for item in self.binding["parameters"]}

    def _array(self, kind, name, size):
        return np.array((kind * max(size, 1)).in_dll(self.library, f"sd_{name}"))[:size]

    def _call(self, name, arguments, size):
        out = np.zeros(max(size, 1))
        keep = [a if isinstance(a, float) else np.ascontiguousarray(a, dtype=float) for a in arguments]
        made = [ctypes.c_double(a) if isinstance(a, float) else a.ctypes.data_as(_POINTER) for a in keep]
        code = getattr(self.library, f"sd_{name}")(*made, out.ctypes.data_as(_POINTER))
        return code, out[:size]

    def residual(self, t, y, yd, p=None):
        """Code and r."""
        return self._call("residual", (float(t), y, yd, self.p0 if p is None else p), self.n)

    def jacobian(self, t, y, yd, cj, p=None):
        """Code and values."""
        return self._call("jacobian", (float(t), y, yd, float(cj), self.p0 if p is None else p), self.entries)

    def mass(self, t, y, yd, p=None):
        """Code and values."""
        return self._call("mass", (float(t), y, yd, self.p0 if p is None else p), self.entries)

    def outputs(self, t, y, yd, p=None):
        """Code and w."""
        return self._call("outputs", (float(t), y, yd, self.p0 if p is None else p), self.outputs_number)

    def follow(self, p):
        """Code and the parameters."""
        p = np.array(p, dtype=float)
        return self.library.sd_follow(p.ctypes.data_as(_POINTER)), p

    def start(self, p):
        """Code, y, yd."""
        p, y, yd = np.array(p, dtype=float), np.zeros(self.n), np.zeros(self.n)
        code = self.library.sd_start(*(a.ctypes.data_as(_POINTER) for a in (p, y, yd)))
        return code, y, yd

    def changed(self, **values):
        """Parameters with some of them replaced, and what follows from these."""
        p = self.p0.copy()
        for name, value in values.items():
            p[self.places[name]["place"]] = value
        code, p = self.follow(p)
        assert code == 0
        for name, value in values.items():
            p[self.places[name]["place"]] = value
        return p

    def dense(self, values):
        """Values on the pattern as a full matrix."""
        full = np.zeros((self.n, self.n))
        full[self.row, np.repeat(np.arange(self.n), np.diff(self.column))] = values
        return full


def compiled(folder, model, *options):
    """`sysdyn compile` of a model's file; the exit code."""
    path = model if Path(model).is_absolute() else MODELS / f"{model}.sd"
    return run(["compile", "-q", str(path), "-o", str(folder), *options])


def module(folder):
    """residual.py of a folder as a module of its own."""
    name = f"exported_{abs(hash(str(folder)))}"
    spec = importlib.util.spec_from_file_location(name, Path(folder) / "residual.py")
    found = importlib.util.module_from_spec(spec)
    sys.modules[name] = found
    spec.loader.exec_module(found)
    return found
