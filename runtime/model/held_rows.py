"""Rows of constraints that are left out, or do not hold now: in each index form, which rows read "multiplier = 0" in
the place of their equation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Description
from sysdyn.runtime.model.forms import Form

LeftOut = tuple[tuple[int, int], ...]
"""(family, position) of multipliers."""
Longs = NDArray[np.int64]

_HELD = {
    "3": (("phi", "kappa"), ("psi", "mu")),
    "2": (("phi_rate", "kappa"), ("phi", "nu"), ("psi", "mu")),
    "2v": (("phi_rate", "kappa"), ("psi", "mu")),
    "1": (("phi_acceleration", "kappa"), ("psi_rate", "mu")),
    "0": (("phi_acceleration", "kappa"), ("psi_rate", "mu")),
    "constraints": (("phi", "kappa"), ("phi_rate", "kappa"), ("psi", "mu")),
}
_HELD["valued"] = _HELD["constraints"]
_HELD["settled"] = _HELD["rated"] = _HELD["start"] = (
    *_HELD["constraints"], ("phi_acceleration", "kappa"), ("psi_rate", "mu"),
)  # fmt: skip
"""Form -> groups of rows of a constraint, and the unknown that each reads where the constraint does not hold.  Where it
is left out, only the last row of an unknown reads it, which determines it: the others hold with those they depend on.
"""
_RATES = {"start": {"kappa": "phi_acceleration", "mu": "psi_rate"}}
_RATES["rated"] = _RATES["start"]
"""Form -> multiplier -> group whose rows read its derivative: a force that is zero stays it, and what balances without
inertia follows from that.  Only where the derivatives of balances stand among the rows.
"""


def _rows_of(description: Description, form: Form, places: LeftOut) -> Iterator[tuple[int, str, str, int, int]]:
    """Of multipliers: number, each group of rows, the unknown that it reads, the places of both."""
    first, families = {(group, k): at for group, k, at in form.groups}, description.families
    row = {family: multiplier_row(description, family) for family in dict(places)}
    # kappa stands for itself and, in the stabilised form, for nu
    for number, (family, position) in enumerate(places):
        at = {families[family].kind: int(form.at[family])}
        if "kappa" in at:
            at["nu"] = nu_place(description, form, family)
        # rows in which this form reads the multiplier
        for group, read in _HELD[form.base]:
            if at.get(read, -1) >= 0 and (group, row[family]) in first:
                yield number, group, read, first[group, row[family]] + position, at[read] + position


def held_rows(description: Description, form: Form, left_out: LeftOut) -> tuple[Longs, Longs]:
    """Rows, and the unknowns that vanish there."""
    own = {} if form.base == "constraints" else {read: group for group, read in _HELD[form.base]}  # the last of each
    found = [(row, at) for _, group, read, row, at in _rows_of(description, form, left_out) if own.get(read) == group]
    table = np.asarray(found, dtype=np.int64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def multiplier_row(description: Description, family: int) -> int:
    """The row family of the constraint of a family of multipliers."""
    # kappa belong to phi, mu to psi
    item = description.families[family]
    block = "phi" if item.kind == "kappa" else "psi"
    rows_of = ((k, description.rows[k]) for k in description.rows_of(block))
    return next(k for k, found in rows_of if item.owner in (found.owner, found.label))


def nu_place(description: Description, form: Form, family: int) -> int:
    """Where the nu of a constraint stand (behind the unknowns as written, in the order of the kappa); -1: nowhere."""
    # forms without nu
    if form.unknowns == form.written:
        return -1
    before = sum(description.families[k].size for k in description.families_of("kappa") if k < family)
    return form.written + before


def switch_rows(description: Description, form: Form) -> tuple[Longs, Longs, Longs, Longs]:
    """Rows, the unknowns that vanish there, the numbers of their switches; 1 where their derivative does."""
    # forms in which rates of multipliers are unknowns
    rates = _RATES.get(form.name, {}) if "dynamics_rate" in description.blocks else {}
    rows = _rows_of(description, form, description.switches.places)
    found = [(row, at, number, int(rates.get(read) == group)) for number, group, read, row, at in rows]
    table = np.asarray(found, dtype=np.int64).reshape(-1, 4)
    return table[:, 0], table[:, 1], table[:, 2], table[:, 3]
