"""From the options of `sysdyn report` to a study: compile, run, measure the energy of each element."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from sysdyn.cli.failures import UsageError
from sysdyn.cli.report.balance import Share, add_observations, shares
from sysdyn.cli.report.report_study import ReportStudy, sources_of
from sysdyn.cli.run.prepare import Prepared, prepare
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest, check_tolerances, of_these_alone, options_of
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import Ran, integrate
from sysdyn.cli.run.start.starting import start
from sysdyn.dsl import load
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.accuracy.options import Options, Progress
from sysdyn.runtime.model.failures import TraceError

LONG = 20.0
"""Wall seconds of a run that is not repeated for the energies of its elements."""

Stages = list[tuple[str, float, float]]


def collect(request: RunRequest, report: Report, progress: Progress | None = None) -> ReportStudy | None:
    """The study; None where the report says why there is none.  Call within `expression.fresh()`."""
    check_tolerances(request)
    stages: Stages = []
    began = time.monotonic()
    with _time_stage("read", stages):
        target = targets.target_of(request, report)
    # the report has it
    if target is None:
        return None
    with _time_stage("check", stages):
        settings, levels = request.settings, request.levels
        inner = Report()
        network = load.network(target.document, target.model, target.scene, inner, settings, levels=levels)
        report.extend(inner if network else targets.refuse_unsupported(inner))
    if network is None:
        return None
    # from here on the run's own stages
    prepared = _prepare(request, network, report, stages)
    if prepared is None:
        return None
    return _study(request, target, prepared, report, stages, began, progress)


def _study(
    request: RunRequest,
    target: Target,
    prepared: Prepared,
    report: Report,
    stages: Stages,
    began: float,
    progress: Progress | None,
) -> ReportStudy | None:
    """Start and run a scene for the page, without a file; None where the report says why not."""
    scene = prepared.network.scene
    findings: list[str] = []
    ran, trace, found = None, None, None
    # a scene without time: the start alone
    if request.until is None and (scene is None or scene.end is None):
        with _time_stage("start", stages):
            started = start(prepared, 0.0, report, request.redundancy)
        findings.append("There is no 'time' in the scene: nothing was run.")
    else:
        options = options_of(request, target, prepared, report, began, progress)
        if options is None:
            return None
        # every step, in memory
        options = replace(options, output=None, every=None)
        with _time_stage("start, integration and trace", stages):
            ran = integrate(target, prepared, options, report)
        started = ran.started if ran is not None else None
        # the energy balance takes a run of its own
        if ran is not None:
            trace = ran.outcome.traced
            _split(stages, ran)
            findings += ran.outcome.warnings
            found = _energies(target, prepared, options, ran, stages)
    if started is None:
        return None
    sources = sources_of(target, prepared.network)
    findings += [f"{d.code}: {d.message}" for d in report.diagnostics if d.severity != "note"]
    return ReportStudy(
        target, sources, prepared.network, prepared, started, ran, trace, found, tuple(findings), tuple(stages)
    )


def _prepare(request: RunRequest, network: Network, report: Report, stages: Stages) -> Prepared | None:
    """Compiled, with the compiler's own stages."""
    made: Stages = []
    with _time_stage("formulation, build and load", made):
        prepared = prepare(
            network, report, formulation=request.formulation, backend=request.backend, traced=True, gather=False
        )
    if prepared is not None:
        own = [(t.stage, t.wall, t.cpu) for t in prepared.compiled.timings]
        stages += own
        ((name, wall, cpu),) = made
        stages.append((name, max(wall - sum(s[1] for s in own), 0.0), max(cpu - sum(s[2] for s in own), 0.0)))
    return prepared


def _split(stages: Stages, ran: Ran) -> None:
    """The integration apart from the start and the writing of the trace."""
    name, wall, cpu = stages.pop()
    inner = ran.outcome.timings
    spent, busy = (float(inner.get(k, 0.0)) for k in ("wall_integrate_s", "cpu_integrate_s"))
    stages.append(("integration", spent, busy))
    stages.append((name.replace("integration and ", "structure and "), max(wall - spent, 0.0), max(cpu - busy, 0.0)))


def _energies(
    target: Target,
    prepared: Prepared,
    options: Options,
    ran: Ran,
    stages: Stages,
) -> tuple[Share, ...] | None:
    """A second run to the first one's accuracy, in which the power of every element is observed; None without."""
    network, parts = add_observations(prepared.network)
    if not parts or ran.failure or ran.outcome.timings.get("wall_integrate_s", 0.0) > LONG:
        return None
    # what is observed may have no underlying equation
    method = {"dopri": options.method, "energy": "auto"}.get(ran.outcome.method, ran.outcome.method)
    fixed = replace(options, method=method, progress=None)
    fixed = of_these_alone(fixed, prepared.network.traced)
    with _time_stage("energies of the elements (a run of their own)", stages):
        try:
            report = Report()
            rich = prepare(network, report, formulation=prepared.formulation, backend=prepared.backend, traced=True)
            again = None if rich is None else integrate(target, rich, fixed, report)
            return None if again is None or again.failure else shares(again.outcome.traced, parts)
        except (UsageError, TraceError):
            return None


@contextmanager
def _time_stage(stage: str, stages: Stages) -> Iterator[None]:
    wall, cpu = time.perf_counter(), time.process_time()
    yield
    stages.append((stage, time.perf_counter() - wall, time.process_time() - cpu))
