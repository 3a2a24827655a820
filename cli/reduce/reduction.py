"""The model without what its scene does not need: elements tried in order of activity, each change measured.

The full model's run at a tenth of the accuracy is the reference.  The least active element is left out, or its ends
become one; what the traced quantities differ by is measured, and the change is kept where it stays within the accuracy
(all changes together).  After MISSES elements in a row that are needed the rest, which takes part more, is left alone.
Received: a request; handed back: `ReducedModel`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from sysdyn.cli.failures import UsageError
from sysdyn.cli.reduce import edits
from sysdyn.cli.reduce.activity import Activities, activities
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import ACCURACY, RunRequest, check_tolerances, options_of
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import Ran, integrate, ready
from sysdyn.cli.trade.errors import error_of
from sysdyn.dsl import load
from sysdyn.dsl.format.format import format_text
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import ModelError, Report, SourceText
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

FINER = 0.1
"""Of the accuracy: that of the runs that are compared."""
GRID = 1000
"""Intervals of the instants that a trace holds besides its steps: where one has a boundary layer, a cubic over a whole
interval would add a difference of its own.
"""
MISSES = 6
"""Elements in a row whose changes miss the accuracy, after which no more active one is tried."""
LARGEST = 0.2
"""Share of the activity above which an element is not tried."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One change.  how: left out, ends one (a node), joined (by a source of zero); error: of all changes so far and
    this one, None where it cannot run; kept; reason: why not.
    """

    label: str
    how: str
    activity: float
    share: float
    error: float | None
    kept: bool
    reason: str


@dataclass(frozen=True, slots=True)
class Cost:
    """Of a run at the accuracy.  unknowns: of the form integrated; cpu_s: of the integration."""

    unknowns: int
    steps: int
    cpu_s: float


@dataclass(frozen=True, slots=True)
class ReducedModel:
    """What came of it.  text: of the reduced model, the author's own where nothing was kept; error: of it, relative;
    full, reduced: cost of both.
    """

    name: str
    accuracy: float
    found: Activities
    trials: tuple[Trial, ...]
    text: str
    error: float
    full: Cost | None
    reduced: Cost | None
    ended: bool


def reduce(
    request: RunRequest,
    report: Report,
    folder: Path,
    *,
    only: bool = False,
    budget: float | None = None,
    progress: Callable[[float, float | None], None] | None = None,
) -> ReducedModel | None:
    """Measure activities and (unless only they are asked) reduce; None where the report says why not."""
    check_tolerances(request)
    if request.rtol is not None or request.atol is not None:
        raise UsageError("reduce measures errors: --accuracy says what is wanted")
    began = time.monotonic()
    # the text and its activities
    target = targets.target_of(request, report)
    if target is None:
        return None
    found = activities(request, target, report, folder, began, None, budget)
    if found is None:
        return None
    text = target.document.file.source.text
    # no trials
    if only:
        return ReducedModel(target.name, request.accuracy or ACCURACY, found, (), text, 0.0, None, None, True)
    limit = None if budget is None else began + budget
    return _Reduction(request, target, found, folder, limit, progress).all(report)


class _Reduction:
    """The trials of one scene."""

    def __init__(
        self,
        request: RunRequest,
        target: Target,
        found: Activities,
        folder: Path,
        limit: float | None,
        progress: Callable[[float, float | None], None] | None,
    ) -> None:
        self.request, self.target, self.found, self.folder = request, target, found, folder
        self.limit, self.progress = limit, progress
        self.trials: list[Trial] = []
        self.accuracy = ACCURACY
        self.judged: tuple[str, ...] = ()
        self.reference: Trace | None = None

    def all(self, report: Report) -> ReducedModel | None:
        """The reference, then every candidate."""
        text = self.target.document.file.source.text
        ran = self._run(self.target, "reference", FINER, report)
        if ran is None or not ran.outcome.met:
            return None
        self.reference = ran.outcome.traced
        full = self._cost(self.target)
        reduced, error, ended = self._reduce_text(text)
        cost = full
        if reduced != text:
            final = self._target(reduced)
            cost = self._cost(final) if final is not None else None
            reduced = format_text(final.document.file) if final is not None else reduced
        found = self.found
        return ReducedModel(
            self.target.name, self.accuracy, found, tuple(self.trials), reduced, error, full, cost, ended
        )

    def _reduce_text(self, original: str) -> tuple[str, float, bool]:
        """The reduced text, its error, whether the budget sufficed."""
        text, error, misses = original, 0.0, 0
        gone: set[str] = set()
        planned = [c for c in self._candidates(text) if c.share <= LARGEST]
        # from the least active on
        for number, first in enumerate(planned):
            if self.limit is not None and time.monotonic() > self.limit:
                return text, error, False
            # several in a row were needed: so are those that are more active
            if misses >= MISSES:
                break
            target = self._target(text)
            candidate = next((c for c in self._candidates(text) if c.label == first.label), None)
            if target is None or candidate is None or candidate.label in gone:
                continue
            kept = None
            # left out, ends joined, or replaced by a source of zero: the first that does no harm
            for how, made in self._variants(target, text, candidate):
                trial = self._trial(candidate, how, made)
                self.trials.append(trial)
                if trial.kept:
                    kept = made, trial.error or 0.0
                    break
            misses = 0 if kept else misses + 1
            if kept:
                text, error = kept
                gone.add(candidate.label)
            if self.progress is not None:
                self.progress((number + 1) / len(planned), None)
        return text, error, True

    def _candidates(self, text: str) -> tuple[edits.Candidate, ...]:
        target = self._target(text)
        if target is None:
            return ()
        with ex.fresh():
            network = load.network(
                target.document, target.model, target.scene, Report(), self.request.settings, levels=self.request.levels
            )
        return () if network is None else edits.candidates(target, network, self.found.items)

    def _variants(self, target: Target, text: str, candidate: edits.Candidate) -> list[tuple[str, str]]:
        """Texts without an element: left out, ends as one node, or a source of zero; without what is then unread."""
        made = [("left out", edits.remove_statement(target, text, candidate))]
        one = edits.merge_nodes(target, text, candidate)
        if one is not None:
            made.append(("ends one", one))
        if candidate.joined:
            made.append(("joined", edits.replace_by_zero_source(target, text, candidate)))
        clean = []
        for how, new in made:
            after = self._target(new)
            clean.append((how, new if after is None else edits.unread(after, new, text)))
        return clean

    def _trial(self, candidate: edits.Candidate, how: str, text: str) -> Trial:
        """Run a changed text and measure its error against the reference; kept where it is within the accuracy."""
        report = Report()
        target = self._target(text, report)
        error, reason = None, ""
        ran = None if target is None else self._run(target, "trial", FINER, report)
        assert self.reference is not None
        # met: judged by its error
        if ran is not None and ran.outcome.met:
            trace = ran.outcome.traced
            until = float(self.reference.time[-1])
            error = error_of(trace, self.reference, self.judged, self.accuracy, until)
            reason = "" if error <= self.accuracy else "it takes part: the error is beyond the accuracy"
            error = error if math.isfinite(error) else None
        # refused or not met: why
        else:
            errors = [d.message for d in report if d.severity == "error"]
            reason = errors[0] if errors else "its run is not met"
        return Trial(candidate.label, how, candidate.activity, candidate.share, error, not reason, reason)

    def _target(self, text: str, report: Report | None = None) -> Target | None:
        """Model and scene of the target in another text; imports and tables are found beside the file."""
        inner = Report() if report is None else report
        document = load.document(SourceText(self.target.document.file.source.name, text), inner)
        scene = self.target.scene.name.name if self.target.scene else None
        try:
            found = targets.one(document, self.request.file, self.target.model.name.name, scene, inner)
        except (UsageError, ModelError):
            return None
        return None if inner.failed else found

    def _run(self, target: Target, name: str, finer: float, report: Report) -> Ran | None:
        """A run at a part of the accuracy: its steps and a grid."""
        with ex.fresh():
            prepared = ready(self.request, target, report)
            began = time.monotonic()
            options = options_of(self.request, target, prepared, report, began, None) if prepared else None
            if prepared is None or options is None or report.failed:
                return None
            asked = [options.accuracy or ACCURACY, *(a for _, a in options.accuracy_on)]
            self.accuracy = min(asked)
            on = tuple((n, finer * a) for n, a in options.accuracy_on)
            # both runs at the same instants, finer than the accuracy
            options = replace(
                options,
                output=self.folder / f"{name}.h5",
                every=None,
                at=tuple(np.linspace(options.t_start, options.t_end, GRID + 1)),
                accuracy=None if options.accuracy is None else finer * options.accuracy,
                accuracy_on=on,
                max_wall=None if self.limit is None else max(self.limit - began, 1e-3),
            )
            # where accuracies are asked of some quantities, these alone count
            named = tuple(n for n, _ in on) if options.accuracy is None else ()
            self.judged = named or prepared.network.traced
            try:
                return integrate(target, prepared, options, report)
            except UsageError as error:
                report.error("E608", error.format_message(), prepared.network.place)
                return None

    def _cost(self, target: Target) -> Cost | None:
        """Of a run at the accuracy itself."""
        ran = self._run(target, "cost", 1.0, Report())
        if ran is None:
            return None
        outcome = ran.outcome
        return Cost(ran.started.system.unknowns, outcome.statistics["steps"], outcome.timings["cpu_integrate_s"])
