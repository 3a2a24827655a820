"""Both carriers of a compiled model for tests: the C library by ctypes, the NumPy module by import."""

import ctypes
import importlib.util
import itertools

import numpy as np
from sysdyn.compiler.binding.places import starts
from sysdyn.compiler.program.build import build
from sysdyn.compiler.program.emit_c import emit_c
from sysdyn.compiler.program.emit_numpy import emit_numpy

_serial = itertools.count()


class Frame(ctypes.Structure):
    _fields_ = [(n, ctypes.c_void_p) for n in ("p", "ix", "at", "to", "spared")]


def sizes(patterns, ix):
    """Iterations of each kernel from the manifest's patterns alone."""
    for pattern in patterns:
        count = 0
        ranges = [()]
        for first, last in pattern.loops:
            ranges = [
                (*outer, i) for outer in ranges for i in range(_value(first, outer, ix), _value(last, outer, ix) + 1)
            ]
        count = len(ranges)
        yield count


def _value(index, outer, ix):
    return (outer[index.loop] if index.loop >= 0 else 0) + (ix[index.slot] if index.slot >= 0 else 0) + index.constant


class Carrier:
    def __init__(self, program, form, binding):
        self.program, self.form, self.binding = program, form, binding
        self.at, self.to = starts(binding.shapes), starts(binding.row_shapes)
        self.patterns = dict(program.patterns)

    def count(self, block, part):
        patterns = self.patterns.get(block, ())
        return sum(n * len(getattr(p, part)) for n, p in zip(sizes(patterns, self.binding.ix), patterns, strict=True))

    def rows(self, block, t, y, yd):
        r = np.zeros(self.to[-1])
        if block in self.patterns:
            self.call(f"{block}_rows", t, y, yd, r)
        return r

    def entries(self, block, part, t, y, yd):
        v = np.zeros(self.count(block, part))
        if len(v):
            self.call(f"{block}_{part}", t, y, yd, v)
        return v


class CCarrier(Carrier):
    spared = None

    def __init__(self, program, form, binding):
        super().__init__(program, form, binding)
        self.library = ctypes.CDLL(str(build(emit_c(program, form), ("-O1", *FLAGS))))

    def call(self, name, t, y, yd, out):
        b = self.binding
        frame = Frame(*(a.ctypes.data for a in (b.p, b.ix, self.at, self.to)), self.spared and self.spared.data)
        function = getattr(self.library, f"sd_{name}")
        function.restype = None
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (y, yd, out)]
        function(ctypes.byref(frame), ctypes.c_double(t), *pointers)


FLAGS = ("-std=c11", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Werror")


class NumpyCarrier(Carrier):
    def __init__(self, program, form, binding, folder):
        super().__init__(program, form, binding)
        path = folder / f"model_{next(_serial)}.py"
        path.write_text(emit_numpy(program, form))
        spec = importlib.util.spec_from_file_location(path.stem, path)
        self.module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.module)

    def call(self, name, t, y, yd, out):
        b = self.binding
        getattr(self.module, name)(b.p, b.ix, self.at, self.to, t, y, yd, out)
