"""What is found from one point: all rows, the least change of the state, what follows from a state that is held.

Where a law has no slope (a turbulent valve at rest) there is no rate of what it passes: decisions.md, 5.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.gauss_newton import Solution, solve, stepped
from sysdyn.runtime.numerics.least_change import DENSE
from sysdyn.runtime.start.corrections import EXACT
from sysdyn.runtime.start.flat import (
    OWN,
    at_rest,
    beside_the_flat,
    off_the_flat,
    rested,
    unrated,
    without_flow,
    without_rates,
)
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.linearly import no_start
from sysdyn.runtime.start.starter import NOISE, Mask, Starter

RESCALINGS, _DOUBTED = 6, 3
"""Times that magnitudes are taken anew; after which of them a state that is held is asked whether it can be, of active
sets, which may contradict it.
"""
IDLE, SAME = 2, tuning.PERCENT
"""Times that magnitudes taken anew change nothing, behind which they never will; of misses: what is no change."""
BACK = tuning.MET
"""Steps of this part of magnitudes are round-off of the linear algebra, and tried without."""
CLOSED = tuning.CANCELS
"""Scaled residual of rows that hold to round-off."""
ASTRAY, SETTLED, FARTHER, _SETTLING = 1e-5, tuning.MET, tuning.SAME, 20
"""Of the largest alike: a state farther from the least change has moved for nothing; of its scale: what searches
leave; in units of moves, where what nothing is said of weighs a thousandth: one is farther than another; steps along
what bends.
"""


def rescaled(
    starter: Starter, t: float, x: Floats, guess: Floats, free: Mask, *, least: bool = True, sized: Floats | None = None
) -> tuple[Solution, bool]:
    """Everything at once from x, and whether it holds; magnitudes are those of `sized` at first (None: x).

    Magnitudes that proved wrong (currents of 1e-12 A at the guess, a diode at 2 V) are taken anew: the rows must hold
    in the magnitudes of the solution too.
    """
    at, best, idle = x if sized is None else sized, Solution(x, np.inf), 0
    # magnitudes anew from what was found, until rows hold in them
    for k in range(RESCALINGS):
        if k and (starter.work.done or idle == IDLE):
            break
        # switches may contradict: linear algebra tells before the search is long
        if k == _DOUBTED and not least and starter.system.description.switches.places and no_start(starter, t, x, free):
            break
        problem = problem_of(starter, t, at, guess, rows=starter.every, free=free, least=least)
        before, best = best.residual, solve(problem, best.x)
        # the same residual again: idle
        idle = idle + 1 if abs(best.residual - before) <= SAME * before else 0
        if not np.isfinite(best.residual):
            break
        at = starter.without_noise(best.x, problem.scale)
        del problem  # of a large model the room counts
        # held in the magnitudes of before: in its own too?
        if best.residual < EXACT:
            clean = next((c for c in (at, best.x) if own_residual(starter, t, at, c) < OWN), None)
            if clean is not None:
                return replace(best, x=clean), True
            # the guess where it was hardly left
            if x.size <= DENSE:
                back = np.where(np.abs(best.x - guess) <= BACK * starter.scale(t, guess), guess, best.x)
                if own_residual(starter, t, back, back) < OWN:
                    return replace(best, x=back), True
    return best, False


def own_residual(starter: Starter, t: float, magnitudes: Floats, x: Floats) -> float:
    """Largest residual at x of the rows that must hold, relative to their terms in magnitudes of a solution: those of
    noise beside their like are no less than that.
    """
    scale = np.maximum(starter.scale(t, magnitudes), NOISE * starter.largest_alike(magnitudes))
    size = starter.row_scale(t, magnitudes, scale)[starter.every]
    return float(np.max(np.abs(starter.residual(t, x)[starter.every]) * size, initial=0.0))


def least_change(
    starter: Starter, t: float, x: Floats, guess: Floats, rows: Mask, free: Mask, state: Mask
) -> Floats | None:
    """From x where these rows hold and the state cannot be nearer to the guess; None where none was found.  Where laws
    have no slope no step along the others shows what is nearer: that from beside them too, and the nearer of both.
    """
    found = _settled(starter, t, x, guess, rows, free, state)
    at = x if found is None else found
    # beside laws without slope too, in a small model
    beside = beside_the_flat(starter, t, at, guess, rows, free) if x.size <= DENSE else None
    if beside is None:
        return found
    # what follows there, with the state held
    held = solve(problem_of(starter, t, beside, guess, rows=rows, free=free & ~state), beside)
    begun = held.x if held.residual < EXACT else beside  # else it may fall back to where laws are flat
    other = _settled(starter, t, begun, guess, rows, free, state)
    # the nearer of both
    if found is None or (other is not None and not farther(starter, t, other, found, guess, free)):
        return other
    return found


def farther(starter: Starter, t: float, x: Floats, near: Floats, guess: Floats, free: Mask) -> bool:
    """Whether x is farther from the guess than this point, by what moves least."""
    problem = problem_of(starter, t, guess, guess, rows=starter.every, free=free, least=True)
    apart = (a - b for a, b in zip(problem.distances(x), problem.distances(near), strict=True))
    return next((d for d in apart if abs(d) > FARTHER), 0.0) > 0.0


def _settled(
    starter: Starter, t: float, x: Floats, guess: Floats, rows: Mask, free: Mask, state: Mask
) -> Floats | None:
    """The point of `least_change` by steps along the rows as they are linear; None where none was found."""
    # by steps along linear rows until the state is as near as it gets
    for _ in range(_SETTLING):
        found = solve(problem_of(starter, t, x, guess, rows=rows, free=free, least=True), x)
        if found.residual >= EXACT:
            return None
        x = nearest(starter, t, found.x, guess, rows, free)
        if not astray(starter, t, found.x, x, guess, state):
            return found.x
    return None


def tidied(starter: Starter, t: float, x: Floats, guess: Floats, state: Mask) -> Floats:
    """X without round-off: of the state beside the largest state alike, whatever searches left of what follows."""
    scale = starter.scale(t, guess)
    return np.where(state, starter.without_noise(np.where(state, x, 0.0), scale), starter.without_noise(x, scale))


def nearest(starter: Starter, t: float, x: Floats, guess: Floats, rows: Mask, free: Mask) -> Floats:
    """The point nearest to the guess on these rows as they are linear at x."""
    return stepped(problem_of(starter, t, x, guess, rows=rows, free=free, least=True), x)


def astray(starter: Starter, t: float, x: Floats, near: Floats, guess: Floats, state: Mask) -> bool:
    """Whether the state at x has moved farther than to this nearest point, of the largest state alike; of scales, which
    slopes beyond all bounds make as large as they like, no more counts than what a search leaves.
    """
    size = starter.largest_alike(np.where(state, np.maximum(np.abs(near), np.abs(x)), 0.0))
    left = SETTLED * np.minimum(starter.scale(t, guess), starter.scale(t, x))
    return bool((np.abs(near - x) > ASTRAY * size + left)[state].any())


def following(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask, follows: Mask) -> tuple[Solution, bool]:
    """What follows from the state at x, beside flat laws first in a small model; whether all rows nearly hold.  Where a
    law passes but a root of round-off, whose rate is of any size, rather than that without such a rate, if there is.
    """
    best = Solution(x, np.inf), False
    ways: Iterable[tuple[int, Way]] = enumerate(_ways(starter, t, x, free, follows))
    if x.size <= DENSE:  # that which led there last first
        ways = sorted(ways, key=lambda item: item[0] != starter.led)
    for k, (way, near) in ways:
        found, nearly = way(starter, t, near, guess, follows)
        # nearly, and not by a root of round-off
        if nearly and (x.size > DENSE or way is _at_rest or (rested(starter, t, found.x, follows) == found.x).all()):
            starter.led = k
            return found, True
        if not best[1]:
            best = found, nearly
    return best


Way = tuple[Callable[..., tuple[Solution, bool]], Floats]
"""How what follows is sought, and from where."""


def _ways(starter: Starter, t: float, x: Floats, free: Mask, follows: Mask) -> Iterator[Way]:
    """How what follows is sought, and from where."""
    # of a large model: at once, then from beside flat laws
    if x.size > DENSE:
        yield _at_once, x
        yield from ((_at_once, near) for near, _ in off_the_flat(starter, t, x, follows))
        return
    # points beside flat laws, and where it stands
    beside = [near for near, _ in off_the_flat(starter, t, x, follows)]
    points = [x, *(near for near in beside if (near != x).any())][::-1]
    rated = np.isfinite(starter.residual(t, x)[starter.every]).all()
    # where no state can move what is all but at rest has rates
    resting = not rated or (free & ~follows & ~starter.hollow).any()
    first = resting and (bool(beside) or not rated)
    # at rest first where laws are flat, or rows are no numbers
    yield from ((_at_rest, near) for near in points if first)
    yield from ((_at_once, near) for near in points)
    if resting and not first:
        yield _at_rest, x


def _at_once(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """From x, in what is free, all rows."""
    return rescaled(starter, t, x, guess, free, least=False)


def _at_rest(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """From x, in what follows from the state, first the rows without rates; then all but rates of laws that are flat
    at rest, as found; these are asked for again where that does not hold.
    """
    found = solve(problem_of(starter, t, x, guess, rows=without_rates(starter), free=free), x)
    # rows as written do not hold
    if found.residual >= EXACT or x.size > DENSE:
        return found, False
    before, scale = (starter.every.copy(), starter.resting.copy()), starter.scale(t, guess)
    begun = starter.without_noise(found.x, scale)  # what round-off left is no magnitude
    # rates of flat laws are let go until those that are left hold
    for still in (at_rest, without_flow):
        near, fewer = begun, True
        while fewer:
            near = rested(starter, t, near, free)
            unrated(starter, t, near)
            found, holds = rescaled(starter, t, near, guess, free & ~still(starter, t, near, free), least=False)
            near = starter.without_noise(found.x, scale)
            fewer = holds and unrated(starter, t, near)
        if holds:
            break
        # asked for again: they do not hold without
        starter.every[:], starter.resting[:] = before
    return found, holds
