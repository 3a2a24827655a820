"""Inertia M = d2T*/df2 by the rows of a form; what each coordinate holds by itself: diagonals of M and K = d2V/dq2.

M stands in the rows of dynamics as the coefficient of f' (Lagrange); rows of momentum r = p - dT*/df, or dT/dp - f,
give it as -(dr/dp)^-1 dr/df (Hamilton).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints, Places
from sysdyn.runtime.model.system import System

Entries = tuple[Places, Places, Floats]

CANCELS = tuning.CANCELS
"""Sum of a column of M over that of its magnitudes that is round-off."""


def _own(system: System, values: Floats, group: str, kind: str) -> Floats:
    """The entry of each unknown of a kind in its coordinate's row of a group [unknowns]; 0 where there is none."""
    mine = _own_places(system, group, kind)
    found = np.zeros(system.unknowns)
    found[system.pattern.columns_of()[mine]] = values[mine]
    return found


def own_unknown(system: System, group: str, kind: str) -> Ints:
    """The unknown of a kind in whose coordinate's row of a group each row is [rows]; -1 elsewhere."""
    families = system.description.families
    own = {family.owner: k for k, family in enumerate(families) if family.kind == kind}
    place = np.full(system.rows, -1, dtype=np.int32)
    # rows of the group, coordinate by coordinate
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
    # without momenta M stands in the balances
    if jy is None:
        return found
    by_flow, by_momentum = _own(system, jy, "momentum", "f"), _own(system, jy, "momentum", "p")
    # p = M f: the slope by the flow over that by the momentum
    momenta, flows = with_flows(system)
    one, other = by_flow[flows], by_momentum[momenta]
    found[flows] -= np.divide(one, other, out=np.zeros_like(one), where=other != 0.0)
    return found


class Inertia:
    """M by the rows of a form: entries of balances at rates of flows, of rows of momentum at flows and at momenta, each
    (row, column, value) by the flows of their coordinates.  jy, jyd [entries]: dF/dy, dF/dyd.
    """

    def __init__(self, system: System, jy: Floats, jyd: Floats) -> None:
        moving = system.are("f")
        self.size = int(moving.sum())
        # flows by number; momenta by the number of their flow
        flow = np.where(moving, np.cumsum(moving) - 1, -1)
        momentum = np.full(system.unknowns, -1, dtype=np.int64)
        momenta, flows = with_flows(system)
        momentum[momenta] = flow[flows]
        self.without = ~np.isin(np.arange(self.size), momentum)  # a momentum
        columns = system.pattern.columns_of()

        def entries(group: str, unknown: NDArray[np.int64], values: Floats) -> Entries:
            # entries whose row belongs to a coordinate and whose column is a flow or its momentum
            own = own_unknown(system, group, "f")[system.pattern.row]
            column = unknown[columns]
            take = (own >= 0) & (column >= 0)
            return flow[own[take]], column[take], values[take]

        self.balances = entries("dynamics", flow, jyd)
        self.by_flow, self.by_momentum = entries("momentum", flow, jy), entries("momentum", momentum, jy)

    def joined_pairs(self) -> Places:
        """Pairs of flows [2, k] of which one has an inertia in the other's rows."""
        parts = self.balances, self.by_flow, self.by_momentum
        return np.hstack([np.stack([i[v != 0.0], j[v != 0.0]]) for i, j, v in parts])

    def blocks(self, members: Places) -> Floats:
        """M [k, s, s] of groups of flows [k, s] that nothing joins with others; no numbers where momenta do not
        determine their flows.
        """
        number, s = members.shape
        # which group each flow is in, and where in it
        group, place = np.full(self.size, -1, dtype=np.int64), np.zeros(self.size, dtype=np.int64)
        group[members], place[members] = np.arange(number)[:, None], np.arange(s)

        def block(entries: Entries) -> Floats:
            i, j, values = entries
            # entries within one group
            take = (group[i] >= 0) & (group[i] == group[j])
            found = np.zeros((number, s, s))
            np.add.at(found, (group[i[take]], place[i[take]], place[j[take]]), values[take])
            return found

        slopes = block(self.by_momentum)
        # a flow without momentum has 1 there
        k, at = np.nonzero(self.without[members])
        slopes[k, at, at] = 1.0
        try:
            carried = np.linalg.solve(slopes, block(self.by_flow))
        # momenta that do not determine their flows
        except np.linalg.LinAlgError:
            return np.full((number, s, s), np.nan)
        return np.asarray(block(self.balances) - carried)

    def cancels(self, members: Places) -> bool:
        """Whether the balances of flows, added up, have no rate left; momenta are to be given by their own rows."""
        mine = np.zeros(self.size, dtype=bool)
        mine[members] = True
        own = np.ones(self.size)
        # a momentum given by several rows
        i, j, values = self.by_momentum
        if (values[(i != j) & mine[i]] != 0.0).any():
            return False
        own[i[i == j]] = values[i == j]
        # sums over the balances of these flows, and sizes of their terms
        total, size = np.zeros(self.size), np.zeros(self.size)
        for (i, j, values), over in ((self.balances, None), (self.by_flow, own)):
            part = values if over is None else -values / over[i]
            np.add.at(total, j[mine[i]], part[mine[i]])
            np.add.at(size, j[mine[i]], np.abs(part[mine[i]]))
        # nothing but round-off: they move together without inertia
        return bool((np.abs(total) <= CANCELS * size).all())


def flows_joined(system: System) -> NDArray[np.bool_]:
    """Flows whose coordinate's rows may hold inertia of another one's, or theirs its own [unknowns]."""
    columns, flows = system.pattern.columns_of(), system.are("f")
    in_y, in_rate = system.structural()
    momenta, own_flow = with_flows(system)
    # momenta count as their flows
    flow = np.where(flows, np.arange(system.unknowns, dtype=np.int32), np.int32(-1))
    flow[momenta] = own_flow
    found = np.zeros(system.unknowns, dtype=bool)
    for group, there, moving in (("dynamics", in_rate, flows), ("momentum", in_y, flow >= 0)):
        # entries that join two coordinates
        at = np.flatnonzero(there & moving[columns])
        own, other = own_unknown(system, group, "f")[system.pattern.row[at]], flow[columns[at]]
        apart = (own >= 0) & (own != other)
        found[own[apart]] = found[other[apart]] = True
    return found


def stored_between(system: System, common: Ints) -> Ints:
    """Pairs [k, 2] of unknowns of one group `common` [unknowns] (-1: of none) that a store joins: the rate of the one
    stands in the balance of the other.
    """
    own = own_unknown(system, "dynamics", "f")[system.pattern.row]
    column = system.pattern.columns_of()
    # a rate that stands in another coordinate's balance
    there = system.structural()[1] & (own >= 0) & (own != column)
    there &= (common[own] >= 0) & (common[own] == common[column])
    pairs = np.sort(np.stack([own[there], column[there]], axis=1), axis=1)
    return np.unique(pairs, axis=0)


def inertia(system: System, jy: Floats, jyd: Floats) -> Floats:
    """M [flows, flows] as a full matrix; no numbers where momenta do not determine their flows.

    jy, jyd [entries]: dF/dy, dF/dyd.
    """
    found = Inertia(system, jy, jyd)
    return np.asarray(found.blocks(np.arange(found.size)[None])[0])


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
    # coordinates that have both
    families = list(zip(system.description.families, system.form.at, strict=False))
    flow = {family.owner: first for family, first in families if family.kind == "f"}
    paired = [(family, first) for family, first in families if family.kind == "p" and family.owner in flow]
    both = [(first + np.arange(f.size), flow[f.owner] + np.arange(f.size)) for f, first in paired]
    momenta, flows = np.hstack([np.zeros((2, 0), dtype=np.int64), *both])
    return momenta, flows
