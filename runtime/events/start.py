"""A consistent start with the constraints that hold at it: complementarity over starts."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.events.contacts import FAINT, Contacts
from sysdyn.runtime.events.determined import Determined
from sysdyn.runtime.events.handler import Handler, Standing
from sysdyn.runtime.events.implicit import DENSE
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.pivoting import NoActiveSetError, Pivoting, Settle
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import InconsistentStart, SolverFailure
from sysdyn.runtime.model.scales import alike, largest_of_group, magnitudes
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.work import Budget
from sysdyn.runtime.start.start import ConsistentState, consistent_start

SAMPLES = 4
"""Points whose samples at the start are asked for: what a converter samples of its own output is what it starts with.
"""
AHEAD = (tuning.HALF_OF_ITS_DIGITS, 1e-5)
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
HOLD = ("psi", "friction")
"""Kinds of contacts that all hold where a nearer state is sought."""
BESIDE = 8
"""Contacts up to which sets are tried in which one of them stands otherwise."""
SETS, SWIFTLY = 3.0, 1.2
"""Times what a search may take: what is spent on all sets, on those that may have a start at once."""
TURNS = 4
"""Sets that are tried behind such a step."""


def eventful_start(system: System, t0: float, plan: Plan, budget: Budget | None = None) -> ConsistentState:
    """A state at t0 with the active set and the senses that fit it, which the model then has.

    Where samples due at t0 turn what holds, and what held before them has no start, or one that is not as guessed, it
    is the one behind them, if that is as guessed: nothing moves while no time passes (a charge pump by switches whose
    pulses begin at t0).  budget: as in consistent_start.  Raises InconsistentStart; SolverFailure (max_wall).
    """
    found = _sampled_start(system, t0, plan, Budget() if budget is None else budget)
    if system.unknowns > LARGE:
        found.put_away()
    return found


def _sampled_start(system: System, t0: float, plan: Plan, budget: Budget) -> ConsistentState:
    """The start with the active set that fits, behind samples due at t0 where these are wanted."""
    begun: Standing | None = None
    # one budget for all sets
    if plan.contacts:
        budget = budget.part(SETS)
    # samples may turn what holds: the text's numbers are needed again
    if plan.sampled and any(c.kind == "guarded" for c in plan.contacts):
        system.own_numbers()
        begun = _standing(system)
    found: ConsistentState | None = None
    try:
        found = _integrated(system, t0, plan, budget)
    except InconsistentStart:
        # no samples that could help
        if begun is None:
            raise
    if begun is None or (found is not None and found.kept):
        assert found is not None
        return found
    return _behind_samples(system, t0, plan, budget, begun, found)


def _standing(system: System) -> Standing:
    """Parameters and active switches as they are."""
    return system.description.p.copy(), system.description.switches.active.copy()


def _behind_samples(
    system: System, t0: float, plan: Plan, budget: Budget, begun: Standing, found: ConsistentState | None
) -> ConsistentState:
    """The start behind samples due at t0, which assign what they do at that very point, if it is as guessed; else the
    one before them.  begun: as the text begins; found: the one before, None: there is none.  Raises InconsistentStart.
    """
    stood, failed = _standing(system), InconsistentStart("stuck", np.inf)
    handler = Handler(plan, system, (t0, t0), begun)
    y, yd = (found.y, found.yd) if found is not None else (np.zeros(system.form.written),) * 2
    behind: tuple[ConsistentState, Standing, Floats] | None = None
    try:
        # until samples assign what they did before
        for _ in range(SAMPLES):
            handler.back(begun)
            places = handler.assign_samples(t0, y, yd)
            assigned = system.description.p[places or []]
            if behind is not None and np.array_equal(assigned, behind[2]):
                handler.back(behind[1])
                return replace(behind[0], sampled=True)
            # where samples assign nothing, for the word why there is none
            state = _integrated(system, t0, plan, budget)
            # they assign nothing, or the start behind them is farther off
            if not places or (found is not None and not state.kept):
                break
            behind = state, handler.now(), assigned
            y, yd = state.y, state.yd
    except InconsistentStart as error:
        failed = error
    except SolverFailure as failure:
        # time is up: no further search
        if failure.cause == "max_wall":
            raise
    handler.back(stood)
    if found is None:
        raise failed
    return found


def _integrated(system: System, t0: float, plan: Plan, budget: Budget) -> ConsistentState:
    """The start with the active set that fits, whatever samples do.

    Constants of integrated constraints are what follows from the start: such a constraint is its own integral, whatever
    it is there, and the complementary forms have none.  Active sets that contradict themselves have no start, which
    takes long to be sure of: first those are tried that have one at once.
    budget: as in consistent_start.  Raises InconsistentStart; SolverFailure (max_wall).
    """
    constants = bool(system.description.constants)
    if constants:
        system.own_numbers()  # they are written there
    # without contacts: one start
    if not plan.contacts:
        return consistent_start(system, t0, budget=budget, constants=constants)
    with suppress(InconsistentStart):
        return _pivoted(system, t0, plan, budget.part(SWIFTLY), quickly=True)
    return _pivoted(system, t0, plan, budget, quickly=False)


def _pivoted(system: System, t0: float, plan: Plan, budget: Budget, *, quickly: bool) -> ConsistentState:
    """By active sets; quickly: each set by the first strategy of a start alone.

    First what stores hold stays as it is guessed, or moves by impulses of the inequalities alone: the set behind a
    short implicit step from there says which hold.  Else by turning those that do not fit, of starts that each set has.
    Where the least change of one set asks for another, and that for the first again, both hold at the point between
    them: a capacitor that a diode charges up to its source, which falls.  It is sought near what such a set asked for.
    """
    starts = _Starts(system, t0, plan, budget, quickly=quickly)
    try:
        # near guesses of stores first
        return starts.nearest(starts.fitted(starts.held()))
    except NoActiveSetError as error:
        failed = starts.failure(error)
    # between two sets that ask for each other
    for asked in starts.found[: -1 - BETWEEN : -1] if quickly else ():
        with suppress(NoActiveSetError):
            return starts.fitted(near=asked)
    raise failed


class _Starts:
    """Of a model at t0 by its active sets; found, errors: in the order in which they were sought."""

    def __init__(self, system: System, t0: float, plan: Plan, budget: Budget, *, quickly: bool) -> None:
        self.contacts = Contacts(plan, system, Observer(system), system.description.p, starting=True)
        self.found: list[ConsistentState] = []
        self.errors: list[InconsistentStart] = []
        self._t, self._budget, self._quickly = t0, budget, quickly
        pieces = [np.arange(first, first + number) for _, first, number in system.description.constants]
        self._constants = np.concatenate(pieces or [np.zeros(0, dtype=np.int64)])  # their places in p
        self._zeros = np.zeros(system.form.written)
        self._near: ConsistentState | None = None
        self._held: ConsistentState | None = None
        self._of_held = np.zeros(0)  # the constants there
        self._with = list[Floats]()  # those of what was found
        # by instant and set; with the constants that are written where a start is found
        self._known = dict[tuple[float, tuple[float, ...]], tuple[ConsistentState | None, Floats]]()

    def failure(self, error: NoActiveSetError) -> InconsistentStart:
        """That of the set that follows from what is wrong: those behind it are tried beside it."""
        return self.errors[0] if self.errors else InconsistentStart("stuck", float("inf"), names=error.names)

    def _sought_near(self, near: ConsistentState | None) -> None:
        """What stores are guessed to hold from now on; None: as the text says."""
        # starts known so far are near another point
        if near is not self._near:
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
                self._budget,
                constants=self._constants.size > 0,
                quickly=self._quickly,
                silent=bool(self.errors),
                jumped=jumped,
            )
        except InconsistentStart as error:
            # only real starts explain why there is none
            if jumped is None:
                self.errors.append(error)
            return None

    def _settle(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats, Floats] | None:
        """The consistent point of the present set at t, remembered, and no impulses; None: there is none."""
        which = t, self.contacts.state()
        if which not in self._known:
            self._known[which] = self._started(t), self.contacts.system.description.p[self._constants]
        state, constants = self._known[which]
        self._put(constants)
        if state is None:
            return None
        self.found.append(state)
        self._with.append(constants)
        self._size(t, state.y, state.yd)
        return state.y, state.yd, np.zeros_like(self._zeros)

    def _put(self, constants: Floats) -> None:
        """Constants of integrated constraints that the model then has."""
        if constants.size:
            self.contacts.system.description.p[self._constants] = constants

    def _size(self, t: float, y: Floats, yd: Floats) -> None:
        """What is as large as the largest of its like is no noise, however fast steep laws have it move."""
        system = self.contacts.system  # within 1 s what starts at rest may come to its magnitude
        magnitude, time = magnitudes(system, t, t + 1.0, y, yd)
        here = np.zeros(magnitude.size)
        here[: y.size] = np.abs(y)
        # of each group the largest
        here = largest_of_group(alike(system), here)
        self.contacts.size(np.minimum(magnitude, here / FAINT, out=magnitude, where=here > 0.0), time)

    def held(self) -> Floats | None:
        """What the guesses say of a point [unknowns as written] where inequalities of flows ask for nothing, or all
        hold, if stores are only so as they are guessed (in series with diodes flows are nothing, beside them efforts);
        None: there are none, or too many unknowns for implicit steps, or there is no such point.
        """
        self._begin()
        contacts = self.contacts
        free = [k for k, c in enumerate(contacts.contacts) if c.kind == "psi" and not contacts.barred[k]]
        # no one-way flow that may turn, or too large
        if not free or contacts.system.unknowns > DENSE:
            return None
        state = self._quick_start([contacts.contacts[k].number for k in free])
        constants = contacts.system.description.p[self._constants]
        # stores would move: with all of them holding instead
        if state is None or not state.kept:
            contacts.active[free] = True
            contacts.apply()
            other = self._quick_start()
            if other is not None and (state is None or state.farther(other)):
                state, constants = other, contacts.system.description.p[self._constants]
        # neither has a start
        if state is None:
            return None
        self._held, self._of_held = state, constants
        self._size(self._t, state.y, state.yd)
        return state.y

    def _quick_start(self, without: Sequence[int] = ()) -> ConsistentState | None:
        """The start of the present set, quickly, where these switches ask for nothing."""
        with suppress(InconsistentStart):
            return consistent_start(
                self.contacts.system,
                self._t,
                budget=self._budget,
                constants=self._constants.size > 0,
                quickly=True,
                without=without,
            )
        return None

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
        determined = Determined(self.contacts)
        # no step tells a set that fits: from the begin
        if held is None or not self._behind_steps(determined.pivoting, held):
            self._begin()
        else:
            self._let_go(determined)
        return self._fitting(determined)

    def _fitting(self, determined: Determined | None = None) -> ConsistentState:
        """The state whose set fits, sought from the present set."""
        contacts, determined = self.contacts, determined or Determined(self.contacts)
        y, yd = determined.fit(self._t, self._zeros, self._zeros, self._settle)
        # a diode that may hold or not: what fits later decides
        if _tied(contacts, contacts.observer(self._t, y, yd)):
            y = _ahead(contacts, determined, self._t, self._settle, y)
        last = next(k for k in reversed(range(len(self.found))) if self.found[k].y is y)
        self._put(self._with[last])
        return self.found[last]

    def nearest(self, found: ConsistentState) -> ConsistentState:
        """What was found, which the model has, or what is nearer: where stores move several sets may fit, of which the
        least change tells one.  It is sought from where all inequalities of flows hold, and all frictions, then among
        sets in which one of these stands otherwise.
        """
        contacts, t, zeros = self.contacts, self._t, self._zeros
        ways = [k for k, c in enumerate(contacts.contacts) if c.kind in HOLD and not contacts.barred[k]]
        # nothing moved, or nothing may stand otherwise
        if found.kept or not found.far or not ways:
            return found
        best = found, contacts.state(), contacts.system.description.p[self._constants]
        self._sought_near(None)
        self._begin()
        contacts.active[ways] = True
        contacts.apply()
        # from where everything holds
        with suppress(NoActiveSetError):
            other = self._fitting()
            if found.farther(other):
                best = other, contacts.state(), contacts.system.description.p[self._constants]
        # then one after the other turned
        for k in ways if len(ways) <= BESIDE else ():
            contacts.become(best[1])
            contacts.flip(k, contacts.observer(t, best[0].y, best[0].yd))
            contacts.apply()
            point = self._settle(t, zeros, zeros)
            if point is not None and best[0].farther(self.found[-1]) and contacts.fits(t, zeros, point):
                best = self.found[-1], contacts.state(), self._with[-1]
        contacts.become(best[1])
        self._put(best[2])
        return best[0]

    def _behind_steps(self, pivoting: Pivoting, held: Floats) -> bool:
        """Whether a set that a short implicit step from there asks for fits, which the model then has: with stores as
        they are guessed, or as impulses leave them.
        """
        contacts, t = self.contacts, self._t
        known, time = contacts.observer.largest.copy(), max(contacts.time, LEAST)
        parts = SHORT if self._quickly else SHORT[:1]  # it takes long to be sure that a set has no start
        told = dict[float, tuple[Floats, tuple[float, ...], Floats]]()  # point, set and sizes behind each step
        # stores as guessed, then as impulses leave them
        for jumps, part in itertools.product((False, True), parts):
            h = part * time
            # the set behind a step of this length, once
            if not jumps and (point := self._behind(pivoting, held, h, SHORT[-1] * time)) is not None:
                told[h] = point, contacts.state(), contacts.observer.largest.copy()
            if h not in told:
                continue
            behind, state, contacts.observer.largest[:] = told[h]
            contacts.become(state)
            self._sought_near(self._jumped(pivoting, held, behind, 0.5 * h) if jumps else None)
            pivoting.ahead(t, behind, h)  # impulses are over then
            # the set behind it fits
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
        self._put(self._of_held)
        behind = pivoting.ahead(self._t, held, h, self._t)
        # begun with the set behind a longer step
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
            # contacts that hold something are not freed
            if c.kind != "psi" or not contacts.active[k] or abs(values[c.multiplier]) > zero(c.multiplier):
                continue
            before = contacts.state()
            contacts.flip(k, values)
            contacts.apply()
            # open without it: does it fit free?
            if determined.nullity(t, *found[:2]) > 0:
                free = self._settle(t, zeros, zeros)
                if free is not None and contacts.fits(t, zeros, free):
                    continue
            contacts.become(before)

    def _jumped(self, pivoting: Pivoting, held: Floats, behind: Floats, half: float) -> ConsistentState | None:
        """What the impulses of the present set leave, where a step of half (s) tells as well which stores move."""
        during = self.contacts.state()
        self._put(self._of_held)
        again = pivoting.ahead(self._t, held, half, self._t)
        self.contacts.become(during)
        return None if again is None else self._started(self._t, (behind, again))

    def _nearly_fits(self, *, kept: bool) -> bool:
        """Whether the set fits, or one a few turns away (what leaks decide is behind a step); kept: of those that move
        stores no farther than to where they are held.
        """
        contacts, t, zeros = self.contacts, self._t, self._zeros
        # a few turns are allowed
        for _ in range(TURNS):
            found = self._settle(t, zeros, zeros)
            if found is None or (kept and self._held is not None and self.found[-1].farther(self._held)):
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
    # ever later, until a set fits that leaves nothing open
    for later in AHEAD:
        with suppress(NoActiveSetError):
            determined.fit(t0 + later * time, zeros, zeros, settle)
            point = settle(t0, zeros, zeros) if contacts.state() != stood else None
            if point is not None and contacts.fits(t0, zeros, point) and not determined.leaves(t0, *point[:2]):
                return point[0]
        contacts.become(stood)
    point = settle(t0, zeros, zeros)  # constants of the start are those of t0
    return y if point is None else point[0]
