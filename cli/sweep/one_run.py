"""One case of a sweep: its run in memory, and what is kept of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.loaded import Loaded
from sysdyn.cli.run.running import Ran, Request
from sysdyn.cli.sweep.axes import CHOICES
from sysdyn.cli.sweep.study import Case
from sysdyn.dsl.text.diagnostics import ModelError, Report
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.trace.trace import Trace

ROWS = 256
"""Of a thinned trace at most."""


@dataclass(frozen=True, slots=True)
class Kept:
    """What is kept of a run.  exit: as `simulate` ends; reason: why it is not 0; end, least, most by traced name; time
    and traces: thinned, where the scene has an interval.
    """

    run: int
    exit: int
    met: bool
    reason: str = ""
    method: str = ""
    error_estimate: float | None = None
    steps: int = 0
    cpu_s: float = 0.0
    end: dict[str, float] | None = None
    least: dict[str, float] | None = None
    most: dict[str, float] | None = None
    time: list[float] | None = None
    traces: dict[str, list[float]] | None = None

    def to_json(self) -> dict[str, Any]:
        """For the journal; numbers to the last bit."""
        return asdict(self)


class Runner:
    """Runs cases of one request; what compiles differently is loaded once each."""

    def __init__(self, request: Request) -> None:
        self.request = request
        self._loaded: dict[tuple[tuple[str, str], ...], Loaded] = {}

    def loaded(self, choices: tuple[tuple[str, str], ...] = ()) -> Loaded:
        """The model under choices that are no numbers."""
        if choices not in self._loaded:
            self._loaded[choices] = Loaded(_chosen(self.request, choices))
        return self._loaded[choices]

    def __call__(self, number: int, case: Case) -> Kept:
        """A run that cannot be made is kept with its reason."""
        choices = tuple((n, str(v)) for n, v in case.items() if n in CHOICES or n.startswith("level "))
        names = {name for name, _ in choices}
        settings = {name: value for name, value in case.items() if name not in names}
        report = Report()
        try:
            ran = self.loaded(choices).run(settings, report)
        except ModelError as error:
            return Kept(number, 1, False, _first(error.diagnostics))
        except UsageError as error:
            return Kept(number, 2, False, str(error))
        except SolverFailure as error:
            return Kept(number, 3, False, str(error))
        if ran is None:
            return Kept(number, 1, False, _first(report.diagnostics))
        return _kept(number, ran, report)


def _chosen(request: Request, choices: tuple[tuple[str, str], ...]) -> Request:
    """The request under choices."""
    changes: dict[str, Any] = {}
    levels = list(request.levels)
    for name, value in choices:
        if name.startswith("level "):
            levels.append((name.removeprefix("level ").strip(), value))
        elif name in ("accuracy", "rtol"):
            try:
                changes[name] = float(value)
            except ValueError:
                raise UsageError(f"--over {name}: '{value}' is no number") from None
        else:
            changes[name] = None if (name, value) == ("formulation", "auto") else value
    return replace(request, levels=tuple(levels), output=None, **changes)


def _first(diagnostics: Any) -> str:
    """The first error, as one line."""
    errors = [d for d in diagnostics if d.severity == "error"]
    return f"{errors[0].code}: {errors[0].message}" if errors else "it could not be run"


def _kept(number: int, ran: Ran, report: Report) -> Kept:
    o = ran.outcome
    trace = o.traced
    values = {name: np.asarray(trace[name]) for name in trace.names}
    some = trace.time.size > 0
    time, traces = _thinned(ran, trace, values) if some else (None, None)
    return Kept(
        number,
        ran.exit,
        o.met,
        "" if ran.exit == 0 else ran.failure or _first(report.diagnostics),
        o.method,
        o.error_estimate,
        int(o.statistics["steps"]),
        float(o.timings["cpu_integrate_s"]),
        {n: float(v[-1]) for n, v in values.items()} if some else None,
        {n: float(v.min()) for n, v in values.items()} if some else None,
        {n: float(v.max()) for n, v in values.items()} if some else None,
        time,
        traces,
    )


def _thinned(
    ran: Ran, trace: Trace, values: dict[str, Any]
) -> tuple[list[float] | None, dict[str, list[float]] | None]:
    """Rows at every k-th instant of the scene's interval, the last before each instant that has several."""
    scene = ran.prepared.network.scene
    if scene is None or scene.every is None or scene.start is None:
        return None, None
    evaluate = ran.prepared.binding.evaluate
    begin, step, end = evaluate(scene.start), evaluate(scene.every), float(trace.time[-1])
    number = round((end - begin) / step)
    grid = begin + step * np.arange(0, number + 1, -(-(number + 1) // ROWS))
    place = np.clip(np.searchsorted(trace.time, grid + 1e-9 * step, side="right") - 1, 0, None)
    return grid.tolist(), {name: v[place].tolist() for name, v in values.items()}
