"""What a consistent start is sought in: unknowns, equations, given values, magnitudes and weights.

Unknowns: y as written and the derivatives that the settled rows read; equations: all settled rows (as written,
phi_rate, phi_acceleration, psi_rate, momentum_rate, gamma_rate) and the block `initial`.

Where contents of stores follow from several coordinates, each has a row of block `initial` and an unknown of its own,
what the row misses; these are what moves least, and the coordinates follow.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import InconsistentStart, RowLabel
from sysdyn.runtime.model.scales import alike, group_maximum, of_a_kind, propagate
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.least_change import DENSE, Problem, Work
from sysdyn.runtime.numerics.rank import count, decomposed
from sysdyn.runtime.start.settled import inertial_rates, rates_of

Mask = NDArray[np.bool_]
Places = NDArray[np.integer]
STATE = ("q", "f", "p", "s")
WEIGHT = {"written": 1.0, "unwritten": 1e-3, "following": 1e-6}
NOISE = 1e-13


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


def remembered(
    ask: Callable[[Starter, float, Floats], NDArray[Any]],
) -> Callable[[Starter, float, Floats], NDArray[Any]]:
    """The answer at the point asked last is known: stages that move nothing ask again and again at one point."""
    name = ask.__name__

    @functools.wraps(ask)
    def answer(self: Starter, t: float, x: Floats) -> NDArray[Any]:
        if not self.remember:
            return ask(self, t, x)
        known = self.known.get(name)
        if known is None or known[0] != t or not np.array_equal(known[1], x):
            known = self.known[name] = (t, x.copy(), ask(self, t, x))
        return known[2].copy()

    return answer


class Starter:
    """The equations of the start of one model (t0 apart).

    measuring: where contents of stores are guessed, guessed expressions hold but for an unknown of their own each,
    behind those of y and its rates; sums of balances without inertia have their rates.
    """

    def __init__(self, system: System, *, measuring: bool = False, remember: bool = False) -> None:
        self.system = system
        self.remember = remember  # one search for a start: nothing but t and x changes
        self.known: dict[str, tuple[float, Floats, NDArray[Any]]] = {}
        self.work = Work()  # of one search for a start
        self.generous = False  # magnitudes by the largest proposal: where the least lead nowhere
        self.settled = system.another("start")
        self.rates = rates_of(self.settled)
        self.given = _given(system)
        self.n = system.form.written
        self._momenta = system.of_groups("momentum")
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
        self._of_kinds: dict[tuple[str, ...], Mask] = {}

    @functools.cached_property
    def _of_a_kind(self) -> NDArray[np.int64]:
        """Number of the row and the kind of its unknown, of each place [entries]."""
        return of_a_kind(self.rows, self.columns, self._alike)

    @functools.cached_property
    def _of_missed(self) -> Mask:
        """Entries that stand in rows which may miss something [entries]."""
        missed = np.zeros(self.settled.rows, dtype=bool)
        missed[self.missed] = True
        return np.asarray(missed[self.rows])

    def _members(self) -> list[Places]:
        """Unknowns of y of each kind."""
        return [np.flatnonzero(self.kinds == kind) for kind in np.unique(self.kinds)]

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

    @remembered
    def jacobian(self, t: float, x: Floats) -> Floats:
        """Values at (self.rows, self.columns)."""
        jy, jyd = self.settled.jacobian(t, *self.expand(x))
        values = np.concatenate([jy, jyd[self._rated], np.full(self.missed.size, -1.0)])
        if self._sums is None:
            return values
        summed = self._sums.weights[:, self._sums.place] * values[self._sums.entries]
        values[self._sums.entries] = 0.0
        return np.concatenate([values, summed.ravel()])

    def with_sums(self, values: Floats) -> Floats:
        """Values of all rows [rows, k] with the sums of rows in their places."""
        if self._sums is None:
            return values
        values = values.copy()
        values[self._sums.rows] = self._sums.weights @ values[self._sums.of]
        return values

    @property
    def summed(self) -> bool:
        """Whether rows hold sums of rows (balances of what floats)."""
        return self._sums is not None

    def groups(self, *names: str) -> Mask:
        """Rows of the named groups; read-only."""
        return self.settled.of_groups(*names)

    def moves(self, kinds: Sequence[str]) -> Mask:
        """Unknowns of these kinds [unknowns]; read-only."""
        key = tuple(kinds)
        if key not in self._of_kinds:
            self._of_kinds[key] = np.isin(self.moving, key)
        return self._of_kinds[key]

    def between(self, kinds: Sequence[str]) -> Mask:
        """Rows that hold between unknowns of these kinds alone: initial conditions; balances between positions."""
        outside = ~self.moves(kinds)
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
        left, sigma, _ = decomposed(matrix / np.where(size > 0.0, size, 1.0))
        weights = left[:, count(sigma) :].T
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
        own = self._structural & self._of_missed & (self.columns < self.n)
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
        return np.asarray(WEIGHT["unwritten"] * content * scale / largest[unit])

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
        if not self.missed.size:
            return np.zeros(0, dtype=self.moving.dtype)
        found = np.full(self.settled.rows, "", dtype=self.moving.dtype)
        many = np.zeros(self.settled.rows, dtype=bool)
        read = self._structural & (self.columns < self.first)
        for kind in np.unique(self.moving[: self.first]):
            rows = self.rows[read & (self.moving[self.columns] == kind)]
            many[rows] |= found[rows] != ""
            found[rows] = kind
        return np.where(many, "", found)[self.missed]

    def _unsettled(self) -> Mask:
        """Rates of balances with inertia: the start does not know them."""
        return inertial_rates(self.settled)

    @remembered
    def following(self, t: float, x: Floats) -> Mask:
        """Unknowns that follow from the state: multipliers, implicit ones, derivatives, flows without inertia.

        The flow of a momentum counts as state: where neither is written, both begin at zero.
        """
        jy, jyd = self.system.jacobian(t, *self.expand(x))
        carries = self.system.differential(jyd)[: self.n] & self.system.are(*STATE)[: self.n]
        pattern = self.system.pattern
        inert = pattern.columns_of()[(jy != 0.0) & self._momenta[pattern.row]]
        carries[np.intersect1d(self._flow[carries[self._momentum]], inert)] = True
        carries &= ~self.measured
        carries |= self.given.written & self.system.are(*STATE)[: self.n]
        return np.concatenate([~carries, np.ones(self.rates.size, dtype=bool), np.zeros(self.missed.size, dtype=bool)])

    def carried(self) -> Ints:
        """Of flows with momenta: the momentum where the flow is written, else the flow."""
        return np.where(self.given.written[self._flow], self._momentum, self._flow)

    def without_noise(self, x: Floats, scale: Floats) -> Floats:
        """X with zeros where it is round-off beside its magnitude, or beside the largest of its kind and unit."""
        largest = np.zeros(int(self._alike.max(initial=0)) + 1)
        np.maximum.at(largest, self._alike, np.abs(x))
        return np.where(np.abs(x) > NOISE * np.maximum(scale, largest[self._alike]), x, 0.0)

    @remembered
    def scale(self, t: float, x: Floats) -> Floats:
        """Magnitudes of x, found by balancing rows where the guess is zero: the least that a row proposes."""
        return self._scale(t, x, largest=False)

    @remembered
    def largest(self, t: float, x: Floats) -> Floats:
        """The same by the largest that a row proposes (rates of fast and slow stores 1e12 apart)."""
        return self._scale(t, x, largest=True)

    def _scale(self, t: float, x: Floats, *, largest: bool) -> Floats:
        known = np.abs(x)
        nominal = self.system.nominal[: self.n]
        known[: self.n] = np.where(nominal > 0.0, nominal, known[: self.n])
        values = np.abs(self.jacobian(t, x))
        free = np.abs(self.residual(t, x))
        values, free = (np.where(np.isfinite(item), item, 0.0) for item in (values, free))
        told = values * self._of_missed
        values = values - told
        # how fast what follows from the state moves says nothing of its size
        sizes = ~self.groups("dynamics_rate")[self.rows]
        of = self._of_a_kind
        own = self.rows[sizes], self.columns[sizes], values[sizes]
        found = propagate(known, *own, free, self._alike, group=of[sizes], largest=largest)
        for members in self.system.once("members", self._members):
            found[members] = np.maximum(found[members], 1e-3 * found[members].max(initial=0.0))
        found[: self.n] = np.where(found[: self.n] > 1e-280, found[: self.n], 1.0)
        found = propagate(found, self.rows, self.columns, values, free, self._alike, group=of, largest=largest)
        # guesses of one unit are measured alike
        size, most = np.zeros(self.settled.rows), np.zeros(int(self._family.max(initial=0)) + 1)
        text = self.columns < self.first
        np.add.at(size, self.rows[text], (told * found[self.columns])[text])
        np.maximum.at(most, self._family, size[self.missed])
        found[self.first :] = most[self._family]
        return np.where(found > 1e-280, found, 1.0)


def problem_of(starter: Starter, t: float, x: Floats, guess: Floats, *, rows: Mask, free: Mask) -> Problem:
    """The equations `rows` in the unknowns `free`, the others as in x."""
    follows = starter.following(t, x)
    weight = np.full(x.size, WEIGHT["unwritten"])
    weight[starter.written] = WEIGHT["written"]
    weight[follows] = WEIGHT["following"]
    # unknowns of one kind and unit are moved by one measure, whatever their values
    scale = starter.largest(t, x) if starter.generous else starter.scale(t, x)
    weight[: starter.n] *= scale[: starter.n] / group_maximum(starter.system, scale[: starter.n])
    return weighted(starter, t, guess, rows=rows, free=free, scale=scale, weight=weight)


def weighted(
    starter: Starter, t: float, guess: Floats, *, rows: Mask, free: Mask, scale: Floats, weight: Floats
) -> Problem:
    """The equations `rows` in the unknowns `free`, which move from the guess by scale and weight [unknowns]."""
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
        work=starter.work,
    )


def row_scale(starter: Starter, t: float, x: Floats, scale: Floats) -> Floats:
    """One over the size of the terms of each row [rows]."""
    size = np.zeros(starter.settled.rows)
    np.add.at(size, starter.rows, np.abs(starter.jacobian(t, x)) * np.maximum(scale, np.abs(x))[starter.columns])
    return np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 1.0)
