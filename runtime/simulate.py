"""From a bound compiled model to a trace: start, structure, index form, accuracy, trace.

Receives manifest, binding, carrier and options; hands back an `Outcome`.  The first run streams into the file itself;
a finer run into a neighbour `.NAME.part` that takes its place when it is finished: whatever is killed, a readable trace
stands at the path.
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.runtime import core_library as lib
from sysdyn.runtime.accuracy import FINEST, Achieved, Sampled, control
from sysdyn.runtime.carrier import Carrier
from sysdyn.runtime.description import Description, Floats, Ints, describe, element
from sysdyn.runtime.failures import NoSuchForm, SolverFailure
from sysdyn.runtime.integrate import Integration
from sysdyn.runtime.rates import determined
from sysdyn.runtime.request import COMPARED, STEP, TRACE, Finished, Request, Statistics
from sysdyn.runtime.scales import ROUND_OFF
from sysdyn.runtime.start import ConsistentState, consistent_start
from sysdyn.runtime.structure import Structure, index_of, structure
from sysdyn.runtime.system import System
from sysdyn.runtime.trace import Column, Parameter, TraceWriter, columns_of
from sysdyn.runtime.underlying import obstacle

FINE = 1e-4
"""Accuracy from which method auto takes radau."""
LONG = 1000
"""Steps of the bdf after which method auto tries radau, and of a stiff dopri."""
STIFF = 1e5
"""Steps that a stiff dopri which was asked for still takes."""
FINEST_RADAU = 1e-17
"""Smallest tolerance of Radau: its error test works with a tenth of the power 2/3 of it (core/radau.h)."""
COMPARISONS = 200
"""Instants at which the runs of the accuracy control are compared, where the grid gives fewer."""

Progress = Callable[[float, float | None], None]
"""Fraction of the span done, seconds left (None: not known yet)."""


@dataclass(frozen=True, slots=True)
class Options:
    """What `sysdyn simulate` asks for.  Times in s.

    every: interval of the trace (None: accepted steps); at: further instants of the trace; sampled_at: instants of
    samples alone; accuracy relative to the largest value of each traced quantity, accuracy_on: (name, accuracy) of
    single ones (the others are then free if `accuracy` is None); rtol, atol: the solver's own, switch the control
    off; euler_step: of method "euler"; stops: ascending instants at which the text jumps or has kinks: a step ends and
    the integration restarts there; redundancy: what becomes of redundant constraints: drop (the last written of each
    dependent group is left out), minimum_norm (the least multipliers), error (the caller has seen to it);
    sample_steps: hand the sides of expects back at accepted steps too.
    """

    output: str | Path
    t_start: float
    t_end: float
    every: float | None = None
    at: tuple[float, ...] = ()
    sampled_at: tuple[float, ...] = ()
    accuracy: float | None = 1e-4
    accuracy_on: tuple[tuple[str, float], ...] = ()
    rtol: float | None = None
    atol: float | None = None
    method: str = "auto"
    index: str = "auto"
    euler_step: float | None = None
    stops: Floats | None = None
    redundancy: str = "error"
    max_steps: int | None = None
    max_wall: float | None = None
    sample_steps: bool = False
    timings: bool = True
    cpu_compile: float = 0.0
    wall_began: float | None = None
    progress: Progress | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)
    parameters: tuple[Parameter, ...] = ()


@dataclass(frozen=True, slots=True)
class Samples:
    """All quantities of block observe at trace instants and (with sample_steps) accepted steps.

    names [observed]; time [k]; kind [k] (TRACE, STEP, a sum); values [k, observed]; energy [k] (J) and constraints [k]
    are the meters.  Where no quantity asks for samples there is the last row alone.
    """

    names: tuple[str, ...]
    time: Floats
    kind: Ints
    values: Floats
    energy: Floats
    constraints: Floats


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a simulation did.  statistics and timings as the trace holds them; reached [s]; error_estimate relative
    (None without accuracy control); warnings: sentences; failure: of a run that stopped (its trace has final = 0).
    """

    trace: Path
    final: bool
    reached: float
    statistics: dict[str, Any]
    timings: dict[str, float]
    error_estimate: float | None
    method: str
    index: str
    start: ConsistentState
    structure: Structure
    samples: Samples
    warnings: tuple[str, ...]
    failure: SolverFailure | None = None


def choose_index(wanted: str, facts: Structure, method: str = "auto") -> tuple[str, int, tuple[str, ...]]:
    """Form of the runtime, its index, warnings.  Raises NoSuchForm for a method that cannot integrate the form."""
    written = facts.index
    if wanted == "auto" and method == "dopri":
        wanted = "0"
    if method == "dopri" and wanted != "0":
        raise NoSuchForm(f"method dopri integrates the underlying equation, index 0, and index {wanted} was asked for")
    if wanted == "0":
        return "0", 1, ()
    if written is None:
        return "3", 2, ("the model's index could not be determined: integrated as written",)
    if wanted == "auto":
        if written == 3:
            return "2", 2, ()
        note = (f"index {written} is integrated as written: expect large errors",) if written > 3 else ()
        return "3", written, note
    if wanted == "3":
        note = ("index 3 integrated directly: about 100 times less accurate than the stabilised form",)
        return "3", written, note if written >= 3 else ()
    if wanted == "2":
        return ("2", 2, ()) if written >= 3 else ("3", written, ())
    if wanted == "2v":
        return "2v", min(written, 2), ()
    if wanted == "1":
        return "1", min(written, 1), ()
    raise ValueError(f"index {wanted}: auto, 3, 2, 2v, 1 or 0")


def choose_method(options: Options) -> str:
    """The method of the core, or euler, with which a simulation begins; ValueError for what does not exist.

    auto: radau from an accuracy of FINE on, else bdf.  Measured over the seed's models (CPU of radau over that of bdf,
    geometric mean): 1.08 at 1e-2, 0.78 at 1e-4 and 1e-6, about 0.5 at 1e-9.  The underlying equation (index 0) is
    begun with dopri.
    """
    if options.method == "auto" and options.index == "0":
        return "dopri"
    if options.method == "auto":
        wanted = [options.accuracy or 1.0, *(accuracy for _, accuracy in options.accuracy_on)]
        own = options.rtol is not None or options.atol is not None
        return "radau" if min(wanted) <= FINE and not own else "bdf"
    if options.method in ("bdf", "radau", "dopri", "euler"):
        return options.method
    raise ValueError(f"method {options.method}: auto, bdf, radau, dopri or euler")


def instants(options: Options) -> tuple[Floats, Ints]:
    """Instants and kinds of rows: grid, --at, comparison.  Raises ValueError for instants outside the span."""
    t0, t1 = options.t_start, options.t_end
    outside = [t for t in options.at if not t0 <= t <= t1]
    if outside:
        raise ValueError(f"instant {outside[0]:g} s lies outside {t0:g} .. {t1:g} s")
    wanted = np.asarray(options.at, dtype=np.float64)
    if options.every is not None:
        number = int(np.floor((t1 - t0) / options.every * (1.0 + 1e-12)))
        grid = np.minimum(t0 + options.every * np.arange(number + 1), t1)
        if t1 - grid[-1] < 1e-9 * options.every:
            grid[-1] = t1
        wanted = np.concatenate([wanted, grid])
    # both ends are always there
    wanted = np.unique(np.concatenate([wanted, [t0, t1]]))
    thin = wanted[:: max(1, wanted.size // COMPARISONS)]
    compared = np.unique(np.concatenate([thin, [t1]]))
    if options.rtol is not None or options.atol is not None or options.method == "euler":
        compared = wanted[:0]  # one run: nothing is compared
    elif compared.size < COMPARISONS // 2:
        compared = np.unique(np.concatenate([compared, np.linspace(t0, t1, COMPARISONS + 1)]))
    sampled = np.asarray(options.sampled_at, dtype=np.float64)
    every = np.unique(np.concatenate([wanted, compared, sampled]))
    kinds = (
        TRACE * np.isin(every, wanted) + COMPARED * np.isin(every, compared) + STEP * np.isin(every, sampled)
    )
    return every, kinds.astype(np.int32)


class _Runs:
    """The runs of one simulation: each writes a trace; the last finished one stands at the path."""

    def __init__(
        self, system: System, start: ConsistentState, options: Options, index: int, method: str
    ) -> None:
        self.system, self.start, self.options, self.index, self.method = system, start, options, index, method
        self.columns: tuple[Column, ...] = columns_of(system.description)
        self.names = _observed_names(system.description)
        self.instants, self.kinds = instants(options)
        self.path = Path(options.output)
        self.target = self.path.resolve()
        self.statistics, self.last_statistics = Statistics(), Statistics()
        self.cpu = self.wall = 0.0
        self.number = 0
        self.patience: int | None = None
        self.began = time.monotonic()
        self.writer: TraceWriter | None = None
        self.finished: Finished | None = None
        self.rows: list[Floats] = []
        self.samples: list[Floats] = []
        self.done: tuple[Finished, list[Floats], TraceWriter] | None = None

    def request(self, rtol: float, atol: float | None, magnitude: Floats | None) -> Request:
        """One integration's request."""
        options = self.options
        left = None if options.max_wall is None else options.max_wall - (time.monotonic() - self.began)
        return Request(
            t_end=options.t_end,
            instants=self.instants,
            instant_kinds=self.kinds,
            every_step=options.every is None,
            sample_steps=options.sample_steps,
            rtol=rtol,
            atol=atol,
            max_steps=self.most_steps,
            max_wall=left,
            magnitude=magnitude,
            index=self.index,
            stops=options.stops,
            method="bdf" if self.method == "euler" else self.method,
            stiff_steps=LONG if options.method == "auto" else STIFF,
            least_norm=options.redundancy == "minimum_norm" and bool(self.system.left_out),
            max_order=1 if self.method == "euler" else lib.MAX_ORDER,
            fixed_step=options.euler_step if self.method == "euler" else None,
        )

    @property
    def most_steps(self) -> int | None:
        """The steps of a run: of the options, or of the patience with a method on trial."""
        return min((n for n in (self.options.max_steps, self.patience) if n is not None), default=None)

    def _write(self, rows: Floats) -> None:
        kind = rows[:, 1].astype(np.int32)
        traced = rows[(kind & TRACE) > 0]
        assert self.writer is not None
        self.writer.append(traced)
        self.rows.append(rows[(kind & COMPARED) > 0])
        taken = rows[(kind & (TRACE | STEP)) > 0]
        if self._keeps:
            self.samples.append(taken)
        elif taken.size:
            self.samples = [taken[-1:]]

    @property
    def _keeps(self) -> bool:
        """Rows are kept for expects: some quantity of observe is not stored."""
        return self.options.sample_steps or len(self.columns) < len(self.names)

    def _progress(self, t: float) -> None:
        options = self.options
        if options.progress is not None:
            span = options.t_end - options.t_start
            fraction = (t - options.t_start) / span if span > 0.0 else 1.0
            spent = time.monotonic() - self.run_began
            options.progress(fraction, spent * (1.0 - fraction) / fraction if fraction > 0.01 else None)

    def run(self, rtol: float, atol: float | None, magnitude: Floats | None) -> Finished:
        """One integration into a file; SolverFailure, KeyboardInterrupt leave what was computed."""
        self.number += 1
        first = self.done is None
        target = self.target if first else self.target.with_name(f".{self.target.name}.part")
        attributes: dict[str, str | float | int] = {
            **self.options.attributes,
            "method": self.method,
            "rtol": float(rtol),
            "atol": float(atol or 0.0),
        }
        self.rows, self.samples = [], []
        self.run_began = wall = time.monotonic()
        self.writer = TraceWriter(target, self.columns, len(self.names), attributes, self.options.parameters)
        integration = Integration(self.system, self.start, self.request(rtol, atol, magnitude))
        try:
            finished = integration.run(self._write, self._progress)
        except BaseException:
            self._account(integration, wall)
            self._leave(integration, first)
            raise
        self._account(integration, wall)
        self.writer.flush()
        self._take(first)
        self.done, self.finished = (finished, self.samples, self.writer), finished
        return finished

    def _account(self, integration: Integration, wall: float) -> None:
        self.cpu += integration.cpu
        self.wall += time.monotonic() - wall
        self.last_statistics = integration.statistics()
        self.statistics = self.statistics + self.last_statistics

    def _leave(self, integration: Integration, first: bool) -> None:
        """After a failure: the rows so far stay if there is no finished run to keep."""
        assert self.writer is not None
        if first:
            nominal = self.nominal(integration.largest(), integration.magnitude)
            self.writer.finish(nominal, self.last_attributes(None), final=False)
            return
        self.writer.discard()
        with contextlib.suppress(OSError):
            self.writer.path.unlink()

    def _take(self, first: bool) -> None:
        """The finished run's file takes the path (the writer keeps writing its last attributes to it)."""
        assert self.writer is not None
        if not first:
            assert self.done is not None
            self.done[2].discard()
            self.writer.path.replace(self.target)
            self.writer.path = self.target

    def sizes(self, largest: Floats, magnitude: Floats) -> Floats:
        """What errors of the stored quantities are relative to [columns]: the largest met (largest [observed]), but no
        less than round-off of the largest of the same unit, unknowns (magnitude [unknowns]) among them.
        """
        of_unit: dict[str, float] = {}
        for family, first in zip(self.system.description.families, self.system.form.at, strict=False):
            if family.size and first + family.size <= magnitude.size:
                size = float(magnitude[first : first + family.size].max())
                of_unit[family.unit] = max(of_unit.get(family.unit, 0.0), size)
        sizes = [float(largest[column.place]) for column in self.columns]
        for column, size in zip(self.columns, sizes, strict=True):
            of_unit[column.unit] = max(of_unit.get(column.unit, 0.0), size)
        return np.maximum(sizes, [ROUND_OFF * of_unit[column.unit] for column in self.columns])

    def nominal(self, largest: Floats, magnitude: Floats) -> dict[str, float]:
        """Nominal magnitude of each stored quantity."""
        sizes = self.sizes(largest, magnitude)
        return {column.name: float(size) for column, size in zip(self.columns, sizes, strict=True)}

    def last_attributes(self, error_estimate: float | None) -> dict[str, str]:
        """Statistics and timings as JSON."""
        found = {"statistics": json.dumps(self.statistics_object(error_estimate))}
        if self.options.timings:
            found["timings"] = json.dumps(self.timings())
        return found

    def statistics_object(self, error_estimate: float | None) -> dict[str, Any]:
        """The counters of all runs, with the estimate."""
        return {**asdict(self.statistics), "error_estimate": error_estimate}

    def timings(self) -> dict[str, float]:
        """cpu_integrate_s, wall_integrate_s, cpu_compile_s, wall_total_s."""
        began = self.options.wall_began
        total = time.monotonic() - (self.began if began is None else began)
        return {
            "cpu_integrate_s": self.cpu,
            "wall_integrate_s": self.wall,
            "cpu_compile_s": self.options.cpu_compile,
            "wall_total_s": total,
        }

    def sampled(self, tolerance: float, magnitude: Floats | None) -> Sampled:
        """One run of the accuracy control."""
        finished = self.run(tolerance, None, magnitude)
        places = [column.place for column in self.columns]
        rows = np.concatenate(self.rows) if self.rows else np.zeros((0, lib.ROW_HEAD + 2 * len(self.names)))
        values = rows[:, lib.ROW_HEAD :][:, places]
        return Sampled(tolerance, values, self.sizes(finished.largest, finished.magnitude), finished.magnitude)

    def collected(self) -> Samples:
        """Samples of the run that stands in the trace."""
        parts = self.samples if self.done is None else self.done[1]
        rows = np.concatenate(parts) if parts else np.zeros((0, lib.ROW_HEAD + 2 * len(self.names)))
        values = rows[:, lib.ROW_HEAD : lib.ROW_HEAD + len(self.names)]
        return Samples(self.names, rows[:, 0], rows[:, 1].astype(np.int32), values, rows[:, 6], rows[:, 7])


def _observed_names(description: Description) -> tuple[str, ...]:
    rows = [description.rows[k] for k in description.rows_of("observe")]
    return tuple(element(row.name, row.shape, k) for row in rows for k in range(row.size))


def _listed(names: tuple[str, ...]) -> str:
    """The first names and how many more, with their verb."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more + (" is" if len(names) == 1 else " are")


def _targets(runs: _Runs, options: Options) -> Floats:
    """Accuracy wanted of each stored quantity; infinite where none is."""
    target = np.full(len(runs.columns), np.inf if options.accuracy is None else options.accuracy)
    names = [column.name for column in runs.columns]
    for name, wanted in options.accuracy_on:
        if name not in names:
            raise ValueError(f"accuracy on '{name}': it is not traced")
        target[names.index(name)] = wanted
    return target


def _controlled(runs: _Runs, options: Options) -> tuple[Achieved | None, tuple[str, ...]]:
    """Runs with accuracy control, or one with the solver's own tolerances."""
    if runs.method == "euler":
        if options.euler_step is None:
            raise ValueError("method euler needs a step")
        runs.run(options.rtol or 1e-6, options.atol, None)
        return None, ()
    if options.rtol is not None or options.atol is not None:
        runs.run(options.rtol if options.rtol is not None else 1e-6, options.atol, None)
        return None, ()
    achieved = _chosen(runs, options) if options.method == "auto" else _achieved(runs, options)
    if achieved.met:
        return achieved, ()
    return achieved, (
        f"the accuracy asked for was not reached: estimated error {achieved.error_estimate:.1e} "
        f"at the finest tolerance {achieved.tolerance:.0e}",
    )


def _achieved(runs: _Runs, options: Options) -> Achieved:
    finest = FINEST_RADAU if runs.method == "radau" else FINEST
    return control(runs.sampled, _targets(runs, options), finest)


def _chosen(runs: _Runs, options: Options) -> Achieved:
    """With method auto: where one method fails, or the bdf needs more than LONG steps, another begins anew.

    Lightly damped oscillations hold the bdf of orders 3 to 5, which are not A-stable, to steps of the fastest of them:
    a line of 10000 sections takes it 25 times the work of radau.
    """
    if runs.method == "bdf":
        runs.patience = LONG
    try:
        return _achieved(runs, options)
    except SolverFailure as failure:
        limited = failure.cause == "max_steps" and runs.most_steps == options.max_steps
        if limited or failure.cause in ("max_wall", "memory"):
            raise
        runs.method, runs.patience = "bdf" if runs.method == "radau" else "radau", None
        return _achieved(runs, options)


def simulate(
    manifest: Mapping[str, Any] | Description,
    binding: Mapping[str, Any] | None,
    carrier: Carrier,
    options: Options,
    *,
    start: ConsistentState | None = None,
    facts: Structure | None = None,
) -> Outcome:
    """Simulates a bound model into a trace file.

    start: a consistent state at t_start that is already known, facts: the structure there (else both are found).

    Raises InconsistentStart, TraceError, ValueError (options that make no sense); a SolverFailure is raised with
    `partial`, the Outcome up to it, after the trace was closed with final = 0.
    """
    description = manifest if isinstance(manifest, Description) else describe(manifest, binding or {})
    method = choose_method(options)
    written = System.of(description, carrier, "3")
    start = start or consistent_start(written, options.t_start)
    facts = facts or structure(written, start)
    if options.redundancy not in ("error", "drop", "minimum_norm"):
        raise ValueError(f"redundancy {options.redundancy}: error, drop or minimum_norm")
    if facts.left_out and options.redundancy != "error":
        written = written.without(facts.left_out)
        start = replace(consistent_start(written, options.t_start, start), moved=start.moved)
        facts = replace(facts, index=index_of(written, start)[0], undetermined=())
    form, index, warnings = choose_index(options.index, facts, options.method)
    system = written if form == "3" else written.another(form)
    missing = obstacle(system, start) if form == "0" else ()
    if missing:
        raise NoSuchForm(
            f"there is no underlying equation: {_listed(missing)} not determined by the balances of efforts, the "
            "constraints and the gammas (coordinates without inertia): index 2 or 3 with bdf or radau"
        )
    name = {"3": str(facts.index), "2": "2"}.get(form, form)
    options = replace(options, attributes={**options.attributes, "index": name})
    runs = _Runs(system, start, options, index, method)
    known = determined(written, start)
    runs.columns = tuple(
        replace(column, derivative=column.derivative and bool(known[column.place])) for column in runs.columns
    )

    def outcome(
        final: bool, reached: float, achieved: Achieved | None, failure: SolverFailure | None
    ) -> Outcome:
        estimate = achieved.error_estimate if achieved is not None else None
        return Outcome(
            runs.path,
            final,
            reached,
            runs.statistics_object(estimate),
            runs.timings(),
            estimate,
            runs.method,
            name,
            start,
            facts,
            runs.collected(),
            warnings,
            failure,
        )

    achieved: Achieved | None = None
    try:
        achieved, more = _controlled(runs, options)
    except SolverFailure as failure:
        _close(runs, None, final=False)
        reached = failure.time if runs.done is None else options.t_end
        failure.partial = outcome(False, reached, None, failure)
        raise
    except BaseException:
        _close(runs, None, final=False)
        raise
    warnings = (*warnings, *more)
    _close(runs, achieved, final=True)
    return outcome(True, options.t_end, achieved, None)


def _close(runs: _Runs, achieved: Achieved | None, final: bool) -> None:
    """Last attributes of the finished run that stands at the path."""
    if runs.done is None or runs.done[2].closed:
        return
    finished, _, writer = runs.done
    estimate = achieved.error_estimate if achieved is not None else None
    writer.finish(runs.nominal(finished.largest, finished.magnitude), runs.last_attributes(estimate), final)
