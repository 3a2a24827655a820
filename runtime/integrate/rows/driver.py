"""The core's driver of one run (core/run/run.h): rows at instants and steps, what observes them, what ledgers count."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.integrate.jumps.impulses import Impulses, Side
from sysdyn.runtime.integrate.methods import Method
from sysdyn.runtime.integrate.request import TRACE, Request
from sysdyn.runtime.integrate.rows.bare import OBSERVED, by_sums, shows
from sysdyn.runtime.integrate.rows.least_norm import LeastMultipliers
from sysdyn.runtime.integrate.rows.ledgers import Ledgers
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.scales import round_off_beside
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.start.settled import Settler

GLANCES = 8
"""Instants of a step at which what shall hold always is looked at, beside its crests (core/run/meters/extrema.h)."""
ROOM = 4096
"""Rows of the ring (blocks of at least 1024 rows are written at once)."""

Sink = Callable[[Floats], None]
SWIFT = 100.0
"""Of the tolerance: what is observed would move by more of its largest in a step, by the equations beside the dense
output, where it relaxes at once (smooth motions: up to ten).
"""
FEW = 400
"""Unknowns up to which the branch of a constraint is watched.  Of several that fold at once (chains of cranks as long
as their rods, which lie flat) one curve through the place is not told from two branches: they are not watched."""
CREDIT = 16
"""Rows that are looked at before it shows that few of them meet their sums."""


def _audit_places(system: System) -> Ints:
    """Places of the members of the audit in y, in the order of core/run/run.h; -1 where there is none."""
    found = np.full(7, -1, dtype=np.int32)
    order = ("energy", "kinetic", "potential", "dissipated", "supplied", "constraints", "drift")
    # families of the audit by the last part of their names
    for k in system.description.families_of("audit"):
        name = system.description.families[k].name.rsplit(".", 1)[-1]
        if name in order:
            found[order.index(name)] = system.form.at[k]
    return found


class Driver:
    """settler: of its rows; keeps [unknowns as written]: the state; start_rate [unknowns]; drift: address of what the
    last step was off the constraints before its method projected it.
    """

    def __init__(
        self,
        system: System,
        request: Request,
        method: Method,
        settler: Settler,
        keeps: NDArray[np.bool_],
        start_rate: Floats,
        drift: int | None,
        magnitude: Floats,
    ) -> None:
        self.system = system
        self.observed = system.observed_rows("observe")[1]
        self._left: Side | None = None
        plan = request.events
        # assignments of events to flows or dynamic variables
        said = () if plan is None else (*(w.assignments for w in plan.whens), *(s.assignments for s in plan.sampled))
        self._assigned = any(a.kind != "discrete" for assignments in said for a in assignments)
        self.unread: Ints = np.zeros(0, dtype=np.int32)
        """Displacements that no row of the run reads: they are not integrated."""
        self.core = lib.core.sd_run_new(
            method.stepper,
            settler.core,
            system.form.written,
            system.form.extended,
            self.observed,
            system.observed_rows("audit")[1],
        )
        # no room in the core
        if not self.core:
            raise MemoryError
        self.ledgers = Ledgers(system)
        run = self.run = self.core.contents
        run.ledgers = self.ledgers.address
        # least multipliers of redundant constraints
        self._least_norm = LeastMultipliers(settler.system) if request.least_norm else None
        if self._least_norm is not None:
            run.least_norm = self._least_norm.address
        self._observers(start_rate)
        self._ask_for_rows(request)
        self._extrema(request)
        self._branches(request, method, settler)
        run.rough = request.settled_to
        run.swift = SWIFT * request.rtol
        self._nothing = round_off_beside(system, magnitude)
        run.nothing = lib.pointer(self._nothing)
        # rows that need no settling, or only sums, or no integrals
        run.bare = int(not request.audited and shows(system, keeps))
        run.told = CREDIT if not request.audited and self._follows_sums(settler, keeps) else 0
        unread = not request.audited and request.events is None and self._unread
        run.unsummed = 1 + request.draft if unread else 0
        run.projected = drift

    def _observers(self, start_rate: Floats) -> None:
        """What is read at a point: the compiled blocks, the members of the audit."""
        system, run = self.system, self.run
        self.calls = {name: system.observer(name) for name in ("audit", "observe", "observe_rate", "observe_scale")}
        self.calls["powers"] = system.powers()
        audited = [k for name in ("audit", "ledger") for k in system.description.blocks.get(name, ())]
        # whether ledgers read rates
        run.rated = int(any(k.rates is None or k.rates for k in audited))
        for name, call in self.calls.items():
            setattr(run, name, None if call is None else c.addressof(call))
        self._audit_at = system.once("audited", lambda: _audit_places(system))
        run.audit_at, run.start_rate = lib.pointer(self._audit_at), lib.pointer(start_rate)

    def _ask_for_rows(self, request: Request) -> None:
        """Where rows are wanted, and the room for them."""
        run, width = self.run, lib.ROW_HEAD + 2 * self.observed
        self._instants = np.ascontiguousarray(request.instants, dtype=np.float64)
        # without kinds all instants are rows of the trace
        kinds = request.instant_kinds
        kinds = np.full(self._instants.size, TRACE) if kinds is None else kinds
        self._kinds = np.ascontiguousarray(kinds, dtype=np.int32)
        run.instant, run.instant_kind = lib.pointer(self._instants), lib.pointer(self._kinds)
        run.instants, run.every_step = self._instants.size, int(request.every_step)
        run.sizes_at_steps = 1
        run.glances, run.apart = GLANCES * request.sample_steps, request.apart
        # a block of rows, fewer where each is wide
        self.rows = np.empty((ROOM if width < ROOM else 64, width))
        run.row, run.room = lib.pointer(self.rows), self.rows.shape[0]

    def _branches(self, request: Request, method: Method, settler: Settler) -> None:
        """Watches that steps stay on the branch of a constraint of displacements, where there is one alone."""
        self.branches: int | None = None
        contacts = () if request.events is None else request.events.contacts
        # gaps and large models have no single branch
        if any(contact.kind == "phi" for contact in contacts) or settler.system.unknowns > FEW:
            return
        rows = np.flatnonzero(settler.left_of(settler.system.of_groups("phi")))
        # no constraint of displacements, or several
        if rows.size != 1:
            return
        extended = self.system.form.extended
        self.branches = lib.core.sd_branches_new(settler.core, method.stepper, extended, int(rows[0]))
        if not self.branches:
            raise MemoryError
        self.run.branches = self.branches

    def _extrema(self, request: Request) -> None:
        """Where they are asked for, and all that is observed has its value at any point: of multipliers that are open
        and of integrals of powers rows alone tell.
        """
        self.extrema: Floats | None = None
        # not asked for, or rows alone tell
        if not (request.extrema or request.sample_steps) or self._least_norm is not None or not self._unread:
            return
        rooms = np.zeros((6, max(self.observed, 1)))
        self.extrema = rooms[:2]
        # least and largest values, and what is looked at within a step
        least, most, *looks, settled = map(lib.pointer, rooms)
        core = self._extrema_core = lib.Extrema(columns=self.observed, least=least, most=most, settled=settled)
        core.watched = int(request.sample_steps)
        core.look[:] = looks
        lib.core.sd_extrema_begin(c.byref(core))
        self.run.extrema = c.addressof(core)

    def _follows_sums(self, settler: Settler, keeps: NDArray[np.bool_]) -> bool:
        """Tells the settler by which sums all that a row shows follows from the state, where so and without rates."""
        settled = settler.system
        # rates are shown, or multipliers are open
        if self.calls["observe_rate"] is not None or self._least_norm is not None or settled.unknowns > LARGE:
            return False  # of a large one the room counts
        known, sums = settled.once(("by sums", keeps.tobytes()), lambda: by_sums(settled, keeps))
        # sums do not tell all that is shown
        if not shows(self.system, known, OBSERVED):
            return False
        self._sums = settler.left_of(sums)
        settler.core.contents.told = lib.pointer(self._sums)
        return True

    @property
    def _unread(self) -> bool:
        """Whether nothing that is observed reads the audit, whose integrals are then for the run that is kept."""
        audit = frozenset(self.system.description.families_of("audit"))
        blocks = [self.system.description.blocks.get(name, ()) for name in ("observe", "observe_scale")]
        return all(k.reads is not None and not (k.reads & audit) for block in blocks for k in block)

    def asks(self, t: float) -> bool:
        """Whether the next instant at which the trace wants a row is t (s), and not every step has one."""
        # no instant left, or a later one
        run = self.run
        if run.every_step or run.next >= run.instants or self._instants[run.next] > t:
            return False
        return bool(self._kinds[run.next] & TRACE)

    @cached_property
    def impulses(self) -> Impulses | None:
        """What gains over an instant without moving anything; None where nothing does."""
        found = Impulses(self.system, self.unread, assigned=self._assigned) if self.system.are("s").any() else None
        return found if found is not None and found.any else None

    def leave(self, y: Floats, yd: Floats) -> None:
        """Notes the powers at y, yd [unknowns as written], the point behind which the run restarts."""
        lib.core.sd_run_leave(self.core, lib.pointer(y), lib.pointer(yd))
        self.note(self.run.t_to, y, yd)

    def note(self, t: float, y: Floats, yd: Floats) -> None:
        """The point at t (s) from which integrals gain by impulses."""
        if self.impulses is not None:
            self._left = Side(t, y.copy(), yd.copy(), self.system.description.p.copy())

    def arrive(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> Floats:
        """Y behind the instant at which the point before it was left, with what integrals gain by its impulses."""
        # nothing gains by impulses
        if self.impulses is None or self._left is None:
            return y
        behind, before, self._left = Side(t, y, yd, self.system.description.p.copy()), self._left, None
        y = y.copy()
        y[self.impulses.states] += self.impulses.gains(before, behind, magnitude[: y.size])
        return y

    def drain(self, sink: Sink) -> None:
        """Rows so far go to the sink."""
        run = self.run
        # rows since the last time
        if run.rows:
            rows = self.rows[: run.rows].copy()
            run.rows = 0  # first: an interruption in between must not hand them over twice
            sink(rows)

    def largest(self) -> Floats:
        """Largest magnitude so far of each observed quantity and of the terms of its expression [observed]."""
        return lib.reader(self.run.largest, max(self.observed, 1))[: self.observed].copy()

    def __del__(self) -> None:
        if getattr(self, "core", None):
            # in the order in which they depend on each other
            lib.core.sd_run_free(self.core)
        if getattr(self, "branches", None):
            lib.core.sd_branches_free(self.branches)
