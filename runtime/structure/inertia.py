"""The inertia matrix at a state: whether T* has a minimum (language, E321)."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.inertia import inertia, own_inertia
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState

DENSE = tuning.DENSE
NEGATIVE = tuning.SAME
"""Eigenvalues below minus this part of the largest are negative."""


def negative_inertia(system: System, state: ConsistentState) -> tuple[str, float] | None:
    """The flow that moves most along a direction in which the inertia is negative, and the inertia n^T M n there, where
    this flow is one (SI); None where there is none.

    system: the form as written.  Models of more than DENSE flows are judged by their diagonal.
    """
    flows = np.flatnonzero(system.are("f"))
    if not flows.size:
        return None
    slopes = system.jacobian(state.t, *state.for_form(system))
    # of a large model its diagonal alone
    if flows.size > DENSE:
        diagonal = own_inertia(system, *slopes)[flows]
        k = int(np.argmin(diagonal))
        return (system.name(int(flows[k])), float(diagonal[k])) if diagonal[k] < 0.0 else None
    m = inertia(system, *slopes)
    # momenta that do not determine flows: not judged
    if not np.isfinite(m).all():
        return None
    diagonal = np.diag(m)
    if (2.0 * diagonal > np.abs(m).sum(axis=1)).all() and (m == m.T).all():
        return None  # what dominates its rows has a minimum (Gershgorin)
    # scaled to a unit diagonal, so that grams and tons are judged alike
    scale = 1.0 / np.sqrt(np.where(np.abs(np.diag(m)) > 0.0, np.abs(np.diag(m)), 1.0))
    found, vectors = np.linalg.eigh(0.5 * (m + m.T) * scale[:, None] * scale[None, :])
    # positive, or zero to round-off
    if found[0] >= -NEGATIVE * max(abs(found[-1]), NEGATIVE):
        return None
    # in the unit of the flow that moves most
    k = int(np.argmax(np.abs(vectors[:, 0])))
    along = scale * vectors[:, 0]
    along /= along[k]
    return system.name(int(flows[k])), float(along @ m @ along)
