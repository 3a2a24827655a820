"""Which of dependent constraints are left out: those whose coefficients in what depends are the largest.

Rows of J (scaled to one) combine to zero by the columns of N [members, k]: J^T N = 0.  With k of them left out the
others determine the motion and their multipliers where the rows of N of those left out are regular, and lose nothing
where no coefficient of the others is much larger: those are the first pivots of N^T (QR with column pivoting, Businger
and Golub 1965).  As the motion goes on N turns: of three parallel cranks any fixed choice loses rank twice a turn.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.switches import Switches
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.runtime.numerics.rank import decomposed
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.redundancy import nearby

MOST = 300
"""Constraints up to which the choice follows the motion."""
SOME = 1e-8
"""Of a unit vector: a constraint's share of what depends."""
APART = 1e-3
"""Singular values of what depends, as part of those of what does not: near where more depends nothing is told."""
TURNED = 2.0
"""A coefficient of one that holds, of those left out, from which these are chosen anew."""


class Dependence:
    """J of all constraints of a system, whether they hold or not."""

    def __init__(self, system: System) -> None:
        pattern, columns = system.pattern, system.pattern.columns_of()
        self.system, self.multipliers = system, np.flatnonzero(system.are("kappa", "mu"))
        reacting = np.isin(columns, self.multipliers) & system.of_groups("dynamics")[pattern.row]
        self._entry = np.flatnonzero(reacting)
        self._which = np.searchsorted(self.multipliers, columns[self._entry]).astype(np.int32)
        rows, row = np.unique(pattern.row[self._entry], return_inverse=True)
        self._row, self._shape = row.astype(np.int32), (self.multipliers.size, rows.size)

    def null(self, t: float, y: Floats, yd: Floats, number: int) -> Floats | None:
        """N [multipliers, number], orthonormal, near a consistent point [unknowns]; None where more depends."""
        value = self.system.jacobian(t, y, yd)[0][self._entry]
        scale, other = sparse_factors(self._which, self._row, np.abs(value), self._shape)
        matrix = np.zeros(self._shape)
        np.add.at(matrix, (self._which, self._row), scale[self._which] * value * other[self._row])
        if not np.isfinite(matrix).all():
            return None
        left, sigma, _ = decomposed(matrix)
        rank = len(matrix) - number
        sigma = np.append(sigma, np.zeros(len(matrix)))
        return left[:, rank:] if rank == 0 or sigma[rank] <= APART * sigma[rank - 1] else None


def chosen(null: Floats) -> Ints:
    """The constraints (rows of N) that are left out."""
    from scipy.linalg import qr

    return np.sort(qr(null.T, mode="r", pivoting=True)[1][: null.shape[1]])


def weight(null: Floats, left: NDArray[np.integer]) -> float:
    """The largest coefficient of a constraint that holds, of those left out: 1 of the best choice."""
    return float(np.abs(np.linalg.lstsq(null[left].T, null.T, rcond=None)[0]).max())


def following(system: System, state: ConsistentState, number: int) -> System | None:
    """The system as written without `number` of its dependent constraints, which can be chosen anew (as `Switches`);
    None where one choice serves for good, they are too many to be followed, or it does not tell how they depend.
    """
    dependence = Dependence(system)
    if not number or dependence.multipliers.size > MOST or system.description.switches.places:
        return None
    y, yd = state.for_form(system)
    start, *beside = (dependence.null(state.t, point, yd, number) for point in (y, *nearby(system, state)))
    if start is None:
        return None
    known = [start, *(null for null in beside if null is not None)]
    if all(np.abs(null @ null.T - start @ start.T).max() < SOME for null in known):
        return None
    members = np.abs(np.hstack(known)).max(axis=1) > SOME
    at = dependence.multipliers[members]
    families = system.family_of[at]
    places = tuple((int(k), int(place - system.form.at[k])) for k, place in zip(families, at, strict=True))
    fresh: dict[str, Any] = {"layouts": {}, "alive": WeakValueDictionary(), "room": [], "systems": None}
    description = replace(system.description, switches=Switches(places, redundant=True), **fresh)
    description.switches.set(~np.isin(np.flatnonzero(members), chosen(start)))
    return System.of(description, system.carrier, system.form.name)
