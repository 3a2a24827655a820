"""The runs of one simulation, each of which writes a trace.

The first is a draft where the accuracy is controlled; the last that finished is kept (trace/keeping.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.accuracy.accounts import Accounts
from sysdyn.runtime.accuracy.common_instants import Instants
from sysdyn.runtime.accuracy.compared import RunComparison
from sysdyn.runtime.accuracy.control import TAME
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.accuracy.pairs import RunSample
from sysdyn.runtime.accuracy.quantities import Quantities
from sysdyn.runtime.accuracy.way import FACTORED, HELD, SPARE, STIFF, Way
from sysdyn.runtime.events.kinks import LIVE
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.origin import Origin
from sysdyn.runtime.integrate.request import LONGEST, STEP, TRACE, Finished, Request
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Description, Floats, Ints
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.scales import group_maxima
from sysdyn.runtime.model.system import LARGE
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.trace.keeping import HeldWriter, Writer, keeping
from sysdyn.runtime.trace.trace import Column, Layout, Trace, columns_of
from sysdyn.values import dataclass

ROUGH = tuning.PERCENT
"""Of the tolerance: scaled residual of rows by which runs are compared."""
APART = 0.1
"""Of a step: rows of a draft are no nearer to each other.  With one a step the rows between the steps of others are not
seen: an amplifier then was estimated 500 times too good."""
BRIEFLY, LONGER = 24, 200
"""Steps of the windows in which Newton may fail in part of them: of a draft, of a run on steep laws."""


@dataclass(frozen=True, slots=True)
class Samples:
    """Quantities of block observe at the rows that the watcher kept, and at the last one.

    names [observed]; time [k]; kind [k] (TRACE, STEP, a sum); values [k, observed]; energy [k] (J) and constraints [k]
    are the meters; largest [observed]: values and terms met in the run; zero of one that has not ended.
    """

    names: tuple[str, ...]
    time: Floats
    kind: Ints
    values: Floats
    energy: Floats
    constraints: Floats
    largest: Floats


class Runs:
    """The runs of one simulation: each writes a trace; the last finished one is kept."""

    def __init__(self, start: ConsistentState, options: Options, way: Way) -> None:
        self.start, self.options = start, options
        description = way.system.description
        self.columns: tuple[Column, ...] = way.system.once("columns", lambda: columns_of(description))
        self.names = way.system.once("observed names", lambda: _observed_names(description))
        self.instants = Instants(options, description.layouts, len(self.names))
        self.compared = RunComparison(options, self.instants, len(self.names))
        self.accounts = Accounts(options)
        self.keeping = keeping(options.output)
        self.ceiling: Floats | None = None
        self.take(way)
        if options.events:  # laws are as the text says, whatever a run before from this start left
            description.p[[kink.branch for kink in options.events.kinks]] = LIVE
        # events write there: every run begins with these
        begin = description.p, description.switches.active
        self.begin = (begin[0].copy(), begin[1].copy()) if options.events else begin
        self.writer: Writer | None = None
        self.finished: Finished | None = None
        self.samples: list[Floats] = []
        self.done: tuple[Finished, list[Floats], Writer] | None = None
        self.controlled = False

    def derive(self, known: NDArray[np.bool_]) -> None:
        """Of the derivatives of stored quantities only the known ones [observed] are stored."""
        if not known.all():
            # columns without known derivatives lose these
            self.columns = tuple(
                replace(column, derivative=False) if column.derivative and not known[column.place] else column
                for column in self.columns
            )

    def take(self, way: Way, patience: int | None = None) -> None:
        """Goes on with another method and form; patience: steps of a run with it."""
        # the first way has none before it
        before = getattr(self, "way", way)
        self.way, self.system, self.method, self.index = way, way.system, way.method, way.index
        self.quantities = Quantities(self.system, self.columns, self.options)
        self.patience: int | None = patience
        self.patience_with_draft: int | None = None
        self.opening = 0.0
        # another form has other unknowns: what these stayed below is not known
        if before.system is not way.system:
            self.ceiling = None
        # the start as seen by another form is found anew
        if before is way or (before.system, before.index) != (way.system, way.index):
            self._origin: Origin | None = None

    @property
    def origin(self) -> Origin | None:
        """The start as the system sees it, for all runs.  Where events leave numbers behind each run has its own, as of
        a large model, which lets it go.
        """
        # events write into it, and a large one is let go between runs
        if self._origin is None and not self.options.events and self.system.unknowns <= LARGE:
            self._origin = Origin(self.system, self.start, self.index)
        return self._origin

    def request(self, rtol: float, atol: float | None, longest: float = LONGEST) -> Request:
        """One integration's request; longest: step, as part of the span."""
        # the first controlled run is the draft
        options, draft = self.options, self.controlled and self.done is None
        # a method of `auto` is tried and may be left to the next
        tried = options.method == "auto" and not self.way.lasting
        instants, kinds = self.instants.rows(compared=self.controlled, draft=draft)
        return Request(
            t_end=options.t_end,
            instants=instants,
            instant_kinds=kinds,
            every_step=options.every is None,
            sample_steps=options.sample_steps,
            extrema=options.extrema and not draft,
            rtol=rtol,
            atol=atol,
            max_steps=self.most_steps,
            max_wall=self.accounts.wall_left(),
            h_max=min(longest * (options.t_end - options.t_start), longest / LONGEST * (options.longest or np.inf)),
            index=self.index,
            stops=options.stops,
            method="bdf" if self.method == "euler" else self.method,
            stages=self._stages,
            stiff_steps=HELD if tried else STIFF,
            spare_steps=SPARE if draft and tried and self.system.unknowns <= FACTORED else 0.0,
            # of steep laws points that settle as loosely would count as failed
            settled_to=ROUGH * rtol if self.controlled and not self.system.form.scales else 0.0,
            draft=draft,
            unstrained=self._window_steps(rtol, draft=draft),
            tried=self.patience is not None,
            audited=bool(self.quantities.meters),
            opening=self.opening,
            ceiling=self.ceiling,
            apart=APART if draft and self.instants.open else 0.0,
            events=options.events or None,
            begin=self.begin,
            least_norm=options.redundancy == "minimum_norm" and self.system.leaves_out,
            max_order=1 if self.method == "euler" else options.order or lib.MAX_ORDER,
            fixed_step=options.euler_step if self.method == "euler" else None,
        )

    def _window_steps(self, rtol: float, *, draft: bool) -> int:
        """Steps of the windows in which a run is not to be strained: of a draft, which a smaller tolerance may tame; of
        steep laws, of which Newton fails at any tolerance, of a method that another one follows.
        """
        # steep laws: the bdf on trial alone is watched
        if self.system.form.scales:
            return LONGER if self.method == "bdf" and self.patience is not None and not draft else 0
        # others: the draft alone, where it is loose
        return BRIEFLY if draft and rtol > 1.01 * TAME else 0

    @property
    def _stages(self) -> tuple[int, int] | None:
        """Of radau, in the first step and at most; None: chosen.  The order of s stages is 2 s - 1."""
        # an order that the user asked for fixes the stages
        if self.method == "radau" and self.options.order is not None:
            return (self.options.order + 1) // 2, (self.options.order + 1) // 2
        # along a smooth motion from three stages up
        return (3, lib.STAGES) if self.way.smooth else None

    @property
    def most_steps(self) -> int | None:
        """The steps of a run: of the options, or of the patience with a method on trial, or with its draft."""
        drafted = self.patience_with_draft if self.done is None else None
        return min((n for n in (self.options.max_steps, self.patience, drafted) if n is not None), default=None)

    def _write(self, rows: Floats) -> None:
        """Rows of a run to where they belong: the comparison, the trace's file, the samples of requirements."""
        kind = rows[:, 1].astype(np.int32)
        traced = rows[(kind & TRACE) > 0]
        self.compared.take(rows, kind)
        assert self.writer is not None
        self.writer.append(traced)
        if self.done is not None:
            self.done[2].append(traced[:0])  # what it still has in memory comes to its file in time
        # samples of `every` and rows of the trace
        taken = rows[(kind & (TRACE | STEP)) > 0]
        if taken.size:
            # requirements want a part of these; the last one is always kept
            kept = (
                taken[self.watched(taken[:, 0], self._observe_columns(taken))]
                if self.watched is not None
                else taken[:0]
            )
            self.samples = [*self.samples[:-1], *([kept] if kept.size else []), taken[-1:]]

    def _observe_columns(self, rows: Floats) -> Floats:
        return rows[:, lib.ROW_HEAD : lib.ROW_HEAD + len(self.names)]

    def _progress(self, t: float) -> None:
        self.accounts.progress(t, another=self.controlled and self.done is None)

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
        # the first run's rows stay, whatever happens to it
        first = self.done is None
        self.samples = []
        self.watched = self.options.watch(self.names) if self.options.watch is not None else None
        self.writer = self.keeping.writer(self.layout(rtol, atol), first)
        integration = Integration(self.system, self.start, self.request(rtol, atol, longest), self.origin)
        try:
            # also an interrupt of the user leaves rows
            finished = self._integrate(integration)
        except BaseException:
            self._leave(integration, first)
            raise
        # a finished run replaces the one before
        if self.done is not None:
            self.writer.flush()
            self.keeping.take(self.writer, self.done[2])
        self.done, self.finished = (finished, self.samples, self.writer), finished
        self.opening, self.ceiling = finished.opening, finished.ceiling
        return finished

    def _integrate(self, integration: Integration) -> Finished:
        """To its end, or SolverFailure; in both cases its work is accounted for."""
        self.compared.begin()
        self.accounts.begin()
        try:
            return integration.run(self._write, self._progress)
        except SolverFailure as failure:
            # the user's wall time ended it, whatever the solver says
            left = self.accounts.wall_left()
            failure.late = left is not None and left <= 0.0
            # the patience is ours, `max_steps` the user's
            own = failure.cause == "max_steps" and self.most_steps != self.options.max_steps
            if failure.late and (own or failure.cause in ("strained", "stiff")):  # it asks for another run
                over = SolverFailure("max_wall", failure.time, failure.step)
                over.state = failure.state
                raise over from failure
            raise
        finally:
            self.accounts.add(integration)

    def _leave(self, integration: Integration, first: bool) -> None:
        """After a failure: the rows so far stay if there is no finished run to keep."""
        assert self.writer is not None
        integration.method.rest()
        # no run before: the rows so far are the trace, marked as not final
        if first:
            magnitude = group_maxima(self.system, integration.sizes.magnitude)
            nominal = self.quantities.nominal(integration.driver.largest(), magnitude)
            attributes: dict[str, str | float | int] = {**self.accounts.attributes(None), "met": 0, "judged": ""}
            self.writer.finish(nominal, attributes, final=False, events=integration.past_events())
            return
        # a run before stands: this one's rows go
        self.keeping.drop(self.writer)

    @property
    def held(self) -> Trace | None:
        """The trace of a run that is kept in memory, once it is closed."""
        writer = self.writer if self.done is None else self.done[2]
        return writer.trace if isinstance(writer, HeldWriter) else None

    def run_sampled(self, tolerance: float, longest: float) -> RunSample:
        """One run of the accuracy control; longest: step, as part of the span."""
        self.controlled = True
        # more steps than the patience allows are foreseen: not begun
        if self._hopeless(tolerance):
            raise SolverFailure("max_steps", self.options.t_start, 0.0, smooth=True)
        return self.compared.sample_run(tolerance, self.run(tolerance, None, longest), self.quantities)

    def _hopeless(self, tolerance: float) -> bool:
        """Whether the bdf would take more steps than the patience with it: on a smooth motion they grow with the power
        1 / (order + 1) of the tolerance at least.
        """
        samplings = self.compared.samplings
        # nothing to foresee by: no patience, a motion that is not smooth, no run before
        if self.patience is None or self.patience != self.most_steps or not self.accounts.smooth or not samplings:
            return False
        last = samplings[-1]
        steps: float = last.steps * (last.tolerance / tolerance) ** (1.0 / (lib.MAX_ORDER + 1))
        return steps > self.patience

    def nominal(self, finished: Finished) -> dict[str, float]:
        """Nominal value of each stored quantity: what errors of the run that stands were relative to."""
        # the run that stands was compared: its sizes
        sampled = self.compared.samplings
        if sampled and finished is self.compared.finished:
            return self.quantities.by_name(sampled[-1].largest[: self.quantities.places.size])
        return self.quantities.nominal(finished.largest, finished.magnitude)

    def open_balances(self) -> Floats:
        """What the equations of the last run leave open of the balance of each ledger by round-off."""
        assert self.finished is not None
        span = self.finished.reached - self.options.t_start
        return self.compared.left_open(self.finished, self.system).balances(span)

    def collect_samples(self) -> Samples:
        """Samples of the run that stands in the trace."""
        # before any run is done, its samples so far
        parts = self.samples if self.done is None else self.done[1]
        rows = np.concatenate(parts) if parts else np.zeros((0, lib.ROW_HEAD + 2 * len(self.names)))
        largest = np.zeros(len(self.names)) if self.done is None else self.done[0].largest
        kind, values = rows[:, 1].astype(np.int32), self._observe_columns(rows)
        return Samples(self.names, rows[:, 0], kind, values, rows[:, 6], rows[:, 7], largest)


def _observed_names(description: Description) -> tuple[str, ...]:
    rows = [description.rows[k] for k in description.rows_of("observe")]
    return tuple(row.name_of(k) for row in rows for k in range(row.size))
