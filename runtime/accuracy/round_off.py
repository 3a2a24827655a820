"""What round-off of the unknowns leaves open of traced quantities, which no estimate by two runs sees.

A current told by the difference of two potentials over 1e-15 ohm is round-off: both runs have the same.  Unknowns are
doubles, so that a quantity is known to eps/4*|dq/dx x| at best.  The slope is taken over two steps, the smaller result
counts: what jumps within one (a rounded number, a relation) is no slope.

Received: runs of which the last has ended; returned: an `Estimate` of the quantity that is worst off, if one is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.judgement import EPS, Estimate
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.points import uniform

if TYPE_CHECKING:
    from sysdyn.runtime.accuracy.runs import Runs

Point = tuple[float, Floats, Floats]
STEPS = (2.0**-26, 2.0**-12)
"""Of the unknowns: what slopes are taken over."""
TRIES = 3
FAR = tuning.SMALL
"""By chance moves of several unknowns cancel to so little of what they are in other directions hardly ever."""
ROUNDED = EPS / 4.0
"""Of a number: what rounding it mostly leaves out."""


def blur(system: System, point: Point, places: Ints, enough: Floats) -> Floats:
    """What round-off of the unknowns makes of observed quantities [places] at t (s), y, yd; 0 where there is no number.
    Where the first try finds all of them far below what is enough [places] it is the last.
    """
    t, y, yd = point
    found = np.zeros(places.size)
    with np.errstate(all="ignore"):
        here = system.observe(t, y, yd)[places]
        for k in range(TRIES):
            # relative perturbations of random signs: what the doubles leave open
            signs = np.where(uniform(y.size, 0, k * y.size) < 0.5, -1.0, 1.0)
            beside = [(y * (1.0 + h * signs), yd * (1.0 + h * signs), h) for h in STEPS]
            # of two step lengths the smaller effect: the larger one may be curvature
            moved = [np.abs(system.observe(t, a, b)[places] - here) / h for a, b, h in beside]
            found = np.maximum(found, ROUNDED * np.min(moved, axis=0))
            # far below what matters: no further try
            if not (found > FAR * enough).any():
                break
    return np.where(np.isnan(found), 0.0, found)


def worst_blur(runs: Runs, t: float, asked: Floats) -> tuple[Estimate, ...]:
    """The quantity that round-off leaves farthest from what was asked [compared] at the end t (s) of the last run, as
    one that misses it; none where all are known, or the model is large.
    """
    assert runs.done is not None
    (finished, _, writer), told, system = runs.done, runs.quantities, runs.system
    # nothing stored, or a large model, whose evaluations cost too much
    if not told.names or finished.last is None or system.unknowns > LARGE:
        return ()
    y, yd = (x[: system.form.written] for x in finished.last[0]())
    seen = writer.seen()
    size = np.maximum(told.largest_of_unit(finished.largest, finished.magnitude), [seen[name] for name in told.names])
    steps = np.ones(size.size)
    # differences of large numbers: their size is their range
    if told.to_range.size:
        # round-off of x adds up like a random walk in a small difference x - 1e8 m, from step to step
        steps[told.to_range] = np.sqrt(finished.statistics.steps)
        size[told.to_range] = runs.compared.ranges(np.array([seen[told.names[k]] for k in told.to_range]))
    wanted = asked[: size.size] * size
    try:
        left = steps * blur(system, (t, y, yd), told.places, wanted)
    except SolverFailure:  # beside the point a function is none
        return ()
    # what is left open over what was asked
    over = np.divide(left, wanted, out=np.zeros(size.size), where=wanted > 0.0)
    worst = int(np.argmax(over))
    if not over[worst] > 1.0:
        return ()
    return (Estimate(told.names[worst], float(left[worst] / size[worst]), float(asked[worst]), None, blurred=True),)
