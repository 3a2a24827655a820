"""The ledgers of one integration (core/run/meters/ledgers.h), and what came of each."""

from __future__ import annotations

import ctypes as c
import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Ints, RowFamily
from sysdyn.runtime.model.failures import RowLabel
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

Signs = NDArray[np.int8]
HEAD: int = _core.SD_AUDIT_HEAD
ROWS: int = _core.SD_LEDGER_ROWS
"""Rows of block audit before the ledgers', and of each ledger."""


@dataclass(frozen=True, slots=True)
class LedgerBalance:
    """A ledger over a run.

    kind: energy or invariant; title: what is kept; unit: of value and turnover; passed: what elements were supplied
    with and dissipated, or passed to each other; turnover: that, and the sum over elements of what each stored at most;
    value: largest magnitude of the balance (infinite where it is no number); element: whose content changed most in
    the step that spoiled the balance most (else the first of the ledger); risen: (instant [s], magnitude) whenever it
    became larger than before.
    """

    kind: str
    title: str
    unit: str
    passed: float
    turnover: float
    value: float
    element: RowLabel
    risen: tuple[tuple[float, float], ...]

    @property
    def conserved(self) -> bool:
        """Whether it should keep its value: an invariant, or what is nowhere dissipated or supplied."""
        return self.turnover > 0.0 and (self.kind == "invariant" or self.passed == 0.0)

    def first_beyond(self, limit: float) -> float | None:
        """The instant [s] from which the balance was beyond a limit; None where it never was."""
        return next((t for t, value in self.risen if not value <= limit), None)


def turned_over(balances: Iterable[LedgerBalance]) -> float:
    """The energy [J] that went through all parts of a model: what an error of `audit.energy` is relative to."""
    return sum(b.turnover for b in balances if b.kind == "energy" and b.unit == "J")


def _ledger_rows(system: System) -> tuple[list[tuple[str, str, RowLabel]], list[RowFamily], Ints, Signs]:
    """Label, unit and first element of each ledger; rows of the elements; of each of these families its ledger; of each
    element whether it is an inertia.
    """
    description = system.description
    # of each ledger the first of its rows
    heads = [description.rows[k] for k in description.rows_of("audit")][HEAD::ROWS]
    families = [description.rows[k] for k in description.rows_of("ledger")]
    sizes = [row.size for row in families]
    # "k inertia ..": the ledger of a family, and what it is
    of = np.array([int(row.kind.split()[0]) for row in families], dtype=np.int32)
    inertia = np.repeat([*("inertia" in row.kind for row in families), False], [*sizes, 1]).astype(np.int8)
    return [(row.label, row.unit, row.label_at(0)) for row in heads], families, of, inertia


class Ledgers:
    """The core's structure for the ledgers of a system."""

    def __init__(self, system: System) -> None:
        self._heads, self._families, of, self._inertia = system.once("ledgers", lambda: _ledger_rows(system))
        count, elements = len(self._heads), self._inertia.size - 1
        self._end = np.cumsum([row.size for row in self._families], dtype=np.int32)
        # sums that the core keeps for each ledger, and for each element
        names = ("gross", "largest", "stored", "balance", "highest", "dissipated", "supplied")
        self._arrays = {name: np.zeros(count + 1) for name in names}
        self._arrays |= {name: np.zeros(elements + 1) for name in ("most", "value", "before")}
        self._element = np.full(count + 1, -1, dtype=np.int32)
        self._of = of
        self._stored: list[float] | None = None
        self._contents = system.observer("ledger") if elements else None
        self.core = lib.Ledgers(
            count=count,
            elements=elements,
            families=of.size,
            contents=None if self._contents is None else c.addressof(self._contents),
            of=lib.pointer(of),
            end=lib.pointer(self._end),
            inertia=lib.pointer(self._inertia),
            lost=-1,
            element=lib.pointer(self._element),
            **{name: lib.pointer(array) for name, array in self._arrays.items()},
        )
        self.address = c.addressof(self.core) if count else None

    @property
    def lost(self) -> RowLabel | None:
        """The element whose inertia became negative."""
        found = int(self.core.lost)
        if found < 0:
            return None
        return self._label(found)

    def _label(self, element: int) -> RowLabel:
        """Of an element by its number."""
        for row in self._families:
            # element numbers run through the families
            if element < row.size:
                return row.label_at(element)
            element -= row.size
        raise IndexError(element)

    @property
    def stored(self) -> list[float]:
        """Of each ledger the sum over its elements of what each stored at most."""
        # kept where the arrays were let go
        if self._stored is not None:
            return self._stored
        # by families of elements, then by ledgers
        most = [float(part.sum()) for part in np.split(self._arrays["most"][:-1], self._end[:-1])]
        return [sum(most[f] for f in np.flatnonzero(self._of == k)) for k in range(len(self._heads))]

    def close(self) -> None:
        """Lets go of what the core notes of each element: no step follows."""
        self._stored = self.stored
        nothing = np.zeros(0)
        self._arrays |= {"most": nothing, "value": nothing, "before": nothing}
        self._inertia = np.zeros(0, dtype=np.int8)

    def balances(self) -> tuple[LedgerBalance, ...]:
        """What came of each ledger."""
        # instants at which a ledger rose above all before
        records = c.cast(self.core.record, c.POINTER(lib.Record))
        risen: list[list[tuple[float, float]]] = [[] for _ in self._heads]
        for k in range(self.core.records):
            record = records[k]
            risen[record.ledger].append((record.t, record.value))
        return tuple(self._balance(k, *found) for k, found in enumerate(zip(self.stored, risen, strict=True)))

    def _balance(self, k: int, stored: float, records: list[tuple[float, float]]) -> LedgerBalance:
        """What came of ledger k: stored at most, instants and values (t, value) at which its balance rose."""
        label, unit, first = self._heads[k]
        kind, _, title = label.partition(": ")
        # passed and stored: what the balance is relative to
        passed = float(self._arrays["gross"][k])
        turnover = passed + stored
        value = float(self._arrays["highest"][k])
        # values beyond all bounds
        highest = max((v for _, v in records), default=0.0) if math.isfinite(value) else math.inf
        element = self._label(int(self._element[k])) if self._element[k] >= 0 else first
        risen = tuple((t, v if math.isfinite(v) else math.inf) for t, v in records)
        return LedgerBalance(kind, title, unit, passed, turnover, highest, element, risen)

    def __del__(self) -> None:
        if getattr(self, "core", None) is not None:
            lib.core.sd_ledgers_clear(c.byref(self.core))
