"""The structures of core/start/*.h."""

from __future__ import annotations

import ctypes as c

from sysdyn.runtime.model.structures.c_types import D, I, P


class Balance(c.Structure):
    """sd_balance."""

    _fields_ = [
        ("unknowns", I),
        ("rows", I),
        ("entries", I),
        ("kinds", I),
        ("row", P),
        ("column", P),
        ("kind", P),
    ]


class Sizing(c.Structure):
    """sd_sizing."""

    _fields_ = [
        *[(name, P) for name in ["balance", "nominal", "kind", "partner"]],
        ("own", P * 4),
        ("owns", I * 4),
        ("efforts", I),
        *[(name, P) for name in ["effort", "moved"]],
        ("parts", I),
        ("rungs", I),
        *[(name, P) for name in ["part", "rung"]],
    ]


class RowsOfStart(c.Structure):
    """sd_rows_of_start."""

    _fields_ = [
        ("system", P),
        ("balance", Balance),
        ("written", I),
        ("rates", I),
        ("plain", I),
        ("rated", I),
        ("k_spans", I),
        ("rate", P),
        ("entry", P),
        ("k_span", P),
        ("extended", I),
        ("both", P),
    ]


class Search(c.Structure):
    """sd_search."""

    _fields_ = [
        ("start", P),
        ("use", P),
        ("free", P),
        ("guess", P),
        ("scale", P),
        ("weight", P),
        ("t", D),
        ("most", I),
        ("share", D),
        ("spent", D),
        ("largest", D),
        ("x", P),
        ("scaled", P),
        ("residual", D),
    ]
