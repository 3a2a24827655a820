"""The Python face of sysdyn for notebooks and scripts: `load`, `simulate`, `Trace`, `compile_model`, `check`.

They call what the commands call.  Findings of a model that cannot be used are raised as `ModelError`, wrong usage as
`UsageError`, a solver that stops as `SolverFailure`, a run that is not met as `NotMet`; of what a run says of its
results is warned, notes of the text stay silent.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.api.compiled import Module, by_name, check_choices, compile_model, parameters_of_text, written
from sysdyn.api.linear import Linearised, NoState, linearised_at, resting
from sysdyn.cli.analysis.resting import Equilibrium
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.check.checking import check_target
from sysdyn.cli.run.many.reusable_model import Loaded, shortly, text_of
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import Ran, run
from sysdyn.cli.sweep.one_run import Runner
from sysdyn.cli.sweep.sweep_results import Sweep
from sysdyn.distribution import warn_of_other
from sysdyn.dsl import load as load_
from sysdyn.dsl import unused_components
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.runtime.judgement import Shortfall
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.trace.trace import Trace

warn_of_other()  # where the other project's `sysdyn/__init__.py` lies over ours, nothing before this is ours

__all__ = [
    "Diagnostic",
    "Equilibrium",
    "Linearised",
    "Model",
    "ModelError",
    "Module",
    "NoState",
    "NotMet",
    "SolverFailure",
    "Sweep",
    "Trace",
    "UsageError",
    "check",
    "compile_model",
    "equilibria",
    "linearize",
    "load",
    "simulate",
]


class NotMet(Exception):  # noqa: N818 (a name of the house)
    """A run that ended, but did not meet what it judges itself by; trace: complete; not_met: what was missed."""

    def __init__(self, trace: Trace, not_met: tuple[Shortfall, ...], findings: tuple[Diagnostic, ...]) -> None:
        self.trace, self.not_met = trace, not_met
        super().__init__("; ".join(d.message for d in findings if d.code in ("E920", "E921")))


def simulate(path: str | Path, *, unmet: str = "raise", **options: Any) -> Trace:
    """Simulate a scene of a file; the options are those of the command (`until`, `set`, `accuracy`, `at`, ...).

    set: a mapping of names to numbers or texts; level: one of paths to levels; at: instants or one text; output: the
    trace's file (a default as the command's); unmet: "warn" where a run that is not met shall warn instead of raising
    `NotMet`.  Returns the trace.
    """
    _check_unmet(unmet)
    report = Report()
    ran = run(_request(path, options), report)
    return _trace_or_raise(ran, report, unmet)


def _check_unmet(unmet: str) -> None:
    if not isinstance(unmet, str) or unmet not in ("raise", "warn"):
        raise UsageError(f"unmet {shortly(unmet)}: raise or warn")


def _trace_or_raise(ran: Ran | None, report: Report, unmet: str) -> Trace:
    """The trace of a run that came to its end, or what stopped it."""
    # the text or the start is wrong
    if ran is None or ran.exit == 1:
        raise ModelError(report.diagnostics)
    # the solver stopped
    if ran.outcome.failure is not None:
        raise ran.outcome.failure
    trace = ran.outcome.traced
    for text in ran.outcome.warnings:
        warnings.warn(text, stacklevel=3)
    # ended, and not met: raised, or warned of
    if ran.outcome.judgement is not None and not ran.outcome.met:
        found = NotMet(trace, ran.outcome.judgement.not_met, report.diagnostics)
        if unmet == "raise":
            raise found
        warnings.warn(str(found), stacklevel=3)
    return trace


class Model:
    """A model of a file under a scene, compiled once and run often; see `load`.

    parameters: values in SI units as the text has them; traced: names of the scene's quantities; formulation.
    """

    def __init__(self, loaded: Loaded) -> None:
        self._loaded = loaded
        prepared = loaded.first.prepared
        self.parameters = parameters_of_text(prepared.binding.values)
        self.traced = prepared.network.traced
        self.formulation = prepared.formulation

    def __repr__(self) -> str:
        return f"<sysdyn model {self._loaded.target.name}: {len(self.parameters)} parameters, {self.formulation}>"

    def run(
        self,
        set: Mapping[str, Any] | None = None,
        until: float | str | None = None,
        at: Iterable[float] | str | None = None,
        *,
        unmet: str = "raise",
        **options: Any,
    ) -> Trace:
        """One run, in memory: parameters or inputs by name (numbers in SI units, or texts), the end [s], instants [s].

        options: `accuracy`, `rtol`, `atol`, `method`, `step`, `index`, `max_steps`, `max_wall`, `output` that
        differ from those of `load`.  Raises as `simulate` does.
        """
        _check_unmet(unmet)
        if not options.keys() <= _RUN:
            raise UsageError(f"run() has no option {', '.join(sorted(options.keys() - _RUN))}: give it to load()")
        given = {name: value for name, value in {"until": until, "at": at, **options}.items() if value is not None}
        report, values = Report(), _settings({} if set is None else set)
        if given:
            return _trace_or_raise(self._loaded.run(values, report, alone=True, **_changes(given)), report, unmet)
        found = self._loaded.trace(values, report)
        return found if isinstance(found, Trace) else _trace_or_raise(found, report, unmet)

    def sweep(
        self,
        over: Mapping[str, Any],
        *,
        runs: int | None = None,
        sample: str | None = None,
        seed: int = 0,
        until: float | str | None = None,
        keep: str = "traces",
        jobs: int = 1,
        dask: str | None = None,
        output: str | Path | None = None,
    ) -> Sweep:
        """Many runs: the study of `sysdyn sweep`.

        over: names to lists of numbers (SI) or texts, or to what `--over` takes behind the name: "1 N/m..2 N/m:5",
        "~normal(4 N/m, 0.1 N/m)"; runs, sample, seed: of what is drawn.  keep: end, extrema or traces of each run.
        jobs: processes side by side (a script that asks for several has its calls under `if __name__ == "__main__"`);
        dask: address of a scheduler.  output: the file, which the same call goes on with after a kill; None: memory.
        A run that fails does not raise: `failed` of what is returned names it.
        """
        from sysdyn.cli.sweep.study import line, study
        from sysdyn.cli.sweep.sweeping import axes_of, sweep

        # the model that is loaded, unless the end is another
        request = replace(self._loaded.request, output=None, **_changes({} if until is None else {"until": until}))
        runner = Runner(request, keep, loaded=self._loaded if until is None else None)
        axes = axes_of(runner, tuple(line(name, value) for name, value in by_name("over", over).items()))
        # numbers as they are given, with errors that name them
        counts = {"runs": runs, "seed": seed, "jobs": jobs}
        counts = {name: n if n is None else int(_number(name, n, int)) for name, n in counts.items()}
        asked = study(axes, sample, counts["runs"], counts["seed"] or 0)
        # in memory: a file that goes with the folder
        with tempfile.TemporaryDirectory(prefix="sysdyn-") as folder:
            file = Path(output) if output is not None else Path(folder) / "sweep.h5"
            sweep(request, asked, file, counts["jobs"] or 1, _silent, timings=True, keep=keep, dask=dask, runner=runner)
            return Sweep.open(file)


def _silent(fraction: float, ahead: float | None) -> None:
    """Progress of a sweep that nobody watches."""


_SOLVED = "accuracy", "accuracy_check", "rtol", "atol", "method", "step", "index", "max_steps", "max_wall"
_RUN = frozenset((*_SOLVED, "output"))


def load(path: str | Path, *, model: str | None = None, scene: str | None = None, **options: Any) -> Model:
    """A model prepared once, for many runs; the options are those of `simulate`.

    The first run sets up; a short one without events then costs its integrations and some tenths of a millisecond,
    another one some milliseconds.  What a run comes to depends on its own numbers alone.
    """
    given = {"model": model, "scene": scene, **options}
    if isinstance(given.get("formulation"), str) and given["formulation"] == "auto":
        given["formulation"] = None
    return Model(Loaded(replace(_request(path, given), output=None)))


def linearize(
    path: str | Path,
    *,
    at: float | str | None = None,
    equilibrium: bool = False,
    inputs: Iterable[str] | None = None,
    outputs: Iterable[str] | None = None,
    **options: Any,
) -> Linearised:
    """The linearisation about the scene's start, an instant [s], or a state of rest; options as of the command.

    Raises ModelError, UsageError, NoState, NoLinearisation.
    """
    if at is not None and equilibrium:
        raise UsageError("at together with equilibrium: an instant of a run, or a state of rest")
    request = _request(path, {**options, "until": at})
    known = (None if names is None else _names(names) for names in (inputs, outputs))
    return linearised_at(request, *known, rest=equilibrium)


def _names(names: Any) -> tuple[str, ...]:
    found = tuple(names) if isinstance(names, list | tuple | set | dict | Iterator) else (None,)
    if not all(isinstance(name, str) for name in found):
        raise UsageError(f"{shortly(names)}: a list of names is wanted")
    return tuple(map(str, found))


def equilibria(path: str | Path, *, tries: int = 40, **options: Any) -> tuple[Equilibrium, ...]:
    """States of rest with their stability, from the guesses and from `tries` points around them; () if none."""
    return resting(_request(path, options), int(_number("tries", tries, int)))


def check(text: str, name: str = "<text>") -> list[Diagnostic]:
    """What `sysdyn check` finds in a text: every finding, of every model, scene and component; [] where it is clean."""
    if not isinstance(text, str) or not isinstance(name, str):
        raise UsageError(f"{shortly(name if isinstance(text, str) else text)}: a text is wanted")
    report = Report()
    document = load_.document(SourceText(name, text), report)
    for target in targets.all_targets(document, report):
        with ex.fresh():
            check_target(target, report)
    for _, own in unused_components.check_unused_components(document):
        report.extend(own)
    return list(report.diagnostics)


def _request(path: object, options: dict[str, Any]) -> RunRequest:
    path = written("path", path)
    given = dict(options)
    settings = given.pop("set", given.pop("settings", None))
    settings = () if settings is None else settings
    given["settings"] = tuple((name, text_of(value)) for name, value in _settings(settings).items())
    return _make_request(RunRequest, path, **_changes(given))


def _settings(settings: Any) -> dict[str, Any]:
    """Values by name, of a mapping or of pairs."""
    try:
        found = dict(settings)
    except (TypeError, ValueError):
        found = {None: None}
    if not all(isinstance(name, str) for name in found):
        raise UsageError(f"set {shortly(settings)}: names with their values, such as {{'R.R': '10 ohm'}}")
    return found


def _make_request(make: Any, *arguments: Any, **options: Any) -> RunRequest:
    try:
        request: RunRequest = make(*arguments, **options)
    except TypeError as error:
        raise UsageError(str(error).replace("Request.__init__()", "simulate()")) from None
    check_choices(request.formulation, request.backend, request.index)
    return request


_NUMBERS: dict[str, type[float] | type[int]] = {"accuracy": float, "rtol": float, "atol": float, "max_steps": int}


def _number(name: str, value: Any, kind: type[float] | type[int]) -> float | int:
    """As the command reads a text."""
    try:
        return kind(value)
    except (TypeError, ValueError, OverflowError):
        raise UsageError(f"{name} {shortly(value)}: a number") from None


_TEXTS = frozenset(("model", "scene", "formulation", "method", "index", "backend", "redundancy", "output", "o"))


def _instants(at: Any) -> Iterable[Any]:
    """Instants, or one."""
    try:
        return np.atleast_1d(at)
    except ValueError:
        raise UsageError(f"at {shortly(at)}: instants [s]") from None


def _changes(options: dict[str, Any]) -> dict[str, Any]:
    """Options as a request has them."""
    given = dict(options)
    given |= {name: written(name, given[name]) for name in _TEXTS & given.keys() if given[name] is not None}
    level = given.pop("level", None)
    # a mapping of paths to levels, or pairs
    if level is not None:
        pairs = (
            list(level.items())
            if isinstance(level, Mapping)
            else list(level)
            if isinstance(level, list | tuple)
            else [()]
        )
        if any(not isinstance(p, tuple) or list(map(type, p)) != [str, str] for p in pairs):
            raise UsageError(f"level {shortly(level)}: paths with the names of their levels")
        given["levels"] = tuple(pairs)
    # numbers are SI, texts have units
    for name in ("until", "max_wall", "step"):
        if given.get(name) is not None:
            given[name] = text_of(given[name])
    # tolerances and counts
    for name, kind in _NUMBERS.items():
        if given.get(name) is not None:
            given[name] = _number(name, given[name], kind)
    at = given.get("at")
    if at is not None and not isinstance(at, str):
        given["at"] = ",".join(text_of(t) for t in _instants(at))
    # names of the command line are understood too
    if "o" in given:
        given["output"] = given.pop("o")
    if "no_timings" in given:
        given["timings"] = not given.pop("no_timings")
    return given
