"""What an analysis is asked of: the target compiled, its state at the start or at an instant."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.events import plan
from sysdyn.cli.run.prepare import Prepared, prepare
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest, options_of, rest, stops, turning
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.start.flat_laws import impossible
from sysdyn.cli.run.start.starting import Started, start
from sysdyn.cli.run.verdict.verdict import report_stop
from sysdyn.compiler.binding.binding import Binding
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.scenes.stopping import drop_measuring_states
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model.calculus import moving, rate_name, time_derivative
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.model.rewriting import following
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.tree import syntax
from sysdyn.runtime.arrival import arrival
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure, WrongOption
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.values import dataclass

Inputs = Sequence[str] | None
"""Names of inputs, `name[i]` of elements; None: the model's own."""
STORES = 200
"""Stores up to which the energy of a mode is shared out."""


@dataclass(frozen=True, slots=True)
class Found:
    """A model at a state: system as written, its numbers there (events may have changed some)."""

    target: Target
    prepared: Prepared
    system: System
    state: ConsistentState
    binding: Binding
    started: Started | None = None


def compile_target(
    request: RunRequest,
    report: Report,
    outputs: tuple[str, ...] | None = None,
    also: Callable[[Network], tuple[str, ...]] | None = None,
    inputs: Inputs = None,
    choose: Callable[..., Target | None] = targets.one,
) -> tuple[Target, Prepared] | None:
    """The target, compiled whole: what a scene does not need may be unstable all the same.

    outputs: names or expressions in the place of the scene's traces.  also: what of a network is observed
    beside.  inputs: those that move in time, about what a formula gives them too.  choose: the target
    among those of the file.  None where the report says why not.
    """
    target = targets.target_of(request, report, choose)
    if target is None:
        return None
    inner, unasked = Report(), frozenset[str]()
    named = _input_names(target, inputs)
    read = partial(
        load.network,
        target.document,
        target.model,
        target.scene,
        settings=request.settings,
        levels=request.levels,
        moved=named,
    )
    # as the scene has it, or with the outputs that are asked for
    network = read(report=inner, outputs=outputs)
    prepared: Prepared | None = None
    # inputs that move get rates, and what the caller wants observed is added
    if network is not None:
        moves = _moving(network, named)
        with moving(moves):
            asked = also(network) if also is not None else ()
            # read again: more is observed, or formulas have a parameter added
            if asked or moves:
                names = network.traced
                unasked = frozenset(asked).difference(names)
                more = (*names, *(name for name in asked if name not in names))
                network = read(report=Report(), outputs=more) or network
            # no time passes here: states that measure and expectations are left out
            network = replace(drop_measuring_states(network), statics=(), expectations=(), goldens=())
            network = _with_rates(network, moves)
            prepared = prepare(network, inner, formulation=request.formulation, backend=request.backend, gather=False)
    report.extend(inner if prepared else targets.refuse_unsupported(inner))
    return None if prepared is None else (target, replace(prepared, unasked=unasked))


def own_inputs(target: Target, network: Network) -> tuple[str, ...]:
    """The model's inputs that can be moved: all but arrays that follow formulas."""
    known = {p.name for p in network.parameters}
    return tuple(name for name in _input_names(target, None) if name in known)


def _input_names(target: Target, inputs: Inputs) -> tuple[str, ...]:
    """Names of the inputs asked for, without indices; the model's own where none is asked for."""
    if inputs is None:
        return tuple(s.decl.name for s in target.model.body if isinstance(s, syntax.InputStatement))
    return tuple(text.partition("[")[0].strip() for text in inputs)


def _moving(network: Network, asked: Sequence[str]) -> tuple[str, ...]:
    """The parameters that move with the inputs: these, and those whose values are formulas in them."""
    found = following(network, asked)
    return tuple(p.name for p in network.parameters if p.name in found)


def _with_rates(network: Network, moves: Sequence[str]) -> Network:
    """With first and second rates of the parameters that move: zero, and of formulas those of the formula."""
    parameters, elements = list(network.parameters), list(network.elements)
    for p in network.parameters:
        values, apart = p.values, [s for s in network.elements if s.name == p.name]
        for order in (1, 2) if p.name in moves else ():
            values = tuple(map(time_derivative, values))
            apart = [replace(s, name=rate_name(p.name, order), value=time_derivative(s.value)) for s in apart]
            parameters.append(replace(p, name=rate_name(p.name, order), values=values))
            elements += apart
    return replace(network, parameters=tuple(parameters), elements=tuple(elements))


def contents(network: Network) -> tuple[tuple[str, str, str], ...]:
    """Of each store its name, its content q or p, its conjugate e or f; () where not all are elements of their own."""
    letters = {"potential": "qe", "kinetic": "pf"}
    stores = [b for b in network.branches if b.kind in letters and not b.domain.pseudo]
    if len(stores) > STORES or any(b.at or b.loops for b in stores):
        return ()
    if any(e.function in ("T*", "T", "V", "V*") for e in network.energies):
        return ()
    return tuple((b.name, f"{b.name}.{letters[b.kind][0]}", f"{b.name}.{letters[b.kind][1]}") for b in stores)


def of_contents(network: Network) -> tuple[str, ...]:
    """Contents and conjugates of the stores."""
    return tuple(name for store in contents(network) for name in store[1:])


def of_nodes(network: Network) -> tuple[str, ...]:
    """Efforts of the common-effort nodes: voltages, pressures, temperatures."""
    nodes = [n for n in network.nodes if n.domain.common == "effort" and not n.shape]
    return tuple(f"{n.name}.e" for n in nodes) if len(nodes) <= STORES else ()


def model_at_start(target: Target, prepared: Prepared, request: RunRequest, report: Report) -> Found | None:
    """The model at its start; None where the report says what is in the way."""
    started = start(prepared, prepared.begin, report, request.redundancy)
    if started is None or report.failed:
        return None
    return Found(target, prepared, started.system, started.state, prepared.binding, started)


def model_at_instant(found: Found, request: RunRequest, report: Report) -> tuple[Found | None, str | None]:
    """The model at the instant `request.until`, and why its run did not come there (exit 3)."""
    asked = load.constant(found.target.document, request.until or "", dim.TIME, "--at", report)
    if asked is None:
        return None, None
    # before the scene's start
    if asked < found.state.t:
        raise UsageError(f"--at {asked:g} s lies before the start, {found.state.t:g} s")
    # the start itself
    if asked == found.state.t:
        return found, None
    options = options_of(request, found.target, found.prepared, report, time.monotonic(), None)
    if options is None:
        return None, None
    # as `simulate` runs it, up to the instant
    options = replace(options, stops=stops(found.prepared, options, report))
    events = plan(found.prepared, found.system, rest=rest(options))
    options = replace(options, events=turning(events, found.prepared, options))
    assert found.started is not None
    # the run may need a form that does not exist, an option that does not fit, or stop before
    try:
        system, state = arrival(found.system, found.state, found.started.facts, options)
    except NoSuchForm as error:
        report.error("E607", impossible(found.prepared, error)[0], found.prepared.network.place)
        return None, None
    except WrongOption as error:
        raise UsageError(str(error)) from error
    except SolverFailure as failure:
        return None, report_stop(found.target, found.prepared, found.started, failure, report)
    return replace(found, system=system, state=state, binding=_now(found.prepared, system)), None


def _now(prepared: Prepared, system: System) -> Binding:
    """The binding with the discrete variables as the run left them."""
    scalars = prepared.compiled.program.scalars
    held: dict[str | tuple[Any, ...], Any] = {
        n: float(system.description.p[scalars.index(n)]) for n in prepared.network.discretes if n in scalars
    }
    return prepared.compiled.bind(held) if held else prepared.binding
