"""A long array while nobody reads it: numbers that are equal one after the other are held once.

A line at rest, magnitudes that are those of a kind: of such arrays hardly anything is left.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats

SHORTER = 4
"""Times shorter than the array its stretches must be to be held instead."""


class Stretches:
    """whole: the array [n], which is held as it is where it has too many stretches."""

    def __init__(self, whole: Floats) -> None:
        bits = whole.view(np.int64)  # zeros of both signs, and what is no number
        begin = np.flatnonzero(np.concatenate([[True], bits[1:] != bits[:-1]])[: whole.size])
        self._few = SHORTER * 2 * begin.size <= whole.size
        self._values: Floats = whole[begin] if self._few else whole
        self._lengths = np.diff(begin, append=whole.size) if self._few else begin[:0].copy()

    @property
    def whole(self) -> Floats:
        """The array: a new one where it was held by its stretches."""
        return np.repeat(self._values, self._lengths) if self._few else self._values
