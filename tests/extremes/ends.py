"""Parameters at the ends of what numbers are: python tests/extremes/ends.py [ROOM ...] [--from K] [--count N]

The first scene of each model of these rooms of models/ (seed, gallery) runs with each of its parameters at 1e300, 1e20,
1e-20, 1e-300, 0 and -1, the others as they are.  A run ends with a result, or with findings: a fault of the house, or a
run that takes more than SLOW seconds, is printed. Results are not compared: told.py and the circuits beside it do.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from sysdyn import api, models
from sysdyn.cli.run.request import targets
from sysdyn.dsl.text.diagnostics import Report

VALUES = (1e300, 1e20, 1e-20, 1e-300, 0.0, -1.0)
WALL, SLOW = 3.0, 10.0
"""Seconds given to a run, and those that it may take with all that stands around it."""
FINDINGS = (api.ModelError, api.SolverFailure, api.NotMet)


def scene(file: Path) -> str:
    """The first of a text."""
    return next(iter(targets.read(str(file), Report()).scenes))


def ended(file: Path, settings: dict[str, float], folder: Path) -> str:
    """How a run with these parameters ended: met, or the name of the exception."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            api.simulate(file, scene=scene(file), output=folder / "n.h5", max_wall=WALL, set=settings)
        except FINDINGS as finding:
            return type(finding).__name__
        except Exception as fault:  # that there is none is what is asked
            return f"FAULT {type(fault).__name__}: {str(fault)[:120]}"
    return "met"


def parameters(file: Path, folder: Path) -> tuple[str, ...]:
    """Of a model that runs."""
    return tuple(api.simulate(file, scene=scene(file), output=folder / "n.h5").parameters)


def runs(file: Path, folder: Path) -> Iterator[tuple[str, float, str, float]]:
    """Parameter, its value, how the run ended, and how long it took (s)."""
    for name in parameters(file, folder):
        for value in VALUES:
            began = time.monotonic()
            yield name, value, ended(file, {name: value}, folder), time.monotonic() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("room", nargs="*", default=["seed", "gallery"])
    parser.add_argument("--from", type=int, default=0, dest="first")
    parser.add_argument("--count", type=int)
    given = parser.parse_args()
    root = Path(models.__file__).parent
    files = [file for room in given.room for file in sorted((root / room).glob("*.sd"))][given.first :][: given.count]
    ends: Counter[str] = Counter()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for file in files:
            for name, value, end, took in runs(file, Path(folder)):
                ends[end.split()[0]] += 1
                if end.startswith("FAULT") or took > SLOW:
                    wrong += 1
                    print(f"{file.stem} {name} = {value:g}: {end}, {took:.1f} s", flush=True)
    print(f"{sum(ends.values())} runs: {', '.join(f'{n} {end}' for end, n in ends.most_common())}; wrong: {wrong}")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
