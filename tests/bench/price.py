"""What an accuracy asked for costs, and how honest it is: python tests/bench/price.py [--accuracy A,...] [NAME...]

Price: cpu_integrate_s of a run with --accuracy over the cheapest single run of ours (any method, tolerances by half
decades) whose error is no larger than the larger of the accuracy and the error that the run achieved; those that come
near to it are timed with it, by turns.  Honesty: the
error achieved over the accuracy asked, and the estimate over the error.  One row a model and accuracy, then a summary.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from measuring import Bench, Measured, Reference, names
from sysdyn.runtime.model.failures import NoSuchForm

TOLERANCES = tuple(10.0 ** (-0.5 * k) for k in range(2, 25))
METHODS = ("bdf", "radau", "rosenbrock", "dopri")
NEAR, REPEATED = 1.3, 1.0
"""Times the least CPU time of single runs that will do: those within it are timed again with the run, for so long (s).
"""
FLOOR = 1e-11
"""Errors below are those of the reference."""


@dataclass(frozen=True, slots=True)
class Row:
    """One run with --accuracy.  steps: of all its runs; best: method of the cheapest single run; lean: the last of its
    runs has no more steps than that one.
    """

    name: str
    asked: float
    achieved: float
    estimate: float
    price: float
    steps: int
    met: bool
    method: str
    best: str
    lean: bool

    def __str__(self) -> str:
        believed = self.estimate / self.achieved if self.achieved > FLOOR else np.nan
        numbers = f"{self.asked:8.0e} {self.achieved:9.1e} {self.achieved / self.asked:8.3f} {self.estimate:9.1e}"
        verdict = "met" if self.met else "NOT"
        methods = f"{self.method} ({self.best})"
        return f"{self.name:34s} {numbers} {believed:9.2f} {self.price:7.2f} {self.steps:7d} {verdict} {methods}"


HEAD = f"{'model':34s}    asked  achieved    ratio  estimate  believed   price   steps     method (cheapest)"


def singles(bench: Bench, finest: float, seconds: float) -> list[Measured]:
    """Single runs of every method from coarse tolerances to well below `finest`."""
    found: list[Measured] = []
    for method in METHODS:
        for rtol in TOLERANCES:
            if rtol < 0.9e-3 * finest:
                break
            run = bench.run(2, accuracy=None, rtol=rtol, method=method, max_wall=seconds)
            if run is not None:
                found.append(run)
            elif found and found[-1].method == method:
                break  # a smaller tolerance takes longer
    return found


def cheapest(bench: Bench, run: Measured, enough: list[Measured], seconds: float) -> tuple[float, Measured | None]:
    """CPU time of a run over that of the cheapest of `enough`, and that one."""
    if not enough:
        return np.nan, None
    least = min(one.cpu for one in enough)
    near = [one for one in enough if one.cpu <= NEAR * least]
    own, *others = bench.timed([run, *near], seconds)
    k = int(np.argmin(others))
    return own / others[k], near[k]


def rows(name: str, accuracies: list[float], formulation: str | None, seconds: float) -> list[Row]:
    """One row an accuracy."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(name, Path(folder), formulation)
        single = singles(bench, min(accuracies), seconds)
        runs = [(a, run) for a in accuracies if (run := bench.run(3, accuracy=a)) is not None]
        reference = Reference(bench, [*single, *(run for _, run in runs)])
        errors = [reference.error(run) for run in single]
        found = []
        for accuracy, run in runs:
            achieved = reference.error(run)
            most = max(accuracy, achieved)
            enough = [one for one, error in zip(single, errors, strict=True) if error <= most]
            price, best = cheapest(bench, run, enough, REPEATED)
            estimate = np.nan if run.estimate is None else run.estimate
            told = (achieved, estimate, price, run.steps, run.met, run.method, best.method if best else "")
            found.append(Row(name, accuracy, *told, best is not None and run.last <= best.steps))
        return found


def summary(found: list[Row]) -> str:
    """Shares over all rows."""
    ratio = np.array([row.achieved / row.asked for row in found])
    met = np.array([row.met for row in found])
    price = np.array([row.price for row in found if np.isfinite(row.price)])
    believed = np.array([row.estimate / row.achieved for row in found if row.met and row.achieved > FLOOR])
    mean = np.exp(np.log(price).mean())
    inside = (ratio >= 0.01) & (ratio <= 3.0)
    thrifty = inside | (ratio < 0.01) & np.array([row.lean for row in found])
    lies = int((met & (ratio > 3.0)).sum())
    return "\n".join(
        [
            f"{len(found)} runs, {int(met.sum())} met; over 3 times what was asked, yet met: {lies}",
            f"price: geometric mean {mean:.2f}, median {np.median(price):.2f}, largest {price.max():.1f}",
            f"achieved over asked in [0.01, 3]: {inside.mean():.2f}, below {(ratio < 0.01).mean():.2f}; "
            f"there, or with no more steps than the cheapest run that meets it: {thrifty.mean():.2f}",
            f"estimate below a third of the error: {(believed < 1 / 3).mean():.3f}; median {np.median(believed):.2f}",
        ]
    )


def main() -> None:
    """The table and its summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--accuracy", default="1e-2,1e-4,1e-6")
    parser.add_argument("--formulation")
    parser.add_argument("--seconds", type=float, default=5.0, help="after which a single run is given up")
    parser.add_argument("name", nargs="*")
    given = parser.parse_args()
    accuracies = [float(a) for a in given.accuracy.split(",")]
    found: list[Row] = []
    print(HEAD)
    for name in given.name or names("seed", "benchmark"):
        try:
            made = rows(name, accuracies, given.formulation, given.seconds)
        except NoSuchForm as none:
            print(f"{name}: {none}", flush=True)
            continue
        for row in made:
            found.append(row)
            print(row, flush=True)
    if found:
        print(summary(found))


if __name__ == "__main__":
    main()
