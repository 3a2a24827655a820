"""The structures of core/linear/*.h."""

from __future__ import annotations

import ctypes as c

from sysdyn.runtime.model.structures.c_types import D, I, L, P


class Order(c.Structure):
    """sd_order."""

    _fields_ = [*[(name, P) for name in ["columns", "own", "otherwise", "position"]], ("most", L), ("paired", I)]


class Linear(c.Structure):
    """sd_linear."""

    _fields_ = [
        ("n", I),
        ("entries", I),
        ("column", P),
        ("row", P),
        ("row_scale", P),
        ("column_scale", P),
        ("scaled", P),
        ("dense", P),
        ("pivot", P),
        ("sparse", P),
        ("work", P),
        ("work2", P),
        ("smallest", D),
        ("bad_row", I),
        ("bad_column", I),
        ("factorisations", L),
        ("pivotings", L),
        ("null_pivot", D),
        ("idle", P),
        ("place", P),
        ("rank", I),
        ("left_over", D),
        ("null", P),
        ("null_room", c.c_size_t),
        ("nulls", I),
        ("pivoted", I),
        ("replayed", I),
        ("elimination", P),
        ("otherwise", P),
        ("sum", P),
        ("lent", P),
        ("own_scale", I),
        ("own_rows", I),
        ("little", P),
    ]
