"""What a call of `Model.run` costs beside its integration: python tests/bench/api.py [--calls N] [MODEL:PARAMETER...]

CPU of a call (medians over 200 calls of a model loaded once, a parameter changed in each) and of its integration as the
trace says (`cpu_integrate_s`, all runs of the accuracy control).  The last column: what the call costs beside 1.5 times
its integration, in ms; 1 was asked.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from sysdyn.api import load

SEED = Path(__file__).parents[2] / "models" / "seed"
MODELS = ("pendulum:l", "dc_motor:L1", "slider_crank", "two_link_arm", "co_circuit", "mass_spring")
WARM = 5


def row(name: str, calls: int) -> str:
    """One line: ms of CPU a call, of its integration, and the difference."""
    plain, _, parameter = name.partition(":")
    model = load(SEED / f"{plain}.sd", scene="reference")
    parameter = parameter or next(k for k, v in model.parameters.items() if np.ndim(v) == 0 and v)
    value = float(model.parameters[parameter])
    whole, own = [], []
    for factor in np.linspace(1.0, 1.1, calls + WARM):
        began = time.process_time()
        trace = model.run({parameter: factor * value})
        whole.append(1e3 * (time.process_time() - began))
        own.append(1e3 * trace.timings["cpu_integrate_s"])
    call, integration = (float(np.median(item[WARM:])) for item in (whole, own))
    return f"{plain:20s} {parameter:8s} {call:8.2f} {integration:8.2f} {call - 1.5 * integration:8.2f}"


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="*", metavar="MODEL:PARAMETER")
    parser.add_argument("--calls", type=int, default=200)
    asked = parser.parse_args()
    print(f"{'model':20s} {'changed':8s} {'ms call':>8s} {'ms own':>8s} {'beside':>8s}")
    for name in asked.models or MODELS:
        print(row(name, asked.calls), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
