"""What of the equations of a start depends on a text's structure alone: their unknowns, rows, entries, kinds.

Unknowns x = (y as written, the derivatives that occur, what guessed expressions miss); see starter.py.
"""

from __future__ import annotations

import ctypes as c

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.balance import Balance
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.inertia import with_flows
from sysdyn.runtime.model.scales import alike
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.settled import columns_of_rates, inertial_rates, rates_of

Mask = NDArray[np.bool_]
Places = NDArray[np.integer]


def pairs(system: System) -> tuple[Ints, Ints]:
    """Places of momenta, and of the flows of the same coordinates."""
    found = [(np.arange(momenta.start, momenta.stop), flows) for momenta, flows in with_flows(system)]
    momenta, flows = np.hstack([np.zeros((2, 0), dtype=np.int64), *found])
    return momenta, flows


class Equations:
    """system: as written; settled: its form "start".

    guessed, unsaid [rows]: guesses of block initial, those that no text says; missed: the rows of these guesses, each
    with an unknown of its own; contents [rows]: those that say what stores hold; unsettled [rows]: they need
    not hold; rows, columns, structural [entries]: of the matrix; alike [unknowns]: number of the kind and unit of each;
    member [unknowns of y]: number of the kind; n: unknowns of y, those of the start alone among them; first: place of
    the first that is missed.
    """

    def __init__(self, system: System, settled: System) -> None:
        self.n, self.written = settled.unknowns, settled.form.written
        self.rates = rates_of(settled)
        self._rows(settled)
        self.missed = np.flatnonzero(self.guessed)
        self.first = self.n + self.rates.size
        self.unsettled = inertial_rates(settled)
        self.unknowns = self.first + self.missed.size
        self.momentum, self.flow = pairs(system)
        self._entries(settled)
        self.units = self._units(settled)
        self._kinds(settled)
        self.measured = self._measured()
        self.rated_rows = settled.of_groups("dynamics_rate").astype(np.int32)

    def _rows(self, settled: System) -> None:
        """Rows of block initial that are guesses, those of them that no text says, and those that say contents."""
        self.guessed, self.unsaid, self.contents = np.zeros((3, settled.rows), dtype=bool)
        for group, family, first in settled.form.groups:
            rows = settled.description.rows[family]
            if group == "initial":
                own = slice(first, first + rows.size)
                self.contents[own] = rows.content
                self.guessed[own], self.unsaid[own] = not rows.fixed, not (rows.fixed or rows.written)

    def _entries(self, settled: System) -> None:
        """Those of dF/dy, of dF/dy' where the derivative is an unknown, of what is missed."""
        pattern = settled.pattern
        columns = pattern.columns_of()
        moved = columns_of_rates(self.n, self.rates, columns)
        self.rated = np.flatnonzero(moved >= 0).astype(np.int32)
        places = (self.first + np.arange(self.missed.size)).astype(np.int32)
        missed = self.missed.astype(np.int32)
        self.rows = np.concatenate([pattern.row, pattern.row[self.rated], missed])
        self.columns = np.concatenate([columns, moved[self.rated], places])
        in_y, in_rate = settled.structural()
        self.structural = np.concatenate([in_y, in_rate[self.rated], np.ones(self.missed.size, dtype=bool)])

    def _units(self, settled: System) -> list[str]:
        """What tells the unit of what each guess misses: that of contents, another for each expression."""
        found = [""] * settled.rows
        for group, family, first in settled.form.groups:
            rows = settled.description.rows[family]
            if group == "initial":
                found[first : first + rows.size] = [rows.unit if rows.content else rows.owner] * rows.size
        return [found[row] for row in self.missed]

    def _kinds(self, settled: System) -> None:
        self.family = np.unique(self.units, return_inverse=True)[1].astype(np.int64)
        kinds = alike(settled)
        largest = kinds.max(initial=0) + 1
        groups = kinds[: self.n], largest + kinds[self.rates], 2 * largest + self.family
        self.alike = np.concatenate(groups).astype(np.int32)
        number: dict[str, int] = {}
        of_family = [number.setdefault(f.kind, len(number)) for f in settled.description.families]
        self.member = np.array([*of_family, 0], dtype=np.int32)[settled.family_of]
        self.members = len(number)

    def _measured(self) -> Mask:
        """Unknowns of y that the contents of stores measure; a momentum with its flow."""
        mask = np.zeros(self.n, dtype=bool)
        own = self.structural & self.contents[self.rows] & (self.columns < self.written)
        mask[self.columns[own]] = True
        mask[self.momentum] |= mask[self.flow]
        return mask

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
