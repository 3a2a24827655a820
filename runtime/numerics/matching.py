"""A maximum matching of rows and columns by their pattern alone (core/linear/order.h)."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.patterns import Pattern


def matched(pattern: Pattern) -> Ints:
    """The row of each column [unknowns]; -1 where none is left for it, whatever the values."""
    found, looks = np.zeros(pattern.unknowns, dtype=np.int32), np.zeros(1, dtype=np.int64)
    places = (lib.pointer(array) for array in (pattern.column, pattern.row, found, looks))
    if lib.core.sd_match(pattern.rows, pattern.unknowns, *places) < 0:
        raise MemoryError
    return found
