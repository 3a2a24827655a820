"""The runs of one simulation with accuracy control: by one method, or by each of those of `auto` until one does.

Received: runs of a start, options and the ways that `auto` may take behind the first; handed on: what was achieved, the
finest run and its samples standing in the runs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from sysdyn.runtime.accuracy.control import Achieved, control
from sysdyn.runtime.accuracy.options import Options, own_tolerances
from sysdyn.runtime.accuracy.round_off import worst_blur
from sysdyn.runtime.accuracy.runs import Runs
from sysdyn.runtime.accuracy.second_opinion import confirm
from sysdyn.runtime.accuracy.way import BRIEF, BRIEF_STEEP, LONG, LONG_STEEP, Way
from sysdyn.runtime.judgement import EPS, Estimate, judge
from sysdyn.runtime.model.failures import SolverFailure, WrongOption

NO_FURTHER = 1.0 + 1e-6
"""Of the instant at which a method stopped: another that stops there got no further."""
REFINED, REFINE, HELPS = 4, 0.3, 0.5
"""Runs with shorter steps for the sake of the ledgers, how long they are beside those before, and what of the balance
is left of one that a step spoils."""
PATIENCE = {"bdf": (LONG, LONG_STEEP), "rosenbrock": (BRIEF, BRIEF_STEEP)}
"""Steps after which the next method is tried, of laws that are not steep and of those that are."""


def _reason_to_leave(runs: Runs, failure: SolverFailure) -> str:
    """Why a method was left."""
    method = runs.method
    # stability, not accuracy, holds the steps
    if failure.cause == "stiff":
        return f"stiff: {method} is held to steps of {failure.step:.2g} s"
    # the patience with a method on trial has run out
    if failure.cause == "max_steps":
        return f"{method} needs more than {runs.most_steps} steps"
    return f"{method} stopped at {failure.time:.6g} s"


def run_controlled(runs: Runs, options: Options, others: tuple[Way, ...]) -> Achieved | None:
    """Runs with accuracy control; None of one run with the solver's own tolerances."""
    # fixed steps: one run, no control
    if runs.method == "euler":
        if options.euler_step is None:
            raise WrongOption("method euler needs a step")
        runs.run(options.rtol or 1e-6, options.atol)
        return None
    # the solver's own tolerances: one run as well
    if own_tolerances(options):
        runs.run(options.rtol if options.rtol is not None else 1e-6, options.atol)
        return None
    achieved = _chosen(runs, options, others) if options.method == "auto" else _run_one_method(runs, options)
    # a ledger may be off where all quantities are met
    achieved = _balance_ledgers(runs, options, achieved)
    if achieved.error_estimate is not None:  # two runs may have the same numbers, which are doubles all the same
        achieved = replace(achieved, error_estimate=max(achieved.error_estimate, EPS))
    return confirm(runs, achieved, runs.quantities.accuracy_asked(options)) if options.accuracy_check else achieved


def worst_miss(runs: Runs, options: Options, achieved: Achieved | None) -> tuple[Estimate, ...]:
    """The quantity that misses most what was asked, by the runs or by what round-off leaves open of it."""
    # one run without control has no estimate
    if achieved is None:
        return ()
    # met by the runs: round-off may leave more open than was asked
    if achieved.met:
        return worst_blur(runs, options.t_end, runs.quantities.accuracy_asked(options))
    name, asked, time, undefined = runs.compared.worst(
        runs.quantities.compared, runs.quantities.accuracy_asked(options)
    )
    return (Estimate(name, achieved.error_estimate, asked, time, undefined),)


def _run_one_method(
    runs: Runs,
    options: Options,
    *,
    last: bool = True,
    doubted: bool = False,
    tame: bool = False,
) -> Achieved:
    """Runs by one method; last: no other takes over, so that it goes on where it would be left to the next."""
    # a method that nothing follows runs on where it is dear
    target, first = runs.quantities.accuracy_asked(options), options.first
    law = replace(runs.way.law, brief=False) if last else runs.way.law
    return control(runs.run_sampled, target, law, doubted=doubted, tame=tame, first=first)


def _ledger_excess(runs: Runs, options: Options) -> float:
    """How many times its limit the worst ledger of the last run is off."""
    assert runs.done is not None
    # ledgers alone are judged: the accuracy is taken as met
    found = judge(options, runs.method, runs.done[0].balances, False, (), runs.open_balances).not_met
    return max((f.value / f.limit if f.value is not None and f.limit > 0.0 else np.inf for f in found), default=0.0)


def _balance_ledgers(runs: Runs, options: Options, achieved: Achieved) -> Achieved:
    """A ledger is a sum over the steps: where it alone is off, they are shortened while that helps."""
    runs.patience = runs.patience_with_draft = None  # no method follows
    off = _ledger_excess(runs, options) if achieved.met else 0.0
    for _ in range(REFINED):
        # balanced, or not met for other reasons
        if off <= 1.0:
            break
        try:
            runs.run_sampled(achieved.tolerance, REFINE / max(runs.accounts.last.steps, 1))
        except SolverFailure:  # the run before stands, with what it misses
            break
        before, off = off, _ledger_excess(runs, options)
        achieved = replace(achieved, runs=achieved.runs + 1)
        # shorter steps help no more: the error is not theirs
        if off > HELPS * before:
            break
    return achieved


def _short(runs: Runs, options: Options, achieved: Achieved) -> str | None:
    """What the method did not reach; None where it met everything."""
    # less than was asked, or a ledger that does not balance
    if not achieved.met:
        return f"{runs.method} does not reach the accuracy"
    return None if _ledger_excess(runs, options) <= 1.0 else f"the energy of {runs.method} does not balance"


def _is_bounded(failure: SolverFailure, runs: Runs) -> bool:
    """The caller's own bound ended it, or the text itself ends there: another method would meet the same."""
    limited = failure.cause == "max_steps" and runs.most_steps == runs.options.max_steps
    return limited or failure.late or failure.cause in ("max_wall", "memory", "zeno")


def _farther_failure(before: SolverFailure | None, last: SolverFailure) -> SolverFailure:
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
    # a run that missed what was asked is handed back where no other method does better
    missed: Achieved | None = None
    stands = runs.way
    stopped: SolverFailure | None = None
    # the explicit method, and the steps that stability would leave it
    explicit: tuple[Way, int] | None = None
    while True:
        # steep laws and others have a patience of their own
        runs.patience = PATIENCE.get(runs.method, (None, None))[steep] if others else None
        runs.patience_with_draft = explicit[1] if explicit is not None and others else None
        try:
            achieved = _run_one_method(runs, options, last=not others, doubted=doubted, tame=tame)
        except SolverFailure as failure:
            # the last method failed, or a limit of the user ended it
            if not others or _is_bounded(failure, runs):
                # nothing to hand back: the failure that came farthest
                if missed is None:
                    raise _farther_failure(stopped, failure) from None
                # what an earlier method reached stands, not met
                runs.take(stands)
                return missed
            # a failure of substance makes the next method's single pair doubtful; too many steps do not
            doubted = failure.cause not in ("max_steps", "stiff") and not runs.way.law.brief
            why = _reason_to_leave(runs, failure)
            # many steps of a smooth motion: the next takes its higher orders
            smooth = failure.smooth and failure.cause == "max_steps"
            stopped = failure if doubted else stopped
            # radau too costs more than the explicit method would: back to that
            if explicit is not None and failure.cause == "max_steps":
                others = (replace(explicit[0], lasting=True), runs.way, *others)
            explicit = None
            # dopri held by stability: remembered with the steps that it would take
            if failure.cause == "stiff" and not runs.way.lasting and others[0].method == "radau":
                explicit = runs.way, int(np.ceil((options.t_end - options.t_start) / failure.step))
        else:
            # with steep laws, or on trial, a run may end and miss what was asked
            short = _short(runs, options, achieved) if (steep or runs.way.law.brief) and others else None
            if short is None:
                return achieved
            # loose runs had nothing in common: the next begins with a tame tolerance
            tame = achieved.lost
            why, stands = short, runs.way
            missed = replace(achieved, error_estimate=None, met=False)
        # the next method, and why it was taken
        runs.take(replace(others[0], reason=why, smooth=smooth and steep))
        others = others[1:]
