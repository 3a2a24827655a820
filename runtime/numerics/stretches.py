"""A long array while nobody reads it: numbers that are equal one after the other, or ascend by one, are held once.

A line at rest, magnitudes that are those of a kind, places of families: of such arrays hardly anything is left.
"""

from __future__ import annotations

from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

SHORTER = 4
"""Times shorter than the array its stretches must be to be held instead."""
Number = TypeVar("Number", bound=np.generic)


class Stretches(Generic[Number]):
    """whole: the array [n], which is held as it is where it has too many stretches of equal numbers."""

    def __init__(self, whole: NDArray[Number]) -> None:
        bits = whole.view(f"i{whole.itemsize}")  # zeros of both signs, and what is no number
        begin = np.flatnonzero(np.concatenate([[True], bits[1:] != bits[:-1]])[: whole.size])
        # held by stretches where that is clearly shorter
        self._few = SHORTER * 2 * begin.size <= whole.size
        self._values: NDArray[Number] = whole[begin] if self._few else whole
        self._lengths = np.diff(begin, append=whole.size) if self._few else begin[:0].copy()

    @property
    def whole(self) -> NDArray[Number]:
        """The array: a new one where it was held by its stretches."""
        return np.repeat(self._values, self._lengths) if self._few else self._values


class Ascents:
    """whole: places [n], most of which ascend by one."""

    def __init__(self, whole: NDArray[Any]) -> None:
        self._offsets = Stretches(whole - np.arange(whole.size, dtype=whole.dtype))

    @property
    def whole(self) -> NDArray[Any]:
        """The places: a new array."""
        offsets = self._offsets.whole
        return offsets + np.arange(offsets.size, dtype=offsets.dtype)


def whole_of(array: NDArray[Any] | Stretches[Any] | Ascents) -> NDArray[Any]:
    """An array that may be held by its stretches."""
    return array if isinstance(array, np.ndarray) else array.whole
