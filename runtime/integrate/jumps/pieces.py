"""The pieces of a run between events: where each ends on the dense output, and how the next one begins.

Received: an `Integration` under way and a plan of events; the handler (runtime/events) says what happens, this file
tells the core.  What an event reads is settled at the instant, so that multipliers are as exact as positions.
"""

from __future__ import annotations

import ctypes as c
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from sysdyn.runtime.events.handler import Handler, Point
from sysdyn.runtime.events.observer import SMALL
from sysdyn.runtime.events.plan import Happened, Plan
from sysdyn.runtime.events.watches import Watched
from sysdyn.runtime.integrate.causes import failure
from sysdyn.runtime.integrate.jumps.crossing import go_on
from sysdyn.runtime.integrate.jumps.first_step import PARTS, FirstStep
from sysdyn.runtime.integrate.jumps.modes import UNSEEN, EventModes, serves
from sysdyn.runtime.integrate.jumps.segments import Segment
from sysdyn.runtime.integrate.request import TRACE
from sysdyn.runtime.integrate.rows.driver import Sink
from sysdyn.runtime.integrate.weights.round_off import left_open
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.scales import group_maxima

if TYPE_CHECKING:
    from sysdyn.runtime.integrate.integrate import Integration


FOLLOWED = 16.0
"""Times a signal that events read may turn within a step: each way has SD_FINEST / FOLLOWED parts (core/run/run.h)."""
WATCHED = 0.5
"""Times any signal may turn within a step where something is watched: what algebra alone determines (what a block that
sticks bears, a node between resistors) is interpolated there, and nothing tests that."""
WIDER = 3.0
"""Times the stretch in which a change was seen, and was none once settled: the next one behind it that is searched."""
HALT = 1e-5
"""Of a step, before friction in the plane comes to rest: there a slip still has a direction."""
FAINT = 1e3
"""Times what round-off leaves of a quantity: what has never been larger is asked again whether it is any."""

_DENSE = c.CFUNCTYPE(None, c.c_void_p, c.c_double, c.c_void_p, c.c_void_p)
_REFINE = c.CFUNCTYPE(None, c.c_void_p, c.c_void_p)


class Pieces:
    """Drives the events of one integration."""

    def __init__(self, run: Integration, plan: Plan) -> None:
        self.run = run
        start = run.start
        assert run.request.begin is not None
        self.handler = Handler(plan, run.system, (start.t, run.request.t_end), run.request.begin)
        self.handler.restart = run.settlers.restart
        run.settlers.restart.sums = all(contact.kind == "guarded" for contact in plan.contacts)
        self.handler.contacts.size(run.sizes.magnitude, run.sizes.time)
        self.handler.contacts.resolution = run.request.rtol
        method = run.method.contents
        # signals that events read are followed from one extreme to the next
        if np.isfinite(plan.turns):
            run.driver.run.turns, method.h_max = plan.turns, min(method.h_max, FOLLOWED * plan.turns)
        method.h_max = min(method.h_max, WATCHED * plan.anywhere)
        self._longest, self._landing = method.h_max, np.inf
        self._passing = lib.Modes(passed=-np.inf)
        self.at = 0
        """The number of the segment."""
        n = run.system.form.written
        before = run.y[:n].copy(), run.start_rate[:n].copy()
        # samples due at the start: values before them
        if plan.sampled and not start.sampled:
            run.driver.note(start.t, *before)
        self._first(self.handler.begin(start.t, *before, sampled=start.sampled))
        self.modes = EventModes(run, self.handler, self._longest) if serves(plan, run) else None
        if self.modes is not None:
            # the core's own state of passing a peak
            self._passing = self.modes.core
        self._first_step = FirstStep(run, self.handler, self._values)
        self._mode, self._open, self._begun = -1, np.full(run.driver.observed, np.inf), start.t
        self._watch()

    def _first(self, point: tuple[Floats, Floats] | None) -> None:
        """The start, where samples due at it change it."""
        if point is None:
            return
        run, n = self.run, self.run.system.form.written
        y, run.start_rate[:n] = point
        run.y[:n] = run.driver.arrive(run.start.t, y, run.start_rate[:n], run.sizes.magnitude)
        run.yd = np.where(run.roles.differential, run.start_rate, 0.0)
        run.sizes.begin_to_move(run.start.t, self._end, run.y, run.start_rate)
        run.method.start(run.start.t, run.y, run.yd)

    def _watch(self) -> None:
        self.handler.observer.know(self.run.driver.largest())
        self._array, number = self.handler.core()
        core = self.run.driver.run
        core.watch, core.watches = c.addressof(self._array), number
        # the mode that the handler is in now
        if self.modes is not None:
            self._mode = self.modes.stands()

    def _inform_handler(self) -> None:
        """The handler knows what the core has done without it."""
        if self.modes is None:
            return
        # something happened: no landing is awaited any more
        if self.modes.inform_handler() or self.modes.core.at != self.at:
            self._landing = np.inf
        self._mode, self.at = self.modes.core.now, self.modes.core.at

    def past_events(self) -> tuple[Happened, ...]:
        """The events so far."""
        self._inform_handler()
        return tuple(self.handler.happened)

    def floating(self, t: float, y: Floats, yd: Floats) -> dict[int, tuple[str, ...]]:
        """Rows of block observe that nothing determined at times, at the end of a run; y, yd [unknowns as written]."""
        self._inform_handler()
        self.handler.choices.end(t, y, yd)
        return self.handler.choices.found

    def _fire(self, t: float, before: tuple[Floats, Floats], due: list[int], which: list[Watched]) -> Point | None:
        """What the handler says, which the core learns."""
        handler, modes = self.handler, self.modes
        # without modes the handler alone knows
        if modes is None:
            return handler.fire(t, *before, samples=due, which=which)
        crossed, begin, events = modes.places(which), self._mode, len(handler.happened)
        flipped = self._flip_sides(which)
        point = handler.fire(t, *before, samples=due, which=which)
        # it has become a transition, where the core could do it
        if not (which and handler.stands(which)):
            modes.learn(begin, t, (crossed, due), (flipped, point, events))
        self._mode = modes.stands()
        return point

    def _flip_sides(self, which: Sequence[Watched]) -> Floats:
        """The sides of all relations, of those that cross the other ones [relations]."""
        flipped = self.handler.side.copy()
        for w in which:
            if w.relation >= 0:
                flipped[w.relation] = -float(w.side)
        return flipped

    @property
    def _end(self) -> float:
        """The end (s) of the segment."""
        return self.run.segments[self.at].end

    def aim(self) -> None:
        """The next step ends no later than at the next sample, or the end of the segment; a sample due where the text
        jumps reads what holds behind it.
        """
        end, sample, near = self._end, self.handler.next_sample(), self.handler.nothing
        if self.modes is not None:
            self.modes.core.segment = end
        # a sample before the end of the segment, and no later than a landing
        self.run.method.contents.t_end = min(sample if sample < end - near else end, self._landing)
        self.run.driver.run.end_kind = TRACE if sample <= min(end + near, self._landing) else 0

    def _bounce(self, t: float) -> None:
        """Steps short enough for the bounces under way at t (s), until the first must have ended."""
        run, method = self.run, self.run.method.contents
        method.h_max, before, self._landing = self._longest, self._landing, np.inf
        if run.request.method == "bdf":
            # bounces too low to be seen: parts of a flight as steps
            flight, self._landing = self.handler.low_flights(t, UNSEEN * run.request.rtol)
            method.h_max = min(flight / PARTS, self._longest)
        # the next step ends elsewhere
        if self._landing != before:
            self.aim()

    def _short(self, t: float, step: float) -> None:
        """Steps of an eighth of one that misled, until its end is passed."""
        method = self.run.method.contents
        method.h_max = max(min(step / PARTS, method.h_max), 16.0 * float(np.spacing(t)))
        self._landing = min(t + step, self._landing)
        self.aim()

    def _in_parts(self, t: float) -> None:
        """Steps from t (s) on are parts of what is being passed."""
        # a peak is still under way
        if t < self._passing.passed:
            method = self.run.method.contents
            method.h_max = min(self._passing.part, method.h_max)
            self._landing = min(self._passing.passed, self._landing)
            self.aim()

    # -- where a piece ends --------------------------------------------------------------------------------------

    def _point(self, t: float) -> tuple[Floats, Floats]:
        """y, yd [unknowns as written] at t within the last step, settled."""
        system, stepper = self.run.system, self.run.method.contents.stepper
        y, yd = np.zeros(system.form.extended), np.zeros(system.form.extended)
        _DENSE(stepper.dense)(stepper.self, t, lib.pointer(y), lib.pointer(yd))
        n = system.form.written
        y, yd, _ = self.run.settler.settle(t, y[:n], yd[:n])
        if not (np.isfinite(y).all() and np.isfinite(yd).all()):  # flows that are solved for have none there
            raise failure(self.run, "newton")
        return y, yd

    def _values(self, t: float) -> Floats:
        """Values [observed] at t within the last step, settled: what an event is located by."""
        values = np.zeros(max(self.run.driver.observed, 1))
        lib.core.sd_run_observe(self.run.driver.core, t, lib.pointer(values))
        return values[: self.run.driver.observed]

    def event(self, sink: Sink) -> float:
        """What changes within the last step, which is counted up to there; CPU seconds spent."""
        began = time.process_time()
        run, core, method = self.run, self.run.driver.run, self.run.method.contents
        stepper = method.stepper
        # what the core has done so far
        self._inform_handler()
        self.handler.before = self.handler.now()
        sides, truth = self.handler.side.copy(), self.handler.truth.copy()
        # a more accurate dense output, where the method has one
        if stepper.refine:
            _REFINE(stepper.refine)(stepper.self, c.addressof(run.settler.core.contents))
        end, begun = method.t, core.t_from == (self._begun if self.modes is None else self.modes.core.begun)
        # from where nothing had changed yet
        begin = max(self._from, min(core.t_clear, end))
        reach = core.t_seen
        while True:
            seen = reach if begin < reach < end else end
            # the first change in the stretch that was looked at
            found = self.handler.first_crossing(self._values, begin, seen)
            # nothing there: a wider stretch
            if found is None and seen < end:
                begin, reach = seen, seen + WIDER * (seen - begin)
                continue
            # nothing at all: the step counts as it is
            if found is None:
                self._accept(end, 0, sink)
                self._watch()
                return time.process_time() - began
            t, which = found
            # a zero that round-off decides: looked at again
            if self._by_round_off(which):
                continue
            # of the dense output alone: a shorter step
            step = self._first_step.shorter(which, (core.t_from, t, end)) if begun else 0.0
            if step:
                self.handler.side[:], self.handler.truth = sides, truth  # what changed within it has not yet
                self._again(core.t_from, step, sink)
                return time.process_time() - began
            self.handler.observer.know(run.driver.largest())  # what it has met in this flight, whose ends are zeros
            # the point of the event, to round-off, and what it does
            with run.settler.exactly():
                before = self._point(t)
                which += self._crossing_together(t, before, which)
                point = self._fire(t, before, [], which)
            # something changes: on from behind it
            if point is not None:
                kind = 0 if self.handler.kinks.only_peaks(which) else TRACE
                self._accept(t, kind, sink, which)
                misled = self.handler.stands(which) or (
                    begun and self._first_step.at_once(which, (core.t_from, t, end))
                )
                lib.core.sd_modes_pass(c.byref(self._passing), t, end - core.t_from, self.handler.passes)
                self._go_on(t, point, before, misled=end - core.t_from if misled else 0.0, kind=kind)
                return time.process_time() - began
            # nothing changes: look on from here
            begin = t

    def _again(self, begin: float, step: float, sink: Sink) -> None:
        """The last step counts for nothing; steps of so many s from where it began, which has its rows."""
        run, core = self.run, self.run.driver.run
        # the point at which the step began, with its rates
        with run.settler.exactly():
            y, _ = self._point(begin)
        point = y, run.start_rate[: y.size].copy()
        every, core.every_step = core.every_step, 0
        # without a row of its own
        self._accept(begin, 0, sink)
        self._go_on(begin, point, point, misled=PARTS * step, kind=0)
        core.every_step = every

    @property
    def _from(self) -> float:
        """The instant (s) from which the last step is searched."""
        return float(self.run.driver.run.t_from if self.modes is None else self.modes.core.begin)

    def _crossing_together(self, t: float, point: Point, known: Sequence[Watched] = ()) -> list[Watched]:
        """The relations beside the known ones that cross zero at t (s) too, but for round-off: one instant for all."""
        # relations not known to cross, that are on a side
        handler = self.handler
        asked = handler.side != 0.0
        asked[[w.relation for w in known if w.relation >= 0]] = False
        step = (t - self._from) / PARTS
        # none, or no time to fall in
        if not asked.any() or step <= handler.nothing:
            return []
        watched, values = handler.all_watched(), handler.observer(t, *point)
        # near zero at this instant
        near = np.abs(values[watched.row]) <= SMALL * handler.observer.largest[watched.row]
        near &= (watched.relation >= 0) & np.append(asked, False)[watched.relation]
        if not near.any():
            return []
        watched, low, here = watched.select(near), self._values(t - step), self._values(t)
        # and falling through it
        rate = watched.side * (low[watched.row] - here[watched.row]) / step
        falls = (rate > 0.0) & (watched.side * here[watched.row] <= rate * handler.nothing)
        return watched.each(falls)

    def _by_round_off(self, which: list[Watched]) -> bool:
        """Whether a relation has crossed zero within what round-off leaves of it, which is then its zero."""
        observer, run = self.handler.observer, self.run
        rows = [w.row for w in which if w.relation >= 0]
        # large beside what was open: sure
        if not any(observer.largest[row] <= FAINT * self._open[row] for row in rows):
            return False
        method, (y, yd, met) = run.method.contents, run.last()
        # what round-off leaves open here and now
        last = y, yd, group_maxima(run.system, met)
        step = max((method.t - run.start.t) / max(method.steps, 1), method.h)
        self._open = left_open(run.system, method.t, last, step).quantities
        # smaller than that is zero from now on
        faint = [row for row in rows if observer.largest[row] < self._open[row]]
        observer.largest[faint] = self._open[faint] / SMALL
        return bool(faint)

    def _accept(self, t: float, kind: int, sink: Sink, which: Sequence[Watched] = ()) -> None:
        """The last step counts up to t; rows of before the event are written with the parameters of before."""
        after, contacts = self.handler.now(), self.handler.contacts
        # rows before the event with the parameters of before
        self.handler.back(self.handler.before)
        # planar frictions halt at a point just before
        for k in contacts.halting([w.contact for w in which if w.contact >= 0]):
            begin = self.run.driver.run.t_from
            contacts.halt(k, self._values(t - HALT * (t - begin)))
        full = lib.core.sd_run_accept(self.run.driver.core, t, kind)
        # as many rows as there is room for
        while full:
            self.run.driver.drain(sink)
            full = lib.core.sd_run_drain(self.run.driver.core)
        self.run.driver.drain(sink)
        self.handler.back(after)

    def _go_on(
        self,
        t: float,
        point: tuple[Floats, Floats],
        before: tuple[Floats, Floats],
        *,
        misled: float = 0.0,
        kind: int = TRACE,
    ) -> None:
        """From a point behind an event; misled (s): by a step whose dense output crossed what the point does not; kind:
        of its row.
        """
        core = self.run.driver.run
        core.start_kind = kind
        # steps for flights under way, from here on
        self._bounce(t)
        self._begun = t
        if self.modes is not None:
            self.modes.core.begun = t
        # steps behind one that was misled are short
        if misled:
            self._short(t, misled)
        self._in_parts(t)
        self.leave(*before)
        go_on(self.run, t, t, [*point])
        core.start_kind = 0
        self._watch()

    def leave(self, y: Floats, yd: Floats) -> None:
        """What was stored at y, yd [unknowns as written] before an event, by the parameters of before; branches that
        coordinates turn are those of behind it: a store that gains there gains it from nowhere.
        """
        after = self.handler.p.copy()
        inner = [kink.branch for kink in self.handler.plan.kinks if kink.inner]
        self.handler.p[:] = self.handler.before[0]
        self.handler.p[inner] = after[inner]
        self.run.driver.leave(y, yd)
        self.handler.p[:] = after

    def sample(self, sink: Sink) -> bool:
        """What is due where a piece has met its end; whether the segment goes on."""
        run, method = self.run, self.run.method.contents
        self._inform_handler()
        end = self._end
        jumps = method.t >= end and self.at + 1 < len(run.segments)  # the text, which is first
        due = [] if jumps else self.handler.due(method.t)
        if not due and method.t < end:  # a bounce that has not come back
            self._bounce(method.t)
            self.aim()
            self._in_parts(method.t)
            return True
        # samples due: their point, settled
        if due:
            n = run.system.form.written
            y, yd = run.method.point()
            with run.settler.exactly():
                y, yd, _ = run.settler.settle(method.t, y[:n], yd[:n])
                self.handler.before = self.handler.now()
                # with relations that cross at the same instant
                point = self._fire(method.t, (y, yd), due, self._crossing_together(method.t, (y, yd)))
            run.driver.drain(sink)
            self.aim()
            # something changes: on from behind it
            if point is not None:
                self._go_on(method.t, point, (y, yd))
        return bool(due) and method.t < end

    def jump(self, segment: Segment, y: Floats, yd: Floats) -> tuple[Floats, Floats]:
        """The point behind the instant at which the text jumps, where the next segment begins; what happens has its
        rows.
        """
        self._inform_handler()
        handler, modes, t, begin = self.handler, self.modes, segment.begin, self._mode
        handler.before, events = handler.now(), len(handler.happened)
        # samples due, relations that the jump turns, relations that cross
        due, which = handler.due(t), handler.turned_relations(t, y, yd)
        which += self._crossing_together(self.run.method.contents.t, (y, yd), which)
        crossed, flipped = modes.places(which) if modes is not None else [], self._flip_sides(which)
        # events, or the jump alone
        found = handler.fire(t, y, yd, samples=due, which=which) if due or which else None
        point = found or handler.restart_at_jump(t, y, yd)
        # the jump becomes a transition too
        if modes is not None and not due:
            modes.learn(begin, t, (crossed, None), (flipped, point, events))
        # entries at the instant that the text names
        handler.happened[events:] = [replace(h, time=segment.label) for h in handler.happened[events:]]
        if len(handler.happened) > events:
            self.row_before()
        self.run.driver.run.start_kind = TRACE if due or len(handler.happened) > events else 0
        self.at += 1
        if modes is not None:
            modes.core.at = self.at
        self._bounce(t)
        self._watch()
        return point

    def row_before(self) -> None:
        """The row of the end of the last step, with the parameters of before, where it has none in the trace."""
        core, after = self.run.driver.run, self.handler.now()
        # a row is there already
        if core.every_step or core.end_kind & TRACE or self.run.method.contents.t == self.run.start.t:
            return
        self.handler.back(self.handler.before)
        lib.core.sd_run_row(self.run.driver.core, TRACE)
        self.handler.back(after)
