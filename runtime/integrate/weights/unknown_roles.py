"""Which unknowns the error test sees, and with which power of h Newton's test weighs them.

Error test: displacements, momenta, dynamic variables, flows with inertia.  Of flows that stores know by differences
alone these differences: what they have in common follows from algebra.  Left out: multipliers, implicit efforts,
flows of massless coordinates (they follow from the others; their accuracy is that of the state, and on index 2 their
local error is one order larger than what it does to the solution).  Where nothing else is left, they are tested.
Newton's test: multipliers and other index-2 unknowns with h, index-3 multipliers with h^2 (Petzold & Lötstedt 1986):
their round-off grows as h falls, and the theory bounds what their error does to the state.  It does so for rows that
are nearly linear: an unknown of a steep law counts as it is.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.scales import group_maximum
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.components import components
from sysdyn.runtime.numerics.points import uniform
from sysdyn.runtime.numerics.stretches import Stretches, whole_of
from sysdyn.runtime.structure.rates import unique
from sysdyn.values import dataclass

BALANCED = tuning.CANCELS
"""Sum of a row of dF/dyd over that of its magnitudes that is round-off."""

Few = NDArray[np.int8]
Mask = NDArray[np.bool_]
BESIDE = tuning.SMALL
"""Relative move of displacements: an inertia that vanishes at the start by chance does not vanish beside it."""


@dataclass(frozen=True, slots=True)
class Roles:
    """test [unknowns]: -1 left out, 0 tested, 1 tested with h; power [unknowns]: of h in Newton's norm.

    state [unknowns]: carry the state across a jump; differential [unknowns]: their derivative occurs;
    smooth [unknowns]: it is determined; common [unknowns]: number of the group of flows of which differences alone are
    states (-1: of none); idle [unknowns]: steep laws may leave them open where their slopes underflow.
    Of a large run under way states are held by their stretches, and the method has the rest.
    """

    test: Few
    power: Few
    held_state: Mask | Stretches[np.bool_]
    held_differential: Mask | Stretches[np.bool_]
    smooth: NDArray[np.bool_]
    idle: NDArray[np.bool_]
    common: Ints

    @property
    def state(self) -> Mask:
        """Made where it is held by its stretches."""
        return whole_of(self.held_state)

    @property
    def differential(self) -> Mask:
        """As state."""
        return whole_of(self.held_differential)

    def put_away(self) -> Roles:
        """Of a large run under way."""
        few, none = np.zeros(0, dtype=np.int8), np.zeros(0, dtype=np.bool_)
        common = self.common[:0].copy()
        return Roles(few, few, Stretches(self.state), Stretches(self.differential), none, none, common)

    def groups(self) -> tuple[Ints, Ints]:
        """Where each group begins among the unknowns of all groups, and these [in groups], as the core has them."""
        order = np.argsort(self.common, kind="stable")[int((self.common < 0).sum()) :].astype(np.int32)
        begin = np.flatnonzero(np.diff(self.common[order], prepend=-1))
        return np.append(begin, order.size).astype(np.int32), order

    def select(self, places: Ints) -> Roles:
        """The roles of these unknowns; a group of which others leave is none."""
        # groups that lose members are none
        common = self.common
        if (common >= 0).any():
            common = np.where(np.isin(common, np.delete(common, places)), -1, common)
        arrays = (common if f.name == "common" else whole_of(getattr(self, f.name)) for f in fields(Roles))
        return Roles(*(np.ascontiguousarray(array[places]) for array in arrays))


def general_rates(system: System, t: float, y: Floats, yd: Floats, jyd: Floats) -> Floats:
    """dF/dyd [entries] for `roles`: of the start, or of a point beside it where inertias vanish at the start alone."""
    flows, displaced = system.are("f"), system.are("q")
    # no displacements, or no inertia that vanishes here
    if not displaced.any() or not (system.structural()[1] & (jyd == 0.0) & flows[system.pattern.columns_of()]).any():
        return jyd
    # a point beside the start
    part = 0.5 + 0.5 * uniform(y.size, 0, 0)
    beside = np.where(displaced, y + BESIDE * group_maximum(system, np.abs(y)) * part, y)
    with np.errstate(all="ignore"):
        _, found = system.jacobian(t, beside, yd)
    return found if np.isfinite(found).all() else jyd


def roles(system: System, t: float, jyd: Floats, index: int) -> Roles:
    """Roles in one form at index `index` of that form (as written: the model's; 2: 2; 1: 1).

    t, jyd: of the start; dF/dyd shows the flows with inertia (`general_rates`).
    """
    flows, implicit = system.are("f"), system.are("e")
    differential = system.differential(jyd)
    smooth = unique(system, jyd)
    state = system.are("q", "p", "s") | (flows & _inertial(system, jyd))
    # the error test sees states and what has rates
    stepped = state | (flows & differential)  # of index 1 and 0 also those whose rates derived constraints hold
    test = np.where(stepped, np.int8(0), np.int8(-1))
    power = np.zeros(system.unknowns, dtype=np.int8)
    multiplier = system.are("kappa", "mu", "nu")
    # index 2: multipliers and implicit efforts move with 1/h
    if index >= 2:
        steep = np.zeros(system.unknowns, dtype=bool)
        if system.form.scales:
            steep[system.pattern.columns_of()[system.steep_rows(t)[system.pattern.row]]] = True
        power[multiplier | ((implicit | (flows & ~differential)) & ~steep)] = 1
        # flows that stores know by differences alone: what they have in common is a rate of what balances hold; where
        # plain differences are states (`common`), these are tested as they are
        shared = flows & state & ~smooth
        power[shared] = test[shared] = 1
    # index 3: multipliers with 1/h^2, flows with 1/h
    if index >= 3:
        power[system.are("kappa", "mu")] = 2
        power[system.are("f", "p") & state] = 1
        test[system.are("f", "p") & state] = 1
    # nothing has a rate: flows are tested
    if not stepped.any():
        test[flows] = 0
    # nothing is tested: everything is
    if (test < 0).all():
        test[:] = 0
    idle = multiplier | implicit | (flows & ~differential)
    alone = np.zeros_like(flows) if index > 2 else flows & (state if index == 2 else stepped) & ~smooth
    common = _common(system, jyd, alone)
    return Roles(test, power, state, differential, smooth, idle, common)


def _inertial(system: System, jyd: Floats) -> NDArray[np.bool_]:
    """Unknowns whose derivative occurs in a balance: rates that derived constraints alone hold carry nothing across a
    jump.
    """
    there = (jyd != 0.0) & system.of_groups("dynamics")[system.pattern.row]
    found = np.zeros(system.unknowns, dtype=bool)
    found[system.pattern.columns_of()[there]] = True
    return found


def _common(system: System, jyd: Floats, shared: NDArray[np.bool_]) -> Ints:
    """Group of each unknown (-1: none): components of dF/dyd within `shared` all of whose rows sum to zero."""
    if not shared.any():
        return np.broadcast_to(np.int32(-1), system.unknowns)
    found = np.full(system.unknowns, -1, dtype=np.int32)
    column, row = system.pattern.columns_of(), system.pattern.row
    # rows that read rates of shared flows
    there = jyd != 0.0
    read = np.zeros(system.rows, dtype=bool)
    read[row[there & shared[column]]] = True
    there &= read[row]
    row, column, value = row[there], column[there], jyd[there]
    group = components(row, column, system.unknowns)
    # rows that sum to zero know differences alone
    total = np.bincount(row, value, system.rows), np.bincount(row, np.abs(value), system.rows)
    other = (np.abs(total[0]) > BALANCED * total[1])[row] | ~shared[column]
    good = ~np.isin(group[column], group[column[other]])
    found[column[good]] = group[column[good]]
    return found


def without_rate(found: Roles, flows: NDArray[np.bool_]) -> Roles:
    """The roles where these flows are solved for at each point: they carry nothing and are not tested."""
    return replace(
        found,
        test=np.where(flows, -1, found.test).astype(np.int8),
        held_state=found.state & ~flows,
        held_differential=found.differential & ~flows,
        smooth=found.smooth & ~flows,
        idle=found.idle | flows,
        common=np.broadcast_to(np.int32(-1), found.common.size),
    )
