"""Parameters at the ends of what numbers are: python tests/extremes/ends.py [ROOM ...] [--from K] [--count N] [...]

The first scene of each model of these rooms of models/ (seed, gallery) runs with each of its parameters at 1e300, 1e20,
1e-20, 1e-300, 0 and -1, the others as they are; --two: each with the next one, at all pairs of 1e300 and 1e-300.
--formulation F: in that one, where the model has it.  A run ends with a result, or with findings: a fault of the house,
a trace told as met that holds something else than numbers, or a run that takes more than SLOW seconds, is printed.
Results are not compared: told.py and the circuits beside it do.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from sysdyn import api, models
from sysdyn.cli.run.request import targets
from sysdyn.dsl.text.diagnostics import Report

VALUES = (1e300, 1e20, 1e-20, 1e-300, 0.0, -1.0)
FAR = (1e300, 1e-300)
"""What pairs take."""
WALL, SLOW = 3.0, 10.0
"""Seconds given to a run, and those that it may take with all that stands around it."""
FINDINGS = (api.ModelError, api.SolverFailure, api.NotMet)


def scene(file: Path) -> str:
    """The first of a text."""
    return next(iter(targets.read(str(file), Report()).scenes))


def ended(file: Path, settings: dict[str, float], folder: Path, formulation: str | None = None) -> str:
    """How a run with these parameters ended: met, or the name of the exception."""
    given = {"scene": scene(file), "output": folder / "n.h5", "max_wall": WALL, "set": settings}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            trace = api.simulate(file, formulation=formulation, **given)
        except FINDINGS as finding:
            return type(finding).__name__
        except Exception as fault:  # that there is none is what is asked
            return f"FAULT {type(fault).__name__}: {str(fault)[:120]}"
    missing = [name for name in trace.names if not np.isfinite(trace[name].values).all()]
    return f"FAULT told as met without numbers: {', '.join(missing)[:120]}" if missing else "met"


def parameters(file: Path, folder: Path, formulation: str | None) -> tuple[str, ...]:
    """Of a model that runs, one element of each array; () if it does not in this formulation."""
    try:
        trace = api.simulate(file, scene=scene(file), output=folder / "n.h5", formulation=formulation)
    except FINDINGS:
        return ()
    return tuple({re.sub(r"\[.*?\]", "[]", name): name for name in trace.parameters}.values())


def settings(names: tuple[str, ...], two: bool) -> Iterator[dict[str, float]]:
    """What the runs of one model change."""
    if not two:
        yield from ({name: value} for name in names for value in VALUES)
        return
    for pair in pairwise((*names, names[0]) if len(names) > 2 else names):
        yield from (dict(zip(pair, values, strict=True)) for values in product(FAR, repeat=2))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("room", nargs="*", default=["seed", "gallery"])
    parser.add_argument("--from", type=int, default=0, dest="first")
    parser.add_argument("--count", type=int)
    parser.add_argument("--formulation")
    parser.add_argument("--two", action="store_true")
    given = parser.parse_args()
    root = Path(models.__file__).parent
    files = [file for room in given.room for file in sorted((root / room).glob("**/*.sd"))][given.first :]
    ends: Counter[str] = Counter()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for file in files[: given.count]:
            for changed in settings(parameters(file, Path(folder), given.formulation), given.two):
                began = time.monotonic()
                end = ended(file, changed, Path(folder), given.formulation)
                took = time.monotonic() - began
                ends[end.split()[0]] += 1
                if end.startswith("FAULT") or took > SLOW:
                    wrong += 1
                    told = ", ".join(f"{name} = {value:g}" for name, value in changed.items())
                    print(f"{file.stem} {told}: {end}, {took:.1f} s", flush=True)
    print(f"{sum(ends.values())} runs: {', '.join(f'{n} {end}' for end, n in ends.most_common())}; wrong: {wrong}")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
