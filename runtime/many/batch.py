"""Many runs in the core, one after the other: structures are set up once at a nominal run, and put back for each.

Received: the nominal start with its structure, the options of a run and the method that the nominal run took; then the
numbers of the runs.  Handed back: `Results`, or a trace.  A run without a result (`state` is not DONE) is the caller's.
"""

from __future__ import annotations

import ctypes as c
import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.accuracy import control, estimate, laws, pairs
from sysdyn.runtime.accuracy.compared import BEYOND
from sysdyn.runtime.accuracy.control import DRAFT, Achieved
from sysdyn.runtime.accuracy.laws import FEW_STEPS, Law
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.accuracy.runs import APART, Runs
from sysdyn.runtime.accuracy.way import Way
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import LONGEST, TRACE, Finished, Request, Statistics
from sysdyn.runtime.judgement import allowed_share, judge, not_met_undefined
from sysdyn.runtime.many.anchors import anchors
from sysdyn.runtime.many.asked import DONE, END, ROWS, TRACES, WHY, Claim, NotApplicableError, Results, obstacle
from sysdyn.runtime.many.mass_matrix import mass_matrix
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, statements
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.scales import group_maxima, sizing
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.ordering import net_order_of
from sysdyn.runtime.simulate import close
from sysdyn.runtime.start.settled import HELD, Settler
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.rates import determined_rates
from sysdyn.runtime.trace.keeping import HeldWriter
from sysdyn.runtime.trace.trace import Trace, TraceParameter

MOST = 48
"""Instants of comparison that are taken of a run's steps, at most twice that."""
COUNTS = tuning.SAME
"""Of the largest entry of a row: what is less is round-off, or may as well vanish."""
MARGIN, LOOSER = 0.1, 3.0
"""Of the accuracy asked: what the nominal run's estimate may be; how much its tolerances are loosened at most."""
COUNTED = ("steps", "rejected_steps", "newton_failures")
"""Counters of a method's structure, the first of a pass; then factorisations, residuals, Jacobians, and those two of an
underlying equation."""
FREELY = 0.25
"""Longest step as part of the span where nothing in the rows depends on time: no event of a source can be missed."""


class Batch:
    """Structures for runs of one model, set up at its nominal start.

    keep: END, EXTREMA or TRACES; thin: numbers of the rows of the trace that are kept; free: nothing in the rows
    depends on time.  Raises NotApplicableError.
    """

    def __init__(
        self,
        way: Way,
        start: ConsistentState,
        options: Options,
        *,
        keep: int = END,
        thin: NDArray[np.integer] | None = None,
        claims: tuple[Claim, ...] = (),
        free: bool = False,
    ) -> None:
        why = obstacle(options)
        if why is not None:
            raise NotApplicableError(why)
        # only ends are wanted: rows between them need not be stored
        if keep == END and not claims:
            options = replace(options, every=None, at=())
        # what one run would do besides belongs to the first run alone
        options = replace(options, output=None, progress=None, watch=None, wall_began=None, cpu_compile=0.0)
        self.options, self.way = options, way
        way.system.own_numbers()  # the core writes there
        self._alive: list[Any] = []  # what the core has addresses of
        self.runs = Runs(start, self.options, way)
        meters = self.runs.quantities.meters
        # meters are compared in Python alone
        if meters or not self.runs.columns:
            raise NotApplicableError("accuracy is asked of a meter" if meters else "nothing is traced")
        self.system, self.start = way.system, start
        self.columns = tuple(column.name for column in self.runs.columns)
        self._thin = np.ascontiguousarray([] if thin is None or keep != TRACES else thin, dtype=np.int32)
        law = way.law
        self._targets = self._wanted_quantities()
        finest = float(np.min(self._targets, initial=1.0))
        # draft and run behind it at the tolerances that `control` would take
        tolerance = law.tolerance(finest if finest < 1.0 else 1e-4)
        draft = min(max(tolerance, law.finest) / law.ratio, law.loosest)
        fine = max(min(tolerance, law.ratio * draft), law.finest)
        # steps as long as they like: dopri tells an end without rows between
        longest = FREELY if free and way.method == "dopri" and keep == END else LONGEST
        try:
            self.passes = tuple(self._pass(k, (draft, fine)[k], longest) for k in (0, 1))
        except (SolverFailure, MemoryError) as error:
            raise NotApplicableError(f"the structures cannot be set up: {error}") from error
        self.core = lib.Many()
        self._begin()
        self._measure(longest, law, draft, fine)
        self._claims(claims)
        self.core.keep = keep
        # rates that the equations leave open are not stored
        if keep == ROWS:
            written = way.system if way.system.form.name == "3" else way.system.another("3")
            self.runs.derive(determined_rates(written, start))
        self._loosen(law)

    def _loosen(self, law: Law) -> None:
        """Tolerances as loose as the nominal run lets them be, with a margin for the others.

        What a run's estimate then misses costs it a finer run, never its promise.
        """
        guess = statements(self.system.form.at, self.system.form.written, self.system.description.initial)[0]
        # the nominal run in the core shows how much its tolerances leave over
        found = self.run(self.system.description.p[None, :], guess[None, :])
        # without a result traces cannot be had here; ends may still be for other numbers
        if found.state[0] != DONE:
            if self.core.keep == ROWS:
                raise NotApplicableError(f"the nominal run has no result in the core: {WHY[found.state[0]]}")
            return
        over = float(found.estimate[0]) / float(np.min(self._targets, initial=1.0))
        # error ~ tolerance^power: up to LOOSER times
        factor = float(np.clip((MARGIN / max(over, 1e-9)) ** (1.0 / law.power), 1.0, LOOSER))
        tolerance = self.core.tolerance
        factor = max(min(factor, law.loosest / tolerance[0]), 1.0)
        tolerance[0], tolerance[1] = factor * tolerance[0], factor * tolerance[1]

    def _keep_address(self, array: Any) -> int | None:
        """Address of an array that lives as long as this."""
        self._alive.append(array)
        return lib.pointer(array)

    def _wanted_quantities(self) -> Floats:
        options, names = self.options, list(self.runs.quantities.compared)
        target = np.full(len(names), np.inf if options.accuracy is None else options.accuracy)
        for name, wanted in options.accuracy_on:
            target[names.index(name)] = wanted
        return target

    def _pass(self, number: int, tolerance: float, longest: float) -> Integration:
        """The structures of the draft (0), or of the runs behind it (1)."""
        runs, options = self.runs, self.options
        runs.controlled, runs.instants.open = True, False  # every run is compared at instants of the draft
        # instants of the trace, and those of comparison
        request: Request = runs.request(tolerance, None, longest)
        instants, kinds = runs.instants.rows(compared=True, draft=not number)
        # what the core cannot do for many runs is switched off
        request = replace(
            request,
            instants=instants,
            instant_kinds=kinds,
            h_max=min(longest * (options.t_end - options.t_start), options.longest or np.inf),
            draft=not number,
            apart=APART if runs.instants.common is not None and not number else 0.0,
            condense=False,
            valued=False,
            extrema=options.extrema and bool(number),
            max_wall=None,
        )
        made = Integration(self.system, self.start, request)
        # dopri gives up after so many steps that stability holds
        if self.way.method == "dopri":
            made.method.contents.patience = request.stiff_steps
        return made

    def _regions(self, made: list[tuple[int, int]], zero: list[int | None]) -> tuple[Any, int]:
        """Regions (address, bytes) as they are now, and integers that begin at 0."""
        # what a run writes, as it is now: put back before the next one
        found = [(at, size, bytes(c.string_at(at, size))) for at, size in made]
        found += [(at, 4, bytes(4)) for at in zero if at]
        regions = (lib.Region * max(len(found), 1))()
        for k, (at, size, content) in enumerate(found):
            buffer = c.create_string_buffer(content, size)
            self._alive.append(buffer)
            regions[k] = lib.Region(at=at, copy=c.addressof(buffer), size=size)
        self._alive.append(regions)
        return regions, len(found)

    @staticmethod
    def _settle(settler: Settler) -> list[tuple[int, int]]:
        core = settler.core.contents
        moves = core.unknowns + core.rates
        return [(c.addressof(core), c.sizeof(lib.Settle)), (core.scale, 8 * moves)]

    def _fill(self, k: int, longest: float) -> None:
        """Pass k of the core."""
        made, system = self.passes[k], self.system
        core = made.method.contents
        # the stepper, the run, the settlers
        states = [(c.addressof(core), c.sizeof(core)), (c.addressof(made.driver.run), c.sizeof(lib.Run))]
        settlers = [made.settler, *([made.projection] if made.projection is not None else [])]
        zero = [lib.core.sd_linear_pivoted(made.linear)]
        for settler in settlers:
            states += self._settle(settler)
            zero += [lib.core.sd_linear_pivoted(settler.linear), lib.core.sd_settle_pivoted(settler.core)]
        # the underlying equation has factors of its own
        if made.underlying is not None:
            states.append((c.addressof(made.underlying.core.contents), c.sizeof(lib.Underlying)))
        zero += [lib.core.sd_linear_z_pivoted(item) for item in made.method.complex]
        # observers read the audit's families behind the unknowns
        rooms = [np.zeros(max(system.form.extended, system.unknowns) + 8) for _ in range(3)]
        made.driver.run.start_rate = lib.pointer(rooms[2])
        regions, number = self._regions(states, zero)
        kind = type(core)
        # fields of the core's structure, in its order
        field = self.core.passes[k]
        field.run, field.region, field.regions = c.addressof(made.driver.run), c.addressof(regions), number
        field.n = system.unknowns
        field.y, field.yd, field.start_rate = (self._keep_address(room) for room in rooms)
        field.differential = self._keep_address(made.roles.differential.astype(np.int32))
        field.magnitude, field.met = lib.pointer(made.sizes.magnitude), lib.pointer(made.sizes.met)
        field.least = self._keep_address(np.ascontiguousarray(made.sizes.least))
        field.project = None if made.projection is None else c.addressof(made.projection.core.contents)
        field.rtol = c.addressof(core) + kind.rtol.offset
        field.h_max = c.addressof(core) + kind.h_max.offset
        field.opening = c.addressof(core) + kind.opening.offset if hasattr(kind, "opening") else None
        field.longest = longest
        field.counter[:] = self._counters(made)

    @staticmethod
    def _counters(made: Integration) -> list[int | None]:
        """Addresses of what is counted."""
        # counters: of the method, of the matrices, of evaluations
        method, linear, own = made.method.contents, made.linear.contents, made.stepped.core
        found: list[tuple[Any, str]] = [(method, name) for name in COUNTED]
        found += [(linear, "factorisations"), (own, "residual_evaluations"), (own, "jacobian_evaluations")]
        # evaluations of the underlying equation are counted apart
        if made.underlying is not None:
            found.append((made.underlying.applied, "residual_evaluations"))
            found.append((made.underlying.matrix, "jacobian_evaluations"))
        places: list[int | None] = [c.addressof(item) + getattr(type(item), name).offset for item, name in found]
        return places + [None] * (lib.COUNTERS - len(places))

    def _begin(self) -> None:
        """The start of every run."""
        many, system, made = self.core, self.system, self.passes[1]
        n = system.form.written
        y, yd = (np.ascontiguousarray(item[:n]) for item in (self.start.y, self.start.yd))
        found = anchors(made.settler, system, self.start.t, (y, yd), made.sizes.magnitude)
        # the start of other numbers would not follow the same way
        if found is None:
            raise NotApplicableError("initial values of the text leave the start open, or move for its sake")
        self.anchored = found
        # the settler that holds these
        settler = made.settlers.settler_of("settled", found)
        settled = settler.system
        # rows written with room for what settles: the buffers of both passes are used
        extended = np.zeros(settled.form.extended), np.zeros(settled.form.extended)
        extended[0][:n], extended[1][:n] = y, yd
        core = settler.core.contents
        core.hold = HELD
        a, b = extended[0].copy(), extended[1].copy()
        # the nominal start must settle in the core as it did in Python
        failed = lib.core.sd_settle_point(settler.core, self.start.t, lib.pointer(a), lib.pointer(b))
        settled.failure.check()
        if failed:
            raise NotApplicableError("the nominal start does not settle")
        # slopes at the nominal start
        jy, jyd = settled.jacobian(self.start.t, a[:n], b[:n])
        core.hold, core.ready = HELD, 0
        many.smallest = settler.linear.contents.smallest
        # states of the settler as they begin
        factors = [lib.core.sd_linear_pivoted(settler.linear), lib.core.sd_settle_pivoted(settler.core)]
        regions, number = self._regions(self._settle(settler), factors)
        many.start, many.region, many.regions = c.addressof(core), c.addressof(regions), number
        self._alive += [settler, settled]
        many.y0, many.yd0 = self._keep_address(y.copy()), self._keep_address(yd.copy())
        many.anchored = self._keep_address(found.astype(np.int32))
        # guesses for what is not held
        guess, _, said = statements(system.form.at, n, system.description.initial)
        many.guessed, many.guess = self._keep_address((said & ~found).astype(np.int32)), self._keep_address(guess)
        many.size = self._keep_address(made.sizes.magnitude[:n].copy())
        many.jy0, many.jyd0 = self._keep_address(np.append(jy, 0.0)), self._keep_address(np.append(jyd, 0.0))
        counts = 1 * _counts(settled, jy, settler.scale[:n]) + 2 * _counts(settled, jyd, self._rates(settler, n))
        many.counts = self._keep_address(np.append(counts, 0).astype(np.int32))
        many.jy, many.jyd = self._keep_address(np.zeros(jy.size + 1)), self._keep_address(np.zeros(jy.size + 1))
        self._inertia(settled)

    @staticmethod
    def _rates(settler: Settler, n: int) -> Floats:
        """Magnitudes of the rates [n]; 0 of those that occur nowhere."""
        found = np.zeros(n)
        found[settler.rates] = settler.scale[n:]
        return found

    def _inertia(self, settled: System) -> None:
        """Where the entries of M stand."""
        many, found = self.core, mass_matrix(settled)
        many.flows, many.inertias = found.flows, found.entry.size
        places = found.row, found.column, found.entry
        many.inertia_row, many.inertia_column, many.inertia_entry = map(self._keep_address, places)
        many.inertia_rate, many.inertia_sign = self._keep_address(found.rate), self._keep_address(found.sign)
        many.inertia = self._keep_address(np.zeros(found.flows**2 + 1))

    def _measure(self, longest: float, law: Any, draft: float, fine: float) -> None:
        """Magnitudes, quantities, accuracy and room."""
        # the program: sizes, span, numbers of the model
        many, options, runs, system = self.core, self.options, self.runs, self.system
        n, columns = system.form.written, len(self.columns)
        span = options.t_end - options.t_start
        many.p, many.parameters = lib.pointer(system.description.p), system.description.p.size
        many.written, many.columns, many.observed = n, columns, self.passes[1].driver.observed
        many.t0, many.t1 = options.t_start, options.t_end
        # magnitudes of each run by its own numbers
        sizes = sizing(system)
        self._alive.append(sizes)
        many.system, many.sizing = c.addressof(system.core), c.addressof(sizes.core)
        many.order = net_order_of(system).address
        many.form_jy, many.form_jyd = (self._keep_address(np.zeros(system.pattern.entries + 1)) for _ in range(2))
        many.found, many.ceiling = (self._keep_address(np.zeros(system.unknowns + 1)) for _ in range(2))
        # both passes: draft and run
        for k in (0, 1):
            self._fill(k, min((DRAFT, 1.0)[k] * longest * span, options.longest or np.inf))
        many.column = self._keep_address(np.array([column.place for column in runs.columns], dtype=np.int32))
        many.target = self._keep_address(self._targets)
        # quantities and unknowns of one unit share the largest
        families = system.description.families
        units: dict[str, int] = {}
        own = [units.setdefault(column.unit, len(units)) for column in runs.columns]
        of = np.full(n, -1, dtype=np.int32)
        for family, first in zip(families, system.form.at, strict=False):
            if family.size and first + family.size <= n and family.unit in units:
                of[first : first + family.size] = units[family.unit]
        many.unit, many.unit_of = self._keep_address(np.array(own, dtype=np.int32)), self._keep_address(of)
        many.units, many.known = len(units), int(runs.instants.common is not None)
        # instants within the time tolerance, as `compared` has it
        asked = float(np.min(self._targets[np.isfinite(self._targets)], initial=1.0))
        many.late = min(pairs.TIMING, pairs.SHARE * asked) * span
        # the law of the method's error
        for name in ("power", "credit", "finest", "far", "ratio", "little", "growth"):
            setattr(many, name, getattr(law, name))
        many.fall = law.order
        # rules of the estimate: constants of Python are not repeated in C
        many.rules = lib.Rules(
            safety=laws.SAFETY,
            aim=estimate.AIM,
            left=estimate.LEFT,
            slowest=estimate.SLOWEST,
            stretch=estimate.STRETCH,
            unseen=estimate.UNSEEN,
            short_credit=laws.SHORT_CREDIT,
            first_drop=estimate.FIRST_DROP,
            loose=pairs.LOOSE,
            tame=control.TAME,
            beyond=BEYOND,
            hidden=pairs.UNSEEN,
            parted=pairs.PARTED,
            much=pairs.MUCH,
            bend=pairs.BEND,
            few=estimate.SHORT,
            runs=control.RUNS,
            instants=MOST,
        )
        many.few_steps, many.many_steps = FEW_STEPS, law.most
        many.tolerance[0], many.tolerance[1] = draft, fine
        many.max_steps = min(options.max_steps or 2**62, 2**62)
        many.energy = allowed_share(options)
        many.thin, many.thins = self._keep_address(np.append(self._thin, np.int32(-1))), self._thin.size
        # room for the rows of three runs: draft, run, and a finer one
        room = max(2 * MOST + 4, 0 if runs.instants.common is None else runs.instants.common.size + 4)
        for k in range(3):
            many.sample[k] = lib.RunSamples(
                time=self._keep_address(np.zeros(room)),
                value=self._keep_address(np.zeros(room * columns + 1)),
                late=self._keep_address(np.zeros(room * columns + 1)),
                number=0,
                room=room,
            )
        many.kind = self._keep_address(np.zeros(room, dtype=np.int32))
        many.work = self._keep_address(np.zeros(4 * columns + 2 * len(units) + 8))

    def _claims(self, claims: tuple[Claim, ...]) -> None:
        """Expectations that the core looks at."""
        # names to rows of the observers
        place = {name: k for k, name in enumerate(self.runs.names)}
        made = (lib.RunClaim * max(len(claims), 1))()
        for k, claim in enumerate(claims):
            within = -1 if claim.within is None else place[claim.within]
            moment = {"always": 0, "finally": 1}.get(claim.moment, 2)
            op = ("==", "!=", "<", "<=", ">", ">=").index(claim.operator)
            made[k] = lib.RunClaim(moment, op, place[claim.left], place[claim.right], within, claim.at)
        self._alive.append(made)
        self.core.claim, self.core.claims = c.addressof(made), len(claims)

    def run(self, p: Floats, anchor: Floats) -> Results:
        """Runs with numbers p [k, parameters] and initial values anchor [k, written] (guesses of all unknowns)."""
        # an entry for each run, no numbers where it has none
        number, columns = len(p), len(self.columns)
        p, anchor = np.ascontiguousarray(p), np.ascontiguousarray(anchor)
        found = Results(
            np.zeros(number, dtype=np.int32),
            np.zeros(number, dtype=np.int64),
            np.zeros(number),
            np.zeros(number),
            np.full((number, columns), np.nan),
            np.full((number, columns), np.nan),
            np.full((number, columns), np.nan),
            np.full((number, columns, self._thin.size), np.nan),
        )
        before = self.system.description.p.copy()
        # each run has its numbers in p: put back behind them
        names = ("state", "steps", "estimate", "cpu", "end", "least", "most", "traces")
        results = (lib.pointer(getattr(found, name)) for name in names)
        lib.core.sd_many_runs(c.byref(self.core), number, lib.pointer(p), lib.pointer(anchor), *results)
        self.system.description.p[:] = before
        self.system.failure.check()
        return found

    def trace(self, p: Floats, anchor: Floats, parameters: tuple[TraceParameter, ...]) -> Trace | None:
        """One run with its numbers p [parameters] and initial values anchor [written], as `simulate` hands back its
        own; None where it has no result here.  parameters: as the trace lists them.
        """
        runs, core, made = self.runs, self.core, self.passes[1]
        runs.accounts.began = time.monotonic()
        found = self.run(p[None, :], anchor[None, :])
        # the core refused or failed: `simulate` runs it itself
        if found.state[0] != DONE:
            return None
        # statistics as one run of `simulate` has them
        runs.accounts.cpu, runs.accounts.wall = core.spent, time.monotonic() - runs.accounts.began
        steps, rejected, newton, factorisations, *evaluated = core.counted
        residuals, jacobians = (evaluated[k] + evaluated[k + 2] for k in (0, 1))
        runs.accounts.statistics = Statistics(steps, rejected, residuals, jacobians, factorisations, newton)
        finished = Finished(
            self.options.t_end,
            runs.accounts.statistics,
            group_maxima(made.system, made.confirm_magnitudes(*made.sizes.sizes_at(made.method.point()[0]))),
            made.driver.largest(),
            core.spent,
            made.settler.core.contents.failures,
            made.driver.ledgers,
        )
        # the rows of the last run are still there
        rows = made.driver.rows[: core.held]
        writer = HeldWriter(replace(runs.layout(made.method.contents.rtol, None), parameters=parameters))
        writer.append(rows[(rows[:, 1].astype(np.int32) & TRACE) > 0])
        runs.done = finished, [], writer
        estimate = float(found.estimate[0])
        # judged as in Python
        judgement = judge(
            self.options, runs.method, finished.balances, True, not_met_undefined(writer.first_undefined())
        )
        close(runs, Achieved(estimate, True, 0, 0.0), judgement)
        return runs.held


def _counts(system: System, values: Floats, scale: Floats) -> NDArray[np.bool_]:
    """Which entries are more than round-off beside the largest of their row, in magnitudes of the unknowns [n]."""
    size = np.abs(values) * scale[system.pattern.columns_of()]
    largest = np.zeros(system.rows + 1)
    np.maximum.at(largest, system.pattern.row, size)
    return np.asarray((size > COUNTS * largest[system.pattern.row]) & (values != 0.0))
