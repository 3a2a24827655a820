"""What a search may spend, counted in operations: the same on every machine; and its limit of wall time."""

from __future__ import annotations

import time

from sysdyn.runtime.numerics.least_change import DENSE, SINGULAR_VALUES
from sysdyn.values import dataclass

GRANTED = 3.6e9
"""Operations that a search may take: two or three seconds; the hardest start of our models takes half of it."""
ITERATIONS = 40
"""Iterations that a search may take however large they are."""
EVALUATION = 1e6
"""Operations that evaluating the rows takes whatever their number: calls, not arithmetic."""
EACH = 40.0
"""Operations that an entry of the matrix takes in an evaluation."""


class OutOfTimeError(Exception):
    """The wall time granted is over."""


@dataclass(slots=True)
class Work:
    """What a search has left to spend, in operations counted by size: the same on every machine.

    A share of GRANTED, or as much as ITERATIONS iterations of the largest problem met take.  until: `time.monotonic()`
    beyond which counting raises OutOfTimeError.
    """

    share: float = 1.0
    until: float | None = None
    spent: float = 0.0
    largest: float = 0.0

    def iteration(self, shape: tuple[int, int], entries: int) -> None:
        """Count one linearisation with its solution, of so many rows and unknowns."""
        rows, unknowns = shape
        solution = 2e3 * (rows + unknowns + entries)
        if max(shape) <= SINGULAR_VALUES:
            solution = 15.0 * rows * unknowns * min(shape)
        elif max(shape) <= DENSE:
            solution = 4.0 * (rows + unknowns) ** 3
        self.clocked()
        whole = solution + EVALUATION + EACH * entries
        self.largest = max(self.largest, whole)
        self.spent += whole

    def evaluation(self, entries: int) -> None:
        """Count one evaluation of all rows."""
        self.clocked()
        self.spent += EVALUATION + EACH * entries

    def clocked(self) -> None:
        """Raise OutOfTimeError where the wall time is over."""
        if self.until is not None and time.monotonic() > self.until:
            raise OutOfTimeError

    @property
    def done(self) -> bool:
        """Whether nothing is left."""
        return self.spent > self.share * max(GRANTED, ITERATIONS * self.largest)
