"""A consistent start with the constraints that hold at it: complementarity over starts."""

from __future__ import annotations

import itertools
from contextlib import suppress
from dataclasses import replace

import numpy as np
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.determined import Determined
from sysdyn.runtime.events.handler import Handler, Standing
from sysdyn.runtime.events.implicit import DENSE
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.pivoting import NoActiveSetError, Pivoting, Settle
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import InconsistentStart, SolverFailure
from sysdyn.runtime.model.scales import magnitudes
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.start.start import ConsistentState, consistent_start

SAMPLES = 4
"""Points whose samples at the start are asked for: what a converter samples of its own output is what it starts with.
"""
AHEAD = (1e-8, 1e-5)
"""Of the time in which the unknowns change: how far ahead a tie between active sets is looked at, where sources alone
have moved.
"""
BETWEEN = 3
"""Points of sets that ask for each other, near which one is sought."""
SHORT, LEAST = (1e-7, 1e-9, 1e-5, 1e-3), 1e-3
"""Of that time, but of so much (s) at least (what leaks tell is no time of the rest): implicit steps that say which set
begins.
"""
LONGER = 100.0
"""Times such a step: one whose set a shorter one is begun with."""
TURNS = 4
"""Sets that are tried behind such a step."""
SPAN = 1.0
"""s: in which what starts at rest may come to its magnitude."""


def eventful_start(system: System, t0: float, plan: Plan, until: float | None = None) -> ConsistentState:
    """A state at t0 with the active set and the senses that fit it, which the model then has.

    Where samples due at t0 turn what holds, and what held before them has no start, or one that is not as guessed, it
    is the one behind them, if that is as guessed: nothing moves while no time passes (a charge pump by switches whose
    pulses begin at t0).  until: as in consistent_start.  Raises InconsistentStart; SolverFailure (max_wall).
    """
    found = _sampled_start(system, t0, plan, until)
    if system.unknowns > LARGE:
        found.put_away()
    return found


def _sampled_start(system: System, t0: float, plan: Plan, until: float | None) -> ConsistentState:
    begun: Standing | None = None
    if plan.sampled and any(c.kind == "guarded" for c in plan.contacts):
        system.own_numbers()
        begun = _standing(system)
    found: ConsistentState | None = None
    try:
        found = _integrated(system, t0, plan, until)
    except InconsistentStart:
        if begun is None:
            raise
    if begun is None or (found is not None and not _moved(found)):
        assert found is not None
        return found
    return _behind_samples(system, t0, plan, until, begun, found)


def _standing(system: System) -> Standing:
    """Parameters and active switches as they are."""
    return system.description.p.copy(), system.description.switches.active.copy()


def _moved(state: ConsistentState) -> bool:
    """Whether it is not as guessed."""
    return state.displaced or bool(state.moved)


def _behind_samples(
    system: System, t0: float, plan: Plan, until: float | None, begun: Standing, found: ConsistentState | None
) -> ConsistentState:
    """The start behind samples due at t0, which assign what they do at that very point, if it is as guessed; else the
    one before them.  begun: as the text begins; found: the one before, None: there is none.  Raises InconsistentStart.
    """
    stood, failed = _standing(system), InconsistentStart("stuck", np.inf)
    handler = Handler(plan, system, (t0, t0), begun)
    y, yd = (found.y, found.yd) if found is not None else (np.zeros(system.form.written),) * 2
    behind: tuple[ConsistentState, Standing, Floats] | None = None
    try:
        for _ in range(SAMPLES):
            handler.back(begun)
            places = handler.sampled(t0, y, yd)
            assigned = system.description.p[places or []]
            if behind is not None and np.array_equal(assigned, behind[2]):
                handler.back(behind[1])
                return replace(behind[0], sampled=True)
            state = _integrated(system, t0, plan, until)  # where samples assign nothing, for the word why there is none
            if not places or (found is not None and _moved(state)):
                break
            behind = state, handler.now(), assigned
            y, yd = state.y, state.yd
    except InconsistentStart as error:
        failed = error
    except SolverFailure as failure:
        if failure.cause == "max_wall":
            raise
    handler.back(stood)
    if found is None:
        raise failed
    return found


def _integrated(system: System, t0: float, plan: Plan, until: float | None) -> ConsistentState:
    """The same, whatever samples do.

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

    First what stores hold stays as it is guessed, or moves by impulses of the inequalities alone: the set behind a
    short implicit step from there says which hold.  Else by turning those that do not fit, of starts that each set has.
    Where the least change of one set asks for another, and that for the first again, both hold at the point between
    them: a capacitor that a diode charges up to its source, which falls.  It is sought near what such a set asked for.
    """
    starts = _Starts(system, t0, plan, until, constants=constants, quickly=quickly)
    try:
        return starts.fitted(starts.held())
    except NoActiveSetError as error:
        failed = starts.failure(error)
    for asked in starts.found[: -1 - BETWEEN : -1] if quickly else ():
        with suppress(NoActiveSetError):
            return starts.fitted(near=asked)
    raise failed


class _Starts:
    """Of a model at t0 by its active sets; found, errors: in the order in which they were sought."""

    def __init__(
        self, system: System, t0: float, plan: Plan, until: float | None, *, constants: bool, quickly: bool
    ) -> None:
        self.contacts = Contacts(plan, system, Observer(system), system.description.p, starting=True)
        self.found: list[ConsistentState] = []
        self.errors: list[InconsistentStart] = []
        self._t, self._until, self._constants, self._quickly = t0, until, constants, quickly
        self._zeros = np.zeros(system.form.written)
        self._near: ConsistentState | None = None
        self._known = dict[tuple[float, tuple[float, ...]], ConsistentState | None]()  # by instant and set

    def failure(self, error: NoActiveSetError) -> InconsistentStart:
        """That of the set that follows from what is wrong: those behind it are tried beside it."""
        return self.errors[0] if self.errors else InconsistentStart("stuck", float("inf"), names=error.names)

    def _sought_near(self, near: ConsistentState | None) -> None:
        """What stores are guessed to hold from now on; None: as the text says."""
        self._near = near
        self._known.clear()

    def _started(self, t: float, jumped: tuple[Floats, Floats] | None = None) -> ConsistentState | None:
        """That of the present set, the first failure with a word why; jumped: points behind an impulse that say which
        stores move.
        """
        try:
            return consistent_start(
                self.contacts.system,
                t,
                self._near,
                self._until,
                constants=self._constants,
                quickly=self._quickly,
                silent=bool(self.errors),
                jumped=jumped,
            )
        except InconsistentStart as error:
            if jumped is None:
                self.errors.append(error)
            return None

    def _settle(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats, Floats] | None:
        which = t, self.contacts.state()
        if self._constants or which not in self._known:  # these are written where it is found
            self._known[which] = self._started(t)
        state = self._known[which]
        if state is None:
            return None
        self.found.append(state)
        self._size(t, state.y, state.yd)
        return state.y, state.yd, np.zeros_like(self._zeros)

    def _size(self, t: float, y: Floats, yd: Floats) -> None:
        self.contacts.size(*magnitudes(self.contacts.system, t, t + SPAN, y, yd))

    def held(self) -> Floats | None:
        """What the guesses say of a point [unknowns as written] where inequalities of flows ask for nothing; None:
        there are none, or too many unknowns for implicit steps, or there is no such point.
        """
        self._begin()
        contacts = self.contacts
        free = [c.number for k, c in enumerate(contacts.contacts) if c.kind == "psi" and not contacts.barred[k]]
        if not free or contacts.system.unknowns > DENSE:
            return None
        try:
            state = consistent_start(contacts.system, self._t, until=self._until, quickly=True, without=free)
        except InconsistentStart:
            return None
        self._size(self._t, state.y, state.yd)
        return state.y

    def _begin(self) -> None:
        """Nothing holds but what the text says."""
        contacts = self.contacts
        contacts.begin()
        contacts.obey(contacts.observer(self._t, self._zeros, self._zeros))

    def fitted(self, held: Floats | None = None, near: ConsistentState | None = None) -> ConsistentState:
        """A state whose set fits; NoActiveSetError.  held: the point that a first set is told from; near: which point
        is sought.
        """
        self._sought_near(near)
        determined, contacts = Determined(self.contacts), self.contacts
        if held is None or not self._behind_steps(determined.pivoting, held):
            self._begin()
        else:
            self._let_go(determined)
        y, yd = determined.fit(self._t, self._zeros, self._zeros, self._settle)
        if _tied(contacts, contacts.observer(self._t, y, yd)):
            y = _ahead(contacts, determined, self._t, self._settle, y)
        return next(state for state in reversed(self.found) if state.y is y)

    def _behind_steps(self, pivoting: Pivoting, held: Floats) -> bool:
        """Whether a set that a short implicit step from there asks for fits, which the model then has: with stores as
        they are guessed, or as impulses leave them.
        """
        contacts, t = self.contacts, self._t
        known, time = contacts.observer.largest.copy(), max(contacts.time, LEAST)
        parts = SHORT if self._quickly else SHORT[:1]  # it takes long to be sure that a set has no start
        told = dict[float, tuple[Floats, tuple[float, ...], Floats]]()  # point, set and sizes behind each step
        for jumps, part in itertools.product((False, True), parts):
            h = part * time
            if not jumps and (point := self._behind(pivoting, held, h, SHORT[-1] * time)) is not None:
                told[h] = point, contacts.state(), contacts.observer.largest.copy()
            if h not in told:
                continue
            behind, state, contacts.observer.largest[:] = told[h]
            contacts.become(state)
            self._sought_near(self._jumped(pivoting, held, behind, 0.5 * h) if jumps else None)
            pivoting.ahead(t, behind, h)  # impulses are over then
            if self._nearly_fits(kept=not jumps):
                return True
            contacts.observer.largest[:] = known
        self._sought_near(None)
        return False

    def _behind(self, pivoting: Pivoting, held: Floats, h: float, longest: float) -> Floats | None:
        """The point behind an implicit step of h (s) from there, whose set the model then has: where leaks and impulses
        are too far apart for one, begun with the set behind a longer one.
        """
        self._begin()
        behind = pivoting.ahead(self._t, held, h, self._t)
        if behind is None and h < longest and self._behind(pivoting, held, LONGER * h, longest) is not None:
            behind = pivoting.ahead(self._t, held, h, self._t)
        return behind

    def _let_go(self, determined: Determined) -> None:
        """Frees what holds without a flow, where that leaves something open: which one holds it is asked again."""
        contacts, t, zeros = self.contacts, self._t, self._zeros
        found = self._settle(t, zeros, zeros)
        assert found is not None  # it fits
        values, zero = contacts.observer(t, *found[:2]), contacts.observer.zero
        for k, c in enumerate(contacts.contacts):
            if c.kind != "psi" or not contacts.active[k] or abs(values[c.multiplier]) > zero(c.multiplier):
                continue
            before = contacts.state()
            contacts.flip(k, values)
            contacts.apply()
            if determined.nullity(t, *found[:2]) > 0:
                free = self._settle(t, zeros, zeros)
                if free is not None and contacts.fits(t, zeros, free):
                    continue
            contacts.become(before)

    def _jumped(self, pivoting: Pivoting, held: Floats, behind: Floats, half: float) -> ConsistentState | None:
        """What the impulses of the present set leave, where a step of half (s) tells as well which stores move."""
        during = self.contacts.state()
        again = pivoting.ahead(self._t, held, half, self._t)
        self.contacts.become(during)
        return None if again is None else self._started(self._t, (behind, again))

    def _nearly_fits(self, *, kept: bool) -> bool:
        """Whether the set fits, or one a few turns away (what leaks decide is behind a step); kept: of those that leave
        stores as they are guessed.
        """
        contacts, t, zeros = self.contacts, self._t, self._zeros
        for _ in range(TURNS):
            found = self._settle(t, zeros, zeros)
            if found is None or (kept and not self.found[-1].kept):
                return False
            if contacts.fits(t, zeros, found):
                return True
            values = contacts.observer(t, *found[:2])
            contacts.turn(contacts.wrong(values, found[2]), values)
            contacts.apply()
        return False


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
