"""The Python face of sysdyn for notebooks and scripts: `compile_model`, `simulate`, `Trace`.

They call what the commands call.  Findings of a model that cannot be used are raised as `ModelError`, wrong usage as
`UsageError`, a solver that stops as `SolverFailure`, a run that is not met as `NotMet`; notes and warnings stay silent.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run import targets
from sysdyn.cli.run.prepare import Prepared, prepare
from sysdyn.cli.run.running import Request, run
from sysdyn.cli.run.starting import start
from sysdyn.compiler.binding.binding import Binding
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Report
from sysdyn.runtime.judgement import NotMet as Missed
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.trace.trace import Trace

__all__ = ["ModelError", "Module", "NotMet", "SolverFailure", "Trace", "UsageError", "compile_model", "simulate"]


class Module:
    """A compiled model.  manifest: as `compile` writes it; unknowns: names in the order of y."""

    def __init__(self, prepared: Prepared, index: int | None, form: str) -> None:
        self._prepared = prepared
        self._form = form
        self.manifest: dict[str, Any] = {**prepared.manifest, "index": index}
        self._systems: dict[tuple[tuple[str, float], ...], System] = {(): self._system(prepared.binding)}
        self.unknowns = self._systems[()].unknown_names

    def _system(self, binding: Binding) -> System:
        return System(self.manifest, self._prepared.arrays_of(binding), self._prepared.carrier, self._form)

    def residual(
        self,
        t: float,
        y: NDArray[np.float64],
        ydot: NDArray[np.float64],
        parameters: Mapping[str, float] | None = None,
    ) -> NDArray[np.float64]:
        """F(t, y, ydot) [rows] of the form as written (or the index form asked for).

        y, ydot [unknowns] in the manifest's order, SI units; parameters: values that replace the model's, SI units.
        """
        key = tuple(sorted((parameters or {}).items()))
        if key not in self._systems:
            self._systems[key] = self._system(self._prepared.compiled.bind(dict(key)))
        return self._systems[key].residual(t, np.asarray(y, dtype=float), np.asarray(ydot, dtype=float))


def compile_model(
    path: str | Path,
    *,
    model: str | None = None,
    scene: str | None = None,
    formulation: str = "auto",
    index: str = "auto",
    backend: str = "c",
) -> Module:
    """Compile a model of a file.  index auto and 3: the form as written."""
    report = Report()
    document = targets.read(str(path), report)
    target = targets.one(document, str(path), model, scene, report)
    report.raise_if_failed()
    assert target is not None
    with ex.fresh():
        inner = Report()
        network = load.network(target.document, target.model, target.scene, inner, required=target.scene is not None)
        report.extend(inner if network else targets.unsupported(inner))
        wanted = None if formulation == "auto" else formulation
        prepared = None if network is None else prepare(network, report, formulation=wanted, backend=backend)
        if prepared is None:
            raise ModelError(report.diagnostics)
        started = start(prepared, 0.0, Report())
    found = started.facts.index if started else None
    return Module(prepared, found, "3" if index == "auto" else index)


class NotMet(Exception):  # noqa: N818 (a name of the house)
    """A run that ended, but did not meet what it judges itself by; trace: complete; not_met: what was missed."""

    def __init__(self, trace: Trace, not_met: tuple[Missed, ...], findings: tuple[Diagnostic, ...]) -> None:
        self.trace, self.not_met = trace, not_met
        super().__init__("; ".join(d.message for d in findings if d.code in ("E920", "E921")))


def simulate(path: str | Path, *, unmet: str = "raise", **options: Any) -> Trace:
    """Simulate a scene of a file; the options are those of the command (`until`, `set`, `accuracy`, `at`, ...).

    set: a mapping of names to numbers or texts; level: one of paths to levels; at: instants or one text; output: the
    trace's file (a default as the command's); unmet: "warn" where a run that is not met shall warn instead of raising
    `NotMet`.  Returns the trace.
    """
    if unmet not in ("raise", "warn"):
        raise UsageError(f"unmet {unmet!r}: raise or warn")
    report = Report()
    ran = run(_request(str(path), options), report)
    if ran is None or ran.exit == 1:
        raise ModelError(report.diagnostics)
    if ran.outcome.failure is not None:
        raise ran.outcome.failure
    trace = Trace.open(ran.outcome.trace)
    if ran.outcome.judgement is not None and not ran.outcome.met:
        found = NotMet(trace, ran.outcome.judgement.not_met, report.diagnostics)
        if unmet == "raise":
            raise found
        warnings.warn(str(found), stacklevel=2)
    return trace


def _request(path: str, options: dict[str, Any]) -> Request:
    given = dict(options)
    settings = given.pop("set", None) or given.pop("settings", ())
    pairs: Iterable[tuple[str, Any]] = settings.items() if isinstance(settings, Mapping) else settings
    given["settings"] = tuple((name, _text(value)) for name, value in pairs)
    level = given.pop("level", None)
    if level is not None:
        given["levels"] = tuple(level.items() if isinstance(level, Mapping) else level)
    for name in ("until", "max_wall"):
        if given.get(name) is not None:
            given[name] = _text(given[name])
    at = given.get("at")
    if at is not None and not isinstance(at, str):
        given["at"] = ",".join(_text(t) for t in np.atleast_1d(at))
    if "o" in given:
        given["output"] = given.pop("o")
    if "no_timings" in given:
        given["timings"] = not given.pop("no_timings")
    if given.get("output") is not None:
        given["output"] = str(given["output"])
    try:
        return Request(path, **given)
    except TypeError as error:
        raise UsageError(str(error).replace("Request.__init__()", "simulate()")) from None


def _text(value: Any) -> str:
    return value if isinstance(value, str) else repr(float(value))
