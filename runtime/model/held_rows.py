"""Rows of left-out constraints: in each index form, which rows read "multiplier = 0" in the place of their equation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Description
from sysdyn.runtime.model.forms import Form

LeftOut = tuple[tuple[int, int], ...]
"""(family, position) of multipliers."""
Longs = NDArray[np.int64]

_ROWS = {
    "3": {"kappa": "phi", "mu": "psi"},
    "2": {"kappa": "phi_rate", "nu": "phi", "mu": "psi"},
    "2v": {"kappa": "phi_rate", "mu": "psi"},
    "1": {"kappa": "phi_acceleration", "mu": "psi_rate"},
    "0": {"kappa": "phi_acceleration", "mu": "psi_rate"},
    "constraints": {},
    "settled": {"kappa": "phi_acceleration", "mu": "psi_rate"},
    "start": {"kappa": "phi_acceleration", "mu": "psi_rate"},
}
"""Form -> multiplier -> group of rows whose row it is.  Where rows and their derivatives all stand, the derivative that
determines the multiplier goes; the others hold with those that they depend on."""


def held_rows(description: Description, form: Form, left_out: LeftOut) -> tuple[Longs, Longs]:
    """Rows, and the unknowns that vanish there."""
    first = {(group, family): row for group, family, row in form.groups}
    rows: list[int] = []
    unknowns: list[int] = []
    for family, position in left_out:
        item = description.families[family]
        block = "phi" if item.kind == "kappa" else "psi"
        rows_of = ((k, description.rows[k]) for k in description.rows_of(block))
        row = next(k for k, found in rows_of if item.owner in (found.owner, found.label))
        groups = _ROWS[form.name]
        for kind, at in ((item.kind, int(form.at[family])), ("nu", _nu(description, form, family))):
            group = groups.get(kind) if kind != "nu" or item.kind == "kappa" else None
            if group is not None and at >= 0 and (group, row) in first:
                rows.append(first[group, row] + position)
                unknowns.append(at + position)
    return np.asarray(rows, dtype=np.int64), np.asarray(unknowns, dtype=np.int64)


def _nu(description: Description, form: Form, family: int) -> int:
    """Where the nu of a constraint stand (behind the unknowns as written, in the order of the kappa); -1: nowhere."""
    if form.unknowns == form.written:
        return -1
    before = sum(description.families[k].size for k in description.families_of("kappa") if k < family)
    return form.written + before
