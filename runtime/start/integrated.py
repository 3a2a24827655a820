"""Rows of a settled system integrated over an instant: where its pulses stand, which dynamic variables gain by them.

Rates of what jumps, flows whose displacements jump, and forces are pulses; finite terms do not count.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.condense.elimination import affine
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.facts import Mask
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

FORCES = ("e", "kappa", "mu")
BROKEN = tuning.MET
"""Of its terms: what a row is missed by, or an impulse, that is no round-off."""


@dataclass(frozen=True, slots=True)
class Pulses:
    """Terms of rows [terms] whose integrals count: row; column, 2 k of what unknown k moves by, 2 k + 1 of its
    integral; entry, those of dF/dyd first, `rated` many.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    entry: NDArray[np.int64]
    rated: int

    def values(self, jy: Floats, jyd: Floats) -> Floats:
        """Of the terms, from dF/dy, dF/dyd [entries]."""
        return np.append(jyd[self.entry[: self.rated]], jy[self.entry[self.rated :]])


@dataclass(frozen=True, slots=True)
class Integrated:
    """row, column [entries]; in_y, in_rate [entries]: in dF/dy, dF/dyd; moved [unknowns]: the displacement of a flow,
    -1 of what is none; force [unknowns]; affine [rows].

    rates [rows]: those that constants make, of contents [unknowns], the dynamic variables that other rows read; unread:
    rows and places of the dynamic variables that none does, of each with a rate of its own.
    """

    row: NDArray[np.int64]
    column: Ints
    in_y: Mask
    in_rate: Mask
    moved: NDArray[np.int64]
    force: Mask
    affine: Mask
    rates: Mask
    contents: Mask
    unread: tuple[NDArray[np.int64], Ints]

    def pulses(self, moved: NDArray[np.int64], force: Mask) -> Pulses:
        """The terms of rates, of flows by the displacements that they move, of forces (both [unknowns])."""
        flows = moved[self.column]
        # rates, flows by their displacements, forces
        at = [np.flatnonzero(of) for of in (self.in_rate, self.in_y & (flows >= 0), self.in_y & force[self.column])]
        columns = 2 * self.column[at[0]].astype(np.int64), 2 * flows[at[1]], 2 * self.column[at[2]].astype(np.int64) + 1
        entry = np.concatenate(at)
        return Pulses(self.row[entry], np.concatenate(columns), entry, at[0].size)


def integrated(settled: System) -> Integrated:
    """Of a System in form "settled"."""
    return settled.once("integrated", lambda: _integrated(settled))


def _integrated(settled: System) -> Integrated:
    """Places and kinds of a settled system's entries, by which its rows are integrated over an instant."""
    row, column, form = settled.pattern.row.astype(np.int64), settled.pattern.columns_of(), settled.another("3").form
    (in_y, in_rate), rated, constant = settled.structural(), settled.of_groups("lambda"), affine(settled)
    moved = np.full(settled.unknowns, -1, dtype=np.int64)
    moved[form.k_f] = form.k_q
    # what rows read by value, or by a rate of another kind
    read, rates = np.zeros(settled.unknowns, dtype=bool), np.zeros(settled.rows, dtype=bool)
    read[column[in_y | (in_rate & ~rated[row])]] = True
    # dynamic variables by their own rates: read by others, or alone
    own = in_rate & rated[row] & (settled.kinds == "s")[column]
    gains = own & constant[row] & read[column]
    rates[row[gains]] = True
    alone = own & ~read[column]
    alone &= (np.bincount(column[alone], minlength=settled.unknowns) == 1)[column]
    contents = np.isin(np.arange(settled.unknowns), column[gains])
    force = np.isin(settled.kinds, FORCES)
    unread = row[alone], column[alone]
    return Integrated(row, column, in_y, in_rate, moved, force, constant, rates, contents, unread)


def missed(entries: tuple[NDArray[np.int64], Ints, Floats], size: Floats, aims: tuple[Floats, Floats]) -> Floats:
    """What rows [rows] by entries (row, column, value) miss their aims by, zero where it is round-off.

    Sizes [columns]: an impulse of none is as large as what it may balance; aims [rows]: what is left, what was asked.
    """
    (i, j, v), (left, asked) = entries, np.abs(aims)
    v = np.abs(v)
    # sizes of impulses grow until each has one
    while True:
        terms, found = asked + np.bincount(i, v * size[j], left.size), np.zeros(size.size)
        np.maximum.at(found, j, np.divide(terms[i], v, out=np.zeros(v.size), where=v > 0.0))
        none = (size == 0.0) & (found > 0.0)
        # every column has its size
        if not none.any():
            return np.where((left > BROKEN * terms) & (terms > 0.0), left, 0.0)
        size = np.where(none, found, size)
