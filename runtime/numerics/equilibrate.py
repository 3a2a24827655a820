"""Rows and columns of a matrix scaled until the largest entry of each is near one (Ruiz 2001).

Each sweep divides rows and columns by the square root of their largest entry; the condition number of the result does
not depend on the units of the unknowns and of the rows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats

SMALL = tuning.IN_THE_CORE
"""Rows and columns up to which the core does it (core/linear/dense/dense.h): calls cost more than arithmetic."""
SWEEPS = 8
"""The distance to one is halved in its logarithm by each: 1e200 becomes 6."""


def equilibrate(*matrices: Floats) -> tuple[Floats, ...]:
    """Matrices [m, n] scaled by the same factors, so that the largest entry of all of them is near 1 in each line."""
    row, column = factors(*matrices)
    return tuple(row[:, None] * matrix * column[None, :] for matrix in matrices)


def factors(*matrices: Floats) -> tuple[Floats, Floats]:
    """The factors of the rows [m] and of the columns [n]; 1 where a line is empty."""
    shape = matrices[0].shape
    row, column = np.ones(shape[0]), np.ones(shape[1])
    # small matrices in the core, by the same sweeps
    if max(shape) <= SMALL and len(matrices) <= 2:
        kept = [np.ascontiguousarray(matrix, dtype=np.float64) for matrix in matrices]
        pair = (*map(lib.pointer, kept), None)[:2]
        lib.core.sd_factors(*shape, *pair, lib.pointer(row), lib.pointer(column))
        return row, column
    # of several matrices the largest magnitude of each place
    size = np.max([np.abs(matrix) for matrix in matrices], axis=0)
    for _ in range(SWEEPS):
        by_row = _root(size.max(axis=1, initial=0.0))
        size = size * by_row[:, None]
        by_column = _root(size.max(axis=0, initial=0.0))
        size = size * by_column[None, :]
        row, column = row * by_row, column * by_column
    return row, column


def sparse_factors(
    rows: NDArray[np.integer], columns: NDArray[np.integer], size: Floats, shape: tuple[int, int]
) -> tuple[Floats, Floats]:
    """The factors of the rows and of the columns of a matrix by its entries: magnitudes `size` at (rows, columns)."""
    row, column = np.ones(shape[0]), np.ones(shape[1])
    places = (np.ascontiguousarray(rows, dtype=np.int32), np.ascontiguousarray(columns, dtype=np.int32))
    arrays = (lib.pointer(item) for item in (*places, size, row, column))
    lib.core.sd_sparse_factors(*shape, size.size, *arrays)
    return row, column


def _root(size: Floats) -> Floats:
    return 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
