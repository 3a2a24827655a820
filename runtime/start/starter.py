"""What a consistent start is sought in: unknowns, equations, given values, magnitudes and weights.

Unknowns: y as written, those of the start alone, the derivatives that the settled rows read; equations: all settled
rows (as written, phi_rate, phi_acceleration, psi_rate, momentum_rate, gamma_rate) and the block `initial`.

A guess of an expression, or of contents that follow from several coordinates, is a row of block `initial` that reads an
unknown of the start alone, what it misses; these move least, and coordinates follow contents.
"""

from __future__ import annotations

import ctypes as c
import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.balance import RowBalance
from sysdyn.runtime.model.description import START, Floats, Initial, Ints, Places, statements
from sysdyn.runtime.model.failures import InconsistentStart, RowLabel
from sysdyn.runtime.model.inertia import Inertia, own_unknown
from sysdyn.runtime.model.patterns import read_only
from sysdyn.runtime.model.scales import largest_of_group
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.least_change import DENSE, least_norm
from sysdyn.runtime.numerics.products import add_sizes, linked_places
from sysdyn.runtime.numerics.work import Work
from sysdyn.runtime.start.equations import Equations
from sysdyn.runtime.start.residue import Residue
from sysdyn.runtime.start.sums import Sums, Weights, of_few, of_many, weights

Mask = NDArray[np.bool_]
STATE = ("q", "f", "p", "s", *START)
NOISE = tuning.BY_FACTORS
DRIFT = 0.55
"""Of what a state moves by in a step, behind one of half its length: with no more it drifts, and has not jumped."""
WRITTEN = 4.0 * float(np.finfo(float).eps)
"""Of the largest of its like: a fixed value that is no round-off of the text's own."""
EQUATIONS = "equations of the start"


def remembered(
    ask: Callable[[Starter, float, Floats], NDArray[Any]],
) -> Callable[[Starter, float, Floats], NDArray[Any]]:
    """The answer at the point asked last is known: stages that move nothing ask again and again at one point."""
    name = ask.__name__

    @functools.wraps(ask)
    def answer(self: Starter, t: float, x: Floats) -> NDArray[Any]:
        # of a large point its digest
        here = t, sha256(np.ascontiguousarray(x).data).digest() if x.size > LARGE else x.tobytes()
        # another point: nothing is known of it
        if here != self.here:
            self.here = here
            self.known.clear()
        if name not in self.known:
            found = ask(self, t, x)
            if x.size > LARGE and found.size > x.size:  # the room counts
                return found
            self.known[name] = read_only(found)
        return self.known[name]

    return answer


class Starter:
    """The equations of the start of one model (t0 apart), for one search: nothing but t and x changes.

    Sums of balances without inertia have their rates.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.here, self.known = (0.0, b""), dict[str, NDArray[Any]]()
        self.work, self._residue = Work(), Residue()  # of one search for a start
        self.led = 0  # of the ways to what follows from a state the one that led there last (held.following)
        self.jumping = False  # what is free of the state is what jumps, and no more (`jump_alone`)
        self.settled = settled = system.another("start")
        if system.unknowns > LARGE:  # found again where it is asked
            system.put_away(whole=True)
        values, fixed, written = statements(settled.form.at, settled.unknowns, settled.description.initial)
        # fixed values of one unknown must agree
        self._agreeing(values)
        self.equations = known = system.once(EQUATIONS, lambda: Equations(system, settled))
        self.core = settled.own(EQUATIONS, lambda: known.core(system, settled))
        if known.unknowns > LARGE:
            settled.put_away(whole=self.core.both is not None)
            settled.forget_once("structural")
        self.n, self.rates, self.measured = known.n, known.rates, known.measured
        self._momentum, self._flow = known.momentum, known.flow
        self.guess = np.append(values, np.zeros(self.rates.size))
        self.free = np.append(~fixed, np.ones(self.rates.size, dtype=bool))
        self.written = np.append(written | settled.are("slack"), np.zeros(self.rates.size, dtype=bool))
        # rates of inertia are unknown at a start
        self.every = ~known.unsettled  # rows that must hold
        self.rows, self.columns = known.rows, known.columns
        unsettled = np.flatnonzero(known.unsettled)
        self._sums = Sums(self._floating(unsettled), unsettled, (known.rows, known.columns), known.unknowns)
        self.every[self._sums.places] = True
        # sums of these in which no rate is left are rows too
        if self.summed:
            self.rows, self.columns = np.append(self.rows, self._sums.rows), np.append(self.columns, self._sums.columns)

    def _said(self) -> list[tuple[Initial, Ints]]:
        """Initial values on y and where they stand, fixed ones last."""
        at, initial = self.settled.form.at, self.settled.description.initial
        return [(item, at[item.family] + item.positions) for item in sorted(initial, key=lambda item: item.fixed)]

    def label(self, place: int) -> RowLabel:
        """Of the initial value that counts."""
        return next(item.label for item, own in reversed(self._said()) if place in own)

    def _agreeing(self, values: Floats) -> None:
        """InconsistentStart where two fixed ones differ; values [unknowns of y]: those that count."""
        for item, own in (pair for pair in self._said() if pair[0].fixed):
            apart = np.abs(values[own] - item.values)
            # two fixed values of one unknown that differ
            wrong = np.flatnonzero(apart > 1e-12 * np.maximum(np.abs(values[own]), np.abs(item.values)))
            if wrong.size:
                place = int(own[wrong[0]])
                labels = item.label, self.label(place)
                raise InconsistentStart("fixed", float(apart[wrong[0]]), (), labels, (self.settled.name(place),))

    @contextmanager
    def granted(self, share: float = 1.0) -> Iterator[None]:
        """Work of its own for what is done within, under the same limit of wall time."""
        own, self.work = self.work, Work(share, self.work.budget)
        try:
            yield
        finally:
            self.work = own

    def spare(self) -> None:
        """Lets go of what no search reads: of a large model the room counts."""
        if self.equations.unknowns > LARGE:
            self.system.spare()
            self.system.put_away(whole=True)

    def forget(self) -> None:
        """Lets go of what stands in the structures of the text for this search alone."""
        self.settled.forget()
        self.system.forget_once(EQUATIONS)

    @functools.cached_property
    def _balance(self) -> lib.Balance:
        """The rows and their entries, sums of rows among them."""
        if not self.summed:
            return self.core.balance  # type: ignore[no-any-return]
        self._own_balance = RowBalance(self.settled.rows, self.rows, self.columns, self.equations.alike)
        return self._own_balance.core

    @functools.cached_property
    def hollow(self) -> Mask:
        """Displacements in constraints alone, of which nothing is said: no store holds them [unknowns]."""
        # no value given, and in constraints alone
        form, known = self.system.form, self.equations
        found = np.zeros(known.unknowns, dtype=bool)
        found[form.k_q] = ~self.written[form.k_q]
        found[known.columns[~self.groups("phi")[known.rows]]] = False
        return found

    def expand(self, x: Floats) -> tuple[Floats, Floats]:
        """y, yd of x = (y, chosen derivatives)."""
        y, yd = x[: self.n].copy(), np.zeros(self.n)
        yd[self.rates] = x[self.n :]
        form = self.system.form
        # q' is the flow
        yd[form.k_q] = y[form.k_f]
        return y[: form.written], yd[: form.written]

    def unknowns(self, t: float, y: Floats, yd: Floats) -> Floats:
        """X of y, yd, the inverse of `expand`: positions are those of the contents, guessed expressions miss what they
        do there.
        """
        x = np.concatenate([y, self.guess[y.size : self.n], yd[self.rates]])
        at = np.flatnonzero((self.moves("start") & self.free)[self.columns])
        # positions by the contents that they hold
        if at.size:
            aim = np.where(np.isin(np.arange(self.settled.rows), self.rows[at]), -self.residual(t, x), 0.0)
            entries = self.rows[at], self.columns[at] - y.size, self.jacobian(t, x)[at]
            x[y.size : self.n] += least_norm((aim.size, self.n - y.size), entries, aim)
        rows, missed = self.equations.guessed
        x[missed] = self.residual(t, x)[rows]
        return x

    @functools.cached_property
    def pinned(self) -> Mask:
        """Fixed values whose rows all hold unknowns beside them, which answer to these values however small they are
        beside their like [unknowns]; a row of fixed values alone may miss by their round-off.  What the text's own
        arithmetic leaves of a zero (`sin(pi)`) is one.
        """
        said = np.abs(self.guess) > WRITTEN * self.largest_alike(self.guess)
        bound = linked_places(~self.reading(self.free), self.rows, self.columns, self.free.size)
        return ~self.free & ~bound & said

    def residual(self, t: float, x: Floats) -> Floats:
        """All rows [rows]."""
        rows = np.zeros(self.settled.rows)
        self._ask(lib.core.sd_start_residual, t, x, rows)
        return self.with_sums(rows)

    def _ask(self, function: Any, t: float, x: Floats, answer: Floats) -> None:
        """What the core says of the rows at x."""
        # C reads arrays without gaps
        x = np.ascontiguousarray(x, dtype=np.float64)
        if function(c.addressof(self.core), t, lib.pointer(x), lib.pointer(answer)):
            raise MemoryError
        self.settled.failure.check()

    @remembered
    def _slopes(self, t: float, x: Floats) -> Floats:
        """Values of the matrix before rows are summed."""
        values = np.zeros(self.equations.rows.size)
        self._ask(lib.core.sd_start_jacobian, t, x, values)
        return values

    def jacobian(self, t: float, x: Floats) -> Floats:
        """Values at (self.rows, self.columns)."""
        values = self._slopes(t, x)
        return self._sums.slopes(values) if self.summed else values

    def row_scale(self, t: float, x: Floats, scale: Floats) -> Floats:
        """One over the size of the terms of each row [rows], by the larger of magnitudes and values; of sums over that
        of what is summed, which may cancel.
        """
        known, size = self.equations, np.zeros(self.settled.rows)
        add_sizes(known.rows, known.columns, self._slopes(t, x), np.maximum(scale, np.abs(x)), size)
        # sums may cancel: by what is summed
        if self.summed:
            self._sums.put(size, sizes=True)
        size[~(size > 0.0)] = 1.0
        return np.divide(1.0, size, out=size)

    def with_sums(self, values: Floats) -> Floats:
        """Values of all rows [rows, k] with the sums of rows in their places."""
        if self.summed:
            values = values.copy()
            self._sums.put(values)
        return values

    @property
    def summed(self) -> bool:
        """Whether rows hold sums of rows (balances of what floats)."""
        return len(self._sums) > 0

    def let_go(self, rows: Mask) -> None:
        """Asks for these rows no longer, nor for sums that hold them."""
        self.every &= ~rows
        if self.summed:
            self.every[self._sums.holding(rows)] = False

    @functools.cached_property
    def resting(self) -> Mask:
        """Rows [rows] of laws whose rates are not asked for."""
        return np.zeros_like(self.every)

    def reading(self, unknowns: Mask) -> Mask:
        """Rows [rows] that read some of these unknowns."""
        return linked_places(unknowns, self.columns, self.rows, self.settled.rows)

    def read(self, rows: Mask) -> Mask:
        """Unknowns that some of these rows [rows] read."""
        return linked_places(rows, self.rows, self.columns, self.free.size)

    def rows_of(self, entries: Mask) -> Mask:
        """Rows [rows] of these entries."""
        return _marked(self.rows[entries], self.settled.rows)

    def columns_of(self, entries: Mask) -> Mask:
        """Unknowns of these entries."""
        return _marked(self.columns[entries], self.free.size)

    def groups(self, *names: str) -> Mask:
        """Rows of the named groups; read-only."""
        return self.settled.of_groups(*names)

    @property
    def told(self) -> Mask:
        """Rows by which the text guesses expressions [rows]."""
        rows, missed = self.equations.guessed
        found = np.zeros(self.settled.rows, dtype=bool)
        found[rows[self.written[missed]]] = True
        return found

    def moves(self, *kinds: str) -> Mask:
        """Unknowns of y of these kinds [unknowns]."""
        found = np.zeros(self.equations.unknowns, dtype=bool)
        found[: self.n] = self.settled.are(*kinds)
        return found

    def _floating(self, unsettled: Places) -> Weights:
        """Sums of `unsettled` balances with inertia that read none: T* holds fewer combinations of their flows.

        They are taken from the inertia at two points: what moves with the state is left out.
        """
        settled = self.settled
        # nothing is unsettled, or too large and not joined
        if not unsettled.size or (self.n > DENSE and not self.equations.joined.any()):
            return weights(np.zeros((0, unsettled.size)))
        # inertia at two points
        points = [self._inertia(shift) for shift in (0.0, 0.1)]
        number = np.cumsum(settled.are("f")) - 1
        own = own_unknown(settled, "dynamics_rate", "f")[unsettled]
        own = np.where(own >= 0, number[own], -1)
        # of a large model groups that inertia joins
        if self.n > DENSE:
            return of_many(points, own, DENSE)
        whole = np.arange(points[0].size)[None]
        return of_few(np.hstack([np.where((own >= 0)[:, None], p.blocks(whole)[0][own], 0.0) for p in points]))

    def _inertia(self, shift: float) -> Inertia:
        """Inertia beside the state that the text says."""
        guess = self.guess[: self.n]
        y = guess + shift * (1.0 + np.abs(guess)) * np.cos(np.arange(self.n))
        return Inertia(self.settled, *self.settled.jacobian(0.0, y, np.zeros(self.n)))

    @remembered
    def following(self, t: float, x: Floats) -> Mask:
        """Unknowns that follow from the state: multipliers, implicit ones, derivatives, flows without inertia, and what
        only begins at a value of the others (energies since the start).

        Of a momentum and its flow the one that is written carries the state, else the momentum; where other flows make
        it too, the momentum in any case.
        """
        jyd = self.system.slopes(t, *self.expand(x), rate=True)
        # of the state: what has a rate, what is written, no measuring content
        state = self.settled.are(*STATE)
        carries = state & ~self.measured
        carries[: self.system.unknowns] &= self.system.differential(jyd)
        carries |= self.written[: self.n] & state
        carries &= ~self.equations.told
        flow, momentum, written = self._flow, self._momentum, self.written
        # momentum or flow carries the state, not both
        carries[flow[~written[flow]]] = False
        carries[momentum[written[flow] & ~self.equations.joined[flow]]] = False
        found = np.ones(x.size, dtype=bool)
        found[: self.n] = ~carries
        return found

    @functools.cached_property
    def momenta(self) -> Mask:
        """What is moved by the measure of momenta, of displacements in the complementary family [unknowns]."""
        return np.asarray(self.equations.moving(self.settled) != self.system.description.complementary)

    @functools.cached_property
    def stored(self) -> Mask:
        """What stores hold, and positions, whatever the point: all but flows that make no momentum [unknowns]."""
        found, (rows, missed) = self.moves("q", "p", "s", "unsaid"), self.equations.guessed
        found[self._flow] = True
        found[missed] |= self.equations.contents(self.settled)[rows]
        return found

    def without_noise(self, x: Floats, scale: Floats) -> Floats:
        """X with zeros where it is round-off beside its magnitude, or beside the largest of its kind and unit; what the
        text fixes is as it says.
        """
        return np.where((np.abs(x) > NOISE * np.maximum(scale, self.largest_alike(x))) | self.pinned, x, 0.0)

    def jump_alone(self, t: float, behind: tuple[Floats, Floats]) -> None:
        """Holds of the state what drifts: behind a step [unknowns as written] twice as far as behind one of half its
        length and more, where what jumps is as far.
        """
        # how far a step, and half of it, moves each unknown
        far, near = (self.unknowns(t, y, np.zeros(y.size)) - self.guess for y in behind)
        size = self.largest_alike(np.abs(self.guess) + np.abs(far))
        drifts = (near * np.sign(far) <= DRIFT * np.abs(far)) | (np.abs(far) <= NOISE * size)
        self.free &= self.following(t, self.guess) | ~drifts
        self.jumping = True

    def largest_alike(self, x: Floats) -> Floats:
        """Of each unknown the largest magnitude of its kind and unit."""
        return largest_of_group(self.equations.alike, np.abs(x))

    @remembered
    def scale(self, t: float, x: Floats) -> Floats:
        """Magnitudes of x, found by balancing rows where the guess is zero: the least that a row proposes."""
        known, found, nominal = self.equations, np.zeros(x.size), self.settled.named
        x = np.ascontiguousarray(x, dtype=np.float64)
        values, free = self.jacobian(t, x), self._residue.cleared(self, t, self.residual(t, x))
        if self.settled.form.scales:  # a constant that `tanh` takes away leaves round-off, which is no size
            terms = self.settled.steep_sizes(t, np.abs(self.expand(x)[0]))
            free = np.where(np.abs(free) <= WRITTEN * terms, 0.0, free)
        rows, missed = known.guessed
        told = np.where(np.isin(self.rows, rows) & np.isfinite(values), values, 0.0) if missed.size else 0.0
        sized = values - told if missed.size or not values.flags.writeable else values
        # how fast what follows from the state moves says nothing of its size
        tables = lib.pointer(known.rated_rows), lib.pointer(known.member), known.members
        sizes = lib.pointer(x), lib.pointer(sized), lib.pointer(free), lib.pointer(found)
        if lib.core.sd_scale(c.addressof(self._balance), lib.pointer(nominal), self.n, *tables, *sizes):
            raise MemoryError
        if missed.size:  # what guesses of one unit miss is measured alike
            found[missed] = 0.0
            found[missed] = np.bincount(self.rows, np.abs(told) * found[self.columns], self.settled.rows)[rows]
            found[missed] = self.largest_alike(found)[missed]
            found = np.where(found > 1e-280, found, 1.0)
        return found


def _marked(places: Ints, size: int) -> Mask:
    """These places among so many."""
    found = np.zeros(size, dtype=bool)
    found[places] = True
    return found
