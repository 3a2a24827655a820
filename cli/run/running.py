"""One simulation from a file to a trace: what `sysdyn simulate` and `sysdyn.api.simulate` have in common."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from sysdyn import __version__
from sysdyn.cli.failures import OF_RUNS, UsageError
from sysdyn.cli.run.events import plan, zeno
from sysdyn.cli.run.many.memory import keep_pages
from sysdyn.cli.run.module_check import check_module
from sysdyn.cli.run.prepare import Prepared, prepare
from sysdyn.cli.run.request import lock, targets
from sysdyn.cli.run.request.run_request import (
    RunRequest,
    check_tolerances,
    default_output,
    options_of,
    rest,
    stops,
    turning,
)
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.start.flat_laws import impossible
from sysdyn.cli.run.start.starting import Started, start
from sysdyn.cli.run.verdict.expectations import JudgedClaim, judge
from sysdyn.cli.run.verdict.verdict import author_place, differences, note_rest, report_stop, verdict
from sysdyn.compiler.forms.kane import repeats
from sysdyn.dsl import load
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Diagnostic, Report
from sysdyn.runtime.accuracy.options import Options, Progress
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure, WrongOption
from sysdyn.runtime.simulate import Outcome, simulate
from sysdyn.runtime.trace.opening import replaceable
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Ran:
    """What came of it.

    exit: 0, 1 (an expectation failed), 3 (the solver stopped, `failure` says where, or the run is not met).
    """

    target: Target
    prepared: Prepared
    started: Started
    outcome: Outcome
    claims: tuple[JudgedClaim, ...]
    exit: int
    failure: str | None = None


def finding(diagnostics: Iterable[Diagnostic]) -> dict[str, Any] | None:
    """Why one run among several failed, in CONTRACT's shape: the first error, one of the run before one of a claim."""
    errors = [d for d in diagnostics if d.severity == "error"]
    first = next((d for d in errors if d.code in OF_RUNS), errors[0] if errors else None)
    return None if first is None else first.to_json()


def run(request: RunRequest, report: Report, progress: Progress | None = None) -> Ran | None:
    """Simulate; None where the report says why not.  UsageError, OSError and TraceError pass through."""
    began = time.monotonic()
    keep_pages()
    check_tolerances(request)
    # neither the model nor a file that is no trace is written over
    if request.output and request.file != "-" and _same(request.output, request.file):
        raise UsageError(f"-o {request.output} is the model itself")
    target = targets.target_of(request, report)
    if target is None:
        return None
    output = request.output or default_output(request.file, target.scene.name.name if target.scene else "")
    if Path(output).is_file() and not replaceable(output):
        raise UsageError(f"-o {output} exists and is no trace of sysdyn: give another name, or remove it")
    # FILE.lock of a trade, where there is one
    request, locked = _apply_lock(request, target, report)
    with ex.fresh():
        prepared = ready(request, target, report)
        options = None if prepared is None else options_of(request, target, prepared, report, began, progress)
        if options is not None and locked is not None:
            options = _under(options, locked)
        return None if prepared is None or options is None else integrate(target, prepared, options, report)


def _apply_lock(request: RunRequest, target: Target, report: Report) -> tuple[RunRequest, lock.Taken | None]:
    """The request with what the file's lock says where neither it nor the scene does."""
    held = None if request.no_lock else lock.read(request.file, target, __version__, report)
    if held is None:
        return request, None
    found = lock.settings_from_lock(held, target, request.formulation, request.index, request.method, request.levels)
    return replace(
        request,
        formulation=request.formulation or found.formulation,
        index=request.index or found.index,
        method=request.method or found.method,
        levels=(*request.levels, *found.levels),
    ), found if found.text else None


def _under(options: Options, found: lock.Taken) -> Options:
    """Options that name the lock, and begin at its tolerance where the accuracy asked is that of its measurement."""
    asked = min([a for a in (options.accuracy, *(a for _, a in options.accuracy_on)) if a is not None], default=None)
    first = found.tolerance if asked == found.accuracy else None
    return replace(options, first=first, attributes={**options.attributes, "lock": found.text})


def ready(request: RunRequest, target: Target, report: Report) -> Prepared | None:
    """The target under the request's settings, compiled and bound; None where the report says why not."""
    inner = Report()
    network = load.network(target.document, target.model, target.scene, inner, request.settings, levels=request.levels)
    prepared = None
    if network is not None:
        wanted, backend, prune = request.formulation, request.backend, not request.no_prune
        prepared = prepare(network, inner, formulation=wanted, backend=backend, traced=True, prune=prune)
    if prepared is not None and request.own and repeats(prepared.compiled.form):
        message = f"formulation {prepared.formulation}: the same rows as Lagrange's, no flow constraint is left out"
        inner.error("E607", message, prepared.network.place)
        prepared = None
    report.extend(inner if prepared else targets.refuse_unsupported(inner))
    return prepared


def integrate(
    target: Target, prepared: Prepared, options: Options, report: Report, *, checked: bool = False
) -> Ran | None:
    """From the consistent start to the trace; None where the report says why not; checked: see begin."""
    started = begin(prepared, options, report, checked=checked)
    return None if started is None else run_from(target, prepared, started, options, report)


def begin(prepared: Prepared, options: Options, report: Report, *, checked: bool = False) -> Started | None:
    """The consistent start, the compiled rows compared with the text there; None where the report says why not.

    checked: they were compared before, with other numbers.
    """
    since = options.wall_began
    until = None if options.max_wall is None or since is None else since + options.max_wall
    started = start(prepared, options.t_start, report, options.redundancy, until)
    if started is None or any(d.severity == "error" and d.code != "E909" for d in report):
        return None
    number = started.system.form.written
    # more memory than there is
    if number * budget.STEPPED > budget.there():
        need, most = (budget.format_bytes(amount) for amount in (number * budget.STEPPED, budget.there()))
        text = f"a run of {number} unknowns needs {need}, and there are {most}"
        report.error("E119", text, prepared.network.place, help="fewer elements")
        return None
    # no unknowns and nothing traced
    if number == 0 and not started.system.description.rows_of("observe"):
        message = "nothing is unknown in the model, and nothing is traced: a run would hold nothing"
        report.error("E607", message, prepared.network.place, help="coord, state or node; or a quantity that is traced")
        return None
    if not checked:
        check_module(prepared, started, options.t_end)
    return started


def run_from(target: Target, prepared: Prepared, started: Started, options: Options, report: Report) -> Ran | None:
    """From a start to the trace; None where the report says why not.  One without events may serve several runs."""
    events, times = plan(prepared, started.system, rest=rest(options)), stops(prepared, options, report)
    if events or times.size:
        events = turning(events, prepared, options) if events else events
        options = replace(options, stops=times, events=events)
    return _ran(target, prepared, started, options, report)


def _same(one: str, other: str) -> bool:
    try:
        return Path(one).samefile(other)
    except OSError:
        return False


def _ran(target: Target, prepared: Prepared, started: Started, options: Options, report: Report) -> Ran | None:
    """Integrate a started model, judge claims and report; None where its form does not exist."""
    failure = None
    try:
        outcome = simulate(
            started.system.description, None, prepared.carrier, options, start=started.state, facts=started.facts
        )
    except NoSuchForm as error:
        text, laws = impossible(prepared, error)
        report.error("E607", text, author_place(target, prepared, laws[0]) if laws else prepared.network.place)
        return None
    except WrongOption as error:
        raise UsageError(str(error)) from error
    # it stopped: what was computed until then is the outcome
    except SolverFailure as error:
        if not isinstance(error.partial, Outcome):
            raise
        outcome = error.partial
        failure = report_stop(target, prepared, started, error, report, options)
    found = Report()
    claims = judge(prepared, outcome, found, finished=outcome.reached >= options.t_end)
    # claims are judged of a run that is met
    if outcome.judgement is None or outcome.met:
        report.extend(found)
        code = 3 if failure else 1 if report.failed else 0
    else:  # what such a run says of the author's claims is not believed
        claims, code = tuple(replace(claim, ok=None) for claim in claims), 3
    # what the run says of itself, and what looks odd
    if outcome.judgement is not None:
        verdict(target, prepared, started, outcome, report)
        differences(prepared, outcome.cancelled, report)
        zeno(prepared, outcome.events, report)
        note_rest(prepared, started, outcome, report)
    return Ran(target, prepared, started, outcome, claims, code, failure)
