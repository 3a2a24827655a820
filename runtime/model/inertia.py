"""Inertia M = d2T*/df2 by the rows of a form; what each coordinate holds by itself: diagonals of M and K = d2V/dq2.

M stands in the rows of dynamics as the coefficient of f' (Lagrange); rows of momentum r = p - dT*/df, or dT/dp - f,
give it as -(dr/dp)^-1 dr/df (Hamilton).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System


def _own(system: System, values: Floats, group: str, kind: str) -> Floats:
    """The entry of each unknown of a kind in its coordinate's row of a group [unknowns]; 0 where there is none."""
    found, columns = np.zeros(system.unknowns), system.pattern.columns_of()
    mine = _own_places(system, group, kind)
    found[columns[mine]] = values[mine]
    return found


def own_unknown(system: System, group: str, kind: str) -> Ints:
    """The unknown of a kind in whose coordinate's row of a group each row is [rows]; -1 elsewhere."""
    families = system.description.families
    own = {family.owner: k for k, family in enumerate(families) if family.kind == kind}
    place = np.full(system.rows, -1, dtype=np.int32)
    for name, family, first in system.form.groups:
        row = system.description.rows[family]
        unknown = own.get(row.owner)
        if name == group and unknown is not None and families[unknown].size == row.size:
            place[first : first + row.size] = system.form.at[unknown] + np.arange(row.size, dtype=np.int32)
    return place


def own_inertia(system: System, jy: Floats | None, jyd: Floats) -> Floats:
    """Diagonal of M at the places of the flows [unknowns], where no others are joined; 0 where there is none.

    jy, jyd [entries]: dF/dy, dF/dyd; jy None: of a system without momenta.
    """
    found = _own(system, jyd, "dynamics", "f")
    if jy is None:
        return found
    by_flow, by_momentum = _own(system, jy, "momentum", "f"), _own(system, jy, "momentum", "p")
    momenta, flows = with_flows(system)
    one, other = by_flow[flows], by_momentum[momenta]
    found[flows] -= np.divide(one, other, out=np.zeros_like(one), where=other != 0.0)
    return found


def inertia(system: System, jy: Floats, jyd: Floats) -> Floats:
    """M [flows, flows] as a full matrix; no numbers where momenta do not determine their flows.

    jy, jyd [entries]: dF/dy, dF/dyd.
    """
    moving = system.are("f")
    size, flow = int(moving.sum()), np.where(moving, np.cumsum(moving) - 1, -1)
    momentum = np.full(system.unknowns, -1, dtype=np.int64)
    momenta, flows = with_flows(system)
    momentum[momenta] = flow[flows]

    def gathered(group: str, unknown: NDArray[np.int64], values: Floats) -> Floats:
        """Entries of a group's rows at unknowns, both by the flow of their coordinate (unknown: of each, or -1)."""
        own = own_unknown(system, group, "f")[system.pattern.row]
        column = unknown[system.pattern.columns_of()]
        take = (own >= 0) & (column >= 0)
        found = np.zeros((size, size))
        np.add.at(found, (flow[own[take]], column[take]), values[take])
        return found

    slopes = gathered("momentum", momentum, jy)
    without = ~np.isin(np.arange(size), momentum)
    slopes[without, without] = 1.0
    try:
        carried = np.linalg.solve(slopes, gathered("momentum", flow, jy))
    except np.linalg.LinAlgError:
        return np.full((size, size), np.nan)
    return gathered("dynamics", flow, jyd) - carried


def own_places(system: System) -> tuple[NDArray[np.int64], ...]:
    """Places in the pattern of what coordinates hold of themselves: flows in rows of dynamics, displacements there;
    flows in rows of momentum, momenta there.
    """
    groups = ("dynamics", "f"), ("dynamics", "q"), ("momentum", "f"), ("momentum", "p")
    return tuple(_own_places(system, *group) for group in groups)


def _own_places(system: System, group: str, kind: str) -> NDArray[np.int64]:
    """Places in the pattern of the entries of each unknown of a kind in its coordinate's row of a group."""

    def find() -> NDArray[np.int64]:
        return np.flatnonzero(own_unknown(system, group, kind)[system.pattern.row] == system.pattern.columns_of())

    return system.once(("own", group, kind), find)


def with_flows(system: System) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places of momenta, and of the flows of the same coordinates."""
    families = list(zip(system.description.families, system.form.at, strict=False))
    flow = {family.owner: first for family, first in families if family.kind == "f"}
    paired = [(family, first) for family, first in families if family.kind == "p" and family.owner in flow]
    both = [(first + np.arange(f.size), flow[f.owner] + np.arange(f.size)) for f, first in paired]
    momenta, flows = np.hstack([np.zeros((2, 0), dtype=np.int64), *both])
    return momenta, flows
