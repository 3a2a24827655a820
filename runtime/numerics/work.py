"""What a search may spend, counted in operations: the same on every machine; and its limit of wall time."""

from __future__ import annotations

import time
from dataclasses import field

from sysdyn.runtime import _core
from sysdyn.runtime.numerics.least_change import DENSE, SINGULAR_VALUES
from sysdyn.values import dataclass

GRANTED: float = _core.SD_GRANTED
"""Operations that a search may take: two or three seconds; the hardest start of our models takes half of it."""
ITERATIONS: int = _core.SD_ITERATIONS
"""Iterations that a search may take however large they are."""
EVALUATION: float = _core.SD_EVALUATION
"""Operations that evaluating the rows takes whatever their number: calls, not arithmetic."""
FACTORS = 4e6
"""Operations that factors of sparse rows take whatever their number: calls (2 ms of 5 for 240 rows)."""
EACH: float = _core.SD_EACH
"""Operations that an entry of the matrix takes in an evaluation."""


TOGETHER = 5.5
"""Times what a search may take: what all searches for one start may; the hardest of the tests takes 5.3."""


class OutOfTimeError(Exception):
    """The wall time granted is over."""


@dataclass(slots=True)
class Budget:
    """What all searches for one start spend together: at most so many times what one may, and what is left of the
    budget that it is a part of.  until: `time.monotonic()` beyond which counting raises OutOfTimeError.
    """

    until: float | None = None
    times: float = TOGETHER
    of: Budget | None = None
    spent: float = 0.0

    def part(self, times: float) -> Budget:
        """So many times what a search may, out of it."""
        return Budget(self.until, times, self)

    def count(self, operations: float) -> None:
        """So many operations, here and in what it is a part of."""
        self.spent += operations
        if self.of is not None:
            self.of.count(operations)

    def share_left(self, own: float, one: float) -> float:
        """Times what a search may, `one`, that it grants to one which has spent `own`."""
        here = self.times - (self.spent - own) / one
        return here if self.of is None else min(here, self.of.share_left(own, one))


@dataclass(slots=True)
class Work:
    """What a search has left to spend, in operations counted by size: the same on every machine.

    A share of GRANTED, or as much as ITERATIONS iterations of the largest problem met take; no more than is left of the
    budget.
    """

    share: float = 1.0
    budget: Budget = field(default_factory=Budget)
    spent: float = 0.0
    largest: float = 0.0

    def count(self, operations: float) -> None:
        """So many operations, of the search and of all."""
        self.spent += operations
        self.budget.count(operations)

    def iteration(self, shape: tuple[int, int], entries: int, *, full: bool = True) -> None:
        """Count one linearisation with its solution, of so many rows and unknowns; full: by full matrices up to DENSE,
        else by factors beyond those that singular values solve.
        """
        rows, unknowns = shape
        solution = FACTORS + 2e3 * (rows + unknowns + entries)
        # singular values, a full matrix, or sparse factors
        if max(shape) <= SINGULAR_VALUES:
            solution = 15.0 * rows * unknowns * min(shape)
        elif full and max(shape) <= DENSE:
            solution = 4.0 * (rows + unknowns) ** 3
        self.clocked()
        whole = solution + EVALUATION + EACH * entries
        self.largest = max(self.largest, whole)
        self.count(whole)

    def evaluation(self, entries: int) -> None:
        """Count one evaluation of all rows."""
        self.clocked()
        self.count(EVALUATION + EACH * entries)

    def clocked(self) -> None:
        """Raise OutOfTimeError where the wall time is over."""
        if self.budget.until is not None and time.monotonic() > self.budget.until:
            raise OutOfTimeError

    @property
    def done(self) -> bool:
        """Whether nothing is left."""
        return self.spent > self.allowed * max(GRANTED, ITERATIONS * self.largest)

    @property
    def allowed(self) -> float:
        """The share that the budget leaves of it."""
        return min(self.share, self.budget.share_left(self.spent, max(GRANTED, ITERATIONS * self.largest)))
