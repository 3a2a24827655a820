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
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.switches import Switches
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.rank import singular_decomposition
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.redundancy import nearby, reactions

MOST = tuning.DENSE
"""Constraints up to which the choice follows the motion."""
SOME = tuning.HALF_OF_ITS_DIGITS
"""Of a unit vector: a constraint's share of what depends."""
APART = tuning.SMALL
"""Singular values of what depends, as part of those of what does not: near where more depends nothing is told."""
TURNED = 2.0
"""A coefficient of one that holds, of those left out, from which these are chosen anew."""


def null_space(system: System, t: float, y: Floats, yd: Floats, number: int) -> Floats | None:
    """N [multipliers, number] of all constraints, whether they hold or not, orthonormal, near a consistent point
    [unknowns]; None where more depends.
    """
    # reactions of all constraints: rows that depend have a left null space
    found = reactions(system, system.jacobian(t, y, yd)[0], every=True)
    rows, row = np.unique(found.row, return_inverse=True)
    matrix = np.zeros((found.multipliers.size, rows.size))
    np.add.at(matrix, (found.which, row), found.value)
    # no numbers beside the point
    if not np.isfinite(matrix).all():
        return None
    left, sigma, _ = singular_decomposition(matrix)
    rank = len(matrix) - number
    # a clear gap behind the rank, or the number is another
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
    # nothing depends, too many to follow, or constraints that hold at times
    multipliers = np.flatnonzero(system.are("kappa", "mu"))
    if not number or multipliers.size > MOST or system.description.switches.places:
        return None
    # the null space here and beside the state
    y, yd = state.for_form(system)
    start, *beside = (null_space(system, state.t, point, yd, number) for point in (y, *nearby(system, state)))
    if start is None:
        return None
    # the same everywhere: one choice serves
    known = [start, *(null for null in beside if null is not None)]
    if all(np.abs(null @ null.T - start @ start.T).max() < SOME for null in known):
        return None
    # multipliers that take part in any dependence
    members = np.abs(np.hstack(known)).max(axis=1) > SOME
    at = multipliers[members]
    families = system.family_of[at]
    places = tuple((int(k), int(place - system.form.at[k])) for k, place in zip(families, at, strict=True))
    # a description of its own: these constraints become switches
    fresh: dict[str, Any] = {"layouts": {}, "alive": WeakValueDictionary(), "room": [], "systems": None}
    description = replace(system.description, switches=Switches(places, redundant=True), **fresh)
    description.switches.set(~np.isin(np.flatnonzero(members), chosen(start)))
    return System.from_description(description, system.carrier, system.form.name)
