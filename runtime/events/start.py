"""A consistent start with the constraints that hold at it: complementarity over starts."""

from __future__ import annotations

from contextlib import suppress

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

    Constants of integrated constraints are what the text says of displacements, zero of those of which it says nothing.
    Where fixed values and loops of stores ask for others (of three capacitors on a node two side by side, one of them
    fixed), they are what follows: the constraint is its own integral, whatever it is at the start.
    until: as in consistent_start.  Raises InconsistentStart; SolverFailure (max_wall).
    """
    try:
        return _fitting(system, t0, plan, until, constants=False)
    except InconsistentStart:
        if not system.description.constants:
            raise
        system.own_numbers()  # the constants are written there
        with suppress(InconsistentStart):
            return _fitting(system, t0, plan, until, constants=True)
        raise


def _fitting(system: System, t0: float, plan: Plan, until: float | None, *, constants: bool) -> ConsistentState:
    """The same; constants: those of integrated constraints are found too."""
    if not plan.contacts:
        return consistent_start(system, t0, until=until, constants=constants)
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
            found.append(consistent_start(system, t, until=until, constants=constants))
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
