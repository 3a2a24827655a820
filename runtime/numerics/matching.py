"""A maximum matching of rows and columns by their pattern alone (core/linear/order/matching.h)."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.patterns import Pattern


def match_rows(pattern: Pattern, given: Ints | None = None) -> Ints:
    """The row of each column [unknowns]; -1 where none is left for it, whatever the values.

    given [unknowns]: such rows, which stay but where one has to make room.
    """
    # rows that are given are begun with
    found = np.zeros(pattern.unknowns, dtype=np.int32) if given is None else given.astype(np.int32)
    looks = np.zeros(1, dtype=np.int64)
    places = lib.pointer(pattern.column), lib.pointer(pattern.row), given is not None
    # no room for the search
    if lib.core.sd_match(pattern.rows, pattern.unknowns, *places, lib.pointer(found), lib.pointer(looks)) < 0:
        raise MemoryError
    return found
