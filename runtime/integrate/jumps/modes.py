"""What the core knows of a run's events: modes met so far, and the transitions between them (core/run/events/modes.h).

The handler says what happens; where it was simple (no impact, no flow assigned) it is told to the core, which takes
the same transition by itself from then on as long as the conditions behind it hold.  Before the handler is asked again
it is told what has happened since.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence
from dataclasses import astuple, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from sysdyn.runtime import _core
from sysdyn.runtime.events.bounces import Bounce
from sysdyn.runtime.events.handler import SOON, Handler
from sysdyn.runtime.events.kinks import WORDS
from sysdyn.runtime.events.observer import SMALL
from sysdyn.runtime.events.plan import Assignment, Happened, Plan
from sysdyn.runtime.events.watches import Watched
from sysdyn.runtime.integrate.jumps.crossing import JUMP
from sysdyn.runtime.integrate.jumps.segments import core_pieces
from sysdyn.runtime.integrate.jumps.strikes import ImpulseBalance, of_momenta, struck
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.scales import ROUND_OFF, UNKNOWN
from sysdyn.runtime.start.restart import STILL
from sysdyn.values import dataclass

if TYPE_CHECKING:
    from sysdyn.runtime.integrate.integrate import Integration

KINDS = {"psi": 0, "friction": 1, "phi": 2, "guarded": 3, "follows": 4}
MOST, MANY = 4096, 16384
"""Modes and transitions that are kept."""
ROUNDS = 4
"""Times the assignments of the text: so many are made at one instant."""
AGAIN = 3
"""Times a transition between two modes is told: it may be another one (assignments), or its conditions at the edge."""
LOG = 1024
"""Events between two looks at them."""
UNLIMITED = 1 << 62
EARLY = dict.fromkeys(("radau", "dopri"), 0.155)
"""Method -> part of the first step behind an event, where the first of radau's three stages lies: before it the dense
output knows nothing of what relaxes at once (a leak behind a diode that blocks, in 1e-10 s), on the way to which others
follow.  Rosenbrock's follows what twists into a zero.  The first step of the bdf is as short as what its error test
sees of that, and shorter ones are of round-off.
"""
AT_ONCE = 1e3
"""Times what is no time: so soon behind an event another one is at once, as in comparisons (accuracy/pairs.TIMING).
"""
UNSEEN = 100.0
"""Times a run's tolerance: of a bounce that rises less, the error test of the bdf hardly sees that it falls."""
FLIGHT = tuple(field.name for field in fields(Bounce))
JUMPS: int = _core.SD_JUMP
"""Samples due where the text jumps (core/run/events/modes.h)."""


@dataclass(frozen=True, slots=True)
class TransitionEntries:
    """What a transition is called: name, element, what is said (before and after alike, but for numbers), which numbers
    of each entry that assigns; the other entries as they were.
    """

    assigns: tuple[tuple[str, str, str, slice, slice], ...]
    entries: tuple[Happened, ...]

    def entries_at(self, t: float, values: Sequence[float]) -> list[Happened]:
        """The entries at t (s); values: before and after of each assignment."""
        found = [
            Happened(t, name, element, said % tuple(values[before]), said % tuple(values[after]))
            for name, element, said, before, after in self.assigns
        ]
        return found + [Happened(t, e.name, e.element, e.before, e.after) for e in self.entries]


def told_of(groups: Sequence[tuple[Assignment, ...]], entries: Sequence[Happened]) -> TransitionEntries:
    """What a transition is called of which these are the entries; groups: assignments of the first of them."""
    # assigned values are filled in from the core's log
    assigns, k = [], 0
    for entry, group in zip(entries, groups, strict=False):
        said = ", ".join(f"{a.name.replace('%', '%%')} = %.9g" for a in group)
        end = k + 2 * len(group)
        assigns.append((entry.name, entry.element, said, slice(k, end, 2), slice(k + 1, end, 2)))
        k = end
    return TransitionEntries(tuple(assigns), tuple(entries[len(assigns) :]))


def serves(plan: Plan, run: Integration) -> bool:
    """Whether the core can take transitions of this run."""
    equal = any(_equal(w.condition, plan) for w in plan.whens)
    kinds = all(k.kind in KINDS and (k.kind == "guarded" or k.guard < 0) for k in plan.contacts)
    return kinds and not equal and run.driver.calls["observe"] is not None and not run.request.least_norm


def _equal(condition: tuple[Any, ...], plan: Plan) -> bool:
    """Whether a condition is true at the instant of a crossing alone."""
    # an equality of what moves
    if condition[0] == "relation":
        return condition[2] in ("==", "!=") and plan.relations[condition[1]].moves
    return any(_equal(item, plan) for item in condition[1:])


class EventModes:
    """Modes and transitions of one run."""

    def __init__(self, run: Integration, handler: Handler, longest: float) -> None:
        self.run, self.handler, plan = run, handler, handler.plan
        self._keep: list[Any] = []
        self._number: dict[Any, int] = {}
        self._states: list[Any] = []
        self._told: list[TransitionEntries] = []
        self._tried: dict[str, int] = {}
        self._strikes: dict[int, ImpulseBalance | None] = {}
        self._modes, self._transitions = (lib.Mode * 8)(), (lib.Transition * 16)()
        # systems whose rows change with the set
        settled = [run.system, run.settler.system, *([run.projection.system] if run.projection else [])]
        self._systems = list({id(s): s for s in settled}.values())
        # parameters that a mode is told by
        self._fixed = [k.sense for k in plan.contacts if k.sense >= 0] + [k.branch for k in plan.kinks]
        self._fixed += [k.hold for k in plan.contacts if k.hold >= 0]
        self._alone = all(k.hold < 0 for k in plan.contacts)
        self.core = lib.Modes(now=-1, last=-np.inf, begin=run.start.t, longest=longest, passed=-np.inf, left=UNLIMITED)
        self.core.chatters = SOON
        self._sizes(plan)
        self._plan(plan)
        self._run()
        run.driver.run.modes = c.addressof(self.core)

    # -- the core's structure ------------------------------------------------------------------------------------

    def _array(self, values: Any, dtype: Any = np.float64) -> int:
        """The address of a copy that is kept."""
        array = np.array(values, dtype=dtype)
        array = array if array.size else np.zeros(1, dtype=dtype)
        self._keep.append(array)
        return int(array.ctypes.data)

    def _sizes(self, plan: Plan) -> None:
        core, run = self.core, self.run
        core.parameters, core.places = self.handler.p.size, len(self._fixed)
        core.relations, core.contacts, core.kinks = len(plan.relations), len(plan.contacts), len(plan.kinks)
        core.systems, core.samples = len(self._systems), len(plan.sampled)
        core.observed, core.unknowns = run.driver.observed, run.system.unknowns

    def _plan(self, plan: Plan) -> None:
        """Tells the core of relations, contacts, laws, segments, samples, and of the room for its log."""
        core, handler = self.core, self.handler
        core.p, core.place = lib.pointer(handler.p), self._array(self._fixed, np.int32)
        core.relation_row = self._array([r.row for r in plan.relations], np.int32)
        core.relation_moves = self._array([r.moves for r in plan.relations], np.int32)
        contacts, kinks = (lib.Contact * max(len(plan.contacts), 1))(), (lib.Kink * max(len(plan.kinks), 1))()
        # frozen contacts follow
        for k, one in enumerate(plan.contacts):
            rows = one.value, one.rate, one.multiplier, one.bound, one.guard, one.sense, one.acceleration
            contacts[k] = lib.Contact(KINDS["follows" if k in handler.contacts.frozen else one.kind], *rows)
        for k, kink in enumerate(plan.kinks):
            functions = kink.branch, kink.value, kink.rate, kink.above, kink.below
            kinks[k] = lib.Kink(*functions, kink.inner, kink.jumps, kink.passage)
        pieces = core_pieces(self.run.segments)
        systems = (c.c_void_p * len(self._systems))(*(c.addressof(s.core) for s in self._systems))
        self._keep += [contacts, kinks, systems, pieces]
        core.piece, core.pieces, core.differs = c.addressof(pieces), len(pieces), max(self.run.request.rtol, JUMP)
        core.contact, core.kink = c.addressof(contacts), c.addressof(kinks)
        core.system = c.addressof(systems)
        core.period, core.next = self._array([s.period for s in plan.sampled]), lib.pointer(handler.next)
        core.first, core.nothing = handler.span[0], handler.nothing
        core.small, core.largest = SMALL, lib.pointer(handler.observer.largest)
        core.known = lib.pointer(handler.observer.exact)
        # groups of values of one kind
        alike = handler.observer.groups
        core.alikes, core.alike = len(alike), self._array(np.concatenate([*alike, []]), np.int32)
        core.alike_end = self._array(np.cumsum([g.size for g in alike]), np.int32)
        # a line of the log holds the values of all assignments of an event
        assigned = sum(len(e.assignments) for e in plan.whens) + sum(len(e.assignments) for e in plan.sampled)
        core.width, core.room = 2 + 2 * max(ROUNDS * assigned, 1), LOG
        self._log = np.zeros((LOG, core.width))
        core.log = lib.pointer(self._log)

    def _run(self) -> None:
        """Tells the core of the run: roles, sizes and magnitudes of its unknowns, room for points and flights."""
        core, run, method, plan = self.core, self.run, self.run.method.contents, self.handler.plan
        extended = max(run.system.unknowns, run.system.form.extended) + 8
        core.still, core.unknown_size, core.round_off = STILL, UNKNOWN, ROUND_OFF
        core.state = self._array(run.roles.state[: run.system.form.written], np.int32)
        core.differential = self._array(run.roles.differential, np.int32)
        core.unnamed, core.met = self._array(run.sizes.unnamed, np.int32), lib.pointer(run.sizes.met)
        core.magnitude, core.resolved = lib.pointer(run.sizes.magnitude), lib.pointer(run.sizes.resolution)
        core.rate = lib.pointer(run.start_rate)
        core.t_end, core.h_max = (c.addressof(method) + getattr(type(method), f).offset for f in ("t_end", "h_max"))
        # points, values and parameters on both sides of an event
        for name in ("y", "yd", "before", "before_d", "restart", "restart_d"):
            setattr(core, name, self._array(np.zeros(extended)))
        for name in ("values", "low", "high"):
            setattr(core, name, self._array(np.zeros(run.driver.observed + 1)))
        for name in ("p_before", "p_after"):
            setattr(core, name, self._array(np.zeros(core.parameters + 1)))
        self._thrown = np.zeros(run.driver.observed + 1, dtype=np.int32)
        self._flights = [np.zeros(run.driver.observed + 1) for _ in FLIGHT]
        core.thrown = lib.pointer(self._thrown)
        # gaps in flight
        for name, array in zip(FLIGHT, self._flights, strict=True):
            setattr(core, name, lib.pointer(array))
        core.fastest, core.rest, core.struck = lib.pointer(self.handler.succession.impacts.fastest), plan.rest, -1
        core.early, core.at_once = EARLY.get(run.request.method, 0.0), AT_ONCE * self.handler.nothing
        core.faint = UNSEEN * run.request.rtol if run.request.method == "bdf" else 0.0
        # transitions of a bounce that any mode may take
        self._anywhere = np.full(core.contacts + 1, -1, dtype=np.int32)
        core.anywhere = lib.pointer(self._anywhere)
        core.exact = self._array(np.zeros(core.relations + 1), np.int32)
        core.was = self._array(np.zeros(core.relations + 1))
        core.turning = self._array(np.zeros(core.kinks + 1), np.int32)
        core.own.value = self._array(np.zeros(core.places + 1))
        self._room(len(self.handler.plan.sampled) + 16)

    def _room(self, watches: int) -> None:
        """Room for as many watches."""
        self._watches = watches
        watch = (lib.Watch * watches)()
        self._keep.append(watch)
        self.core.watch = c.addressof(watch)
        self.core.found, self.core.which = self._array(np.zeros(watches)), self._array(np.zeros(watches), np.int32)
        for name in ("row", "side", "rate"):
            setattr(self.core.own, name, self._array(np.zeros(watches), np.int32))

    # -- between the core and the handler ------------------------------------------------------------------------

    def inform_handler(self) -> bool:
        """The handler stands where the core does, and knows what has happened; whether any event has."""
        core, handler = self.core, self.handler
        # a law's branch, or a transition that was learnt
        for row in self._log[: core.logged].tolist():
            handler.happened += (
                self._entry_of_law(row) if row[1] < 0.0 else self._told[int(row[1])].entries_at(row[0], row[2:])
            )
        some, core.logged = bool(core.logged), 0
        number = core.base if core.now == lib.OWN else core.now
        # the mode of which the core knows everything
        if number >= 0:
            side, truth, contacts = self._states[number]
            handler.side[:], handler.truth = side, truth.copy()
            handler.contacts.become(contacts)
            handler.caught_up(core.last, core.stalled)
            handler.bounces = self._bounces()
        # a mode that the core has made by itself: described anew
        if core.now == lib.OWN:
            self.stands()
        return some

    def _bounces(self) -> dict[int, Bounce]:
        """The gaps in flight, as the handler has them."""
        rows = np.flatnonzero(self._thrown).tolist()
        return {row: Bounce(*(float(array[row]) for array in self._flights)) for row in rows}

    def _throw(self) -> None:
        """The core has the gaps in flight as the handler does."""
        self._thrown[:] = 0
        for row, bounce in self.handler.bounces.items():
            self._thrown[row] = 1
            for array, value in zip(self._flights, astuple(bounce), strict=True):
                array[row] = value

    def _entry_of_law(self, row: Sequence[float]) -> list[Happened]:
        """The entry of a law whose branch the core turned: time (s), -1 - its number, its branches."""
        kink = self.handler.plan.kinks[-1 - int(row[1])]
        told = Happened(row[0], kink.name, kink.element, WORDS[row[2]], WORDS[row[3]])
        return [] if kink.passage else [told]

    def stands(self) -> int:
        """The number of the handler's present mode, which the core is in from now on; -1: one too many."""
        core, handler = self.core, self.handler
        key = handler.side.tobytes(), handler.truth.tobytes(), handler.contacts.state(), tuple(handler.kinks.state())
        core.last, core.stalled = handler.last, handler.stalled
        limit = handler.plan.limit
        core.left = UNLIMITED if limit is None else limit - len(handler.happened)
        self._throw()
        # a guard that bars contacts is not known to the core
        usual = not handler.contacts.barred.any()
        core.now = self._mode(key) if usual else -1
        return int(core.now)

    def _mode(self, key: Any) -> int:
        """The number of a mode, described to the core where it is met for the first time; -1: one too many."""
        if key in self._number:
            return self._number[key]
        number = len(self._states)
        # room for modes is bounded
        if number >= MOST:
            return -1
        self._modes = _grow(self._modes, number)
        self._modes[number] = self._describe_mode()
        self.core.mode = c.addressof(self._modes)
        self._states.append((self.handler.side.copy(), self.handler.truth.copy(), key[2]))
        self._number[key] = number
        return number

    def _describe_mode(self) -> Any:
        """The handler's present mode as the core's structure."""
        handler, held = self.handler, (lib.Held * len(self._systems))()
        watched = handler.all_watched()
        if len(watched) > self._watches:
            # more watches than there was room for
            self._room(2 * len(watched))
        for k, system in enumerate(self._systems):
            s = system.core
            rows = s.held_row, s.held_unknown, s.held_slot, s.held_rate, s.cleared
            held[k] = lib.Held(s.held, s.clear, *rows)
            self._keep.append(system._held)
        self._keep.append(held)
        return lib.Mode(
            watches=len(watched),
            first=-1,
            row=self._array(watched.row, np.int32),
            side=self._array(watched.side, np.int32),
            rate=self._array(watched.rate, np.int32),
            value=self._array(handler.p[self._fixed]),
            relation=self._array(handler.side),
            holds=self._array(handler.contacts.active, np.int32),
            held=c.addressof(held),
        )

    def learn(
        self, begin: int, t: float, what: tuple[Sequence[int], Sequence[int] | None], moved: tuple[Any, Any, int]
    ) -> None:
        """The handler went from mode `begin` at t (s); what: watches that crossed, samples due, None: the text jumps;
        moved: sides once these had changed, the point behind (None: nothing but sides changed), events before.
        """
        (crossed, due), (flipped, point, before) = what, moved
        handler, number = self.handler, len(self._told)
        # unknown, full, or not determined: not learnt
        if begin < 0 or number >= MANY or not self._is_determined(t, point):
            return
        strike = None if handler.simple else self._strike(t, point)
        flows = any(a.kind == "flow" for r in handler.rounds for group in r.groups for a in group)
        if (strike or flows) and self.run.driver.impulses is not None:
            return  # integrals gain by the impulses
        momenta = self._momenta(t, point) if flows else None
        # neither an assignment nor an impact that the core could repeat
        if not (handler.simple or strike) or momenta == 0:
            return
        end = self.stands()
        groups = tuple(group for r in handler.rounds for group in r.groups)
        flat = [a for group in groups for a in group]
        ends = np.cumsum([sum(map(len, r.groups)) for r in handler.rounds])
        same = what[0], what[1], begin, end
        # too long for the log, or tried before in vain
        if end < 0 or 2 + 2 * len(flat) > self.core.width or self._tried.setdefault(repr(same), 0) >= AGAIN:
            return
        # a bounce that leaves the set alone: from any mode
        anywhere = strike is not None and begin == end and self._alone
        if anywhere and self._anywhere[handler.struck] >= 0:
            return
        self._tried[repr(same)] += 1
        self._transitions = _grow(self._transitions, number)
        entries = tuple(handler.happened[before:])
        self._transitions[number] = lib.Transition(
            number=number,
            to=end,
            next=-1 if anywhere else self._modes[begin].first,
            crossed=len(crossed),
            due=JUMPS if due is None else len(due),
            rounds=len(handler.rounds),
            moves=point is not None,
            which=self._array(sorted(crossed), np.int32),
            sample=self._array(sorted(due or ()), np.int32),
            kind=self._array([a.kind != "discrete" for a in flat], np.int32),
            place=self._array([a.place for a in flat], np.int32),
            read=self._array([a.row for a in flat], np.int32),
            end=self._array(ends, np.int32),
            sides=self._array(np.concatenate([flipped, *(r.sides for r in handler.rounds)])),
            entries=len(entries),
            soon=handler.soon,
            strike=strike,
            momenta=momenta,
        )
        self.core.transition = c.addressof(self._transitions)
        # for all modes, or first in this one's list
        if anywhere:
            self._anywhere[handler.struck] = number
        else:
            self._modes[begin].first = number
        self._told.append(told_of(groups, entries))

    def _strike(self, t: float, point: Any) -> int | None:
        """The address of the impact that has just been, where the core can do the like; None: it cannot."""
        k = self.handler.struck
        # no impact, or no point behind it
        if k < 0 or point is None:
            return None
        # equations of one gap, once
        if k not in self._strikes:
            self._strikes[k] = struck(self.handler, k, t, *point)
        one = self._strikes[k]
        return None if one is None else one.address

    def _momenta(self, t: float, point: Any) -> int | None:
        """The address of the rows that momenta follow from; None: the model has none, 0: they do not tell them."""
        restart = self.handler.restart
        assert restart is not None
        if not (restart.settler.system.kinds == "p").any():
            return None
        # how they follow from flows, once
        if -1 not in self._strikes:
            self._strikes[-1] = of_momenta(restart.settler.system, t, *point)
        one = self._strikes[-1]
        return 0 if one is None else one.address

    def _is_determined(self, t: float, point: Any) -> bool:
        """Whether the mode leaves nothing open at t (s)."""
        handler = self.handler
        # no contacts: nothing can be open
        if point is None or not handler.plan.contacts:
            return True
        return bool(handler.determined.leaves(t, *point) == 0)

    def places(self, which: Sequence[Watched]) -> list[int]:
        """Numbers of these among what is watched."""
        watched = self.handler.all_watched()
        return [watched.place(w) for w in which]


def _grow(array: Any, number: int) -> Any:
    """An array of structures with room for one more at `number`: itself, or a larger copy."""
    if number < len(array):
        return array
    larger = (array._type_ * (2 * len(array)))()
    c.memmove(larger, array, c.sizeof(array))
    return larger
