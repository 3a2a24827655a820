"""The state that an analysis is about: the start, an instant of a run, or rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from sysdyn.cli.analysis.operating_point import (
    Found,
    Inputs,
    compile_target,
    model_at_instant,
    model_at_start,
    of_contents,
)
from sysdyn.cli.run.events import plan
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.request.targets import Target
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.events.start import eventful_start
from sysdyn.runtime.linear.contact_rest import ContactRest, SampledRest
from sysdyn.runtime.linear.rest import Rest, RestEquations, Resting, rests
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import InconsistentStart
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.start.starter import Starter

NO_REST = "no state of rest was found from the guesses{}: every rate zero, time held at {:g} s"
"""Said with what else was tried, and the instant."""
TRIES = 20
"""Random points that are tried where the guesses lead nowhere."""


def state_of(
    request: RunRequest, outputs: tuple[str, ...] | None, inputs: Inputs, report: Report, *, rest: bool
) -> tuple[Found | None, str | None]:
    """The model at the state asked, its inputs free to move; else None, the report says why, and what stopped a run or
    a search.
    """
    made = compile_target(request, report, outputs, of_contents, inputs)
    if made is None:
        return None, None
    if rest:
        found, states, why = resting(*made, TRIES, most=1)
        return (found, None) if states else (None, NO_REST.format("", found.state.t) + why)
    found_ = model_at_start(*made, request, report)
    return (found_, None) if found_ is None or request.until is None else model_at_instant(found_, request, report)


def resting(
    target: Target,
    prepared: Prepared,
    tries: int,
    most: int | None = None,
    advance: Callable[[int], None] | None = None,
) -> tuple[Found, tuple[Rest, ...], str]:
    """The model at its first state of rest, and all of them; the guess where there is none, and what is to be said of
    it.  advance: see rests.
    """
    t0 = prepared.begin
    system = System(prepared.structure, prepared.arrays, prepared.carrier)
    events = plan(prepared, system)
    guess = _guess(system, t0, events)
    tangible = {c.name for c in prepared.compiled.energies.coordinates if c.tangible}
    # every rate zero; contacts may hold or be open, sampled values stay as they are
    equations: RestEquations = Resting(system, tangible, t0, guess)
    if events.contacts:
        equations = ContactRest(system, tangible, t0, guess, events)
    if events.sampled:
        equations = SampledRest(equations, system, events.sampled)
    states = rests(equations, tries, most, advance)
    # the guess where nothing was found
    state = states[0].state if states else ConsistentState(t0, guess, np.zeros_like(guess), (), np.inf)
    if states:
        states[0].stand(system)
    changed = next(iter(equations.changes), "") if isinstance(equations, SampledRest) else ""
    why = f"; where every rate is zero {changed}" if changed else ""
    return Found(target, prepared, system, state, prepared.binding), states, why


def model_at_rest(found: Found, rest: Rest) -> Found:
    """The model at another state of rest."""
    rest.stand(found.system)
    return replace(found, state=rest.state)


def _guess(system: System, t0: float, events: Plan) -> Floats:
    """The consistent start, which also says what holds of the constraints that hold at times; else what is written."""
    try:
        with np.errstate(all="ignore"):
            return eventful_start(system, t0, events).y
    except (InconsistentStart, NotFiniteError):
        return Starter(system).guess[: system.form.written]
