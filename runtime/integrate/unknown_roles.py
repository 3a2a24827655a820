"""Which unknowns the error test sees, and with which power of h Newton's test weighs them.

Error test: displacements, momenta, dynamic variables, flows with inertia.  Left out: multipliers, implicit efforts,
flows of massless coordinates (they follow from the others; their accuracy is that of the state, and on index 2 their
local error is one order larger than what it does to the solution).  Where nothing else is left, they are tested.
Newton's test: multipliers and other index-2 unknowns with h, index-3 multipliers with h^2 (Petzold & Lötstedt 1986):
their round-off grows as h falls, and the theory bounds what their error does to the state.  It does so for rows that
are nearly linear: an unknown of a steep law counts as it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System
from sysdyn.runtime.structure.rates import unique
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Roles:
    """test [unknowns]: -1 left out, 0 tested, 1 tested with h; power [unknowns]: of h in Newton's norm.

    state [unknowns]: carry the state; differential [unknowns]: their derivative occurs;
    smooth [unknowns]: it is determined; idle [unknowns]: steep laws may leave them open where their slopes underflow.
    """

    test: Ints
    power: Ints
    state: NDArray[np.bool_]
    differential: NDArray[np.bool_]
    smooth: NDArray[np.bool_]
    idle: NDArray[np.bool_]


def roles(system: System, t: float, jyd: Floats, index: int) -> Roles:
    """Roles in one form at index `index` of that form (as written: the model's; 2: 2; 1: 1).

    t, jyd: of the start, where dF/dyd shows the flows with inertia.
    """
    flows, implicit = system.are("f"), system.are("e")
    differential = system.differential(jyd)
    smooth = unique(system, jyd)
    state = system.are("q", "p", "s") | (flows & differential)
    test = np.where(state, 0, -1)
    power = np.zeros(system.unknowns, dtype=np.int32)
    multiplier = system.are("kappa", "mu", "nu")
    if index >= 2:
        steep = np.zeros(system.unknowns, dtype=bool)
        steep[system.pattern.columns_of()[system.steep_rows(t)[system.pattern.row]]] = True
        power[multiplier | ((implicit | (flows & ~differential)) & ~steep)] = 1
        # flows that stores know by differences alone: what they have in common is a rate of what balances hold
        shared = flows & state & ~smooth
        power[shared] = test[shared] = 1
    if index >= 3:
        power[system.are("kappa", "mu")] = 2
        power[system.are("f", "p") & state] = 1
        test[system.are("f", "p") & state] = 1
    if not state.any():
        test[flows] = 0
    if (test < 0).all():
        test[:] = 0
    idle = multiplier | implicit | (flows & ~differential)
    return Roles(test.astype(np.int32), power, state, differential, smooth, idle)


def without_rate(found: Roles, flows: NDArray[np.bool_]) -> Roles:
    """The roles where these flows are solved for at each point: they carry nothing and are not tested."""
    return replace(
        found,
        test=np.where(flows, -1, found.test).astype(np.int32),
        state=found.state & ~flows,
        differential=found.differential & ~flows,
        smooth=found.smooth & ~flows,
        idle=found.idle | flows,
    )
