"""Whether a point can exist, where that is linear algebra.

With the state held most models are linear in what follows from it: multipliers, rates, flows and efforts of linear
laws; circuits of ideal diodes are linear in everything.  Then one elimination says whether their rows can be met, and
what it leaves of them no search does away with: two diodes that short a source, a gap that is held and closes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.numerics.gauss_newton import MISSED, graded
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.start.settled import Settler, columns_of_rates
from sysdyn.runtime.start.starter import Starter
from sysdyn.values import dataclass

DENSE = tuning.DENSE
"""Unknowns up to which matrices are full; of more nothing is said."""
ALIKE = tuning.SAME
"""Of a slope: what it differs by elsewhere and is constant."""
AROUND = tuple(sign * far for far in (1.0, 1.0 / tuning.SMALL) for sign in (1.0, -1.0))
"""Magnitudes from a point where the slopes of a linear row are the same."""
MISSES = tuning.SLIGHT
"""Of the terms of a row: what it may miss by as a step of the run leaves it; more, in a sum of rows that eliminates all
that may move, is no such miss.
"""
NOTHING = tuning.UNSEEN
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
        # too large for dense elimination
        if x.size > DENSE:
            return False
        here, free = self.slopes(x), self.free[self.columns]
        # at a point aside: other slopes mean a curve
        aside = self.size * np.random.default_rng(1).uniform(0.5, 1.5, x.size)
        a, b = here[free], self.slopes(np.where(self.free, x + aside, x))[free]
        if not _alike(a, b).all():
            return False
        return self._unmet(x, here, self.asked)

    def contradicting(self, x: Floats) -> Mask | None:
        """Of these rows the ones that are linear, where they leave one of them unmet; None where they do not."""
        if x.size > DENSE:
            return None
        here, free = self.slopes(x), self.free[self.columns]
        step = self.size * np.random.default_rng(1).uniform(0.5, 1.5, x.size)
        linear = self.asked.copy()
        # at several points around
        for part in AROUND:
            there = self.slopes(np.where(self.free, x + part * step, x))
            linear[self.rows[free & ~_alike(here, there)]] = False
        return linear if self._unmet(x, np.where(linear[self.rows], here, 0.0), linear) else None

    def _unmet(self, x: Floats, here: Floats, asked: Mask) -> bool:
        """Whether an elimination leaves one of the rows asked unmet, which keeps small coefficients beside large ones
        (the leak of a blocked bridge beside kiloamperes); here: slopes.  NotFiniteError.
        """
        # matrix of what may move, and sizes of terms
        free = self.free[self.columns]
        matrix, terms = np.zeros((asked.size, x.size)), np.zeros(asked.size)
        np.add.at(matrix, (self.rows[free], self.columns[free]), here[free])
        np.add.at(terms, self.rows, np.abs(here) * np.maximum(np.abs(x), NOTHING * self.size)[self.columns])
        matrix, aim, (step, doubt) = matrix[asked], -self.residual(x)[asked], np.zeros((2, x.size))
        # no numbers: nothing is said
        if not (np.isfinite(matrix).all() and np.isfinite(aim).all()):
            raise NotFiniteError
        return graded(matrix, aim, step, MISSES * terms[asked], doubt) == MISSED


def _alike(a: Floats, b: Floats) -> Mask:
    """Where slopes are the same; one beyond the largest number is like none."""
    both = np.isfinite(a) & np.isfinite(b)
    a, b = np.where(both, a, 0.0), np.where(both, b, np.inf)
    return np.asarray(both & (np.abs(b - a) <= ALIKE * np.abs(a)))


def unmet(settler: Settler, t: float, y: Floats, yd: Floats, state: Mask) -> bool:
    """Whether linear algebra says that no point at t has this state of y, yd [unknowns as written]."""
    settled, rates = settler.system, settler.rates
    n, columns = settled.unknowns, settled.pattern.columns_of()
    # unknowns, then rates
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
    try:
        return rows.contradict(np.concatenate([y, yd[rates]]))
    except NotFiniteError:
        return False


def no_start(starter: Starter, t: float, x: Floats, free: Mask) -> bool:
    """Whether linear algebra says that there is no start, from x [unknowns of the start] by what is free."""
    return _of_a_start(starter, t, x, free).contradict(x)


def contradicting(starter: Starter, t: float, x: Floats, free: Mask) -> Mask | None:
    """Rows of a start that are linear and cannot all be met from x by what is free; None where they can."""
    with np.errstate(all="ignore"):  # slopes beyond numbers are of rows that are not linear
        return _of_a_start(starter, t, x, free).contradicting(x)


def _of_a_start(starter: Starter, t: float, x: Floats, free: Mask) -> Rows:
    at, size = (starter.rows, starter.columns), starter.scale(t, x)
    residual, slopes = (lambda x: starter.residual(t, x)), (lambda x: starter.jacobian(t, x))
    return Rows(residual, slopes, *at, starter.every, free, size)
