"""What the core needs to know of a gap that closes in flight: the equations of its impulse (core/run/events/strike.c).

They are those of start/instant.py, of unknowns that move and of impulses that act, where they are as many as these: no
dry friction tells an impulse, and inertia leaves no flow open.  They fall apart into the connected parts of their
pattern, and what is asked of one gap is met in its own: nothing else moves, and what holds elsewhere has no impulse.
Momenta follow from flows that are assigned by their rows alone.
"""

from __future__ import annotations

import ctypes as c
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.events.handler import Handler
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.held_rows import multiplier_row
from sysdyn.runtime.model.patterns import Places, compress
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.components import components

MOST = 60
"""Unknowns and impulses of an impact, which are eliminated as a full matrix."""

Mask = NDArray[np.bool_]


def struck(handler: Handler, k: int, t: float, y: Floats, yd: Floats) -> ImpulseBalance | None:
    """The impulse of contact k, of what it reaches, as at a point; None where the core cannot tell it."""
    assert handler.restart is not None
    system, contact = handler.restart.settler.system, handler.plan.contacts[k]
    active = handler.contacts.active.copy()
    # as if contact k alone held
    handler.contacts.active[:] = np.arange(active.size) == k
    handler.contacts.apply()
    try:
        reactions = system.are("kappa", "mu")
        there, acts = np.ones(system.rows, dtype=bool), reactions.copy()
        # constraints that do not hold do not act
        there[system.held[0]] = acts[system.held[1]] = False
        behind = (system.of_groups("phi_rate", "psi") & there) | system.of_groups("momentum", "gamma")
        # effort laws that read reactions: friction within an impact
        told = system.of_groups("gamma")[system.pattern.row] & reactions[system.pattern.columns_of()]
        if told.any():
            return None
        first = {(group, family): row for group, family, row in system.form.groups}
        family, position = handler.contacts.switches.places[contact.number]
        row = int(first["phi_rate", multiplier_row(system.description, family)]) + position
        # only the part of the model that the impulse reaches
        place, over = handler.contacts.multiplier, system.of_groups("dynamics")
        part, rows = _connected_part(system, (behind, over), (system.are("f", "p", "e"), acts), place[k])
        found = ImpulseBalance(system, (t, y, yd), (behind, over), (part & ~acts, part & acts))
        # other gaps in that part must not be pushed together
        pushed = np.unique(system.pattern.columns_of()[(rows & over)[system.pattern.row]])
        gaps = np.flatnonzero([c.kind == "phi" for c in handler.plan.contacts])
        found.other_gaps(gaps[np.isin(np.array(place)[gaps], pushed) & (gaps != k)])
        return found.of_gap(k, row, place[k], contact.restitution) if found.ready else None
    # contacts as they stand
    finally:
        handler.contacts.active[:] = active
        handler.contacts.apply()


def _connected_part(
    system: System, rows: tuple[Mask, Mask], unknowns: tuple[Mask, Mask], multiplier: int
) -> tuple[Mask, Mask]:
    """Unknowns and rows of the connected part of a multiplier in the equations of `ImpulseBalance`."""
    (behind, over), (moves, acts) = rows, unknowns
    row, column, (in_y, in_rate) = system.pattern.row, system.pattern.columns_of(), system.structural()
    # rows behind the impact by what moves, balances by what acts
    joined = in_y & np.where(behind[row], moves[column], over[row] & acts[column])
    joined |= in_rate & over[row] & moves[column]
    label = components(row[joined], column[joined], system.unknowns)
    part = label == label[multiplier]
    there = np.zeros(system.rows, dtype=bool)
    there[row[joined & part[column]]] = True
    return part & (moves | acts), there


def of_momenta(system: System, t: float, y: Floats, yd: Floats) -> ImpulseBalance | None:
    """How momenta follow from flows; None where their rows leave some open."""
    none = np.zeros(system.unknowns, dtype=bool)
    rows = system.of_groups("momentum"), np.zeros(system.rows, dtype=bool)
    found = ImpulseBalance(system, (t, y, yd), rows, (system.are("p"), none))
    return found if found.ready else None


class ImpulseBalance:
    """Equations of unknowns that move and impulses that act, laid out for the core; it frees what it made.

    at: t, y, yd; rows: behind the instant, integrated over it [rows]; unknowns: those that move, those with impulses
    [unknowns].  ready: whether they are as many.
    """

    def __init__(
        self, system: System, at: tuple[float, Floats, Floats], rows: tuple[Mask, Mask], unknowns: tuple[Mask, Mask]
    ) -> None:
        self.ready, self._linear, (behind, over), (moves, acts) = False, None, rows, unknowns
        row, column, slopes = system.pattern.row, system.pattern.columns_of(), system.jacobian(*at)
        # momenta and flows behind, rates of balances, reactions
        parts = [behind[row] & moves[column], over[row] & moves[column], over[row] & acts[column]]
        entries = np.concatenate([np.flatnonzero(part) for part in parts])
        rated = np.repeat([0, 1, 0], [int(part.sum()) for part in parts])
        # entries that are zero at this point are left out
        some = entries[np.where(rated, slopes[1][entries], slopes[0][entries]) != 0.0]
        own, columns = np.unique(row[some]), np.unique(column[some])
        columns = np.append(columns[moves[columns]], columns[acts[columns]])
        # not square, empty or large: not here
        if not 0 < columns.size == own.size <= MOST:
            return
        held = system._held
        self.core = lib.Strike(system=c.addressof(system.core), contact=-1, row=-1, own=-1, n=own.size)
        self.core.moves, self._columns = int(moves[columns].sum()), columns
        self.core.held = lib.Held(held[0].size, held[4].size, *map(lib.pointer, held))
        self._keep: list[Any] = [held]
        self._laid_out(system, (own, columns, over[own]), entries, rated)
        self.ready = True

    def other_gaps(self, gaps: Ints) -> None:
        """Other gaps that the impulse reaches."""
        # only where the balance is complete
        if self.ready:
            self._keep.append(np.ascontiguousarray(gaps, dtype=np.int32))
            self.core.besides, self.core.beside = gaps.size, lib.pointer(self._keep[-1])

    def of_gap(self, k: int, row: int, multiplier: int, restitution: float) -> ImpulseBalance | None:
        """The balance with the impulse of contact k: its row of flows, the place of its multiplier; None where that
        has no impulse.
        """
        # the gap's multiplier is not in its part
        core, places = self.core, np.flatnonzero(self._columns == multiplier)
        if not places.size:
            return None
        core.contact, core.row, core.own, core.restitution = k, row, int(places[0]), restitution
        return self

    @property
    def address(self) -> int:
        """Of the core's structure."""
        return c.addressof(self.core)

    def _laid_out(self, system: System, lines: tuple[Any, Any, Mask], entries: Any, rated: Any) -> None:
        """The matrix, where its entries stand in the system, room; lines: rows, columns, rows that are integrated."""
        own, columns, integral = lines
        n, core = own.size, self.core
        # rows and columns numbered among those taken
        number = np.full(system.rows, -1), np.full(system.unknowns, -1)
        number[0][own] = number[1][columns] = np.arange(n)
        i, j = number[0][system.pattern.row[entries]], number[1][system.pattern.columns_of()[entries]]
        # entries that are in the small matrix
        take = (i >= 0) & (j >= 0)
        pattern, (slots,) = compress(n, n, [Places(i[take], j[take])])
        slot, which = np.zeros((2, pattern.entries), dtype=np.int32)
        slot[slots], which[slots] = entries[take], rated[take]
        # arrays by which the core fills and solves it
        integers = [
            np.ascontiguousarray(item, dtype=np.int32)
            for item in (columns, own, integral, pattern.column, pattern.row, slot, which)
        ]
        sizes = [system.pattern.entries, system.pattern.entries, system.rows, pattern.entries, n, n, n]
        room = [np.zeros(size + 8) for size in sizes]
        names = ["unknown", "of_row", "integral", "column", "row_of", "slot", "rated"]
        names += ["jy", "jyd", "r", "value", "scale", "x", "impulse"]
        for name, item in zip(names, [*integers, *room], strict=True):
            setattr(core, name, lib.pointer(item))
        self._keep += [integers, room]
        self._linear = lib.core.sd_linear_new(n, core.column, core.row_of, None)
        if not self._linear:
            raise MemoryError
        core.linear = c.addressof(self._linear.contents)

    def __del__(self) -> None:
        if getattr(self, "_linear", None):
            lib.core.sd_linear_free(self._linear)
