"""What may happen to a model: relations that cross, assignments, constraints that hold at times.

Rows are places in block observe: a relation a > b is the row a - b.  Made by whoever has the text; see simulate.
"""

from __future__ import annotations

import math
from typing import Any

from sysdyn.values import dataclass

Condition = tuple[Any, ...]
"""("and" | "or", condition, ...), ("not", condition), ("relation", number, operator)"""


@dataclass(frozen=True, slots=True)
class Relation:
    """row - against zero; moves: it does between events, else at events alone; ticks: by time alone."""

    row: int
    moves: bool
    ticks: bool = False


@dataclass(frozen=True, slots=True)
class Assignment:
    """target := value of a row.  kind: discrete (place in p), state or flow (place in y as written)."""

    name: str
    kind: str
    place: int
    row: int


@dataclass(frozen=True, slots=True)
class When:
    """Fires where its condition becomes true."""

    name: str
    condition: Condition
    assignments: tuple[Assignment, ...]


@dataclass(frozen=True, slots=True)
class Sampled:
    """Fires at t0 + k period (s), k = 0, 1, ..."""

    name: str
    period: float
    assignments: tuple[Assignment, ...]


@dataclass(frozen=True, slots=True)
class Contact:
    """A constraint that holds at times.

    kind: phi, psi (value >= 0, multiplier >= 0 where it holds), guarded (holds while the row `guard` is not zero),
    friction (where it holds, abs(multiplier) <= bound; else the place `sense` of p is the sign of the value).
    hold: place of p that is 1 while it does, of friction that a relation reads: it has no switch (number -1).
    planar is friction in the plane: value is the speed along `direction` (a flow: places in p) less half the speed,
    rate that of the former, aim the rows of both flows, both multipliers and the speed; follows holds where the one
    before it does.
    value, rate, acceleration (of phi), multiplier, bound, bound - multiplier (upper),
    bound + multiplier (lower), guard: rows; number: of its switch; restitution: of phi; moves: whether the bound
    changes between events (a negative one ends the run); dual: what holds here is free in the text; turn: the
    relation c against zero of a c*setsign(u) that a reaction tells (aim: its row), -1: none.
    """

    name: str
    kind: str
    number: int
    value: int
    rate: int
    multiplier: int
    acceleration: int = -1
    bound: int = -1
    upper: int = -1
    lower: int = -1
    sense: int = -1
    guard: int = -1
    restitution: float = 0.0
    aim: tuple[int, ...] = ()
    direction: tuple[int, ...] = ()
    hold: int = -1
    moves: bool = False
    dual: bool = False
    turn: int = -1

    def word(self, *, holds: bool, up: bool) -> str:
        """How it stands where it holds or does not, with its sense upwards or not."""
        # a relation that may hold at zero
        if self.hold >= 0:
            return "at zero" if holds else "above" if up else "below"
        # along a line: with its sense
        if self.kind == "friction":
            return "sticks" if holds else f"slips {'+' if up else '-'}"
        if self.kind == "planar":
            return "sticks" if holds else "slips"
        return "holds" if holds is not self.dual else "free"


@dataclass(frozen=True, slots=True)
class Kink:
    """A switching function: where it is zero, a law changes its branch.

    value, rate: rows (rate -1 where it has none); branch: place in p, see kinks.py; above, below: rows 1 - sense and
    1 + sense of a law that jumps and may slide between its branches (else -1); element: whose law; inner: whether
    coordinates move it, so that what is stored is the same on both sides; passage: of a peak, which begins where the
    function becomes positive and changes no branch: how far that goes while it is passed.
    """

    name: str
    element: str
    branch: int
    value: int
    rate: int = -1
    above: int = -1
    below: int = -1
    jumps: bool = False
    inner: bool = False
    passage: float = 0.0


@dataclass(frozen=True, slots=True)
class Plan:
    """limit: of events; rest: an impact left slower than this part of the fastest is the last; plain: row families that
    are sums of unknowns, with factors that are numbers, and of nothing else; turns (s): the least time in which a
    signal that an event reads goes from one extreme to the next; anywhere (s): the same of any signal of the rows,
    where something is watched (algebra alone may determine that, which no error test follows).
    """

    relations: tuple[Relation, ...] = ()
    whens: tuple[When, ...] = ()
    sampled: tuple[Sampled, ...] = ()
    contacts: tuple[Contact, ...] = ()
    kinks: tuple[Kink, ...] = ()
    limit: int | None = None
    rest: float = 1e-6
    plain: frozenset[int] = frozenset()
    turns: float = math.inf
    anywhere: float = math.inf

    def __bool__(self) -> bool:
        return bool(self.whens or self.sampled or self.contacts or self.kinks)

    @property
    def of_laws(self) -> bool:
        """Whether laws change their branches, and nothing else happens."""
        return bool(self.kinks) and not (self.whens or self.sampled or self.contacts)

    @property
    def bends(self) -> bool:
        """Whether they do without a jump."""
        return self.of_laws and not any(kink.jumps for kink in self.kinks)


@dataclass(frozen=True, slots=True)
class Happened:
    """One event: time (s), name, element, what it changed before and after."""

    time: float
    name: str
    element: str
    before: str
    after: str
