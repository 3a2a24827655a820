"""What was found made exact: its state to round-off in its own magnitudes, what follows by corrections that vanish.

Neither depends on the way to it then.  Beside steep laws what does not come to hold to its own round-off is no start.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.gauss_newton import Solution, corrected, solve, stepped
from sysdyn.runtime.numerics.least_change import DENSE, SINGULAR_VALUES
from sysdyn.runtime.start.corrections import EXACT, by_corrections, leaves_open
from sysdyn.runtime.start.equations import HIDDEN
from sysdyn.runtime.start.flat import at_rest
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.starter import NOISE, Mask, Starter
from sysdyn.runtime.start.strategies import CLOSED, own_residual, rescaled

BACK = 1e-10
"""Steps of this part of the largest alike are round-off of the linear algebra, and tried without."""


def anew(starter: Starter, t: float, best: Solution, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """The solution with its state to round-off, in its own magnitudes, and what follows found from x as where no state
    moves: neither depends on the way here; whether that holds.  What is too large for full matrices is left alone.
    """
    there = best.x
    state = free & ~starter.following(t, there)
    if best.residual >= EXACT or there.size > DENSE or not (there != guess)[state].any():
        return best, False
    near = stepped(problem_of(starter, t, there, guess, rows=starter.every, free=free, least=True), there)
    largest = starter.largest_alike(np.maximum(starter.scale(t, guess), np.abs(near)))
    near = np.where(np.abs(near - there) <= NOISE * largest, there, near)
    back = np.where(np.abs(near - guess) <= BACK * largest, guess, near)
    steep, last = bool(starter.system.form.scales), near
    if steep:  # rows of small terms are lost beside all that moves: the rest by the least change from there
        last = stepped(problem_of(starter, t, near, near, rows=starter.every, free=free, least=True), near)
    for moved in (back, near, last):
        begun = np.where(state, moved, x)
        follows = free & ~state & ~at_rest(starter, t, begun, free & ~state)
        found, holds = rescaled(starter, t, begun, guess, follows, least=False)
        held = holds and found.residual <= max(CLOSED, best.residual)
        # what is left where a guess of twelve digits stays is no round-off: beside steep laws that is no start
        if held and (moved is last or not steep or sharp(starter, t, found, free) is not None):
            return found, True
    return best, False


def sharp(starter: Starter, t: float, best: Solution, free: Mask) -> Solution | None:
    """The solution with what follows from its state by corrections that vanish, where rows determine them, first those
    as written: what only leakage ties moves by volts under rows that hold to round-off of the largest current.  None
    where rows with steep laws do not come to hold to their own round-off: it is no solution.
    """
    if best.x.size > SINGULAR_VALUES:
        return best
    follows, steep = free & starter.following(t, best.x), bool(starter.system.form.scales)
    follows &= ~at_rest(starter, t, best.x, follows)
    written = starter.every & ~starter.groups(*HIDDEN) & starter.reading(follows)
    x, held = by_corrections(starter, t, best.x, written, follows & (np.arange(follows.size) < starter.n))
    if not held and steep:
        return None
    x = x if held else best.x
    near, held = by_corrections(starter, t, x, starter.every, follows)
    if held and near is not x:
        best = Solution(near, own_residual(starter, t, near, near))
    elif x is not best.x and np.isfinite(starter.jacobian(t, x)).all():
        best = solve(problem_of(starter, t, x, x, rows=starter.every, free=follows), x, 1)
    return None if steep and not _tells(starter, t, best.x, written, follows) else best


def _tells(starter: Starter, t: float, x: Floats, rows: Mask, free: Mask) -> bool:
    """Whether these rows, rates answering, hold and leave no state or effort of the point open by more than the largest
    of its like: a sum of currents may stand between charges of 1e8 A that cancel in it, and hold to their round-off.
    """
    problem = problem_of(starter, t, x, x, rows=rows, free=free)
    near = corrected(problem, x)
    if near is None or not near.whole:
        return True
    return near.agrees and not leaves_open(starter, t, near, np.maximum(problem.scale, np.abs(x)))
