"""The settled system: every row that holds at a consistent point, and its least-change projection in the core.

Unknowns x = (y as written, the derivatives that occur); see core/system/settle.h.  `Settler` owns the core's structure.
"""

from __future__ import annotations

import ctypes as c
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core, tuning
from sysdyn.runtime.condense.condensed import CondensedSystem
from sysdyn.runtime.condense.elimination import affine
from sysdyn.runtime.condense.sums import numbers_of
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.inertia import stored_between
from sysdyn.runtime.model.layout import entries_of
from sysdyn.runtime.model.own_rows import own_rows, own_rows_of_rates
from sysdyn.runtime.model.patterns import Pattern, Places, compress
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.ordering import Order, tall_order
from sysdyn.runtime.numerics.saddle import saddle_order
from sysdyn.runtime.numerics.tall import free_unknowns

LATER = 2000
"""Unknowns and rates from which the saddle-point matrix is made where a basis is not enough, not before: of a net its
order of elimination alone costs what a pivoting does."""
FREE = tuning.SLIGHT
"""Weight (of squares: its square) of unknowns that follow from the state."""
RATES = ("momentum_rate", "gamma_rate", "gamma_acceleration", "dynamics_rate")
DIFFERS: int = _core.SD_DIFFERS
"""SD_DIFFERS (core/system/settle.h): an unknown whose differences from others are of the state."""
LEFT_OUT: int = _core.SD_LEFT_OUT
"""SD_LEFT_OUT (core/system/settle.h): a row that no point is asked to meet."""
HELD = 1.0 / tuning.HALF_OF_ITS_DIGITS
"""Weight (of squares) of a state that moves only where the rows leave nothing else."""


def rates_of(settled: System) -> Ints:
    """Places of y whose derivatives occur in the settled rows."""
    return settled.once("rates", lambda: _rates(settled))


def columns_of_rates(unknowns: int, rates: Ints, columns: Ints) -> Ints:
    """Columns of dF/dy' in a matrix with the rates behind the unknowns; -1: not among them."""
    found = np.full(unknowns, -1, dtype=np.int32)
    found[rates] = unknowns + np.arange(rates.size, dtype=np.int32)
    return found[columns]


def _rates(settled: System) -> Ints:
    used = np.zeros(settled.unknowns, dtype=bool)
    pattern = settled.pattern
    # rates that stand in rows of this form
    for call in settled.form.calls:
        used[entries_of(settled.description, call)[1].column] = True
    assert pattern.unknowns == settled.unknowns
    return np.flatnonzero(used).astype(np.int32)


def inertial_rows(settled: System) -> NDArray[np.bool_]:
    """Rows [rows] that hold a rate of inertia, balances among them.  A momentum that nothing moves with is none."""
    pattern, momentum = settled.pattern, settled.of_groups("momentum")
    in_y, in_rate = settled.structural()
    columns = pattern.columns_of()
    # a momentum by itself has no inertia
    alone = in_y & momentum[pattern.row]
    alone &= (np.bincount(pattern.row[alone], minlength=settled.rows) == 1)[pattern.row]
    found = np.zeros(settled.rows, dtype=bool)
    found[pattern.row[in_rate & ~np.isin(columns, columns[alone])]] = True
    return found


def inertial_rates(settled: System) -> NDArray[np.bool_]:
    """Rows [rows] that are rates of balances with inertia: a point does not know them."""
    inertial, groups = inertial_rows(settled), settled.form.groups
    balances = {family: first for group, family, first in groups if group == "dynamics"}
    mask = np.zeros(settled.rows, dtype=bool)
    # rates of balances by the rows of these
    for group, family, first in groups:
        if group == "dynamics_rate":
            own, size = balances[family], settled.description.rows[family].size
            mask[first : first + size] = inertial[own : own + size]
    return mask


def flows_open(
    settled: System, t: float, y: Floats, yd: Floats, state: NDArray[np.bool_], *, turning: bool = False
) -> bool:
    """Whether settled rows leave a flow open that carries no state [unknowns]: in loops of stores it follows from the
    rate of their balance (form "rated").  Asked once of a text, at a point y, yd [unknowns as written].  turning: laws
    may be flat elsewhere (a damper with a dead zone), and are asked for no flow.
    """
    return settled.once(("flows open", turning), lambda: _flows_open(settled, t, y, yd, state, turning))


def _flows_open(settled: System, t: float, y: Floats, yd: Floats, state: NDArray[np.bool_], turning: bool) -> bool:
    flows = (settled.kinds == "f") & ~state
    # what laws that may turn leave open
    open_ = _open(settled, (t, y, yd), state, flows if turning else np.zeros_like(flows))
    return open_ is None or bool(open_[: settled.unknowns][flows].any())


def _open(
    settled: System, point: tuple[float, Floats, Floats], state: NDArray[np.bool_], untold: NDArray[np.bool_]
) -> NDArray[np.bool_] | None:
    """What settled rows leave open at a point [unknowns, rates]; untold [unknowns]: what laws may be flat for.  None
    where that cannot be said.
    """
    (jy, jyd), pattern, rates = settled.jacobian(*point), settled.pattern, rates_of(settled)
    n, columns = settled.unknowns, pattern.columns_of()
    # laws that may be flat say nothing
    if untold.any():
        laws = settled.of_groups("dynamics", "gamma", "gamma_rate") & ~affine(settled)
        jy = np.where(laws[pattern.row] & untold[columns], 0.0, jy)
    moved = columns_of_rates(n, rates, columns)
    # unknowns that do not carry the state, and rates
    free, rated = ~state[columns], moved >= 0
    i = np.concatenate([pattern.row[free], pattern.row[rated]])
    j = np.concatenate([columns[free], moved[rated]])
    v = np.concatenate([jy[free], jyd[rated]])
    if not np.isfinite(v).all():
        return None
    return free_unknowns((settled.rows, n + rates.size), (i, j, v))


def values_told(
    valued: System, settled: System, point: tuple[float, Floats, Floats], state: NDArray[np.bool_], read: frozenset[int]
) -> bool:
    """Whether what follows from the state, its rates, and those of the families that are read follow from the rows of
    form "valued" as from those of "settled".  Asked once of a text, at a point t, y, yd [unknowns as written].
    """
    return valued.once(("values told", read), lambda: _values_told(valued, settled, point, state, read))


def _values_told(
    valued: System, settled: System, point: tuple[float, Floats, Floats], state: NDArray[np.bool_], read: frozenset[int]
) -> bool:
    """Whether rows of values alone tell at a point all that is read, besides the state."""
    # the same rows: nothing is saved
    if valued.rows == settled.rows:
        return False
    n, told, rates = valued.unknowns, rates_of(valued), rates_of(settled)
    wanted = np.zeros(n, dtype=bool)
    wanted[settled.pattern.columns_of()[settled.structural()[0]]] = True
    moving = state | np.isin(settled.family_of, list(read))
    open_ = _open(valued, point, state, np.zeros(n, dtype=bool))
    # something that is read stays open
    if open_ is None or open_[:n][wanted & ~state].any():
        return False
    return bool(np.isin(rates[moving[rates]], told).all() and not open_[n:][moving[told]].any())


class Settler:
    """Moves points onto the settled rows.

    settled: the System in form "settled"; kinematics: `Form.k_span` of the runs; magnitude [unknowns] of y;
    rate_magnitude [rates]; state [unknowns] bool: unknowns that carry the state and should move least.  condensed: what
    is left of the settled form; the other unknowns follow.  common [unknowns]: groups of which differences alone are
    states (`Roles.common`).
    """

    def __init__(
        self,
        settled: System,
        kinematics: Ints,
        magnitude: Floats,
        time_scale: float,
        state: NDArray[np.bool_],
        condensed: CondensedSystem | None = None,
        common: Ints | None = None,
    ) -> None:
        self.system, self._points = settled, settled.unknowns
        # all unknowns, or what is left of them
        self._left = settled if condensed is None else condensed
        self.rates = rates_of(settled) if condensed is None else condensed.rates
        if condensed is not None:
            magnitude, state = magnitude[condensed.kept], state[condensed.kept]
        n, k = self._left.unknowns, int(self.rates.size)
        self._n, self._moves = n, n + k
        self.pattern: Pattern
        self._key: tuple[object, ...] = () if condensed is None else condensed.key
        self._sort = settled.once(("sorts", *self._key), self._sorts)
        self._state = np.zeros(self._moves, dtype=np.bool_)
        self._state[:n] = state
        self._part = self._state.astype(np.int8)
        self._pairs = self._between = np.zeros((0, 2), dtype=np.int32)
        # groups by their differences
        if common is not None and (common >= 0).any():
            self._by_differences(common, np.arange(n, dtype=np.int32) if condensed is None else condensed.kept)
        self._kinematics = kinematics
        self.scale, self._time = np.concatenate([magnitude, magnitude[self.rates] / time_scale]), time_scale
        self.linear: Any = None
        # of a large one factors are found when they are wanted
        if self._moves <= LATER:
            self._provide()
        self._allocate()

    def _by_differences(self, common: Ints, kept: Ints) -> None:
        """Of groups whose members are all kept the differences over each store carry the state."""
        # groups that lose a member are none
        gone = np.delete(common, kept)
        common = np.where(np.isin(common, gone), np.int32(-1), common)
        place = numbers_of(common.size, kept)
        self._between = stored_between(self.system, common)
        self._pairs = np.ascontiguousarray(place[self._between], dtype=np.int32)
        self._part[: self._n][common[kept] >= 0] = DIFFERS

    def of_state(self, change: Floats) -> Floats:
        """How far the state has moved at each unknown [unknowns as written] by a change of these: where differences
        carry it, the largest of them.
        """
        found = np.abs(change)
        # pairs by their difference, both ways
        found[self._between] = 0.0
        for one, other in (self._between.T, self._between.T[::-1]):
            np.maximum.at(found, one, np.abs(change[one] - change[other]))
        return found

    def alone(self, state: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Of a state [unknowns as written] what carries it by itself."""
        found = state.copy()
        found[self._between] = False
        return found

    def _saddle(self) -> tuple[Pattern, list[Ints]]:
        """Pattern of [D G^T; G -eps] and the places of the parts."""
        pattern, n = self._left.pattern, self._n
        number = self._moves + self._left.rows
        # entries by values and by rates, with their transposes
        columns, rows = pattern.columns_of(), pattern.row
        moved = columns_of_rates(n, self.rates, columns)
        with_rate = moved >= 0
        x, r = rows + self._moves, columns
        xd, rd = rows[with_rate] + self._moves, moved[with_rate]
        diagonal_x, diagonal_r = np.arange(self._moves), self._moves + np.arange(self._left.rows)
        parts = [
            Places(x, r),
            Places(r, x),
            Places(xd, rd),
            Places(rd, xd),
            Places(diagonal_x, diagonal_x),
            Places(diagonal_r, diagonal_r),
            Places(*self._pairs.T),
            Places(*self._pairs.T[::-1]),
        ]
        found, slots = compress(number, number, parts)
        # entries without a rate have no place
        for k in (2, 3):
            full = np.full(pattern.entries, -1, dtype=np.int32)
            full[with_rate] = slots[k]
            slots[k] = full
        return found, slots

    @property
    def holding(self) -> NDArray[np.bool_]:
        """Rows [rows] that a settled point meets."""
        found: NDArray[np.bool_] = self._sort[: self._left.rows] != LEFT_OUT
        return found

    def _sorts(self) -> Ints:
        """Of the rows, as core/system/settle.h names them: constraints, rates of other rows, others, left out."""
        found = np.zeros(max(self.system.rows, 1), dtype=np.int32)
        # constraints, rates, all else
        for group, family, first in self.system.form.groups:
            sort = 1 if group in ("phi", "phi_rate", "psi") else 2 if group in RATES else 0
            found[first : first + self.system.description.rows[family].size] = sort
        # rates of inertia are unknown at a point
        if self.system.form.name == "rated":
            found[: self.system.rows][inertial_rates(self.system)] = LEFT_OUT
        return found if isinstance(self._left, System) else found[self._left.kept_rows]

    def _provide(self) -> None:
        """The factors of the saddle-point matrix, and where its parts stand."""
        self.pattern, self._slots = self.system.once(("saddle", *self._key, self._pairs.tobytes()), self._saddle)
        self._order = self.system.once(("saddle order", *self._key, self._state.tobytes()), self._saddle_order)
        self.linear = self._order.linear(self.pattern)

    def _saddle_order(self) -> Order:
        """The order in which the saddle-point matrix is eliminated: pivots by rows that tell what follows."""

        def own() -> Ints:
            """Rows that tell what follows from the state."""
            unknowns, rates = own_rows(self.system), own_rows_of_rates(self.system)
            # of all unknowns; of a condensed form by places of what is kept
            if not isinstance(self._left, CondensedSystem):
                return np.concatenate([unknowns, rates[self.rates]])
            kept = self._left.kept
            row = np.append(numbers_of(self.system.rows, self._left.kept_rows), -1).astype(np.int32)
            told: Ints = row[np.concatenate([unknowns[kept], rates[kept[self.rates]]])]
            return told

        return saddle_order(self.pattern, self._state, own)

    def _placed(self) -> None:
        """What the core is told of them."""
        names = ("slot_y", "slot_y_t", "slot_yd", "slot_yd_t", "slot_x", "slot_r", "slot_pair", "slot_pair_t")
        for name, slot in zip(names, self._slots, strict=True):
            setattr(self.core.contents, name, lib.pointer(slot))

    def _provided(self) -> Callable[[], int]:
        """A callback that finds the factors when the core first wants them; where a basis is enough it never does."""
        own = weakref.ref(self)

        def provide() -> int:
            # gone meanwhile: nothing to provide
            settler = own()
            if settler is None:
                return 1
            settler._provide()
            settler._placed()
            return int(lib.core.sd_settle_take(settler.core, settler.linear))

        return provide

    def _allocate(self) -> None:
        """Makes the core's structure, with places and factors, or with what provides them later."""
        self.core = lib.core.sd_settle_new(c.byref(self._left.core), self.linear, int(self.rates.size))
        if not self.core:
            raise MemoryError
        core = self.core.contents
        core.state, core.follows, core.time = lib.pointer(self._part), FREE**2, self._time
        core.rate = lib.pointer(self.rates)
        core.pair, core.pairs = lib.pointer(self._pairs), len(self._pairs)
        # factors are provided when the core asks for them
        if self.linear is None:
            self._wanted = lib.PROVIDE(self._provided())
            core.provide = c.cast(self._wanted, c.c_void_p)
        else:
            self._placed()
        core.sort = lib.pointer(self._sort)
        core.k_span, core.k_spans = lib.pointer(self._kinematics), len(self._kinematics)
        lib.reader(core.scale, self._moves)[:] = self.scale
        if self._moves > LARGE:  # the core has its own
            self.scale = self.scale[:0].copy()

    def _basis(self) -> Ints:
        """The order of the columns of G^T."""
        pattern = self._left.pattern
        columns, rows = pattern.columns_of(), pattern.row
        moved = columns_of_rates(self._n, self.rates, columns)
        with_rate = moved >= 0
        # G^T by values, then by rates
        parts = [Places(columns, rows), Places(moved[with_rate], rows[with_rate])]
        return tall_order(compress(self._moves, self._left.rows, parts)[0])

    def by_basis(self, slack: float, *, determined: bool) -> None:
        """Points settle within a basis where the state moves by no more than slack, in magnitudes (settle.h).

        determined: only where it leaves nothing open that follows from the state.
        """
        self._wide = self.system.once(("basis", *self._key), self._basis)
        if lib.core.sd_settle_widen(self.core, lib.pointer(self._wide), int(determined)):
            raise MemoryError
        self.core.contents.slack = slack

    def rest(self) -> None:
        """Of a large system: lets go of the room for a point."""
        lib.core.sd_settle_rest(self.core)

    def left_of(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Of a mask of the settled rows those that are left where some unknowns follow from others."""
        return mask[self._left.kept_rows] if isinstance(self._left, CondensedSystem) else mask

    @property
    def address(self) -> int:
        """Of the core's structure."""
        return c.addressof(self.core.contents)

    def settle(self, t: float, y: Floats, yd: Floats, *, hold: float = 1.0) -> tuple[Floats, Floats, bool]:
        """y, yd [unknowns as written] moved onto the rows; False where that failed (then they are as given).

        hold: times the weight of the state; HELD moves it only where the rows leave nothing else.
        """
        self.core.contents.hold = hold
        # the core works in place
        a, b = self.system._buffer(y), self.system._buffer(yd)
        failed = lib.core.sd_settle_point(self.core, t, lib.pointer(a), lib.pointer(b))
        self.core.contents.hold = 1.0
        self.system.failure.check()
        return a[: self._points], b[: self._points], not failed

    def moved(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats, bool]:
        """`settle` to round-off, though the state must move for it: not within a basis that leaves it where it is."""
        core = self.core.contents
        basis, enough = core.basis, core.enough
        core.basis, core.enough, core.ready = None, 0.0, 0
        found = self.settle(t, y, yd)
        core.basis, core.enough, core.ready = basis, enough, 0
        return found

    @contextmanager
    def exactly(self) -> Iterator[None]:
        """Points settle to round-off meanwhile, in a draft too: behind a jump what is left over moves the state."""
        # what was factored belongs to another accuracy
        core = self.core.contents
        enough, core.enough = core.enough, 0.0
        core.ready = 0
        try:
            yield
        finally:
            core.enough = enough

    def held(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats, bool]:
        """`settle` with the state where it is: of large ones within a basis that moves none of it, if there is one."""
        # small, or without a basis: by weights
        if self._moves <= LARGE or self.linear is not None or not self.core.contents.basis:
            return self.settle(t, y, yd, hold=HELD)
        # a basis that leaves the state alone
        slack, self.core.contents.slack = self.core.contents.slack, 0.0
        found = self.settle(t, y, yd)
        self.core.contents.slack = slack
        return found

    def __del__(self) -> None:
        if getattr(self, "core", None):
            lib.core.sd_settle_free(self.core)
        if getattr(self, "linear", None):
            lib.core.sd_linear_free(self.linear)
