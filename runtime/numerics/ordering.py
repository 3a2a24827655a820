"""Column orders for the sparse factorisation, from a library (SciPy's SuperLU), imported only when needed."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.patterns import Pattern

DENSE = 50
"""Largest dense matrix (SD_DENSE of core/linear.h)."""


def column_order(pattern: Pattern, values: Floats) -> Ints | None:
    """Elimination order [unknowns] of a square matrix, None where it is small enough for the dense LU.

    values [entries] of a typical matrix.  Where they are singular, seeded random values on the same pattern serve:
    the order depends on the pattern.
    """
    if pattern.unknowns <= DENSE:
        return None
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    random = np.random.default_rng(0).uniform(0.5, 1.5, size=pattern.entries)
    shape = (pattern.rows, pattern.unknowns)
    for attempt in (values, random):
        if not np.isfinite(attempt).all():
            continue
        matrix = csc_array((attempt, pattern.row, pattern.column), shape=shape)
        try:
            found = splu(matrix, permc_spec="COLAMD", diag_pivot_thresh=0.1)
        except RuntimeError:
            continue
        return np.argsort(found.perm_c).astype(np.int32)
    return np.arange(pattern.unknowns, dtype=np.int32)
