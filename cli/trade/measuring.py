"""Settings of one scene, run: each formulation compiled once, its start found once.

Received: a request, its target; handed back: combinations that exist, and a `Measured` of each that is run.
"""

from __future__ import annotations

import itertools
import math
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.cli.failures import OF_CLAIMS, UsageError
from sysdyn.cli.options import TRIED
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import ACCURACY, RunRequest, options_of
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import Ran, begin, finding, ready, run_from
from sysdyn.cli.run.start.starting import Started
from sysdyn.cli.trade import work
from sysdyn.cli.trade.errors import error_of
from sysdyn.cli.trade.trade_results import INDICES, Combination, Measured, RefusedCombination
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Diagnostic, Report
from sysdyn.runtime.accuracy.common_instants import GOLDEN, some
from sysdyn.runtime.accuracy.options import Options, choose_index
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import NoSuchForm, SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

METHODS = ("dopri", "rosenbrock", "radau", "bdf")
CONSTRAINTS = ("phi", "psi", "phi_rate", "psi_rate", "phi_acceleration")
LARGE = 20_000
"""Unknowns of a model of which other formulations are not kept beside its own: gigabytes each."""
MOST = 32
"""Combinations of levels that are measured."""
GRID = 200
"""Intervals of the trace of a scene with samples that leaves them to the solver, and a part that no period divides."""
ROWS = 1000
"""Rows at most where the scene leaves them to the solver: every so many steps of the reference, which lie where the
solution varies (an even grid passes over the peaks of a relaxation)."""
Said = dict[str, Any]
"""A finding in CONTRACT's shape."""


@dataclass(frozen=True, slots=True)
class Carried:
    """A formulation at its start.  again: it has events, and every run finds its own start; sizes: by index
    form.
    """

    prepared: Prepared
    options: Options
    started: Started
    again: bool
    sizes: dict[str, work.Size]


@dataclass(frozen=True, slots=True)
class Limits:
    """Of one run: steps, and wall time [s]; None: none."""

    steps: int | None = None
    wall: float | None = None


@dataclass(frozen=True, slots=True)
class Carrying:
    """What is to be compiled; formulation None: the scene's."""

    formulation: str | None
    level: str
    levels: tuple[tuple[str, str], ...]


class Bench:
    """The settings of one scene.  Traces go to `folder`.

    carried: by formulation and level; names: formulations that can express the scene; full: the level with the most
    detail, which the reference has.
    """

    def __init__(self, request: RunRequest, target: Target, report: Report, folder: Path, began: float) -> None:
        self.request, self.target, self.report, self.folder, self.began = request, target, report, folder, began
        self.carried: dict[tuple[str, str], Carried] = {}
        self.refusals: list[RefusedCombination] = []
        self.levels: dict[str, tuple[tuple[str, str], ...]] = {}
        self.names: list[str] = []
        self.missing: set[tuple[str, str]] = set()
        self.full = ""

    # --- formulations -------------------------------------------------------------------------------------------

    def prepare(self) -> bool:
        """Every formulation that can express the scene, its own first, and every level in that one (in the others when
        it is run); False where the report says why there is none.
        """
        asked = self.request.formulation
        own = Carrying(asked, _text(self.request.levels), self.request.levels)
        # the scene's own formulation and levels
        first = self._carry(own, self.report)
        if first is None:
            return False
        unknowns, detail = self._unknowns(first), self._detail(first)
        self.names, self.full = [first[0]], first[1]
        self.levels = _levels(self.carried[first].prepared.network, self.request.levels, first[1])
        # others where the model is small enough, and none was named
        for name in TRIED if asked in (None, "auto") else []:
            if name == first[0]:
                continue
            if unknowns > LARGE:
                why = f"the model has {unknowns} unknowns: only the formulation of the scene is measured"
                self.refusals.append(RefusedCombination(name, f"{why}; --formulation {name}"))
            elif self._carry(Carrying(name, first[1], self.levels[first[1]]), Report()):
                self.names.append(name)
        # other levels; the one of the most detail is the full model
        for text, levels in self.levels.items():
            key = self._carry(Carrying(first[0], text, levels), Report()) if text != first[1] else None
            if key is not None and self._detail(key) > detail:
                self.full, detail = text, self._detail(key)
        return True

    def _detail(self, key: tuple[str, str]) -> tuple[int, int]:
        """Elements and states of a level, then its unknowns."""
        network = self.carried[key].prepared.network
        return len(network.branches) + len(network.couplings) + len(network.states), self._unknowns(key)

    def _unknowns(self, key: tuple[str, str]) -> int:
        return self.carried[key].started.system.unknowns

    def _carry(self, what: Carrying, report: Report) -> tuple[str, str] | None:
        """A formulation at a level, at its start; None where it cannot be run."""
        own = what.formulation not in (None, self.request.formulation)
        request = replace(self.request, formulation=what.formulation, levels=what.levels, own=own)
        with ex.fresh():
            prepared = ready(request, self.target, report)
            options = options_of(request, self.target, prepared, report, self.began, None) if prepared else None
            started = begin(prepared, options, report) if prepared and options and not report.failed else None
        if prepared is None or options is None or started is None:
            reasons = [d for d in report if d.severity == "error"] or list(report)
            if what.formulation is not None and reasons:
                said = reasons[0]
                self.refusals.append(
                    RefusedCombination(what.formulation, said.message, said.to_json(), level=what.level)
                )
            return None
        sampled = any(event.period is not None for event in prepared.network.events)
        every = None if sampled else options.every  # rows of its own may all be at samples, where nothing is compared
        every = (options.t_end - options.t_start) / (GRID + GOLDEN) if sampled and every is None else every
        options = replace(options, every=every, watch=None, sampled_at=(), sample_steps=False)
        again = bool(prepared.network.events or prepared.network.switches)
        level = _text((*what.levels, *_chosen(prepared.network)))
        self.carried[prepared.formulation, level] = Carried(prepared, options, started, again, {})
        return prepared.formulation, level

    def carry(self, combination: Combination) -> Carried | None:
        """A formulation at a level, compiled once; None where it cannot be run, which is a refusal."""
        key = combination.formulation, combination.level
        if key not in self.carried and key not in self.missing:
            made = self._carry(Carrying(*key, self.levels[combination.level]), Report())
            self.missing |= {key} if made is None else set()
        return self.carried.get(key)

    @property
    def options(self) -> Options:
        """Those of the scene's own formulation."""
        return next(iter(self.carried.values())).options

    @property
    def accuracy(self) -> float:
        """Asked of the judged quantities."""
        return min([self.options.accuracy or ACCURACY, *(wanted for _, wanted in self.options.accuracy_on)])

    def judged_quantities(self, trace: Trace) -> tuple[str, ...]:
        """Quantities whose errors count."""
        on = [name for name, _ in self.options.accuracy_on]
        return tuple(name for name in trace.names if not on or self.options.accuracy is not None or name in on)

    def combinations(self) -> Iterator[Combination]:
        """Every formulation x index x method that exists; forms that are one appear once."""
        own = next(iter(self.levels))
        for formulation, level in itertools.product(self.names, self.levels):
            carried = self.carried.get((formulation, level)) or self.carried[formulation, own]
            seen = set()
            # forms that are one for this model are tried once
            for index in INDICES:
                form = choose_index(index, carried.started.facts)[0]
                if form in seen or (self.request.index not in (None, "auto", index)):
                    continue
                seen.add(form)
                for method in METHODS:
                    fits = self.request.method in (None, "auto", method)
                    if fits and self._exists(method, index, carried):
                        yield Combination(formulation, index, method, level)

    @staticmethod
    def _exists(method: str, index: str, carried: Carried) -> bool:
        """Whether the method integrates that form."""
        try:
            choose_index(index, carried.started.facts, method)
        except NoSuchForm:
            return False
        return True

    # --- runs ---------------------------------------------------------------------------------------------------

    def trace(
        self,
        combination: Combination,
        tolerance: float,
        limits: Limits,
        *,
        name: str | None = None,
        at: Floats | None = None,
    ) -> tuple[Ran | None, str, Said | None]:
        """One run at the solver's own tolerance: what came of it, why it may not be used, and the finding of that.

        name: of the file of its trace, which else stays in memory; at [s]: its rows alone, None: those of the scene.
        """
        carried, report = self.carry(combination), Report()
        if carried is None:
            return None, f"{combination.formulation} cannot express {combination.level}", None
        # the smaller of both limits
        most = [n for n in (carried.options.max_steps, limits.steps) if n is not None]
        # the tolerance of the solver itself: no estimate, no second run
        options = replace(
            carried.options,
            output=None if name is None else self.folder / f"{name}.h5",
            accuracy=None,
            accuracy_on=(),
            rtol=tolerance,
            method=combination.method,
            index=combination.index,
            max_steps=min(most, default=None),
            max_wall=limits.wall,
        )
        # rows where the reference has them
        if at is not None:
            options = replace(options, at=tuple(at.tolist()), every=options.t_end - options.t_start)
        try:
            started = begin(carried.prepared, options, report) if carried.again else carried.started
            ran = run_from(self.target, carried.prepared, started, options, report) if started else None
        # a setting that does not exist or fails is no end of the trade
        except UsageError as error:
            return None, error.format_message(), None
        except SolverFailure as failure:
            return None, str(failure), None
        except (ArithmeticError, ValueError, MemoryError) as error:  # one setting's fault ends no other
            return None, f"{type(error).__name__}: {error}", None
        reason = _reason(ran, report)
        return ran, reason, finding(_of_run(report)) if reason else None

    def measure(
        self, combination: Combination, tolerance: float, reference: Trace, until: float, limits: Limits
    ) -> Measured | str:
        """One run, compared with the reference; a sentence where there is no such setting."""
        carried = self.carry(combination)
        # rows at the reference's instants, thinned
        at = None if carried is None or carried.options.every is not None else some(reference.time, ROWS)
        ran, reason, said = self.trace(combination, tolerance, limits, at=at)
        if ran is None:
            return reason
        outcome = ran.outcome
        found = outcome.traced
        error = None
        # an error needs a run to the end
        if outcome.final:
            error = error_of(found, reference, self.judged_quantities(reference), self.accuracy, until, at=at)
            if not math.isfinite(error):
                numbers = all(np.isfinite(found[name].values).all() for name in found.names)
                lack = "apart from events it has no instants to compare" if numbers else "a quantity is no number"
                reason = reason or lack
        # work that was counted does not depend on the machine's load
        counts = {key: n for key, n in outcome.statistics.items() if isinstance(n, int)}
        size, method = self.size(combination), combination.method
        fixed = work.work_of_rows(found.time.size, size, method)
        return Measured(
            combination,
            tolerance,
            error,
            outcome.timings["cpu_integrate_s"],
            outcome.statistics["steps"],
            fixed + work.work_of_steps(counts, size, method),
            fixed,
            float(np.max(np.abs(found["audit.energy"].values), initial=0.0)),
            float(np.max(found["audit.constraints"].values, initial=0.0)),
            reason,
            tuple(counts.items()),
            said,
        )

    def size(self, combination: Combination) -> work.Size:
        """Of a combination's form."""
        carried = self.carry(combination)
        if carried is None:
            return work.Size(1, 1, bent=False)
        form = choose_index(combination.index, carried.started.facts)[0]
        if form not in carried.sizes:
            system = carried.started.system
            system = system if system.form.name == form else system.another(form)
            carried.sizes[form] = work.Size(system.unknowns, system.pattern.entries, bent=_bent(system))
        return carried.sizes[form]


def _bent(system: System) -> bool:
    """Whether slopes of constraints change."""
    blocks = system.description.blocks
    return not all(kernel.steady for block in CONSTRAINTS for kernel in blocks.get(block, ()))


def _levels(network: Network, given: tuple[tuple[str, str], ...], own: str) -> dict[str, tuple[tuple[str, str], ...]]:
    """Levels by their text, those of the scene first: what is left open in every combination,
    those with few changes first, MOST at most.
    """
    free = [choice for choice in network.levels if choice.free]
    found = {own: (*given, *_chosen(network))}
    mine = tuple(choice.chosen for choice in free)
    every = itertools.islice(itertools.product(*(choice.names for choice in free)), 64 * MOST)
    for names in sorted(every, key=lambda names: sum(a != b for a, b in zip(names, mine, strict=True)))[:MOST]:
        pairs = tuple((choice.path, name) for choice, name in zip(free, names, strict=True))
        found.setdefault(_text((*given, *pairs)), (*given, *pairs))
    return found


def _chosen(network: Network) -> tuple[tuple[str, str], ...]:
    """The choices that nobody made."""
    return tuple((choice.path, choice.chosen) for choice in network.levels if choice.free)


def _text(levels: tuple[tuple[str, str], ...]) -> str:
    return " ".join(f"{path}={name}" for path, name in levels)


def _of_run(report: Report) -> list[Diagnostic]:
    """Findings without those of what the scene expects: they are no reason against a setting."""
    return [d for d in report if d.code not in OF_CLAIMS]


def _reason(ran: Ran | None, report: Report) -> str:
    """Why a run may not be chosen; "" where it may."""
    if ran is not None and ran.failure:
        return ran.failure
    errors = [d.message for d in _of_run(report) if d.severity == "error"]
    if ran is not None and ran.outcome.met:
        return ""
    return errors[0] if errors else "not met"


_benches: dict[tuple[RunRequest, Path], Bench] = {}


def bench_of(request: RunRequest, folder: Path) -> Bench:
    """The settings of a request's scene in a process beside the one that asks, made once."""
    key = request, folder
    if key not in _benches:
        report, own = Report(), folder / f"ahead-{os.getpid()}"
        own.mkdir(exist_ok=True)
        target = targets.target_of(request, report)
        assert target is not None
        _benches[key] = Bench(request, target, report, own, time.monotonic())
        _benches[key].prepare()
    return _benches[key]
