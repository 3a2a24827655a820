"""How fast what disturbs a state of rest grows: where it does, rounding alone decides that a run stays there."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.linear.pencil import motions
from sysdyn.runtime.linear.states import candidates_of
from sysdyn.runtime.linear.tangent import NoLinearisation
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.start.start import ConsistentState


def growth(system: System, rest: ConsistentState) -> tuple[float, str]:
    """The largest real part of an eigenvalue (1/s) of the equations beside a state of rest, and the unknown that most
    of that motion is; 0.0 and "" where none grows, or the linearisation is not regular.  system: the form as written.
    """
    n = system.form.written
    with np.errstate(all="ignore"):
        jy, jyd = (system.dense(part)[:, :n] for part in system.jacobian(rest.t, rest.y, rest.yd))
        # no slopes, or a form that is not square
        if not (np.isfinite(jy).all() and np.isfinite(jyd).all()) or jy.shape[0] != n:
            return 0.0, ""
        try:
            v, w, column = motions(jyd, -jy)
        # a pencil without finite linearisation
        except (NoLinearisation, ArithmeticError, np.linalg.LinAlgError):
            return 0.0, ""
    if not v.shape[1]:
        return 0.0, ""
    # x = v z on the finite motions; E v z' + ... = A v z solved for z'
    v, w = column[:, None] * v, column[:, None] * w
    both = np.hstack([jyd @ v, -jy @ w])
    row, _ = factors(both)
    small = np.linalg.solve(row[:, None] * both, row[:, None] * (-jy @ v))[: v.shape[1]]
    values, vectors = np.linalg.eig(small)
    k = int(np.argmax(values.real))
    # no eigenvalue in the right half plane
    if values[k].real <= 0.0:
        return 0.0, ""
    # the unknown that moves most in its own unit
    size = np.abs((v @ vectors[:, k]) / column)
    states = candidates_of(system, rest, n)
    return float(values[k].real), system.name(int(states[np.argmax(size[states])]))
