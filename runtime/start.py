"""A consistent state at t0 from fixed values and guesses.

Unknowns: y as written and the derivatives that the settled rows read; equations: all settled rows (as written,
phi_rate, phi_acceleration, psi_rate, momentum_rate, gamma_rate) and the block `initial`.  Fixed values never move.
Guesses move least: each step is the minimum-norm solution of the linearised rows around the *guess* (Gauss-Newton,
in unknowns scaled by magnitude, rank-deficient rows tolerated).  Stages: positions onto phi and what else holds between
them, then flows and momenta onto the first derivatives, then everything.  Where the rows are singular at the guess (a
valve C f|f| at rest), seeded perturbations of the free unknowns are tried.

Where contents of stores follow from several coordinates, each has a row of block `initial` and an unknown of its own,
what the row misses; these are what moves least, and the coordinates follow.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.description import Floats, Ints
from sysdyn.runtime.failures import InconsistentStart, RowLabel
from sysdyn.runtime.least_change import DENSE, Problem, Solution, least_residual, solve, where_light
from sysdyn.runtime.scales import alike, group_maximum, propagate
from sysdyn.runtime.settled import rates_of
from sysdyn.runtime.system import System

Mask = NDArray[np.bool_]
Places = NDArray[np.integer]
STATE = ("q", "f", "p", "s")
_WEIGHT = {"written": 1.0, "unwritten": 1e-3, "following": 1e-6}
_AMPLITUDES = (1e-2, 1e-1, 1.0, 1e-4, 10.0, 1e-6, 1e2, 1e-1, 1.0, 10.0)
_RESCALINGS = 6
_FEW = 3
"""Iterations that show whether what follows from the state is enough: rows that are linear in it take one."""
EXACT = 1e-9
OWN = 1e-6
NOISE = 1e-13
BACK = 1e-9


@dataclass(frozen=True, slots=True)
class ConsistentState:
    """y, yd [unknowns as written] at t; residual: largest scaled row.

    moved: (name, guess, value, "asked for by ...") of written guesses that moved.  freedom: how many more
    fixed values the state would take, guesses: names of the free unknowns among which.
    """

    t: float
    y: Floats
    yd: Floats
    moved: tuple[tuple[str, float, float, str], ...]
    residual: float
    freedom: int
    guesses: tuple[str, ...]

    def for_form(self, system: System) -> tuple[Floats, Floats]:
        """y, yd in the layout of an index form: new multipliers are zero."""
        y, yd = np.zeros(system.unknowns), np.zeros(system.unknowns)
        y[: self.y.size], yd[: self.y.size] = self.y, self.yd
        return y, yd


@dataclass(frozen=True, slots=True)
class _Given:
    """The initial values on y: guess [unknowns], fixed and written masks, label of each written one."""

    guess: Floats
    fixed: Mask
    written: Mask
    label: Mapping[int, RowLabel]


def _given(system: System) -> _Given:
    n = system.form.written
    guess, fixed, written = np.zeros(n), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    label: dict[int, RowLabel] = {}
    for item in sorted(system.description.initial, key=lambda item: item.fixed):
        places = system.form.at[item.family] + item.positions
        known = np.where(fixed[places], guess[places], item.values)
        guess[places] = item.values
        for held in (known, guess[places]) if item.fixed else ():  # said before, and twice by the statement itself
            apart = np.abs(held - item.values)
            wrong = np.flatnonzero(apart > 1e-12 * np.maximum(np.abs(held), np.abs(item.values)))
            if wrong.size:
                place = int(places[wrong[0]])
                labels = (label.get(place, item.label), item.label)
                raise InconsistentStart("fixed", float(apart[wrong[0]]), (), labels, (system.name(place),))
        fixed[places] |= item.fixed
        written[places] = True
        label.update(dict.fromkeys(places.tolist(), item.label))
    return _Given(guess, fixed, written, label)


def _of_groups(system: System, names: Sequence[str]) -> Mask:
    mask = np.zeros(system.rows, dtype=bool)
    for group, family, first in system.form.groups:
        if group in names:
            mask[first : first + system.description.rows[family].size] = True
    return mask


def _pairs(system: System) -> tuple[Ints, Ints]:
    """Places of momenta, and of the flows of the same coordinates."""
    families, at = system.description.families, system.form.at
    flows = {f.owner: k for k, f in enumerate(families) if f.kind == "f"}
    found = [(at[k] + np.arange(f.size), at[flows[f.owner]]) for k, f in enumerate(families) if f.kind == "p"]
    nothing = np.zeros(0, dtype=np.int64)
    momenta = np.concatenate([nothing, *(places for places, _ in found)])
    return momenta, np.concatenate([nothing, *(places - places[:1] + first for places, first in found)])


@dataclass(frozen=True, slots=True)
class _Sums:
    """Rows [k] that hold weights [k, n] times the rows `of` [n] instead; entries of these, and the n of each."""

    rows: Places
    of: Places
    weights: Floats
    entries: Places
    place: Places


class Starter:
    """The equations of the start of one model (t0 apart).

    measuring: where contents of stores are guessed, guessed expressions hold but for an unknown of their own each,
    behind those of y and its rates; sums of balances without inertia have their rates.
    """

    def __init__(self, system: System, *, measuring: bool = False) -> None:
        self.system = system
        self.settled = system.another("start")
        self.rates = rates_of(self.settled)
        self.given = _given(system)
        self.n = system.form.written
        self._momenta = _of_groups(system, ("momentum",))
        self.guessed, self.unsaid = self._guessed()
        starting, measuring = measuring, measuring and bool(self.unsaid.any())
        self.missed = np.flatnonzero(self.guessed & measuring)
        unsettled = self._unsettled()
        self.every = ~unsettled  # rows that must hold
        if not measuring:
            self.every &= ~self.guessed
        self.kinds = system.kinds[: self.n]
        pattern = self.settled.pattern
        columns = pattern.columns_of()
        rate_at = np.full(self.n, -1, dtype=np.int64)
        rate_at[self.rates] = self.n + np.arange(self.rates.size)
        self._rated = rate_at[columns] >= 0
        self.first = self.n + self.rates.size  # place of the first that is missed
        places = self.first + np.arange(self.missed.size)
        self.rows = np.concatenate([pattern.row, pattern.row[self._rated], self.missed]).astype(np.int64)
        self.columns = np.concatenate([columns, rate_at[columns[self._rated]], places])
        self._momentum, self._flow = _pairs(system)
        in_y, in_rate = self.settled.structural()
        self._structural = np.concatenate([in_y, in_rate[self._rated], np.ones(self.missed.size, dtype=bool)])
        self._sums = self._floating(np.flatnonzero(unsettled)) if starting else None
        if self._sums is not None:
            self.every[self._sums.rows] = True
            self.rows = np.concatenate([self.rows, np.repeat(self._sums.rows, self._sums.entries.size)])
            columns = self.columns[self._sums.entries]
            self.columns = np.concatenate([self.columns, np.tile(columns, self._sums.rows.size)])
            more = self._structural[self._sums.entries]
            self._structural = np.concatenate([self._structural, np.tile(more, self._sums.rows.size)])
        self.units = self._units()
        self._family = np.unique(self.units, return_inverse=True)[1].astype(np.int64)
        kinds = alike(system)
        largest = kinds.max(initial=0) + 1
        self._alike = np.concatenate([kinds[: self.n], largest + kinds[self.rates], 2 * largest + self._family])
        self.written = np.concatenate(
            [self.given.written, np.zeros(self.rates.size, dtype=bool), ~self.unsaid[self.missed]]
        )
        self.measured = self._measured()
        self.idle = self._idle()
        self.moving = np.concatenate([self.kinds, np.full(self.rates.size, "rate"), np.full(self.missed.size, "")])
        self.moving[self.first :] = self._read()

    def expand(self, x: Floats) -> tuple[Floats, Floats]:
        """y, yd of x = (y, chosen derivatives)."""
        y, yd = x[: self.n].copy(), np.zeros(self.n)
        yd[self.rates] = x[self.n : self.first]
        form = self.system.form
        yd[form.k_q] = y[form.k_f]
        return y, yd

    def residual(self, t: float, x: Floats) -> Floats:
        """All rows [rows]."""
        rows = self.settled.residual(t, *self.expand(x))
        rows[self.missed] -= x[self.first :]
        if self._sums is not None:
            rows[self._sums.rows] = self._sums.weights @ rows[self._sums.of]
        return rows

    def jacobian(self, t: float, x: Floats) -> Floats:
        """Values at (self.rows, self.columns)."""
        jy, jyd = self.settled.jacobian(t, *self.expand(x))
        values = np.concatenate([jy, jyd[self._rated], np.full(self.missed.size, -1.0)])
        if self._sums is None:
            return values
        summed = self._sums.weights[:, self._sums.place] * values[self._sums.entries]
        values[self._sums.entries] = 0.0
        return np.concatenate([values, summed.ravel()])

    def groups(self, *names: str) -> Mask:
        """Rows of the named groups."""
        return _of_groups(self.settled, names)

    def between(self, kinds: Sequence[str]) -> Mask:
        """Rows that hold between unknowns of these kinds alone: initial conditions; balances between positions."""
        outside = ~np.isin(self.moving, kinds)
        mask = self.groups("initial", *(["dynamics"] if kinds == ("q",) else [])) & self.every
        mask[self.rows[self._structural & outside[self.columns]]] = False
        return mask

    def _guessed(self) -> tuple[Mask, Mask]:
        """Rows of block initial that are guesses, and those of them that no text says."""
        guessed, unsaid = (np.zeros(self.settled.rows, dtype=bool) for _ in range(2))
        for group, family, first in self.settled.form.groups:
            rows = self.settled.description.rows[family]
            if group == "initial" and not rows.fixed:
                guessed[first : first + rows.size] = True
                unsaid[first : first + rows.size] = not rows.written
        return guessed, unsaid

    def _floating(self, unsettled: Places) -> _Sums | None:
        """Sums of balances with inertia that read none: nothing but differences of their flows stand in T*.

        They are taken from the matrix of inertia at two points: what moves with the state is left out.
        """
        if not unsettled.size or self.n > DENSE:
            return None
        matrix = np.hstack([self._inertia(unsettled, shift) for shift in (0.0, 0.1)])
        if not np.isfinite(matrix).all():
            return None
        size = np.abs(matrix).max(axis=0)
        left, sigma, _ = np.linalg.svd(matrix / np.where(size > 0.0, size, 1.0))
        weights = left[:, int((sigma > 1e-10 * sigma.max(initial=0.0)).sum()) :].T
        if not weights.size:
            return None
        number = np.full(self.settled.rows, -1, dtype=np.int64)
        number[unsettled] = np.arange(unsettled.size)
        entries = np.flatnonzero(number[self.rows] >= 0)
        return _Sums(unsettled[: len(weights)], unsettled, weights, entries, number[self.rows[entries]])

    def _inertia(self, unsettled: Places, shift: float) -> Floats:
        """The matrix of inertia beside a state [dynamics_rate rows, flows]: of f' in the balances, of f in momenta."""
        form, families = self.settled.form, self.settled.description.rows
        first = {(group, families[k].owner): place for group, k, place in form.groups}
        y = self.given.guess + shift * (1.0 + np.abs(self.given.guess)) * np.cos(np.arange(self.n))
        jy, jyd = self.settled.jacobian(0.0, y, np.zeros(self.n))
        matrix = np.zeros((self.settled.rows, self.n))
        pattern = self.settled.pattern
        columns = pattern.columns_of()
        flows = (self.kinds == "f")[columns]
        np.add.at(matrix, (pattern.row[flows], columns[flows]), jyd[flows])
        carried = flows & self.groups("momentum")[pattern.row]
        np.add.at(matrix, (pattern.row[carried], columns[carried]), -jy[carried])
        found = np.zeros((unsettled.size, self.n))
        for group, k, place in form.groups:
            if group != "dynamics_rate":
                continue
            mine = np.flatnonzero((unsettled >= place) & (unsettled < place + families[k].size))
            for base in ("dynamics", "momentum"):
                at = first.get((base, families[k].owner))
                if at is not None:
                    found[mine] += matrix[at + unsettled[mine] - place]
        return found

    def _units(self) -> list[str]:
        """The unit of what each guess misses."""
        found = [""] * self.settled.rows
        for group, family, first in self.settled.form.groups:
            rows = self.settled.description.rows[family]
            if group == "initial":
                found[first : first + rows.size] = [rows.unit] * rows.size
        return [found[row] for row in self.missed]

    def _measured(self) -> Mask:
        """Unknowns of y that the contents of stores measure; a momentum with its flow."""
        mask = np.zeros(self.n, dtype=bool)
        own = self._structural & np.isin(self.rows, self.missed) & (self.columns < self.n)
        mask[self.columns[own]] = True
        mask[self._momentum] |= mask[self._flow]
        return mask

    def by_content(self, t: float, x: Floats, scale: Floats) -> Floats:
        """Weights of guesses that are not written: contents of one unit are measured alike, flows by their momenta."""
        families, form = self.system.description.families, self.system.form
        flows = {f.owner: form.at[k] for k, f in enumerate(families) if f.kind == "f"}
        own = np.full(self.system.rows, -1, dtype=np.int64)
        effort: dict[str, str] = {}
        for group, family, first in form.groups:
            rows = self.system.description.rows[family]
            if group == "dynamics" and rows.owner in flows:
                effort[rows.owner] = rows.unit
                own[first : first + rows.size] = flows[rows.owner] + np.arange(rows.size)
        units = [effort.get(f.owner, "") if f.kind in ("f", "p") else f.unit for f in families]
        own_units = np.array(units)[self.system.family_of[: self.n]]
        names = np.concatenate([own_units, np.full(self.rates.size, ""), self.units])
        pattern = self.system.pattern
        inertia = pattern.columns_of() == own[pattern.row]
        content = np.zeros(x.size)
        content[pattern.columns_of()[inertia]] = np.abs(self.system.jacobian(t, *self.expand(x))[1][inertia])
        content = np.where(content > 0.0, content, 1.0)
        _, unit = np.unique(names, return_inverse=True)
        largest = np.zeros(int(unit.max()) + 1)
        np.maximum.at(largest, unit, content * scale)
        return np.asarray(_WEIGHT["unwritten"] * content * scale / largest[unit])

    def _idle(self) -> Mask:
        """Displacements that stand in constraints alone and move without inertia: they hold nothing."""
        form, inertial = self.system.form, np.zeros(self.system.unknowns, dtype=bool)
        inertial[self.system.pattern.columns_of()[self.system.structural()[1]]] = True
        inertial[self._flow] = True
        held = np.zeros(self.first + self.missed.size, dtype=bool)
        held[form.k_q] = ~self.given.written[form.k_q] & ~inertial[form.k_f]
        held[self.columns[self._structural & ~self.groups("phi")[self.rows]]] = False
        return held

    def _read(self) -> NDArray[np.str_]:
        """The kind of unknowns that each guess is of; none where it is of several."""
        found = np.full(self.settled.rows, "", dtype=self.moving.dtype)
        many = np.zeros(self.settled.rows, dtype=bool)
        read = self._structural & (self.columns < self.first)
        for kind in np.unique(self.moving[: self.first]):
            rows = self.rows[read & (self.moving[self.columns] == kind)]
            many[rows] |= found[rows] != ""
            found[rows] = kind
        return np.where(many, "", found)[self.missed]

    def _unsettled(self) -> Mask:
        """Rates of balances with inertia: the start does not know them.  A momentum that nothing moves with is none."""
        pattern = self.settled.pattern
        in_y, in_rate = self.settled.structural()
        columns = pattern.columns_of()
        alone = in_y & self.groups("momentum")[pattern.row]
        alone &= (np.bincount(pattern.row[alone], minlength=self.settled.rows) == 1)[pattern.row]
        inertial = np.zeros(self.settled.rows, dtype=bool)
        inertial[pattern.row[in_rate & ~np.isin(columns, columns[alone])]] = True
        balances = {family: first for group, family, first in self.settled.form.groups if group == "dynamics"}
        mask = np.zeros(self.settled.rows, dtype=bool)
        for group, family, first in self.settled.form.groups:
            if group == "dynamics_rate":
                size, own = self.settled.description.rows[family].size, balances[family]
                mask[first : first + size] = inertial[own : own + size]
        return mask

    def following(self, t: float, x: Floats) -> Mask:
        """Unknowns that follow from the state: multipliers, implicit ones, derivatives, flows without inertia.

        The flow of a momentum counts as state: where neither is written, both begin at zero.
        """
        jy, jyd = self.system.jacobian(t, *self.expand(x))
        carries = self.system.differential(jyd)[: self.n] & np.isin(self.kinds, STATE)
        pattern = self.system.pattern
        inert = pattern.columns_of()[(jy != 0.0) & self._momenta[pattern.row]]
        carries[np.intersect1d(self._flow[carries[self._momentum]], inert)] = True
        carries &= ~self.measured
        carries |= self.given.written & np.isin(self.kinds, STATE)
        return np.concatenate([~carries, np.ones(self.rates.size, dtype=bool), np.zeros(self.missed.size, dtype=bool)])

    def carried(self) -> Ints:
        """Of flows with momenta: the momentum where the flow is written, else the flow."""
        return np.where(self.given.written[self._flow], self._momentum, self._flow)

    def without_noise(self, x: Floats, scale: Floats) -> Floats:
        """X with zeros where it is round-off beside its magnitude, or beside the largest of its kind and unit."""
        largest = np.zeros(int(self._alike.max(initial=0)) + 1)
        np.maximum.at(largest, self._alike, np.abs(x))
        return np.where(np.abs(x) > NOISE * np.maximum(scale, largest[self._alike]), x, 0.0)

    def scale(self, t: float, x: Floats) -> Floats:
        """Magnitudes of x, found by balancing rows where the guess is zero."""
        known = np.abs(x)
        nominal = self.system.nominal[: self.n]
        known[: self.n] = np.where(nominal > 0.0, nominal, known[: self.n])
        values = np.abs(self.jacobian(t, x))
        free = np.abs(self.residual(t, x))
        values, free = (np.where(np.isfinite(item), item, 0.0) for item in (values, free))
        told = values * np.isin(self.rows, self.missed)
        values = values - told
        # how fast what follows from the state moves says nothing of its size
        sizes = ~self.groups("dynamics_rate")[self.rows]
        found = propagate(known, self.rows[sizes], self.columns[sizes], values[sizes], free, self._alike)
        for kind in np.unique(self.kinds):
            members = np.flatnonzero(self.kinds == kind)
            largest = found[members].max(initial=0.0)
            found[members] = np.maximum(found[members], 1e-3 * largest)
        found[: self.n] = np.where(found[: self.n] > 1e-280, found[: self.n], 1.0)
        found = propagate(found, self.rows, self.columns, values, free, self._alike)
        # guesses of one unit are measured alike
        size, largest = np.zeros(self.settled.rows), np.zeros(int(self._family.max(initial=0)) + 1)
        own = self.columns < self.first
        np.add.at(size, self.rows[own], (told * found[self.columns])[own])
        np.maximum.at(largest, self._family, size[self.missed])
        found[self.first :] = largest[self._family]
        return np.where(found > 1e-280, found, 1.0)


def _problem(starter: Starter, t: float, x: Floats, guess: Floats, *, rows: Mask, free: Mask) -> Problem:
    """The equations `rows` in the unknowns `free`, the others as in x."""
    follows = starter.following(t, x)
    weight = np.full(x.size, _WEIGHT["unwritten"])
    weight[starter.written] = _WEIGHT["written"]
    weight[follows] = _WEIGHT["following"]
    # unknowns of one kind and unit are moved by one measure, whatever their values
    scale = starter.scale(t, x)
    weight[: starter.n] *= scale[: starter.n] / group_maximum(starter.system, scale[: starter.n])
    return Problem(
        residual=lambda z: starter.residual(t, z),
        jacobian=lambda z: starter.jacobian(t, z),
        rows=starter.rows,
        columns=starter.columns,
        number=starter.settled.rows,
        use=rows,
        free=free,
        guess=guess,
        scale=scale,
        weight=weight,
    )


def _guess(starter: Starter, t: float, guess: Floats, free: Mask) -> Floats:
    """The guess moved onto guessed expressions, as far as constraints and fixed values let it."""
    written = starter.guessed & ~starter.unsaid
    if not written.any():
        return guess
    rows = written | starter.groups("phi", "psi")
    free = free & (np.arange(free.size) < starter.n)
    found = solve(_problem(starter, t, guess, guess, rows=rows, free=free), guess)
    return found.x if np.isfinite(found.residual) else guess


def _stages(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Floats:
    """Positions, flows, momenta one after the other, each the nearest to its guess with those before it held.

    What follows from the state moves alone where that is enough.
    """
    for groups, moving in (
        (("phi",), ("q",)),
        (("phi_rate", "psi"), ("f",)),
        (("momentum",), ("p",)),
        (("phi", "phi_rate", "psi", "momentum"), STATE),
    ):
        rows, may = starter.groups(*groups), free & np.isin(starter.moving, moving)
        for use in (rows | starter.between(moving), rows):
            if not use.any() or not may.any():
                continue
            problem = _problem(starter, t, x, guess, rows=use, free=may)
            gentle = replace(problem, free=may & starter.following(t, x))
            found = next((s for s in _trials(gentle, problem, x) if s.residual < EXACT), None)
            if found is not None:
                x = starter.without_noise(found.x, problem.scale)
                break
    return x


def _trials(gentle: Problem, problem: Problem, x: Floats) -> Iterator[Solution]:
    """From x in the unknowns of the gentle problem, then in all, then from points around."""
    yield solve(gentle, x, _FEW)
    yield solve(problem, x)
    for z in _shaken(x, problem.free, problem.scale):
        yield solve(problem, z)


def _shaken(x: Floats, free: Mask, scale: Floats) -> Iterator[Floats]:
    """Points around x, always the same: where a guess lies on a singular point."""
    random = np.random.default_rng(20)
    for amplitude in _AMPLITUDES:
        yield x + np.where(free, amplitude * scale * random.standard_normal(x.size), 0.0)


def _rescaled(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """Everything at once, and whether it holds.

    Magnitudes that proved wrong (currents of 1e-12 A at the guess, a diode at 2 V) are taken anew: the rows must hold
    in the magnitudes of the solution too.
    """
    at, best = x, Solution(x, np.inf, np.zeros(0))
    empty = None
    for _ in range(_RESCALINGS):
        scale = starter.scale(t, at)
        found = solve(_problem(starter, t, at, guess, rows=starter.every, free=free), best.x)
        if empty is not None and found.residual >= EXACT and not found.residual < best.residual:
            if at is empty:
                break
            at = empty
            continue
        best = found
        if not np.isfinite(best.residual):
            break
        at = starter.without_noise(best.x, scale)
        # what is far below its magnitude may be zero, which has none of its own
        empty = np.where(free & (np.abs(at) < OWN * scale), 0.0, at)
        for candidate in (at, empty) if best.residual < EXACT else ():
            if _own(starter, t, candidate, candidate) < OWN:
                return Solution(candidate, best.residual, best.scaled), True
            if candidate is at and _own(starter, t, at, best.x) < OWN:
                return best, True
    return best, False


def _own(starter: Starter, t: float, magnitudes: Floats, x: Floats) -> float:
    """Largest residual at x of the rows that must hold, relative to their terms in magnitudes of a solution."""
    size = _row_scale(starter, t, magnitudes, starter.scale(t, magnitudes))[starter.every]
    return float(np.max(np.abs(starter.residual(t, x)[starter.every]) * size, initial=0.0))


def _beside_gammas(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Floats:
    """X with everything else as the implicit unknowns at their guesses make it: of two roots of a gamma the iteration
    then begins at that of the guess.

    Left out are gammas that are not linear, held what their text guesses of implicit unknowns (all that stand in them,
    where it guesses none).
    """
    implicit = starter.moving == "e"
    gammas = starter.groups("gamma")
    if not gammas.any() or not implicit.any():
        return x
    bent = _bent(starter, t, x) & gammas
    own = bent[starter.rows] & implicit[starter.columns]
    own_rows, own_columns = starter.rows[own], starter.columns[own]
    said = np.zeros(starter.settled.rows, dtype=bool)
    said[own_rows[starter.written[own_columns]]] = True
    held = np.zeros(x.size, dtype=bool)
    held[own_columns[starter.written[own_columns] | ~said[own_rows]]] = True
    if not held.any():
        return x
    rows = starter.every & ~bent & ~starter.groups("gamma_rate")
    may = free & ~held & starter.following(t, x)
    found = solve(_problem(starter, t, x, guess, rows=rows, free=may), x)
    return found.x if found.residual < EXACT else x


def _bent(starter: Starter, t: float, x: Floats) -> Mask:
    """Rows that are not linear."""
    here, there = (starter.jacobian(t, z) for z in (x, x + 1e-3 * starter.scale(t, x)))
    bent = np.zeros(starter.settled.rows, dtype=bool)
    bent[starter.rows[here != there]] = True
    return bent


def _steadied(starter: Starter, t: float, best: Solution, guess: Floats, free: Mask) -> Solution:
    """The solution without what guesses of the state moved for the sake of what follows from it: that costs nothing.

    Guesses that can stay do so exactly.  Positions in curved constraints are left alone, and what is too large for full
    matrices.
    """
    x = best.x
    follows = starter.following(t, x) | starter.idle
    follows[starter.carried()] = True
    curved = np.zeros(x.size, dtype=bool)
    bent = _bent(starter, t, x) & starter.groups("phi")
    curved[starter.columns[bent[starter.rows]]] = True
    free = free & ~(curved & (starter.moving == "q"))
    state = free & ~follows
    if x.size > DENSE or not (x != guess)[state].any():
        return best
    problem = _problem(starter, t, x, guess, rows=starter.every, free=free)
    by_content = starter.by_content(t, x, problem.scale)
    problem = replace(problem, weight=np.where(state & ~starter.written, by_content, problem.weight))
    aim = where_light(problem, x, follows)
    moved = np.abs(aim - guess) * problem.weight / problem.scale
    aim = np.where(moved > BACK * _WEIGHT["unwritten"], aim, guess)
    for held in (state, state & (aim == guess)):
        z = np.where(held, aim, x)
        found = solve(replace(problem, free=free & ~held), z)
        if found.residual < EXACT:
            z = starter.without_noise(found.x, problem.scale)
            if _own(starter, t, z, z) < OWN:
                return replace(found, x=z)
    return best


def _attempt(starter: Starter, t: float, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """What follows from the staged state; where nothing does, everything at once, then from perturbed points."""
    x = _beside_gammas(starter, t, _stages(starter, t, guess.copy(), guess, free), guess, free)
    best, holds = _rescaled(starter, t, x, guess, free & starter.following(t, x))
    if holds:
        return best, True
    best, holds = _rescaled(starter, t, x, guess, free)
    for shaken in _shaken(x, free, starter.scale(t, x)):
        if holds:
            break
        found, holds = _rescaled(starter, t, shaken, guess, free)
        if holds or found.residual < best.residual:
            best = found
    return best, holds


def _asked(starter: Starter, t: float, x: Floats, place: int) -> str:
    """Labels of the constraint rows that an unknown stands in."""
    found: list[str] = []
    values = starter.jacobian(t, x)
    hit = np.unique(starter.rows[(starter.columns == place) & (values != 0.0)])
    for row in hit[~starter.unsaid[hit]]:
        label = starter.settled.row_label(int(row))
        base = label.kind.split("_")[0]
        text = f"{base} {label.label}"
        if base in ("phi", "psi", "gamma", "momentum", "initial") and text not in found:
            found.append(text)
    return "asked for by " + ", ".join(found[:4]) if found else "asked for by the balance of efforts"


def _moved(starter: Starter, t: float, x: Floats, scale: Floats) -> tuple[tuple[str, float, float, str], ...]:
    given = starter.given
    change = np.abs(x[: starter.n] - given.guess)
    places = np.flatnonzero(
        given.written
        & ~given.fixed
        & (change > 1e-9 * np.maximum(np.abs(given.guess), 1e-3 * scale[: starter.n]))
    )
    return tuple(
        (starter.system.name(int(k)), float(given.guess[k]), float(x[k]), _asked(starter, t, x, int(k)))
        for k in places[:100]
    )


def _row_scale(starter: Starter, t: float, x: Floats, scale: Floats) -> Floats:
    """One over the size of the terms of each row [rows]."""
    size = np.zeros(starter.settled.rows)
    np.add.at(
        size, starter.rows, np.abs(starter.jacobian(t, x)) * np.maximum(scale, np.abs(x))[starter.columns]
    )
    return np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 1.0)


def _explain(starter: Starter, t: float, guess: Floats, free: Mask, best: Solution) -> InconsistentStart:
    """Why there is no consistent state: rows in the way, and the fixed values that would have to move."""
    if not np.isfinite(best.residual):
        bad = np.flatnonzero(~np.isfinite(starter.residual(t, guess)))
        rows = tuple(starter.settled.row_label(int(row)) for row in bad[:5])
        return InconsistentStart("nonfinite", float("inf"), rows)
    x, scaled = best.x, best.scaled
    if x.size <= DENSE:
        problem = _problem(starter, t, guess, guess, rows=starter.every, free=free)
        x = least_residual(problem, x)
        scaled = np.abs(starter.residual(t, x)) * _row_scale(starter, t, x, problem.scale)
    raw, scaled = (np.where(starter.every, item, 0.0) for item in (np.abs(starter.residual(t, x)), scaled))
    order = np.argsort(-scaled)
    worst = [int(row) for row in order[:5] if scaled[row] > 0.1 * scaled[order[0]]]
    rows = tuple(dict.fromkeys(starter.settled.row_label(row) for row in worst))
    freed, holds = _attempt(starter, t, guess, np.ones_like(free))
    candidates: tuple[RowLabel, ...] = ()
    if holds:
        scale = starter.scale(t, freed.x)
        change = np.abs(freed.x - guess)[: starter.n] / scale[: starter.n] * starter.given.fixed
        places = [int(k) for k in np.argsort(-change)[:5] if change[k] > 1e-9]
        candidates = tuple(dict.fromkeys(starter.given.label[k] for k in places))
    kind = "fixed"
    if not candidates:
        kind = "gamma" if rows and rows[0].kind.startswith("gamma") else "stuck"
        if rows and rows[0].kind.startswith(("phi", "psi", "initial")):
            kind = "fixed"
    return InconsistentStart(kind, float(raw[order[0]]), rows, candidates)


def _freedom(starter: Starter, t: float, x: Floats, free: Mask) -> tuple[int, tuple[str, ...]]:
    """How many fixed values are missing, and the free unknowns that could take them (dense; else unknown: 0)."""
    if x.size > 400:
        return 0, ()
    scale = starter.scale(t, x)
    full = np.zeros((starter.settled.rows, x.size))
    np.add.at(full, (starter.rows, starter.columns), starter.jacobian(t, x) * scale[starter.columns])
    size = np.abs(full).max(axis=1, initial=0.0)
    full = (full / np.where(size > 0.0, size, 1.0)[:, None])[starter.every]
    carries = ~starter.following(t, x) & free
    follows = free & ~carries
    if not carries.any():
        return 0, ()
    inner = np.linalg.matrix_rank(full[:, follows], tol=1e-9) if follows.any() else 0
    missing = int(carries.sum()) - (int(np.linalg.matrix_rank(full[:, free], tol=1e-9)) - int(inner))
    names = tuple(starter.system.name(int(k)) for k in np.flatnonzero(carries)) if missing > 0 else ()
    return missing, names


def consistent_start(system: System, t0: float, near: ConsistentState | None = None) -> ConsistentState:
    """A state at t0 that satisfies all rows and their hidden derivatives.

    system: any index form of the model; near: a state to stay close to, else the guesses.  Raises InconsistentStart.
    """
    system = system if system.form.name == "3" else system.another("3")
    starter = Starter(system, measuring=True)
    guess = np.concatenate([starter.given.guess, np.zeros(starter.moving.size - starter.n)])
    if near is not None:  # but for its multipliers, which redundant rows make as large as they like
        guess[: starter.n] = np.where(np.isin(starter.kinds, (*STATE, "e")), near.y, guess[: starter.n])
        guess[starter.first :] = starter.residual(t0, guess)[starter.missed]
    free = np.append(~starter.given.fixed, np.ones(guess.size - starter.n, dtype=bool))
    guess = _guess(starter, t0, guess, free)
    best, holds = _attempt(starter, t0, guess, free)
    if not holds:
        raise _explain(starter, t0, guess, free, best)
    best = _steadied(starter, t0, best, guess, free)
    y, yd = starter.expand(best.x)
    counted = Starter(system) if starter.missed.size else starter
    freedom, names = _freedom(counted, t0, best.x[: starter.first], free[: starter.first])
    moved = _moved(starter, t0, best.x, starter.scale(t0, best.x))
    return ConsistentState(t0, y, yd, moved, best.residual, freedom, names)
