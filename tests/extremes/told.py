"""Errors told beside real ones where laws are steep or have corners: python tests/extremes/told.py [NUMBER] [--from K]

NUMBER (60) motions of steep_corners.py or, with --switched, of switched_motions.py, which events carry, each in all
formulations that can express it, by `auto` and, with --methods, by others, at accuracies 1e-2, 1e-3, 1e-5 beside the
truth by SciPy.  Prints runs that say they are met and are further off than OVER times what they tell or what was asked,
those that fail, and shares.  Ends with 1 where there is one.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import steep_corners
import switched_motions
from running import ran
from steep_corners import Motion

OVER = 1.5
"""Real error over what is told, or was asked, from which a run that says it is met is a defect."""
SURE = 0.05
"""Of an error: what truths at two tolerances may be apart."""
RTOLS = {"LSODA": (1e-10, 1e-12), "DOP853": (1e-11, 1e-13)}
"""Of two truths."""
LATE = 0.03
"""Of the accuracy, and of the span: rows so near a jump are of one side or the other."""
FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")
ACCURACIES = (1e-2, 1e-3, 1e-5)
WALL = "60 s"
"""Of a run."""


@dataclass(frozen=True)
class Told:
    """One run: error real and told, of the largest value of what is furthest off; refused: why there is none."""

    motion: Motion
    way: str
    asked: float
    refused: str = ""
    met: bool = False
    told: float = np.nan
    real: float = np.nan
    unsure: float = 0.0
    where: str = ""
    steps: int = 0
    cpu: float = 0.0

    @property
    def defect(self) -> bool:
        """Met, and off by more than is told, beyond doubt of the truth."""
        least = (1.0 - SURE) * self.real - self.unsure
        return self.met and not self.refused and least > OVER * min(max(self.told, 1e-2 * self.asked), self.asked)

    def __str__(self) -> str:
        head = f"{self.motion.number:4d} {self.motion.family:20s}{self.way:26s}{self.asked:8.0e}"
        if self.refused:
            return f"{head} {self.refused[:60]}"
        met = "met" if self.met else "not met"
        return (
            f"{head} real {self.real:.2e} told {self.told:.2e} {self.real / self.asked:6.2f} of asked, "
            f"{self.real / max(self.told, 1e-300):6.3g} of told, {met}, {self.where}, {self.steps} steps"
        )


def told(folder: Path, motion: Motion, formulation: str, accuracy: float, method: str, known: list) -> Told:
    """A run beside the truth; known: truths at two tolerances."""
    way, began = f"{formulation} {method}", time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = ran(folder, motion.text, formulation=formulation, accuracy=accuracy, method=method, max_wall=WALL)
    spent = time.process_time() - began
    if found.refused:
        return Told(motion, way, accuracy, found.refused, cpu=spent)
    times = np.asarray(found.trace.time)
    if not known:
        try:
            known.extend([motion.truth(rtol) for rtol in RTOLS[motion.method]])
        except AssertionError:
            known.append(None)
    if known[0] is None:
        return Told(motion, way, accuracy, "no truth", cpu=spent)
    loose, exact = (at(times) for at in known)
    size = np.abs(exact).max(axis=1, keepdims=True)
    off = np.abs(np.array([np.asarray(found.trace[name]) for name in motion.names]) - exact) / size
    before = np.diff(times, append=np.inf) <= 2.0 * np.spacing(times)  # a jump, of which the truth knows the end alone
    unsure = np.abs(loose - exact) / size
    if motion.jumps:  # what a run is late by shows behind the jump
        near, jumps = LATE * accuracy * motion.end, known[1].begins
        before |= np.searchsorted(jumps, times - near) < np.searchsorted(jumps, times + near)
        unsure[:, before] = 0.0
    off[:, before] = 0.0
    name, row = np.unravel_index(int(np.argmax(off)), off.shape)
    statistics = found.trace.statistics
    return Told(
        motion, way, accuracy, "", found.met, statistics["error_estimate"], float(off.max()),
        float(unsure.max()), f"{motion.names[name]} at {times[row]:.6g} s",
        int(statistics["steps"]), spent,
    )  # fmt: skip


def every(
    folder: Path, motion: Motion, accuracies: tuple[float, ...], methods: list[str], forms: tuple[str, ...]
) -> Iterator[Told]:
    """All runs of a motion."""
    known: list = []
    for formulation in forms:
        for accuracy in accuracies:
            for method in methods:
                yield told(folder, motion, formulation, accuracy, method, known)


def main() -> int:
    """Runs and prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number", nargs="?", type=int, default=60)
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--methods", default="auto")
    parser.add_argument("--accuracies", default=",".join(f"{a:g}" for a in ACCURACIES))
    parser.add_argument("--families", default="")
    parser.add_argument("--formulations", default=",".join(FORMULATIONS))
    parser.add_argument("--switched", action="store_true")
    parser.add_argument("--all", action="store_true", help="print every run")
    given = parser.parse_args()
    wanted = tuple(float(a) for a in given.accuracies.split(","))
    motions = switched_motions if given.switched else steep_corners
    found: list[Told] = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.first, given.first + given.number):
            motion = motions.drawn(number)
            if given.families and motion.family not in given.families.split(","):
                continue
            for one in every(
                Path(folder), motion, wanted, given.methods.split(","), tuple(given.formulations.split(","))
            ):
                found.append(one)
                if given.all or one.defect or (one.refused and not one.refused.startswith("E60")):
                    print("DEFECT" if one.defect else "      ", one, flush=True)
    runs = [one for one in found if not one.refused]
    met = [one for one in runs if one.met]
    defects = [one for one in met if one.defect]
    ratio = np.array([one.real / max(one.told, 1e-300) for one in met if one.real > 1e-10])
    print(
        f"{len(runs)} runs, {len(met)} met; refused {len(found) - len(runs)}; {sum(one.cpu for one in found):.0f} s CPU"
    )
    if ratio.size:
        print(
            f"real over told of those met: median {np.median(ratio):.2g}, 95 % below {np.quantile(ratio, 0.95):.2g}, ",
            end="",
        )
        print(f"largest {ratio.max():.2g}; over {OVER}: {len(defects)}")
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
