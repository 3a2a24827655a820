"""Which rows of the settled form are left where unknowns leave the runs."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.condense.elimination import Mask
from sysdyn.runtime.condense.sums import ConstantSums
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.patterns import Places, compress
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.matching import match_rows
from sysdyn.runtime.numerics.points import distinct

RATE_OF = {
    "phi_acceleration": "phi_rate",
    "psi_rate": "psi",
    "gamma_rate": "gamma",
    "gamma_acceleration": "gamma_rate",
    "momentum_rate": "momentum",
}
"""Group of rows -> group of which they are the time derivative."""


def _defining(rows: Ints, columns: Ints) -> bool:
    """Whether each of the rows can be told for a column of its own, by their entries."""
    own, each = distinct(rows), distinct(columns)
    pattern, _ = compress(own.size, each.size, [Places(np.searchsorted(own, rows), np.searchsorted(each, columns))])
    return int((match_rows(pattern) >= 0).sum()) == own.size


def settled_rows(stepped: System, settled: System, gone: Mask, numbers: ConstantSums) -> Mask | None:
    """Rows of the settled form that are left [rows]; None where the others say more than what leaves moves by: what
    balances it would be open, or rates that observers read.
    """
    description = settled.description
    # rows of both forms meet by group and family
    first = {(group, family): at for group, family, at in stepped.form.groups}
    kept = np.ones(settled.rows, dtype=bool)
    for group, family, at in settled.form.groups:
        home, size = first.get((RATE_OF.get(group, group), family)), description.rows[family].size
        # a row whose home is gone is gone with it
        if home is not None:
            kept[at : at + size] = ~gone[home : home + size]
    columns, rows = settled.pattern.columns_of(), settled.pattern.row
    lost = np.zeros(settled.unknowns, dtype=bool)
    lost[numbers.unread] = True
    # rows that read what nothing else reads
    kept[rows[lost[columns]]] = False
    derived = np.zeros(settled.unknowns, dtype=bool)
    derived[numbers.place] = True
    # rows that read the rate of a defined unknown
    moving = settled.structural()[1]
    dropped = np.zeros(settled.rows, dtype=bool)
    dropped[rows[moving & derived[columns]]] = True
    dropped &= kept
    rates = moving & derived[columns] & dropped[rows]
    # those rows must define these rates and nothing else
    if not _defining(rows[rates], columns[rates]):
        return None
    read = {family for kernel in description.blocks.get("observe_rate", ()) for family in kernel.rates or ()}
    open_ = np.zeros(settled.unknowns, dtype=bool)
    open_[columns[moving & dropped[rows] & ~derived[columns]]] = True
    # an observer shows a rate that would be open
    if read & settled.families_in(open_):
        return None
    return kept & ~dropped
