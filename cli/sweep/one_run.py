"""One case of a sweep: its run in memory, and what is kept of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.many.reusable_model import Loaded
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import Ran, finding
from sysdyn.cli.sweep.axes import CHOICES
from sysdyn.cli.sweep.core_cases import Cases, thin_instants
from sysdyn.cli.sweep.run_records import Item, Kept
from sysdyn.cli.sweep.study import Case
from sysdyn.dsl.text.diagnostics import ModelError, Report
from sysdyn.runtime.many.asked import NotApplicableError
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.trace.trace import Trace

Task = tuple[int, Case]
"""Number of a run, and what it takes."""


class Runner:
    """Runs cases of one request; what compiles differently is loaded once each.

    keep: end, extrema or traces of each run; core: many at once where that can be; loaded: what is loaded already.
    """

    def __init__(
        self, request: RunRequest, keep: str = "traces", *, core: bool = True, loaded: Loaded | None = None
    ) -> None:
        self.request, self.keep, self.core = replace(request, extrema=keep != "end"), keep, core
        loaded = None if loaded is None else loaded.keeping(extrema=keep != "end")
        self._loaded: dict[tuple[tuple[str, str], ...], Loaded] = {} if loaded is None else {(): loaded}
        self._in_core: dict[Any, Cases | str] = {}

    def load_model(self, choices: tuple[tuple[str, str], ...] = ()) -> Loaded:
        """The model under choices that are no numbers."""
        if choices not in self._loaded:
            self._loaded[choices] = Loaded(_chosen(self.request, choices))
        return self._loaded[choices]

    def __call__(self, number: int, case: Case) -> Kept:
        """A run that cannot be made is kept with its reason."""
        choices, settings = _split_case(case)
        report = Report()
        try:
            ran = self.load_model(choices).run(settings, report)
        except ModelError as error:
            return Kept(number, 1, False, _first(error.diagnostics), finding=finding(error.diagnostics))
        except UsageError as error:
            return Kept(number, 2, False, str(error))
        except SolverFailure as error:
            return Kept(number, 3, False, str(error))
        if ran is None:
            return Kept(number, 1, False, _first(report.diagnostics), finding=finding(report.diagnostics))
        return _keep(number, ran, report, self.keep)

    def chunk(self, tasks: Sequence[Task]) -> tuple[list[Item], list[Task]]:
        """What is kept of the tasks that the core could run, and those that need a run of their own."""
        groups: dict[Any, list[Task]] = {}
        for number, case in tasks:
            choices, settings = _split_case(case)
            groups.setdefault((choices, tuple(settings)), []).append((number, case))
        found, left = list[Item](), list[Task]()
        for (choices, names), group in groups.items():
            way = self.way(choices, names)
            if isinstance(way, str):
                left += group
                continue
            block, places = way.run([number for number, _ in group], [case for _, case in group])
            found += [block] if block is not None else []
            left += [group[k] for k in places]
        return found, left

    def way(self, choices: tuple[tuple[str, str], ...], names: tuple[str, ...]) -> Cases | str:
        """The core's way for cases with these names, or why there is none."""
        key = choices, names
        if key not in self._in_core:
            try:
                self._in_core[key] = Cases(self.load_model(choices), names, self.keep) if self.core else "not asked for"
            except NotApplicableError as error:
                self._in_core[key] = str(error)
            except (ModelError, UsageError, SolverFailure):
                self._in_core[key] = "the text's own numbers do not run"
        return self._in_core[key]

    def reason_for_single_runs(self, case: Case) -> str:
        """Why cases like this one are run one by one; "" where they are not."""
        choices, settings = _split_case(case)
        way = self.way(choices, tuple(settings))
        return way if isinstance(way, str) else ""


def _split_case(case: Case) -> tuple[tuple[tuple[str, str], ...], dict[str, Any]]:
    """Choices of a case that are no numbers; its other settings."""
    choices = tuple((n, str(v)) for n, v in case.items() if n in CHOICES or n.startswith("level "))
    names = {name for name, _ in choices}
    return choices, {name: value for name, value in case.items() if name not in names}


def _chosen(request: RunRequest, choices: tuple[tuple[str, str], ...]) -> RunRequest:
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


def _keep(number: int, ran: Ran, report: Report, keep: str) -> Kept:
    """What is kept of a run: how it ended, and end, extrema or traces of its quantities."""
    o = ran.outcome
    trace = o.traced
    values = {name: np.asarray(trace[name]) for name in trace.names}
    some = trace.time.size > 0
    time, traces = _thin_trace(ran, trace, values) if some and keep == "traces" else (None, None)
    extrema, within, none = some and keep != "end", o.extrema, (math.inf, -math.inf)
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
        {n: min(float(v.min()), within.get(n, none)[0]) for n, v in values.items()} if extrema else None,
        {n: max(float(v.max()), within.get(n, none)[1]) for n, v in values.items()} if extrema else None,
        time,
        traces,
        None if ran.exit == 0 else finding(report.diagnostics),
    )


def _thin_trace(
    ran: Ran, trace: Trace, values: dict[str, Any]
) -> tuple[list[float] | None, dict[str, list[float]] | None]:
    """Rows at every k-th instant of the scene's interval, the last before each instant that has several."""
    scene = ran.prepared.network.scene
    if scene is None or scene.every is None or scene.start is None:
        return None, None
    evaluate = ran.prepared.binding.evaluate
    grid, place = thin_instants(evaluate(scene.start), evaluate(scene.every), trace.time)
    return grid.tolist(), {name: v[place].tolist() for name, v in values.items()}
