"""Implicit unknowns that the equations leave open at a state alone (language, E505).

A gamma may leave out its own unknown (a controlled flow source does), and its slope may vanish at a point (a valve at
rest): then the rest of the model must determine the unknown.  Where it does not, the pencil is singular there and
regular beside it.  Of an element's own law that is monotone nothing is asked: a valve at rest passes nothing.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.scales import balanced_sizes
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.structure import Structure, null_place

DENSE = tuning.NULL_SPACE
"""Unknowns up to which null vectors are taken."""
BESIDE = tuning.UNSEEN
"""Of its size, how far beside: a slope there is no round-off, and the exponential of a diode notices little."""


def undetermined_implicits(system: System, state: ConsistentState, facts: Structure) -> tuple[str, ...]:
    """Implicit unknowns that a null vector of the pencil moves at the state, and none where these are others; system:
    the form as written.
    """
    # an index and nothing undetermined: nothing is open
    if facts.index is not None and not facts.undetermined:
        return ()
    implicit = np.flatnonzero(system.are("e"))
    # with an index: those of no law are open by themselves
    if facts.index is not None:
        laws = {row.label for row in system.description.rows if row.block == "gamma"}
        found = (name for name in map(system.name, implicit.tolist()) if name in facts.undetermined)
        return tuple(name for name in found if f"{name.partition('[')[0].removesuffix('.e')}.law" not in laws)
    # nothing implicit, or too large to ask
    if not implicit.size or system.unknowns > DENSE:
        return ()
    y, yd = state.for_form(system)
    clean, slopes = state.without_noise(y), system.jacobian(state.t, y, yd)
    # those that a null vector moves at the state
    open_ = null_place(system, *slopes)[0]
    mine = [k for k in implicit.tolist() if system.name(k) in open_]
    # beside it: a law that is flat at the state alone determines them
    beside = y.copy()
    beside[mine] += BESIDE * balanced_sizes(system, clean, system.jacobian(state.t, clean, yd)[0])[mine]
    left = null_place(system, *system.jacobian(state.t, beside, yd))[0] if mine else ()
    return tuple(name for name in map(system.name, mine) if name not in left)
