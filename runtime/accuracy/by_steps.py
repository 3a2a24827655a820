"""An accuracy met by steps and tolerances that shrink together, of a model that can do nothing but relax (relaxing.py).

Two runs of Radau IIA, every step of the second shorter than the first's: where the longest step holds it, by r, and
where its tolerance does, by one r^3 times as large or less.  Of real decays and smooth sources errors fall with r^3,
the stage order of three stages, at least; with r^2 where the error test, which takes the tolerance to 2/3, holds the
steps: of the difference r^2.5 / (1 - r^2.5) is left (laws.py).  With three stages steps of one length share their
factors, which of grids cost as much as twenty steps; finer accuracies take all stages.  The first run costs a third to
a half of the second.  Where more happens than the longest step holds the tolerance leads (control.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from sysdyn.runtime.accuracy.control import Achieved, Run
from sysdyn.runtime.accuracy.estimate import AIM, Estimate
from sysdyn.runtime.accuracy.laws import RELAXING
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.accuracy.pairs import Sampled
from sysdyn.runtime.accuracy.relaxing import relaxes
from sysdyn.runtime.accuracy.runs import Runs
from sysdyn.runtime.integrate.request import LONGEST
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure

SHORTER, FEW, ALL = 0.35, 3.0, 4.5
"""Of the longest step of the first run: that of the second; the power of it that is left of the tolerance, with three
stages and with all, whose errors where something relaxes fell with the power 0.43 of it at worst."""
COARSEST, FEW_STAGES, FINEST = 3e-3, 3e-6, 1e-10
"""Accuracies above which the bdf behind a draft costs no more (control.py), from which on three stages take less work,
and down to which steps are known to serve."""
EASY, FALLS = 4e-4, 4.0
"""Accuracy that the longest step of all reaches with three stages (of two periods of a sine in 20 steps 1e-5 to 1e-4
are left), and the power of the longest step with which errors mostly fall."""
BESIDE, ROOT = 60.0, 0.06
"""Times the accuracy: the tolerance of the first run of three stages, whose errors are a tenth of it where it holds the
steps; times the root of the accuracy: that with all stages, whose errors of what relaxes fall with the power 1.4 (1e-7
and 5e-9 at 1e-4 and 1e-5, ladders and grids)."""
FEWER = 0.7
"""Of the longest steps of all: with all stages (first runs a third longer left third ones to follow on grids)."""
RUNS, ONCE_MORE, LEAST = 3, 0.6, 0.5
"""Runs at most; of the longest step of the second: that of a third, and the least that is worth it."""
CROWDED, EVER, DECADE = 1.2, 3.0, 2.5
"""Times as many steps as the longest would take, with so many more ever, and each decade of the tolerance: with more
the tolerance holds too many (ladders and grids take up to 1.15 times, with 1 and 2)."""

SIMPLE = 30
"""Unknowns up to which the question whether they relax costs what the answer saves."""

Take = Callable[[tuple[int, int] | None, int | None], None]
"""Takes the stages of the next runs, at first and at most, and how many steps they may take."""


def by_steps(runs: Runs, options: Options, target: Floats) -> Achieved | Sampled | None:
    """What runs of a model that can but relax are worth, or the last of them where they miss what was asked; None: it
    is another, or too much happens.
    """
    way = runs.way
    if not FINEST <= float(np.min(target)) <= COARSEST or not can_but_relax(runs, options):
        return None

    def take(stages: tuple[int, int] | None, steps: int | None) -> None:
        runs.take(replace(way, stages=stages), steps)

    found = shortened(runs.sampled, target, take)
    take(runs.way.stages if isinstance(found, Achieved) else way.stages, None)
    return found


def can_but_relax(runs: Runs, options: Options) -> bool:
    """Whether the model can do nothing else, on a way of radau that nothing restarts."""
    way, stops = runs.way, options.stops is not None and bool(np.isfinite(options.stops).any())
    if way.method != "radau" or options.order or options.events or stops or runs.system.unknowns <= SIMPLE:
        return False
    return relaxes(runs.system, runs.start)


def shortened(run: Run, target: Floats, take: Take) -> Achieved | Sampled | None:
    """What two or three runs are worth; the last of them where they miss what was asked; None: too much happens."""
    wanted = float(np.min(target))
    few = wanted >= FEW_STAGES
    stages = (3, 3) if few else None
    longest = LONGEST / SHORTER * (min((wanted / EASY) ** (1.0 / FALLS), 1.0) if few else FEWER)
    tolerance = min(BESIDE * wanted if few else ROOT * wanted**0.5, RELAXING.loosest)
    estimate, last, shorter = Estimate(RELAXING, target), None, SHORTER
    try:
        for number in range(1, RUNS + 1):
            take(stages, int(CROWDED / longest + EVER - DECADE * np.log10(tolerance)))
            now: Sampled = run(tolerance, longest)
            if last is not None:
                estimate.compare(last, now, shorter)
                if estimate.met:
                    return Achieved(estimate.apart, True, number, now.tolerance)
                shorter = min(ONCE_MORE, (AIM * estimate.over) ** (-1.0 / RELAXING.by_steps))
                if not shorter >= LEAST:
                    return now
            last, tolerance = now, tolerance * shorter ** (FEW if few else ALL)
            longest = longest * shorter if few else LONGEST * ONCE_MORE ** (number - 1)
    except SolverFailure as failure:
        if failure.late or failure.cause == "max_wall":
            raise
        return None
    return last
