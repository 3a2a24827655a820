"""Numbers in ascending order, each once; numbers without a pattern, always the same.

NumPy has both (`unique`, `random`), and imports 12 ms of modules for them, a twentieth of a short command.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Scalar = TypeVar("Scalar", bound=np.generic)
EVEN = 0.7548776662466927, 0.5698402909980532
"""1/g and 1/g^2 of g^3 = g + 1: multiples of both fill the unit square evenly."""


def distinct(values: NDArray[Scalar]) -> NDArray[Scalar]:
    """Of numbers [k]: each once, in ascending order."""
    found = np.sort(values)
    new: NDArray[np.bool_] = np.ones(found.size, dtype=bool)
    new[1:] = found[1:] != found[:-1]
    return found[new]


def uniform(number: int, which: int = 0, behind: int = 0) -> NDArray[np.float64]:
    """Numbers [number] that fill [0, 1) evenly; which: 0 or 1, two that know nothing of each other; behind: so many
    that come before them.
    """
    found = np.arange(1.0 + behind, 1.0 + behind + number)
    found *= EVEN[which]
    found -= np.floor(found)  # as the remainder by one, in a tenth of its time
    return found


def normal(*shape: int, behind: int = 0) -> NDArray[Any]:
    """Numbers [shape] as from the normal distribution (Box and Muller, 1958); behind: so many that come before them."""
    number = int(np.prod(shape))
    radius, angle = uniform(number, 0, behind), uniform(number, 1, behind)
    # radius sqrt(-2 ln(1 - u)), angle 2 pi v
    np.log1p(np.negative(radius, out=radius), out=radius)
    radius *= -2.0
    np.sqrt(radius, out=radius)
    angle *= 2.0 * np.pi
    radius *= np.cos(angle, out=angle)
    return radius.reshape(shape)
