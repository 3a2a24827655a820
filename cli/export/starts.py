"""The tables by which an exported model finds a start at other parameters than those it was bound to.

The problem is that of runtime/start: unknowns, rows and weights are the starter's own at the known start; what
is given anew are the initial values, by formulas.
"""

from __future__ import annotations

import numpy as np
from sysdyn.cli.export.tables import Stage, StartTables, assembly_tables
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.start.starter import Mask, Starter

LARGEST = 1500
"""Unknowns and rows up to which a start is sought outside: with full matrices."""


def start_tables(system: System, state: ConsistentState) -> StartTables | None:
    """The problem of a start; None where it is too large, or has rows that only the runtime forms."""
    starter = Starter(system)
    if starter.summed or max(starter.equations.unknowns, starter.settled.rows) > LARGEST:
        return None
    x = starter.unknowns(state.t, state.y, state.yd)
    problem = problem_of(starter, state.t, x, x, rows=starter.every, free=starter.free)
    return StartTables(
        assembly_tables(starter.settled),
        starter.n,
        starter.rates.astype(np.int32),
        np.flatnonzero(starter.written[: starter.n]).astype(np.int32),
        starter.system.form.k_q,
        starter.system.form.k_f,
        x,
        problem.scale,
        problem.weight,
        tuple(_stages(starter, state.t, x, starter.free)),
    )


def _stages(starter: Starter, t: float, x: Floats, free: Mask) -> list[Stage]:
    """Onto guessed expressions, then onto all rows: what follows from the state alone where that is enough."""
    follows = starter.following(t, x)
    found = []
    if starter.told.any():
        rows = starter.told | starter.groups("phi", "psi")
        own = free & (np.arange(free.size) < starter.n) & ~starter.moves("slack", "unsaid")
        found.append(Stage(((_places(rows), _places(own)),), guess=True))
    every = _places(starter.every)
    found.append(Stage(((every, _places(free & follows)), (every, _places(free)))))
    return found


def _places(mask: Mask) -> Ints:
    return np.flatnonzero(mask).astype(np.int32)
