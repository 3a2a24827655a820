"""What of the equations of a start depends on a text's structure alone: their unknowns, rows, entries, kinds.

Unknowns x = (y as written, the derivatives that occur, what guessed expressions miss); see starter.py.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.balance import Balance
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.patterns import read_only
from sysdyn.runtime.model.scales import alike
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.settled import inertial_rates, rates_of

Mask = NDArray[np.bool_]
Places = NDArray[np.integer]


def pairs(system: System) -> tuple[Ints, Ints]:
    """Places of momenta, and of the flows of the same coordinates."""
    families, at = system.description.families, system.form.at
    flows = {f.owner: k for k, f in enumerate(families) if f.kind == "f"}
    found = [(at[k] + np.arange(f.size), at[flows[f.owner]]) for k, f in enumerate(families) if f.kind == "p"]
    nothing = np.zeros(0, dtype=np.int64)
    momenta = np.concatenate([nothing, *(places for places, _ in found)])
    return momenta, np.concatenate([nothing, *(places - places[:1] + first for places, first in found)])


class Equations:
    """system: as written; settled: its form "start"; measuring: guessed expressions may miss something.

    guessed, unsaid [rows]: guesses of block initial, those that no text says; missed: rows of the guesses that have an
    unknown of their own; unsettled [rows]: they need not hold; rows, columns, structural [entries]: of the matrix;
    moving [unknowns]: kind of each; alike [unknowns]: number of its kind and unit; first: place of the first that is
    missed.
    """

    def __init__(self, system: System, settled: System, measuring: bool) -> None:
        self.n = system.form.written
        self.rates = rates_of(settled)
        self.momenta = system.of_groups("momentum")
        self._rows(settled)
        self.measuring = measuring and bool(self.unsaid.any())
        self.missed = np.flatnonzero(self.guessed & self.measuring)
        self.first = self.n + self.rates.size
        self.unsettled = inertial_rates(settled)
        self.kinds = system.kinds[: self.n]
        self.momentum, self.flow = pairs(system)
        self._entries(settled)
        self.units = self._units(settled)
        self._kinds(system)
        missed = np.zeros(settled.rows, dtype=bool)
        missed[self.missed] = True
        self.of_missed = missed[self.rows]
        self.measured = self._measured()
        self.rated_rows = settled.of_groups("dynamics_rate").astype(np.int32)

    def _rows(self, settled: System) -> None:
        """Rows of block initial that are guesses, and those of them that no text says."""
        self.guessed, self.unsaid = (np.zeros(settled.rows, dtype=bool) for _ in range(2))
        for group, family, first in settled.form.groups:
            rows = settled.description.rows[family]
            if group == "initial" and not rows.fixed:
                self.guessed[first : first + rows.size] = True
                self.unsaid[first : first + rows.size] = not rows.written

    def _entries(self, settled: System) -> None:
        """Those of dF/dy, of dF/dy' where the derivative is an unknown, of what is missed."""
        pattern = settled.pattern
        columns = pattern.columns_of()
        rate_at = np.full(self.n, -1, dtype=np.int64)
        rate_at[self.rates] = self.n + np.arange(self.rates.size)
        self.rated = np.flatnonzero(rate_at[columns] >= 0).astype(np.int32)
        places = self.first + np.arange(self.missed.size)
        self.rows = np.concatenate([pattern.row, pattern.row[self.rated], self.missed]).astype(np.int64)
        self.columns = np.concatenate([columns, rate_at[columns[self.rated]], places])
        in_y, in_rate = settled.structural()
        self.structural = np.concatenate([in_y, in_rate[self.rated], np.ones(self.missed.size, dtype=bool)])

    def _units(self, settled: System) -> list[str]:
        """The unit of what each guess misses."""
        found = [""] * settled.rows
        for group, family, first in settled.form.groups:
            rows = settled.description.rows[family]
            if group == "initial":
                found[first : first + rows.size] = [rows.unit] * rows.size
        return [found[row] for row in self.missed]

    def _kinds(self, system: System) -> None:
        self.family = np.unique(self.units, return_inverse=True)[1].astype(np.int64)
        kinds = alike(system)
        largest = kinds.max(initial=0) + 1
        self.alike = np.concatenate([kinds[: self.n], largest + kinds[self.rates], 2 * largest + self.family])
        self.member = np.unique(self.kinds, return_inverse=True)[1].astype(np.int32)
        moving = np.concatenate([self.kinds, np.full(self.rates.size, "rate"), np.full(self.missed.size, "")])
        moving[self.first :] = self._read(moving, system)
        self.moving = read_only(moving)
        self._of_kinds: dict[tuple[str, ...], Mask] = {}

    def _read(self, moving: NDArray[np.str_], system: System) -> NDArray[np.str_]:
        """The kind of unknowns that each guess is of; none where it is of several."""
        if not self.missed.size:
            return np.zeros(0, dtype=moving.dtype)
        number = self.guessed.size
        found, many = np.full(number, "", dtype=moving.dtype), np.zeros(number, dtype=bool)
        read = self.structural & (self.columns < self.first)
        for kind in np.unique(moving[: self.first]):
            rows = self.rows[read & (moving[self.columns] == kind)]
            many[rows] |= found[rows] != ""
            found[rows] = kind
        return np.where(many, "", found)[self.missed]

    def _measured(self) -> Mask:
        """Unknowns of y that the contents of stores measure; a momentum with its flow."""
        mask = np.zeros(self.n, dtype=bool)
        own = self.structural & self.of_missed & (self.columns < self.n)
        mask[self.columns[own]] = True
        mask[self.momentum] |= mask[self.flow]
        return mask

    def moves(self, kinds: Sequence[str]) -> Mask:
        """Unknowns of these kinds [unknowns]; read-only."""
        key = tuple(kinds)
        if key not in self._of_kinds:
            self._of_kinds[key] = read_only(np.isin(self.moving, key))
        return self._of_kinds[key]

    def core(self, system: System, settled: System) -> lib.RowsOfStart:
        """The core's structure for the rows of one settled system."""
        form, found = system.form, lib.RowsOfStart()
        balance = Balance(settled.rows, self.rows, self.columns, self.alike)
        missed = self.missed.astype(np.int32)
        found.system, found.balance, found.extended = c.addressof(settled.core), balance.core, settled.form.extended
        found.written, found.rates, found.missed = self.n, self.rates.size, missed.size
        found.rated, found.kinematics = self.rated.size, form.k_q.size
        found.rate, found.entry, found.miss, found.k_q, found.k_f = map(
            lib.pointer, (self.rates, self.rated, missed, form.k_q, form.k_f)
        )
        found.kept = balance, missed
        return found
