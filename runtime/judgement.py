"""A run judged by itself: is the accuracy that was asked for reached, and does every ledger balance?

    accuracy    the estimate of each quantity is within the accuracy asked of it
    energy      max |balance| <= max(k, 1e-12) G for each part's ledger, G what its elements stored and passed on
    invariants  likewise, for combinations of dynamic variables that keep their value

k: ten times the loosest accuracy asked; min(0.1, 10 sqrt(rtol)) where the solver's own tolerances are given.  Implicit
Euler's method is not judged.  Received: options, the accuracy control's result, balances.  Returned: a Judgement.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.accuracy.options import Options, own_tolerances
from sysdyn.runtime.integrate.rows.ledgers import LedgerBalance, turned_over
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import RowLabel
from sysdyn.values import dataclass

LEAST = tuning.CANCELS
"""Smallest part of what went through a ledger that its balance may be."""
TIMES = 10.0
"""Of the loosest accuracy asked: what the balance may be."""
MOST = 0.1
"""Largest part of it that is allowed where the solver's own tolerances are given."""
CANCELS = tuning.SMALL
OFFSET, NOISE = 1e-3, 10.0
"""Of a size: a range below it is that of what rides on an offset; times an error: a range that is none (conserved)."""
"""Of its terms: a difference that is less has lost more than three digits."""
EPS = float(np.finfo(np.float64).eps)
ROUND_OFF = 10.0 * EPS
"""Of the terms of a difference: no run knows them better."""


@dataclass(frozen=True, slots=True)
class Shortfall:
    """What a run missed.

    what: accuracy, energy or invariants; value beyond limit: relative for accuracy (value None: no estimate), in `unit`
    for a ledger; element: the quantity, or whose content changed most in the step that spoiled the balance most; time
    [s]: of the first instant beyond the limit; row: where the element stands in the text; undefined: the quantity is no
    number from then on; blurred: round-off of the unknowns alone does that.
    """

    what: str
    value: float | None
    limit: float
    element: str
    time: float | None
    unit: str = "1"
    row: RowLabel | None = None
    undefined: bool = False
    blurred: bool = False

    def to_json(self) -> dict[str, Any]:
        """The object of CONTRACT's `not_met` list."""
        return {name: getattr(self, name) for name in ("what", "value", "limit", "element", "time", "unit")}


@dataclass(frozen=True, slots=True)
class Judgement:
    """judged: what could be judged, in the order accuracy, energy, invariants; not_met: what was missed; conserved:
    the ledgers of what should have kept its value; turnover [J]: the energy that went round.
    """

    judged: tuple[str, ...]
    not_met: tuple[Shortfall, ...]
    conserved: tuple[LedgerBalance, ...] = ()
    turnover: float = 0.0

    @property
    def met(self) -> bool:
        """Nothing was missed."""
        return not self.not_met

    def attributes(self) -> dict[str, str | int]:
        """Root attributes of the trace."""
        kept = {"conserved": json.dumps(self.conserved_quantities())} if self.conserved else {}
        return {"met": int(self.met), "judged": " ".join(self.judged), **kept}

    def conserved_quantities(self) -> list[dict[str, Any]]:
        """What should have kept its value, how far it went from it, and of how much, in `unit`."""
        return [{"what": b.title, "drift": b.value, "of": b.turnover, "unit": b.unit} for b in self.conserved]


UNJUDGED: dict[str, str | int] = {"met": 0, "judged": ""}
"""Root attributes of a run that did not end as asked."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The accuracy control's verdict on one quantity.  error: relative (None: there is none); time [s] of the first
    instant at which two runs differ by more than asked; undefined: it is no number there; blurred: by round-off alone.
    """

    quantity: str
    error: float | None
    asked: float
    time: float | None
    undefined: bool = False
    blurred: bool = False


@dataclass(frozen=True, slots=True)
class Cancelled:
    """A traced quantity whose rows are much smaller than its terms, or than itself between them; moves: or whose range
    is that much smaller than its size, 0: not that.  known, terms, moves: in the quantity's unit, SI.
    """

    quantity: str
    known: float
    terms: float
    moves: float = 0.0


def cancelling_quantities(
    nominal: Mapping[str, float],
    seen: Mapping[str, float],
    asked: float | None,
    estimate: float | None,
    ranges: Mapping[str, float],
) -> Iterator[Cancelled]:
    """Quantities whose terms (nominal) cancel so far that the error, relative to the terms, is more than the accuracy
    asked of the rows (seen) themselves; what is nothing but round-off of its terms is zero by symmetry.  And those that
    ride on an offset: their range (ranges, of those that are not judged by it) is below OFFSET of their size, but more
    than their error.

    asked, estimate: relative; None where the solver's own tolerances are given.
    """
    error = max(estimate or 0.0, ROUND_OFF)
    for name, terms in nominal.items():
        own = seen.get(name, 0.0)
        # terms that cancel, and are not round-off alone
        if terms * 4.0 * EPS < own < CANCELS * terms and terms * error > (asked or MOST) * own:
            yield Cancelled(name, terms * error, terms)
        # riding on an offset: moves less than its size by far
        elif NOISE * error * terms < (moves := ranges.get(name, 0.0)) < OFFSET * own:
            yield Cancelled(name, own * error, own, moves)


def allowed_share(options: Options) -> float:
    """The part of what went through a ledger that its balance may be."""
    # by the tolerance of the solver
    if own_tolerances(options):
        return max(min(MOST, TIMES * float(np.sqrt(options.rtol if options.rtol is not None else 1e-6))), LEAST)
    # by the accuracy asked for
    asked = [a for a in (options.accuracy, *(wanted for _, wanted in options.accuracy_on)) if a is not None]
    return max(TIMES * max(asked, default=0.0), LEAST)


def not_met_undefined(found: tuple[str, float] | None) -> tuple[Estimate, ...]:
    """A quantity of the trace that is no number from an instant [s] on: missed whatever was asked of it."""
    return () if found is None else (Estimate(found[0], None, 0.0, found[1], undefined=True),)


def judge(
    options: Options,
    method: str,
    balances: Iterable[LedgerBalance],
    accurate: bool,
    missed: Iterable[Estimate],
    left_open: Callable[[], Floats] | None = None,
) -> Judgement:
    """The verdict; accurate: an accuracy was asked for; missed: quantities that did not reach it; left_open(): what
    round-off leaves open of each balance [balances]: where nothing moves it is all there is.
    """
    balances = tuple(balances)
    conserved = tuple(b for b in balances if b.conserved)
    asked = accurate and method != "euler"  # what is no number is missed whatever was asked
    misses = [e for e in missed if asked or e.undefined]
    found = [
        Shortfall("accuracy", e.error, e.asked, e.quantity, e.time, undefined=e.undefined, blurred=e.blurred)
        for e in misses
    ]
    # one run of fixed steps is not judged
    if method == "euler":
        return Judgement((), tuple(found), conserved, turned_over(balances))
    judged = ["accuracy"] if accurate else []
    part = allowed_share(options)
    # energies, then invariants
    for kind, what in (("energy", "energy"), ("invariant", "invariants")):
        own = [(k, b) for k, b in enumerate(balances) if b.kind == kind]
        judged += [what] if own else []
        for k, b in own:
            # what went through the ledger sets its limit
            limit = part * b.turnover
            # round-off may leave more open than that
            if limit < b.value and left_open is not None:
                limit = max(limit, float(left_open()[k]))
            if not b.value <= limit:
                found.append(Shortfall(what, b.value, limit, b.element.label, b.first_beyond(limit), b.unit, b.element))
    return Judgement(tuple(judged), tuple(found), conserved, turned_over(balances))
