"""Which unknowns are the states of a linearisation, and what of them nothing depends on.

Receives a System, a consistent state, the directions that its rows leave open.  Hands on places of unknowns.
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.scales import group_maximum
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.rank import CERTAIN, singular_decomposition, singular_values
from sysdyn.runtime.start.start import ConsistentState

Mask = NDArray[np.bool_]
OWN = 10.0
"""Preference for the flow or momentum of a coordinate whose displacement is a state."""


def candidates_of(system: System, state: ConsistentState, n: int) -> NDArray[np.int64]:
    """Places of y that may be states: displacements, momenta, dynamic variables, flows with inertia and no momentum."""
    # unknowns whose rate occurs, and displacements
    _, jyd = system.jacobian(state.t, state.y, state.yd)
    moving = system.differential(jyd)[:n]
    moving[system.form.k_q] = True
    kinds = system.kinds[:n]
    families = system.description.families
    # a flow is a state where its coordinate has no momentum
    carried = {f.owner for f in families if f.kind == "p"}
    bare = np.array([families[int(k)].owner not in carried for k in system.family_of[:n]], dtype=bool)
    return np.flatnonzero(moving & (np.isin(kinds, ("q", "p", "s")) | ((kinds == "f") & bare)))


def chosen_states(
    system: System, tangent: Floats, units: Floats, candidates: NDArray[np.int64], loose: Mask
) -> NDArray[np.int64]:
    """States [k] of orthonormal directions [unknowns, k] in these units: as many displacements as are free, then what
    moves beside them, of the same coordinates if it can be, what nothing depends on (loose) last; of what is alike
    that which moves most.
    """
    n = system.form.written
    # how far each moves beside its like
    size = np.linalg.norm(tangent[:n], axis=1) * units[:n]
    most = group_maximum(system, size)
    weight = np.where(most > 0.0, size / np.where(most > 0.0, most, 1.0), 0.0)[:, None]
    shown = system.kinds[candidates] == "q"
    kept: list[int] = []
    # displacements, then other states, then what nothing depends on
    for group in (shown & ~loose[candidates], ~shown & ~loose[candidates], loose[candidates]):
        members = candidates[group]
        # directions that the states so far do not see
        left = tangent @ unseen(tangent[kept])
        coordinates = {_coordinate(system, k) for k in kept}
        # a flow beside its own displacement is preferred
        near = np.array([OWN if _coordinate(system, int(k)) in coordinates else 1.0 for k in members])
        part = left[members] * near[:, None] * weight[members]
        kept += members[pivots(part, rank_of(left[members]))].tolist() if part.size else []
    return np.array(kept, dtype=np.int64)


def pivots(matrix: Floats, number: int) -> NDArray[np.int64]:
    """The rows of a matrix [m, n] that are farthest from each other's spans, one after the other (ascending)."""
    from scipy.linalg import qr

    _, order = qr(matrix.T, mode="r", pivoting=True)
    return np.sort(order[:number].astype(np.int64))


def rank_of(part: Floats) -> int:
    """Rank of rows of orthonormal columns: potentials that differ little from each other are two."""
    return int((singular_values(part) > CERTAIN).sum()) if part.size else 0


def unseen(rows: Floats) -> Floats:
    """Directions that some rows of orthonormal columns do not see."""
    # no rows see nothing: all directions
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sigma, vt = singular_decomposition(rows)
    return np.asarray(vt[int((sigma > CERTAIN).sum()) :].T)


def _coordinate(system: System, place: int) -> tuple[str, int]:
    """Coordinate of an unknown: its family's owner, its position there."""
    k = int(system.family_of[place])
    return system.description.families[k].owner, place - int(system.form.at[k])


def quadratures(system: System, tangible: AbstractSet[str]) -> Mask:
    """Unknowns that nothing depends on [unknowns as written]: displacements of coordinates that are not tangible,
    dynamic variables that stand in no row, not even where it has no slope by them (sign(x), step(x)).
    """
    settled = system.another("settled")
    n = system.form.written
    # unknowns that stand in rows of the settled form
    columns = settled.pattern.columns_of()[settled.structural()[0]]
    # read without slope: sign(x), step(x)
    read = np.isin(settled.family_of, list(_read_flat(settled)))
    read[columns] = True
    families, kinds = system.description.families, system.kinds[:n]
    owners = np.array([families[int(k)].owner in tangible for k in system.family_of[:n]], dtype=bool)
    found: Mask = ((kinds == "q") & ~owners) | ((kinds == "s") & ~read[:n])
    return found


def _read_flat(system: System) -> set[int]:
    """Families that a loop nest reads and has no slope by."""
    kernels = [kernel for call in system.form.calls for kernel in system.description.blocks[call.block]]
    return {k for nest in kernels for k in (nest.reads or frozenset()) - {by.family for _, by in nest.dy}}


def moving(system: System, state: ConsistentState) -> bool:
    """Whether any differential unknown moves."""
    yd = state.yd.copy()
    yd[system.form.k_q] = state.y[system.form.k_f]
    places = candidates_of(system, state, system.form.written)
    return bool(np.abs(yd[places]).max(initial=0.0) > 0.0)


def constant(system: System, state: ConsistentState) -> bool:
    """Whether the pencil is the same beside the state: linear equations, whose frozen pencil is right in motion too."""
    # any other point: linear equations have the same slopes there
    random = np.random.default_rng(5)
    here = system.jacobian(state.t, state.y, state.yd)
    y, yd = (v + np.maximum(np.abs(v), 1.0) * random.uniform(0.1, 0.3, v.size) for v in (state.y, state.yd))
    there = system.jacobian(state.t + 0.37, y, yd)
    return all(np.allclose(one, two, rtol=1e-12, atol=0.0) for one, two in zip(here, there, strict=True))
