"""Whether a point can exist, where that is linear algebra.

With the state held most models are linear in what follows from it: multipliers, rates, flows and efforts of linear
laws; circuits of ideal diodes are linear in everything.  Then one least-squares solution says whether their rows can be
met, and what it leaves of them no search does away with: two diodes that short a source, a gap that is held and closes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import least_squares
from sysdyn.runtime.start.settled import Settler, columns_of_rates
from sysdyn.runtime.start.starter import Starter
from sysdyn.values import dataclass

DENSE = 300
"""Unknowns up to which matrices are full; of more nothing is said."""
ALIKE = 1e-9
"""Of a slope: what it differs by elsewhere and is constant."""
MISSES, REFINED = 1e-4, 2
"""Of the terms of a row: what is left of it that is no round-off; solutions, each of what the one before left over."""
ROUND_OFF = 1e-13
"""Of the largest singular value: one that is less is no way out; valves in series with a stiff chamber have 2.5e-10."""
NOTHING = 1e-6
"""Of its magnitude: what an unknown is of which nothing but round-off may be there."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Rows:
    """Equations r(x) = 0: residual [rows]; slopes [entries], whose places are rows, columns; asked [rows]: which are to
    hold; free [unknowns]: which may move; size [unknowns]: magnitudes.
    """

    residual: Callable[[Floats], Floats]
    slopes: Callable[[Floats], Floats]
    rows: Ints
    columns: Ints
    asked: Mask
    free: Mask
    size: Floats

    def contradict(self, x: Floats) -> bool:
        """Whether they are linear in what may move from x on, and leave one of them unmet."""
        if x.size > DENSE:
            return False
        here, free = self.slopes(x), self.free[self.columns]
        aside = self.size * np.random.default_rng(1).uniform(0.5, 1.5, x.size)
        a, b = here[free], self.slopes(np.where(self.free, x + aside, x))[free]
        if not (np.abs(a - b) <= ALIKE * np.maximum(np.abs(a), np.abs(b))).all():
            return False
        matrix = np.zeros((self.asked.size, x.size))
        np.add.at(matrix, (self.rows[free], self.columns[free]), a)
        matrix[~self.asked] = 0.0
        residual = np.where(self.asked, self.residual(x), 0.0)
        by_row, by_column = factors(matrix)
        even, change = by_row[:, None] * matrix * by_column, np.zeros(x.size)
        for _ in range(REFINED):
            change += by_column * least_squares(even, -by_row * (matrix @ change + residual), ROUND_OFF)
        terms = np.abs(matrix) @ np.abs(change)
        np.add.at(terms, self.rows, np.abs(here) * np.maximum(np.abs(x), NOTHING * self.size)[self.columns])
        left = np.abs(matrix @ change + residual)
        return bool((left > MISSES * terms)[self.asked].any())


def unmet(settler: Settler, t: float, y: Floats, yd: Floats, state: Mask) -> bool:
    """Whether linear algebra says that no point at t has this state of y, yd [unknowns as written]."""
    settled, rates = settler.system, settler.rates
    n, columns = settled.unknowns, settled.pattern.columns_of()
    moved = columns_of_rates(n, rates, columns)
    rated = moved >= 0

    def point(x: Floats) -> tuple[float, Floats, Floats]:
        rate = yd.copy()
        rate[rates] = x[n:]
        return t, x[:n], rate

    def slopes(x: Floats) -> Floats:
        by_value, by_rate = settled.jacobian(*point(x))
        return np.concatenate([by_value, by_rate[rated]])

    free = np.concatenate([~state, np.ones(rates.size, dtype=bool)])
    at = np.concatenate([settled.pattern.row, settled.pattern.row[rated]]), np.concatenate([columns, moved[rated]])
    size = lib.reader(settler.core.contents.scale, n + rates.size)
    rows = Rows(lambda x: settled.residual(*point(x)), slopes, *at, settler.holding, free, size)
    return rows.contradict(np.concatenate([y, yd[rates]]))


def no_start(starter: Starter, t: float, x: Floats, free: Mask) -> bool:
    """The same of a start, from x [unknowns of the start] by what is free."""
    at, size = (starter.rows, starter.columns), starter.scale(t, x)
    residual, slopes = (lambda x: starter.residual(t, x)), (lambda x: starter.jacobian(t, x))
    return Rows(residual, slopes, *at, starter.every, free, size).contradict(x)
