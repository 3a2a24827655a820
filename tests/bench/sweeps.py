"""What a run of a sweep costs: python tests/bench/sweeps.py [--runs N] [MODEL:PARAMETER...]

CPU time of a run in the core (everything from a case's numbers to its end values in an array), beside what single runs
of `simulate` spend on integration alone, for the same cases.  First the pendulum of the book over one period at 1e-4,
end values alone; then ten other models.  Rates are of one core, medians of five.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from sysdyn.cli.run.many.reusable_model import Loaded
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.sweep.core_cases import Cases
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.many.asked import NotApplicableError

SEED = Path(__file__).parents[2] / "models" / "seed"
MODELS = (
    "dc_motor", "slider_crank", "two_link_arm", "knife_edge", "ebers_moll", "pi_controller", "em_suspension",
    "nonlinear_spring", "two_tank", "co_circuit",
)  # fmt: skip
TIMES, SINGLES = 5, 8


def row(name: str, parameter: str | None, runs: int, keep: str, until: str | None = None) -> str:
    """One line: microseconds of CPU a run in the core, of integration alone, and their ratio."""
    loaded = Loaded(RunRequest(str(SEED / f"{name}.sd"), accuracy=1e-4, until=until))
    known = loaded.first.prepared.binding.values
    some = [p.name for p in loaded.first.prepared.network.parameters if not p.shape and not p.whole and known[p.name]]
    parameter = parameter or some[0]
    cases = [{parameter: float(v)} for v in np.linspace(0.9, 1.1, runs) * known[parameter]]
    try:
        core = Cases(loaded.keeping(extrema=keep != "end"), [parameter], keep)
    except NotApplicableError as error:
        return f"{name:20s} {parameter:8s} one by one: {error}"
    spent = []
    for _ in range(TIMES):
        began = time.process_time()
        _, left = core.run(range(runs), cases)
        spent.append((time.process_time() - began) / runs)
    singles = []
    for case in cases[:: -(-runs // SINGLES)]:
        ran = loaded.run(case, Report())
        singles.append(0.0 if ran is None else ran.outcome.timings["cpu_integrate_s"])
    ours, alone = float(np.median(spent)), float(np.median(singles))
    numbers = f"{1e6 * ours:9.0f} {1.0 / ours:10.0f} {1e6 * alone:9.0f} {ours / alone:7.2f}"
    return f"{name:20s} {parameter:8s} {keep:8s} {numbers} {len(left):6d}"


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="*", metavar="MODEL:PARAMETER")
    parser.add_argument("--runs", type=int, default=512)
    asked = parser.parse_args()
    head = f"{'model':20s} {'varies':8s} {'keep':8s} {'us a run':>9s} {'runs/s':>10s}"
    print(f"{head} {'alone, us':>9s} {'ratio':>7s}   left")
    if not asked.models:
        print(row("pendulum", "th_0", 4 * asked.runs, "end", "3.07"), flush=True)
        print(row("pendulum", "th_0", asked.runs, "traces", "3.07"), flush=True)
    for item in asked.models or MODELS:
        name, _, parameter = item.partition(":")
        for keep in ("end", "traces"):
            print(row(name, parameter or None, asked.runs if keep == "end" else 64, keep), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
