"""What rows determine by corrections that vanish: small coefficients count beside large ones (linear/dense/graded.h).

Volts that a leak of megohms ties are lost in the steps of a search, whose rows hold to the round-off of kiloamperes.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.gauss_newton import ITERATIONS, Correction, corrected
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.starter import STATE, Mask, Starter
from sysdyn.values import dataclass

EXACT = tuning.SAME
"""Scaled residual of rows that hold, and a step that is none."""
SHARPER = ITERATIONS
"""Corrections in which what follows from the state is found, or left as it was."""
BACK = 0.5
"""Of the step before: what is longer, and the other way, is round-off where it may be."""


@dataclass(frozen=True, slots=True)
class Corrected:
    """x; holds: whether the rows do, to their round-off, and leave no state or effort open by more than the largest of
    its like; known [unknowns]: what they determine.  x as it was, and nothing known, where corrections do not vanish.
    """

    x: Floats
    holds: bool
    known: Mask


def by_corrections(starter: Starter, t: float, x: Floats, rows: Mask, free: Mask, *, partly: bool = False) -> Corrected:
    """What `rows` make of x in what is `free`, by corrections until nothing moves but round-off.  What has no row of
    its own stays; partly: what is less than its round-off is nothing.
    """
    begun, nothing = x, np.zeros_like(free)
    last, rested = np.zeros(x.size), False
    # corrections until nothing moves but round-off
    for k in range(SHARPER):
        problem = problem_of(starter, t, x, x, rows=rows, free=free)
        starter.work.iteration((int(rows.sum()), int(free.sum())), starter.rows.size)
        near = corrected(problem, x)
        if near is None or not (partly or near.whole):  # too large, of too few rows, leading nowhere
            return Corrected(begun, k == 0, nothing)
        step, size = near.x - x, np.maximum(problem.scale, np.abs(x))
        rests = not _moving(step, last, near.open_, size).any()
        # at rest, and the rows agree: done
        if rests and (near.agrees or rested):
            # what is less than its own round-off is zero
            if partly:
                x = np.where(np.isfinite(near.open_) & (np.abs(x) <= near.open_), 0.0, x)
            holds = near.agrees and not leaves_open(starter, t, near, size)
            return Corrected(x, holds, free & np.isfinite(near.open_))
        if starter.work.done:
            break
        x, last, rested = near.x, step, rests
    return Corrected(begun, False, nothing)


def _moving(step: Floats, last: Floats, open_: Floats, size: Floats) -> Mask:
    """What a correction moves: beyond its round-off; within this bound, mostly a wide one, as long as steps go on the
    same way (down an exponential, each as long as the last) or become less.
    """
    length, before = np.abs(step), np.abs(last)
    onward = (length < BACK * before) | ((step * last > 0.0) & (length <= before))
    return np.asarray((length > EXACT * size) & ((length > open_) | onward))


def leaves_open(starter: Starter, t: float, near: Correction, size: Floats) -> bool:
    """Whether round-off leaves a state or an effort open by more than the largest of its like, and of what rows add to
    it as it is (the head of an orifice between vessels of one pressure is what is left of these), or rows of momenta.
    """
    told, largest = starter.moves(*STATE, "e") & np.isfinite(near.open_), starter.largest_alike(size)
    if (near.open_ <= largest)[told].all():
        return False
    # what rows add to it as it is, and momenta, may be as large as their terms
    slopes = np.abs(starter.jacobian(t, near.x))
    added = (slopes == 1.0) | (starter.groups("momentum")[starter.rows] & (slopes > 0.0))
    rows, columns = starter.rows[added], starter.columns[added]
    terms = np.zeros(starter.settled.rows)
    np.maximum.at(terms, rows, slopes[added] * size[columns])
    np.maximum.at(largest, columns, terms[rows] / slopes[added])
    return bool((near.open_ > largest)[told].any())
