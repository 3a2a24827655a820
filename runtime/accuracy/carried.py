"""An accuracy met by one run of the bdf that carries its error along, of a model that can do nothing but relax.

Its slopes are constant, and e = values less solution is stepped by the formula itself with the factors at hand
(core/steppers/bdf/bdf_transport.c): one solution more a step and no second run.  What is observed with e and without it
is compared at every step.  No second run passes by what the steps of this one do not meet: they are half as long
at most.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from sysdyn.runtime.accuracy.by_steps import can_but_relax
from sysdyn.runtime.accuracy.control import Achieved
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.accuracy.pairs import ROUND_OFF
from sysdyn.runtime.accuracy.runs import Runs
from sysdyn.runtime.accuracy.way import Way
from sysdyn.runtime.integrate.request import LONGEST
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import LARGE

FINEST = 2e-3
"""Of accuracies below methods of higher order are cheaper on ladders (at 1e-3 1.1 to 1.2 times the CPU of by_steps.py).
"""
SAFETY, LOOSEST = 2.5, 4e-3
"""Of the error carried, which was 0.91 to 1.18 of the largest error at any step (ladders and grids) up to this
tolerance, 0.73 to 1.35 at ten times that; beside pulses in the midst of rest, where steps grow and shrink,
0.34 once and else 0.56 at least."""
FAINT = 1e-2
"""Of the largest of its unit: of a quantity that is less the steps are not made (what a pulse sends through a line,
1e-10 of it, was estimated at a fifteenth of its error), and another method follows."""
PART, FALLS, EASY = 0.03, 0.2, 1e-3
"""Of the accuracy: the tolerance that does for one of EASY; each decade finer takes FALLS of a decade beside."""
RUNS, AIM, LEAST = 2, 1.5, 0.5
"""Runs at most; how far below what was asked the second aims, and what is left of its tolerance at most."""
STEPS = 400
"""Of a run at most: what takes more is left to methods of higher order."""
LONGER = 0.5
"""Of the longest step of all: that of these runs."""


def serves(runs: Runs, options: Options, target: Floats) -> bool:
    """Whether it may: of a large system the room counts, and a check compares two runs."""
    if (
        options.accuracy_check
        or runs.quantities.meters
        or runs.system.unknowns > LARGE
        or not np.isfinite(target).any()
    ):
        return False
    return FINEST <= float(np.min(target)) < 1.0 and can_but_relax(runs, options)


def carried(runs: Runs, way: Way, target: Floats) -> Achieved | None:
    """What the run is worth; None: it misses what was asked, and the method before goes on.  way: of the bdf."""
    before, patience, with_draft = runs.way, runs.patience, runs.patience_with_draft
    wanted = float(np.min(target))
    tolerance = min(PART * wanted * (wanted / EASY) ** FALLS, LOOSEST)
    runs.take(replace(way, carried=True), min(STEPS, with_draft or STEPS))
    try:
        for number in range(1, RUNS + 1):
            runs.run(tolerance, None, LONGER * LONGEST)
            apart, over = _estimated(runs, target)
            if over <= 1.0:
                return Achieved(apart, True, number, tolerance)
            if not np.isfinite(over):
                break
            tolerance *= min(1.0 / (AIM * over), LEAST)
    except SolverFailure as failure:
        if failure.late or failure.cause == "max_wall":
            raise
    runs.take(before, patience)
    runs.patience_with_draft = with_draft
    return None


def _estimated(runs: Runs, target: Floats) -> tuple[float, float]:
    """Largest relative error of the last run, and that over the accuracy wanted [compared]."""
    rows, finished, quantities = np.concatenate(runs.carried), runs.finished, runs.quantities
    assert finished is not None
    places = lib.ROW_HEAD + quantities.places
    values, without = rows[:, places], rows[:, places + len(runs.names)]
    size = quantities.of_run(finished)
    beside = quantities.beside(finished.largest, finished.magnitude)
    use = np.isfinite(target) & ~(np.abs(values).max(axis=0) <= ROUND_OFF * beside)
    with np.errstate(all="ignore"):
        off = SAFETY * np.abs(values - without).max(axis=0)[use] / size[use]
    off[~np.isfinite(off) | (size < FAINT * beside)[use]] = np.inf
    return float(off.max(initial=0.0)), float((off / target[use]).max(initial=0.0))
