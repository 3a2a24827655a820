"""Random models with and without pruning: python tests/models/random_pruning.py FIRST LAST

Prints each model whose traces differ by more than 10 x accuracy x nominal (exit 1), and how many were pruned by which
rule.  Half of those that have no `coord` run in the complementary formulations.
"""

import math
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from model_runs import FOUR, attempt
from random_scenes import text
from sysdyn.runtime.trace.trace import Trace

INSTANTS = [0.25 * k for k in range(1, 21)]
LIMIT = 10 * 1e-4


@dataclass(frozen=True)
class Compared:
    """worst: the largest difference in units of the limit; rules: of the parts left out; whole: why the model as
    written did not run, where the pruned one did.
    """

    worst: float
    rules: tuple[str, ...]
    whole: str = ""


def compared(seed, folder):
    """One model, pruned and whole."""
    body, network = text(seed)
    formulation = FOUR[seed % 4] if network else FOUR[seed % 2]
    found, rules = [], ()
    for no_prune in (False, True):
        at = ",".join(map(str, INSTANTS))
        ran, report = attempt(folder, body, formulation=formulation, backend="numpy", at=at, no_prune=no_prune)
        said = [f"{d.code} {d.message}" for d in report if d.severity == "error"]
        if no_prune and rules and (ran is None or ran.exit):
            return Compared(0.0, rules, f"model {seed}, {formulation}, as a whole: {said}")
        assert ran is not None, (seed, formulation, no_prune, said)
        assert ran.exit == 0, (seed, formulation, no_prune, said)
        trace = Trace.open(folder / "trace.h5")
        places = [int(np.argmin(np.abs(trace.time - t))) for t in INSTANTS]
        names = [o.name.replace("/", "\u2215") for o in ran.prepared.network.observations]
        found.append({name: (trace[name].values[places], trace[name].values) for name in names})
        rules += tuple(part.rule for part in ran.prepared.left_out)
    pruned, whole = found
    ratios = [
        np.max(np.abs(pruned[name][0] - whole[name][0])) / (LIMIT * max(np.max(np.abs(whole[name][1])), 1e-9))
        for name in whole
    ]
    return Compared(float(max(ratios)), rules)


def main(first, last):
    counted, cut, wrong, worst = Counter(), 0, [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, last):
            try:
                result = compared(seed, Path(folder))
            except AssertionError as error:
                result = Compared(math.inf, ())
                print(error, flush=True)
            if result.whole:
                print(result.whole, flush=True)
            counted.update(result.rules)
            cut += bool(result.rules)
            worst = max(worst, result.worst)
            if not result.worst <= 1.0:
                wrong.append(seed)
                print(f"model {seed}: {result.worst:.3g} of the limit", flush=True)
    print(f"{last - first} models, {cut} pruned ({dict(counted)}), worst {worst:.3g} of the limit, wrong: {wrong}")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3])))
