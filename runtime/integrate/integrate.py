"""One integration by a method of the core: from a consistent state to rows of observed values.

The core advances in chunks of about 50 ms; between them rows are handed to `sink`, progress is shown, and Ctrl-C,
--max-steps and --max-wall are honoured.  Values at output instants are moved onto the constraints and their hidden
derivatives by the core (settled.py).
"""

from __future__ import annotations

import ctypes as c
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from sysdyn.runtime.condense.condensed import CondensedSystem
from sysdyn.runtime.condense.condenser import Forms, condense_model
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.integrate.causes import NEWTON, failure, place_failure
from sysdyn.runtime.integrate.creeping import Creeping, Windows
from sysdyn.runtime.integrate.jumps.corners import CornerPassing, serves
from sysdyn.runtime.integrate.jumps.crossing import cross
from sysdyn.runtime.integrate.jumps.exchange import Exchange
from sysdyn.runtime.integrate.jumps.pieces import Pieces
from sysdyn.runtime.integrate.jumps.segments import segments
from sysdyn.runtime.integrate.methods import Method
from sysdyn.runtime.integrate.origin import Origin
from sysdyn.runtime.integrate.request import LONGEST, ON_UNDERLYING, Finished, Request, Statistics
from sysdyn.runtime.integrate.rows.driver import Driver, Sink
from sysdyn.runtime.integrate.rows.settlers import Settlers
from sysdyn.runtime.integrate.underlying import Underlying
from sysdyn.runtime.integrate.weights.metric import kinematic_scale
from sysdyn.runtime.integrate.weights.sizes import Sizes
from sysdyn.runtime.integrate.weights.told import Told
from sysdyn.runtime.integrate.weights.unknown_roles import Roles, general_rates, roles
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.scales import ceiling, confirm_magnitudes, group_maxima
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.ordering import Order, net_order_of
from sysdyn.runtime.start.settled import Settler
from sysdyn.runtime.start.start import ConsistentState

CHUNK_SECONDS = 0.05
OPENED = ("dopri", "rosenbrock")
"""Methods that are told how long their first step may be."""
STAGED = 100_000
"""Unknowns of a system up to which radau may take more stages than three, whose factors need three times the room."""
SMOOTH = 4.5
"""Mean order of the bdf from which on a motion is smooth (of rectifiers 2.5 to 4.7)."""
Progress = Callable[[float], None]


class Integration:
    """The core's structures for one system and request; `run` drives them."""

    def __init__(self, system: System, start: ConsistentState, request: Request, origin: Origin | None = None) -> None:
        """origin: of this start, where it is known for several runs."""
        self.system, self.start, self.request = system, start, request
        self.cpu = 0.0
        self._work: tuple[Statistics, bool] | None = None
        alone = origin is None and request.events is None
        system.trim()  # of the run before
        if request.begin is not None:  # nor are the numbers part of this start that its events left
            system.description.put(request.begin[0])
            system.description.switches.set(request.begin[1])
        self.origin: Origin | None = origin or Origin(system, start, request.index)
        origin = self.origin
        self._factors = origin.factors
        self.underlying: Underlying | None = None
        self.sizes = Sizes(system, start, request, origin)
        self.y, self.yd, self.start_rate = origin.point(own=alone)
        self.roles: Roles = origin.roles
        if request.method in ON_UNDERLYING:
            self._solved, self.roles = origin.explicit
        # the stabilised form weighs its rows q' - f
        if system.form.name == "2":
            self._weigh()
        self._spare()
        self.segments = segments(start.t, request.t_end, None if request.fixed_step else request.stops)
        self.forms = self._condense()
        # matrices, settlers, then the stepper that uses both
        self._linear()
        at = start.t, self.y, self.yd
        self.settlers = Settlers(system, self.forms, request, self.sizes, self.roles, at)
        self.settler = self.settlers.settler
        if system.unknowns > LARGE:
            del origin, at
            self._leave_origin()
        self._put_away()
        system.trim(LARGE)  # what is made now stays, and little of it fits where something was let go
        self._stepper()
        # what the driver is told: rates of the start, drift, magnitudes
        keeps = self.settlers.keeps
        told = self.start_rate, self._drift(), self.sizes.magnitude
        self.driver = Driver(system, request, self.method, self.settlers.of_trace, keeps, *told)
        if self.forms is not None:
            self.driver.unread = np.asarray(self.forms.settled.unread, dtype=np.int32)
        # rosenbrock settles within a step where laws are steep
        if self.method.name == "rosenbrock" and system.form.scales and self.forms is None:
            self.method.contents.settle = self.settler.address
        if self.underlying is None and system.form.scales:
            self.driver.run.magnitude = lib.pointer(self.sizes.magnitude)
        self.pieces = Pieces(self, request.events) if request.events else None
        self.exchange = Exchange(self) if request.least_norm and system.description.switches.redundant else None
        self.corners = CornerPassing(self) if serves(self) else None
        self._spare()
        self._put_away()
        if system.unknowns > LARGE:
            del self.yd

    def _leave_origin(self) -> None:
        """Lets go of the start as one system sees it: of a large model each run has its own."""
        self.origin = None
        self.sizes.let_go()
        if self.forms is not None:  # of what is kept the method has its own
            self.roles = self.roles.put_away()

    def _spare(self) -> None:
        """Lets go of what a large model found on its way here, and would find again."""
        if self.system.unknowns > LARGE:
            # matrices of the start are found again if asked
            if self.origin is not None:
                self.origin.let_go()
            self.sizes.spare()
            self.system.spare()
            self.system.trim()

    def _put_away(self) -> None:
        """Lets go of patterns of a large model that no step reads: those of what is condensed."""
        if self.system.unknowns > LARGE and self.forms is not None:
            self.system.put_away(whole=True)
            self._put_away_of(self.forms)

    @contextmanager
    def room_left(self) -> Iterator[None]:
        """What a large run evaluates its condensed points in goes meanwhile; nothing is evaluated there."""
        if self.forms is None or self.system.unknowns <= LARGE:
            yield
            return
        self.forms.room.rest()
        yield
        self.forms.bind()
        room, run = self.forms.room, self.driver.run
        run.point, run.point_d = lib.pointer(room.y), lib.pointer(room.yd)

    def _rest_of_start(self) -> None:
        """Lets go of the start of a large run of what is kept, under way; the next one finds it where it is."""
        # small, whole or steep: its start stays
        if self.system.unknowns <= LARGE or self.forms is None or self.system.form.scales:
            return
        # rows of the start are written first
        if self.start_rate.size:
            before = time.process_time()
            lib.core.sd_run_advance(self.driver.core, 0, 0.0)
            self.cpu += time.process_time() - before
            self.driver.run.start_rate = None
            self.y = self.start_rate = np.zeros(0)
            self.start.put_away()
            for name in ("order", ("order", "net")):  # of the whole matrix, which no step takes
                self.system.forget_once(name)
        self.sizes.put_away()

    @staticmethod
    def _put_away_of(forms: Forms) -> None:
        """Lets go of the patterns of the systems that these were made of."""
        assert forms.settled.rates is not None  # found by its pattern
        for form in (forms.stepped, forms.settled):
            form.whole.put_away(whole=True)

    def _weigh(self) -> None:
        """The factors of the rows q' - f; the magnitudes of nu follow them."""
        assert self.origin is not None
        scale = kinematic_scale(self.system, self.sizes.magnitude, self.origin.jy, self.origin.jyd)
        # other weights: other entries, other magnitudes
        if (scale != self.system.kinematic_scale).any():
            self.system.kinematic_scale[:] = scale
            self.origin.weigh_entries()
            self.sizes = Sizes(self.system, self.start, self.request, self.origin)

    def _condense(self) -> Forms | None:
        """The forms without what constant sums define; None where all unknowns are integrated."""
        request = self.request
        # events, redundant constraints and fixed steps read all unknowns
        whole = request.events is not None or request.least_norm or request.fixed_step is not None
        if whole or not request.condense or request.method in ON_UNDERLYING:
            return None
        if self.system.unknowns > LARGE:
            self.system.put_away(whole=True)  # found again, if it is what is stepped
        found = condense_model(self.system, self.start.t, self.y, self.yd)
        if found is not None:
            assert self.origin is not None
            # roles of what is kept: once for all runs of one start
            if self.origin.kept is None:
                self.origin.kept = self._kept_roles(found.stepped.whole, found.stepped.kept)
            self._kept = self.origin.kept
            if self.system.unknowns > LARGE:
                self._put_away_of(found)
        self._spare()
        return found

    @property
    def stepped(self) -> System | CondensedSystem:
        """What the method sees."""
        return self.system if self.forms is None else self.forms.stepped

    def _linear(self) -> None:
        # explicit methods: a matrix of accelerations
        if self.request.method in ON_UNDERLYING:
            self.underlying = Underlying(self._solved, self.sizes.magnitude, self._factors)
            self.linear, self._order = self.underlying.linear, Order(None)
            return
        # implicit ones: of the form, or of what is kept of it
        self._order = net_order_of(self.system) if self.forms is None else self.forms.order()
        self._taken = self._factors.take(self.stepped.pattern, self._order)
        self.linear = self._taken.linear

    def _stages(self) -> tuple[int, int]:
        """Of radau: in the first step, at most."""
        if self.request.stages is not None:
            return self.request.stages
        # many stages pay on smooth systems of moderate size
        many = self.stepped.unknowns <= STAGED and not self.system.form.scales
        return 3, lib.STAGES if many else 3

    def _stepper(self) -> None:
        """Makes the method with what the request says of it, and begins it at the start."""
        request = self.request
        first, most = self._stages()
        order = self._order
        self.method = Method(request.method, self.stepped, self.linear, self._factors, order, self.underlying, most)
        method = self.method.contents
        method.rtol, method.t_end = request.rtol, self.segments[0].end
        method.h_max = request.fixed_step or request.h_max or LONGEST * (request.t_end - self.start.t)
        method.fixed_h = request.fixed_step or 0.0
        self._tell()
        # what only some methods are told
        if request.method == "bdf":
            method.max_order = request.max_order
        elif request.method == "radau":
            steep = any(scale.block == "dynamics_scale" for scale in self.system.form.scales)
            method.stages, method.balances = first, int(steep)
        elif self.underlying is not None:
            method.patience = request.stiff_steps
        if request.method == "dopri":
            method.spare = request.spare_steps
        if request.method in OPENED:
            method.opening = request.opening
        if request.method == "energy":
            self._audit = self.system.observer("audit")
            method.audit = None if self._audit is None else c.addressof(self._audit)
        # projection between steps: of implicit methods of stabilised forms
        self.projection: Settler | None = self.settlers.projection() if self.underlying is None else None
        if self.projection is not None:
            method.project = self.projection.address
        self.method.start(self.start.t, self.y, self.yd)

    def _tell(self) -> None:
        """Says to the method what each unknown that it steps is, and may be off by."""
        kept, found = None, self.roles
        # of a condensed form only what is kept
        if self.forms is not None:
            kept, found = self.forms.stepped.kept, self._kept
        self.told = Told(self.system, self.request, self.sizes, found, kept)
        self.told.tell(self.method)
        if self.forms is not None and self.system.unknowns > LARGE:
            del self._kept
        if self.system.form.scales and self.underlying is None:
            self.told.tell_steep(self.method, self.linear)

    def _kept_roles(self, whole: System, kept: Ints) -> Roles:
        """Roles of what is kept; constraints between displacements are left by their rates: no index above 2."""
        jyd = whole.slopes(self.start.t, self.y, self.yd, rate=True)
        jyd = general_rates(whole, self.start.t, self.y, self.yd, jyd)
        return roles(whole, self.start.t, jyd, min(self.request.index, 2)).select(kept)

    def last(self) -> tuple[Floats, Floats, Floats]:
        """Y and yd at the end of the last step, the largest |y| met [unknowns]."""
        y, yd = self.method.point()
        return y, yd, self.sizes.sizes_at(y)[0]

    def confirm_magnitudes(self, met: Floats, magnitude: Floats) -> Floats:
        """Magnitudes as the run confirmed them, by those it met and went by [unknowns]."""
        return confirm_magnitudes(self.system, self.request.t_end - self.start.t, met, magnitude)

    def _drift(self) -> int | None:
        """Address of what the last step was off the constraints before its method projected it."""
        # explicit methods project themselves
        if self.underlying is not None:
            return c.addressof(self.underlying.core.contents) + lib.Underlying.drift.offset
        if self.projection is not None:
            return c.addressof(self.projection.core.contents) + lib.Settle.drift.offset
        return None

    @property
    def work(self) -> tuple[Statistics, bool]:
        """Counters so far; whether the bdf takes nearly all steps at its highest order: a smooth motion."""
        # counted before the method was let go
        if self._work is not None:
            return self._work
        method = self.method.contents
        return self.statistics(), self.request.method == "bdf" and method.orders > SMOOTH * method.steps

    def past_events(self) -> tuple[Happened, ...]:
        """The events so far."""
        return self.pieces.past_events() if self.pieces is not None else ()

    def statistics(self) -> Statistics:
        """Counters so far; residuals and Jacobians of the settling at output instants not included."""
        method, core = self.method.contents, self.stepped.core
        # evaluations of the underlying equation are counted apart
        residuals, matrices = (0, 0) if self.underlying is None else self.underlying.evaluations
        return Statistics(
            method.steps,
            method.rejected_steps,
            core.residual_evaluations + residuals,
            core.jacobian_evaluations + matrices,
            self.linear.contents.factorisations,
            method.newton_failures,
        )

    def _advance(self, sink: Sink, progress: Progress | None, began: float, at: int) -> int:
        """To the end of the segment of number `at`, or of one behind it: its number."""
        if self.pieces is not None:
            self.pieces.aim()
        request, method = self.request, self.method.contents
        span = request.t_end - self.start.t
        creeping = Creeping(span, method.t, self.statistics(), draft=request.draft, tried=request.tried)
        windows = Windows(request.unstrained, self.statistics()) if request.unstrained else None
        while True:
            # as many steps as anything may want to look behind
            until = [item.steps_left(method.steps) for item in (creeping, windows, self.exchange) if item is not None]
            if request.max_steps is not None:
                until.append(max(request.max_steps - method.steps, 1))
            before = time.process_time()
            state = lib.core.sd_run_advance(self.driver.core, min(until), CHUNK_SECONDS)
            self.cpu += time.process_time() - before
            self.driver.drain(sink)
            self.system.failure.check()
            for settler in self.settlers.both:
                # a callback that failed ends the run
                settler.system.failure.check()
            if progress is not None:
                progress(method.t)
            # constraints that depend otherwise: others are left out
            if self.exchange is not None and state in (0, 3) and self.exchange.due(failed=state == 3):
                continue
            if state == 3:
                if lib.CAUSES[method.cause] in NEWTON and self._resolve_zeros():
                    continue
                raise place_failure(self, lib.CAUSES[method.cause])
            # limits of the request: steps, strain, wall time
            if request.max_steps is not None and method.steps >= request.max_steps and method.t < request.t_end:
                raise failure(self, "max_steps")
            if windows is not None and windows.is_strained(self.statistics()):
                raise failure(self, "strained")
            late = request.max_wall is not None and time.monotonic() - began > request.max_wall
            if late and method.t < request.t_end:
                raise failure(self, "max_wall")
            # something watched has changed within the last step
            if state == 4:
                assert self.pieces is not None
                self.cpu += self.pieces.event(sink)
                continue
            # the end of a piece: a sample, or the end of the segment
            if state == 1 and self.pieces is not None:
                before = time.process_time()
                more = self.pieces.sample(sink)
                self.cpu += time.process_time() - before
                if more:
                    continue
                self.driver.drain(sink)
            if state == 1:
                return next((taken.at for taken in (self.pieces, self.corners) if taken is not None), at)
            # hardly any progress for the work done
            if not creeping.goes_on(method.t, self.statistics()):
                raise failure(self, "crawl")

    def _resolve_zeros(self) -> bool:
        """Whether a step failed by what round-off leaves of unknowns that are still zero where the terms of their rows
        have grown; then their magnitudes have too, and the method begins anew at the last accepted point.
        """
        # of a large system the inverse costs too much
        if self.system.unknowns > LARGE:
            return False
        y, yd = self.method.point()
        before = self.sizes.sizes_at(y)[1].copy()
        self.sizes.share(y)
        self.sizes.resolve_by_rows(self.method.contents.t, y, yd, self.roles.state)
        self.sizes.hand_down()
        # nothing counts for more than before: no help
        if not (0.5 * self.sizes.sizes_at(y)[1] > before).any():
            return False
        self.method.start(self.method.contents.t, y, yd)
        return True

    def run(self, sink: Sink, progress: Progress | None = None, *, spent: bool = True) -> Finished:
        """To the end, or SolverFailure; rows go to `sink` in any case, the time reached [s] to `progress`.  spent:
        nobody asks for the method or the settler behind the end.
        """
        began = time.monotonic()
        self.stepped.core.residual_evaluations = self.stepped.core.jacobian_evaluations = 0
        method = self.method.contents
        at = 0
        # segment by segment: the text jumps or bends between them
        while True:
            self._rest_of_start()
            at = self._advance(sink, progress, began, at) + 1
            if at == len(self.segments):
                break
            before = time.process_time()
            cross(self, self.segments[at])
            # the last segment: no restart asks for these again
            if at + 1 == len(self.segments) and self.pieces is None and self.corners is None:
                self.sizes.spare_resolved()
            if self.corners is not None:
                self.corners.at = at
            self._put_away()
            self._spare()
            self.system.trim(LARGE)
            self.cpu += time.process_time() - before
        if spent:
            self.method.rest()
        last = self.method.last()
        found = Finished(
            method.t,
            self.statistics(),
            np.zeros(0),
            self.driver.largest(),
            self.cpu,
            self.settlers.failures,
            self.driver.ledgers,
            self.past_events(),
            self.driver.run.beyond,
            opening=method.opening if self.request.method in OPENED else 0.0,
            extrema=self.driver.extrema,
        )
        # what events leave open at the end
        if self.pieces is not None:
            n = self.system.form.written
            y, yd = last()
            found = replace(found, open=self.pieces.floating(method.t, y[:n], yd[:n]))
        if spent and self.system.unknowns > LARGE:
            del method
            self._leave_method()
        met, magnitude = self.sizes.sizes_at(last()[0], last=True)
        magnitude = self.confirm_magnitudes(met, magnitude)
        most = None if self.system.unknowns > LARGE else ceiling(self.system, met, magnitude)
        peaks = None if self.system.unknowns > LARGE else met.copy()
        magnitude, met = (group_maxima(self.system, sizes) for sizes in (magnitude, met))
        self._spare()
        return replace(found, magnitude=magnitude, last=(last, met), ceiling=most, peaks=peaks)

    def _leave_method(self) -> None:
        """Lets go of what stepped, whose work is counted: at the end of a large run the room counts too."""
        self._work = self.work
        ledgers = self.driver.ledgers
        for name in ("method", "driver", "told", "linear", "_taken", "settler", "settlers", "projection", "pieces"):
            self.__dict__.pop(name, None)
        ledgers.close()
        if self.forms is not None:
            self.forms.room.rest()
        self.system.trim()


def integrate(
    system: System,
    start: ConsistentState,
    request: Request,
    sink: Sink,
    progress: Progress | None = None,
) -> Finished:
    """One integration; see Request.  sink receives blocks of rows [k, ROW_HEAD + 2 observed] (core/run/run.h)."""
    return Integration(system, start, request).run(sink, progress)
