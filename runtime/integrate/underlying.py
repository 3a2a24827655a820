"""The underlying ordinary differential equation of a model, from its blocks (core/steppers/explicit/underlying.h).

`Underlying` owns the core's structure: the matrix [M A^T; A 0] as entries of dF/dy and dF/dy' of form 0, the rows of
the constraints in the places of their derivatives.  The equation exists where that matrix is regular
(`undetermined_unknowns` is empty): where coordinates without inertia are determined by constraints, and implicit
efforts by gammas.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.integrate.factors import Factors
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.forms import Planned
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.runtime.numerics.matching import match_rows
from sysdyn.runtime.numerics.ordering import Order, column_order
from sysdyn.runtime.numerics.rank import CERTAIN, count, singular_decomposition
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.levels import undifferentiated_families
from sysdyn.values import dataclass

SMALL = tuning.IN_THE_CORE
"""Unknowns up to which the core judges the matrix first (core/linear/dense/dense.h)."""
DENSE = tuning.DENSE
"""Unknowns up to which the matrix is judged by its singular values."""
NONE = np.zeros(0, dtype=np.int32)
_DERIVED = {"phi": "phi_acceleration", "phi_rate": "phi_acceleration", "psi": "psi_rate", "momentum": "momentum_rate"}
"""Block of a constraint -> block of form 0 in whose rows its residual stands in a projection."""


@dataclass(frozen=True, slots=True)
class Selection:
    """What of form 0 is solved for the slopes (core/steppers/explicit/underlying.h).

    unknown, rate [solved]; column [unknowns]; pattern, source, from_rate [entries] of the matrix, order of its columns;
    direct: it does not depend on what is solved for; silent: calls whose dF/dy does not stand in the matrix; applied:
    calls that are no reactions.
    """

    unknown: Ints
    rate: Ints
    column: Ints
    pattern: Pattern
    source: Ints
    from_rate: Ints
    order: Ints
    direct: bool
    silent: tuple[int, ...]
    applied: tuple[int, ...]


class Names(Sequence[str]):
    """Names of unknowns at places, with a prime where `rate` is not zero; each is made when it is read, for of a large
    model only the first are told.
    """

    def __init__(self, system: System, places: NDArray[np.integer], rate: NDArray[np.integer]) -> None:
        self._system, self._places, self._rate = system, places, rate

    def __len__(self) -> int:
        return int(self._places.size)

    def __getitem__(self, at: Any) -> Any:
        if isinstance(at, slice):
            return Names(self._system, self._places[at], self._rate[at])
        return self._system.name(int(self._places[at])) + "'" * int(self._rate[at] > 0)


def _solved_for(system: System) -> tuple[Ints, Ints, Ints]:
    """Unknown [solved], column [unknowns], rate [solved] of a Selection; flows without a rate are solved for."""
    # displacements are integrated, all others solved for
    unknown = np.flatnonzero(~system.are("q")).astype(np.int32)
    column = np.full(system.unknowns, -1, dtype=np.int32)
    column[unknown] = np.arange(unknown.size)
    # flows and momenta by second derivatives, dynamic variables by first
    rate = np.where(system.are("f", "p"), 2, np.where(system.are("s"), 1, 0)).astype(np.int32)
    read = system.structural()[1] & (system.pattern.row < system.form.kinematics + unknown.size)
    # flows whose rate stands nowhere
    rate[system.are("f") & ~system.differential(read.astype(float))] = 0
    return unknown, column, rate[unknown]


class _Parts:
    """The calls of a system in form "0" by what they serve: the matrix, the applied efforts, projections.

    calls: all, without slopes that do not stand in the matrix; direct: the matrix does not depend on what is solved
    for; applied, kept: those that are no reactions, and their number; position, velocity: rows of constraints.
    """

    def __init__(self, system: System, algebraic: NDArray[np.bool_]) -> None:
        number = len(system.form.calls)
        self.calls = (lib.Call * max(number, 1))()
        self.direct = True
        # blocks that give nothing to the matrix are evaluated without slopes
        for k, planned in enumerate(system.form.calls):
            self.calls[k] = system.calls[k]
            if not algebraic[system.slots_dy(k)].any():
                self.calls[k].n_dy = 0  # its slopes in y do not stand in the matrix
            elif not planned.block.endswith("_reaction"):
                self.direct = False
        # reactions are solved for, not applied
        kept = [k for k, planned in enumerate(system.form.calls) if not planned.block.endswith("_reaction")]
        self.kept = len(kept)
        self.applied = (lib.Call * max(len(kept), 1))(*(system.calls[k] for k in kept))
        self._keep: list[Any] = []
        # constraints of positions and velocities, for projection
        self.position = self._rows(system, "phi")
        self.velocity = self._rows(system, "phi_rate", "psi", "momentum")
        self.displaced = np.zeros(system.rows, dtype=np.int32)
        # rows whose constraint reads displacements
        for group, k, first in system.form.groups:
            if group == "phi_acceleration":
                self.displaced[first : first + system.description.rows[k].size] = 1

    def _rows(self, system: System, *blocks: str) -> lib.System | None:
        """Rows of constraints in the places of their derivatives; None where the model has none."""
        planned = {item.block: item for item in system.form.calls}
        found: list[tuple[str, Planned]] = [
            (block, planned[_DERIVED[block]])
            for block in blocks
            if block in system.description.blocks and _DERIVED[block] in planned
        ]
        if blocks == ("phi",):  # displacements meet constraints whose flows are solved for too
            home = {k: first for group, k, first in system.form.groups if group == "phi_acceleration"}
            found = [(block, replace(place, to=_at_home(place.to, home))) for block, place in found]
        # a model without such constraints
        if not found:
            return None
        # calls into the places of the derivatives
        calls = (lib.Call * len(found))()
        for k, (block, place) in enumerate(found):
            calls[k] = system.call(block, place.at, place.to, system.rows)
        self._keep.append(calls)
        return lib.System(
            unknowns=system.unknowns,
            rows=system.rows,
            calls=len(found),
            call=c.addressof(calls),
            stop=system.core.stop,
        )


def _at_home(to: Ints, home: Mapping[int, int]) -> Ints:
    """A table of places with those of these families."""
    return np.array([home.get(k, int(first)) for k, first in enumerate(to)], dtype=np.int32)


class Accelerations:
    """The matrix of the equation by its entries; system: form "0"."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._unknown, self._column, self._rate = system.once("solved for", lambda: _solved_for(system))
        (
            self._in_matrix, self._source, self._from_rate, self.pattern
        ) = system.once("selection", self._select)  # fmt: skip

    def _select(self) -> tuple[NDArray[np.bool_], Ints, Ints, Pattern]:
        """Which entries of dF/dy, dF/dy' stand in the matrix, where from, and its pattern."""
        # rows q' - f are solved by hand
        system = self.system
        pattern, first = system.pattern, system.form.kinematics
        columns = pattern.columns_of()
        in_y, in_rate = system.structural()
        counted = (pattern.row >= first) & (pattern.row < first + self._unknown.size)
        # a column of a rate takes dF/dy', any other dF/dy
        in_matrix = counted & (self._column[columns] >= 0)
        of_rate = (self._rate > 0)[self._column[columns]]
        take = in_matrix & np.where(of_rate, in_rate, in_y)
        source, from_rate = np.flatnonzero(take).astype(np.int32), of_rate[take].astype(np.int32)
        # sorted by columns already
        number = self._unknown.size
        start = np.searchsorted(self._column[columns[take]], np.arange(number + 1)).astype(np.int32)
        rows = (pattern.row[take] - first).astype(np.int32)
        return in_matrix, source, from_rate, Pattern(number, number, start, rows)

    @property
    def without_rate(self) -> NDArray[np.bool_]:
        """Flows that are solved for themselves [unknowns]."""
        found = np.zeros(self.system.unknowns, dtype=bool)
        found[self._unknown] = self._rate == 0
        return found & self.system.are("f")

    def _algebraic(self) -> NDArray[np.bool_]:
        """Entries of the matrix whose unknown is no rate [entries]."""
        return np.asarray((self._rate == 0)[self._column[self.system.pattern.columns_of()]] & self._in_matrix)

    def values(self, jy: Floats, jyd: Floats) -> Floats:
        """Entries of the matrix from those of dF/dy, dF/dy'."""
        return np.where(self._from_rate > 0, jyd[self._source], jy[self._source])

    def undetermined_unknowns(self, jy: Floats, jyd: Floats) -> Sequence[str]:
        """Unknowns, or x' for their derivatives, that the rows do not determine at a point; none where they do."""
        number = self.pattern.unknowns
        if number == 0:
            return ()
        # small and regular: the usual case
        if number <= SMALL and _regular(self.pattern, self.values(jy, jyd)):
            return ()
        # large: unknowns that no row can be matched with
        alone = _unmatched_unknowns(self.pattern) if number > DENSE else np.zeros(0)
        if alone.any():
            return self._largest(alone)
        # equilibrated: the null space does not depend on units
        matrix = _equilibrated_entries(self.pattern, self.values(jy, jyd))
        # large: by inverse iteration
        if number > DENSE:
            return self._largest(_sparse_null(self.pattern, matrix))
        full = np.zeros((number, number))
        full[self.pattern.row, self.pattern.columns_of()] = matrix
        # beyond the domain of a law
        if not np.isfinite(full).all():
            return ()
        _, sigma, vectors = singular_decomposition(full)
        null = vectors[count(sigma, CERTAIN) :]
        return self._largest(np.abs(null).max(axis=0) if null.size else np.zeros(number))

    def _largest(self, null: Floats) -> Names:
        """Names of the largest entries of a null vector."""
        places = np.flatnonzero(null > 1e-3 * null.max()) if null.any() else NONE
        return Names(self.system, self._unknown[places], self._rate[places])


class _Core:
    """The core's structure on one factorisation, kept with it from run to run: tables stay as they are
    for the system and the rows that it holds.
    """

    def __init__(self, system: System, linear: Any) -> None:
        self.system, self.held = system, system.held[0]
        self.at: Any = lib.core.sd_underlying_new(c.byref(system.core), linear)
        # no room in the core
        if not self.at:
            raise MemoryError

    def serves(self, system: System) -> bool:
        """Whether it is of this system and of the rows that it holds now."""
        return self.system is system and np.array_equal(self.held, system.held[0])

    def __del__(self) -> None:
        if getattr(self, "at", None):
            lib.core.sd_underlying_free(self.at)


class Underlying(Accelerations):
    """system: of `underlying_form`; magnitude [unknowns], kept and read by the core; factors: where the matrix has its
    factorisation from.
    """

    def __init__(self, system: System, magnitude: Floats, factors: Factors | None = None) -> None:
        super().__init__(system)
        self._magnitude = magnitude
        self._parts = system.own("parts", lambda: _Parts(system, self._algebraic()))
        self._order = system.once("order of accelerations", lambda: Order(column_order(self.pattern)))
        self._taken = (factors or Factors()).take(self.pattern, self._order)
        self.linear = self._taken.linear
        made = self._taken.made
        # the core's structure of a run before serves, if rows are held alike
        if made.beside is None or not made.beside.serves(system):
            made.beside = _Core(system, self.linear)
        self.core: Any = made.beside.at
        self._systems(self.core.contents)
        core = self.core.contents
        # which unknown each column is, and where entries come from
        core.unknown, core.rate, core.column = map(lib.pointer, (self._unknown, self._rate, self._column))
        core.source, core.from_rate = lib.pointer(self._source), lib.pointer(self._from_rate)
        core.magnitude, core.tolerance = lib.pointer(magnitude), 1e-14
        core.ready, core.drift = 0, 0.0  # of the run before

    def _systems(self, core: Any) -> None:
        """The core's own systems, as rows are held now."""
        parts, system = self._parts, self.system
        # slopes of all blocks, values without reactions
        self.matrix = lib.System.from_buffer_copy(system.core)
        self.matrix.call = c.addressof(parts.calls)
        self.applied = lib.System.from_buffer_copy(system.core)
        self.applied.call, self.applied.calls = c.addressof(parts.applied), parts.kept
        self.applied.kinematics = self.applied.k_spans = 0  # rows that nobody solves
        core.matrix, core.applied = c.addressof(self.matrix), c.addressof(self.applied)
        core.position, core.velocity = (item and c.addressof(item) for item in (parts.position, parts.velocity))
        core.direct, core.displaced = int(parts.direct), lib.pointer(parts.displaced)

    def switch(self) -> None:
        """Other rows are held now."""
        for copied in (self.matrix, self.applied):
            # copies are told which rows are held
            for name in ("held", "clear", "held_row", "held_unknown", "held_slot", "held_rate", "cleared"):
                setattr(copied, name, getattr(self.system.core, name))
        self._taken.made.beside.held = self.system.held[0]
        lib.core.sd_underlying_switched(self.core)

    @property
    def selection(self) -> Selection:
        """The tables of the core's structure."""
        calls = range(len(self.system.form.calls))
        return Selection(
            self._unknown,
            self._rate,
            self._column,
            self.pattern,
            self._source,
            self._from_rate,
            np.zeros(0, dtype=np.int32) if self._order.columns is None else self._order.columns,
            self._parts.direct,
            tuple(k for k in calls if self._parts.calls[k].n_dy == 0),
            tuple(k for k in calls if not self.system.form.calls[k].block.endswith("_reaction")),
        )

    @property
    def evaluations(self) -> tuple[int, int]:
        """Residuals and Jacobians evaluated beside those of the system itself."""
        return int(self.applied.residual_evaluations), int(self.matrix.jacobian_evaluations)

    def slopes(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats]:
        """y, yd [unknowns] completed from the state in y: q' = f, f', p', s', kappa, mu, e.  SolverFailure."""
        a, b = self.system._buffer(y), self.system._buffer(yd)
        self._answer(t, lib.core.sd_underlying_slopes(self.core, t, lib.pointer(a), lib.pointer(b)))
        return a[: self.system.unknowns], b[: self.system.unknowns]

    def project(self, t: float, y: Floats, yd: Floats) -> Floats:
        """Y [unknowns] with q, f, p on the constraints at t.  SolverFailure."""
        a, b = self.system._buffer(y), self.system._buffer(yd)
        self.core.contents.ready = 0
        self._answer(t, lib.core.sd_underlying_project(self.core, t, lib.pointer(a), lib.pointer(b)))
        return a[: self.system.unknowns]

    def _answer(self, t: float, cause: int) -> None:
        self.system.failure.check()
        # the core's cause, as that of a step
        if cause:
            raise SolverFailure(lib.CAUSES[cause], t, 0.0)


def underlying_form(system: System, state: ConsistentState) -> tuple[System, Sequence[str]]:
    """What is solved for the slopes, and what it leaves undetermined at a state; system: form "0".

    That system itself; where coordinates without inertia are in the way, one in which constraints stand as they are.
    """
    missing = obstacle(system, state)
    # constraints of massless coordinates as they are
    kept = system.once("undifferentiated", lambda: undifferentiated_families(system)) if missing else None
    if kept:
        other = system.another("0/" + ",".join(map(str, kept)))
        if not obstacle(other, state):
            return other, ()
    return system, missing


def rateless(system: System, state: ConsistentState) -> Sequence[str]:
    """What of form 0 has no rate at a state: flows solved for at each stage cost the explicit method its lead."""
    # flows that are solved for
    massless = Accelerations(system).without_rate
    if massless.any():
        places = np.flatnonzero(massless)
        return Names(system, places, np.zeros_like(places))
    return obstacle(system, state)


def obstacle(system: System, state: ConsistentState) -> Sequence[str]:
    """What keeps a model from having an underlying equation: unknowns not determined at a state.  system: form "0"."""
    y, yd = state.for_form(system)
    jy, jyd = system.jacobian(state.t, y, yd)
    return Accelerations(system).undetermined_unknowns(jy, jyd)


def _regular(pattern: Pattern, values: Floats) -> bool:
    """Whether a small matrix is certainly regular, or holds what is no number, of which nothing can be said."""
    arrays = lib.pointer(pattern.column), lib.pointer(pattern.row), lib.pointer(values)
    return int(lib.core.sd_regular(pattern.unknowns, *arrays, CERTAIN)) != 0


def _equilibrated_entries(pattern: Pattern, values: Floats) -> Floats:
    """The entries of the equilibrated matrix."""
    columns = pattern.columns_of()
    row, column = sparse_factors(pattern.row, columns, np.abs(values), (pattern.rows, pattern.unknowns))
    return values * row[pattern.row] * column[columns]


def _unmatched_unknowns(pattern: Pattern) -> NDArray[np.float64]:
    """1 for unknowns that no row is left for, whatever the values (a maximum matching of rows and columns), else 0.

    Round-off makes pivots of what is singular by structure: a line of 20000 sections passes for regular by its values.
    """
    return np.asarray(match_rows(pattern) < 0, dtype=np.float64)


def _sparse_null(pattern: Pattern, values: Floats) -> NDArray[np.float64]:
    """A null vector of a large matrix by inverse iteration; zeros where it is regular."""
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import splu

    shape = (pattern.unknowns, pattern.unknowns)
    matrix = csc_array((values, pattern.row, pattern.column), shape=shape)
    try:
        factors = splu(matrix)
    # exactly singular: next to it
    except RuntimeError:
        factors = splu((matrix + 1e-15 * eye_array(pattern.unknowns)).tocsc())
    # two steps towards the null vector
    x = factors.solve(factors.solve(np.ones(pattern.unknowns)), trans="T")
    x = factors.solve(x / np.abs(x).max())
    large = np.abs(x).max()
    return np.abs(x) / large if large * CERTAIN > 1.0 or not np.isfinite(large) else np.zeros(pattern.unknowns)
