"""Inertia and stiffness of each coordinate by itself: the diagonals of M = d2T*/df2 and K = d2V/dq2."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System


def _own(system: System, values: Floats, group: str, kind: str) -> Floats:
    """|entry| of each unknown of a kind in its coordinate's row of a group [unknowns]; 0 where there is none."""
    found, columns = np.zeros(system.unknowns), system.pattern.columns_of()
    mine = _own_places(system, group, kind)
    np.maximum.at(found, columns[mine], np.abs(values[mine]))
    return found


def _places(system: System, group: str, kind: str) -> NDArray[np.int64]:
    """Places in the pattern of the entries of each unknown of a kind in its coordinate's row of a group."""
    return np.flatnonzero(own_unknown(system, group, kind)[system.pattern.row] == system.pattern.columns_of())


def own_unknown(system: System, group: str, kind: str) -> NDArray[np.int64]:
    """The unknown of a kind in whose coordinate's row of a group each row is [rows]; -1 elsewhere."""
    families = system.description.families
    own = {family.owner: k for k, family in enumerate(families) if family.kind == kind}
    place = np.full(system.rows, -1, dtype=np.int64)
    for name, family, first in system.form.groups:
        row = system.description.rows[family]
        unknown = own.get(row.owner)
        if name == group and unknown is not None and families[unknown].size == row.size:
            place[first : first + row.size] = system.form.at[unknown] + np.arange(row.size)
    return place


def own_inertia(system: System, jy: Floats, jyd: Floats) -> Floats:
    """Diagonal of M at the places of the flows [unknowns]; 0 where there is none.

    jy, jyd [entries]: dF/dy, dF/dyd.  M stands in the rows of dynamics (Lagrange); those of momentum are p - M f, or
    p/M - f.
    """
    found, at = _own(system, jyd, "dynamics", "f"), system.form.at
    by_flow, by_momentum = _own(system, jy, "momentum", "f"), _own(system, jy, "momentum", "p")
    families = system.description.families
    flow = {family.owner: k for k, family in enumerate(families) if family.kind == "f"}
    for k, family in enumerate(families[: len(at)]):
        if family.kind == "p" and family.owner in flow:
            own = slice(at[flow[family.owner]], at[flow[family.owner]] + family.size)
            one, other = by_flow[own], by_momentum[at[k] : at[k] + family.size]
            found[own] = np.maximum(found[own], np.divide(one, other, out=np.zeros_like(one), where=other > 0.0))
    return found


def own_places(system: System) -> tuple[NDArray[np.int64], ...]:
    """Places in the pattern of what coordinates hold of themselves: flows in rows of dynamics, displacements there;
    flows in rows of momentum, momenta there.
    """
    groups = ("dynamics", "f"), ("dynamics", "q"), ("momentum", "f"), ("momentum", "p")
    return tuple(_own_places(system, *group) for group in groups)


def _own_places(system: System, group: str, kind: str) -> NDArray[np.int64]:
    return system.once(("own", group, kind), lambda: _places(system, group, kind))


def with_flows(system: System) -> Iterator[tuple[slice, NDArray[np.int64]]]:
    """Momenta of each family, and the flows of their coordinates."""
    families, at = system.description.families, system.form.at
    flow = {family.owner: k for k, family in enumerate(families) if family.kind == "f"}
    for k, family in enumerate(families[: len(at)]):
        if family.kind == "p" and family.owner in flow:
            yield slice(at[k], at[k] + family.size), at[flow[family.owner]] + np.arange(family.size)
