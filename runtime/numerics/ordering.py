"""Column orders for the sparse factorisation: our own for small matrices, for others that of SciPy's SuperLU.

Small matrices get the least degree of A^T A with rows merged as they are eliminated (George & Ng, SIAM J. Sci. Stat.
Comput. 8, 1987): what partial pivoting may fill is known from the pattern.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.patterns import Pattern

DENSE = 16
"""Largest dense matrix: above, the matrices of models are so sparse that the sparse LU is the cheaper one (measured on
twelve models of 8 to 150 unknowns: steps of radau by up to 46 %, of the bdf by up to 23 %); below, little is
gained, and full pivoting is the safer one near singular positions."""
LEAVING = 50
"""The same of matrices whose columns may be left without a pivot, which the dense LU alone does."""
COLUMNS: Mapping[str, Any] = {"permc_spec": "COLAMD"}
SMALL = 200
"""Unknowns up to which the order is our own."""


def column_order(pattern: Pattern, values: Floats, *, leaving: bool = False) -> Ints | None:
    """Elimination order [unknowns] of a square matrix, None where it is small enough for the dense LU.

    leaving: columns may be left without a pivot; values [entries] of a typical matrix.  Where they are singular, seeded
    random values on the same pattern serve: the order depends on the pattern.
    """
    if pattern.unknowns <= (LEAVING if leaving else DENSE):
        return None
    return least_degree(pattern) if pattern.unknowns <= SMALL else _library(pattern, values)


def paired_order(pattern: Pattern, values: Floats) -> Ints | None:
    """The same where row k belongs to unknown k and pivots there: least degree of A + A^T (a grid of 100 x 100 fills
    371000 places by it, 646000 by the order for any pivots).
    """
    if pattern.unknowns <= SMALL:
        return column_order(pattern, values)
    return _library(pattern, values, {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}})


def least_degree(pattern: Pattern) -> Ints:
    """The columns [unknowns], each that whose elimination can fill least; sets of columns are bits of integers."""
    n, columns = pattern.unknowns, pattern.columns_of()
    rows: dict[int, int] = {}
    holding: list[set[int]] = [set() for _ in range(n)]
    for row, column in zip(pattern.row.tolist(), columns.tolist(), strict=True):
        rows[row] = rows.get(row, 0) | 1 << column
        holding[column].add(row)

    def degree(c: int) -> int:
        reached = 0
        for row in holding[c]:
            reached |= rows[row]
        return reached.bit_count()

    degrees = {c: degree(c) for c in range(n)}
    found = []
    while degrees:
        best = min(degrees, key=lambda c: (degrees[c], c))
        del degrees[best]
        found.append(best)
        merged, kept = 0, min(holding[best], default=-1)
        for row in holding[best]:
            merged |= rows.pop(row)
        merged &= ~(1 << best)
        if kept < 0 or not merged:
            continue
        rows[kept] = merged
        gone, touched = holding[best] - {kept}, [c for c in degrees if merged >> c & 1]
        for c in touched:
            holding[c] -= gone
            holding[c].add(kept)
        for c in touched:
            degrees[c] = degree(c)
    return np.array(found, dtype=np.int32)


def _library(pattern: Pattern, values: Floats, how: Mapping[str, Any] = COLUMNS) -> Ints:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    random = np.random.default_rng(0).uniform(0.5, 1.5, size=pattern.entries)
    shape = (pattern.rows, pattern.unknowns)
    for attempt in (values, random):
        if not np.isfinite(attempt).all():
            continue
        matrix = csc_array((attempt, pattern.row, pattern.column), shape=shape)
        try:
            found = splu(matrix, diag_pivot_thresh=0.1, **how)
        except RuntimeError:
            continue
        return np.argsort(found.perm_c).astype(np.int32)
    return np.arange(pattern.unknowns, dtype=np.int32)
