"""One integration by the core's BDF: from a consistent state to rows of observed values.

The core advances in chunks of about 50 ms; between them rows are handed to `sink`, progress is shown, and Ctrl-C,
--max-steps and --max-wall are honoured.  Values at output instants are moved onto the constraints and their hidden
derivatives by the core (settled.py).
"""

from __future__ import annotations

import ctypes as c
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sysdyn.runtime import core_library as lib
from sysdyn.runtime.description import Floats, Ints
from sysdyn.runtime.failures import RowLabel, SolverFailure
from sysdyn.runtime.ordering import column_order
from sysdyn.runtime.scales import magnitudes
from sysdyn.runtime.settled import Settler
from sysdyn.runtime.start import ConsistentState
from sysdyn.runtime.structure import DENSE, null_place
from sysdyn.runtime.system import System
from sysdyn.runtime.unknown_roles import Roles, roles

CHUNK_SECONDS = 0.05
CHUNK_STEPS = 1 << 20
ROOM = 4096
"""Rows of the ring (blocks of at least 1024 rows are written at once)."""

LONGEST = 0.05
"""Longest step as part of the span: short events of sources are met, and the dense output stays honest."""

TRACE, STEP, COMPARED = 1, 2, 4
"""Kinds of rows (their second column, a sum)."""

Sink = Callable[[Floats], None]
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Request:
    """What an integration shall do.

    t_end [s]; instants [s] ascending: where rows are wanted, instant_kinds: their kinds
    (TRACE, COMPARED or both; None: all TRACE), every_step: at each accepted step too; rtol; atol:
    absolute tolerance of all unknowns in SI units, None: rtol times the magnitude of each; magnitude [unknowns as
    written] known from an earlier run (else tracked); fixed_step [s]: no error test (with max_order 1 the
    implicit Euler method); h_max [s]: longest step, None: LONGEST of the span.
    """

    t_end: float
    instants: Floats
    instant_kinds: Ints | None = None
    every_step: bool = True
    sample_steps: bool = False
    rtol: float = 1e-6
    atol: float | None = None
    max_steps: int | None = None
    max_wall: float | None = None
    magnitude: Floats | None = None
    index: int = 3
    max_order: int = lib.MAX_ORDER
    fixed_step: float | None = None
    h_max: float | None = None


@dataclass(frozen=True, slots=True)
class Statistics:
    """Deterministic counters of one or more runs."""

    steps: int = 0
    rejected_steps: int = 0
    residual_evaluations: int = 0
    jacobian_evaluations: int = 0
    factorisations: int = 0
    newton_failures: int = 0

    def __add__(self, other: Statistics) -> Statistics:
        return Statistics(*(getattr(self, name) + getattr(other, name) for name in self.__slots__))


@dataclass(frozen=True, slots=True)
class Finished:
    """An integration that reached its end.

    magnitude [unknowns as written]: largest |y| met; largest [observed]: of the values and of the terms of their
    expressions; cpu [s].
    """

    reached: float
    statistics: Statistics
    magnitude: Floats
    largest: Floats
    cpu: float
    unsettled: int


class Integration:
    """The core's structures for one system and request; `run` drives them."""

    def __init__(self, system: System, start: ConsistentState, request: Request) -> None:
        self.system, self.start, self.request = system, start, request
        self.cpu = 0.0
        self.y, self.yd = start.for_form(system)
        jy, jyd = system.jacobian(start.t, self.y, self.yd)
        self._start_rate = self.yd
        # rates of algebraic unknowns do not follow from the start's equations: the first step finds them
        self.yd = np.where(system.differential(jyd), self.yd, 0.0)
        self.roles: Roles = roles(system, jyd, request.index)
        self.magnitude = self._magnitudes()
        self._linear(jy, jyd)
        self.settler = self._settler()
        self._stepper()
        self._driver()

    def _magnitudes(self) -> Floats:
        found, self._time = magnitudes(self.system, self.start.t, self.request.t_end, self.y, self.yd)
        if self.request.magnitude is not None:
            known = self.request.magnitude
            found[: known.size] = np.where(known > 0.0, known, found[: known.size])
        return np.ascontiguousarray(found)

    def _linear(self, jy: Floats, jyd: Floats) -> None:
        pattern = self.system.pattern
        span = max(self.request.t_end - self.start.t, 1e-300)
        self._order = column_order(pattern, jy + 1e3 / span * jyd)
        self.linear = lib.core.sd_linear_new(
            pattern.unknowns, *(lib.pointer(item) for item in (pattern.column, pattern.row, self._order))
        )
        if not self.linear:
            raise MemoryError

    def _settler(self) -> Settler:
        form = self.system.form
        n = form.written
        kinematics = (form.k_q, form.k_f)
        return Settler(
            self.system.another("settled"), kinematics, self.magnitude[:n], self._time, self.roles.state[:n]
        )

    def _stepper(self) -> None:
        request = self.request
        self.bdf = lib.core.sd_bdf_new(c.byref(self.system.core), self.linear)
        if not self.bdf:
            raise MemoryError
        self._atol = None if request.atol is None else np.full(self.system.unknowns, request.atol)
        bdf = self.bdf.contents
        bdf.max_order = request.max_order
        bdf.rtol, bdf.t_end = request.rtol, request.t_end
        bdf.h_max = request.h_max or LONGEST * (request.t_end - self.start.t)
        bdf.fixed_h = request.fixed_step or 0.0
        bdf.atol = lib.pointer(self._atol)
        bdf.magnitude = lib.pointer(self.magnitude)
        bdf.test, bdf.power = lib.pointer(self.roles.test), lib.pointer(self.roles.power)
        bdf.track = 1
        lib.core.sd_bdf_start(self.bdf, self.start.t, lib.pointer(self.y), lib.pointer(self.yd), 0.0)

    def _driver(self) -> None:
        request, system = self.request, self.system
        self.observed = system.observed_rows("observe")[1]
        self.width = lib.ROW_HEAD + 2 * self.observed
        self.run_ = lib.core.sd_run_new(
            self.bdf, self.settler.core, system.form.written, system.form.extended, self.observed
        )
        if not self.run_:
            raise MemoryError
        self._calls = {
            name: system.observer(name) for name in ("audit", "observe", "observe_rate", "observe_scale")
        }
        run = self.run_.contents
        for name, call in self._calls.items():
            setattr(run, name, None if call is None else c.addressof(call))
        self._audit_at = np.full(6, -1, dtype=np.int32)
        order = ("energy", "kinetic", "potential", "dissipated", "supplied", "constraints")
        for k in system.description.families_of("audit"):
            name = system.description.families[k].name.rsplit(".", 1)[-1]
            if name in order:
                self._audit_at[order.index(name)] = system.form.at[k]
        self._instants = np.ascontiguousarray(request.instants, dtype=np.float64)
        self._rows = np.zeros((max(64, min(ROOM, 1 << 24)) if self.width < 4096 else 64, self.width))
        kinds = request.instant_kinds
        self._kinds = np.ascontiguousarray(
            np.full(self._instants.size, TRACE) if kinds is None else kinds, dtype=np.int32
        )
        run.instant_kind = lib.pointer(self._kinds)
        run.start_rate = lib.pointer(self._start_rate)
        run.audit_at, run.instant = lib.pointer(self._audit_at), lib.pointer(self._instants)
        run.instants, run.every_step = self._instants.size, int(request.every_step)
        run.sample_steps = int(request.sample_steps)
        run.row, run.room = lib.pointer(self._rows), self._rows.shape[0]

    def _drain(self, sink: Sink) -> None:
        run = self.run_.contents
        if run.rows:
            sink(self._rows[: run.rows].copy())
            run.rows = 0

    def _failure(self, cause: str) -> SolverFailure:
        bdf = self.bdf.contents
        unknown: str | None = None
        row: RowLabel | None = None
        if cause in ("singular", "nonfinite") and 0 <= bdf.bad_row < self.system.rows:
            row = self.system.row_label(bdf.bad_row)
        if cause == "singular":
            unknown = self.system.name(bdf.bad_column)
        if cause in ("newton", "step_too_small", "error_test", "singular") and self.system.unknowns <= DENSE:
            # where the equations themselves are singular there, say so, with the place
            names, at = self._null_place()
            if names:
                return SolverFailure(
                    "singular", bdf.t, bdf.h, ", ".join(names[:3]), self.system.row_label(at)
                )
            cause = "newton" if cause == "singular" else cause
        if cause in ("error_test", "step_too_small", "newton"):
            unknown = self._worst()
        return SolverFailure(cause, bdf.t, bdf.h, unknown, row)

    def _null_place(self) -> tuple[tuple[str, ...], int]:
        """Unknowns and row of a singular pencil at the last accepted point; () where it is regular."""
        bdf, n = self.bdf.contents, self.system.unknowns
        y = lib.reader(bdf.phi[0], n).copy()
        yd = self.yd if bdf.steps == 0 else lib.reader(bdf.yd, n).copy()
        jy, jyd = self.system.jacobian(bdf.t, y, yd)
        if not (np.isfinite(jy).all() and np.isfinite(jyd).all()):
            return (), -1
        return null_place(self.system, jy, jyd)

    def _worst(self) -> str:
        """The unknown with the largest weighted correction in the last step."""
        bdf, n = self.bdf.contents, self.system.unknowns
        change = np.abs(lib.reader(bdf.ee, n) * lib.reader(bdf.weight, n))
        change = np.where(np.isfinite(change), change, np.inf)
        if (self.roles.test >= 0).any():
            change[self.roles.test < 0] = 0.0
        return self.system.name(int(np.argmax(change)))

    def largest(self) -> Floats:
        """Largest magnitude so far of each observed quantity and of the terms of its expression [observed]."""
        return lib.reader(self.run_.contents.largest, max(self.observed, 1))[: self.observed].copy()

    def statistics(self) -> Statistics:
        """Counters so far; residuals and Jacobians of the settling at output instants not included."""
        bdf, core = self.bdf.contents, self.system.core
        return Statistics(
            bdf.steps,
            bdf.rejected_steps,
            core.residual_evaluations,
            core.jacobian_evaluations,
            self.linear.contents.factorisations,
            bdf.newton_failures,
        )

    def run(self, sink: Sink, progress: Progress | None = None) -> Finished:
        """To the end, or SolverFailure; rows go to `sink` in any case, the time reached [s] to `progress`."""
        request, bdf = self.request, self.bdf.contents
        began = time.monotonic()
        self.system.core.residual_evaluations = self.system.core.jacobian_evaluations = 0
        while True:
            left = CHUNK_STEPS if request.max_steps is None else request.max_steps - bdf.steps
            before = time.process_time()
            state = lib.core.sd_run_advance(self.run_, min(CHUNK_STEPS, max(left, 1)), CHUNK_SECONDS)
            self.cpu += time.process_time() - before
            self._drain(sink)
            self.system.failure.check()
            self.settler.system.failure.check()
            if progress is not None:
                progress(bdf.t)
            if state == 1:
                break
            if state == 3:
                raise self._failure(lib.CAUSES[bdf.cause])
            if request.max_steps is not None and bdf.steps >= request.max_steps and bdf.t < request.t_end:
                raise self._failure("max_steps")
            if request.max_wall is not None and time.monotonic() - began > request.max_wall:
                raise self._failure("max_wall")
        return Finished(
            bdf.t,
            self.statistics(),
            self.magnitude[: self.system.form.written].copy(),
            self.largest(),
            self.cpu,
            self.settler.core.contents.failures,
        )

    def __del__(self) -> None:
        for name, free in (("run_", "sd_run_free"), ("bdf", "sd_bdf_free"), ("linear", "sd_linear_free")):
            if getattr(self, name, None):
                getattr(lib.core, free)(getattr(self, name))


def integrate(
    system: System,
    start: ConsistentState,
    request: Request,
    sink: Sink,
    progress: Progress | None = None,
) -> Finished:
    """One integration; see Request.  sink receives blocks of rows [k, ROW_HEAD + 2 observed] (core/run.h)."""
    return Integration(system, start, request).run(sink, progress)
