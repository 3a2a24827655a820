"""What rows determine by corrections that vanish: small coefficients count beside large ones (linear/dense/graded.h).

Volts that a leak of megohms ties are lost in the steps of a search, whose rows hold to the round-off of kiloamperes.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.gauss_newton import Correction, corrected
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.starter import STATE, Mask, Starter

EXACT = 1e-9
"""Scaled residual of rows that hold, and a step that is none."""
SHARPER = 60
"""Corrections in which what follows from the state is found, or left as it was."""


def by_corrections(
    starter: Starter, t: float, x: Floats, rows: Mask, free: Mask, *, partly: bool = False
) -> tuple[Floats, bool]:
    """X after corrections that vanish, and whether the rows hold to their round-off then and leave no state or effort
    open by more than the largest of its like; as it was where corrections do not vanish, or rows determine too little.
    partly: what has no row of its own stays, and what is less than its round-off is nothing.
    """
    begun, agrees, last = x, True, np.inf
    for _ in range(SHARPER):
        problem = problem_of(starter, t, x, x, rows=rows, free=free)
        near = corrected(problem, x)
        if near is None or not (partly or near.whole):
            return begun, agrees
        agrees = near.agrees
        step, size = np.abs(near.x - x), np.maximum(problem.scale, np.abs(x))
        step[step <= near.open_] = 0.0
        most = float(np.max(step / size, initial=0.0))
        if most <= EXACT and (agrees or most >= 0.5 * last):  # a steep law tells 1e-13 of a volt from its round-off
            if partly:
                x = np.where(np.isfinite(near.open_) & (np.abs(x) <= near.open_), 0.0, x)
            return x, agrees and not leaves_open(starter, t, near, size)
        if starter.work.done:
            return begun, False
        x, last = near.x, most
    return begun, True


def leaves_open(starter: Starter, t: float, near: Correction, size: Floats) -> bool:
    """Whether round-off leaves a state or an effort open by more than the largest of its like, and of what rows add to
    it as it is (the head of an orifice between vessels of one pressure is what is left of these), or rows of momenta.
    """
    told, largest = starter.moves(*STATE, "e") & np.isfinite(near.open_), starter.largest_alike(size)
    if (near.open_ <= largest)[told].all():
        return False
    slopes = np.abs(starter.jacobian(t, near.x))
    added = (slopes == 1.0) | (starter.groups("momentum")[starter.rows] & (slopes > 0.0))
    rows, columns = starter.rows[added], starter.columns[added]
    terms = np.zeros(starter.settled.rows)
    np.maximum.at(terms, rows, slopes[added] * size[columns])
    np.maximum.at(largest, columns, terms[rows] / slopes[added])
    return bool((near.open_ > largest)[told].any())
