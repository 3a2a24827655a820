"""Runs of one model for measurements: prepared once, run with many options, compared with a reference of its own.

Errors are those of every row that a run stored, against one finer run that stores rows at all these instants; relative
to the trace's nominal magnitudes.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from sysdyn.cli.run.events import plan
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest, options_of, stops
from sysdyn.cli.run.request.sizes import sizes
from sysdyn.cli.run.running import ready, rest
from sysdyn.cli.run.start.starting import start
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure
from sysdyn.runtime.simulate import Outcome, simulate
from sysdyn.runtime.trace.trace import Trace

MODELS = Path(__file__).resolve().parents[2] / "models"
LONGEST_RUN = 20.0
"""Seconds after which a run is given up."""
TIMING = 1e-9
"""Of the span: the time tolerance of comparisons (accuracy/control.py)."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One command's integration.  options: as it was asked for; cpu: cpu_integrate_s, the least of all repetitions;
    estimate: None where none; steps: of all its runs; last, rtol: steps and tolerance of the last one.
    """

    options: dict[str, object]
    cpu: float
    estimate: float | None
    met: bool
    steps: int
    last: int
    method: str
    rtol: float
    time: np.ndarray
    values: dict[str, np.ndarray]
    nominal: dict[str, float]


def names(*rooms: str) -> list[str]:
    """room/NAME of every model of these rooms."""
    return [f"{room}/{p.stem}" for room in rooms for p in sorted((MODELS / room).glob("*.sd"))]


class Bench:
    """A model under its scene `reference` and one formulation."""

    def __init__(
        self, name: str, folder: Path, formulation: str | None = None, settings: tuple[tuple[str, str], ...] = ()
    ) -> None:
        path = MODELS / f"{name}.sd"
        report = Report()
        self.trace = folder / "trace.h5"
        settings = (*sizes(str(path))[1], *settings)
        request = RunRequest(str(path), "reference", formulation=formulation, output=str(self.trace), settings=settings)
        target = targets.one(targets.read(str(path), report), str(path), None, "reference", report)
        assert target is not None, [d.message for d in report.diagnostics]
        with ex.fresh():
            prepared = ready(request, target, report)
            if prepared is None or prepared.network.events or prepared.network.switches:
                raise NoSuchForm("values beside a jump are of instants, not of errors")
            began = time.monotonic()
            options = options_of(request, target, prepared, report, began, None)
            assert options is not None
            started = start(prepared, options.t_start, report, options.redundancy)
            assert started is not None, [d.message for d in report.diagnostics]
            jumps = plan(prepared, started.system, rest=rest(options))  # of laws, which a command locates
            options = replace(options, stops=stops(prepared, options, report), watch=None, sampled_at=(), events=jumps)
        self.prepared, self.started = prepared, started
        self.options = replace(options, sample_steps=False, max_wall=LONGEST_RUN, accuracy_on=())

    def run(self, repetitions: int = 1, **options: object) -> Measured | None:
        """None where the run failed."""
        try:
            outcomes = [self._once(options) for _ in range(repetitions)]
        except (SolverFailure, NoSuchForm):
            return None
        outcome, cpu = outcomes[-1], min(map(_cpu, outcomes))
        trace = Trace.open(self.trace)
        instants = np.array(trace.time)
        # an instant stands twice where the text jumps: the row before is left out
        keep = np.append(np.diff(instants) > 0.0, True)
        columns = {name: np.asarray(trace[name])[keep] for name in trace.names}
        nominal = {name: float(trace[name].nominal) for name in trace.names}
        steps, rtol = outcome.statistics["steps"], float(trace.attributes["rtol"])
        told = outcome.error_estimate, outcome.met, steps, outcome.steps, outcome.method, rtol
        return Measured(options, cpu, *told, instants[keep], columns, nominal)

    def timed(self, runs: list[Measured], seconds: float) -> list[float]:
        """CPU time (s) of each run's integration: the least of as many repetitions by turns as take so long (s).  Of
        runs of a millisecond the least of three is off by a fifth, and one beside another by what the machine does
        meanwhile.
        """
        found = [run.cpu for run in runs]
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = [min(cpu, _cpu(self._once(run.options))) for cpu, run in zip(found, runs, strict=True)]
        return found

    def _once(self, options: dict[str, object]) -> Outcome:
        asked = replace(self.options, **options)  # type: ignore[arg-type]
        started = self.started
        parts = started.system.description, None, self.prepared.carrier
        return simulate(*parts, asked, start=started.state, facts=started.facts)


def _cpu(outcome: Outcome) -> float:
    return float(outcome.timings["cpu_integrate_s"])


class Reference:
    """A run at `rtol` with rows at all instants of the runs it judges, and the time tolerance beside them.  Where a
    law jumps, which radau's iteration does not pass (tube), one of rosenbrock near its finest tolerance: 1e-7 there;
    where constraints lose rank (fourbar) one of dopri.
    """

    def __init__(self, bench: Bench, runs: list[Measured], rtol: float = 1e-15) -> None:
        self.late = TIMING * (bench.options.t_end - bench.options.t_start)
        times = np.unique(np.concatenate([run.time for run in runs]))
        at = np.unique(np.clip([times - self.late, times, times + self.late], times[0], times[-1]))
        asked = {"accuracy": None, "index": "auto", "at": tuple(at), "max_wall": 60.0}
        tried = (("radau", rtol), ("rosenbrock", 3e-10), ("dopri", 1e-12))
        runs = (bench.run(**asked, rtol=finest, method=method) for method, finest in tried)
        found = next((run for run in runs if run is not None), None)
        if found is None:
            raise NoSuchForm("no reference within its time")
        self.found = found

    def error(self, run: Measured) -> float:
        """Largest relative error of any traced quantity at any row: how far it is from all that the reference holds
        within the time tolerance.
        """
        time = self.found.time
        low = np.searchsorted(time, run.time - self.late)
        high = np.minimum(np.searchsorted(time, run.time + self.late), time.size - 1)
        worst = 0.0
        for name, values in run.values.items():
            size = self.found.nominal[name]
            if size > 0.0:
                near = [self.found.values[name][np.minimum(low + k, high)] for k in range(1 + int((high - low).max()))]
                beyond = np.maximum(values - np.max(near, axis=0), np.min(near, axis=0) - values)
                worst = max(worst, float(beyond.max()) / size)
        return worst
