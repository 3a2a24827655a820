"""Rows of constraints that are left out, or do not hold now: in each index form, which rows read "multiplier = 0" in
the place of their equation.
"""

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
    "rated": {"kappa": "phi_acceleration", "mu": "psi_rate"},
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
        row = multiplier_row(description, family)
        groups = _ROWS[form.base]
        for kind, at in ((item.kind, int(form.at[family])), ("nu", nu_place(description, form, family))):
            group = groups.get(kind) if kind != "nu" or item.kind == "kappa" else None
            if group is not None and at >= 0 and (group, row) in first:
                rows.append(first[group, row] + position)
                unknowns.append(at + position)
    return np.asarray(rows, dtype=np.int64), np.asarray(unknowns, dtype=np.int64)


def multiplier_row(description: Description, family: int) -> int:
    """The row family of the constraint of a family of multipliers."""
    item = description.families[family]
    block = "phi" if item.kind == "kappa" else "psi"
    rows_of = ((k, description.rows[k]) for k in description.rows_of(block))
    return next(k for k, found in rows_of if item.owner in (found.owner, found.label))


def nu_place(description: Description, form: Form, family: int) -> int:
    """Where the nu of a constraint stand (behind the unknowns as written, in the order of the kappa); -1: nowhere."""
    if form.unknowns == form.written:
        return -1
    before = sum(description.families[k].size for k in description.families_of("kappa") if k < family)
    return form.written + before


_HELD = {
    "3": (("phi", "kappa"), ("psi", "mu")),
    "2": (("phi_rate", "kappa"), ("phi", "nu"), ("psi", "mu")),
    "2v": (("phi_rate", "kappa"), ("psi", "mu")),
    "1": (("phi_acceleration", "kappa"), ("psi_rate", "mu")),
    "0": (("phi_acceleration", "kappa"), ("psi_rate", "mu")),
    "constraints": (("phi", "kappa"), ("phi_rate", "kappa"), ("psi", "mu")),
}
_HELD["settled"] = _HELD["rated"] = _HELD["start"] = (
    *_HELD["constraints"], ("phi_acceleration", "kappa"), ("psi_rate", "mu"),
)  # fmt: skip
"""Form -> groups of rows of a constraint, and the unknown that each reads where the constraint does not hold."""
_RATES = {"start": {"kappa": "phi_acceleration", "mu": "psi_rate"}}
_RATES["rated"] = _RATES["start"]
"""Form -> multiplier -> group whose rows read its derivative: a force that is zero stays it, and what balances without
inertia follows from that.  Only where the derivatives of balances stand among the rows.
"""


def switch_rows(description: Description, form: Form) -> tuple[Longs, Longs, Longs, Longs]:
    """Rows, the unknowns that vanish there, the numbers of their switches; 1 where their derivative does."""
    first = {(group, family): row for group, family, row in form.groups}
    found: list[tuple[int, int, int, int]] = []
    rates = _RATES.get(form.name, {}) if "dynamics_rate" in description.blocks else {}
    for k, (family, position) in enumerate(description.switches.places):
        item = description.families[family]
        row = multiplier_row(description, family)
        for group, kind in _HELD[form.base]:
            place = nu_place(description, form, family) if kind == "nu" else int(form.at[family])
            if item.kind == ("kappa" if kind == "nu" else kind) and place >= 0 and (group, row) in first:
                found.append((first[group, row] + position, place + position, k, int(rates.get(kind) == group)))
    table = np.asarray(found, dtype=np.int64).reshape(-1, 4)
    return table[:, 0], table[:, 1], table[:, 2], table[:, 3]
