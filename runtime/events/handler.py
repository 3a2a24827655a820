"""One run's events: what a change of what is watched (`watching.py`) does.

At an instant, in this order: the relations that cross take their new side; `when`s that became true fire, all values
read before anything is assigned; what they changed may fire others; the constraints that hold are found anew, and with
them the consistent point from which the next piece begins.  Senses and discrete variables stand in the parameters p,
which begin every run as they were bound.
"""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.events.bounces import LEAST, PART, begun_flights, flights, new
from sysdyn.runtime.events.choices import Choices
from sysdyn.runtime.events.conditions import Conditions, Round, with_momenta
from sysdyn.runtime.events.contacts import Standing as Stood
from sysdyn.runtime.events.determined import Determined
from sysdyn.runtime.events.kinks import NoBranchError
from sysdyn.runtime.events.observer import ASSIGNED
from sysdyn.runtime.events.pivoting import NoActiveSetError
from sysdyn.runtime.events.plan import Assignment, Happened, Plan
from sysdyn.runtime.events.succession import Point, Succession
from sysdyn.runtime.events.turns import Turns
from sysdyn.runtime.events.watches import BOUNDED, Watched
from sysdyn.runtime.events.watching import Watching
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.restart import Restart

__all__ = ["STALLED", "Handler", "Point"]

CASCADE = 100
"""Rounds of events at one instant: more will never end."""
STALLED = 200
"""Events in a row within NOTHING of the span: they chatter."""
SOON = 2
"""Of these, after which the handler is asked about each."""
RECENT = 64
"""Entries of what happened, several of which may be of one instant."""
BY_CHANCE = tuning.PERCENT
"""Of the gap between two events before: one that is so much shorter has other reasons than theirs."""
SHRINKING, NO_TIME = 8, 1e5
"""Events in a row, each of which follows sooner than the one before, until it does within so many spacings of t: their
instants have a limit (Zeno), behind which the text says nothing."""
HELD = tuning.SAME
"""Of what counts as zero: what has stayed below it for a time is held there."""
STOPPED = tuning.UNSEEN
"""Of what it was: a flow that an event leaves is no flow any more."""

Standing = tuple[Floats, NDArray[np.bool_]]
"""Parameters, and which of the constraints that may hold do."""


class Handler(Watching):
    """Events of one run.  system: as the stepper sees it; restart: consistent points of it."""

    def __init__(self, plan: Plan, system: System, span: tuple[float, float], begin: Standing) -> None:
        super().__init__(plan, system, span)
        self.determined = Determined(self.contacts)
        self.succession = Succession(plan, self.contacts, self.determined)
        self.choices = Choices(self.contacts, self.determined)
        self.turns = Turns(plan, self.observer, self.succession)
        self.passes = np.inf  # how long (s) a peak takes that began at the last event; inf: none did
        self.truth = np.zeros(len(plan.whens), dtype=bool)
        self._conditions = Conditions(tuple(w.condition for w in plan.whens), plan.relations)
        self._row = np.array([r.row for r in plan.relations], dtype=np.int64)
        self._gap = np.array([k for k, c in enumerate(plan.contacts) if c.kind == "phi"], dtype=np.int64)
        self._gaps = np.array([plan.contacts[k].value for k in self._gap], dtype=np.int64)
        self._bounds = [c for c in plan.contacts if c.kind in BOUNDED]
        self._bound = np.array([c.bound for c in self._bounds], dtype=np.int64)
        self._assigned = np.zeros(len(plan.relations), dtype=bool)  # whose values an assignment has told
        self._moves = np.array([r.moves for r in plan.relations], dtype=bool)
        self.happened: list[Happened] = []
        self.stalled, self.last = 0, -np.inf
        self.simple, self.struck, self.rounds, self.soon = False, -1, list[Round](), 0.0
        self._plain = all(c.kind in ("phi", "friction") and c.guard < 0 for c in plan.contacts)
        self._exact, self._sinking = list[int](), set[int]()
        self._jumps: dict[int, float] = {}
        """Relations that jump where they were found to cross, on whose other side the point is, by round-off: that."""
        self.back(begin)
        self.before = self.now()

    @property
    def restart(self) -> Restart | None:
        """Consistent points of the run; told once it has any."""
        return self.succession.restart

    @restart.setter
    def restart(self, restart: Restart | None) -> None:
        self.succession.restart = restart

    # -- what stands ---------------------------------------------------------------------------------------------

    def now(self) -> Standing:
        """Parameters and active switches."""
        return self.p.copy(), self.contacts.switches.active.copy()

    def back(self, standing: Standing) -> None:
        """These stand again."""
        self.p[:] = standing[0]
        self.contacts.take(standing[1])
        # the settler's factors belong to other rows
        if self.restart is not None:
            self.restart.settler.core.contents.ready = 0

    def caught_up(self, t: float, stalled: int) -> None:
        """The core has been in charge, until an event at t (s), which is as many in a row within no time."""
        self.stalled, self.last = stalled, t

    def stands(self, which: Sequence[Watched]) -> bool:
        """Whether kinks alone were crossed since `before`, and every branch is what it was."""
        return all(w.kink >= 0 for w in which) and bool(np.array_equal(self.before[0], self.p))

    # -- the start -----------------------------------------------------------------------------------------------

    def assign_samples(self, t: float, y: Floats, yd: Floats) -> list[int] | None:
        """Places of p that samples due at a start, and the conditions that become true by them, assign as the point
        has it; p has the values then.  None where they assign what p does not hold.
        """
        values = self.observer(t, y, yd)
        # sides by values, conditions by sides, then samples and what follows
        self._take_sides(t, values, np.ones_like(self.side), self.observer.zeros(self._row))
        self.truth, self.rounds = self._conditions.hold(self.side), []
        self._cascade(t, y, yd, range(len(self.plan.sampled)), [])
        assigned = [a for r in self.rounds for group in r.groups for a in group]
        # only parameters may be assigned before there is a start
        return [a.place for a in assigned] if all(a.kind == "discrete" for a in assigned) else None

    def begin(self, t: float, y: Floats, yd: Floats, *, sampled: bool = False) -> Point | None:
        """Sides and conditions at the start; samples due there, unless it is behind them.  The point where they changed
        it.
        """
        values = self.observer(t, y, yd)
        self._take_sides(t, values, np.ones_like(self.side), self.observer.zeros(self._row))
        self._verify_bounds(t, values)
        # a friction that would drive from the start on
        drives = self.succession.driving_friction(t, y, yd, values) if self.restart is not None else None
        if drives is not None:
            raise SolverFailure("drives", t, 0.0, drives)
        self.turns.seen(t, (y, yd))
        self.choices.begin(t, y, yd)
        self.truth = self._conditions.hold(self.side)
        due, anew = self.due(t), self.kinks.begin(values)
        # samples at the start, unless it is already behind them
        if due and not sampled:
            return self.fire(t, y, yd, due)
        # laws that jump, and stand at their jump
        return self.settle(t, y, yd, self.contacts.standing()) if anew else None

    def _take_sides(self, t: float, values: Floats, before: Floats, zeros: Floats) -> None:
        """The side of each relation, which was `before` [relations], as that of what moves below `zeros` is: one that a
        jump made zero is on neither, a root of a crossing and what jumps there is past it.  SolverFailure: no number.
        """
        values = values[self._row]
        if np.isnan(values).any():
            raise SolverFailure("nonfinite", t, 0.0)
        # exactly zero by a jump: on neither side; by a crossing: near, as what is almost zero
        exact = values != 0.0
        exact[self._exact] = True
        near = exact & (np.abs(values) <= np.where(self._moves, zeros, 0.0))
        side = np.sign(values)
        for k, past in self._jumps.items():
            near[k] |= past == side[k]
        self.side[:] = np.where(near, before, side)

    # -- what happens --------------------------------------------------------------------------------------------

    def _turn_sides(
        self, t: float, y: Floats, yd: Floats, which: Sequence[Watched]
    ) -> tuple[Sequence[Watched], list[int]]:
        """Turns sides and branches of laws; what then counts of what is watched, the relations that have crossed."""
        crossed = [w.relation for w in which if w.relation >= 0]
        values = self.observer(t, y, yd) if self.plan.relations else np.zeros(0)
        # values exactly zero at the crossing
        self._exact = [k for k in crossed if values[self.plan.relations[k].row] == 0.0]
        # values that jumped past it by more than counts
        self._jumps = {
            w.relation: float(w.side)
            for w in which
            if w.relation >= 0 and w.side * values[w.row] > self.observer.zero(w.row)
        }
        self._hold(values, crossed)
        which = self.turns.verify_passage(t, which)
        # relations change sides, laws change branches
        for w in which:
            if w.relation >= 0:
                self.side[w.relation] = -float(w.side)
            if w.kink >= 0:
                self.kinks.cross(w.kink, w.row, w.side)
        return which, crossed

    def _cascade(self, t: float, y: Floats, yd: Floats, samples: Sequence[int], crossed: list[int]) -> Floats:
        """Y behind all assignments: those of samples, then round by round of conditions that these have made true."""
        assigned: list[tuple[str, tuple[Assignment, ...]]] = [
            (self.plan.sampled[k].name, self.plan.sampled[k].assignments) for k in samples
        ]
        # each round may make other conditions true
        for _ in range(CASCADE):
            fired = self._risen(crossed)
            assigned += [(self.plan.whens[k].name, self.plan.whens[k].assignments) for k in fired]
            # nothing more becomes true
            if not assigned:
                return y
            y = self._assign(t, y, yd, assigned)
            self.rounds.append(Round(tuple(group for _, group in assigned), self.side.copy()))
            assigned, crossed = [], []
        # conditions that make each other true without end
        raise SolverFailure("chatter", t, 0.0, self._names())

    def fire(
        self, t: float, y: Floats, yd: Floats, samples: Sequence[int] = (), which: Sequence[Watched] = ()
    ) -> Point | None:
        """The point after everything that happens at t; None where nothing changes.  which: of the watched.

        rounds, simple: what is assigned, and whether that is all, and without an impact; struck: the gap that closed in
        flight and opened again, where that is all, else -1; soon (s): sooner than that the same shall be asked again.
        """
        # too many events at one instant are refused
        self._count(t)
        self.choices.end(t, y, yd)
        free, lone = self._free("friction"), self._free("friction", "phi")
        self.simple, self.struck, self.rounds, self.soon = True, -1, [], 0.0
        # as all stood before
        said, stood, flew = self.contacts.standing(), self.kinks.state(), self.bounces
        # values that an assignment has told are known anew
        self._assigned[:] = self.observer.exact[self._row] == ASSIGNED
        self.observer.exact[self.observer.exact == ASSIGNED] = 0
        # what crosses turns first, then assignments follow
        self.kinks.begin_instant()
        which, crossed = self._turn_sides(t, y, yd, which)
        begun, y, yd = y, y.copy(), yd.copy()
        y = self._cascade(t, y, yd, samples, crossed)
        # contacts that are touched, and what is not as simple as an assignment
        touched = list(dict.fromkeys(w.contact for w in which if w.contact >= 0))
        bent = any(w.kink >= 0 for w in which)
        self._sink(t, which)
        # a flow that is assigned blows against contacts
        self.succession.blow = any(a.kind == "flow" for r in self.rounds for group in r.groups for a in group)
        # the core repeats what is assigned, not contacts that turn
        self.simple &= not (self.succession.blow and not (free and self._plain))
        self.simple &= not (self.rounds and (touched or bent))
        self.simple &= all(self.plan.contacts[k].kind != "phi" for k in touched)
        # nothing to do: no sample, no law, no assignment, no contact
        if not (samples or bent or self.rounds or touched):
            return None
        # the point behind it all
        self.struck = touched[0] if lone and touched and len(which) == 1 and not self.rounds else -1
        point = self._follow_conditions(t, self.settle(t, y, yd, said, touched))
        self._due_at_once(t, point, crossed)
        self.turns.seen(t, point)
        # relations that an assignment sends back at once
        self._return(t, begun, point, which)
        thrown = new(self.bounces, flew)
        self.struck = self.struck if self._has_bounced(self.struck, thrown) else -1
        self.simple &= not thrown
        # what laws became, and how long peaks take
        self.happened += self.kinks.changes(t, stood)
        self.passes = self.kinks.passing(stood, self.observer(t, *point)) if self.kinks.peaks else np.inf
        return point

    def _due_at_once(self, t: float, point: Point, crossed: list[int]) -> None:
        """Relations, but those that cross at t, that have come back through zero by less than counts and fall again
        from this point on have their side again (tanks that are filled by turns); these, and what assignments have put
        next to zero, are known to rounding until they have crossed.
        """
        # without relations none comes back
        if not self.plan.relations:
            return
        row, (y, yd) = self._row, point
        here, zeros = self.observer(t, y, yd)[row], self.observer.zeros(row)
        near, rounding = np.abs(here) <= zeros, self.observer.rounding(row, here)
        back = near & (self.side * here < -rounding)
        # those that do not cross at t, and move on past zero a little later
        back[crossed] = False
        if back.any():
            step = PART * self.contacts.time
            back &= self.side * (self.observer(t + step, y + step * yd, yd)[row] - here) > zeros
        # these have turned: conditions anew
        if back.any():
            self.side[back] *= -1.0
            self.truth, self.simple = self._conditions.hold(self.side), False
        # known to rounding: within it a crossing is none
        near &= (self._assigned | back) & self._moves & (self.side * here > rounding)
        self.observer.exact[row[near]] = ASSIGNED

    def _hold(self, values: Floats, crossed: Sequence[int]) -> None:
        """What a constraint holds at zero since an event before (a speed that sticks) is on neither side."""
        # at an instant that has stalled no time has passed to stick in
        if self.stalled:
            return
        still = self._moves & (np.abs(values[self._row]) <= HELD * self.observer.zeros(self._row))
        still[crossed] = False
        self.side[still] = 0.0

    def _return(self, t: float, begun: Floats, point: Point, which: Sequence[Watched]) -> None:
        """SolverFailure where what was assigned sends a relation back for so little that it is not seen to return;
        begun: y before.  What others have stopped (a one-way clutch) is not sent.
        """
        # states that were assigned and moved
        moved = [a.place for r in self.rounds for group in r.groups for a in group if a.kind != "discrete"]
        sent = any(abs(point[0][k]) > STOPPED * abs(begun[k]) for k in moved)
        falls = [(w.row, w.side) for w in which if w.relation >= 0 and self.side[w.relation] == -w.side]
        # nothing was sent, or nothing has crossed
        if not (sent and falls and self.restart is not None):
            return
        for flight, least in flights(self.observer, self.restart, t, point, self.contacts.time, falls):
            # back sooner than can be seen: without end
            if flight.flight <= least:
                raise SolverFailure("zeno", t, 0.0, self._names())
            self.soon = max(self.soon, LEAST * least)

    def _has_bounced(self, k: int, thrown: list[int]) -> bool:
        """Whether gap k has closed and opened again, and nothing else did; thrown: rows of gaps."""
        closed, contacts = self.succession.impacts.closed, self.plan.contacts
        bounced = k >= 0 and closed == [k] and thrown == [contacts[k].value]
        return bounced and self._plain and self._free("friction", "phi")

    def _free(self, *kinds: str) -> bool:
        """Whether nothing holds but contacts of these kinds, and none that a relation reads."""
        pairs = zip(self.plan.contacts, self.contacts.active.tolist(), strict=True)
        return not any(holds and (c.kind not in kinds or c.hold >= 0) for c, holds in pairs)

    def _follow_conditions(self, t: float, point: Point) -> Point:
        """The point after the conditions that became true where the constraints were found anew."""
        for _ in range(CASCADE):
            fired = self._risen(())
            if not fired:
                return point
            self.simple, self.struck, said = False, -1, self.contacts.standing()
            # assignments, and the constraints behind them
            y = self._assign(t, *point, [(self.plan.whens[k].name, self.plan.whens[k].assignments) for k in fired])
            point = self.settle(t, y, point[1], said)
        # conditions and constraints that do not come to an end
        raise SolverFailure("chatter", t, 0.0, self._names())

    def settle(self, t: float, y: Floats, yd: Floats, said: Stood, touched: Sequence[int] = ()) -> Point:
        """The consistent point with the constraints and the branches that hold from now on."""
        self.kinks.leave(self.observer(t, y, yd))
        point = self._settle_constraints(t, y, yd, said, touched)
        # each turn of a branch may turn another
        try:
            while self.kinks.turn(self.observer(t, *point)):
                point = self._settle_constraints(t, *point, self.contacts.standing())
        # a law that is driven to both sides, or branches in a circle
        except NoBranchError as error:
            raise SolverFailure("slides" if error.pushed else "chatter", t, 0.0, ", ".join(error.names)) from error
        return point

    def restart_at_jump(self, t: float, y: Floats, yd: Floats) -> Point:
        """The point behind an instant at which the text jumps, and behind the conditions that become true by it."""
        self.simple, self.struck, self.rounds, self.soon, stood = True, -1, [], 0.0, self.kinks.state()
        self.kinks.begin_instant()
        flew = self.bounces
        point = self._follow_conditions(t, self.settle(t, y, yd, self.contacts.standing()))
        self.simple &= not new(self.bounces, flew)
        self.happened += self.kinks.changes(t, stood)
        return point

    def _settle_constraints(self, t: float, y: Floats, yd: Floats, said: Stood, touched: Sequence[int] = ()) -> Point:
        """The consistent point with the constraints that hold from now on; SolverFailure where there is none."""
        assert self.restart is not None
        # without contacts: a point across the event
        if not self.plan.contacts:
            found = self.restart.across(t, y, yd)
            if found is None:
                raise SolverFailure("newton", t, 0.0)
            self._renew(t, *found)
            return found
        self.restart.bounded(t, y, yd)
        try:
            found, anew = self.succession.after(t, y, yd, touched, stalled=self.stalled > 0)
        # no set fits: whether a friction drives is a clearer word
        except NoActiveSetError as error:
            drives = self.succession.driving(t, y, yd)
            cause = "complementarity" if drives is None else "drives"
            raise SolverFailure(cause, t, 0.0, drives or ", ".join(error.names)) from error
        self._renew(t, *found)
        self.choices.begin(t, *found)
        # gaps are thrown only where the set was sought
        if anew:
            self._bounce(t, *found, {*touched, *self.succession.impacts.closed})
        self._note(t, said, {*touched, *self.succession.impacts.closed})
        return found

    def _bounce(self, t: float, y: Floats, yd: Floats, met: Set[int]) -> None:
        """The gaps in flight: that were, and have not been met, or that open here."""
        values, contacts = self.observer(t, y, yd), self.plan.contacts
        # open gaps that stand at zero begin a flight
        free = ~self.contacts.active[self._gap]
        here = values[self._gaps] <= self.observer.zeros(self._gaps)
        still = {contacts[k].value for k in set(self._gap[free].tolist()) - met}
        begin = begun_flights(t, values, [contacts[k] for k in self._gap[free & here]])
        # flights that were go on where nothing was met
        self.bounces = begin | {row: bounce for row, bounce in self.bounces.items() if row in still}

    def _note(self, t: float, said: Stood, struck: Set[int]) -> None:
        """What contacts that stand otherwise than `said`, and impacts, are called."""
        words = self.contacts.changed_contacts(said)
        for k in sorted({*words, *struck}):
            contact = self.plan.contacts[k]
            # what stands otherwise than before
            if k in words and contact.kind != "follows":
                self.happened.append(Happened(t, contact.name, contact.name, *words[k]))
            # an impact behind which all is as before
            elif contact.kind == "phi":
                word = self.contacts.word(k)
                self.happened.append(Happened(t, f"impact {contact.name}", contact.name, word, word))

    # -- conditions and assignments ------------------------------------------------------------------------------

    def _risen(self, crossed: Sequence[int]) -> list[int]:
        """Which conditions have become true; crossed: relations that are zero at this instant alone."""
        fired = np.flatnonzero(self._conditions.hold(self.side, crossed) & ~self.truth)
        self.truth = self._conditions.hold(self.side)
        return [int(k) for k in fired]

    def _assign(self, t: float, y: Floats, yd: Floats, events: list[tuple[str, tuple[Assignment, ...]]]) -> Floats:
        """All values are read, then all assigned; a law driven back to where it came from is no longer so for that."""
        values = self.observer(t, y, yd)
        y, set_by = y.copy(), dict[tuple[str, int], int]()
        for k, (name, assignments) in enumerate(events):
            said, now = [], []
            for a in assignments:
                # two events set one value at one instant
                other = set_by.setdefault((a.kind, a.place), k)
                if other != k:  # elements of one family have a name in common
                    raise SolverFailure("conflict", t, 0.0, f"{a.name} (by '{events[other][0]}' and by '{name}')")
                # a value that is no number
                if not np.isfinite(values[a.row]):
                    raise SolverFailure("overflows", t, 0.0, f"{a.name} (= {values[a.row]:g}, by '{name}')")
                target = self.p if a.kind == "discrete" else y
                said.append(f"{a.name} = {target[a.place]:.9g}")
                target[a.place] = values[a.row]
                now.append(f"{a.name} = {values[a.row]:.9g}")
            # the element that owns what is assigned
            element = assignments[0].name.rpartition(".")[0] if assignments else ""
            self.happened.append(Happened(t, name, element, ", ".join(said), ", ".join(now)))
        self.kinks.begin_instant()
        # flows: momenta follow
        if any(a.kind == "flow" for _, assignments in events for a in assignments):
            settled = self.restart.instant.system if self.restart else self.system
            y = with_momenta(settled, t, y, yd)
        self._renew(t, y, yd, values)
        return y

    def _sink(self, t: float, which: Sequence[Watched]) -> None:
        """SolverFailure where bounds fall below zero, and nothing else happens there (the reaction that told one would
        end) the second time.
        """
        sinking = {w.contact for w in which if w.contact >= 0 and w.row == self.plan.contacts[w.contact].bound}
        # the second time, and by the bound alone
        if sinking & self._sinking and all(w.contact in sinking for w in which):
            raise SolverFailure("drives", t, 0.0, self.plan.contacts[min(sinking)].name)
        self._sinking = sinking

    def _verify_bounds(self, t: float, values: Floats) -> None:
        """SolverFailure where the bound of dry friction is negative."""
        for k in np.flatnonzero(values[self._bound] < -self.observer.zeros(self._bound)):
            raise SolverFailure("drives", t, 0.0, self._bounds[k].name)

    def _renew(self, t: float, y: Floats, yd: Floats, was: Floats | None = None) -> None:
        """Sides after a jump; was: values [observed] before an assignment."""
        values = self.observer(t, y, yd)
        self._verify_bounds(t, values)
        here, zeros = values[self._row], self.observer.zeros(self._row)
        # what an assignment moved is known to round-off
        if was is not None:
            rounding = self.observer.rounding(self._row, here)
            assigned = np.abs(here - was[self._row]) > rounding
            self._assigned |= assigned
            self._jumps = {k: past for k, past in self._jumps.items() if not assigned[k]}
            zeros = np.where(assigned, np.minimum(zeros, rounding), zeros)
        self._take_sides(t, values, self.side, zeros)

    # -- what never ends -----------------------------------------------------------------------------------------

    def _count(self, t: float) -> None:
        """Counts events at one instant; SolverFailure where instants accumulate, or events or those of an instant are
        too many.
        """
        near = t - self.last <= self.nothing
        self.stalled, self.last = (self.stalled + 1 if near else 0), t
        # instants that shrink towards a limit
        if self.stalled and self._accumulate(t):
            raise SolverFailure("zeno", t, 0.0, self._names())
        # too many without time passing: laws alone, or all
        if self.stalled > STALLED:
            raise SolverFailure("fold" if self._turns_alone() else "chatter", t, 0.0, self._names())
        if self.plan.limit is not None and len(self.happened) > self.plan.limit:
            raise SolverFailure("max_events", t, 0.0, self._names())

    def _accumulate(self, t: float) -> bool:
        """Whether the instants of what happened have a limit that is not told from t."""
        # the last instants, by their gaps
        gaps = np.diff(sorted({h.time for h in self.happened[-RECENT:]})[-SHRINKING - 2 :])
        if gaps.size <= SHRINKING or gaps[-1] > NO_TIME * np.spacing(abs(t)):
            return False
        # each a fixed part of the one before
        ratios = gaps[1:] / gaps[:-1]
        return bool((ratios < 1.0).all() and (ratios > BY_CHANCE).all())

    def _turns_alone(self) -> bool:
        """Whether nothing but corners of continuous laws was crossed of late: on neither side of them is a motion."""
        corners = {(kink.name, kink.element) for kink in self.plan.kinks if not kink.jumps}
        return {(h.name, h.element) for h in self.happened[-RECENT:]} <= corners

    def _names(self) -> str:
        return ", ".join(dict.fromkeys(h.name for h in self.happened[-6:]))
