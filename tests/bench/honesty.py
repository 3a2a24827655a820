"""Achieved error over accuracy asked: python tests/bench/honesty.py [--accuracy A,...] [--formulations F,...] [NAME...]

One run with --accuracy a model, formulation and accuracy, against our radau near round-off as reference.  Rows for
what is over 3 times what was asked, and yet met, or whose estimate is below a third of the error; then the shares.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from measuring import Bench, Measured, Reference, names
from price import FLOOR, HEAD, Row
from sysdyn.dsl.text.diagnostics import ModelError
from sysdyn.runtime.model.failures import NoSuchForm

FORMULATIONS = "lagrangian,hamiltonian,co_lagrangian,co_hamiltonian"
ACCURACIES = ",".join(f"1e-{k}" for k in range(1, 10))


def rows(name: str, formulation: str, accuracies: list[float]) -> list[Row]:
    """One row an accuracy; none where the formulation cannot express the model or the run fails."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            bench = Bench(name, Path(folder), formulation)
        except (NoSuchForm, ModelError):
            return []
        runs = [(a, run) for a in accuracies if (run := bench.run(accuracy=a)) is not None]
        if not runs:
            return []
        where = f"{name} {formulation}"
        try:
            reference = Reference(bench, [run for _, run in runs])
        except NoSuchForm as error:
            print(f"{where}: {error}", flush=True)
            return []
        return [row(where, a, reference.error(run), run) for a, run in runs]


def row(where: str, asked: float, achieved: float, run: Measured) -> Row:
    """A row without a price."""
    estimate = np.nan if run.estimate is None else run.estimate
    return Row(where, asked, achieved, estimate, 1.0, run.steps, run.met, run.method, "", False)


def suspicious(row: Row) -> bool:
    """What must not be, or hardly ever."""
    return row.met and row.achieved > FLOOR and (row.achieved > 3.0 * row.asked or row.estimate < row.achieved / 3.0)


def main() -> None:
    """What is suspicious, and shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--accuracy", default=ACCURACIES)
    parser.add_argument("--formulations", default=FORMULATIONS)
    parser.add_argument("name", nargs="*")
    given = parser.parse_args()
    found: list[Row] = []
    print(HEAD)
    for name in given.name or names("seed", "benchmark"):
        for formulation in given.formulations.split(","):
            new = rows(name, formulation, [float(a) for a in given.accuracy.split(",")])
            found += new
            for one in filter(suspicious, new):
                print(one, flush=True)
    ratio = np.array([row.achieved / row.asked for row in found])
    lies = sum(row.met and row.achieved > max(3.0 * row.asked, FLOOR) for row in found)
    below = [row for row in found if row.met and row.achieved > FLOOR]
    low = sum(row.estimate < row.achieved / 3.0 for row in below)
    print(f"{len(found)} runs, {sum(row.met for row in found)} met; over 3 times what was asked, yet met: {lies}")
    print(
        f"achieved over asked in [0.01, 3]: {((ratio >= 0.01) & (ratio <= 3.0)).mean():.3f}, over 3 {(ratio > 3).sum()}"
    )
    print(f"estimate below a third of the error: {low} of {len(below)}")


if __name__ == "__main__":
    main()
