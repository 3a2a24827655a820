"""What the core needs to know of a gap that closes in flight: the equations of its impulse (core/run/strike.c).

They are those of start/instant.py, of unknowns that move and of impulses that act, where they are as many as these: no
dry friction tells an impulse, and inertia leaves no flow open.
"""

from __future__ import annotations

import ctypes as c
from typing import Any

import numpy as np
from sysdyn.runtime.events.handler import Handler
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.held_rows import multiplier_row
from sysdyn.runtime.model.patterns import Places, compress
from sysdyn.runtime.model.system import System

MOST = 60
"""Unknowns and impulses of an impact, which are eliminated as a full matrix."""


class Strike:
    """Of contact k of the handler, as at a point y, yd; ready: whether the core can do it.  It frees what it made."""

    def __init__(self, handler: Handler, k: int, t: float, y: Floats, yd: Floats) -> None:
        assert handler.restart is not None
        self.ready, self._linear = False, None
        self._system, contact = handler.restart.settler.system, handler.plan.contacts[k]
        active = handler.contacts.active.copy()
        handler.contacts.active[:] = np.arange(active.size) == k
        handler.contacts.apply()
        try:
            found = self._equations(t, y, yd)
            self._held = self._system._held
        finally:
            handler.contacts.active[:] = active
            handler.contacts.apply()
        if found is None:
            return
        unknowns, impulses, rows, integrals = found
        place = handler.contacts.multiplier[k]
        if unknowns.size + impulses.size != rows.size or rows.size > MOST or place not in impulses:
            return
        self.core = lib.Strike(system=c.addressof(self._system.core), contact=k, restitution=contact.restitution)
        self.core.row, self.core.own = self._row(k, handler), unknowns.size + impulses.tolist().index(place)
        self._laid_out(unknowns, impulses, rows, integrals)
        self.ready = True

    def _equations(self, t: float, y: Floats, yd: Floats) -> Any:
        """Unknowns that move, those with impulses, rows behind the instant and over it [rows], which are the latter;
        None: others tell impulses.
        """
        system, pattern = self._system, self._system.pattern
        row, column, kinds = pattern.row, pattern.columns_of(), system.kinds
        reads = np.isin(kinds, ("kappa", "mu"))[column] & system.of_groups("gamma")[row]
        if reads.any():
            return None
        there, acts = np.ones(system.rows, dtype=bool), np.isin(kinds, ("kappa", "mu"))
        there[system.held[0]] = acts[system.held[1]] = False
        moves = np.isin(kinds, ("f", "p", "e"))
        behind = (system.of_groups("phi_rate", "psi") & there) | system.of_groups("momentum", "gamma")
        balances = system.of_groups("dynamics")
        jy, jyd = system.jacobian(t, y, yd)
        self._entries = np.concatenate([
            np.flatnonzero(behind[row] & moves[column]),
            np.flatnonzero(balances[row] & moves[column]),
            np.flatnonzero(balances[row] & acts[column]),
        ])  # fmt: skip
        self._rated = np.repeat(
            [0, 1, 0],
            [(behind[row] & moves[column]).sum(), (balances[row] & moves[column]).sum(),
             (balances[row] & acts[column]).sum()],
        )  # fmt: skip
        some = np.where(self._rated, jyd[self._entries], jy[self._entries]) != 0.0
        rows = np.unique(row[self._entries[some]])
        columns = np.unique(column[self._entries[some]])
        return columns[moves[columns]], columns[acts[columns]], rows, balances[rows]

    def _row(self, k: int, handler: Handler) -> int:
        """The row of flows of the contact."""
        system = self._system
        first = {(group, family): row for group, family, row in system.form.groups}
        family, position = handler.contacts.switches.places[handler.plan.contacts[k].number]
        return int(first["phi_rate", multiplier_row(system.description, family)]) + position

    def _laid_out(self, unknowns: Any, impulses: Any, rows: Any, integrals: Any) -> None:
        """The matrix, its entries in the system, room."""
        system, core, n = self._system, self.core, rows.size
        columns = np.append(unknowns, impulses)
        place = np.full(system.unknowns, -1, dtype=np.int64)
        place[columns] = np.arange(n)
        at = np.full(system.rows, -1, dtype=np.int64)
        at[rows] = np.arange(n)
        i, j = at[system.pattern.row[self._entries]], place[system.pattern.columns_of()[self._entries]]
        take = (i >= 0) & (j >= 0)
        pattern, (slots,) = compress(n, n, [Places(i[take], j[take])])
        slot, rated = np.zeros((2, pattern.entries), dtype=np.int32)
        slot[slots], rated[slots] = self._entries[take], self._rated[take]
        integer = [columns, rows, integrals, pattern.column, pattern.row, slot, rated]
        self._keep = [np.ascontiguousarray(item, dtype=np.int32) for item in integer]
        names = ["unknown", "of_row", "integral", "column", "row_of", "slot", "rated"]
        sizes = [system.pattern.entries, system.pattern.entries, system.rows, pattern.entries, n, n, n]
        self._room = [np.zeros(size + 8) for size in sizes]
        names += ["jy", "jyd", "r", "value", "scale", "x", "impulse"]
        for name, item in zip(names, [*self._keep, *self._room], strict=True):
            setattr(core, name, lib.pointer(item))
        held = self._held
        core.held = lib.Held(held[0].size, held[4].size, *map(lib.pointer, held))
        core.n, core.moves = n, unknowns.size
        self._linear = lib.core.sd_linear_new(n, core.column, core.row_of, None)
        if not self._linear:
            raise MemoryError
        core.linear = c.addressof(self._linear.contents)

    def __del__(self) -> None:
        if getattr(self, "_linear", None):
            lib.core.sd_linear_free(self._linear)
