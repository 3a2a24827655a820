"""What optional mechanisms earn: python tests/bench/ablate.py [--against REVISION] [--runs GROUP,...] [MECHANISM...]

A mechanism is optional where runs end without it.  Each has a switch: an edit of the sources that leaves it out
(`MECHANISMS`).  The package is built twice, with and without it, into folders of their own, and a worker of either
makes the named runs by turns: the least CPU of a call of `Model.run` and of the integrations within it
(`cpu_integrate_s`), whether the run is met, its method, steps, and how far the last values are from those of the other
build (over what was asked).
--against: the sources as they are beside those of a revision, in place of a mechanism.  --list: the table.

The rule: a mechanism stays if, per 500 lines, it earns a tenth of a call in the geometric mean of `runs`, or a factor
of 2 of the integrations of a class of models that users have; else it goes.  Whoever adds a mechanism adds its row.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
SECONDS, LEAST = 1.5, 3
"""Of a run: how long (s) it is repeated in either build, and how often at least."""
LONGEST = 60.0
"""Seconds after which a run is given up."""


@dataclass(frozen=True, slots=True)
class Mechanism:
    """files: what goes with it, which lines count; switch: (file, text, text that leaves it out); tests: that need it;
    earns: what was measured, integration / call without it, and where else.
    """

    name: str
    files: tuple[str, ...]
    switch: tuple[tuple[str, str, str], ...]
    tests: str
    earns: str

    @property
    def lines(self) -> int:
        """Lines of its files."""
        return sum(len((ROOT / file).read_text().splitlines()) for file in self.files)


_LINEAR, _RUN = "runtime/core/linear", "runtime/core/run"
MECHANISMS = (
    Mechanism(
        "condensing",
        tuple(
            f"runtime/condense/{name}.py" for name in ("composition", "condensed", "condenser", "elimination", "sums")
        ),
        (("runtime/integrate/request.py", "    condense: bool = True\n", "    condense: bool = False\n"),),
        "tests/runtime/test_condense.py, tests/models/test_condensed.py",
        "1.16 / 1.07; a grid of 60 x 60 nodes 38 times: stays",
    ),
    Mechanism(
        "all stages at once",
        ("runtime/core/steppers/radau/radau_coupled.c",),
        (
            (
                "runtime/core/steppers/radau/radau.c",
                "    if (cause == SD_NEWTON && one->fresh && radau->strained",
                "    if (0 && cause == SD_NEWTON && one->fresh && radau->strained",
            ),
        ),
        "tests/models/test_flat_chains.py",
        "0.98 / 1.00; without it radau stops at the dead centre of 7 of 16 chains of cranks: stays",
    ),
    Mechanism(
        "kept orders",
        tuple(f"{_LINEAR}/elimination/{name}.c" for name in ("elimination", "elimination_order")),
        (
            (
                f"{_LINEAR}/linear.c",
                "    if (!linear->elimination || linear->null_pivot",
                "    if (1 || linear->null_pivot",
            ),
        ),
        "tests/runtime/test_replays.py, tests/runtime/test_elimination.py",
        "with little LU 1.45 / 1.16, as machine code: stays",
    ),
    Mechanism(
        "little LU",
        (f"{_LINEAR}/dense/little_lu.h",),
        ((f"{_LINEAR}/linear.c", "    if (!linear->little || linear->null_pivot", "    if (1 || linear->null_pivot"),),
        "tests/runtime/test_little.py",
        "not measured by itself",
    ),
    Mechanism(
        "dense rest",
        (f"{_LINEAR}/sparse/dense_rest.h",),
        ((f"{_LINEAR}/sparse/dense_rest.h", "    if (lu->idle || lu->null_pivot != 0.0 ||", "    if (1 ||"),),
        "tests/runtime/test_sparse_factors.py",
        "not measured by itself",
    ),
    Mechanism(
        "rows told unsettled",
        ("runtime/core/system/settle_shown.c",),
        ((f"{_RUN}/rows.c", "(!stays(run, kind) && !meets(run, t))", "!stays(run, kind)"),),
        "tests/runtime/test_settled_rows.py",
        "netlists 1.32 / 1.05: stays",
    ),
    Mechanism(
        "powers by past steps",
        (),
        ((f"{_RUN}/meters/quadratures.c", "    run->by_past = known && run->sampled;", "    run->by_past = 0;"),),
        "tests/runtime/test_powers_summed.py",
        "not measured by itself",
    ),
    Mechanism(
        "rosenbrock in auto",
        tuple(f"runtime/core/steppers/rosenbrock/rosenbrock{part}.c" for part in ("", "_error", "_stages")),
        (
            (
                "runtime/accuracy/alternatives.py",
                '    return (replace(way, method="rosenbrock"),) if serves else ()\n',
                "    return ()\n",
            ),
        ),
        "tests/runtime/test_rosenbrock.py",
        "1.11; tube 2.8 to 15, van der Pol 3.2: stays",
    ),
    Mechanism(
        "search in C",
        ("runtime/core/start/search.c",),
        (("runtime/numerics/gauss_newton.py", "\nSMALL = 64\n", "\nSMALL = -1\n"),),
        "tests/runtime/test_starter.py",
        "1.02 / 1.12, netlists 1.07 / 1.60: stays",
    ),
)
"""What is optional and stays, and why.  Left out by the rule, with what their absence cost:
fronts (780 lines): 1.00 / 1.02; one-run accuracies (620): 1.03 / 1.01, grids
1.98, ladders 1.39; rows told from nodes (290), machine code (890): with these 1.19 / 1.01; threads of radau (320),
the pattern of a line's factors told by what changes (190): no CPU; chains of a line (250): ladders 1.19 / 1.00.
"""


@dataclass(frozen=True, slots=True)
class Run:
    """One named run: a model or netlist (a path from the root), its scene, the accuracy, parameters."""

    path: str
    scene: str
    accuracy: float
    values: tuple[tuple[str, float], ...] = ()

    @property
    def name(self) -> str:
        """NAME:VALUE@ACCURACY."""
        sizes = "".join(f":{value:g}" for _, value in self.values)
        return f"{Path(self.path).stem}{sizes}@{self.accuracy:g}"


BENCHMARK = (
    "akzo", "andrews", "beam", "caraxis", "crank", "fourbar", "hires", "lc_line", "nltl", "oregonator", "pendulum",
    "rc_ladder", "ring", "rober", "transistor", "tube", "vdpol",
)  # fmt: skip
NETLISTS = (
    "amp", "biquad", "boost", "buck", "colpitts", "ctrl", "diff", "inv", "latch", "lcf", "nand", "opamp", "osc", "rc",
    "rect", "ring", "rlc", "trafo", "wien", "zener",
)  # fmt: skip
MODELS = tuple(Run(f"models/benchmark/{name}.sd", "reference", a) for name in BENCHMARK for a in (1e-3, 1e-6))
CIRCUITS = tuple(Run(f"tests/cli/netlists/{name}.cir", "tran", 1e-3) for name in NETLISTS)


def _gallery(**scenes: str) -> tuple[Run, ...]:
    return tuple(Run(f"models/gallery/{name}.sd", scene, 1e-4) for name, scene in scenes.items())


def _seed(*names: str) -> tuple[Run, ...]:
    return tuple(Run(f"models/seed/{name}.sd", "reference", 1e-6) for name in names)


GROUPS: dict[str, tuple[Run, ...]] = {
    "models": MODELS,
    "netlists": CIRCUITS,
    "ladders": tuple(Run("models/benchmark/rc_ladder.sd", "reference", a, (("n", 1000),)) for a in (1e-2, 1e-3, 1e-6)),
    "grids": tuple(Run("tests/bench/peers/grid.sd", "reference", a, (("n", n),)) for n, a in ((20, 1e-4), (60, 1e-3))),
    "heat": tuple(Run("models/gallery/heat_exchanger.sd", "warm_up", a) for a in (1e-3, 1e-5)),
    "mechanisms": _seed("slider_crank", "two_link_arm", "parallelogram", "rectifier_motor_crank", "em_suspension"),
    "contacts": _gallery(
        stick_slip="squeal",
        backlash_gear="to_and_fro",
        clutch_launch="launch",
        newtons_cradle="click",
        rocking_block="rock",
    ),
    "converters": _gallery(buck_converter="start", diode_bridge="mains", six_pulse_rectifier="mains"),
    "steep": _seed("diode_circuit", "ebers_moll", "coulomb_planar", "brake_by_wire"),
}
"""The 54 runs are `models` and `netlists`; the others are classes of models."""
RUNS = "models", "netlists"


def worker() -> None:
    """Make the runs that come line by line; say what they took and came to."""
    from sysdyn.api import ModelError, load
    from sysdyn.cli.main import run as command
    from sysdyn.runtime.trace.trace import Trace

    warnings.simplefilter("ignore")
    loaded: dict[str, Any] = {}
    out, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        asked = json.loads(line)
        key, path = json.dumps([asked["path"], asked["values"]]), ROOT / asked["path"]
        try:
            if key not in loaded:
                loaded.clear()
                if path.suffix == ".cir":
                    text = Path(f"{path.stem}.sd")
                    command(["import", str(path), "-o", str(text), "--quiet"])
                    path = text
                loaded[key] = load(path, scene=asked["scene"], set=dict(asked["values"]))
            began = time.process_time()
            try:
                trace = loaded[key].run(accuracy=asked["accuracy"], output="t.h5", unmet="warn", max_wall=LONGEST)
            except ModelError:  # a claim of the scene at another accuracy than its own
                trace = Trace.open(Path("t.h5"))
            call = time.process_time() - began
            attributes = trace.attributes
            found: dict[str, Any] = {"call": call, "own": trace.timings["cpu_integrate_s"]}
            found |= {"met": bool(attributes["met"]), "method": str(attributes["method"])}
            found["steps"] = json.loads(attributes["statistics"])["steps"]
            found["values"] = {name: (float(trace[name][-1]), float(trace[name].nominal)) for name in trace.names}
        except Exception as failed:  # a verdict too
            found = {"failed": f"{type(failed).__name__}: {failed}"[:300]}
        print(json.dumps(found), file=out, flush=True)


class Worker:
    """A process that makes runs with one build."""

    def __init__(self, build: Path) -> None:
        (build.parent / f"{build.name}-runs").mkdir()
        environment = os.environ | {"PYTHONPATH": str(build), "SYSDYN_CACHE": str(build.parent / f"{build.name}-cache")}
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            cwd=build.parent / f"{build.name}-runs",
            env=environment | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )

    def make(self, run: Run) -> dict[str, Any]:
        """What a run took and came to."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        asked = {"path": run.path, "scene": run.scene, "accuracy": run.accuracy, "values": run.values}
        print(json.dumps(asked), file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline()
        return json.loads(answer) if answer else {"failed": "the worker died"}


def build(to: Path, revision: str | None, switch: tuple[tuple[str, str, str], ...] = ()) -> Path:
    """The package of a revision (None: of the tree as it is) with a switch, in a folder."""
    tree = to.parent / f"{to.name}-tree"
    tree.mkdir()
    if revision is None:
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
        files = b"\0".join(file for file in listed.split(b"\0") if file and (ROOT / file.decode()).exists())
        pack = subprocess.run(
            ["tar", "--null", "--files-from=-", "-cf", "-"], cwd=ROOT, input=files, capture_output=True, check=True
        )
    else:
        pack = subprocess.run(["git", "archive", revision], cwd=ROOT, capture_output=True, check=True)
    subprocess.run(["tar", "-xf", "-"], cwd=tree, input=pack.stdout, check=True)
    for file, old, other in switch:
        text = (tree / file).read_text()
        assert text.count(old) == 1, f"{file}: the switch's text stands {text.count(old)} times"
        (tree / file).write_text(text.replace(old, other))
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(to), str(tree)]
    subprocess.run(command, check=True)
    return to


def compare(one: Worker, other: Worker, run: Run) -> tuple[float, float] | None:
    """Of a run without over with: integration, call; a row is printed.  None where one of both failed."""
    pairs = [(one.make(run), other.make(run))]  # the first compiles
    if not any("failed" in found for found in pairs[0]):
        end = time.monotonic() + 2.0 * SECONDS
        while len(pairs) <= LEAST or time.monotonic() < end:
            pairs.append((one.make(run), other.make(run)))
    with_, without = pairs[-1]
    if "failed" in with_ or "failed" in without:
        print(f"{run.name:32s} {with_.get('failed', 'ends')} | {without.get('failed', 'ends')}", flush=True)
        return None
    least = [[min(pair[k][what] for pair in pairs) for k in (0, 1)] for what in ("own", "call")]
    own, call = (after / before for before, after in least)
    off = max(
        abs(value - without["values"][name][0]) / (nominal * run.accuracy)
        for name, (value, nominal) in with_["values"].items()
        if nominal > 0.0
    )
    verdict = "  ".join(
        f"{'met' if found['met'] else 'NOT'} {found['method']} {found['steps']}" for found in (with_, without)
    )
    changed = " !" if with_["met"] != without["met"] else ""
    times = f"{1e3 * least[0][0]:9.2f} {own:6.3f} {1e3 * least[1][0]:9.1f} {call:6.3f}"
    print(f"{run.name:32s} {times} {off:8.1e}  {verdict}{changed}", flush=True)
    return own, call


def mean(values: list[float]) -> float:
    """Geometric."""
    return math.exp(sum(map(math.log, values)) / len(values)) if values else math.nan


def ablate(with_: Path, without: Path, groups: list[str]) -> None:
    """The runs of groups, their means."""
    one, other = Worker(with_), Worker(without)
    print(f"{'run':32s} {'ms':>9s} {'factor':>6s} {'ms call':>9s} {'factor':>6s} {'apart':>8s}")
    found = {group: [ratio for run in GROUPS[group] if (ratio := compare(one, other, run))] for group in groups}
    if all(group in found for group in RUNS):
        found["runs"] = [ratio for group in RUNS for ratio in found[group]]
    for group, ratios in found.items():
        own, call = (mean([ratio[k] for ratio in ratios]) for k in (0, 1))
        print(f"{group:12s} {len(ratios):3d} runs: integration {own:.3f}, call {call:.3f}", flush=True)
    for worker_ in (one, other):
        worker_.process.kill()


def main() -> None:
    """Measure, or show the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", metavar="REVISION")
    parser.add_argument("--runs", default=",".join(GROUPS))
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("mechanisms", nargs="*", metavar="MECHANISM")
    asked = parser.parse_args()
    if asked.worker:
        worker()
        return
    if asked.list:
        for row in MECHANISMS:
            print(f"{row.name:28s} {row.lines:5d} lines  {row.earns}; tests: {row.tests}")
        return
    groups = asked.runs.split(",")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        first = build(folder / "with", asked.against)
        if asked.against:
            ablate(first, build(folder / "without", None), groups)
        for row in MECHANISMS:
            if row.name in asked.mechanisms:
                print(f"without {row.name}")
                ablate(first, build(folder / row.name.replace(" ", "_"), None, row.switch), groups)


if __name__ == "__main__":
    main()
