"""Time and memory of `sysdyn diff` on large traces: python tests/comparison/bench.py [POINTS] [VARIABLES] [FOLDER].

Two pairs: the same instants in both traces, and other instants in the test.  Derivatives are stored for every quantity.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

CHUNK = 1024
RUN = "import sys; from sysdyn.cli.main import main; main(sys.argv[1:])"


def write(path, instants, variables, shift):
    """A trace of sines; shift: relative difference of the values."""
    with h5py.File(path, "w", libver=("earliest", "v110")) as file:
        file.create_dataset("time", data=instants, chunks=(CHUNK,)).attrs["units"] = "s"
        for k in range(variables):
            w = 10.0 + k
            data = file.create_dataset(f"x{k}", data=np.sin(w * instants) * (1.0 + shift), chunks=(CHUNK,))
            data.attrs["units"], data.attrs["nominal"] = "m", 1.0
            data.attrs["derivative"] = f"/derivatives/x{k}"
            rates = w * np.cos(w * instants) * (1.0 + shift)
            file.create_dataset(f"/derivatives/x{k}", data=rates, chunks=(CHUNK,))


def measure(one, two):
    """(wall s, CPU s, peak MB, first line) of one comparison."""
    began = time.monotonic()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ran = subprocess.run([sys.executable, "-c", RUN, "diff", one, two], capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert ran.returncode == 0, ran.stdout[:500] + ran.stderr
    wall, cpu = time.monotonic() - began, after.ru_utime - before.ru_utime
    return wall, cpu, after.ru_maxrss / 1024, ran.stdout.splitlines()[0]


def main(points=1_000_000, variables=100, folder=None):
    """Write, compare, print."""
    with tempfile.TemporaryDirectory(dir=folder) as place:
        ref, same, other = (str(Path(place) / f"{name}.h5") for name in ("ref", "same", "other"))
        even = np.linspace(0.0, 10.0, points)
        uneven = np.sort(np.random.default_rng(1).uniform(0.0, 10.0, points))
        uneven[0], uneven[-1] = 0.0, 10.0
        write(ref, even, variables, 0.0)
        for path, instants, what in ((same, even, "same instants"), (other, uneven, "other instants")):
            write(path, instants, variables, 1e-5)
            wall, cpu, memory, line = measure(ref, path)
            print(f"{points} x {variables}, {what}: {wall:.1f} s wall, {cpu:.1f} s CPU, {memory:.0f} MB: {line}")
            Path(path).unlink()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:4])
