"""The runs of one simulation, each of which writes a trace.

The first is a draft where the accuracy is controlled; the last that finished is kept (trace/keeping.py).
"""

from __future__ import annotations

import json
import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.events.kinks import LIVE
from sysdyn.runtime.integrate import accuracy, pairs
from sysdyn.runtime.integrate.common_instants import Thinned, beside, common, joined, known
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.options import Options, instants
from sysdyn.runtime.integrate.origin import Origin
from sysdyn.runtime.integrate.pairs import Sampled
from sysdyn.runtime.integrate.request import COMPARED, LONGEST, STEP, TRACE, Finished, Request, Statistics
from sysdyn.runtime.integrate.round_off import LeftOpen, left_open
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Description, Floats, Ints
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.scales import ROUND_OFF
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.trace.keeping import Held, Writer, keeping
from sysdyn.runtime.trace.trace import Column, Layout, Trace, columns_of
from sysdyn.values import dataclass

LONG = 1000
"""Steps of the bdf after which method auto tries radau."""
LONG_STEEP = 1_000_000
"""The same of steep laws: where they turn Newton's method holds the steps of any method, and the bdf's are cheap."""
BRIEF, BRIEF_STEEP = 1000, 20_000
"""Steps of rosenbrock after which method auto tries another: where laws are so steep that the equations are nearly of
index 2, its error test holds the steps; those of steep laws that turn often."""
HELD = 100
"""Steps that a dopri which stability holds may still have to take before method auto tries another."""
STIFF = 1e5
"""Steps that a stiff dopri which was asked for still takes."""
SPARE, FACTORED = 1.0 / LONGEST, 100
"""Steps that dopri may still take on a system much faster than its motion: no more than any method takes; unknowns of a
system of which radau's factors are cheap enough for it to take over."""

ROUGH = 1e-2
"""Of the tolerance: scaled residual of rows by which runs are compared."""
APART = 0.1
"""Of a step: rows of a draft are no nearer to each other.  With one a step the rows between the steps of others are not
seen: an amplifier then was estimated 500 times too good."""
FORETOLD = 0.01
"""Of the span: when a forecast is made."""
BEHIND = 1.5
"""Work of the run behind a draft over the draft's: a tenth of the tolerance at the orders of the methods."""

BEYOND = 100.0
"""Times its magnitude at steps: an unknown that is more within a step shows that the step passed over something."""

PURE = 1e-8
"""Angles and other pure numbers: what is round-off beside this is nothing, whatever the largest that occurs."""

KEPT = 10_000
"""Instants of rows up to which they are kept for the next run."""

METERS = {
    "audit.kinetic": 2, "audit.potential": 3, "audit.dissipated": 4, "audit.supplied": 5, "audit.energy": 6,
    "audit.constraints": 7,
}  # fmt: skip
"""Places of the audit's members in a row."""


@dataclass(frozen=True, slots=True)
class Way:
    """A method on a form of the model; index: of the form as the error test takes it, name: as the trace names it;
    reason: why method auto takes it; smooth: the motion is long and smooth, however steep its laws.
    """

    method: str
    system: System
    index: int
    name: str
    reason: str = ""
    smooth: bool = False

    @property
    def law(self) -> accuracy.Law:
        """How its errors follow its tolerance."""
        return accuracy.law_of(self.method, steep=bool(self.system.form.scales), smooth=self.smooth)


@dataclass(frozen=True, slots=True)
class Samples:
    """Quantities of block observe at the rows that the watcher kept, and at the last one.

    names [observed]; time [k]; kind [k] (TRACE, STEP, a sum); values [k, observed]; energy [k] (J) and constraints [k]
    are the meters.
    """

    names: tuple[str, ...]
    time: Floats
    kind: Ints
    values: Floats
    energy: Floats
    constraints: Floats


@dataclass(frozen=True, slots=True)
class _Joined:
    """Instants of comparison [s]; instants and kinds of rows with these among them; of a draft these alone."""

    compared: Floats
    every: tuple[Floats, Ints]
    draft: tuple[Floats, Ints]

    @classmethod
    def of(cls, times: Floats, kinds: Ints, compared: Floats) -> _Joined:
        """Of instants and kinds of rows."""
        every = joined(times, kinds, compared)
        use = (every[1] & COMPARED) > 0
        return cls(compared, every, (every[0][use], every[1][use]))


class Runs:
    """The runs of one simulation: each writes a trace; the last finished one is kept."""

    def __init__(self, start: ConsistentState, options: Options, way: Way) -> None:
        self.start, self.options = start, options
        self.take(way)
        self.columns: tuple[Column, ...] = self.system.once("columns", lambda: columns_of(self.system.description))
        self.places = np.array([column.place for column in self.columns], dtype=np.int64)
        if options.events:  # laws are as the text says, whatever a run before from this start left
            self.system.description.p[[kink.branch for kink in options.events.kinks]] = LIVE
        # events write there: every run begins with these
        begin = self.system.description.p, self.system.description.switches.active
        self.begin = (begin[0].copy(), begin[1].copy()) if options.events else begin
        self.names = self.system.once("observed names", lambda: _observed_names(self.system.description))
        self.instants, self.kinds, self.common, self._joined = self._instants()
        self.keeping = keeping(options.output)
        self.statistics, self.last_statistics = Statistics(), Statistics()
        self.smooth = False
        self.cpu = self.wall = 0.0
        self.number = 0
        self.began = time.monotonic()
        self.writer: Writer | None = None
        self.finished: Finished | None = None
        self.rows: list[Floats] = []
        self.samples: list[Floats] = []
        self.done: tuple[Finished, list[Floats], Writer] | None = None
        self.samplings: tuple[Sampled, ...] = ()
        self._opened: tuple[Finished, LeftOpen] | None = None
        self.jumps: Floats | None = None
        self.controlled = False
        self.forecast: float | None = None
        self.open = options.every is not None
        self.compared_at: Floats | None = None

    def derive(self, known: NDArray[np.bool_]) -> None:
        """Of the derivatives of stored quantities only the known ones [observed] are stored."""
        if not known.all():
            self.columns = tuple(
                replace(column, derivative=False) if column.derivative and not known[column.place] else column
                for column in self.columns
            )

    def _instants(self) -> tuple[Floats, Ints, Floats | None, _Joined | None]:
        """Instants [s] of rows and their kinds; those at which runs are compared where they are known (while it is
        open, those from which a draft takes its own), and both together.  The run before had the same, or others.
        """
        options, layouts = self.options, self.system.description.layouts
        asked = options.t_start, options.t_end, options.every, options.at, options.sampled_at
        before = layouts.get("instants")
        if before is None or before[0] != asked:
            times, kinds = instants(options)
            compared = known(times, options)
            both = None if compared is None else _Joined.of(times, kinds, compared)
            before = asked, (times, kinds, compared, both)
            if times.size <= KEPT:
                layouts["instants"] = before
        return before[1]

    def take(self, way: Way, patience: int | None = None) -> None:
        """Goes on with another method and form; patience: steps of a run with it."""
        before = getattr(self, "way", way)
        self.way, self.system, self.method, self.index = way, way.system, way.method, way.index
        self._beside: tuple[Floats, Floats, Floats] | None = None
        self.patience: int | None = patience
        self.opening = 0.0
        self._compared_before = getattr(self, "common", None)
        if before is way or (before.system, before.index) != (way.system, way.index):
            self._origin: Origin | None = None

    def take_back(self, way: Way) -> None:
        """Goes on as before the last `take`: the next run is compared where that of the method before it was."""
        instants = self._compared_before
        self.take(way)
        self.common = instants

    @property
    def origin(self) -> Origin | None:
        """The start as the system sees it, for all runs.  Where events leave numbers behind each run has its own, as of
        a large model, which lets it go.
        """
        if self._origin is None and not self.options.events and self.system.unknowns <= LARGE:
            self._origin = Origin(self.system, self.start, self.index)
        return self._origin

    def request(self, rtol: float, atol: float | None, longest: float = LONGEST) -> Request:
        """One integration's request; longest: step, as part of the span."""
        options, draft = self.options, self.controlled and self.done is None
        instants, kinds = self.instants, self.kinds
        if self.controlled and self.common is not None:
            instants, kinds = self.with_common(self.common, draft=draft)
        left = None if options.max_wall is None else options.max_wall - (time.monotonic() - self.began)
        return Request(
            t_end=options.t_end,
            instants=instants,
            instant_kinds=kinds,
            every_step=options.every is None,
            sample_steps=options.sample_steps,
            rtol=rtol,
            atol=atol,
            max_steps=self.most_steps,
            max_wall=left,
            h_max=min(longest * (options.t_end - options.t_start), longest / LONGEST * (options.longest or np.inf)),
            index=self.index,
            stops=options.stops,
            method="bdf" if self.method == "euler" else self.method,
            stages=(3, lib.STAGES) if self.way.smooth else None,
            stiff_steps=HELD if options.method == "auto" else STIFF,
            spare_steps=SPARE if draft and options.method == "auto" and self.system.unknowns <= FACTORED else 0.0,
            settled_to=ROUGH * rtol if self.controlled else 0.0,
            draft=draft,
            # of steep laws Newton fails at any tolerance
            unstrained=draft and rtol > 1.01 * accuracy.TAME and not self.system.form.scales,
            audited=bool(self.meters),
            opening=self.opening,
            apart=APART if draft and self.open else 0.0,
            events=options.events or None,
            begin=self.begin,
            least_norm=options.redundancy == "minimum_norm" and bool(self.system.left_out),
            max_order=1 if self.method == "euler" else lib.MAX_ORDER,
            fixed_step=options.euler_step if self.method == "euler" else None,
        )

    def with_common(self, compared: Floats, *, draft: bool) -> tuple[Floats, Ints]:
        """Instants and kinds with those of comparison; of a draft these alone."""
        if self._joined is None or self._joined.compared is not compared:
            self._joined = _Joined.of(self.instants, self.kinds, compared)
        return self._joined.draft if draft else self._joined.every

    @property
    def most_steps(self) -> int | None:
        """The steps of a run: of the options, or of the patience with a method on trial."""
        return min((n for n in (self.options.max_steps, self.patience) if n is not None), default=None)

    def _write(self, rows: Floats) -> None:
        kind = rows[:, 1].astype(np.int32)
        traced = rows[(kind & TRACE) > 0]
        self._compare(rows, kind)
        assert self.writer is not None
        self.writer.append(traced)
        if self.done is not None:
            self.done[2].append(traced[:0])  # what it still has in memory comes to its file in time
        taken = rows[(kind & (TRACE | STEP)) > 0]
        if taken.size:
            kept = taken[self.watched(taken[:, 0], self._observed(taken))] if self.watched is not None else taken[:0]
            self.samples = [*self.samples[:-1], *([kept] if kept.size else []), taken[-1:]]

    def _compare(self, rows: Floats, kind: Ints) -> None:
        """Keeps what runs are compared by: rows at the instants of the run before, and its own, thinned."""
        if self.options.every is None:
            self.thinned.take(rows[(kind & TRACE) > 0])
        if (kind & COMPARED).any():
            self.rows.append(rows[(kind & COMPARED) > 0])

    def _observed(self, rows: Floats) -> Floats:
        return rows[:, lib.ROW_HEAD : lib.ROW_HEAD + len(self.names)]

    def _progress(self, t: float) -> None:
        options = self.options
        span = options.t_end - options.t_start
        fraction = (t - options.t_start) / span if span > 0.0 else 1.0
        left = self._left(fraction)
        if options.progress is not None:
            options.progress(fraction, left)

    def _left(self, fraction: float) -> float | None:
        """Seconds to the end of the runs that are foreseen; None before a hundredth of the first."""
        if not FORETOLD <= fraction < 1.0:
            return None if fraction < 1.0 else 0.0
        spent = time.monotonic() - self.run_began
        whole = spent / fraction
        left = whole - spent + (BEHIND * whole if self.controlled and self.done is None else 0.0)
        if self.forecast is None:
            self.forecast = time.monotonic() - self.began + left
        return left

    def layout(self, rtol: float, atol: float | None) -> Layout:
        """What a trace holds before its first row."""
        attributes: dict[str, str | float | int] = {
            **self.options.attributes,
            "method": self.method,
            "index": self.way.name,
            "start_strategy": self.start.strategy,
            "rtol": float(rtol),
            "atol": float(atol or 0.0),
        }
        return Layout(self.columns, len(self.names), attributes, self.options.parameters)

    def run(self, rtol: float, atol: float | None, longest: float = LONGEST) -> Finished:
        """One integration into a file; SolverFailure, KeyboardInterrupt leave what was computed."""
        first = self.done is None
        self.samples = []
        self.watched = self.options.watch(self.names) if self.options.watch is not None else None
        self.writer = self.keeping.writer(self.layout(rtol, atol), first)
        integration = Integration(self.system, self.start, self.request(rtol, atol, longest), self.origin)
        try:
            finished = self._integrate(integration)
        except BaseException:
            self._leave(integration, first)
            raise
        if self.done is not None:
            self.writer.flush()
            self.keeping.take(self.writer, self.done[2])
        self.done, self.finished = (finished, self.samples, self.writer), finished
        self.opening = finished.opening
        return finished

    def _integrate(self, integration: Integration) -> Finished:
        """To its end, or SolverFailure; in both cases its work is accounted for."""
        self.number += 1
        self.rows, self.thinned = [], Thinned()
        self.run_began = time.monotonic()
        try:
            return integration.run(self._write, self._progress)
        finally:
            self._account(integration, self.run_began)

    def _account(self, integration: Integration, wall: float) -> None:
        self.cpu += integration.cpu
        self.wall += time.monotonic() - wall
        self.last_statistics, self.smooth = integration.statistics(), integration.smooth
        self.statistics = self.statistics + self.last_statistics

    def _leave(self, integration: Integration, first: bool) -> None:
        """After a failure: the rows so far stay if there is no finished run to keep."""
        assert self.writer is not None
        if first:
            nominal = self.nominal(integration.driver.largest(), integration.sizes.magnitude)
            attributes: dict[str, str | float | int] = {**self.last_attributes(None), "met": 0, "judged": ""}
            self.writer.finish(nominal, attributes, final=False, events=integration.happened())
            return
        self.keeping.drop(self.writer)

    def sizes(self, largest: Floats, magnitude: Floats) -> Floats:
        """What errors of the stored quantities are relative to [columns]: the largest met (largest [observed]), but no
        less than round-off of the largest of the same unit, unknowns (magnitude [unknowns]) among them.
        """
        return np.asarray(np.maximum(largest[self.places], ROUND_OFF * self.beside(largest, magnitude)))

    def beside(self, largest: Floats, magnitude: Floats) -> Floats:
        """The largest of the unit of each stored quantity [columns], unknowns among them."""
        last = self._beside
        if last is not None and last[0] is largest and last[1] is magnitude:
            return last[2]
        of_unknowns, of_columns, number = self.system.once("units", self._units)
        found = np.zeros(number)
        found[0] = PURE
        np.fmax.at(found, of_unknowns, magnitude[: of_unknowns.size])
        np.fmax.at(found, of_columns, largest[self.places])
        self._beside = largest, magnitude, np.asarray(found[of_columns])
        return self._beside[2]

    def _units(self) -> tuple[Ints, Ints, int]:
        """Number of the unit of each unknown as written and of each stored quantity, and how many units there are; 0:
        pure numbers.
        """
        system, number = self.system, {"1": 0}
        of_family = [number.setdefault(family.unit, len(number)) for family in system.description.families]
        of_columns = [number.setdefault(column.unit, len(number)) for column in self.columns]
        of_unknowns = np.array([*of_family, 0], dtype=np.int32)[system.family_of[: system.form.written]]
        return of_unknowns, np.array(of_columns, dtype=np.int32), len(number)

    def nominal(self, largest: Floats, magnitude: Floats) -> dict[str, float]:
        """Nominal magnitude of each stored quantity."""
        return self._named(self.sizes(largest, magnitude))

    def terms(self, largest: Floats) -> dict[str, float]:
        """Largest terms of each stored quantity, where it is a difference; largest [observed]."""
        return self._named(largest[self.places])

    def _named(self, values: Floats) -> dict[str, float]:
        return dict(zip((column.name for column in self.columns), values.tolist(), strict=True))

    @property
    def held(self) -> Trace | None:
        """The trace of a run that is kept in memory, once it is closed."""
        writer = self.writer if self.done is None else self.done[2]
        return writer.trace if isinstance(writer, Held) else None

    def last_attributes(self, error_estimate: float | None) -> dict[str, str]:
        """Statistics and timings as JSON."""
        found = {"statistics": json.dumps(self.statistics_object(error_estimate))}
        if self.options.timings:
            found["timings"] = json.dumps(self.timings())
        return found

    def statistics_object(self, error_estimate: float | None) -> dict[str, Any]:
        """The counters of all runs, with the estimate."""
        counted = {name: getattr(self.statistics, name) for name in Statistics.__slots__}
        return {**counted, "error_estimate": error_estimate}

    def timings(self) -> dict[str, float]:
        """cpu_integrate_s, wall_integrate_s, cpu_compile_s, wall_total_s; forecast_s of a longer one."""
        began = self.options.wall_began
        total = time.monotonic() - (self.began if began is None else began)
        foretold = {} if self.forecast is None else {"forecast_s": self.forecast}
        return {
            **foretold,
            "cpu_integrate_s": self.cpu,
            "wall_integrate_s": self.wall,
            "cpu_compile_s": self.options.cpu_compile,
            "wall_total_s": total,
        }

    def sampled(self, tolerance: float, longest: float) -> Sampled:
        """One run of the accuracy control; longest: step, as part of the span."""
        self.controlled = True
        if self._hopeless(tolerance):
            raise SolverFailure("max_steps", self.options.t_start, 0.0, smooth=True)
        finished = self.run(tolerance, None, longest)
        rows = np.concatenate(self.rows) if self.rows else np.zeros((0, self._width))
        if self.open:
            self.common, self.open = rows[:, 0], False
        instants, there = self.common, None
        if self.options.every is None:
            self.common = common(self.thinned.time, self.options)
            own = self.thinned.rows(self.common)
            there = self._sampled(own, finished), self._late(own, steps=True)
        self.compared_at = instants if instants is not None else self.common
        values = there[0] if there is not None and instants is None else self._sampled(rows, finished)
        sizes = np.append(self.sizes(finished.largest, finished.magnitude), [*map(self._turned_over, self.meters)])
        noise = pairs.ROUND_OFF * self.beside(finished.largest, finished.magnitude)
        noise = np.append(noise, np.zeros(len(self.meters)))
        jumps = np.unique([e.time for e in finished.events]) if finished.events else np.zeros(0)
        last, self.jumps = self.jumps, jumps
        span = self.options.t_end - self.options.t_start
        assert self.compared_at is not None
        between = beside(self.compared_at, jumps if last is None else last, jumps, span)
        counted = finished.statistics
        late = self._late(rows) if instants is not None else 0.0
        open_ = partial(self._open_quantities, finished)
        found = Sampled(tolerance, values, sizes, counted.steps, noise, open_, between, late, there)
        self.samplings = (*self.samplings[-1:], found)
        return found

    def _hopeless(self, tolerance: float) -> bool:
        """Whether the bdf would take more steps than the patience with it: on a smooth motion they grow with the power
        1 / (order + 1) of the tolerance at least.
        """
        if self.patience is None or self.patience != self.most_steps or not self.smooth or not self.samplings:
            return False
        last = self.samplings[-1]
        steps: float = last.steps * (last.tolerance / tolerance) ** (1.0 / (lib.MAX_ORDER + 1))
        return steps > self.patience

    def _left_open(self, finished: Finished) -> LeftOpen:
        """Asked of the equations once a run: of its quantities, and of each of its ledgers."""
        if self._opened is None or self._opened[0] is not finished:
            assert finished.last is not None
            step = (finished.reached - self.options.t_start) / max(finished.statistics.steps, 1)
            self._opened = finished, left_open(self.system, finished.reached, finished.last, step)
        return self._opened[1]

    def _open_quantities(self, finished: Finished) -> Floats:
        """What the equations of a run leave open of each compared quantity by round-off."""
        return np.append(self._left_open(finished).quantities[self.places], np.zeros(len(self.meters)))

    def open_balances(self) -> Floats:
        """What the equations of the last run leave open of the balance of each ledger by round-off."""
        assert self.finished is not None
        return self._left_open(self.finished).balances(self.finished.reached - self.options.t_start)

    def _sampled(self, rows: Floats, finished: Finished) -> Floats:
        """The compared quantities [k, quantities] at rows."""
        if finished.beyond > BEYOND:
            rows = np.full_like(rows, np.nan)
        return rows[:, [*(lib.ROW_HEAD + self.places).tolist(), *(METERS[name] for name in self.meters)]]

    def _late(self, rows: Floats, *, steps: bool = False) -> Floats:
        """What the compared quantities move by within the time tolerance at these rows [k, quantities]; steps: rows of
        the run's own steps, whose rates are those of the equations.
        """
        places, options = lib.ROW_HEAD + self.places, self.options
        asked = min((a for a in (options.accuracy, *(w for _, w in options.accuracy_on)) if a is not None), default=0.0)
        tau = min(pairs.TIMING, pairs.SHARE * asked) * (options.t_end - options.t_start)
        rates = rows[:, places + len(self.names)]
        late = pairs.lateness(rows[:, 0], rows[:, places], rates, tau) if steps else tau * np.abs(rates)
        return np.hstack([late, np.zeros((len(rows), len(self.meters)))]) if self.meters else late

    @property
    def _width(self) -> int:
        return lib.ROW_HEAD + 2 * len(self.names)

    @property
    def meters(self) -> tuple[str, ...]:
        """Members of the audit of which accuracy is asked, though they are not traced."""
        names = {column.name for column in self.columns}
        return tuple(name for name, _ in self.options.accuracy_on if name in METERS and name not in names)

    @property
    def compared(self) -> tuple[str, ...]:
        """Names of the quantities of `sampled`."""
        return (*(column.name for column in self.columns), *self.meters)

    def _turned_over(self, meter: str) -> float:
        """What an error of a meter is relative to: the norm of constraints is scaled, energies are what went round."""
        assert self.finished is not None
        turnover = sum(b.turnover for b in self.finished.balances if b.kind == "energy" and b.unit == "J")
        return 1.0 if meter == "audit.constraints" else turnover

    def worst(self, target: Floats) -> tuple[str, float, float | None]:
        """Of the last two runs: the quantity whose difference is largest beside what is asked of it (target
        [compared]), that, and the first instant [s] at which it differs by more.
        """
        asked = {name: float(wanted) for name, wanted in zip(self.compared, target, strict=True)}
        name = min(asked, key=lambda n: asked[n], default="")
        if len(self.samplings) < 2 or self.samplings[0].own[0].shape != self.samplings[1].values.shape:
            return name, asked.get(name, 0.0), None
        one, two = self.samplings
        assert self.compared_at is not None
        size = (one if one.tolerance < two.tolerance else two).largest
        with np.errstate(all="ignore"):
            ratio = pairs.apart(one, two) / (size * target)
        ratio = np.where(np.isfinite(ratio), ratio, np.where(np.isfinite(target), np.inf, 0.0))
        ratio = np.where((one.own[0] == two.values) | pairs.zero(one, two, target), 0.0, ratio)
        ratio[two.between] = 0.0
        k = int(np.argmax(ratio.max(axis=0)))
        beyond = np.flatnonzero(ratio[:, k] > 1.0)
        name = self.compared[k]
        return name, asked[name], float(self.compared_at[beyond[0]]) if beyond.size else None

    def collected(self) -> Samples:
        """Samples of the run that stands in the trace."""
        parts = self.samples if self.done is None else self.done[1]
        rows = np.concatenate(parts) if parts else np.zeros((0, lib.ROW_HEAD + 2 * len(self.names)))
        return Samples(
            self.names, rows[:, 0], rows[:, 1].astype(np.int32), self._observed(rows), rows[:, 6], rows[:, 7]
        )


def _observed_names(description: Description) -> tuple[str, ...]:
    rows = [description.rows[k] for k in description.rows_of("observe")]
    return tuple(row.named(k) for row in rows for k in range(row.size))
