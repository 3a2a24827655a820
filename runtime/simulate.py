"""From a bound compiled model to a trace: start, structure, index form, accuracy, trace.

Receives manifest, binding, carrier and options; hands back an `Outcome`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.runtime.accuracy.alternatives import alternatives
from sysdyn.runtime.accuracy.by_steps import by_steps
from sysdyn.runtime.accuracy.control import Achieved, Lighter, control
from sysdyn.runtime.accuracy.options import Options, choose_index, choose_method, own_tolerances
from sysdyn.runtime.accuracy.round_off import blurred
from sysdyn.runtime.accuracy.runs import Runs, Samples
from sysdyn.runtime.accuracy.second_opinion import confirmed
from sysdyn.runtime.accuracy.way import BRIEF, BRIEF_STEEP, LONG, LONG_STEEP, Way
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.judgement import UNJUDGED, Cancelled, Estimate, Judgement, cancelled, judge, undefined
from sysdyn.runtime.model.carrier import Carrier
from sysdyn.runtime.model.description import Description, Floats, describe
from sysdyn.runtime.model.failures import SolverFailure, WrongOption
from sysdyn.runtime.model.system import System
from sysdyn.runtime.one_underlying import refuse_contacts, refuse_sliding, refuse_undetermined
from sysdyn.runtime.start.start import ConsistentState, consistent_start
from sysdyn.runtime.structure.left_out import following
from sysdyn.runtime.structure.rates import determined
from sysdyn.runtime.structure.structure import Structure, index_of, structure
from sysdyn.runtime.trace.trace import Trace
from sysdyn.runtime.trace.trace_store import columns_of
from sysdyn.values import dataclass

NO_FURTHER = 1.0 + 1e-6
"""Of the instant at which a method stopped: another that stops there got no further."""
REFINED, REFINE, HELPS = 4, 0.3, 0.5
"""Runs with shorter steps for the sake of the ledgers, how long they are beside those before, and what of the balance
is left of one that a step spoils."""
LITTLE_HAPPENS = "little happens"
"""Why method auto goes on with the bdf behind a draft of radau."""
LIGHT = 200
"""Steps of the bdf there, beyond which they are no cheaper than radau's."""
PATIENCE = {"bdf": (LONG, LONG_STEEP), "rosenbrock": (BRIEF, BRIEF_STEEP)}
"""Steps after which the next method is tried, of laws that are not steep and of those that are."""


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


def _left(runs: Runs, failure: SolverFailure) -> str:
    """Why a method was left."""
    method = runs.method
    if failure.cause == "stiff":
        return f"stiff: {method} is held to steps of {failure.step:.2g} s"
    if failure.cause == "max_steps":
        return f"{method} needs more than {runs.most_steps} steps"
    return f"{method} stopped at {failure.time:.6g} s"


def _targets(runs: Runs, options: Options) -> Floats:
    """Accuracy wanted of each compared quantity; infinite where none is."""
    names = list(runs.quantities.compared)
    target = np.full(len(names), np.inf if options.accuracy is None else options.accuracy)
    for name, wanted in options.accuracy_on:
        if name not in names:
            raise WrongOption(f"accuracy on '{name}': it is not traced")
        target[names.index(name)] = wanted
    return target


def _controlled(runs: Runs, options: Options, others: tuple[Way, ...]) -> Achieved | None:
    """Runs with accuracy control; None of one run with the solver's own tolerances."""
    if runs.method == "euler":
        if options.euler_step is None:
            raise WrongOption("method euler needs a step")
        runs.run(options.rtol or 1e-6, options.atol)
        return None
    if own_tolerances(options):
        runs.run(options.rtol if options.rtol is not None else 1e-6, options.atol)
        return None
    achieved = _chosen(runs, options, others) if options.method == "auto" else _achieved(runs, options)
    achieved = _balanced(runs, options, achieved)
    return confirmed(runs, achieved, _targets(runs, options)) if options.accuracy_check else achieved


def _missed(runs: Runs, options: Options, achieved: Achieved | None) -> tuple[Estimate, ...]:
    """The quantity that misses most what was asked, where the accuracy was not reached."""
    if achieved is None or achieved.met:
        return ()
    name, asked, time, undefined = runs.compared.worst(runs.quantities.compared, _targets(runs, options))
    return (Estimate(name, achieved.error_estimate, asked, time, undefined),)


def _achieved(
    runs: Runs,
    options: Options,
    *,
    last: bool = True,
    doubted: bool = False,
    tame: bool = False,
    lighter: Lighter | None = None,
) -> Achieved:
    """Runs by one method; last: no other takes over, so that it goes on where it would be left to the next."""
    target, first = _targets(runs, options), options.first
    relaxed = by_steps(runs, options, target) if first is None and not (doubted or tame) else None
    if isinstance(relaxed, Achieved):
        return relaxed
    law = replace(runs.way.law, brief=False) if last else runs.way.law
    return control(runs.sampled, target, law, doubted=doubted, tame=tame, first=first, lighter=lighter, draft=relaxed)


def _lighter(runs: Runs, options: Options, others: tuple[Way, ...]) -> Lighter | None:
    """The bdf behind a draft of radau: where so little happens that the longest step holds the steps, its steps cost a
    third of radau's and its rows less (CPU over eleven seed models: 0.81 of two runs of radau; over ladders of 100 to
    10 000 sections at 1e-1 to 1e-4: 0.75).
    """
    way = runs.way
    bent = options.events or way.system.form.scales
    if way.method != "radau" or bent or not others or others[0].method != "bdf":
        return None
    light = replace(others[0], reason=LITTLE_HAPPENS)
    return Lighter(light.law, lambda: runs.take(light, LIGHT), lambda: runs.take_back(way))


def _unbalanced(runs: Runs, options: Options) -> float:
    """How many times its limit the worst ledger of the last run is off."""
    assert runs.done is not None
    found = judge(options, runs.method, runs.done[0].balances, False, (), runs.open_balances).not_met
    return max((f.value / f.limit if f.value is not None and f.limit > 0.0 else np.inf for f in found), default=0.0)


def _balanced(runs: Runs, options: Options, achieved: Achieved) -> Achieved:
    """A ledger is a sum over the steps: where it alone is off, they are shortened while that helps."""
    runs.patience = runs.patience_with_draft = None  # no method follows
    off = _unbalanced(runs, options) if achieved.met else 0.0
    for _ in range(REFINED):
        if off <= 1.0:
            break
        try:
            runs.sampled(achieved.tolerance, REFINE / max(runs.accounts.last.steps, 1))
        except SolverFailure:  # the run before stands, with what it misses
            break
        before, off = off, _unbalanced(runs, options)
        achieved = replace(achieved, runs=achieved.runs + 1)
        if off > HELPS * before:
            break
    return achieved


def _short(runs: Runs, options: Options, achieved: Achieved) -> str | None:
    """What the method did not reach; None where it met everything."""
    if not achieved.met:
        return f"{runs.method} does not reach the accuracy"
    return None if _unbalanced(runs, options) <= 1.0 else f"the energy of {runs.method} does not balance"


def _bounded(failure: SolverFailure, runs: Runs) -> bool:
    """The caller's own bound ended it, or the text itself ends there: another method would meet the same."""
    limited = failure.cause == "max_steps" and runs.most_steps == runs.options.max_steps
    return limited or failure.late or failure.cause in ("max_wall", "memory", "zeno")


def _told(before: SolverFailure | None, last: SolverFailure) -> SolverFailure:
    """Of two methods that stopped the one that got further; where they got equally far, the first."""
    return before if before is not None and last.time <= NO_FURTHER * before.time else last


def _chosen(runs: Runs, options: Options, others: tuple[Way, ...]) -> Achieved:
    """With method auto: where one method fails, or is held back, the next begins anew.

    Lightly damped oscillations hold the bdf of orders 3 to 5, which are not A-stable, to steps of the fastest of them:
    a line of 10000 sections takes it 25 times the work of radau.  Stability holds the dopri where a model is stiff.
    Of steep laws the next one begins, too, where the first does not reach what was asked: the bdf tests its states
    alone, and efforts that blocked diodes leave to a source may bend between its steps.  Where the bdf is held back at
    its highest order the motion is smooth, and radau takes all its stages (ring modulator at 1e-6: 5.3 s -> 1.3).
    Where a draft of radau takes more steps than stability leaves the dopri, whose steps are cheaper, that goes on.
    """
    doubted, smooth, tame, steep = False, False, False, bool(runs.system.form.scales)
    missed: Achieved | None = None
    stands = runs.way
    stopped: SolverFailure | None = None
    explicit: tuple[Way, int] | None = None
    if runs.way.drafted:
        explicit, others = (others[0], runs.way.drafted), others[1:]
    while True:
        runs.patience = PATIENCE.get(runs.method, (None, None))[steep] if others else None
        runs.patience_with_draft = explicit[1] if explicit is not None and others else None
        try:
            lighter = _lighter(runs, options, others)
            achieved = _achieved(runs, options, last=not others, doubted=doubted, tame=tame, lighter=lighter)
        except SolverFailure as failure:
            if not others or _bounded(failure, runs):
                if missed is None:
                    raise _told(stopped, failure) from None
                runs.take(stands)
                return missed
            doubted = failure.cause not in ("max_steps", "stiff") and not runs.way.law.brief
            why = _left(runs, failure)
            smooth = failure.smooth and failure.cause == "max_steps"
            stopped = failure if doubted else stopped
            if explicit is not None and failure.cause == "max_steps" and runs.done is None:
                lasting = not runs.way.drafted  # what the start says of stability may not last
                others = (replace(explicit[0], lasting=lasting), replace(runs.way, drafted=0), *others)
            explicit = None
            if failure.cause == "stiff" and not runs.way.lasting and others[0].method == "radau":
                explicit = runs.way, int(np.ceil((options.t_end - options.t_start) / failure.step))
        else:
            short = _short(runs, options, achieved) if (steep or runs.way.law.brief) and others else None
            if short is None:
                return achieved
            tame = achieved.lost
            why, stands = short, runs.way
            missed = replace(achieved, error_estimate=None, met=False)
        runs.take(replace(others[0], reason=why, smooth=smooth and steep))
        others = others[1:]


def counted(
    written: System, start: ConsistentState, facts: Structure, options: Options
) -> tuple[System, ConsistentState, Structure]:
    """The model as written without the redundant constraints that the options leave out."""
    if options.redundancy not in ("error", "drop", "minimum_norm"):
        raise WrongOption(f"redundancy {options.redundancy}: error, drop or minimum_norm")
    if facts.left_out and options.redundancy != "error":
        alike = options.redundancy == "minimum_norm" and not options.events
        followed = following(written, start, len(facts.left_out)) if alike else None
        written = followed or written.without(facts.left_out)
        start = replace(consistent_start(written, options.t_start, start), moved=start.moved)
        facts = replace(facts, index=index_of(written, start)[0], undetermined=())
    return written, start, facts


def formed(
    written: System, start: ConsistentState, facts: Structure, options: Options
) -> tuple[System, int, tuple[str, ...]]:
    """The system in the index form of the options, its index, warnings.  Raises NoSuchForm, ValueError."""
    form, index, warnings = choose_index(options.index, facts, options.method)
    system = written if form == "3" else written.another(form)
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
    written = System.of(description, carrier, "3")
    start = start or consistent_start(written, options.t_start)
    facts = facts or structure(written, start)
    written, start, facts = counted(written, start, facts, options)
    system, index, warnings = formed(written, start, facts, options)
    if system.form.name == "0":
        refuse_contacts(options.events)
    way = Way(method, system, index, form_name(system, facts))
    ways = (way,) if options.method != "auto" else alternatives(way, written, start, options)
    runs = Runs(start, options, ways[0])
    with runs.keeping.claimed():
        return _runs(runs, ways[1:], written, facts, warnings)


def _runs(runs: Runs, others: tuple[Way, ...], written: System, facts: Structure, warnings: tuple[str, ...]) -> Outcome:
    """The runs of one simulation, whose trace is claimed."""
    options, start = runs.options, runs.start
    runs.derive(determined(written, start))

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
            runs.collected(),
            warnings,
            failure,
            reason=runs.way.reason,
            held=runs.held,
            **more,
        )

    achieved: Achieved | None = None
    try:
        achieved = _controlled(runs, options, others)
    except SolverFailure as failure:
        close(runs, None, None)
        if runs.system.form.name == "0":
            refuse_sliding(runs.system, options.events, failure)
        reached = failure.time if runs.done is None else options.t_end
        failure.partial = outcome(False, reached, None, failure)
        raise
    except BaseException:
        close(runs, None, None)
        raise
    assert runs.done is not None
    missed = _missed(runs, options, achieved) or undefined(runs.done[2].undefined())
    if achieved is not None and not missed:
        missed = blurred(runs, options.t_end, _targets(runs, options))
    judgement = judge(options, runs.method, runs.done[0].balances, achieved is not None, missed, runs.open_balances)
    close(runs, achieved, judgement)
    finished, _, writer = runs.done
    if finished.unsettled and not options.events:
        some = "1 row does" if finished.unsettled == 1 else f"{finished.unsettled} rows do"
        warnings = (*warnings, f"{some} not meet the equations: what stands there is the integrator's own")
    warnings += tuple(_floating(finished.open, written.description))
    estimate = achieved.error_estimate if achieved is not None else None
    lost = tuple(cancelled(runs.quantities.terms(finished.largest), writer.seen(), options.accuracy, estimate))
    below = achieved is not None and achieved.below_round_off
    told = {"judgement": judgement, "below_round_off": below, "cancelled": lost, "events": finished.events}
    told |= {"steps": finished.statistics.steps, "extrema": _extrema(runs)}
    return outcome(True, options.t_end, achieved, None, **told)


def _floating(open_: Mapping[int, tuple[str, ...]], description: Description) -> Iterator[str]:
    """What is said of traced quantities that floated between contacts."""
    traced = {column.name: open_[column.place] for column in columns_of(description) if column.place in open_}
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
    nominal = runs.quantities.nominal(finished.largest, finished.magnitude)
    writer.finish(nominal, attributes, judgement is not None, finished.events)
