"""What the coarser of two runs passed over in one step: a front that none of its rows lies in.

Where the finer run takes many steps within one of the coarser's, something happens of which their rows in common say
nothing. There the finer rows are compared with the cubic between the coarser's own, by their values and rates: a step
that saw no front is as smooth as that, and what it differs by is all that is known of the front's error.
Received: the rows of both runs at their steps [k, width]; handed on: how far the quantities differ.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats, Ints

CROWD, BEYOND = 8, 2.5
"""Steps of the finer run within one of the coarser's that are many, and times what they are on the whole (at the start
both begin with short ones)."""
STEEP = 3.0
"""Of the slope across a step: with rates at its ends no larger the cubic stays between them (Fritsch and Carlson);
those of what relaxes at once are beyond bounds."""


def passed_over(coarse: Floats, fine: Floats, places: Ints, rates: Ints) -> Floats:
    """Largest difference [quantities] of the rows of two runs, whose columns these are, in steps of the coarser one
    that the finer one crowds; zeros where there is none.
    """
    found = np.zeros(places.size)
    before, now = coarse[:, 0], fine[:, 0]
    # one row has no steps
    if before.size < 2 or not now.size:
        return found
    place = np.searchsorted(before, now) - 1  # of the step in which each row lies
    inside = (place >= 0) & (now < before[np.minimum(place + 1, before.size - 1)])
    number = np.bincount(place[inside], minlength=before.size)
    # steps of the coarser run that hold far more rows of the finer one than the mean
    crowded = number >= max(CROWD, BEYOND * now.size / before.size)
    inside &= crowded[place]
    if not inside.any():
        return found
    k, values = place[inside], fine[inside][:, places]
    # dense output of the coarser run: a cubic by values and rates at both ends
    length = (before[k + 1] - before[k])[:, None]
    at = (now[inside] - before[k])[:, None] / length
    one, two = coarse[k][:, places], coarse[k + 1][:, places]
    # a rate far above the secant belongs to what relaxes at once: clipped
    most = STEEP * np.abs(two - one)
    slope_one, slope_two = (np.clip(length * coarse[j][:, rates], -most, most) for j in (k, k + 1))
    back = 1.0 - at
    cubic = back**2 * ((1.0 + 2.0 * at) * one + at * slope_one) + at**2 * ((1.0 + 2.0 * back) * two - back * slope_two)
    # what the rows of the finer run are off that cubic
    apart: Floats = np.abs(values - cubic).max(axis=0)
    return np.where(np.isfinite(apart), apart, 0.0)
