"""One integration by a method of the core: from a consistent state to rows of observed values.

The core advances in chunks of about 50 ms; between them rows are handed to `sink`, progress is shown, and Ctrl-C,
--max-steps and --max-wall are honoured.  Values at output instants are moved onto the constraints and their hidden
derivatives by the core (settled.py).
"""

from __future__ import annotations

import ctypes as c
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.condense.condensed import Condensed, Forms, condensed
from sysdyn.runtime.condense.elimination import steady
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.integrate.least_norm import LeastNorm
from sysdyn.runtime.integrate.ledgers import Ledgers
from sysdyn.runtime.integrate.methods import Method
from sysdyn.runtime.integrate.metric import kinematic_scale
from sysdyn.runtime.integrate.origin import UNRESOLVED, Origin
from sysdyn.runtime.integrate.pieces import Pieces
from sysdyn.runtime.integrate.request import LONGEST, ON_UNDERLYING, TRACE, Finished, Request, Statistics
from sysdyn.runtime.integrate.segments import Segment, segments
from sysdyn.runtime.integrate.underlying import Underlying
from sysdyn.runtime.integrate.unknown_roles import Roles, roles
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import RowLabel, SolverFailure
from sysdyn.runtime.model.scales import ROUND_OFF, UNKNOWN, confirmed, magnitudes, noise
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.ordering import Order, net_order_of
from sysdyn.runtime.start.restart import Restart, still
from sysdyn.runtime.start.settled import Settler, flows_open
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.structure import DENSE, null_place

CHUNK_SECONDS = 0.05
WINDOW, STRAINED = 24, 0.5
"""Steps, with a quarter of those before, in which Newton may fail in this part of them: beyond, the tolerance says
little of what a run finds."""
CHUNK_STEPS = 1 << 20
PROJECTED = ("1", "0")
"""Forms whose rows let the constraints drift: accepted points are moved onto them."""
CRAWL, DRAFT_CRAWL = 200_000, 20_000
"""Steps after which a run, a draft must have got CREPT of the span further: else it would take for ever."""
CREPT = 1e-6
SLACK = 0.1
"""Of the tolerance: what rows within a step may move of the state, in magnitudes, and need not be the least change,
where constraints are constant sums: their unknowns are interpolated differently (radau_dense.c).  Of curved ones
the least change takes out most of the error between steps (a parallelogram by dopri: 25 times)."""
UNPULLED = 2
"""Kind of a derivative (core/steppers/radau.h): interpolated whatever pulls at its unknown."""
RATED = 5_000
"""Unknowns up to which a point behind a jump is asked for flows that are open.  With the rates of all balances that
of a larger net is dear to find (a driven grid of 35 x 35: 20 s): its loops of stores are left as rows leave them.
"""
STAGED = 100_000
"""Unknowns of a system up to which radau may take more stages than three, whose factors need three times the room."""
SMOOTH = 4.5
"""Mean order of the bdf from which on a motion is smooth (of rectifiers 2.5 to 4.7)."""
ROOM = 4096
"""Rows of the ring (blocks of at least 1024 rows are written at once)."""

Sink = Callable[[Floats], None]
Progress = Callable[[float], None]


def _audited(system: System) -> Ints:
    """Places of the members of the audit in y, in the order of core/run/run.h; -1 where there is none."""
    found = np.full(7, -1, dtype=np.int32)
    order = ("energy", "kinetic", "potential", "dissipated", "supplied", "constraints", "drift")
    for k in system.description.families_of("audit"):
        name = system.description.families[k].name.rsplit(".", 1)[-1]
        if name in order:
            found[order.index(name)] = system.form.at[k]
    return found


class Integration:
    """The core's structures for one system and request; `run` drives them."""

    def __init__(
        self, system: System, start: ConsistentState, request: Request, origin: Origin | None = None
    ) -> None:
        """origin: of this start, where it is known for several runs."""
        self.system, self.start, self.request = system, start, request
        self.cpu = 0.0
        alone = origin is None and request.events is None
        system.trim()  # of the run before
        self.origin = origin = origin or Origin(system, start, request.index)
        self._factors = origin.factors
        self.y, self.yd, self._start_rate = origin.point(own=alone)
        self._restart: Restart | None = None
        self.roles: Roles = origin.roles
        self.underlying: Underlying | None = None
        if request.method in ON_UNDERLYING:
            self._solved, self.roles = origin.explicit
        self._carries = self.roles.state
        self.magnitude = self._magnitudes()
        if system.form.name == "2":
            self._weigh()
        self._spare()
        self.segments = segments(start.t, request.t_end, None if request.fixed_step else request.stops)
        self.forms = self._condensed()
        self._linear()
        self.settler = self._settler("settled" if self.forms is not None else self._whole_form, self._keeps)
        if not self._steep_balances:
            sums = system.once("sums", lambda: steady(system.description, ("phi", "phi_rate", "psi")))
            # steep laws magnify what a basis leaves
            slack = SLACK * request.tolerance if sums and not system.form.scales else 0.0
            # the least change shares what is open: flows between contacts, potentials where all laws are faint
            self.settler.by_basis(slack, determined=request.events is not None)
        self.settler.core.contents.enough = request.settled_to if request.draft else 0.0
        self._stepper()
        self._driver()
        self.pieces = Pieces(self, request.events) if request.events else None
        self._spare()
        self._put_away()
        if system.unknowns > LARGE:
            del self.origin, self.yd, self._least
            if self.forms is not None:  # of what is kept the method has its own
                nothing = np.zeros(0, dtype=np.int32)
                self.roles = replace(self.roles, test=nothing, power=nothing)

    def _spare(self) -> None:
        """Lets go of what a large model found on its way here, and would find again."""
        if self.system.unknowns > LARGE:
            self.origin.let_go()
            self.system.spare()
            self.system.trim()

    def _put_away(self) -> None:
        """Lets go of patterns of a large model that no step reads: those of what is condensed."""
        if self.system.unknowns > LARGE and self.forms is not None:
            self.system.put_away(whole=True)
            for form in (self.forms.stepped, self.forms.settled):
                form.whole.put_away(whole=False)

    def _weigh(self) -> None:
        """The factors of the rows q' - f; the magnitudes of nu follow them."""
        scale = kinematic_scale(self.system, self.magnitude, self.origin.jy, self.origin.jyd)
        if (scale != self.system.kinematic_scale).any():
            self.system.kinematic_scale[:] = scale
            self.origin.weighted()
            self.magnitude = self._magnitudes()

    def _condensed(self) -> Forms | None:
        """The forms without what constant sums define; None where all unknowns are integrated."""
        request = self.request
        whole = request.events is not None or request.least_norm or request.fixed_step is not None
        if whole or not request.condense or request.method in ON_UNDERLYING:
            return None
        if self.system.unknowns > LARGE:
            self.system.put_away(whole=True)  # found again, if it is what is stepped
        found = condensed(self.system, self.start.t, self.y, self.yd)
        self._spare()
        return found

    @property
    def stepped(self) -> System | Condensed:
        """What the method sees."""
        return self.system if self.forms is None else self.forms.stepped

    @cached_property
    def _least(self) -> Floats:
        """Magnitudes below which a tolerance is less than round-off leaves open: no step meets it [unknowns]."""
        origin = getattr(self, "origin", None) or Origin(self.system, self.start, self.request.index)
        return origin.least / max(self.request.rtol, 1e-15)

    @cached_property
    def _met(self) -> Floats:
        """Largest |y| met [unknowns]; of a condensed form as far as it is shared (`_share`)."""
        return np.zeros(self.system.unknowns)

    @cached_property
    def _resolved(self) -> Floats:
        """|y| of which is known what round-off leaves open [unknowns]."""
        return np.zeros(self.system.unknowns)

    def _magnitudes(self) -> Floats:
        found, self._time = self.origin.sized(self.request.t_end)
        return np.maximum(found, self._least)

    def _linear(self) -> None:
        if self.request.method in ON_UNDERLYING:
            self.underlying = Underlying(self._solved, self.magnitude, self._factors)
            self.linear, self._order = self.underlying.linear, Order(None)
            return
        self._order = net_order_of(self.system) if self.forms is None else self.forms.order()
        self._taken = self._factors.take(self.stepped.pattern, self._order)
        self.linear = self._taken.linear

    @property
    def _keeps(self) -> NDArray[np.bool_]:
        """Unknowns as written that carry the state."""
        return self.roles.state[: self.system.form.written]

    @cached_property
    def _whole_form(self) -> str:
        """All rows that hold at a point, with every unknown: where events change them any flow may be open."""
        system = self.system
        if "dynamics_rate" not in system.description.blocks:
            return "settled"
        if self.request.events is not None:
            return "rated"
        if system.unknowns > RATED:
            return "settled"
        n = system.form.written
        point = self.start.t, self.y[:n], self.yd[:n]
        return "rated" if flows_open(system.another("settled"), *point, self._keeps) else "settled"

    def _settler(self, name: str, state: NDArray[np.bool_], *, whole: bool = False) -> Settler:
        """Of the rows of a form; whole: with every unknown, whatever leaves the runs."""
        form = self.system.form
        n = form.written
        kinematics = (form.k_q, form.k_f)
        left = self.forms.settled if self.forms is not None and name == "settled" and not whole else None
        system = self.system.another(name)
        return Settler(system, kinematics, self.magnitude[:n], self._time, state, left)

    def _stages(self) -> tuple[int, int]:
        """Of radau: in the first step, at most."""
        if self.request.stages is not None:
            return self.request.stages
        many = self.stepped.unknowns <= STAGED and not self.system.form.scales
        return 3, lib.STAGES if many else 3

    def _stepper(self) -> None:
        request = self.request
        first, most = self._stages()
        order = self._order
        self.method = Method(request.method, self.stepped, self.linear, self._factors, order, self.underlying, most)
        # below what round-off leaves of a magnitude nothing is asked: --atol 0 meets zeros
        self._atol = None if request.atol is None else np.maximum(request.atol, ROUND_OFF * self.magnitude)
        self._unnamed = self.system.are("q", "f", "p", "s") & (self.system.nominal == 0.0)
        method = self.method.contents
        method.rtol, method.t_end = request.rtol, self.segments[0].end
        method.h_max = request.fixed_step or request.h_max or LONGEST * (request.t_end - self.start.t)
        method.fixed_h = request.fixed_step or 0.0
        self._tell(method)
        if request.method == "bdf":
            method.max_order = request.max_order
        elif request.method == "radau":
            method.stages, method.balances = first, int(self._steep_balances)
        elif self.underlying is not None:
            method.patience = request.stiff_steps
        if request.method == "dopri":
            method.spare, method.opening = request.spare_steps, request.opening
        if request.method == "energy":
            self._audit = self.system.observer("audit")
            method.audit = None if self._audit is None else c.addressof(self._audit)
        self._project: Settler | None = None
        if self.underlying is None and self.system.form.name in PROJECTED:
            self._project = self._settler("constraints", np.ones(self.system.form.written, dtype=bool))
            method.project = self._project.address
        self.method.start(self.start.t, self.y, self.yd)

    @property
    def _steep_balances(self) -> bool:
        return any(scale.block == "dynamics_scale" for scale in self.system.form.scales)

    def _tell(self, method: Any) -> None:
        """What the method is told of each unknown that it steps: tolerance, magnitude, roles."""
        found, origin = self.roles, self.origin
        if self.forms is None:
            seen = self._atol, self.magnitude, self._met
        else:
            kept = self.forms.stepped.kept
            if origin.kept is None:
                origin.kept = self._kept_roles(self.forms.stepped.whole, kept)
            found = origin.kept
            seen = (None if self._atol is None else self._atol[kept], self.magnitude[kept], np.zeros(kept.size))
        smooth = found.smooth.astype(np.int32)
        if self.forms is not None:  # as where their rates are unknowns too: rows q' = f pull at nothing
            smooth[found.smooth & self.system.are("q")[kept]] = UNPULLED
        self._stepped = found, seen, smooth, found.idle.astype(np.int32)
        atol, magnitude, met = seen
        method.atol, method.magnitude, method.met = map(lib.pointer, (atol, magnitude, met))
        method.test, method.power = lib.pointer(found.test), lib.pointer(found.power)
        if self.request.method == "bdf" and (found.common >= 0).any():
            self._groups = found.groups()
            method.common_from, method.common = map(lib.pointer, self._groups)
            method.commons = self._groups[0].size - 1
        if self.request.method == "radau":
            method.smooth = lib.pointer(self._stepped[2])
        if self.system.form.scales and self.underlying is None:
            self.linear.contents.idle = lib.pointer(self._stepped[3])
            if self.forms is not None:  # rows within a step are judged by the magnitudes of all unknowns
                expanded = self.method.expanded.contents
                expanded.met, expanded.magnitude = lib.pointer(self._met), lib.pointer(self.magnitude)

    def _kept_roles(self, whole: System, kept: Ints) -> Roles:
        """Roles of what is kept; constraints between displacements are left by their rates: no index above 2."""
        _, jyd = whole.jacobian(self.start.t, self.y, self.yd)
        return roles(whole, self.start.t, jyd, min(self.request.index, 2)).kept(kept)

    def _sizes(self) -> tuple[Floats, Floats]:
        """Largest |y| met and magnitude of every unknown; what was eliminated is as large as at the last point."""
        if self.forms is None:
            return self._met, self.magnitude
        _, (_, magnitude, met), _, _ = self._stepped
        largest, kept = np.maximum(self._met, np.abs(self.method.point()[0])), self.forms.stepped.kept
        largest[kept] = met
        sizes = np.maximum(self.magnitude, largest)
        sizes[kept] = magnitude
        return largest, sizes

    def last(self) -> tuple[Floats, Floats, Floats]:
        """Y and yd at the end of the last step, the largest |y| met [unknowns]."""
        return (*self.method.point(), self._sizes()[0])

    def _projected(self) -> int | None:
        """Address of what the last step was off the constraints before its method projected it."""
        if self.underlying is not None:
            return c.addressof(self.underlying.core.contents) + lib.Underlying.drift.offset
        if self._project is not None:
            return c.addressof(self._project.core.contents) + lib.Settle.drift.offset
        return None

    def _driver(self) -> None:
        request, system = self.request, self.system
        self.observed = system.observed_rows("observe")[1]
        self.width = lib.ROW_HEAD + 2 * self.observed
        self.run_ = lib.core.sd_run_new(
            self.method.stepper,
            self.settler.core,
            system.form.written,
            system.form.extended,
            self.observed,
            system.observed_rows("audit")[1],
        )
        if not self.run_:
            raise MemoryError
        self.ledgers = Ledgers(system)
        self.run_.contents.ledgers = self.ledgers.address
        self._calls = {
            name: system.observer(name) for name in ("audit", "observe", "observe_rate", "observe_scale")
        }
        run = self.run_.contents
        self._least_norm = LeastNorm(self.settler.system) if request.least_norm else None
        if self._least_norm is not None:
            run.least_norm = self._least_norm.address
        self._calls["powers"] = system.powers()
        audited = [k for name in ("audit", "ledger") for k in system.description.blocks.get(name, ())]
        run.rated = int(any(k.rates is None or k.rates for k in audited))
        for name, call in self._calls.items():
            setattr(run, name, None if call is None else c.addressof(call))
        self._audit_at = system.once("audited", lambda: _audited(system))
        self._instants = np.ascontiguousarray(request.instants, dtype=np.float64)
        self._rows = np.empty((max(64, min(ROOM, 1 << 24)) if self.width < 4096 else 64, self.width))
        kinds = request.instant_kinds
        self._kinds = np.ascontiguousarray(
            np.full(self._instants.size, TRACE) if kinds is None else kinds, dtype=np.int32
        )
        run.instant_kind = lib.pointer(self._kinds)
        run.start_rate = lib.pointer(self._start_rate)
        run.audit_at, run.instant = lib.pointer(self._audit_at), lib.pointer(self._instants)
        run.instants, run.every_step = self._instants.size, int(request.every_step)
        run.sample_steps, run.apart = int(request.sample_steps), request.apart
        run.rough, run.bare = request.settled_to, int(self._bare and not request.audited)
        unread = not request.audited and request.events is None and self._unread
        run.unsummed = 1 + request.draft if unread else 0
        if self.underlying is None and system.form.scales:
            run.magnitude = lib.pointer(self.magnitude)
        run.projected = self._projected()
        run.row, run.room = lib.pointer(self._rows), self._rows.shape[0]

    @property
    def _bare(self) -> bool:
        """Whether all that is observed follows from the state: nothing that a row has to be settled for."""
        description, written = self.system.description, self.system.family_of[: self.system.form.written]
        follows = frozenset(written[~self._keeps].tolist())
        read = [(kernel.reads, kernel.rates) for kernel in description.blocks.get("observe", ())]
        return all(reads is not None and not (reads & follows) and rates == frozenset() for reads, rates in read)

    @property
    def _unread(self) -> bool:
        """Whether nothing that is observed reads the audit, whose integrals are then for the run that is kept."""
        audit = frozenset(self.system.description.families_of("audit"))
        blocks = [self.system.description.blocks.get(name, ()) for name in ("observe", "observe_scale")]
        return all(k.reads is not None and not (k.reads & audit) for block in blocks for k in block)

    def drain(self, sink: Sink) -> None:
        """Rows so far go to the sink."""
        run = self.run_.contents
        if run.rows:
            rows = self._rows[: run.rows].copy()
            run.rows = 0  # first: an interruption in between must not hand them over twice
            sink(rows)

    def _placed(self, failure: SolverFailure) -> SolverFailure:
        """The failure with the last good point."""
        n, (y, yd) = self.system.form.written, self.method.point()
        failure.state = (self.method.contents.t, y[:n].copy(), yd[:n].copy())
        return failure

    def _failure(self, cause: str) -> SolverFailure:
        method = self.method.contents
        if self.ledgers.lost is not None:
            return SolverFailure("inertia", method.t, method.h, None, self.ledgers.lost)
        unknown: str | None = None
        row: RowLabel | None = None
        if cause in ("singular", "nonfinite") and 0 <= method.bad_row < self.stepped.rows:
            row = self.stepped.row_label(method.bad_row)
        if cause == "singular":
            unknown = self.stepped.name(method.bad_column)
        if cause in ("newton", "step_too_small", "error_test", "singular") and self.system.unknowns <= DENSE:
            # where the equations themselves are singular there, say so, with the place
            names, at = self._null_place()
            if names:
                return SolverFailure(
                    "singular", method.t, method.h, ", ".join(names[:3]), self.system.row_label(at)
                )
            cause = "newton" if cause == "singular" else cause
        if cause in ("error_test", "step_too_small", "newton"):
            unknown = self._worst()
        return SolverFailure(cause, method.t, method.h, unknown, row, smooth=self.smooth)

    @property
    def smooth(self) -> bool:
        """Whether the bdf takes nearly all steps at its highest order."""
        method = self.method.contents
        return self.request.method == "bdf" and method.orders > SMOOTH * method.steps

    def _null_place(self) -> tuple[tuple[str, ...], int]:
        """Unknowns and row of a singular pencil at the last accepted point; () where it is regular."""
        method = self.method.contents
        y, yd = self.method.point()
        jy, jyd = self.system.jacobian(method.t, y, yd)
        if not (np.isfinite(jy).all() and np.isfinite(jyd).all()):
            return (), -1
        return null_place(self.system, jy, jyd)

    def _worst(self) -> str:
        """The unknown with the largest weighted correction in the last step."""
        method, n = self.method.contents, self.stepped.unknowns
        change = np.abs(lib.reader(method.ee, n) * lib.reader(method.weight, n))
        change = np.where(np.isfinite(change), change, np.inf)
        test = self._stepped[0].test
        if (test >= 0).any():
            change[test < 0] = 0.0
        return self.stepped.name(int(np.argmax(change)))

    def happened(self) -> tuple[Happened, ...]:
        """The events so far."""
        return self.pieces.happened() if self.pieces is not None else ()

    def largest(self) -> Floats:
        """Largest magnitude so far of each observed quantity and of the terms of its expression [observed]."""
        return lib.reader(self.run_.contents.largest, max(self.observed, 1))[: self.observed].copy()

    def statistics(self) -> Statistics:
        """Counters so far; residuals and Jacobians of the settling at output instants not included."""
        method, core = self.method.contents, self.stepped.core
        residuals, matrices = (0, 0) if self.underlying is None else self.underlying.evaluations
        return Statistics(
            method.steps,
            method.rejected_steps,
            core.residual_evaluations + residuals,
            core.jacobian_evaluations + matrices,
            self.linear.contents.factorisations,
            method.newton_failures,
        )

    @property
    def restart(self) -> Restart:
        """Finds consistent points behind jumps, with every unknown."""
        if self._restart is None:
            settler = self.settler
            if self.forms is not None:
                settler = self._settler(self._whole_form, self._keeps, whole=True)
                settler.by_basis(0.0, determined=True)
            self._restart = Restart(settler, self._keeps)
        return self._restart

    def _across(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats] | None:
        """The point behind a jump of the text at t (s); where no state jumps, what is left of the unknowns tells."""
        if self.forms is not None and self._whole_form == "settled":
            n = self.system.form.written
            found = still(self.settler, t, (y, yd), self._keeps, self.magnitude[:n])
            if found is not None:
                return found
        return self.restart.across(t, y if self.forms is None else self.forms.completed(t, y), yd)

    def _share(self, y: Floats) -> None:
        """What a method of fewer unknowns knows of their sizes becomes known of all at a point y."""
        if self.forms is None:
            return
        kept, (_, magnitude, met) = self.forms.stepped.kept, self._stepped[1]
        for sizes in (self._met, self.magnitude):
            np.maximum(sizes, np.abs(y), out=sizes)
        self.magnitude[kept], self._met[kept] = magnitude, met

    def _hand_down(self) -> None:
        """The magnitudes that the method of fewer unknowns goes by, from those of all."""
        if self.forms is not None:
            self._stepped[1][1][:] = self.magnitude[self.forms.stepped.kept]

    def _cross(self, segment: Segment) -> None:
        """Restarts behind the instant at which a segment ended."""
        n, method = self.system.form.written, self.method.contents
        y, yd = self.method.point()
        self._share(y)
        y, yd, _ = self.settler.settle(method.t, y[:n], yd[:n])
        if self.pieces is not None:
            found: tuple[Floats, Floats] | None = self.pieces.jump(segment.begin, y, yd)
        else:
            found = self._across(segment.begin, y, yd)
        if found is None:
            raise self._failure("newton")
        method.t_end = segment.end
        self.go_on(segment.begin, segment.label, found, (y, yd))
        self.run_.contents.start_kind = 0

    def go_on(
        self, t: float, label: float, point: tuple[Floats, Floats], before: tuple[Floats, Floats]
    ) -> None:
        """Restarts at t (s) from a point [unknowns as written], with the row of the instant `label`."""
        n = self.system.form.written
        if not self._start_rate.flags.writeable:  # the start's own
            self.y, self._start_rate = np.zeros(self.system.unknowns), np.zeros(self.system.unknowns)
            self.run_.contents.start_rate = lib.pointer(self._start_rate)
        self.y[:], self._start_rate[:] = 0.0, 0.0
        self.y[:n], self._start_rate[:n] = point
        self.yd = np.where(self.roles.differential, self._start_rate, 0.0)
        self.begin_to_move(t)
        self._resolve(t)
        self._hand_down()
        pointers = (lib.pointer(item) for item in (self.y, self.yd, *before))
        lib.core.sd_run_restart(self.run_, t, label, *pointers)

    def _resolve(self, t: float) -> None:
        """No magnitude asks for more than round-off leaves: contents that grew are summed where flows are zero."""
        if (np.abs(self.y) <= 2.0 * self._resolved).all():
            return
        np.maximum(self._resolved, np.abs(self.y), out=self._resolved)
        jy, _ = self.system.jacobian(t, self.y, self.yd)
        open_ = np.where(self._carries, 0.0, noise(self.system, self.y, jy, self._time))
        np.maximum(self.magnitude, UNRESOLVED * open_ / max(self.request.rtol, 1e-15), out=self.magnitude)

    def begin_to_move(self, t: float) -> None:
        """Unknowns that stood at zero so far, of unknown size, and whose rates say only now how large they will be."""
        begin = (self._met <= ROUND_OFF) & (self.magnitude == UNKNOWN) & (self._start_rate != 0.0) & self._unnamed
        if begin.any():
            with np.errstate(over="ignore"):
                found, _ = magnitudes(self.system, t, self.request.t_end, self.y, self._start_rate)
            self.magnitude[begin] = np.maximum(found, self._least)[begin]

    def _advance(self, sink: Sink, progress: Progress | None, began: float, segment_end: float) -> None:
        """To the end of a segment."""
        if self.pieces is not None:
            self.pieces.aim(segment_end)
        request, method = self.request, self.method.contents
        marked, at = method.steps, method.t
        most, failed = CHUNK_STEPS, method.newton_failures
        while True:
            left = CHUNK_STEPS if request.max_steps is None else request.max_steps - method.steps
            if request.unstrained:
                most, failed = WINDOW + method.steps // 4, method.newton_failures
            before = time.process_time()
            state = lib.core.sd_run_advance(self.run_, min(most, max(left, 1)), CHUNK_SECONDS)
            self.cpu += time.process_time() - before
            self.drain(sink)
            self.system.failure.check()
            self.settler.system.failure.check()
            if progress is not None:
                progress(method.t)
            if state == 3:
                raise self._placed(self._failure(lib.CAUSES[method.cause]))
            if request.max_steps is not None and method.steps >= request.max_steps and method.t < request.t_end:
                raise self._failure("max_steps")
            if request.unstrained and state == 0 and method.newton_failures - failed > STRAINED * most:
                raise self._failure("strained")
            late = request.max_wall is not None and time.monotonic() - began > request.max_wall
            if late and method.t < request.t_end:
                raise self._failure("max_wall")
            if state == 4:
                assert self.pieces is not None
                self.cpu += self.pieces.event(sink)
                continue
            if state == 1 and self.pieces is not None:
                before = time.process_time()
                more = self.pieces.sample(segment_end, sink)
                self.cpu += time.process_time() - before
                if more:
                    continue
                self.drain(sink)
            if state == 1:
                break
            if method.steps - marked >= (DRAFT_CRAWL if request.draft else CRAWL):
                if method.t - at < CREPT * (request.t_end - self.start.t):
                    raise self._failure("step_too_small")
                marked, at = method.steps, method.t

    def run(self, sink: Sink, progress: Progress | None = None) -> Finished:
        """To the end, or SolverFailure; rows go to `sink` in any case, the time reached [s] to `progress`."""
        began = time.monotonic()
        self.stepped.core.residual_evaluations = self.stepped.core.jacobian_evaluations = 0
        method = self.method.contents
        for segment in self.segments:
            if segment is not self.segments[0]:
                before = time.process_time()
                self._cross(segment)
                self._put_away()
                self.cpu += time.process_time() - before
            self._advance(sink, progress, began, segment.end)
        magnitude = confirmed(self.system, self.request.t_end - self.start.t, *self._sizes())
        return Finished(
            method.t,
            self.statistics(),
            magnitude[: self.system.form.written],
            self.largest(),
            self.cpu,
            self.settler.core.contents.failures,
            self.ledgers,
            self.happened(),
            self.run_.contents.beyond,
            self.last(),
            method.opening if self.request.method == "dopri" else 0.0,
        )

    def __del__(self) -> None:
        if getattr(self, "run_", None):
            lib.core.sd_run_free(self.run_)


def integrate(
    system: System,
    start: ConsistentState,
    request: Request,
    sink: Sink,
    progress: Progress | None = None,
) -> Finished:
    """One integration; see Request.  sink receives blocks of rows [k, ROW_HEAD + 2 observed] (core/run/run.h)."""
    return Integration(system, start, request).run(sink, progress)
