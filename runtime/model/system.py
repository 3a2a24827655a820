"""One index form of a compiled model: residual F(t, y, yd), Jacobian, observed quantities.

Made of a `Description`, a carrier and the name of a form (forms.py); evaluated by the core's assembly.c, so that
what Python sees is what the stepper integrates.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Hashable, Mapping
from dataclasses import replace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.carrier import Carrier, Extent, Failure, LibraryCarrier, Tables
from sysdyn.runtime.model.description import BASE, Description, Floats, Ints, describe
from sysdyn.runtime.model.facts import Facts, Found, Mask
from sysdyn.runtime.model.forms import Form, plan
from sysdyn.runtime.model.held_rows import LeftOut
from sysdyn.runtime.model.layout import JacobianLayout, laid_out
from sysdyn.runtime.model.patterns import Pattern, read_only, spared_loops

LARGE = 100_000
"""Unknowns beyond which what can be found again is let go: of a large model the room counts."""
HUGE = 1_000_000
"""Unknowns beyond which pages that a stage left go back to the machine wherever something large was let go: it asks for
them again for the next one, which costs a line of 500000 unknowns a tenth of its CPU time to the first step.  Of LARGE
ones they go back behind a start, a structure and a jump, and before a method is made."""
_NOWHERE: Callable[[int], int | None] = lambda _: None  # noqa: E731
SETS = 4096
"""Active sets whose rows are kept."""


class System(Facts):
    """A model in one index form.  y, yd [unknowns], r [rows]; all in SI units."""

    def __init__(
        self, manifest: Mapping[str, Any], binding: Mapping[str, Any], carrier: Carrier, index_form: str = "3"
    ) -> None:
        self._make(describe(manifest, binding), carrier, index_form)

    @classmethod
    def from_description(
        cls, description: Description, carrier: Carrier, index_form: str, left_out: LeftOut = ()
    ) -> System:
        """A system of a description; left_out: multipliers (family, position) of constraints that do not count.

        Where the description has the systems of a run before it, one of those, at this one's numbers; else one that
        somebody has, unless a run gave its rows q' - f factors.
        """
        made = description.alive if description.systems is None else description.systems
        self = made.get((index_form, left_out))
        # none, or one that another run may still use with factors
        if self is None or self.carrier is not carrier or (description.systems is None and index_form == "2"):
            self = cls.__new__(cls)
            self._make(description, carrier, index_form, left_out)
            made[index_form, left_out] = self
        # one of the last run, at these numbers
        elif description.systems is not None:
            self.description = description
            if index_form == "2":
                self.kinematic_scale[:] = 1.0
        return self

    def another(self, index_form: str) -> System:
        """The model in another form."""
        return System.from_description(self.description, self.carrier, index_form, self.left_out)

    def without_constraints(self, left_out: LeftOut) -> System:
        """The system of one form without these constraints."""
        return System.from_description(self.description, self.carrier, self.form.name, left_out)

    def of_blocks(self, index_form: str) -> System:
        """The model in another form for `rows_at` alone: nothing of its Jacobian is laid out."""
        found = System.__new__(System)
        found._plan(self.description, self.carrier, index_form, self.left_out)
        return found

    def own_numbers(self) -> None:
        """From now on its p is its own, which may be written into."""
        old = self.description
        # writable: its own already
        if old.p.flags.writeable:
            return
        # caches are those of the shared numbers: empty ones
        own = replace(old, p=old.p.copy(), alive=WeakValueDictionary(), room=[])
        self._make(own, self.carrier, self.form.name, self.left_out)
        own.alive[self.form.name, self.left_out] = self

    def _plan(self, description: Description, carrier: Carrier, index_form: str, left_out: LeftOut) -> None:
        self.description, self.carrier, self.left_out = description, carrier, left_out
        key = "plan", index_form
        # the plan of a form is kept with the description
        if key not in description.layouts:
            description.layouts[key] = plan(description, index_form)
        self.form: Form = description.layouts[key]
        self.failure = Failure()
        self._keep: list[Any] = []

    def _make(self, description: Description, carrier: Carrier, index_form: str, left_out: LeftOut = ()) -> None:
        self._plan(description, carrier, index_form, left_out)
        self._own: dict[Hashable, Any] = {}
        self._layout: JacobianLayout | None = None
        self._slots: list[Ints] = []
        self.trim()
        self._assemble()

    def trim(self, least: int = HUGE) -> None:
        """Hands memory that was let go back to the machine, where it counts more than the time to ask for it again: of
        more unknowns than these.
        """
        if self.unknowns > least:
            lib.core.sd_trim(self.unknowns > HUGE)

    @property
    def plain(self) -> bool:
        """Whether blocks alone write into the matrix, whatever holds."""
        return not self.form.kinematics and not self._may_hold[0].size

    def put_away(self, *, whole: bool) -> None:
        """Lets go of the pattern, found again when it is asked for; whole: of the places of the Jacobian's entries too.
        Nobody may hold addresses of what goes.
        """
        # kept for runs that follow
        if self.description.systems is not None:
            return
        self.description.layouts.pop(self._layout_key, None)
        self._layout, self._away = None, whole
        # addresses of what goes are cleared
        self._core.column = self._core.row = None
        self._kinematics(())
        # places of entries go too
        if whole:
            self._slots = []
            self._place_entries(_NOWHERE)

    def own(self, name: Hashable, make: Callable[[], Found]) -> Found:
        """What is made of this system's structures in the core, whatever the numbers: once for all runs it serves."""
        if name not in self._own:
            self._own[name] = make()
        return self._own[name]  # type: ignore[no-any-return]

    # --- the core's structure -------------------------------------------------------------------------------

    def _laid_out(self) -> JacobianLayout:
        """Pattern and slots of the form, found once a description."""
        key = self._layout_key
        if key not in self.description.layouts:
            self.description.layouts[key] = laid_out(self.description, self.form, self.left_out)
        return self.description.layouts[key]  # type: ignore[no-any-return]

    @property
    def _layout_key(self) -> tuple[str, LeftOut]:
        return self.form.name, self.left_out

    def _assemble(self) -> None:
        """Makes the core's structure: calls of blocks, magnitudes of steep laws, room, rows that may not hold."""
        form, layout = self.form, self._laid_out()
        # each block with its tables, and how many entries it writes
        calls = (lib.Call * max(len(form.calls), 1))()
        for k, call in enumerate(form.calls):
            sizes = (int(slots.size) for slots in layout.slots[2 * k + 2 : 2 * k + 4])
            calls[k] = self.call(call.block, call.at, call.to, form.rows, *sizes)
        self.calls = calls
        # blocks of magnitudes have no slopes
        scales = (lib.Call * max(len(form.scales), 1))()
        for k, scale in enumerate(form.scales):
            scales[k] = self.call(scale.block, scale.at, scale.to, form.rows)
        self._scales = scales
        # the stabilised form weighs its rows q' - f
        ones = np.broadcast_to(1.0, form.kinematics)
        self.kinematic_scale: Floats = ones.copy() if form.name == "2" else ones
        self.work = self._work(layout.entries)
        self._keep += [calls]
        self._reads_rate, self._may_hold = layout.reads_rate, layout.may_hold
        # kernels that say of themselves that nothing of them moves with time
        blocks = self.description.blocks
        planned = [kernel for call in form.calls for kernel in blocks.get(call.block, ())]
        self._core = lib.System(
            unknowns=form.unknowns,
            rows=form.rows,
            entries=layout.pattern.entries,
            calls=len(form.calls),
            kinematics=form.kinematics,
            k_spans=len(form.k_span),
            call=c.addressof(calls),
            k_span=lib.pointer(form.k_span),
            k_scale=lib.pointer(self.kinematic_scale) if form.name == "2" else None,
            scales=len(form.scales),
            scale=c.addressof(scales),
            v=lib.pointer(self.work),
            stop=lib.pointer(self.failure.flag),
            steady=all(kernel.steady for kernel in planned),
            together=isinstance(self.carrier, LibraryCarrier),
        )
        self._bring_back()
        self._sets: dict[bytes, tuple[Any, Any]] = self.once("sets", dict)
        self.switch()
        self.description.switches.join(self)

    def _bring_back(self) -> JacobianLayout:
        """The layout and all that points there."""
        layout = self._layout = self._laid_out()
        self._slots, self._away = list(layout.slots), False
        self._core.column, self._core.row = lib.pointer(layout.pattern.column), lib.pointer(layout.pattern.row)
        self._place_entries(lambda k: lib.pointer(layout.slots[k]))
        self._kinematics((self.form.k_q, self.form.k_f))
        return layout

    def _kinematics(self, places: tuple[Ints, ...]) -> None:
        """Where q and f of the rows q' - f stand, or (): nobody reads it for a while."""
        self._k = places
        self._core.k_q, self._core.k_f = map(lib.pointer, places or (None, None))

    def _place_entries(self, address: Callable[[int], int | None]) -> None:
        """Where the entries of each part of the matrix stand."""
        self._core.k_slot_q, self._core.k_slot_f = address(0), address(1)
        for k in range(len(self.form.calls)):
            self.calls[k].slot_dy, self.calls[k].slot_dyd = address(2 * k + 2), address(2 * k + 3)

    @property
    def core(self) -> lib.System:
        """The core's structure."""
        # let go by `put_away`
        if self._layout is None:
            self._bring_back()
        return self._core

    def bare(self, pattern: Pattern | None = None) -> tuple[lib.System, tuple[Ints, ...]]:
        """The core's structure where nothing asks for the places of entries, and what it reads: rows q' - f, this
        pattern.
        """
        made, arrays = lib.System.from_buffer_copy(self._core), (self.form.k_q, self.form.k_f)
        made.k_q, made.k_f = map(lib.pointer, arrays)
        # a pattern that someone else still has
        if pattern is not None:
            made.column, made.row = lib.pointer(pattern.column), lib.pointer(pattern.row)
        return made, arrays

    @property
    def pattern(self) -> Pattern:
        """Of the Jacobian."""
        return (self._layout or self._bring_back()).pattern

    def _work(self, entries: int) -> Floats | None:
        """Room for the entries of any part, one after the other: all systems of a description have the same; None of a
        large one, for which the core finds it for each Jacobian.
        """
        if self.unknowns > LARGE:
            return None
        room = self.description.room
        # larger than any before: all systems get the larger room
        if not room or room[0].size < entries:
            room[:] = [np.zeros(entries)]
            # addresses of the old room are renewed
            for system in (one for one in self.description.alive.values() if one.work is not None):
                system.work, system._core.v = room[0], lib.pointer(room[0])
        return room[0]

    def switch(self) -> None:
        """Rows of constraints that do not hold read "multiplier = 0"."""
        key = self.description.switches.active.tobytes()
        # active sets are remembered, up to so many
        if key not in self._sets:
            if len(self._sets) >= SETS:
                self._sets.clear()
            self._sets[key] = self._set_of_rows()
        self._held, pointers = self._sets[key]
        self.held, cleared = self._held[:2], self._held[4]
        core = self._core
        core.held, core.clear = self.held[0].size, cleared.size
        core.held_row, core.held_unknown, core.held_slot, core.held_rate, core.cleared = pointers

    def _set_of_rows(self) -> tuple[Any, Any]:
        """Arrays of the present active set, and their addresses."""
        # left out for good, or not active
        rows, unknowns, slots, number = self._may_hold
        now = (number < 0) | ~np.append(self.description.switches.active, True)[number]
        row, unknown = rows[now], unknowns[now]
        # entries of these rows are cleared
        cleared = np.flatnonzero(np.isin(self.pattern.row, row)).astype(np.int32)
        held = row, unknown, slots[now].copy(), self._reads_rate[now], cleared
        return held, tuple(map(lib.pointer, held))

    @property
    def leaves_out(self) -> bool:
        """Whether redundant constraints do not count."""
        return bool(self.left_out) or self.description.switches.redundant

    def idle_multipliers(self) -> Ints:
        """Places of the multipliers of constraints that do not hold now."""
        switches = self.description.switches
        idle = (place for place, active in zip(switches.places, switches.active, strict=True) if not active)
        return np.array([self.form.at[family] + position for family, position in idle], dtype=np.int32)

    def call(self, block: str, at: Ints, to: Ints, rows: int, n_dy: int = 0, n_dyd: int = 0) -> lib.Call:
        """The core's structure for one block with its tables, and how many entries it writes."""
        tables = Tables(self.description.p, self.description.ix, at, to)
        made = self.carrier.bind(block, tables, Extent(self.form.extended, rows, n_dy, n_dyd), self.failure)
        self._keep.append((tables, made))
        frame = lib.Frame(*(lib.pointer(item) for item in (tables.p, tables.ix, at, to)), None)
        return lib.Call(
            rows=made.rows,
            dy=made.dy,
            dyd=made.dyd,
            frame=frame,
            n_dy=n_dy,
            n_dyd=n_dyd,
        )

    @property
    def slots(self) -> list[Ints]:
        """Places in the pattern of entries: of q', of f in the rows q' - f; dy, dyd of each call; of held rows."""
        # let go by `put_away`
        if self._away:
            self._bring_back()
        return self._slots

    def slots_dy(self, call: int) -> Ints:
        """Places in the pattern of the entries that a call adds to dF/dy."""
        return self.slots[2 * call + 2]

    def structural(self) -> tuple[Mask, Mask]:
        """Which places of the pattern [entries] some block writes in dF/dy, in dF/dyd (rows q' - f left out)."""
        return self.once("structural", self._structural)

    def _structural(self) -> tuple[Mask, Mask]:
        # entries of each call stand behind those of q' - f
        in_y, in_rate = np.zeros(self.pattern.entries, dtype=bool), np.zeros(self.pattern.entries, dtype=bool)
        for k in range(len(self.form.calls)):
            in_y[self.slots[2 * k + 2]] = True
            in_rate[self.slots[2 * k + 3]] = True
        # rows of multipliers read them, or their rates
        in_y[self.slots[-1]] = True
        in_rate[self.slots[-1][self._reads_rate != 0]] = True
        return read_only(in_y), read_only(in_rate)

    def observer(self, block: str) -> lib.Call | None:
        """A call of observe, observe_rate, observe_scale or audit whose rows begin at 0; None where there is none."""
        return self.own(("observer", block), lambda: self._observer(block))

    def _observer(self, block: str) -> lib.Call | None:
        # a model without that block
        if block not in self.description.blocks:
            return None
        table, number = self.observed_rows(block)
        return self.call(block, self.form.at, table, max(number, 1))

    def powers(self) -> lib.Call | None:
        """The call of audit without loops of energies alone: what is integrated; None where there is no audit."""
        return self.own("powers", self._powers)

    def _powers(self) -> lib.Call | None:
        call = self._observer("audit")
        # without rows of energies: the first two, and the first of each ledger
        if call is not None:
            to, number = self.observed_rows("audit")
            read = np.ones(number, dtype=bool)
            read[:2] = read[4::4] = False
            self.spare_loops(call, "audit", read, to)
        return call

    def spare_loops(self, call: lib.Call, block: str, read: Mask, to: Ints) -> None:
        """Tells a call which rows are read [rows]; to: where those of each family begin."""
        shapes = [row.shape for row in self.description.rows]
        found = spared_loops(self.description.blocks[block], read, self.description.ix, shapes, to)
        if found.any():
            self._keep.append(found)
            call.frame.spared = lib.pointer(found)

    def observed_rows(self, block: str) -> tuple[Ints, int]:
        """First row of each row family of an observing block, and their number."""
        return self.once(("observed", block), lambda: self._observed_rows(block))

    def _observed_rows(self, block: str) -> tuple[Ints, int]:
        table = np.full(len(self.description.rows), -1, dtype=np.int32)
        number = 0
        # rows of a derived block are those of its base
        for k in self.description.rows_of(BASE.get(block, block)):
            table[k] = number
            number += self.description.rows[k].size
        return table, number

    # --- evaluation -----------------------------------------------------------------------------------------

    def _buffer(self, x: Floats) -> Floats:
        """X with room for the audit families behind."""
        buffer = np.zeros(self.form.extended)
        buffer[: len(x)] = x
        return buffer

    def _read(self, x: Floats) -> Floats:
        """X as blocks of equations read it, which know no audit families: itself where they are compiled."""
        return np.ascontiguousarray(x) if self._core.together and x.size >= self.unknowns else self._buffer(x)

    def residual(self, t: float, y: Floats, yd: Floats) -> Floats:
        """F(t, y, yd) [rows]."""
        r = np.empty(max(self.rows, 1))
        a, b = self._read(y), self._read(yd)
        lib.core.sd_residual(c.byref(self._core), t, lib.pointer(a), lib.pointer(b), lib.pointer(r))
        self.failure.check()
        return r[: self.rows]

    def jacobian(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats]:
        """Values of dF/dy and dF/dyd [entries] on the pattern."""
        jy, jyd = np.empty(self.pattern.entries + 1), np.empty(self.pattern.entries + 1)
        a, b = self._read(y), self._read(yd)
        at, slopes = ([lib.pointer(item) for item in pair] for pair in ((a, b), (jy, jyd)))
        lib.core.sd_jacobian(c.byref(self.core), t, *at, None, *slopes)
        self.failure.check()
        return jy[:-1], jyd[:-1]

    def slopes(self, t: float, y: Floats, yd: Floats, *, rate: bool) -> Floats:
        """Values of dF/dy, or of dF/dyd [entries], as `jacobian` says them; of a large system in half the room."""
        # small: both at once
        if self.unknowns <= LARGE:
            return self.jacobian(t, y, yd)[rate]
        found = np.empty(self.pattern.entries + 1)
        a, b = self._read(y), self._read(yd)
        # the half that is not wanted first, to be overwritten
        for side in (not rate, rate):
            lib.core.sd_slopes(c.byref(self.core), t, lib.pointer(a), lib.pointer(b), side, lib.pointer(found))
            self.failure.check()
            # slopes that are no numbers: `jacobian` takes those of a point beside
            if lib.core.sd_first_bad(self.pattern.entries, lib.pointer(found)) >= 0:
                return self.jacobian(t, y, yd)[rate]
        return found[:-1]

    def dense(self, values: Floats) -> Floats:
        """Values on the pattern as a full matrix [rows, unknowns]."""
        full = np.zeros((self.rows, self.unknowns))
        full[self.pattern.row, self.pattern.columns_of()] = values
        return full

    def steep_rows(self, t: float) -> Mask:
        """Rows that hold a steep law [rows]: those for which a scale is compiled."""
        return np.asarray(self.steep_sizes(t, np.ones(self.form.written)) != 0.0)

    def steep_sizes(self, t: float, y: Floats) -> Floats:
        """Sums of the magnitudes of the terms of rows that hold a steep law [rows], rates as large as y; else 0."""
        found = np.zeros(max(self.rows, 1))
        at = self._buffer(y)
        # each block of magnitudes adds to its rows
        for k in range(len(self.form.scales)):
            call = self._scales[k]
            function = lib.ROWS(call.rows)
            function(c.addressof(call.frame), t, *(lib.pointer(item) for item in (at, at, found)))
        self.failure.check()
        return found[: self.rows]

    def _evaluate(self, block: str, t: float, y: Floats, yd: Floats) -> Floats:
        """Rows [observed] of a block of observers at a point (extended); zeros where the model has no such block."""
        call = self.observer(block)
        number = self.observed_rows(block)[1]
        if call is None:
            return np.zeros(number)
        out = np.zeros(max(number, 1))
        function = lib.ROWS(call.rows)
        function(c.addressof(call.frame), t, lib.pointer(y), lib.pointer(yd), lib.pointer(out))
        self.failure.check()
        return out[:number]

    def rows_at(self, block: str, at: Ints, to: Ints, point: tuple[float, Floats, Floats], out: Floats) -> Floats:
        """R [rows] of one block alone at t, y, yd, added to out; at, to: places of families and of rows there."""
        t, y, yd = point
        call = self.call(block, np.ascontiguousarray(at), np.ascontiguousarray(to), out.size)
        # a point that is extended already
        a, b = (x if x.size == self.form.extended else self._buffer(x) for x in (y, yd))
        lib.ROWS(call.rows)(c.addressof(call.frame), t, lib.pointer(a), lib.pointer(b), lib.pointer(out))
        del self._keep[-1]
        self.failure.check()
        return out

    def observe(self, t: float, y: Floats, yd: Floats, audit: Mapping[str, float] | None = None) -> Floats:
        """Traced quantities (and sides of expects) at a point, in the order of their rows."""
        a, b = self._buffer(y[: self.form.written]), self._buffer(yd[: self.form.written])
        # ledgers are read as if they were unknowns
        for k in self.description.families_of("audit"):
            family = self.description.families[k]
            a[self.form.at[k]] = (audit or {}).get(family.name.removeprefix("audit."), 0.0)
        return self._evaluate("observe", t, a, b)

    def observe_rate(self, t: float, y: Floats, yd: Floats) -> Floats:
        """Derivatives of the traced quantities at a point, in the order of their rows; 0 where there is none."""
        buffers = (self._buffer(item[: self.form.written]) for item in (y, yd))
        return self._evaluate("observe_rate", t, *buffers)

    def audit(self, t: float, y: Floats, yd: Floats) -> Floats:
        """[kinetic energy, potential energy (J), power dissipated, power supplied (W)]."""
        return np.concatenate([self._audit_rows(t, y, yd), np.zeros(4)])[:4]

    def ledgers(self, t: float, y: Floats, yd: Floats) -> Floats:
        """Of each ledger [k, 4]: stored, power dissipated, power supplied, the sum of their magnitudes."""
        return self._audit_rows(t, y, yd)[4:].reshape(-1, 4)

    def _audit_rows(self, t: float, y: Floats, yd: Floats) -> Floats:
        buffers = (self._buffer(item[: self.form.written]) for item in (y, yd))
        return self._evaluate("audit", t, *buffers)

    def differential(self, jyd: Floats) -> Mask:
        """Unknowns whose derivative occurs with a nonzero coefficient."""
        mask = np.zeros(self.unknowns, dtype=bool)
        mask[self.pattern.columns_of()[jyd != 0.0]] = True
        return mask
