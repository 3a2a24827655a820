"""One scene in every formulation that can express it and by two methods: what `sysdyn verify` compares.

The reference is the scene's formulation and method (or those that the options name).  Its run at a tenth of the
accuracy gives the horizon: the instant up to which two runs of one formulation agree, so that a chaotic model is
compared as far as its own runs justify (where it is chaotic, those of the runs that differ count too).  Up to there
every two runs shall agree within TIMES x accuracy x nominal on every traced quantity; quantities that read multipliers
of redundant constraints are left out.
Received: a request and a folder for the traces (None: they stay in memory); handed back: `Verified`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from sysdyn.cli.failures import OF_CLAIMS, OF_RUNS, UsageError
from sysdyn.cli.options import EVERY
from sysdyn.cli.run.many.crew import Lost, each
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import ACCURACY, RunRequest, check_tolerances, options_of
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import Ran, finding, integrate, ready
from sysdyn.cli.verify.agreement import Bounds, Gap, gaps, horizon
from sysdyn.cli.verify.twins import Twins, free_quantities, twins
from sysdyn.cli.verify.verify_results import RefusedFormulation, Verified, VerifiedRun, disagreements, worst
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Diagnostic, Report
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

METHODS = ("bdf", "radau")
"""Where neither the scene nor the request names a method; else that one, and the first of these that is another; again
these in a formulation that has no such method."""
TIMES = 10.0
"""Of the accuracy asked: what two runs may differ by (CONTRACT)."""
FINER = 0.1
"""Of the accuracy asked: that of the run which gives the horizon (CONTRACT)."""
GRID = 200
"""Intervals of the common instants where the scene leaves them to the solver."""
REFUSALS = ("E601", "E602", "E603", "E604", "E605", "E606", "E607", "E608")
"""Codes by which a formulation says that it cannot express a model."""
JUDGED = (*OF_CLAIMS, *OF_RUNS)
"""What runs say of themselves: it is in their part of the table."""


def verify(
    request: RunRequest,
    report: Report,
    folder: Path | None,
    progress: Callable[[float, float | None], None] | None = None,
    jobs: int | None = 1,
) -> Verified | None:
    """Run and compare; None where the report says why the reference cannot run.  Errors pass as those of `run`.

    jobs: formulations side by side, each in a process of its own; None: where it pays.
    """
    check_tolerances(request)
    if request.method == "euler":
        raise UsageError("--method euler: verify compares bdf and radau, or another and bdf; euler has no accuracy")
    target = targets.target_of(request, report)
    if target is None:
        return None
    return _Verification(targets.with_text(request, target), target, report, folder, progress).all(jobs)


@dataclass(frozen=True, slots=True)
class _Part:
    """What came of one formulation; said: findings of the reference."""

    runs: tuple[VerifiedRun, ...]
    refusals: tuple[RefusedFormulation, ...]
    twins: tuple[Twins, ...]
    left_out: dict[str, str]
    found: dict[tuple[str, object], tuple[Diagnostic, list[str]]]
    bounds: dict[str, float]
    span: tuple[float, float]
    finer: VerifiedRun | None
    said: tuple[Diagnostic, ...]


def _part(asked: tuple[RunRequest, Path | None, str | None]) -> _Part:
    """One formulation (None: the reference) in a process of its own."""
    request, folder, name = asked
    report = Report()
    target = targets.target_of(request, report)
    assert target is not None
    before = set(report)
    own = _Verification(request, target, report, folder, None)
    own._formulation(name)
    runs = tuple(replace(run, outcome=replace(run.outcome, failure=None)) for run in own.runs)
    finer = own.finer and replace(own.finer, outcome=replace(own.finer.outcome, failure=None))
    said = tuple(item for item in report if item not in before)
    return _Part(
        runs, tuple(own.refusals), tuple(own.twins), own.left_out, own.found, own.bounds, own.span, finer, said
    )


class _Verification:
    """The runs of one scene, collected."""

    def __init__(
        self,
        request: RunRequest,
        target: Target,
        report: Report,
        folder: Path | None,
        progress: Callable[[float, float | None], None] | None,
    ) -> None:
        self.request, self.target, self.report, self.folder, self._progress = request, target, report, folder, progress
        self.began = time.monotonic()
        self.done, self.planned = 0, 2 * len(EVERY) + 1
        self.runs: list[VerifiedRun] = []
        self.refusals: list[RefusedFormulation] = []
        self.twins: list[Twins] = []
        self.left_out: dict[str, str] = {}
        self.found: dict[tuple[str, object], tuple[Diagnostic, list[str]]] = {}
        self.bounds: dict[str, float] = {}
        self.span = (0.0, 0.0)
        self.finer: VerifiedRun | None = None
        self.interrupted = False

    def all(self, jobs: int | None = 1) -> Verified | None:
        """Every formulation, then the comparison; behind an interruption of the runs so far, once there is a reference.

        jobs: processes; None: as many as pay, as the reference, which runs here, foretells it.  What they find is taken
        in in the order of formulations, not of their ends.
        """
        began = time.monotonic()
        asked: list[str | None] = []
        # the reference first: its time tells whether processes pay
        if jobs is None or jobs == 1:
            self._formulation(None)
            if self._has_stopped():
                return None
            asked += [name for name in EVERY if name != self.runs[0].formulation]
        # all side by side; which formulation is the reference's is known without a run
        else:
            with ex.fresh():
                first = ready(self.request, self.target, Report())
            asked += [None, *(name for name in EVERY if first and name != first.formulation)]
        items = [(self.request, self.folder, name) for name in asked]
        try:
            # in the order of formulations
            for name, part in zip(asked, each(_part, items, jobs, self._here, time.monotonic() - began), strict=True):
                if isinstance(part, Lost):
                    raise RuntimeError(f"the process of {name or 'the reference'} died ({part.how})")
                if part is not None:
                    self._take(part)
                    self.done = min(self.planned, self.done + len(METHODS) + (name is None))
                    self._advance(0.0, None)
                # without a reference there is nothing to compare
                if name is None and self._has_stopped():
                    return None
        # what is there is compared, once there is a reference
        except KeyboardInterrupt:
            if self.finer is None:
                raise
            self.interrupted = True
        self._tell()
        assert self.finer is not None
        return self._compare_runs(self.finer)

    def _here(self, item: tuple[RunRequest, Path | None, str | None]) -> None:
        """A formulation in this process."""
        self._formulation(item[2])

    def _has_stopped(self) -> bool:
        """The reference did not come to its end: it is said why."""
        if self.runs and self.finer is not None:
            return False
        self._tell()
        return True

    def _take(self, part: _Part) -> None:
        """What came of a formulation."""
        self.runs += part.runs
        self.refusals += part.refusals
        self.twins += part.twins
        self.left_out |= part.left_out
        for key, (item, names) in part.found.items():
            self.found.setdefault(key, (item, []))[1].extend(names)
        self.report.extend(part.said)
        if part.finer is not None:
            self.bounds, self.span, self.finer = part.bounds, part.span, part.finer

    # --- runs ---------------------------------------------------------------------------------------------------

    def _formulation(self, name: str | None) -> None:
        """Both methods in one formulation; None: that of the request, of the scene, or auto (the reference)."""
        report = Report(self.report if name is None else ())
        request = self.request if name is None else replace(self.request, formulation=name, own=True)
        label = name or "reference"
        before = self.done
        with ex.fresh():
            prepared = ready(request, self.target, report)
            if prepared is not None:
                label = prepared.formulation
                options = options_of(request, self.target, prepared, report, self.began, None)
                if options is not None and not report.failed:
                    self._methods(prepared, _on_grid(options), report, reference=name is None)
            elif name is not None and (refusal := _refusal(name, report)):
                self.refusals.append(refusal)
                report = Report()
        self.done = before + len(METHODS) + (name is None)
        self._collect(report, label)
        if name is None:
            self.report.extend(d for d in report if d.severity != "error")

    def _methods(self, prepared: Prepared, options: Options, report: Report, *, reference: bool) -> None:
        """Run a formulation by two methods; of the reference also its own run at a finer accuracy."""
        first, second = _pair(options)
        for method in (first, second):
            inner = Report()
            ran = self._run(prepared, options, method, inner, "")
            # the method does not exist in this formulation: auto in its place
            if ran is None and not reference and method not in METHODS and any(d.code == "E607" for d in inner):
                self._methods(prepared, replace(options, method="auto"), report, reference=False)
                return  # this formulation has no such method
            name = f"{prepared.formulation} {method}"
            self._collect(inner, name)
            if reference and method == first:
                report.extend(d for d in inner if d.severity != "error")
            if ran is None:
                return
            self.runs.append(_read(ran, options, inner))
            self.done += 1
            if method != first:
                continue
            self._facts(ran, options.t_end)
            # bounds of the comparison come from the reference
            if reference:
                self.span = options.t_start, options.t_end
                self.bounds = _bounds(options, self.runs[0].trace)
                self.finer = self._other(prepared, options, self.runs[0])
                self.done += 1

    def _other(self, prepared: Prepared, options: Options, reference: VerifiedRun) -> VerifiedRun | None:
        """The reference at a tenth of the accuracy; at a coarser tolerance where it has the finest there is already."""
        finer, report = _finer(options), Report()
        ran = self._run(prepared, finer, reference.method, report, "-finer")
        if ran is None:
            return None
        run = _read(ran, finer, report)
        used = float(reference.trace.attributes["rtol"])
        if float(run.trace.attributes["rtol"]) <= 0.5 * used:
            return run
        coarser = replace(finer, rtol=used / FINER)
        report = Report()
        ran = self._run(prepared, coarser, reference.method, report, "-coarser")
        return None if ran is None else _read(ran, coarser, report)

    def _run(self, prepared: Prepared, options: Options, method: str, report: Report, suffix: str) -> Ran | None:
        path = None if self.folder is None else self.folder / f"{prepared.formulation}-{method}{suffix}.h5"
        options = replace(options, output=path, method=method, progress=self._advance)
        return integrate(self.target, prepared, options, report)

    def _facts(self, ran: Ran, until: float) -> None:
        """What the formulation says beside its traces: its other carrier, multipliers that are not unique."""
        pair = twins(ran.prepared, ran.started, until)
        if pair is not None:
            self.twins.append(pair)
        for name in free_quantities(ran.prepared, ran.started):
            self.left_out[name] = "multiplier of a redundant constraint"

    def _advance(self, fraction: float, _left: float | None) -> None:
        """Progress over all runs."""
        if self._progress is not None:
            whole = (self.done + fraction) / self.planned
            spent = time.monotonic() - self.began
            self._progress(whole, spent * (1.0 - whole) / whole if whole > 0.05 else None)

    # --- findings -----------------------------------------------------------------------------------------------

    def _collect(self, report: Report, name: str) -> None:
        """Errors by code and place, with the runs that have them."""
        for item in report:
            if item.severity == "error" and item.code not in JUDGED:
                self.found.setdefault((item.code, item.place), (item, []))[1].append(name)

    def _tell(self) -> None:
        """Errors into the report; those of some runs alone name the runs."""
        everywhere = max(len(self.runs), 1)
        for item, names in self.found.values():
            some = f" (in {', '.join(names)})" if len(names) < everywhere else ""
            self.report.add(replace(item, message=item.message + some))

    # --- comparison ---------------------------------------------------------------------------------------------

    def _compare_runs(self, finer: VerifiedRun) -> Verified:
        """Compare all runs up to the horizon of the reference, or of a run that loses its accuracy earlier."""
        reference = self.runs[0]
        # quantities without a bound, or missing somewhere, are named
        for name in reference.trace.names:
            if not math.isfinite(self.bounds.get(name, math.inf)):
                self.left_out.setdefault(name, "no accuracy is asked of it")
        for run in self.runs:
            for name in set(reference.trace.names) ^ set(run.trace.names):
                self.left_out.setdefault(name, f"not in every formulation: {run.formulation}")
        bounds = {name: bound for name, bound in self.bounds.items() if name not in self.left_out}
        until, beyond = horizon(reference.trace, finer.trace, bounds)
        by, found = reference.name, disagreements(self.runs, bounds, until)
        if found and beyond is not None:
            # chaotic: a run that differs may have lost its accuracy earlier than the reference
            for name in dict.fromkeys(r.name for d in found for r in (d.one, d.other) if r is not reference):
                own, differs = self._own_horizon(name, bounds)
                if own < until:
                    until, beyond, by = own, differs, name
            found = disagreements(self.runs, bounds, until)
        return Verified(
            self.target.name,
            self.span,
            tuple(self.runs),
            finer,
            tuple(worst(reference, run, bounds, until) for run in (*self.runs, finer)),
            tuple(self.refusals),
            tuple(self.twins),
            until,
            beyond,
            by,
            tuple(bounds),
            tuple(sorted(self.left_out.items())),
            found,
            self._starts(bounds),
            self.interrupted,
        )

    def _starts(self, bounds: dict[str, float]) -> tuple[tuple[VerifiedRun, Gap], ...]:
        """One run of each other formulation, and its worst gap to the reference at the first instant."""
        reference, begun = self.runs[0], dict[str, tuple[VerifiedRun, Gap]]()
        for run in self.runs:
            if run.formulation != reference.formulation and run.formulation not in begun:
                for gap in gaps(reference.trace, run.trace, bounds, self.span[0])[:1]:
                    begun[run.formulation] = run, gap
        return tuple(begun.values())

    def _own_horizon(self, name: str, bounds: Bounds) -> tuple[float, Gap | None]:
        """The horizon [s] of a run from its own finer one, and what differs beyond it."""
        run = next(run for run in self.runs if run.name == name)
        request, report = replace(self.request, formulation=run.formulation), Report()
        with ex.fresh():
            prepared = ready(request, self.target, report)
            options = prepared and options_of(request, self.target, prepared, report, self.began, None)
            other = self._other(prepared, _on_grid(options), run) if prepared and options else None
        return (math.inf, None) if other is None else horizon(run.trace, other.trace, bounds)


def _refusal(formulation: str, report: Report) -> RefusedFormulation | None:
    """Why a formulation cannot express the model; None where something else is wrong."""
    if any(d.severity == "error" and d.code not in REFUSALS for d in report):
        return None
    reasons = [d for d in report if d.code in REFUSALS]
    reasons.sort(key=lambda d: d.severity != "error")
    return RefusedFormulation(formulation, reasons[0].code, reasons[0].message) if reasons else None


def _on_grid(options: Options) -> Options:
    """Options whose trace holds the same instants whatever the method."""
    if options.every is not None:
        return options
    return replace(options, every=(options.t_end - options.t_start) / GRID)


def _pair(options: Options) -> tuple[str, str]:
    """The method of the reference, and the other one."""
    if options.method in ("auto", "euler"):
        return METHODS
    return options.method, next(m for m in METHODS if m != options.method)


def _finer(options: Options) -> Options:
    """Options at a tenth of the accuracy (and of the solver's own tolerances)."""
    return replace(
        options,
        accuracy=None if options.accuracy is None else FINER * options.accuracy,
        accuracy_on=tuple((name, FINER * wanted) for name, wanted in options.accuracy_on),
        rtol=None if options.rtol is None else FINER * options.rtol,
        atol=None if options.atol is None else FINER * options.atol,
    )


def _bounds(options: Options, trace: Trace) -> dict[str, float]:
    """Relative difference allowed of each traced quantity; infinite where no accuracy is asked of it."""
    wanted = dict(options.accuracy_on)
    rest = math.inf if options.accuracy is None else options.accuracy
    return {name: TIMES * wanted.get(name, rest) for name in trace.names}


def _read(ran: Ran, options: Options, report: Report) -> VerifiedRun:
    accuracy = min([options.accuracy or ACCURACY, *(wanted for _, wanted in options.accuracy_on)])
    claims = tuple((claim.text, claim.ok) for claim in ran.claims)
    trace = ran.outcome.traced
    said = finding(report) if ran.failure else None
    return VerifiedRun(
        ran.prepared.formulation, ran.outcome.method, accuracy, ran.outcome, claims, trace, ran.failure, said
    )
