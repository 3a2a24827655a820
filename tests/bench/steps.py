"""What a step of a large line costs: python tests/bench/steps.py [--sizes 300,3000,30000] [MODEL...]

For each model of models/benchmark with `param n` and each size: unknowns as written and as stepped, CPU time of an
accepted step of bdf and radau without rows (microseconds a section), over one integration at rtol 1e-6 or its first
steps; `grid`: one of n x n nodes.  For rc_ladder and grid beside IDA with KLU on a text of one unknown a node (peers),
both over tolerances by quarter decades, and IDA over two policies of refactoring: the cheapest run whose error in the
last voltage, the largest at ten instants, meets 1e-3, 1e-4, 1e-5 of its largest value; the reference is our radau at
1e-12.  (At the end alone an error that changes sign meets anything now and then.)  In brackets without the balance of
energy, which IDA does not keep either.  Without SUNDIALS (Debian: libsundials-dev, libsuitesparse-dev) ours alone.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from measuring import MODELS
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest, options_of
from sysdyn.cli.run.running import ready
from sysdyn.cli.run.start.starting import start
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.simulate import simulate

TOLERANCES = tuple(10.0 ** (-0.25 * k) for k in range(6, 25))
INSTANTS = 0.1 * np.arange(1, 11)
TARGETS = (1e-3, 1e-4, 1e-5)
SIZES = {"rc_ladder": ("ladder", 0.2), "grid": ("grid", 0.05)}
"""Of each model that has one its peer, and the largest voltage of the last node (V): what errors are relative to."""
GRID = Path(__file__).parent / "peers" / "grid.sd"
REPEATED, FIRST = 5, 200
"""Runs of which the fastest counts; steps that are timed."""
LONG = 100_000
"""Sections beyond which each run counts."""
LIBRARIES = ("ida", "nvecserial", "sunmatrixsparse", "sunlinsolklu", "generic")


class _CaughtError(Exception):
    """An integration that was made but not run."""


class Line:
    """A model at a size, ready to be integrated.  name: of models/benchmark, or a file with one scene."""

    def __init__(self, name: str | Path, n: int, folder: Path) -> None:
        path = MODELS / "benchmark" / f"{name}.sd" if isinstance(name, str) else name
        scene, report = "reference" if isinstance(name, str) else None, Report()
        settings = (("n", str(n)),)
        request = RunRequest(str(path), scene, output=str(folder / "trace.h5"), settings=settings)
        target = targets.one(targets.read(str(path), report), str(path), None, scene, report)
        assert target is not None
        with ex.fresh():
            prepared = ready(request, target, report)
            assert prepared is not None
            options = options_of(request, target, prepared, report, time.monotonic(), None)
            assert options is not None
            self.started = start(prepared, options.t_start, report, options.redundancy)
        self.prepared, self.options = prepared, replace(options, accuracy=None, sample_steps=False)

    def integration(self, method: str, rtol: float) -> Integration:
        """One integration, made as a simulation makes it."""
        made: list[Integration] = []

        def caught(integration: Integration, *_: object) -> None:
            made.append(integration)
            raise _CaughtError

        options = replace(self.options, method=method, rtol=rtol)
        with patch.object(Integration, "run", caught), suppress(_CaughtError):
            simulate(
                self.prepared.structure, self.prepared.arrays, self.prepared.carrier, options,
                start=self.started.state, facts=self.started.facts,
            )  # fmt: skip
        return made[0]

    def run(
        self, method: str, rtol: float, repeated: int = REPEATED, most: int = 1 << 40, *, audited: bool = True
    ) -> tuple[float, int, Integration]:
        """CPU seconds of the fastest of some runs of at most that many steps without rows, steps, the integration;
        audited: with the balance of energy.
        """
        least = float("inf")
        for _ in range(repeated):
            made = self.integration(method, rtol)
            made.driver.run.every_step = 0
            made.driver.run.sizes_at_steps = 0
            if not audited:
                made.driver.run.audit = None
            began = time.process_time()
            lib.core.sd_run_advance(made.driver.core, most, 1e9)
            least = min(least, time.process_time() - began)
        return least, made.method.contents.steps, made


def last_voltages(line: Line, method: str, rtol: float) -> Floats:
    """Of the ladder or grid: what the trace calls y_end, at INSTANTS."""
    made, found = line.integration(method, rtol), []
    made.driver.run.every_step = made.driver.run.sizes_at_steps = 0
    names = [row.name for row in made.system.description.rows if row.block == "observe"]
    values = np.zeros(made.driver.observed + 1)
    while len(found) < INSTANTS.size and lib.core.sd_run_advance(made.driver.core, 1, 1e9) < 2:
        for t in INSTANTS[len(found) :][INSTANTS[len(found) :] <= made.method.contents.t]:
            lib.core.sd_run_observe(made.driver.core, t, lib.pointer(values))
            found.append(values[names.index("y_end")])
    return np.array(found)


class Peer:
    """One of peers; `program` None: SUNDIALS is not here."""

    def __init__(self, name: str, folder: Path) -> None:
        source = Path(__file__).parent / "peers" / f"{name}.c"
        libraries = [*(f"-lsundials_{name}" for name in LIBRARIES), "-lklu", "-lm"]
        self.program: Path | None = folder / name
        command = ["cc", "-O2", "-march=native", "-w", "-I/usr/include/suitesparse", str(source), "-o"]
        if subprocess.run([*command, str(self.program), *libraries], capture_output=True, check=False).returncode:
            self.program = None

    def run(self, n: int, rtol: float, policy: str, repeated: int = REPEATED) -> tuple[float, int, Floats]:
        """CPU seconds of the fastest of some, steps, last voltages."""
        least, steps, values = float("inf"), -1, np.zeros(0)
        for _ in range(repeated):
            found = subprocess.run(
                [str(self.program), str(n), repr(rtol), policy], capture_output=True, text=True, check=True
            ).stdout.split()
            least, steps, values = min(least, float(found[1])), int(found[0]), np.array(found[2:], dtype=np.float64)
        return least, steps, values


def race(line: Line, n: int, peer: Peer, size: float) -> None:
    """Both at equal errors."""
    repeated = 1 if n > LONG else REPEATED
    exact = last_voltages(line, "radau", 1e-12)
    ours: dict[tuple[str, bool], list[tuple[float, float]]] = {}
    for method in ("bdf", "radau"):
        for rtol in TOLERANCES:
            error = np.abs(last_voltages(line, method, rtol) - exact).max() / size
            for audited in (True, False):
                seconds = line.run(method, rtol, repeated, audited=audited)[0]
                ours.setdefault((method, audited), []).append((error, seconds))
    theirs = []
    for rtol in TOLERANCES:
        for policy in ("0.25", "0.01"):
            seconds, steps, values = peer.run(n, rtol, policy, repeated)
            theirs += [(np.abs(values - exact).max() / size, seconds)] if steps > 0 else []
    for target in TARGETS:
        bdf, alone, radau, radau_alone, ida = (
            1e3 * min((seconds for error, seconds in runs if error <= target), default=float("nan"))
            for runs in (*ours.values(), theirs)
        )
        times = f"bdf {bdf:.2f} ({alone:.2f}) ms, radau {radau:.2f} ({radau_alone:.2f}) ms, IDA-KLU {ida:.2f} ms"
        best = min(bdf, radau), min(alone, radau_alone)
        ratios = f"IDA/bdf {ida / bdf:.2f} ({ida / alone:.2f}), IDA/best {ida / best[0]:.2f} ({ida / best[1]:.2f})"
        print(f"  error {target:.0e}: {times}; {ratios}", flush=True)


def main() -> None:
    """Prints a line a model, size and method."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sizes", default="300,3000,30000")
    parser.add_argument("models", nargs="*", default=["rc_ladder", "lc_line", "nltl"])
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in asked.models:
            made, size = SIZES.get(name, (None, 1.0))
            peer = Peer(made, Path(folder)) if made is not None else None
            if name == "grid":
                (Path(folder) / "grid.sd").write_text(GRID.read_text())
            for n in map(int, asked.sizes.split(",")):
                line = Line(Path(folder) / "grid.sd" if name == "grid" else name, n, Path(folder))
                for method in ("bdf", "radau"):
                    seconds, steps, run = line.run(method, 1e-6, 1 if n > LONG else REPEATED, FIRST)
                    unknowns = f"{run.system.unknowns} unknowns, {run.stepped.unknowns} stepped"
                    each = f"{1e3 * seconds / steps:.4f} ms a step, {1e6 * seconds / steps / n:.3f} us a section"
                    print(f"{name} {n} {method}: {unknowns}; {steps} steps, {each}", flush=True)
                if peer is not None and peer.program is not None:
                    race(line, n, peer, size)


if __name__ == "__main__":
    main()
