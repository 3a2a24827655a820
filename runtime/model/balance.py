"""Rows of a matrix by its entries, of which unknown magnitudes are balanced (core/start/magnitudes.h)."""

from __future__ import annotations

import ctypes as c

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats

LARGEST: int = _core.SD_LARGEST
CAPPED: int = _core.SD_CAPPED
"""How proposals of a row are taken (core/start/magnitudes.h)."""


class RowBalance:
    """rows, columns [entries] of a matrix [rows, unknowns]; kind [unknowns]: number of the kind and unit of each.

    Depends on the structure alone and changes never: several threads may read it.
    """

    def __init__(
        self, number: int, rows: NDArray[np.integer], columns: NDArray[np.integer], kind: NDArray[np.integer]
    ) -> None:
        # the core reads int32
        places = tuple(np.ascontiguousarray(item, dtype=np.int32) for item in (rows, columns, kind))
        self._arrays = places
        kinds = 1 + int(kind.max(initial=0))
        addresses = [lib.pointer(item) for item in self._arrays]
        self.core = lib.Balance(kind.size, number, rows.size, kinds, *addresses)
        self.address = c.addressof(self.core)

    def propagate(
        self, magnitude: Floats, size: Floats, excited: Floats, *, largest: bool = False, capped: bool = False
    ) -> Floats:
        """Zeros of `magnitude` [unknowns] filled so that their terms balance the others of their rows.

        size [entries]: |coefficient| of each place; excited [rows]: magnitude of the rows' free terms.
        A coefficient that is small beside those of its like proposes much: it is asked only where no other is left.
        Of several rows' proposals the least counts, or the largest; capped: none above the largest of its like that is
        known, for along a chain each overestimates the next, and a run mends what is too small alone.
        """
        # sizes and free terms; no mask
        found = magnitude.copy()
        flags = LARGEST * largest + CAPPED * capped
        given = lib.pointer(size), lib.pointer(excited), None
        # no room for the search
        if lib.core.sd_propagate(self.address, *given, flags, lib.pointer(found)):
            raise MemoryError
        return found
