"""A large sparse matrix whose pattern is symmetric, factorised by the core (core/linear/sparse/sparse.h).

Columns are eliminated in an order of least fill of A + A^T, and each row pivots in its own column wherever its entry
will do: of 4650 masses joined at random the factors take a third of the time of an order for any pivots.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.patterns import Places, compress
from sysdyn.runtime.numerics.ordering import symmetric_order
from sysdyn.runtime.numerics.rank import NotFiniteError

SINGULAR = 1
"""What the core answers where there is no pivot."""


class Symmetric:
    """number: of rows; places: rows and columns of values, which add up where they meet; definite: [H, A^T; A, -K] of
    positive definite H and K, which has factors on its diagonal in any order: `solve` then wants to be refined.

    NotFiniteError where values are no numbers or leave no pivot.
    """

    def __init__(
        self, number: int, places: tuple[NDArray[Any], NDArray[Any]], values: Floats, *, definite: bool = False
    ) -> None:
        rows, columns = (item.astype(np.int32) for item in places)
        # entries of one place are added up
        self._pattern, (slot,) = compress(number, number, [Places(rows, columns)])
        self._values = np.bincount(slot, weights=values, minlength=self._pattern.entries).astype(np.float64)
        if not np.isfinite(self._values).all():
            raise NotFiniteError
        self._columns = self._pattern.columns_of()
        self._order = symmetric_order(self._pattern, faint=definite)
        self._linear = self._order.linear(self._pattern)
        failed = lib.core.sd_linear_factor(self._linear, lib.pointer(self._values), None)
        if failed:
            raise NotFiniteError if failed == SINGULAR else MemoryError

    def times(self, x: Floats) -> Floats:
        """The product with x [number]."""
        terms = self._values * x[self._columns]
        return np.bincount(self._pattern.row, weights=terms, minlength=x.size).astype(np.float64)

    def solve(self, b: Floats) -> Floats:
        """The x [number] whose product is b."""
        x = b.astype(np.float64)
        lib.core.sd_linear_solve(self._linear, lib.pointer(x))
        return x

    def __del__(self) -> None:
        if getattr(self, "_linear", None):
            lib.core.sd_linear_free(self._linear)
