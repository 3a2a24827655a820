"""A matrix by its entries times a vector, in the order of the entries, without arrays as long as these."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints

PIECE = 1 << 14
"""Numbers of which products are made at a time."""


def add_product(rows: Any, columns: Any, values: Floats, x: Floats, out: Floats) -> Floats:
    """Out [rows] += A x, which is handed back; values of A at (rows, columns) [entries]; x [columns]."""
    return _add_products(lib.core.sd_add_product, rows, columns, values, x, out)


def add_sizes(rows: Any, columns: Any, values: Floats, x: Floats, out: Floats) -> Floats:
    """Out [rows] += |A| x, the same way."""
    return _add_products(lib.core.sd_add_sizes, rows, columns, values, x, out)


def _add_products(function: Any, rows: Any, columns: Any, values: Floats, x: Floats, out: Floats) -> Floats:
    arrays: list[NDArray[Any]] = [np.ascontiguousarray(item, dtype=np.int32) for item in (rows, columns)]
    arrays += [*(np.ascontiguousarray(item, dtype=np.float64) for item in (values, x)), out]
    function(values.size, *(lib.pointer(item) for item in arrays))
    return out


def largest_product(x: Floats, y: Floats) -> float:
    """The largest |x y|, piece by piece; no number where one is none."""
    found = (np.abs(x[here] * y[here]).max() for here in pieces(x.size))
    return float(np.max(np.fromiter(found, dtype=np.float64), initial=0.0))


def norm_of(x: Floats) -> float:
    """The 2-norm, by one thread: those of BLAS wait for each other longer than a vector of some thousands takes."""
    return float(np.sqrt(np.einsum("i,i->", x, x)))


def pieces(size: int) -> Iterator[slice]:
    """Of an array of a large model, worked through without a second one as long."""
    return (slice(k, k + PIECE) for k in range(0, size, PIECE))


def linked_places(chosen: NDArray[np.bool_], of: Ints, at: Ints, size: int) -> NDArray[np.bool_]:
    """Places [size] among `at` [entries] of those entries whose places `of` [entries] are chosen."""
    found = np.zeros(size, dtype=bool)
    # piece by piece: no array as long as the entries
    for k in range(0, of.size, PIECE):
        found[at[k : k + PIECE][chosen[of[k : k + PIECE]]]] = True
    return found
