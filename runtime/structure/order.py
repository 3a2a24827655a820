"""How many initial values a model takes, and how many more than the text fixes (language, section 5, Counting).

The consistent states near a point form a manifold; its tangent space is the null space of all rows and their hidden
derivatives.  `manifold` is its dimension in the differential unknowns; `order` that of its projection onto contents:
displacements that something depends on, momenta or flows with inertia, dynamic variables.
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import equilibrate
from sysdyn.runtime.numerics.rank import TOLERANCE, null_space, singular_values
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.start.starter import Mask, Starter

DENSE = tuning.NULL_SPACE
"""Unknowns and rates up to which the null space is taken."""


def order_and_manifold(system: System, state: ConsistentState, idle: AbstractSet[str]) -> tuple[int, int] | None:
    """(order, manifold) at a state; None for models too large.

    system: the form as written; idle: coordinates on whose displacement nothing depends, and states that only measure.
    """
    starter = Starter(system)
    full = _rows(starter, state)
    if full is None:
        return None
    # rows that hold at starts, without initial values
    full = full[starter.every & ~starter.groups("initial")]
    whole, kinds = _graded_rank(full), system.kinds
    # states: contents, and flows that have rates
    _, jyd = system.jacobian(state.t, state.y, state.yd)
    moving = np.isin(kinds, ("q", "p", "s")) | ((kinds == "f") & system.differential(jyd))
    families = system.description.families
    owners = np.array([families[int(k)].owner in idle for k in system.family_of], dtype=bool)
    content = moving & ~(owners & np.isin(kinds, ("q", "s")))

    def directions(of: Mask) -> int:
        """The dimension of the tangent space less that of its part in which these unknowns rest."""
        rest = np.append(~of, np.ones(full.shape[1] - of.size, dtype=bool))
        return int(of.sum()) - whole + _graded_rank(full[:, rest])

    return directions(content), directions(moving)


def freedom(system: System, state: ConsistentState) -> tuple[int, tuple[str, ...]]:
    """How many more fixed values a state as found would take, and the names of the free unknowns among which (of models
    too large unknown: 0).
    """
    # what the state leaves free, beyond what it fixes
    starter = Starter(system)
    tangent = _tangent(starter, state, starter.every, starter.free)
    if tangent is None:
        return 0, ()
    follows = starter.following(state.t, starter.unknowns(state.t, state.y, state.yd))
    carries = np.flatnonzero(starter.free & ~follows & ~starter.moves("slack", "unsaid"))
    missing = _rank(tangent[carries])
    return missing, tuple(starter.settled.name(int(k)) for k in carries) if missing else ()


def _tangent(starter: Starter, state: ConsistentState, rows: Mask, free: Mask) -> Floats | None:
    """Orthonormal directions [unknowns and rates, freedoms] that the rows leave open to free unknowns; None of models
    too large.
    """
    full = _rows(starter, state)
    if full is None:
        return None
    # null space in equilibrated rows
    null = null_space(*equilibrate(full[rows][:, free]))
    tangent = np.zeros((free.size, null.shape[1]))
    tangent[free] = null
    return tangent


def _rows(starter: Starter, state: ConsistentState) -> Floats | None:
    """The derivatives of all rows by unknowns and rates; None of models too large."""
    x = starter.unknowns(state.t, state.y, state.yd)
    if x.size > DENSE:
        return None
    full = np.zeros((starter.settled.rows, x.size))
    np.add.at(full, (starter.rows, starter.columns), starter.jacobian(state.t, x))
    return full


def _rank(part: Floats) -> int:
    """Rank of some rows of orthonormal columns: their size is known, so what is small beside one is zero."""
    return int((singular_values(part) > TOLERANCE).sum()) if part.size else 0


def _graded_rank(matrix: Floats) -> int:
    """Rank whatever the ratios of its entries: those of a resistor of 0.1 mohm beside a capacitor, in rows and their
    derivatives, are powers of 1e8, and no scaling of lines makes them alike.

    By elimination; a pivot is alone in its row or column, or an entry that none in its lines exceeds, and what is left
    of an entry is zero where it is small beside the terms that it came of.
    """
    left, size, found = matrix.copy(), np.abs(matrix), 0
    # one pivot after the other, without a fixed order
    while left.size:
        left[np.abs(left) <= TOLERANCE * size] = 0.0
        rows, columns = left.any(axis=1), left.any(axis=0)
        left, size = left[rows][:, columns], size[rows][:, columns]
        if not left.size:
            break
        # candidates: the largest of its row and its column
        most = np.abs(left)
        largest = (most == most.max(axis=1, keepdims=True)) & (most == most.max(axis=0, keepdims=True))
        there = most > 0.0
        # entries alone in a line cost no fill, and lose nothing
        alone = there & ((there.sum(axis=1, keepdims=True) == 1) | (there.sum(axis=0, keepdims=True) == 1))
        among = alone if alone.any() else largest
        i, j = np.unravel_index(np.argmax(np.divide(most, size, out=np.zeros_like(most), where=among)), left.shape)
        # one step of elimination; magnitudes grow by what is taken off
        column, row = left[:, j] / left[i, j], left[i].copy()
        left = left - np.outer(column, row)
        size = size + np.outer(np.abs(column), np.abs(row))
        left = np.delete(np.delete(left, i, axis=0), j, axis=1)
        size = np.delete(np.delete(size, i, axis=0), j, axis=1)
        found += 1
    return found
