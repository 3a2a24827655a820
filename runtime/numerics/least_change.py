"""Linear equations with more unknowns than rows: the solution of least norm, or least in an order of unknowns.

By singular values (dense), by factors of the rows themselves where these determine every unknown (tall.py), or by the
saddle-point system [I A^T; A -eps] (sparse).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.equilibrate import factors, sparse_factors
from sysdyn.runtime.numerics.products import add_product, largest_product
from sysdyn.runtime.numerics.rank import NotFiniteError, count, least_by, least_squares, singular_decomposition
from sysdyn.runtime.numerics.symmetric import Symmetric
from sysdyn.runtime.numerics.tall import by_columns, solve_columns

Mask = NDArray[np.bool_]
SINGULAR_VALUES = 120
"""Unknowns up to which singular values are used."""
DENSE = 400
"""Unknowns up to which matrices are full (no SciPy)."""
RANK = tuning.DEPENDENT
"""Singular values below this part of the largest belong to redundant rows."""
EPS = tuning.BY_FACTORS
"""Of redundant rows in the saddle-point system, relative to rows of size one: above the round-off of its pivots."""
NORM = RANK**2 / EPS
"""Weight of the norm there for rows that leave little.  Singular values below the root of NORM EPS pass for redundant,
as below RANK, and the system is as well conditioned as the rows, not as their squares (Bjorck, BIT 7, 1967); of the
least norm it knows seven digits."""
MET = tuning.MET
"""Of the aim: what a solution of the linearised rows may miss before another way is tried."""
FAR = 0.1
"""Part of what the first way misses from which another is taken though it does not meet the rows either."""
EMPTY = 1e-160
"""Coefficients whose squares underflow say nothing: a row of them is empty (slopes of diodes far from conduction)."""
NOTHING = 2.0**-52
"""Of the largest coefficient of a row, equilibrated: less is round-off, no row of its own beside what levels hold."""
_PROXIMAL = 6


def least_norm(
    shape: tuple[int, int],
    entries: tuple[Any, Any, Floats],
    aim: Floats,
    *,
    spent: bool = False,
    idle: Mask | None = None,
    again: bool = False,
) -> Floats:
    """The u of least norm with A u = aim; A [rows, unknowns] by its entries (row, column, value).  spent: nobody else
    needs values and aim, which are overwritten; of a large matrix the room counts, and the caller holds no entries
    either.  idle: unknowns of which nobody asks for the least where rows leave them open.  again: the same small matrix
    is asked about many times.
    """
    i, j, v = entries
    del entries
    # no numbers: no solution
    if not (np.isfinite(v).all() and np.isfinite(aim).all()):
        raise NotFiniteError
    v = v if spent else v.copy()
    # rows of size one, so that none passes for redundant by its unit
    back = _to_size_one(i, v, shape[0])
    aim = np.divide(aim, back, out=aim if spent else None)
    small = MET * largest_product(aim, back)
    # a large matrix by columns, where its rows determine all unknowns
    columns = None if max(shape) <= SINGULAR_VALUES else by_columns(shape, (i, j, v), fewer=idle is not None)
    if columns is not None:
        matrix = columns
        del i, j, v
        # rows that determine the solution: no least one to look for
        only = solve_columns(matrix, aim, lambda u: largest_product(matrix.residual(u, aim), back) <= small, idle)
        if only is not None:
            return only
        i, j, v = columns.entries()
    # ways in order of cost, until one meets the rows
    tried: list[tuple[float, Floats]] = []
    for way in (_AGAIN if again else _DENSE) if max(shape) <= SINGULAR_VALUES else _SPARSE:
        found = way(shape, (i, j, v), aim)
        missed = largest_product(add_product(i, j, v, found, -aim), back)
        if not missed > small:
            return found
        tried.append((missed, found))
    # none does: the least miss, if it is clearly less than that of the first way
    least = min(tried, key=lambda item: item[0])
    return least[1] if least[0] < FAR * tried[0][0] else tried[0][1]


def least_measured(entries: tuple[Any, Any, Floats], aim: Floats, scale: Floats) -> Floats:
    """The least x [columns], each in its scale, that meets `aim` [rows] by entries (row, column, value); what has none
    is zero.  A scale that is no number: in what one unit of it does at most.
    """
    take, x = entries[2] != 0.0, np.zeros(scale.size)
    if not take.any():
        return x
    (rows, i), (columns, j) = (np.unique(item[take], return_inverse=True) for item in entries[:2])
    v, most = entries[2][take], np.zeros(columns.size)
    np.maximum.at(most, j, np.abs(v))
    # without a scale: one unit of effect
    unit = np.where(np.isnan(scale[columns]), 1.0 / most, scale[columns])
    x[columns] = unit * least_norm((rows.size, columns.size), (i, j, v * unit[j]), aim[rows], again=True)
    return x


def _to_size_one(i: Any, v: Floats, rows: int) -> Floats:
    """Divides entries v in rows i by the sizes [rows] of these: a row of small coefficients is no redundant one."""
    size, row = np.empty(rows), np.ascontiguousarray(i, dtype=np.int32)
    if lib.core.sd_to_size_one(rows, v.size, lib.pointer(row), EMPTY, lib.pointer(v), lib.pointer(size)):
        raise MemoryError
    return size


def in_order(shape: tuple[int, int], entries: tuple[Any, Any, Floats], aim: Floats, levels: Sequence[Mask]) -> Floats:
    """The u with A u = aim of least norm within the first level, then within the next, each with what stands before it
    held, at last of the others; A [rows, unknowns] by its entries, a full matrix.
    """
    i, j, v = entries
    a = _full(shape, i, j, v)
    # as in `least_norm`
    if not (np.isfinite(a).all() and np.isfinite(aim).all()):
        raise NotFiniteError
    # equilibrated; each level takes what it can, the next ones the rest
    row, column = factors(a)
    a, aim, found = row[:, None] * a, row * aim, np.zeros(shape[1])
    later = np.ones(shape[1], dtype=bool)
    for level in filter(np.any, levels):
        # directions of the rows that no later level can meet
        later = later & ~level
        left, sigma, _ = singular_decomposition(a[:, later] * column[later])
        only = left[:, count(sigma) :].T  # what rows say of the level whatever comes later
        # what is round-off of these directions says nothing
        said, largest = only @ a[:, level], np.abs(a[:, level]).max(axis=0, initial=0.0)
        noise = NOTHING / min(sigma[: count(sigma)], default=1.0)  # of `only`, by the least that counts
        said[np.abs(said) <= noise * largest] = 0.0
        left, sigma, right = singular_decomposition(said)
        k = int((sigma > RANK * largest.max(initial=0.0)).sum())  # nothing may be left of a level
        found[level] = right[:k].T @ ((left[:, :k].T @ (only @ aim)) / sigma[:k])
        aim = aim - a[:, level] @ found[level]
    # at last all others, by entries that count
    size = np.abs(a * column)
    i, j = np.nonzero((size > NOTHING * size.max(axis=1, keepdims=True, initial=0.0))[:, later])
    found[later] = least_norm((shape[0], int(later.sum())), (i, j, a[:, later][i, j]), aim)
    return found


_Way = Callable[[tuple[int, int], tuple[Any, Any, Floats], Floats], Floats]
"""From a shape, the entries of rows of size one and their aim: the u of least norm."""


def _full(shape: tuple[int, int], i: Any, j: Any, v: Floats) -> Floats:
    """The full matrix of entries v at rows i and columns j."""
    a = np.zeros(shape)
    np.add.at(a, (i, j), v)
    return a


def _singular_values(shape: tuple[int, int], entries: tuple[Any, Any, Floats], aim: Floats) -> Floats:
    return least_squares(_full(shape, *entries), aim, RANK)


def _of_known(shape: tuple[int, int], entries: tuple[Any, Any, Floats], aim: Floats) -> Floats:
    """The u of least norm by the decomposition that is remembered, and once more for what that misses."""
    a = _full(shape, *entries)
    parts = singular_decomposition(a)
    found = least_by(parts, aim, RANK)
    return found + least_by(parts, aim - a @ found, RANK)


def _of_one_size(shape: tuple[int, int], entries: tuple[Any, Any, Floats], aim: Floats) -> Floats:
    """The u of least norm where columns of one size say which rows are redundant: a change that the metric takes for
    nothing may be the only one that meets a row.
    """
    i, j, v = entries
    # columns of one size decide ranks
    size = sparse_factors(i, j, np.abs(v), shape)[1]
    parts = singular_decomposition(_full(shape, i, j, v * size[j]))
    found, free = least_by(parts, aim, RANK), parts[2][count(parts[1], RANK) :].T
    return np.asarray(size * (found - free @ least_squares(size[:, None] * free, size * found, RANK)))


def _to_the_rank(shape: tuple[int, int], entries: tuple[Any, Any, Floats], aim: Floats) -> Floats:
    """The saddle point whose rows hold as far as RANK says, its norm the least to some digits only."""
    return _saddle_point(shape, entries, aim, NORM)


def _saddle_point(shape: tuple[int, int], entries: tuple[Any, Any, Floats], aim: Floats, weight: float = 1.0) -> Floats:
    """The u of least norm with A u = aim from [weight I, A^T; A, -eps]."""
    rows, unknowns = shape
    i, j, v = entries
    # unknowns, then multipliers
    here = np.arange(unknowns), unknowns + np.arange(rows)
    places = (
        np.concatenate([here[0], j, unknowns + i, here[1]]),
        np.concatenate([here[0], unknowns + i, j, here[1]]),
    )
    # weight on the diagonal, A and its transpose, a faint -eps
    values = np.concatenate([np.full(unknowns, weight), v, v, np.full(rows, -EPS)])
    matrix = Symmetric(unknowns + rows, places, values, definite=True)
    found = np.zeros(unknowns + rows)
    # each pass takes off what eps left behind
    for _ in range(_PROXIMAL):
        # eps acts on the change of the multipliers only, so that it leaves no trace in the solution
        right = np.concatenate([np.zeros(unknowns), aim - EPS * found[unknowns:]])
        found = found + matrix.solve(right - matrix.times(found))
    return found[:unknowns]


_DENSE: tuple[_Way, ...] = (_singular_values, _of_one_size)
_AGAIN: tuple[_Way, ...] = (_of_known, _of_one_size)
_SPARSE: tuple[_Way, ...] = (_saddle_point, _to_the_rank)
"""What is tried until the rows hold."""
