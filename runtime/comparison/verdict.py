"""What a comparison asks and answers: plain values."""

from __future__ import annotations

import math
from dataclasses import field, replace
from typing import Protocol

from sysdyn.runtime import tuning
from sysdyn.runtime.comparison.curve import Floats
from sysdyn.values import dataclass


class Incomparable(Exception):  # noqa: N818 (a name of the house: no fault of the program)
    """The two traces cannot be compared at all; the message says why."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """abs(test - ref) <= atol + rtol*nominal, within tau [s]; tau None: SHARE of the reference's span."""

    rtol: float = 1e-3
    atol: float = 0.0
    tau: float | None = None

    def part(self, share: float) -> Tolerance:
        """A share of the tube in value, all of it in time: tau counts only where the limit is left."""
        return replace(self, rtol=share * self.rtol, atol=share * self.atol)


SHARE = tuning.INSTANT
"""Of the span: the default tau.  Instants of two programs differ by rounding, not by more."""


@dataclass(frozen=True, slots=True)
class About:
    """What a trace says of a quantity; nominal in `unit`, None where it says nothing."""

    name: str
    unit: str
    nominal: float | None


@dataclass(frozen=True, slots=True)
class TraceEvent:
    """An event of a trace; time [s]."""

    time: float
    name: str


class Source(Protocol):
    """A trace that is read piece by piece.  time [n] in `time_unit`."""

    @property
    def time(self) -> Floats:
        """Instants, not falling."""

    @property
    def time_unit(self) -> str:
        """Unit of time."""

    @property
    def quantities(self) -> dict[str, About]:
        """Traced quantities by name, without the meters."""

    @property
    def events(self) -> tuple[TraceEvent, ...]:
        """Events in their order."""

    def read(self, name: str, first: int, last: int) -> tuple[Floats, Floats | None]:
        """Rows first..last-1 of a quantity: values and, where known, rates."""


@dataclass(frozen=True, slots=True)
class Worst:
    """Where a quantity is worst.  ratio: distance over the limit (inf: no limit would allow it); time [s]."""

    ratio: float = 0.0
    time: float = math.nan
    reference: float = math.nan
    test: float = math.nan


@dataclass(frozen=True, slots=True)
class Compared:
    """The verdict on one quantity, in the reference's unit.

    status: equal, differs, nonfinite, missing (in test), extra (in test), renamed (values equal under another name),
    unit (of another dimension), and of the traces as a whole: coverage, events.
    """

    name: str
    status: str
    worst: Worst
    unit: str = "1"
    nominal: float = math.nan
    limit: float = math.nan
    note: str = ""

    @property
    def equal(self) -> bool:
        """Within the tube everywhere."""
        return self.status == "equal"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Of all quantities, worst first; traces: findings on span and events; span [s] of the reference; tau [s]."""

    quantities: tuple[Compared, ...]
    traces: tuple[Compared, ...]
    span: tuple[float, float]
    rtol: float
    atol: float
    tau: float
    points: tuple[int, int]
    notes: tuple[str, ...] = field(default=())

    @property
    def equal(self) -> bool:
        """Nothing differs."""
        return all(c.equal for c in (*self.traces, *self.quantities))

    @property
    def worst(self) -> Compared | None:
        """What is farthest over (or nearest to) its limit; what differs comes before what does not."""
        found = sorted([*(c for c in self.traces if not c.equal), *self.quantities], key=rank)
        return found[0] if found else None


def rank(compared: Compared) -> tuple[bool, bool, float, str]:
    """Order of a report: what differs first, quantities before spans where both have no limit, by ratio, by name."""
    whole = compared.status in ("coverage", "events", "missing", "extra", "renamed")
    return compared.equal, whole and not math.isfinite(compared.worst.ratio), -compared.worst.ratio, compared.name
