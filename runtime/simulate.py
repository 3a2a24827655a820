"""From a bound compiled model to a trace: start, structure, index form, accuracy, trace.

Receives manifest, binding, carrier and options; hands back an `Outcome`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.integrate.accuracy import FINEST, Achieved, control
from sysdyn.runtime.integrate.options import Options, choose_index, choose_method
from sysdyn.runtime.integrate.runs import LONG, Runs, Samples
from sysdyn.runtime.integrate.underlying import obstacle
from sysdyn.runtime.judgement import UNJUDGED, Cancelled, Estimate, Judgement, cancelled, judge, own_tolerances
from sysdyn.runtime.model.carrier import Carrier
from sysdyn.runtime.model.description import Description, Floats, describe
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure, WrongOption
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState, consistent_start
from sysdyn.runtime.structure.rates import determined
from sysdyn.runtime.structure.structure import Structure, index_of, structure
from sysdyn.runtime.trace.claim import claimed

FINEST_RADAU = 1e-17
"""Smallest tolerance of Radau: its error test works with a tenth of the power 2/3 of it (core/radau.h)."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a simulation did.  statistics and timings as the trace holds them; reached [s]; error_estimate relative
    (None without accuracy control); warnings: sentences; failure: of a run that stopped (its trace has final = 0);
    judgement: of a run that ended; below_round_off: the estimate is less than double precision resolves;
    cancelled: traced differences of terms much larger than they are; events: of a run that ended.
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
    judgement: Judgement | None = None
    below_round_off: bool = False
    cancelled: tuple[Cancelled, ...] = ()
    events: tuple[Happened, ...] = ()

    @property
    def met(self) -> bool:
        """The run ended as asked and met what it judged itself by."""
        return self.final and self.judgement is not None and self.judgement.met


def _listed(names: tuple[str, ...]) -> str:
    """The first names and how many more, with their verb."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more + (" is" if len(names) == 1 else " are")


def _targets(runs: Runs, options: Options) -> Floats:
    """Accuracy wanted of each compared quantity; infinite where none is."""
    names = list(runs.compared)
    target = np.full(len(names), np.inf if options.accuracy is None else options.accuracy)
    for name, wanted in options.accuracy_on:
        if name not in names:
            raise WrongOption(f"accuracy on '{name}': it is not traced")
        target[names.index(name)] = wanted
    return target


def _controlled(runs: Runs, options: Options) -> Achieved | None:
    """Runs with accuracy control; None of one run with the solver's own tolerances."""
    if runs.method == "euler":
        if options.euler_step is None:
            raise WrongOption("method euler needs a step")
        runs.run(options.rtol or 1e-6, options.atol)
        return None
    if own_tolerances(options):
        runs.run(options.rtol if options.rtol is not None else 1e-6, options.atol)
        return None
    return _chosen(runs, options) if options.method == "auto" else _achieved(runs, options)


def _missed(runs: Runs, options: Options, achieved: Achieved | None) -> tuple[Estimate, ...]:
    """The quantity that misses most what was asked, where the accuracy was not reached."""
    if achieved is None or achieved.met:
        return ()
    name, asked, time = runs.worst(_targets(runs, options))
    return (Estimate(name, achieved.error_estimate, asked, time),)


def _achieved(runs: Runs, options: Options, *, doubted: bool = False) -> Achieved:
    finest = FINEST_RADAU if runs.method == "radau" else FINEST
    return control(runs.sampled, _targets(runs, options), finest, doubted=doubted)


def _chosen(runs: Runs, options: Options) -> Achieved:
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
        return _achieved(runs, options, doubted=failure.cause != "max_steps")


def counted(
    written: System, start: ConsistentState, facts: Structure, options: Options
) -> tuple[System, ConsistentState, Structure]:
    """The model as written without the redundant constraints that the options leave out."""
    if options.redundancy not in ("error", "drop", "minimum_norm"):
        raise WrongOption(f"redundancy {options.redundancy}: error, drop or minimum_norm")
    if facts.left_out and options.redundancy != "error":
        written = written.without(facts.left_out)
        start = replace(consistent_start(written, options.t_start, start), moved=start.moved)
        facts = replace(facts, index=index_of(written, start)[0], undetermined=())
    return written, start, facts


def formed(
    written: System, start: ConsistentState, facts: Structure, options: Options
) -> tuple[System, int, tuple[str, ...]]:
    """The system in the index form of the options, its index, warnings.  Raises NoSuchForm, ValueError."""
    form, index, warnings = choose_index(options.index, facts, options.method)
    system = written if form == "3" else written.another(form)
    missing = obstacle(system, start) if form == "0" else ()
    if missing:
        raise NoSuchForm(
            f"there is no underlying equation: {_listed(missing)} not determined by the balances of efforts, the "
            "constraints and the gammas (coordinates without inertia): index 2 or 3 with bdf or radau"
        )
    return system, index, warnings


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

    Raises InconsistentStart, TraceError, WrongOption (options that make no sense); a SolverFailure is raised with
    `partial`, the Outcome up to it, after the trace was closed with final = 0.
    """
    description = manifest if isinstance(manifest, Description) else describe(manifest, binding or {})
    method = choose_method(options)
    written = System.of(description, carrier, "3")
    start = start or consistent_start(written, options.t_start)
    facts = facts or structure(written, start)
    written, start, facts = counted(written, start, facts, options)
    system, index, warnings = formed(written, start, facts, options)
    if system.form.name == "0" and options.events and options.events.contacts:
        name = options.events.contacts[0].name
        raise NoSuchForm(f"'{name}' holds at times: there is no one underlying equation; index 2 with bdf or radau")
    form = system.form.name
    name = {"3": str(facts.index), "2": "2"}.get(form, form)
    options = replace(options, attributes={**options.attributes, "index": name})
    with claimed(Path(options.output).resolve()):
        return _runs(Runs(system, start, options, index, method), written, name, facts, warnings)


def _runs(runs: Runs, written: System, name: str, facts: Structure, warnings: tuple[str, ...]) -> Outcome:
    """The runs of one simulation, whose trace is claimed."""
    options, start = runs.options, runs.start
    known = determined(written, start)
    runs.columns = tuple(
        replace(column, derivative=column.derivative and bool(known[column.place])) for column in runs.columns
    )

    def outcome(final: bool, reached: float, achieved: Achieved | None, failure: SolverFailure | None) -> Outcome:
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
        achieved = _controlled(runs, options)
    except SolverFailure as failure:
        _close(runs, None, None)
        reached = failure.time if runs.done is None else options.t_end
        failure.partial = outcome(False, reached, None, failure)
        raise
    except BaseException:
        _close(runs, None, None)
        raise
    assert runs.done is not None
    missed = _missed(runs, options, achieved)
    judgement = judge(options, runs.method, runs.done[0].balances, achieved is not None, missed)
    _close(runs, achieved, judgement)
    finished, _, writer = runs.done
    nominal = runs.nominal(finished.largest, finished.magnitude)
    ended = outcome(True, options.t_end, achieved, None)
    lost = tuple(cancelled(nominal, writer.seen(), options.accuracy, ended.error_estimate))
    below = achieved is not None and achieved.below_round_off
    ended = replace(ended, below_round_off=below, cancelled=lost, events=finished.events)
    return replace(ended, judgement=judgement)


def _close(runs: Runs, achieved: Achieved | None, judgement: Judgement | None) -> None:
    """Last attributes of the finished run that stands at the path; judgement None: it did not end as asked."""
    if runs.done is None or runs.done[2].closed:
        return
    finished, _, writer = runs.done
    estimate = achieved.error_estimate if achieved is not None else None
    verdict = UNJUDGED if judgement is None else judgement.attributes()
    attributes = {**runs.last_attributes(estimate), **verdict}
    nominal = runs.nominal(finished.largest, finished.magnitude)
    writer.finish(nominal, attributes, judgement is not None, finished.events)
