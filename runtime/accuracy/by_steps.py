"""An accuracy met by steps and tolerances that shrink together, of a model that can do nothing but relax (relaxing.py).

Two runs of Radau IIA, every step of the second shorter than the first's: where the longest step holds it, by r, and where
its tolerance does, by a tolerance r^3 times as large.  Of real decays and smooth sources errors fall with r^3, the stage
order of three stages, at least: of the difference r^3 / (1 - r^3) is left.  With three stages steps of one length share
their factors, which of grids cost as much as twenty steps; finer accuracies take all stages.  The first run costs a
third of the second.  Where more happens than the longest step holds the runs are left to the tolerance (control.py).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from sysdyn.runtime.accuracy.control import QUIET, Achieved, Run
from sysdyn.runtime.accuracy.estimate import AIM, Estimate
from sysdyn.runtime.accuracy.laws import RELAXING
from sysdyn.runtime.accuracy.pairs import Sampled
from sysdyn.runtime.integrate.request import LONGEST
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure

SHORTER, CUBED = 0.35, 3.0
"""Of the longest step of the first run: that of the second; the power of it that is left of the tolerance."""
FEW_STAGES = 3e-6
"""Accuracy from which on three stages take less work."""
EASY, FALLS = 2e-4, 4.0
"""Accuracy that the longest step of all reaches with three stages (of two periods of a sine in 20 steps 1e-5 to 1e-4 are
left), and the power of the longest step with which errors mostly fall."""
BESIDE, ROOT = 100.0, 0.1
"""Times the accuracy: the tolerance of the first run of three stages, whose errors are a tenth of it where it holds the
steps; times the root of the accuracy: that with all stages, whose errors of what relaxes fall with the power 1.4 (1e-7
and 5e-9 at 1e-4 and 1e-5, ladders and grids)."""
RUNS, ONCE_MORE, LEAST = 3, 0.6, 0.2
"""Runs at most; of the longest step of the second: that of a third, and the least that is worth it."""
CROWDED = 1.5
"""Times as many steps as the longest would take, and QUIET each decade of the tolerance: with more it holds too many."""

Take = Callable[[tuple[int, int] | None, int | None], None]
"""Takes the stages of the next runs, at first and at most, and how many steps they may take."""


def by_steps(run: Run, target: Floats, take: Take) -> Achieved | None:
    """What two or three runs are worth; None: too much happens, or they miss what was asked."""
    wanted = float(np.min(target))
    if not wanted < 1.0:
        return None
    few = wanted >= FEW_STAGES
    stages, law = ((3, 3), RELAXING[0]) if few else ((3, lib.STAGES), RELAXING[1])
    longest = LONGEST / SHORTER * min((wanted / EASY) ** (1.0 / FALLS), 1.0) if few else 2.0 * LONGEST
    tolerance = min(BESIDE * wanted if few else ROOT * wanted**0.5, law.loosest)
    estimate, last, shorter = Estimate(law, target), None, SHORTER
    try:
        for number in range(1, RUNS + 1):
            take(stages, int(CROWDED / longest - QUIET * np.log10(tolerance)))
            now: Sampled = run(tolerance, longest)
            if last is not None:
                estimate.compare(last, now, shorter)
                if estimate.met:
                    return Achieved(estimate.apart, True, number, now.tolerance)
                shorter = min(ONCE_MORE, (AIM * estimate.over) ** (-1.0 / law.by_steps))
                if not shorter >= LEAST:
                    return None
            last, tolerance = now, tolerance * shorter**CUBED
            longest = longest * shorter if few else LONGEST
    except SolverFailure as failure:
        if failure.late or failure.cause == "max_wall":
            raise
    return None
