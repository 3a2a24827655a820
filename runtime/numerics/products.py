"""A matrix by its entries times a vector, in the order of the entries, without arrays as long as these."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats


def add_product(rows: Any, columns: Any, values: Floats, x: Floats, out: Floats) -> Floats:
    """Out [rows] += A x, which is handed back; values of A at (rows, columns) [entries]; x [columns]."""
    arrays: list[NDArray[Any]] = [np.ascontiguousarray(item, dtype=np.int32) for item in (rows, columns)]
    arrays += [*(np.ascontiguousarray(item, dtype=np.float64) for item in (values, x)), out]
    lib.core.sd_add_product(values.size, *(lib.pointer(item) for item in arrays))
    return out
