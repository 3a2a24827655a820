"""How many initial values a model takes, and how many more than the text fixes (language, section 5, Counting).

The consistent states near a point form a manifold; its tangent space is the null space of all rows and their hidden
derivatives.  `manifold` is its dimension in the differential unknowns; `order` that of its projection onto contents:
displacements that something depends on, momenta or flows with inertia, dynamic variables.
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import equilibrated
from sysdyn.runtime.numerics.rank import TOLERANCE, null_space, singular_values
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.start.starter import Mask, Starter

DENSE = 600
"""Unknowns and rates up to which the null space is taken."""


def order_and_manifold(system: System, state: ConsistentState, idle: AbstractSet[str]) -> tuple[int, int] | None:
    """(order, manifold) at a state; None for models too large.

    system: the form as written; idle: coordinates on whose displacement nothing depends, and states that only measure.
    """
    starter = Starter(system)
    tangent = _tangent(starter, state, starter.every & ~starter.groups("initial"), np.ones_like(starter.free))
    if tangent is None:
        return None
    kinds, n = system.kinds, system.unknowns
    _, jyd = system.jacobian(state.t, state.y, state.yd)
    moving = np.isin(kinds, ("q", "p", "s")) | ((kinds == "f") & system.differential(jyd))
    families = system.description.families
    owners = np.array([families[int(k)].owner in idle for k in system.family_of], dtype=bool)
    content = moving & ~(owners & np.isin(kinds, ("q", "s")))
    return _rank(tangent[:n][content]), _rank(tangent[:n][moving])


def freedom(system: System, state: ConsistentState) -> tuple[int, tuple[str, ...]]:
    """How many more fixed values a state as found would take, and the names of the free unknowns among which (of models
    too large unknown: 0).
    """
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
    x = starter.unknowns(state.t, state.y, state.yd)
    if x.size > DENSE:
        return None
    full = np.zeros((starter.settled.rows, x.size))
    np.add.at(full, (starter.rows, starter.columns), starter.jacobian(state.t, x))
    (full,) = equilibrated(full[rows][:, free])
    null = null_space(full)
    tangent = np.zeros((x.size, null.shape[1]))
    tangent[free] = null
    return tangent


def _rank(part: Floats) -> int:
    """Rank of some rows of orthonormal columns: their size is known, so what is small beside one is zero."""
    return int((singular_values(part) > TOLERANCE).sum()) if part.size else 0
