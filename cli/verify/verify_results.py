"""What `sysdyn verify` hands back, and which of its runs disagree.

Received: runs with their traces, bounds by name, the horizon; handed back: disagreements with their worst place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np
from sysdyn.cli.verify.agreement import Bounds, Gap, gaps
from sysdyn.cli.verify.twins import Twins
from sysdyn.runtime.judgement import Shortfall
from sysdyn.runtime.simulate import Outcome
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class VerifiedRun:
    """One run of the scene.

    accuracy: as asked; expects: text, and whether it held; failure: where it stopped.
    """

    formulation: str
    method: str
    accuracy: float
    outcome: Outcome
    expects: tuple[tuple[str, bool | None], ...]
    trace: Trace
    failure: str | None
    finding: dict[str, Any] | None = field(default=None, compare=False)
    """Where and why it stopped, in CONTRACT's shape."""

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.formulation} {self.method}"

    @property
    def energy(self) -> float:
        """Largest |energy balance| (J)."""
        return float(np.max(np.abs(self.trace["audit.energy"].values), initial=0.0))

    @property
    def inaccurate(self) -> bool:
        """Whether its own estimate is above the accuracy."""
        judgement = self.outcome.judgement
        return judgement is not None and any(m.what == "accuracy" for m in judgement.not_met)

    @property
    def unbalanced(self) -> tuple[Shortfall, ...]:
        """Ledgers of energy and invariants that are off."""
        judgement = self.outcome.judgement
        return () if judgement is None else tuple(m for m in judgement.not_met if m.what != "accuracy")

    @property
    def constraints(self) -> float:
        """Largest norm of the constraints."""
        return float(np.max(self.trace["audit.constraints"].values, initial=0.0))


@dataclass(frozen=True, slots=True)
class RefusedFormulation:
    """A formulation that cannot express the model: the code and its reason."""

    formulation: str
    code: str
    reason: str


@dataclass(frozen=True, slots=True)
class Disagreement:
    """Two runs that differ, and where most."""

    one: VerifiedRun
    other: VerifiedRun
    gap: Gap

    @property
    def doubted(self) -> tuple[VerifiedRun, ...]:
        """Those of the two that say themselves that they have not reached their accuracy: no witnesses."""
        return tuple(run for run in (self.one, self.other) if run.inaccurate)


@dataclass(frozen=True, slots=True)
class Verified:
    """What came of it.

    runs: the reference first; finer: the reference at a tenth of the accuracy; worst: gap of each run to the reference;
    horizon [s], beyond: what differs after it (None: compared to the end), by: the run that gives it; compared: names;
    left_out: names and why; starts: one run of each other formulation, and where it begins farthest from the reference;
    interrupted: other runs would have followed.
    """

    name: str
    span: tuple[float, float]
    runs: tuple[VerifiedRun, ...]
    finer: VerifiedRun
    worst: tuple[Gap | None, ...]
    refusals: tuple[RefusedFormulation, ...]
    twins: tuple[Twins, ...]
    horizon: float
    beyond: Gap | None
    by: str
    compared: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]
    disagreements: tuple[Disagreement, ...]
    starts: tuple[tuple[VerifiedRun, Gap], ...] = ()
    interrupted: bool = False

    @property
    def apart(self) -> tuple[tuple[VerifiedRun, Gap], ...]:
        """Formulations that begin elsewhere than the reference."""
        return tuple((run, gap) for run, gap in self.starts if gap.ratio > 1.0)

    @property
    def failures(self) -> tuple[VerifiedRun, ...]:
        """Runs that stopped early: the solver could not finish them, or a limit came first."""
        return tuple(run for run in (*self.runs, self.finer) if run.failure)


def worst(reference: VerifiedRun, run: VerifiedRun, bounds: Bounds, until: float) -> Gap | None:
    """The worst gap of a run to the reference; None of the reference itself, where nothing is compared, and where one
    of the two stopped early.
    """
    if run is reference or run.failure or reference.failure:
        return None
    return next(iter(gaps(reference.trace, run.trace, bounds, until)), None)


def disagreements(runs: Sequence[VerifiedRun], bounds: Bounds, until: float) -> tuple[Disagreement, ...]:
    """Runs that differ from the first up to `until` [s], then pairs among those that do not.

    A first run that is not met by its own estimate judges no other; one that stopped early neither judges nor is
    judged.
    """
    runs = [run for run in runs if not run.failure]
    if not runs:
        return ()
    found, agreeing = [], []
    # each against the reference
    for run in runs[1:]:
        gap = worst(runs[0], run, bounds, until)
        if gap is not None and gap.ratio > 1.0:
            found.append(Disagreement(runs[0], run, gap))
        if gap is None or gap.ratio <= 1.0 or runs[0].inaccurate:
            agreeing.append(run)
    # then against each other
    for k, one in enumerate(agreeing):
        for other in agreeing[k + 1 :]:
            gap = worst(one, other, bounds, until)
            if gap is not None and gap.ratio > 1.0:
                found.append(Disagreement(one, other, gap))
    return tuple(found)
