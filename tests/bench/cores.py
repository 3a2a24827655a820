"""What a second core is worth: python tests/bench/cores.py [--sizes 3000,30000,100000] [--grid 100] [--commands]

Wall and CPU time of an accepted step without rows, by one thread of the core and by two in turns, the least of some:
the RC ladder and the LC line at several lengths, a grid of N x N nodes, by bdf and radau at rtol 1e-6.  --commands: the
same of commands with `--jobs 1`, `--jobs 2` and as they choose by themselves.  Where others share the machine, root
gets both cores for the time of a measurement (SCHED_FIFO).
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from large import GRID
from measuring import MODELS
from steps import Line
from sysdyn.runtime.model.core_library import core

STEPS, REPEATED = {3000: 300, 30000: 60, 100000: 30}, 3
GOLDENS = ("benchmark-andrews", "seed-coulomb_planar", "seed-ebers_moll", "seed-em_suspension")
COMMANDS = (
    ("verify", str(MODELS / "gallery" / "transmission_line.sd")),
    ("verify", str(MODELS / "gallery" / "pendulum.sd")),
    ("check", str(MODELS / "gallery")),
    ("golden", "check", "--folder", str(MODELS.parent / "tests" / "golden"), *GOLDENS),
)


@contextmanager
def both_cores() -> Iterator[None]:
    """First claim to the cores, where that may be had."""
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    try:
        yield
    finally:
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def measured(cpu: Callable[[], float], work: Callable[[], object]) -> tuple[float, float]:
    """Wall and CPU seconds."""
    with both_cores():
        wall, spent = time.perf_counter(), cpu()
        work()
        return time.perf_counter() - wall, cpu() - spent


def stepped(line: Line, method: str, steps: int) -> str:
    """A step by one thread and by two: wall (CPU) in ms, and the gain."""
    best: dict[int, tuple[float, float]] = {}
    for _ in range(REPEATED):
        for threads in (1, 2):
            core.sd_threads_use(threads)
            made = line.integration(method, 1e-6)
            made.driver.run.every_step = 0
            made.driver.run.sizes_at_steps = 0
            found = measured(time.process_time, partial(core.sd_run_advance, made.driver.core, steps, 1e9))
            each = 1e3 / made.method.contents.steps
            before = best.get(threads, (float("inf"), float("inf")))
            best[threads] = min(before[0], found[0] * each), min(before[1], found[1] * each)
    one, two = best[1], best[2]
    return f"{one[0]:.3g} ({one[1]:.3g}) and {two[0]:.3g} ({two[1]:.3g}) ms, {one[0] / two[0]:.2f} x"


def commanded(arguments: tuple[str, ...]) -> str:
    """A command by one process, by two, and as it chooses: wall (CPU) in s."""

    def children() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    told = []
    for options in (("--jobs", "1"), ("--jobs", "2"), ()):
        command = [sys.executable, "-m", "sysdyn", *arguments, *options, "--quiet"]
        found = [measured(children, partial(_run, command)) for _ in range(REPEATED)]
        told.append(f"{min(wall for wall, _ in found):.2f} ({min(cpu for _, cpu in found):.2f})")
    return f"jobs 1 {told[0]}, jobs 2 {told[1]}, by itself {told[2]} s"


def _run(command: list[str]) -> None:
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main() -> None:
    """Prints a line a measurement."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sizes", default="3000,30000,100000")
    parser.add_argument("--grid", type=int, default=100)
    parser.add_argument("--commands", action="store_true")
    asked = parser.parse_args()
    if asked.commands:
        for arguments in COMMANDS:
            print(" ".join(Path(a).name for a in arguments), commanded(arguments), flush=True)
        return
    with tempfile.TemporaryDirectory() as folder:
        grid = Path(folder) / "grid.sd"
        grid.write_text(GRID.format(n=asked.grid))
        named: list[tuple[str | Path, int]] = [
            (name, int(n)) for name in ("rc_ladder", "lc_line") for n in asked.sizes.split(",")
        ]
        for name, n in [*named, (grid, asked.grid)]:
            line = Line(name, n, Path(folder))
            for method in ("bdf", "radau"):
                found = stepped(line, method, STEPS.get(n, 30))
                print(f"{name if isinstance(name, str) else 'grid'} {n} {method}: {found}", flush=True)


if __name__ == "__main__":
    main()
