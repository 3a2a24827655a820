"""What large models cost before their first step: python tests/bench/large.py [--sections N ...] [--grid N] [--steps N]

CPU seconds and largest resident memory of a process, imports included: `check` of the gallery's line; text to first
step (`simulate --max-steps 1`) of the line at several lengths, and of a grid of N x N nodes with a resistance between
neighbours and a capacitance to ground at each.  --steps: the same to so many accepted steps of a run, where what
integrates is at its largest.  Below a million unknowns pages that a stage left stay with the process, which saves a
tenth of the time and costs a sixth more memory; beyond they go back to the machine.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

LINE = Path(__file__).parents[2] / "models" / "gallery" / "transmission_line.sd"
GRID = """from std.electrical import resistor, capacitor, voltage

model grid {{
  param n = {n}
  node v[1..n, 1..n]: electrical
  source: voltage(v = 1 V*smoothstep(t/(1 ms))) v[1, 1] -> ground
  for i in 1..n {{
    for j in 1..n - 1 {{
      across[i, j]: resistor(R = 1 kohm) v[i, j] -> v[i, j + 1]
      down[j, i]: resistor(R = 1 kohm) v[j, i] -> v[j + 1, i]
    }}
    for j in 1..n {{
      C[i, j]: capacitor(C = 1 uF) v[i, j] -> ground
    }}
  }}
}}

scene edge of grid {{
  time 0 s to 10 ms
  trace v[n, n].e
}}
"""


@cache
def _environment() -> dict[str, str]:
    """Of a command, whose modules were compiled by another one before."""
    kept = Path(tempfile.gettempdir()) / "sysdyn-bench-bytecode"
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(kept)
    with tempfile.TemporaryDirectory() as folder:
        first = "simulate", str(LINE), "--set", "n=1000", "--max-steps", "1", "-o", str(Path(folder) / "first.h5")
        subprocess.run([sys.executable, "-m", "sysdyn", *first], capture_output=True, env=environment, check=False)
    return environment


def cost(*arguments: str) -> str:
    """CPU seconds and MB of one command, with Python's modules compiled before as in an installed package.  It ends as
    asked, or at its limit of steps; SystemExit with what it says otherwise: one that fails early looks fast.
    """
    environment = _environment()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    # a process of its own reads the memory of the one command that it runs
    script = "import resource, subprocess, sys; ran = subprocess.run(sys.argv[1:], stdout=-3, stderr=-1); "
    script += "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); "
    script += "sys.exit(ran.stderr.decode() if ran.returncode and b'E934' not in ran.stderr else 0)"
    command = [sys.executable, "-c", script, sys.executable, "-m", "sysdyn", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    memory = int(done.stdout)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return f"{spent:8.2f} s CPU {memory / 1024.0:8.0f} MB"


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sections", type=int, nargs="*", default=[10_000, 100_000])
    parser.add_argument("--grid", type=int, default=100)
    parser.add_argument("--steps", type=int, default=1)
    asked = parser.parse_args()
    print("check, 100000 sections     ", cost("check", str(LINE)), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        first = "--max-steps", str(asked.steps), "-o", str(Path(folder) / "first.h5")
        for n in asked.sections:
            found = cost("simulate", str(LINE), "--set", f"n={n}", *first)
            print(f"{asked.steps:3d} steps, {n:8d} sections", found, flush=True)
        grid = Path(folder) / "grid.sd"
        grid.write_text(GRID.format(n=asked.grid))
        found = cost("simulate", str(grid), *first)
        print(f"{asked.steps:3d} steps, {asked.grid:4d} x {asked.grid:4d} nodes ", found, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
