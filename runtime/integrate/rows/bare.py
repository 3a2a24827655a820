"""Which rows of a trace need not be settled: what they show follows from the state, by itself or by constant sums.

A dense output that is the same combination of points for every unknown keeps each constant sum that the points keep
(the voltage of a linear capacitor from its charge); laws that bend it does not keep, and a row that shows none of what
follows from these asks for no iteration.  The core looks at one such row a step whether its sums and constraints do
hold (sd_settle_meets): a method that interpolates unknowns apart (radau) settles as ever.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.condense.elimination import LONGEST, affine
from sysdyn.runtime.model.system import System

Mask = NDArray[np.bool_]
OBSERVED = ("observe", "observe_scale")


def shows(system: System, known: Mask, blocks: tuple[str, ...] = ("observe",)) -> bool:
    """Whether blocks read no unknown but known ones [unknowns as written], and no rate."""
    follows = system.families_in(~known)
    kernels = [kernel for block in blocks for kernel in system.description.blocks.get(block, ())]
    return all(k.reads is not None and not (k.reads & follows) and k.rates == frozenset() for k in kernels)


def by_sums(settled: System, state: Mask) -> tuple[Mask, Mask]:
    """What follows from the state [unknowns] by constant sums one after the other, and these sums [rows]."""
    rows, columns = settled.pattern.row, settled.pattern.columns_of()
    in_y, in_rate = settled.structural()
    # rows that are constant sums, without rates
    sums = affine(settled)
    sums[rows[in_rate]] = False
    known = state.copy()
    there = in_y & sums[rows]
    rows, columns = rows[there], columns[there]
    # each pass finds those with one unknown left
    for _ in range(LONGEST):
        open_ = ~known[columns]
        last = open_ & (np.bincount(rows[open_], minlength=settled.rows) == 1)[rows]
        if not last.any():
            break
        known[columns[last]] = True
    return known, sums
