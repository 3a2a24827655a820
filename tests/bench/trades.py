"""The search of `trade` against the exhaustive one: python tests/bench/trades.py [--accuracy A,...] [MODEL...]

For each model of the book and each accuracy: the work of the setting that the search chose over that of the cheapest
of all combinations at all half-decade tolerances, and what the search's runs cost over what all runs cost (work beside
the trace's rows).  Then, least and largest of a dozen runs: the error as `trade` states it (the largest of all rows)
over the largest at the book's instants by `references.json`; and what a run at the finest tolerance says of the latter.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import tempfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.cli.trade.trade_results import cheapest
from sysdyn.cli.trade.trading import trade
from sysdyn.dsl.text.diagnostics import Report

SEED = Path(__file__).parents[2] / "models" / "seed"
MODELS = (
    "dc_motor", "fluid_tank", "nonlinear_spring", "thermal_two_node", "lc_ladder", "diode_circuit", "slider_crank",
    "two_link_arm", "two_tank", "em_suspension", "pi_controller", "lead_filter",
)  # fmt: skip
SOME = 12
"""Runs whose error is compared with the book's values."""


def at_instants(name: str, entry: dict[str, Any], folder: Path) -> str:
    """The model with a trace at the coarsest grid that holds all instants of the book."""
    instants = [Fraction(t).limit_denominator(10**6) for t in entry["t"]]
    common = math.lcm(*(t.denominator for t in instants))
    every = math.gcd(*(int(t * common) for t in instants)) / common
    text = (SEED / f"{name}.sd").read_text(encoding="utf-8")
    path = folder / f"{name}.sd"
    path.write_text(re.sub(r"every [^;\n}]+", f"every {every!r} s", text), encoding="utf-8")
    return str(path)


def values(file: str, entry: dict[str, Any], folder: Path, **how: Any) -> tuple[dict[str, Any], dict[str, float]]:
    """A run at the book's instants, and the magnitudes of what it traces."""
    ran = run(RunRequest(file, scene="reference", output=str(folder / "run.h5"), **how), Report())
    assert ran is not None
    trace, t = ran.outcome.traced, np.array(entry["t"])
    rows = np.searchsorted(trace.time, t + 1e-9 * t[-1], side="right") - 1
    names = entry["variables"]
    return {v: trace[v].values[rows] for v in names}, {v: trace[v].nominal or 1.0 for v in names}


def apart(one: dict[str, Any], other: dict[str, Any], nominal: dict[str, float]) -> float:
    """The largest relative difference."""
    return max(float(np.abs(one[v] - np.array(other[v])).max()) / nominal[v] for v in one)


def rows(name: str, accuracies: list[float], entry: dict[str, Any], folder: Path) -> list[str]:
    """A line an accuracy."""
    file = at_instants(name, entry, folder)
    full = trade(RunRequest(file, scene="reference"), Report(), folder, full=True)
    assert full is not None
    spent = sum(m.work - m.fixed for m in full.measured)
    known = full.reference.uncertainty
    sure = [m for m in full.measured if m.usable and 10.0 * known < (m.error or 0.0) < 0.5]
    some = sure[:: max(len(sure) // SOME, 1)]
    finest, _ = values(file, entry, folder, method="radau", rtol=1e-13)
    ratios, there = [], []
    for m in some:
        c = m.combination
        how = {"formulation": c.formulation, "index": c.index, "method": c.method, "rtol": m.tolerance}
        found, nominal = values(file, entry, folder, **how)
        true = apart(found, entry["values"], nominal)
        ratios.append((m.error or 0.0) / true)
        there.append(apart(found, finest, nominal) / true)
    lines = []
    for accuracy in accuracies:
        tried = trade(RunRequest(file, scene="reference", accuracy=accuracy), Report(), folder)
        best = cheapest(full.measured, accuracy, known)
        if tried is None or tried.chosen is None or best is None:
            lines.append(f"{name:18s} {accuracy:8.0e} nothing chosen")
            continue
        cost = sum(m.work - m.fixed for m in tried.measured) / spent
        chosen = f"{tried.chosen.combination.name} at {tried.chosen.tolerance:.0e}"
        lines.append(
            f"{name:18s} {accuracy:8.0e} {len(full.measured):5d} {len(tried.measured):5d} "
            f"{tried.chosen.work / best.work:6.2f} {cost:7.3f}  {min(ratios):5.2f} .. {max(ratios):5.2f}  "
            f"{min(there):6.4f} .. {max(there):6.4f}  {chosen}"
        )
    return lines


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", default=list(MODELS), metavar="MODEL")
    parser.add_argument("--accuracy", default="1e-2,1e-4,1e-6", metavar="A,...")
    asked = parser.parse_args()
    book = json.loads((Path(__file__).parents[1] / "data" / "references.json").read_text(encoding="utf-8"))
    print(f"{'model':18s} accuracy  runs tried   work    cost  stated / true  at the instants   chosen")
    for name in asked.models:
        with tempfile.TemporaryDirectory() as folder:
            for line in rows(name, [float(a) for a in asked.accuracy.split(",")], book[name], Path(folder)):
                print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
