"""Which unknowns every run's start takes from its own text, so that the rows determine everything else.

An initial value that did not move at the nominal start is an anchor; what nobody wrote, and nothing determines, stays
where the nominal start left it if that is where it was guessed.  Where the rows then leave nothing open, the start of a
run is unique near the nominal one: it is what the search of start.py finds for guesses that need not move.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, statements
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.least_change import DENSE, RANK
from sysdyn.runtime.numerics.rank import count, singular_decomposition
from sysdyn.runtime.start.settled import Settler

Mask = NDArray[np.bool_]
AGREES = tuning.CANCELS
"""Of its magnitude: an initial value that moved by less did not move."""
OPEN = tuning.OPEN
"""Component of a null vector of unit length from which an unknown is open."""
LARGEST = DENSE
"""Unknowns with their rates that are looked at: full matrices."""
STATE = ("q", "f", "p", "s")


def anchors(settler: Settler, system: System, t: float, point: tuple[Floats, Floats], magnitude: Floats) -> Mask | None:
    """Which unknowns [written] are anchors; None where the rows leave something open beside them.

    point: y, yd [written] of the nominal start.
    """
    n = system.form.written
    # dense null spaces beyond this cost too much
    if n + settler.rates.size > LARGEST:
        return None
    # what the text said and the start kept: it holds for other numbers too
    guess, _, said = statements(system.form.at, n, system.description.initial)
    state = np.isin(system.kinds[:n], STATE)
    stayed = np.abs(point[0] - guess) <= AGREES * np.maximum(magnitude[:n], np.abs(guess))
    anchored = said & stayed & state
    may = ~said & stayed & state
    matrix = _scaled_jacobian(settler, t, point, magnitude)
    # as long as something is open, what moves most there is held as well
    while True:
        free = np.concatenate([~anchored, np.ones(settler.rates.size, dtype=bool)])
        null = _null(matrix[:, free])
        component = np.zeros(free.size)
        component[free] = np.abs(null).max(axis=0, initial=0.0) if null.size else 0.0
        # the rows determine everything else
        if not (component[:n] > OPEN).any():
            return anchored
        choice = np.where(may & ~anchored, component[:n], 0.0)
        # something is open that no anchor closes
        k = int(np.argmax(choice))
        if choice[k] <= OPEN:
            return None
        anchored[k] = True


def _scaled_jacobian(settler: Settler, t: float, point: tuple[Floats, Floats], magnitude: Floats) -> Floats:
    """The settled rows' Jacobian by unknowns and rates [rows, written + rates] in magnitudes, rows scaled to 1."""
    system = settler.system
    jy, jyd = system.jacobian(t, *point)
    matrix = np.hstack([system.dense(jy), system.dense(jyd)[:, settler.rates]]) * settler.scale
    # entries that are no numbers count as none
    matrix[~np.isfinite(matrix)] = 0.0
    size = np.abs(matrix).max(axis=1, initial=0.0)
    return np.asarray(matrix / np.where(size > 0.0, size, 1.0)[:, None])


def _null(matrix: Floats) -> Floats:
    """Null vectors as rows [k, columns]."""
    # no columns, or no rows: nothing, or all, is open
    if not matrix.shape[1]:
        return np.zeros((0, 0))
    if not matrix.shape[0]:
        return np.eye(matrix.shape[1])
    _, sigma, vectors = singular_decomposition(matrix)
    return np.asarray(vectors[count(sigma, RANK) :])
