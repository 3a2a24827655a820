"""What a call of `Model.run` costs beside its integration: python tests/bench/api.py [--calls N] [MODEL:PARAMETER...]

CPU of a call and of its integrations as the trace says (`cpu_integrate_s`), a parameter changed in each; medians over
200 calls of a model loaded once, the median of three such series.  `beside`: what a call costs beside 1.5 times its
integrations, in ms; 1 was asked.  `alone`: the same of runs on their own, as the command makes them, in turn with the
others; `over`: what a call costs beside 1.5 times their integrations; `first`: the first call, which sets up.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.api import Model, load

SEED = Path(__file__).parents[2] / "models" / "seed"
MODELS = (
    "pendulum:l", "dc_motor:L1", "co_circuit:C1", "lc_ladder:Lc", "slider_crank", "two_link_arm", "mass_spring",
    "two_tank", "bouncing_ball",
)  # fmt: skip
WARM, SERIES = 5, 3
ALONE = {"max_steps": 10**7}
"""An option of one call: it is a run on its own."""


def cost(model: Model, settings: dict[str, float], **options: Any) -> tuple[float, float]:
    """CPU of a call and of its integrations [ms]."""
    began = time.process_time()
    trace = model.run(settings, **options)
    return 1e3 * (time.process_time() - began), 1e3 * trace.timings["cpu_integrate_s"]


def row(name: str, calls: int) -> str:
    """One line."""
    plain, _, parameter = name.partition(":")
    model = load(SEED / f"{plain}.sd", scene="reference")
    whole = model.parameters
    parameter = parameter or next(k for k, v in whole.items() if np.ndim(v) == 0 and v and not float(v).is_integer())
    value = float(whole[parameter])
    first = cost(model, {parameter: value})[0]
    found = []
    for _ in range(SERIES):
        pairs = []
        for factor in np.linspace(1.0, 1.1, calls + WARM):
            settings = {parameter: factor * value}
            pairs.append((*cost(model, settings), *cost(model, settings, **ALONE)))
        found.append(np.median(pairs[WARM:], axis=0))
    call, own, other, its = np.median(found, axis=0)
    times = (call, own, call - 1.5 * own, call - 1.5 * its, other - 1.5 * its, first)
    return f"{plain:20s} {parameter:8s} {' '.join(f'{item:8.2f}' for item in times)}"


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="*", metavar="MODEL:PARAMETER")
    parser.add_argument("--calls", type=int, default=200)
    asked = parser.parse_args()
    heads = ("ms call", "ms own", "beside", "over", "alone", "first")
    print(f"{'model':20s} {'changed':8s} {' '.join(f'{head:>8s}' for head in heads)}")
    for name in asked.models or MODELS:
        print(row(name, asked.calls), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
