"""From a bound compiled model to a trace: start, structure, index form, accuracy, trace.

Receives manifest, binding, carrier and options; hands back an `Outcome`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from sysdyn.runtime.accuracy.alternatives import alternatives
from sysdyn.runtime.accuracy.control import Achieved
from sysdyn.runtime.accuracy.controlled import run_controlled, worst_miss
from sysdyn.runtime.accuracy.options import Options, choose_index, choose_method
from sysdyn.runtime.accuracy.runs import Runs, Samples
from sysdyn.runtime.accuracy.way import Way
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.judgement import UNJUDGED, Cancelled, Judgement, cancelling_quantities, judge, not_met_undefined
from sysdyn.runtime.model.carrier import Carrier
from sysdyn.runtime.model.description import Description, describe
from sysdyn.runtime.model.failures import SolverFailure, WrongOption
from sysdyn.runtime.model.system import System
from sysdyn.runtime.one_underlying import refuse_contacts, refuse_sliding, refuse_undetermined
from sysdyn.runtime.start.start import ConsistentState, consistent_start
from sysdyn.runtime.structure.left_out import following
from sysdyn.runtime.structure.rates import determined_rates
from sysdyn.runtime.structure.structure import Structure, index_of, structure
from sysdyn.runtime.trace.trace import Trace
from sysdyn.runtime.trace.trace_store import columns_of
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a simulation did.  trace: its file, or held: the trace in memory; statistics and timings as the trace holds
    them; reached [s]; error_estimate relative (None without accuracy control); warnings: sentences; failure: of a run
    that stopped (its trace has final = 0); judgement: of a run that ended; below_round_off: the estimate is less than
    double precision resolves; reason: why method auto took its method ("" where it was named); cancelled: traced
    differences of terms much larger than they are; events: of a run that ended; steps: of the run that stands; extrema:
    least and largest values of what is traced within its steps (infinite where there are none), if these are looked at.
    """

    trace: Path | None
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
    reason: str = ""
    cancelled: tuple[Cancelled, ...] = ()
    events: tuple[Happened, ...] = ()
    held: Trace | None = None
    steps: int = 0
    extrema: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def traced(self) -> Trace:
        """The trace, read from its file or as it is held."""
        if self.held is not None:
            return self.held
        assert self.trace is not None
        return Trace.open(self.trace)

    @property
    def met(self) -> bool:
        """The run ended as asked and met what it judged itself by."""
        return self.final and self.judgement is not None and self.judgement.met


def without_redundant(
    written: System, start: ConsistentState, facts: Structure, options: Options
) -> tuple[System, ConsistentState, Structure]:
    """The model as written without the redundant constraints that the options leave out."""
    if options.redundancy not in ("error", "drop", "minimum_norm"):
        raise WrongOption(f"redundancy {options.redundancy}: error, drop or minimum_norm")
    # dependent constraints: left out, or followed as the motion turns them
    if facts.left_out and options.redundancy != "error":
        alike = options.redundancy == "minimum_norm" and not options.events
        followed = following(written, start, len(facts.left_out)) if alike else None
        written = followed or written.without_constraints(facts.left_out)
        start = replace(consistent_start(written, options.t_start, start), moved=start.moved)
        facts = replace(facts, index=index_of(written, start)[0], undetermined=())
    return written, start, facts


def form_system(
    written: System, start: ConsistentState, facts: Structure, options: Options
) -> tuple[System, int, tuple[str, ...]]:
    """The system in the index form of the options, its index, warnings.  Raises NoSuchForm, ValueError."""
    form, index, warnings = choose_index(options.index, facts, options.method)
    system = written if form == "3" else written.another(form)
    # index 0 must determine all rates
    if form == "0":
        refuse_undetermined(written, system, start)
    return system, index, warnings


def form_name(system: System, facts: Structure) -> str:
    """The index form as the trace names it."""
    form = system.form.name
    return {"3": str(facts.index), "2": "2"}.get(form, form)


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
    written = System.from_description(description, carrier, "3")
    start = start or consistent_start(written, options.t_start)
    facts = facts or structure(written, start)
    written, start, facts = without_redundant(written, start, facts, options)
    system, index, warnings = form_system(written, start, facts, options)
    # contacts have no underlying equation
    if system.form.name == "0":
        refuse_contacts(options.events)
    way = Way(method, system, index, form_name(system, facts))
    ways = (way,) if options.method != "auto" else alternatives(way, written, start, options)
    runs = Runs(start, options, ways[0])
    with runs.keeping.claim():
        return _runs(runs, ways[1:], written, facts, warnings)


def _runs(runs: Runs, others: tuple[Way, ...], written: System, facts: Structure, warnings: tuple[str, ...]) -> Outcome:
    """The runs of one simulation, whose trace is claimed."""
    options, start = runs.options, runs.start
    runs.derive(determined_rates(written, start))

    # an outcome of what is there now
    def outcome(
        final: bool, reached: float, achieved: Achieved | None, failure: SolverFailure | None, **more: Any
    ) -> Outcome:
        estimate = achieved.error_estimate if achieved is not None else None
        return Outcome(
            runs.keeping.path,
            final,
            reached,
            runs.accounts.statistics_object(estimate),
            runs.accounts.timings(),
            estimate,
            runs.method,
            runs.way.name,
            start,
            facts,
            runs.collect_samples(),
            warnings,
            failure,
            reason=runs.way.reason,
            held=runs.held,
            **more,
        )

    achieved: Achieved | None = None
    # runs until one is good enough
    try:
        achieved = run_controlled(runs, options, others)
    except SolverFailure as failure:
        # a failure keeps the trace so far
        close(runs, None, None)
        if runs.system.form.name == "0":
            refuse_sliding(runs.system, options.events, failure)
        # how far the trace goes
        reached = failure.time if runs.done is None else options.t_end
        failure.partial = outcome(False, reached, None, failure)
        raise
    # an interrupt keeps it too
    except BaseException:
        close(runs, None, None)
        raise
    assert runs.done is not None
    # the quantity that misses most, or one that is no number
    misses = worst_miss(runs, options, achieved) or not_met_undefined(runs.done[2].first_undefined())
    judgement = judge(options, runs.method, runs.done[0].balances, achieved is not None, misses, runs.open_balances)
    close(runs, achieved, judgement)
    finished, _, writer = runs.done
    # rows that were not settled are said
    if finished.unsettled and not options.events:
        some = "1 row does" if finished.unsettled == 1 else f"{finished.unsettled} rows do"
        warnings = (*warnings, f"{some} not meet the equations: what stands there is the integrator's own")
    warnings += tuple(_floating(finished.open, written.description))
    estimate = achieved.error_estimate if achieved is not None else None
    ranges = {name: moves for name, moves in writer.ranges().items() if name not in options.to_range}
    terms = runs.quantities.terms(finished.largest)
    lost = tuple(cancelling_quantities(terms, writer.seen(), options.accuracy, estimate, ranges))
    below = achieved is not None and achieved.below_round_off
    told = {"judgement": judgement, "below_round_off": below, "cancelled": lost, "events": finished.events}
    told |= {"steps": finished.statistics.steps, "extrema": _extrema(runs)}
    return outcome(True, options.t_end, achieved, None, **told)


def _floating(open_: Mapping[int, tuple[str, ...]], description: Description) -> Iterator[str]:
    """What is said of traced quantities that floated between contacts."""
    traced = {column.name: open_[column.place] for column in columns_of(description) if column.place in open_}
    # what floats between the same contacts in one sentence
    for between in dict.fromkeys(traced.values()):
        names = ", ".join(name for name, of in traced.items() if of == between)
        choice = "what is traced then is one of many values that fit (a small resistance in series, or a large one to"
        choice += " ground, determines it)"
        yield f"at times {', '.join(between)} leave {names} open: {choice}"


def _extrema(runs: Runs) -> dict[str, tuple[float, float]]:
    """Within the steps of a run, by traced name; nothing where they were not asked for."""
    if runs.done is None or runs.done[0].extrema is None:
        return {}
    least, most = runs.done[0].extrema
    return {column.name: (float(least[column.place]), float(most[column.place])) for column in runs.columns}


def close(runs: Runs, achieved: Achieved | None, judgement: Judgement | None) -> None:
    """Last attributes of the finished run that stands at the path; judgement None: it did not end as asked."""
    if runs.done is None or runs.done[2].closed:
        return
    finished, _, writer = runs.done
    estimate = achieved.error_estimate if achieved is not None else None
    verdict = UNJUDGED if judgement is None else judgement.attributes()
    attributes = {**runs.accounts.attributes(estimate), **verdict}
    writer.finish(runs.nominal(finished), attributes, judgement is not None, finished.events)
