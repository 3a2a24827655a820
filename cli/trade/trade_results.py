"""What `sysdyn trade` measures and hands back: plain values, the Pareto set, the choice.

A setting meets an accuracy where its error and the uncertainty of the reference together are within it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from typing import Any

from sysdyn.values import dataclass

INDICES = ("2", "3", "2v", "1", "0")
"""As `--index` takes them; a model of index 2 or less is as written at 2 and at 3."""


@dataclass(frozen=True, slots=True, order=True)
class Combination:
    """formulation, index (as `--index` takes it), method, level ("PATH=NAME ...", "" where none is declared)."""

    formulation: str
    index: str
    method: str
    level: str = ""

    @property
    def name(self) -> str:
        """For tables and messages."""
        level = f" {self.level}" if self.level else ""
        return f"{self.formulation} index {self.index} {self.method}{level}"

    @property
    def levels(self) -> tuple[tuple[str, str], ...]:
        """(path, name) of each component whose level is chosen."""
        return tuple((path, name) for path, _, name in (pair.partition("=") for pair in self.level.split()))


@dataclass(frozen=True, slots=True)
class Measured:
    """One run.  tolerance: the solver's own; error: largest relative error of the judged quantities (None: no trace to
    its end); cpu_s: of the integration; work: counted (work.py), fixed: the part of it that no tolerance changes;
    energy: largest balance [J]; constraints: largest norm; reason: why it is never chosen, "" where it may be.
    """

    combination: Combination
    tolerance: float
    error: float | None
    cpu_s: float
    steps: int
    work: float
    fixed: float
    energy: float | None
    constraints: float | None
    reason: str = ""
    statistics: tuple[tuple[str, int], ...] = ()
    finding: dict[str, Any] | None = field(default=None, compare=False)
    """The reason with its code and place, where a finding says it."""

    @property
    def usable(self) -> bool:
        """Ended, met, and compared."""
        return not self.reason and self.error is not None


Runs = dict[tuple[Combination, float], Measured | str]
"""By combination and tolerance: what was measured, or why there is no such setting."""


@dataclass(frozen=True, slots=True)
class RefusedCombination:
    """A formulation or combination that cannot be run, and why; finding: the reason with its code and place."""

    formulation: str
    reason: str
    finding: dict[str, Any] | None = field(default=None, compare=False)
    index: str | None = None
    method: str | None = None
    level: str = ""


@dataclass(frozen=True, slots=True)
class TradeReference:
    """What errors are taken from.  first, second: its two runs; uncertainty: how far they are apart, relative;
    until [s]: up to where they agree within a tenth of the accuracy.
    """

    first: str
    second: str
    uncertainty: float
    until: float


@dataclass(frozen=True, slots=True)
class Traded:
    """Everything measured of one scene.  dropped: combinations that were given up early, and why; ended: False where
    the budget of wall time came first; span [s]; judged: names of the quantities whose errors count.
    """

    name: str
    accuracy: float
    span: tuple[float, float]
    measured: tuple[Measured, ...]
    refusals: tuple[RefusedCombination, ...]
    dropped: tuple[tuple[Combination, str], ...]
    reference: TradeReference
    judged: tuple[str, ...]
    ended: bool

    @property
    def pareto(self) -> tuple[Measured, ...]:
        """The usable settings that no other beats in error and work, the cheapest first."""
        return frontier(self.measured)

    @property
    def chosen(self) -> Measured | None:
        """The cheapest usable setting that meets the accuracy."""
        return cheapest(self.measured, self.accuracy, self.reference.uncertainty)


def meets(measured: Measured, accuracy: float, uncertainty: float) -> bool:
    """Whether a setting's true error is within the accuracy, as far as the reference knows."""
    return measured.usable and measured.error is not None and measured.error + uncertainty <= accuracy


def cheapest(found: Iterable[Measured], accuracy: float, uncertainty: float) -> Measured | None:
    """The setting of least work that meets the accuracy; the more accurate of equals."""
    enough = [m for m in found if meets(m, accuracy, uncertainty)]
    return min(enough, key=lambda m: (m.work, m.error, m.combination), default=None)


def frontier(found: Iterable[Measured]) -> tuple[Measured, ...]:
    """Settings of which none is both cheaper and more accurate, by work."""
    kept: list[Measured] = []
    for m in sorted((m for m in found if m.usable), key=lambda m: (m.work, m.error, m.combination)):
        if m.error is not None and (not kept or kept[-1].error is None or m.error < kept[-1].error):
            kept.append(m)
    return tuple(kept)
