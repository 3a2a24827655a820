"""Whether a point with a given state can exist, where that is linear algebra.

With the state held most models are linear in what follows from it: multipliers, rates, flows and efforts of linear
laws.  Then one least-squares solution says whether their rows can be met, and what it leaves of them no search does
away with: two diodes that short a source, a gap that is held and closes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import least_squares
from sysdyn.runtime.start.settled import Settler, columns_of_rates

DENSE = 300
"""Unknowns and rates up to which matrices are full; of more nothing is said."""
ALIKE = 1e-9
"""Of a slope: what it differs by elsewhere and is constant."""
MISSES = 1e-6
"""Of the terms of a row: what is left of it that is no round-off."""


def unmet(settler: Settler, t: float, y: Floats, yd: Floats, state: NDArray[np.bool_]) -> bool:
    """Whether no point at t has this state: what follows from y, yd [unknowns as written] enters the rows linearly, and
    leaves one of them unmet.
    """
    settled, rates = settler.system, settler.rates
    n = settled.unknowns
    if n + rates.size > DENSE:
        return False
    columns = settled.pattern.columns_of()
    free, moved = ~state[columns], columns_of_rates(n, rates, columns)
    slopes = settled.jacobian(t, y, yd)
    if not _constant(settler, (t, y, yd), slopes, (free, moved >= 0), state):
        return False
    matrix = np.zeros((settled.rows, n + rates.size))
    rows, rated = settled.pattern.row, moved >= 0
    np.add.at(matrix, (rows[free], columns[free]), slopes[0][free])
    np.add.at(matrix, (rows[rated], moved[rated]), slopes[1][rated])
    residual = settled.residual(t, y, yd)
    by_row, by_column = factors(matrix)
    change = by_column * least_squares(by_row[:, None] * matrix * by_column, -by_row * residual)
    size = np.abs(matrix) @ np.abs(change)
    for slope, at in zip(slopes, (y, yd), strict=True):
        np.add.at(size, rows, np.abs(slope * at[columns]))
    left = np.abs(matrix @ change + residual)
    return bool((left > MISSES * size)[settler.holding].any())


def _constant(
    settler: Settler,
    point: tuple[float, Floats, Floats],
    slopes: tuple[Floats, Floats],
    asked: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    state: NDArray[np.bool_],
) -> bool:
    """Whether slopes [entries] by what follows, those asked for, are the same where that is something else."""
    (t, y, yd), number = point, settler.system.unknowns
    random, core = np.random.default_rng(1), settler.core.contents
    scale = lib.reader(core.scale, number + settler.rates.size)
    aside = scale * random.uniform(0.5, 1.5, scale.size)
    other_y, other_yd = y + np.where(state, 0.0, aside[:number]), yd.copy()
    other_yd[settler.rates] += aside[number:]
    elsewhere = settler.system.jacobian(t, other_y, other_yd)
    for here, there, which in zip(slopes, elsewhere, asked, strict=True):
        a, b = here[which], there[which]
        if not (np.abs(a - b) <= ALIKE * np.maximum(np.abs(a), np.abs(b))).all():
            return False
    return True
