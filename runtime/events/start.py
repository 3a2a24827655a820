"""A consistent start with the constraints that hold at it: complementarity over starts."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.determined import Determined
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.pivoting import NoActiveSetError, Settle
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import InconsistentStart
from sysdyn.runtime.model.scales import magnitudes
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState, consistent_start

AHEAD = (1e-8, 1e-5)
"""Of the time in which the unknowns change: how far ahead a tie between active sets is looked at, where sources alone
have moved.
"""
BETWEEN = 3
"""Points of sets that ask for each other, near which one is sought."""
SPAN = 1.0
"""s: in which what starts at rest may come to its magnitude."""


def eventful_start(system: System, t0: float, plan: Plan, until: float | None = None) -> ConsistentState:
    """A state at t0 with the active set and the senses that fit it, which the model then has.

    Constants of integrated constraints are those of the guess.  Where it is not the start (capacitors alone at a node,
    in loops), they are what follows: the constraint is its own integral, whatever it is at the start.
    until: as in consistent_start.  Raises InconsistentStart; SolverFailure (max_wall).
    """
    none: InconsistentStart | None = None
    if system.description.constants:
        try:
            found = _fitting(system, t0, plan, until, constants=False)
            if not found.displaced:
                return found
        except InconsistentStart as error:
            none = error
        system.own_numbers()  # the constants are written there
        p = system.description.p
        stood = p.copy()
        with suppress(InconsistentStart):
            return _fitting(system, t0, plan, until, constants=True)
        p[:] = stood  # sets that were tried have left theirs
    if none is not None:
        raise none
    return _fitting(system, t0, plan, until, constants=False)


def _fitting(system: System, t0: float, plan: Plan, until: float | None, *, constants: bool) -> ConsistentState:
    """The same; constants: those of integrated constraints are found too.  Active sets that contradict themselves have
    no start, which takes long to be sure of: first those are tried that have one at once.
    """
    if not plan.contacts:
        return consistent_start(system, t0, until=until, constants=constants)
    with suppress(InconsistentStart):
        return _pivoted(system, t0, plan, until, constants=constants, quickly=True)
    return _pivoted(system, t0, plan, until, constants=constants, quickly=False)


def _pivoted(
    system: System, t0: float, plan: Plan, until: float | None, *, constants: bool, quickly: bool
) -> ConsistentState:
    """The same; quickly: each set by the first strategy of a start alone.

    Where the least change of one set asks for another, and that for the first again, both hold at the point between
    them: a capacitor that a diode charges up to its source, which falls.  It is sought near what such a set asked for.
    """
    contacts = Contacts(plan, system, Observer(system), system.description.p, starting=True)
    zeros = np.zeros(system.form.written)
    found: list[ConsistentState] = []
    errors: list[InconsistentStart] = []
    near: ConsistentState | None = None
    known = dict[tuple[float, tuple[float, ...]], ConsistentState | None]()  # by instant and set

    def started(t: float) -> ConsistentState | None:
        try:
            return consistent_start(system, t, near, until, constants=constants, quickly=quickly)
        except InconsistentStart as error:
            errors.append(error)
            return None

    def settle(t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats, Floats] | None:
        which = t, contacts.state()
        if constants or which not in known:  # these are written where it is found
            known[which] = started(t)
        state = known[which]
        if state is None:
            return None
        found.append(state)
        y, yd = state.y, state.yd
        contacts.size(*magnitudes(system, t, t + SPAN, y, yd))
        return y, yd, np.zeros_like(zeros)

    def fitted() -> ConsistentState:
        contacts.begin()
        values = contacts.observer(t0, zeros, zeros)
        for k, contact in enumerate(plan.contacts):
            if contact.kind == "guarded":
                contacts.active[k] = bool(values[contact.guard])
        determined = Determined(contacts)
        y, yd = determined.fit(t0, zeros, zeros, settle)
        if _tied(contacts, contacts.observer(t0, y, yd)):
            y = _ahead(contacts, determined, t0, settle, y)
        return next(state for state in reversed(found) if state.y is y)

    try:
        return fitted()
    except NoActiveSetError as error:
        # that of the set that follows from what is wrong: those behind it are tried beside it
        failed = errors[0] if errors else InconsistentStart("stuck", float("inf"), names=error.names)
    for asked in found[: -1 - BETWEEN : -1] if quickly else ():
        near = asked
        known.clear()
        with suppress(NoActiveSetError):
            return fitted()
    raise failed


def _tied(contacts: Contacts, values: Floats) -> bool:
    """Whether some ideal diode or valve may hold or not at the start: nothing flows through it, nothing holds it."""
    zero = contacts.observer.zero
    return any(
        c.kind == "psi" and all(abs(values[row]) <= zero(row) for row in (c.value, c.rate, c.multiplier))
        for c in contacts.contacts
    )


def _ahead(contacts: Contacts, determined: Determined, t0: float, settle: Settle, y: Floats) -> Floats:
    """The point at t0 with the active set that fits these initial values a little later, where it fits at t0 too; y
    where none does.
    """
    stood, zeros, time = contacts.state(), np.zeros_like(y), contacts.time
    for later in AHEAD:
        with suppress(NoActiveSetError):
            determined.fit(t0 + later * time, zeros, zeros, settle)
            point = settle(t0, zeros, zeros) if contacts.state() != stood else None
            if point is not None and contacts.fits(t0, zeros, point) and not determined.leaves(t0, *point[:2]):
                return point[0]
        contacts.become(stood)
    point = settle(t0, zeros, zeros)  # constants of the start are those of t0
    return y if point is None else point[0]
