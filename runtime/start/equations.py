"""What of the equations of a start depends on a text's structure alone: their unknowns, rows, entries, kinds.

Unknowns x = (y as written, those of the start alone, the derivatives that occur); see starter.py.
"""

from __future__ import annotations

import ctypes as c

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.balance import RowBalance
from sysdyn.runtime.model.description import Ints, Places
from sysdyn.runtime.model.inertia import flows_joined, own_unknown, with_flows
from sysdyn.runtime.model.redirected import redirect_entries
from sysdyn.runtime.model.scales import alike, kinds_and_units
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.start.settled import columns_of_rates, inertial_rates, rates_of

Mask = NDArray[np.bool_]
HIDDEN = (
    "dynamics_rate",
    "momentum_rate",
    "phi_rate",
    "phi_acceleration",
    "psi_rate",
    "gamma_rate",
    "gamma_acceleration",
)
"""Groups of rows that are derivatives of others."""


class Equations:
    """system: as written; settled: its form "start".

    guessed: (rows of block initial that are guesses, the unknowns that they miss); told [unknowns of y]: what only
    begins at a value of the others; unsettled [rows]: they need not hold; rows, columns [entries]: of what some block
    writes in the matrix; alike [unknowns]: number of the kind and unit of each; member [unknowns of y]: number of the
    kind; n: unknowns of y, those of the start alone among them; joined [unknowns of y]: flows whose coordinates hold
    inertia of each other; momenta: (unknowns beside flows and momenta that are contents of their kind, one of these
    flows each); balanced: flows have balances of their own, which say what their stores hold (in Kane's form they are
    shared).
    """

    def __init__(self, system: System, settled: System) -> None:
        self.n, self.written = settled.unknowns, settled.form.written
        self.rates = rates_of(settled)
        self.unsettled = inertial_rates(settled)
        self.unknowns = self.n + self.rates.size
        self.momentum, self.flow = with_flows(system)
        # whether every flow has a balance: then contents are measured in momenta
        owners = {system.description.rows[family].owner for _, family, _ in system.form.groups}
        self.balanced = all(f.owner in owners for f in system.description.families if f.kind == "f")
        self._entries(settled)
        # unknowns by which guessed expressions are missed
        misses = np.append(settled.are("slack", "unsaid"), np.zeros(self.rates.size, dtype=bool))[self.columns]
        self.guessed = self.rows[misses], self.columns[misses]
        self.told = self._told(settled)
        contents = self.contents(settled)
        self._kinds(settled, contents)
        self.measured = self._measured(settled, contents)
        self.momenta = self._momenta(settled, contents)
        del contents  # of a large model the room counts
        self.joined = flows_joined(settled)
        self.rated_rows = settled.of_groups("dynamics_rate")

    def _entries(self, settled: System) -> None:
        """Those of dF/dy, of dF/dy' where the derivative is an unknown."""
        pattern = settled.pattern
        columns = pattern.columns_of()
        plain, rated = self._places(settled)
        self.plain, self.rated = plain.size, rated.size
        self.rows = np.empty(plain.size + rated.size, dtype=np.int32)
        self.columns = np.empty_like(self.rows)
        np.take(pattern.row, plain, out=self.rows[: plain.size])
        np.take(pattern.row, rated, out=self.rows[plain.size :])
        np.take(columns, plain, out=self.columns[: plain.size])
        self.columns[plain.size :] = columns_of_rates(self.n, self.rates, columns[rated])

    def _places(self, settled: System) -> tuple[Ints, Ints]:
        """Of these entries in the pattern."""
        in_y, in_rate = settled.structural()
        moving = columns_of_rates(self.n, self.rates, settled.pattern.columns_of()) >= 0
        return np.flatnonzero(in_y).astype(np.int32), np.flatnonzero(in_rate & moving).astype(np.int32)

    def _kinds(self, settled: System, contents: Mask) -> None:
        """The kind of each unknown, by which it is measured beside its like, and the kind of its family."""
        kinds = alike(settled)
        if contents.any():  # what chords hold is of the kind of coordinates
            families, numbers = settled.description.families, kinds_and_units(settled)
            of_q = np.array([*(numbers.get(("q", f.unit), numbers[f.kind, f.unit]) for f in families), 0])
            held = np.zeros(self.n, dtype=bool)
            held[self.columns[contents[self.rows] & (self.columns < self.n)]] = True
            kinds = kinds.copy()
            kinds[held] = of_q[settled.family_of[held]]
        self.alike = np.concatenate([kinds, kinds.max(initial=0) + 1 + kinds[self.rates]]).astype(np.int32)
        # numbers of kinds alone, without units
        number: dict[str, int] = {}
        of_family = [number.setdefault(f.kind, len(number)) for f in settled.description.families]
        self.member = np.array([*of_family, 0], dtype=np.int32)[settled.family_of]
        self.members = len(number)

    def _told(self, settled: System) -> Mask:
        """Dynamic variables that no row reads but those of block initial, one of which tells them [unknowns of y]."""
        plain, initial = self.columns < self.n, settled.of_groups("initial")
        row, column, telling = self.rows[plain], self.columns[plain], initial.copy()
        # rows of block initial that guess nothing: they tell a value
        telling[self.guessed[0]] = False
        told, read = np.zeros((2, self.n), dtype=bool)
        told[column[telling[row]]] = read[column[~initial[row]]] = True
        return np.asarray(settled.are("s") & told & ~read)

    @staticmethod
    def contents(settled: System) -> Mask:
        """Rows that guess contents of stores [rows]."""
        # rows of block initial whose family is a content
        found = np.zeros(settled.rows, dtype=bool)
        for group, family, first in settled.form.groups:
            rows = settled.description.rows[family]
            found[first : first + rows.size] = group == "initial" and rows.content
        return found

    def _measured(self, settled: System, contents: Mask) -> Mask:
        """Unknowns of y that the contents of stores measure; a momentum with its flow."""
        mask = np.zeros(self.n, dtype=bool)
        own = contents[self.rows] & (self.columns < self.written)
        # rows of contents that are made of flows
        row, column = self.rows[own], self.columns[own]
        flow, moving = settled.are("f")[column], np.zeros(settled.rows, dtype=bool)
        moving[row[flow]] = True  # what is made of flows measures these alone
        mask[column[flow | ~moving[row]]] = True
        mask[self.momentum] |= mask[self.flow]
        return mask

    def _momenta(self, settled: System, contents: Mask) -> tuple[Places, Places]:
        """Unknowns that are contents of the kind of momenta, and a flow with such a content each: dynamic variables
        that integrate efforts of a balance, what guesses of these miss and of contents made of flows.
        """
        # the flow of which each row makes a content
        made = np.full(settled.rows, -1, dtype=np.int64)
        flows = np.flatnonzero(contents[self.rows] & np.append(settled.are("f"), self.rates < 0)[self.columns])
        made[self.rows[flows]] = self.columns[flows]
        row, column, (in_y, in_rate) = settled.pattern.row, settled.pattern.columns_of(), settled.structural()
        own, acts = own_unknown(settled, "dynamics", "f"), np.full(self.n, -1, dtype=np.int64)
        # efforts that act on a coordinate's balance, and rates that read them
        effort, rates = in_y & settled.are("e")[column], settled.of_groups("lambda")
        told, read = np.flatnonzero(effort & (own >= 0)[row]), np.flatnonzero(effort & rates[row])
        acts[column[told]] = own[row[told]]
        made[row[read]] = acts[column[read]]
        # dynamic variables whose rate is such an effort
        gains = np.flatnonzero(in_rate & rates[row] & settled.are("s")[column])
        rows, missed = self.guessed
        # guesses of these count as the flow's
        if gains.size:
            of_gain = np.full(self.unknowns, -1, dtype=np.int64)
            of_gain[column[gains]] = made[row[gains]]
            guessed = np.flatnonzero(contents[self.rows] & (of_gain[self.columns] >= 0))
            made[self.rows[guessed]] = of_gain[self.columns[guessed]]
        unknown, flow = np.append(missed, column[gains]), made[np.append(rows, row[gains])]
        return unknown[flow >= 0], flow[flow >= 0]

    def _measured_by(self, settled: System) -> list[str]:
        """The measure of each family of unknowns: contents of one unit have one, whatever gives them, momenta one with
        the flows that make them.
        """
        rows, families = settled.description.rows, settled.description.families
        # efforts by the units of their balances
        groups = settled.form.groups if self.balanced else ()
        effort = {rows[k].owner: rows[k].unit for group, k, _ in groups if group == "dynamics"}
        kinds = {"q": "", "s": "", "f": "p ", "p": "p ", "slack": "", "unsaid": ""}
        return [kinds.get(f.kind, f.kind) + (effort if f.kind in "fp" else {}).get(f.owner, f.unit) for f in families]

    def measures(self, settled: System) -> Ints:
        """The number of the measure of each unknown."""
        number: dict[str, int] = {}
        names = self._measured_by(settled)
        of_family = np.array([*(number.setdefault(s, len(number)) for s in names), 0], dtype=np.int32)
        of_y = of_family[settled.family_of]
        contents, flow = self.momenta
        # contents of the kind of momenta share the measure of their flow
        of_y[contents] = of_y[flow]
        return np.append(of_y, np.full(self.rates.size, len(number), dtype=np.int32))

    def moving(self, settled: System) -> Mask:
        """Whether the measure of each unknown is one of momenta."""
        names = self._measured_by(settled)
        found = np.array([*(s.startswith("p ") for s in names), False])[settled.family_of]
        found[self.momenta[0]] = True
        return np.append(found, np.zeros(self.rates.size, dtype=bool))

    def core(self, system: System, settled: System) -> lib.RowsOfStart:
        """The core's structure for the rows of one settled system."""
        form, found = system.form, lib.RowsOfStart()
        balance = RowBalance(settled.rows, self.rows, self.columns, self.alike)
        found.system, found.balance, found.extended = c.addressof(settled.core), balance.core, settled.form.extended
        found.written, found.rates = self.n, self.rates.size
        found.plain, found.rated, found.k_spans = self.plain, self.rated, len(form.k_span)
        found.rate, found.k_span = map(lib.pointer, (self.rates, form.k_span))
        places = self._places(settled)
        # of a large model entries go to places of their own at once
        if self.unknowns > LARGE and settled.plain:  # the room counts
            both = redirect_entries(settled, *self._numbered(settled, *places), self.plain + self.rated)
            found.both, entry = both.address, None
        else:
            both, entry = None, np.concatenate(places)
        found.entry = lib.pointer(entry)
        found.kept = balance, both, entry
        return found

    def _numbered(self, settled: System, plain: Ints, rated: Ints) -> tuple[Ints, Ints]:
        """Of each place in the pattern the number of its entry in dF/dy, in dF/dyd; -1: none."""
        numbers = np.full((2, settled.pattern.entries), -1, dtype=np.int32)
        numbers[0, plain] = np.arange(plain.size, dtype=np.int32)
        numbers[1, rated] = plain.size + np.arange(rated.size, dtype=np.int32)
        return numbers[0], numbers[1]
