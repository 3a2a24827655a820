"""A consistent start with the constraints that hold at it: complementarity over starts."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.determined import Determined
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.pivoting import NoActiveSetError
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import InconsistentStart
from sysdyn.runtime.model.scales import magnitudes
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState, consistent_start

SPAN = 1.0
"""s: in which what starts at rest may come to its magnitude."""


def eventful_start(system: System, t0: float, plan: Plan, until: float | None = None) -> ConsistentState:
    """A state at t0 with the active set and the senses that fit it, which the model then has.

    until: as in consistent_start.  Raises InconsistentStart; SolverFailure (max_wall).
    """
    if not plan.contacts:
        return consistent_start(system, t0, until=until)
    contacts = Contacts(plan, system, Observer(system), system.description.p, starting=True)
    contacts.begin()
    zeros = np.zeros(system.form.written)
    values = contacts.observer(t0, zeros, zeros)
    for k, contact in enumerate(plan.contacts):
        if contact.kind == "guarded":
            contacts.active[k] = bool(values[contact.guard])
    found: list[ConsistentState] = []
    errors: list[InconsistentStart] = []

    def settle(t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats, Floats] | None:
        try:
            found.append(consistent_start(system, t, until=until))
        except InconsistentStart as error:
            errors.append(error)
            return None
        y, yd = found[-1].y, found[-1].yd
        contacts.size(*magnitudes(system, t, t + SPAN, y, yd))
        return y, yd, np.zeros_like(zeros)

    try:
        y, _ = Determined(contacts).fit(t0, zeros, zeros, settle)
    except NoActiveSetError as error:
        raise errors[-1] if errors else InconsistentStart("stuck", float("inf"), names=error.names) from error
    return next(state for state in reversed(found) if state.y is y)
