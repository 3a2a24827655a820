"""Which row belongs to which unknown of a form, by what they are: a matrix becomes as symmetric as its model is.

A displacement belongs to the balance of its coordinate, a flow to q' - f, a momentum to its definition, a multiplier to
its constraint.  So what stores and loads couple, and what constraints react with, stand on both sides of the diagonal.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.inertia import own_unknown
from sysdyn.runtime.model.system import System

_CONSTRAINTS = (("kappa", ("phi", "phi_rate", "phi_acceleration")), ("mu", ("psi", "psi_rate")))
"""Kinds of multipliers and the groups of rows of their constraints: the last one that a form has is theirs."""

_BALANCES = ("dynamics", "f"), ("dynamics", "p"), ("momentum_rate", "f")
"""Groups of rows, and whose rates they tell."""


def own_rows(system: System) -> Ints:
    """The row of each unknown [unknowns]; -1 where none is sure.  A constraint reads its multiplier only once
    others are eliminated: until then another row pivots there.
    """
    form = system.form
    own = np.full(system.unknowns, -1, dtype=np.int32)
    # a balance belongs to its displacement, a momentum's row to the momentum
    for group, kind in (("dynamics", "q"), ("momentum", "p")):
        unknown = own_unknown(system, group, kind)
        own[unknown[unknown >= 0]] = np.flatnonzero(unknown >= 0)
    # q' = f tells the flow
    own[form.k_f] = form.k_row
    _constraints(system, own)
    return own


def own_rows_of_rates(system: System) -> Ints:
    """The row that tells the rate of each unknown [unknowns]; -1 where none is sure."""
    pattern, rated = system.pattern, system.structural()[1]
    columns = pattern.columns_of()
    own = np.full(system.unknowns, -1, dtype=np.int32)
    for group, kind in _BALANCES:
        # a row that reads the rate of its own unknown
        mine = rated & (own_unknown(system, group, kind)[pattern.row] == columns)
        own[columns[mine]] = pattern.row[mine]
    return own


def _constraints(system: System, own: Ints) -> None:
    """The rows of multipliers [unknowns]."""
    form, description = system.form, system.description
    for kind, groups in _CONSTRAINTS:
        # a constraint belongs to its multiplier
        family_of = {description.families[k].owner: k for k in description.families_of(kind)}
        for group, row, first in form.groups:
            found = description.rows[row]
            family = family_of.get(found.owner, family_of.get(found.label))
            if group in groups and family is not None and description.families[family].size == found.size:
                at = int(form.at[family])
                own[at : at + found.size] = np.arange(first, first + found.size, dtype=np.int32)
