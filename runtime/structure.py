"""Structural facts at a consistent point, after the parameters are bound.

Differential index of the form as written, from the pencil dF/dyd yd' + dF/dy y at the point: rows without yd are
differentiated until dF/dyd is nonsingular (shuffle algorithm, Luenberger 1978); ranks by singular values of the
equilibrated matrices.  Larger models: the inverse of dF/dy + cj dF/dyd grows like cj^(index - 1) with cj.
Freedom: rank of [Phi_q; Psi_f], taken from the reactions of the multipliers (virtual displacements).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.description import Floats
from sysdyn.runtime.failures import RowLabel
from sysdyn.runtime.start import ConsistentState
from sysdyn.runtime.system import System

DENSE = 300
MAX_INDEX = 6
RANK = 1e-9
"""Singular values of equilibrated matrices below this part of the largest count as zero."""


@dataclass(frozen=True, slots=True)
class Structure:
    """index: of the form as written, None where the pencil is singular (undetermined: names of unknowns in its null
    vector).  coordinates n, m1, m2: coordinates and constraint rows; rank of [Phi_q; Psi_f]; dof, redundant,
    configuration_dof as the language defines them; dependent: labels of a dependent group with its coefficients.
    """

    index: int | None
    undetermined: tuple[str, ...]
    coordinates: int
    m1: int
    m2: int
    rank: int
    dof: int
    configuration_dof: int
    redundant: int
    dependent: tuple[tuple[RowLabel, float], ...]


def _equilibrate(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Rows and columns of the pair scaled so that the larger of both is near 1 everywhere (Ruiz 2001)."""
    a, b = a.copy(), b.copy()
    for _ in range(8):
        for axis in (1, 0):
            size = np.maximum(np.abs(a).max(axis=axis, initial=0.0), np.abs(b).max(axis=axis, initial=0.0))
            root = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
            scale = root[:, None] if axis == 1 else root[None, :]
            a *= scale
            b *= scale
    return a, b


def _rows_to_one(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    size = np.maximum(np.abs(a).max(axis=1, initial=0.0), np.abs(b).max(axis=1, initial=0.0))
    size = np.where(size > 0.0, size, 1.0)[:, None]
    return a / size, b / size


def pencil_index(e: Floats, b: Floats) -> int | None:
    """Index of e x' + b x = 0 [n, n]; None where the pencil is singular (or the index above MAX_INDEX)."""
    e, b = _equilibrate(e, b)
    n = e.shape[0]
    for index in range(MAX_INDEX + 1):
        u, sigma, _ = np.linalg.svd(e)
        rank = int((sigma > RANK * max(sigma.max(initial=0.0), RANK)).sum())
        if rank == n:
            return index
        top, bottom = u[:, :rank].T, u[:, rank:].T
        # the rows without derivatives are differentiated
        e = np.vstack([top @ e, bottom @ b])
        b = np.vstack([top @ b, np.zeros((n - rank, n))])
        e, b = _rows_to_one(e, b)
    return None


def null_place(system: System, jy: Floats, jyd: Floats) -> tuple[tuple[str, ...], int]:
    """Unknowns in the null vector of dF/dy + cj dF/dyd at a generic cj, () where it is regular; its row."""
    e, b = _equilibrate(system.dense(jyd), system.dense(jy))
    u, sigma, vt = np.linalg.svd(b + 0.7310585786300049 * e)
    if sigma.size == 0 or sigma[-1] > 1e-12 * sigma[0]:
        return (), -1
    null = np.abs(vt[sigma <= 1e-12 * sigma[0]]).max(axis=0)
    names = tuple(system.name(int(k)) for k in np.flatnonzero(null > 1e-6 * null.max()))
    return names, int(np.argmax(np.abs(u[:, -1])))


def _growth_index(system: System, jy: Floats, jyd: Floats) -> int | None:
    """Index from the growth of (dF/dy + cj dF/dyd)^-1 b over cj (large models)."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    pattern = system.pattern
    shape = (pattern.rows, pattern.unknowns)
    columns = pattern.columns_of()
    row, column = np.ones(pattern.rows), np.ones(pattern.unknowns)
    for _ in range(8):
        for places, scale in ((pattern.row, row), (columns, column)):
            size = np.zeros(scale.size)
            np.maximum.at(size, places, (np.abs(jy) + np.abs(jyd)) * row[pattern.row] * column[columns])
            scale *= 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    scale = row[pattern.row] * column[columns]
    b = np.random.default_rng(3).standard_normal((pattern.rows, 4))
    sizes = []
    for cj in (1e4, 1e5):
        matrix = csc_array(((jy + cj * jyd) * scale, pattern.row, pattern.column), shape=shape)
        try:
            sizes.append(float(np.abs(splu(matrix).solve(b)).max()))
        except RuntimeError:
            return None
    slope = np.log10(sizes[1] / sizes[0])
    index = round(float(slope)) + 1
    return index if 0 <= index <= MAX_INDEX else None


def _reactions(system: System, jy: Floats, kinds: tuple[str, ...]) -> tuple[NDArray[np.int64], ...]:
    """Entries (row of dynamics, column) of the multipliers of those kinds, and the columns themselves."""
    pattern = system.pattern
    columns = pattern.columns_of()
    multipliers = np.flatnonzero(np.isin(system.kinds, kinds))
    dynamics = np.zeros(system.rows, dtype=bool)
    for group, family, first in system.form.groups:
        if group == "dynamics":
            dynamics[first : first + system.description.rows[family].size] = True
    take = np.flatnonzero(np.isin(columns, multipliers) & dynamics[pattern.row] & (jy != 0.0))
    return take, columns[take], pattern.row[take].astype(np.int64), multipliers


def _rank(system: System, jy: Floats, kinds: tuple[str, ...]) -> tuple[int, Floats, NDArray[np.int64]]:
    """Rank of the constraint rows, a null vector of their transpose (empty: none, or too large), multipliers."""
    take, columns, rows, multipliers = _reactions(system, jy, kinds)
    if multipliers.size == 0:
        return 0, np.zeros(0), multipliers
    used, place = np.unique(rows, return_inverse=True)
    which = np.searchsorted(multipliers, columns)
    # each constraint and each coordinate scaled to size one
    value = jy[take]
    for _ in range(4):
        for number, index in ((multipliers.size, which), (used.size, place)):
            size = np.zeros(number)
            np.maximum.at(size, index, np.abs(value))
            value = value / np.sqrt(np.where(size > 0.0, size, 1.0))[index]
    if multipliers.size > DENSE or used.size > 4 * DENSE:
        return _sparse_rank(which, place, value, multipliers.size, used.size), np.zeros(0), multipliers
    c = np.zeros((multipliers.size, used.size))
    np.add.at(c, (which, place), value)
    u, sigma, _ = np.linalg.svd(c)
    rank = int((sigma > RANK * sigma.max(initial=0.0)).sum()) if sigma.size else 0
    null = np.zeros(0) if rank == multipliers.size else u[:, -1]
    return rank, null, multipliers


def _sparse_rank(
    which: NDArray[np.int64], place: NDArray[np.int64], value: Floats, rows: int, columns: int
) -> int:
    """Rows - (pivots of the order of eps in the factors of [I C^T; C -eps])."""
    from scipy.sparse import block_array, csc_array, eye_array
    from scipy.sparse.linalg import splu

    eps = 1e-13
    c = csc_array((value, (which, place)), shape=(rows, columns))
    matrix = block_array([[eye_array(columns), c.T], [c, -eps * eye_array(rows)]], format="csc")
    lu = splu(matrix, permc_spec="COLAMD")
    return rows - int((np.abs(lu.U.diagonal()) < 1e3 * eps).sum())


def _label(system: System, multiplier: int) -> RowLabel:
    """Label of the constraint of a multiplier."""
    family = system.description.families[int(system.family_of[multiplier])]
    position = multiplier - int(system.form.at[system.family_of[multiplier]])
    block = "phi" if family.kind == "kappa" else "psi"
    for k in system.description.rows_of(block):
        row = system.description.rows[k]
        if family.owner in (row.owner, row.label):
            return row.at(position)
    return RowLabel(family.owner, block)


def index_of(system: System, state: ConsistentState) -> tuple[int | None, tuple[str, ...]]:
    """Index of the form as written, and the undetermined unknowns where there is none."""
    jy, jyd = system.jacobian(state.t, *state.for_form(system))
    if system.unknowns == 0:
        return 0, ()
    if system.unknowns > DENSE:
        return _growth_index(system, jy, jyd), ()
    names = null_place(system, jy, jyd)[0]
    if names:
        return None, names
    return pencil_index(system.dense(jyd), system.dense(jy)), ()


def structure(system: System, state: ConsistentState) -> Structure:
    """Facts of a model at a consistent state; system: any form."""
    system = system if system.form.name == "3" else system.another("3")
    jy, _ = system.jacobian(state.t, *state.for_form(system))
    index, undetermined = index_of(system, state)
    rank, null, multipliers = _rank(system, jy, ("kappa", "mu"))
    rank_q = _rank(system, jy, ("kappa",))[0]
    n = int((system.kinds == "f").sum())
    m1, m2 = (int((system.kinds == kind).sum()) for kind in ("kappa", "mu"))
    dependent: list[tuple[RowLabel, float]] = []
    if null.size:
        null = null / null[np.argmax(np.abs(null))]
        dependent = [
            (_label(system, int(multipliers[k])), float(null[k])) for k in np.flatnonzero(np.abs(null) > 1e-8)
        ]
    return Structure(
        index, undetermined, n, m1, m2, rank, n - rank, n - rank_q, m1 + m2 - rank, tuple(dependent)
    )
