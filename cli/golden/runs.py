"""One run for a golden trace: the scene on instants of our choice, its curves, its structure, its meters."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from sysdyn.cli.failures import OF_CLAIMS, OF_RUNS
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest, options_of
from sysdyn.cli.run.running import Ran, integrate, ready
from sysdyn.cli.run.start.starting import as_written
from sysdyn.compiler.model import energies
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.comparison.arrays import Arrays, arrays_of
from sysdyn.runtime.comparison.curve import Floats
from sysdyn.values import dataclass

INSTANTS = 2000
"""Rows of each run besides its steps: what has no stored rate is a line between them."""
PARTS = 16
"""Parts of each cell of the kept trace at whose ends a run has rows too: dense where the curves are not smooth."""
APART = 1e-12
"""Of the span: instants nearer than this are one, computed in two ways."""


def between(time: Floats) -> Floats:
    """Instants [m] s of the kept rows [n] and of the parts between them."""
    return np.unique(np.linspace(time[:-1], time[1:], PARTS + 1)) if time.size > 1 else time


@dataclass(frozen=True, slots=True)
class GoldenRun:
    """trace: its curves; structure: of this formulation; energy [J], constraints: largest of the meters;
    turnover [J]: the energy that went round; parameters: name to value in SI; claims: what it fails of them.
    """

    trace: Arrays
    structure: dict[str, Any]
    energy: float
    constraints: float
    turnover: float
    formulation: str
    method: str
    parameters: dict[str, float]
    claims: tuple[str, ...] = ()


class Stopped(Exception):  # noqa: N818 (no fault of the program)
    """The run did not come to its end.  code: the exit code; finding: code of the first error, if there is one."""

    def __init__(self, code: int, message: str, finding: str = "") -> None:
        self.code, self.finding = code, finding
        super().__init__(message)


@ex.fresh()
def run(request: RunRequest, also: Floats | None = None) -> GoldenRun:
    """Simulate at the request's accuracy, or the scene's own where that is finer (its expectations want it).

    also [m] s: further instants of the trace.  Raises Stopped, UsageError, OSError, TraceError.
    """
    report = Report()
    ran = _ran(request, report, also)
    later = (*OF_CLAIMS, *OF_RUNS)  # claims are judged by `simulate`, at the scene's own accuracy
    errors = [d for d in report.diagnostics if d.severity == "error" and (ran is None or d.code not in later)]
    # no run: the first error, or the note of what is planned
    if ran is None or errors:
        first = next(iter(errors), None)
        where = f"{first.place.file}:{first.place.start[0]}: " if first and first.place else ""
        if first is None:  # notes alone: what is planned for later
            note = next(iter(report.diagnostics), None)
            raise Stopped(1, note.message if note else "the model has errors", note.code if note else "")
        raise Stopped(1, f"{where}{first.code}: {first.message}", first.code)
    # it stopped
    if ran.failure:
        raise Stopped(3, ran.failure)
    # it ended, and is not met
    if not ran.outcome.met:
        unmet = next(d for d in report.diagnostics if d.code in OF_RUNS)
        raise Stopped(3, unmet.message, unmet.code)
    trace = ran.outcome.traced
    energy, constraints = (_largest(trace[f"audit.{meter}"].values) for meter in ("energy", "constraints"))
    parameters = {name: value for name, (value, _) in trace.parameters.items()}
    source = arrays_of(trace)
    formulation, method = ran.prepared.formulation, ran.outcome.method
    turnover = ran.outcome.judgement.turnover if ran.outcome.judgement else 0.0
    claims = tuple(d.message for d in report.diagnostics if d.code == "E909")
    structure = _structure(ran, source)
    return GoldenRun(source, structure, energy, constraints, turnover, formulation, method, parameters, claims)


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _ran(request: RunRequest, report: Report, also: Floats | None) -> Ran | None:
    """As `cli.running.run`, but the trace holds the steps and the instants that are wanted here."""
    target = targets.target_of(request, report)
    if target is None:
        return None
    prepared = ready(request, target, report)
    own = replace(request, accuracy=None)
    options = None if prepared is None else options_of(own, target, prepared, report, time.monotonic(), None)
    if prepared is None or options is None:
        return None
    # the finest of what is asked for, of the text's, of single quantities
    if request.accuracy is not None:
        finest = min([request.accuracy, options.accuracy or 1.0, *(a for _, a in options.accuracy_on)])
        options = replace(options, accuracy=finest, accuracy_on=())
    even = np.linspace(options.t_start, options.t_end, INSTANTS + 1)
    wanted = even if also is None else np.union1d(even, also)
    # instants so near that they are one
    wanted = wanted[np.diff(wanted, prepend=-np.inf) > APART * (options.t_end - options.t_start)]
    inside = wanted[(wanted >= options.t_start) & (wanted <= options.t_end)]
    # the steps themselves and these instants, in place of the scene's
    options = replace(options, output=None, every=None, at=tuple(inside.tolist()))
    return integrate(target, prepared, options, report)


def _structure(ran: Ran, trace: Arrays) -> dict[str, Any]:
    """Equations, degrees of freedom, index, counts of one formulation: independent of parameters' values, and of what
    the scene needs of the model.
    """
    prepared, started = ran.prepared, ran.started
    if prepared.left_out:
        prepared, started = as_written(prepared, started.state.t) or (prepared, started)
    facts, manifest = started.facts, prepared.manifest
    return {
        **facts.counts,
        "unknowns": [[u["name"], u["kind"], u["unit"], u["differential"]] for u in manifest["unknowns"]],
        "rows": [[r["label"], r["kind"]] for r in manifest["rows"]],
        "equations": energies.show(prepared.compiled.energies).splitlines(),
        "quantities": sorted(trace.values),
    }
