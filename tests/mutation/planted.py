"""Faults planted in generated code: does the run notice?  python tests/mutation/planted.py [--number N] [--blind]

A sign, an index or a factor is changed in the residual rows of a model's C text; its audit, its traced quantities and
its Jacobian stay as they are.  A fault counts where it moves a traced result by more than TIMES x the accuracy (or ends
the run); it is noticed where the run itself says so: exit 3 or 4, or no run at all.  Models of dynamic variables alone
are counted apart.  --blind: without the comparison of the rows with the text, to see what the ledgers alone notice.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from sysdyn.cli.run import module_check, running
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest, options_of
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import integrate, ready
from sysdyn.compiler.program import build
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import ModelError, Report
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.model import carrier
from sysdyn.runtime.trace.trace import Trace

MODELS = Path(__file__).resolve().parents[2] / "models"
ROWS = (
    "dynamics", "dynamics_rate", "phi_reaction", "phi_normal", "psi_reaction", "momentum", "momentum_rate", "phi",
    "phi_rate", "phi_acceleration", "psi", "psi_rate", "gamma", "gamma_rate", "lambda",
)  # fmt: skip
FORMULATIONS = ("lagrangian", "hamiltonian", "kane", "co_lagrangian", "co_hamiltonian")
TIMES, ACCURACY = 10.0, 1e-4
GRID = 100
STATES = ("pi_controller", "integral_controller", "lead_filter")


@dataclass(frozen=True, slots=True)
class Fault:
    """One changed line of a model's text."""

    model: str
    formulation: str
    kind: str
    block: str
    before: str
    after: str


@dataclass(frozen=True, slots=True)
class Found:
    """What came of a fault.  moved: largest change of a traced result over its accuracy; noticed: how, empty: not."""

    fault: Fault
    moved: float
    noticed: str


def seeds() -> list[Path]:
    """The models of the book, those that a run of some milliseconds tells."""
    return sorted((MODELS / "seed").glob("*.sd"))


def lines_of(text: str) -> Iterator[tuple[int, str, str]]:
    """(line number, block, line) of each statement in the residual rows of a C text."""
    block = ""
    for number, line in enumerate(text.splitlines()):
        if head := re.match(r"/\* (\w+), (rows|dyd?): ", line):
            block = head[1] if head[2] == "rows" and head[1] in ROWS else ""
        elif block and re.match(r"\s+(const double a\d+ = |r\[)", line):
            yield number, block, line


def changes(line: str, draw: random.Random) -> list[tuple[str, str]]:
    """(kind, changed line) of a statement: a sign, a factor, an index."""
    found = []
    if line.lstrip().startswith("r["):
        found.append(("sign", line.replace("+=", "-=")))
    head, _, value = line.partition(" = ")
    value = value.rstrip(";")
    signs = [m.start() for m in re.finditer(r" [+-] ", value)]
    if signs:
        at = draw.choice(signs)
        other = {"+": "-", "-": "+"}[value[at + 1]]
        found.append(("sign", f"{head} = {value[: at + 1]}{other}{value[at + 2 :]};"))
    if value and not value.startswith(("y", "p[")):
        found.append(("factor", f"{head} = {draw.choice((0.5, 1.01, 1.5, 2.0))!r}*({value});"))
    if read := re.search(r"\b(y|yd)\[at\[(\d+)\]", value):
        other = str(max(0, int(read[2]) + draw.choice((-1, 1))))
        if other != read[2]:
            found.append(("index", line.replace(f"{read[1]}[at[{read[2]}]", f"{read[1]}[at[{other}]", 1)))
    if read := re.search(r"\bp\[(\d+)\]", value):
        other = str(max(0, int(read[1]) + draw.choice((-1, 1))))
        if other != read[1]:
            found.append(("index", line.replace(f"p[{read[1]}]", f"p[{other}]", 1)))
    return found


class Bench:
    """One model in one formulation, prepared, with its faultless run."""

    def __init__(self, path: Path, formulation: str, folder: Path) -> None:
        self.path, self.folder = path, folder
        request = RunRequest(str(path), scene="reference", formulation=formulation, output=str(folder / "t.h5"))
        report = Report()
        document = targets.read(str(path), report)
        target = targets.one(document, str(path), None, "reference", report)
        assert target is not None
        prepared = ready(request, target, report)
        if prepared is None:
            raise ModelError(report.diagnostics)
        options = options_of(request, target, prepared, report, time.monotonic(), None)
        assert options is not None
        self.target: Target = target
        self.prepared: Prepared = prepared
        every = options.every or (options.t_end - options.t_start) / GRID
        self.options: Options = replace(options, every=every, accuracy=ACCURACY, max_steps=20000, max_wall=20.0)
        ran = integrate(target, prepared, self.options, report)
        if ran is None or ran.exit == 3:
            raise ModelError(report.diagnostics)
        self.right = ran.outcome.traced

    def tried(self, fault: Fault, text: str) -> Found:
        """A run with a changed text."""
        changed = replace(self.prepared, carrier=carrier.load(build.build(text)))
        report = Report()
        try:
            ran = integrate(self.target, changed, self.options, report)
        except module_check.ModuleFault:
            return Found(fault, self._moved_unseen(changed), "the rows are not the text's")
        except Exception as error:  # what the command line makes exit 4 of, or a refusal
            return Found(fault, np.inf, type(error).__name__)
        if ran is None:
            return Found(fault, np.inf, "no start")
        if ran.outcome.failure is not None:
            return Found(fault, np.inf, "the solver stops")
        moved = self.moved(ran.outcome.traced)
        return Found(fault, moved, "" if ran.outcome.met else ran.outcome.judgement.not_met[0].what)

    def _moved_unseen(self, changed: Prepared) -> float:
        """What the fault would have moved."""
        report, kept = Report(), running.check_module
        running.check_module = lambda *_: None
        try:
            ran = integrate(self.target, changed, self.options, report)
        except Exception:
            return np.inf
        finally:
            running.check_module = kept
        if ran is None or ran.outcome.failure is not None:
            return np.inf
        return self.moved(ran.outcome.traced)

    def moved(self, trace: Trace) -> float:
        """Largest difference to the faultless run over the accuracy, of all traced quantities."""
        times, here, there = np.intersect1d(self.right.time, trace.time, return_indices=True)
        worst = 0.0
        for name in self.right.names:
            size = self.right[name].nominal or 0.0
            apart = np.abs(self.right[name].values[here] - trace[name].values[there])
            apart = np.where(np.isfinite(apart), apart, np.inf)
            if size > 0.0 and times.size:
                worst = max(worst, float(apart.max()) / (size * ACCURACY))
        return worst


def faults(bench: Bench, formulation: str, number: int, draw: random.Random) -> Iterator[tuple[Fault, str]]:
    """That many faults of a model's text, drawn without returning, with the changed text."""
    text = bench.prepared.compiled.text
    rows = text.splitlines()
    every = [(n, block, line, kind, new) for n, block, line in lines_of(text) for kind, new in changes(line, draw)]
    for n, block, line, kind, new in draw.sample(every, min(number, len(every))):
        fault = Fault(bench.path.stem, formulation, kind, block, line.strip(), new.strip())
        yield fault, "\n".join([*rows[:n], new, *rows[n + 1 :]]) + "\n"


def plant(number: int, seed: int = 8) -> Iterator[Found]:
    """That many faults over the models and their formulations."""
    draw = random.Random(seed)
    left, kinds = number, [(path, f) for path in seeds() for f in FORMULATIONS]
    draw.shuffle(kinds)
    with tempfile.TemporaryDirectory(prefix="sysdyn-planted-") as folder:
        while left > 0:
            for path, formulation in kinds:
                if left <= 0:
                    break
                with ex.fresh():
                    try:
                        bench = Bench(path, formulation, Path(folder))
                    except (ModelError, AssertionError):
                        continue
                    for fault, text in faults(bench, formulation, min(2, left), draw):
                        left -= 1
                        yield bench.tried(fault, text)


def summary(found: list[Found]) -> tuple[int, int, list[Found]]:
    """(faults that count, those noticed, those missed), models of dynamic variables alone left out."""
    counted = [f for f in found if f.moved > TIMES and f.fault.model not in STATES]
    missed = [f for f in counted if not f.noticed]
    return len(counted), len(counted) - len(missed), missed


def main() -> int:
    """Print what came of each, and the sum."""
    options = argparse.ArgumentParser()
    options.add_argument("--number", type=int, default=200)
    options.add_argument("--seed", type=int, default=8)
    options.add_argument("--blind", action="store_true")
    given = options.parse_args()
    if given.blind:
        running.check_module = lambda *_: None
    found = []
    for one in plant(given.number, given.seed):
        found.append(one)
        f = one.fault
        print(f"{f.model} {f.formulation} {f.kind} {f.block}: {f.before} -> {f.after}: {one.moved:.3g}, {one.noticed}")
    counted, noticed, missed = summary(found)
    print(f"{len(found)} planted, {counted} move a result, {noticed} noticed")
    for one in missed:
        print("missed:", one)
    states = [f for f in found if f.fault.model in STATES and f.moved > TIMES]
    print(f"models of dynamic variables alone: {sum(bool(f.noticed) for f in states)} of {len(states)}")
    return int(noticed < 0.95 * counted)


if __name__ == "__main__":
    sys.exit(main())
