"""The inertia matrix at a state: whether T* has a minimum (language, E321).

M = d2T*/df2 stands in the rows of dynamics as the coefficient of f' (Lagrange), or in those of momentum as minus the
coefficient of f (Hamilton, p - dT*/df).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.inertia import own_unknown
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState

Longs = NDArray[np.int64]
DENSE = 300
NEGATIVE = 1e-9
"""Eigenvalues below minus this part of the largest are negative."""


def negative_inertia(system: System, state: ConsistentState) -> tuple[str, float] | None:
    """The flow that moves most along a direction in which the inertia is negative, and the inertia n^T M n there, where
    this flow is one (SI); None where there is none.

    system: the form as written.  Models of more than DENSE flows are judged by their diagonal.
    """
    flows, (i, j), places, of_momentum = system.once("inertia", lambda: _places(system))
    if not flows.size:
        return None
    jy, jyd = system.jacobian(state.t, *state.for_form(system))
    return _least(system, flows, (i, j, np.where(of_momentum, -jy[places], jyd[places])))


def _places(system: System) -> tuple[Longs, tuple[Longs, Longs], Longs, NDArray[np.bool_]]:
    """Flows; the entries of M: row and column among these, place in the pattern, whether in a row of momentum."""
    moving, columns, row = system.are("f"), system.pattern.columns_of(), system.pattern.row
    number = np.cumsum(moving) - 1
    balance, momentum = (own_unknown(system, group, "f")[row] for group in ("dynamics", "momentum"))
    owner = np.maximum(balance, momentum)
    take = np.flatnonzero((owner >= 0) & moving[columns])
    places = number[owner[take]], number[columns[take]]
    return np.flatnonzero(moving), places, take, momentum[take] >= 0


def _least(
    system: System, flows: np.ndarray, entries: tuple[np.ndarray, np.ndarray, Floats]
) -> tuple[str, float] | None:
    i, j, v = entries
    if flows.size > DENSE:
        diagonal = np.zeros(flows.size)
        np.add.at(diagonal, i[i == j], v[i == j])
        k = int(np.argmin(diagonal))
        return (system.name(int(flows[k])), float(diagonal[k])) if diagonal[k] < 0.0 else None
    m = np.zeros((flows.size, flows.size))
    np.add.at(m, (i, j), v)
    if not np.isfinite(m).all():
        return None
    diagonal = np.diag(m)
    if (2.0 * diagonal > np.abs(m).sum(axis=1)).all() and (m == m.T).all():
        return None  # what dominates its rows has a minimum (Gershgorin)
    # scaled to a unit diagonal, so that grams and tons are judged alike
    scale = 1.0 / np.sqrt(np.where(np.abs(np.diag(m)) > 0.0, np.abs(np.diag(m)), 1.0))
    found, vectors = np.linalg.eigh(0.5 * (m + m.T) * scale[:, None] * scale[None, :])
    if found[0] >= -NEGATIVE * max(abs(found[-1]), NEGATIVE):
        return None
    k = int(np.argmax(np.abs(vectors[:, 0])))
    along = scale * vectors[:, 0]
    along /= along[k]
    return system.name(int(flows[k])), float(along @ m @ along)
