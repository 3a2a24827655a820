"""Active sets that leave something open: constraints that depend on each other, and flows that nothing determines.

Four blocked diodes of a bridge say three things; four that conduct leave the current that circles in them open.  Among
the active sets that fit, one is taken whose equations determine everything: of dependent constraints one lets go (its
multiplier is zero, that of dry friction at its bound, the others hold its value), of undetermined flows one is held at
zero, those that are zero first: what the equations tell stays as it is.  Which sets are regular is a matter of
structure: it is asked once for each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.pivoting import NoActiveSetError, Pivoting, Settle
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.held_rows import switch_rows
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import equilibrate, factors
from sysdyn.runtime.numerics.rank import CERTAIN, count, singular_decomposition, sure_solver

DENSE = tuning.DENSE
"""Unknowns up to which matrices are full; larger models are taken as they come."""
NOTHING = tuning.SAME
"""Of a unit vector: a contact's share of what is open."""
SAME = tuning.SLIGHT
"""Of the largest flow, or rate of one: what a point found with another set may differ by, and is the same."""
ALIKE = 9
"""Digits to which shares are compared."""
GENERIC = tuning.GENERIC
"""Of dF/dyd beside dF/dy: at it a regular pencil is a regular matrix."""

SMALL = 60
"""Unknowns up to which sets are told apart by their index."""
CLOSE, FAR = (1e2, 1e4), 9
"""Times the fastest rate of a row: what a power is told by; an index of what has none."""

Point = tuple[Floats, Floats]


class Determined:
    """Finds active sets that leave nothing open."""

    def __init__(self, contacts: Contacts) -> None:
        self.contacts = contacts
        self.pivoting = Pivoting(contacts, self._singular)
        self._indices: dict[tuple[bool, ...], int] = {}
        self._regular: dict[tuple[bool, ...], tuple[int, Floats, NDArray[np.bool_]]] = {}

    @cached_property
    def _system(self) -> System:
        return self.contacts.system.another("3")

    def _singular(self, t: float, y: Floats, yd: Floats) -> bool:
        return self._system.unknowns <= DENSE and self.nullity(t, y, yd) > 0

    def leaves(self, t: float, y: Floats, yd: Floats) -> int:
        """How many directions the equations leave open at a point; 0 of models too large to ask."""
        return self.nullity(t, y, yd) if self._system.unknowns <= DENSE else 0

    def nullity(self, t: float, y: Floats, yd: Floats) -> int:
        """How many directions the equations with the present active set leave open."""
        return self._open(t, y, yd)[0]

    def directions(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, list[int]]:
        """What the equations with the present active set leave open [directions, unknowns as written], and the
        contacts that have to do with it.
        """
        number, part, _ = self._open(t, y, yd) if self._system.unknowns <= DENSE else (0, np.zeros(0), None)
        # nothing open, or too large to ask
        if not number:
            return np.zeros((0, 0)), []
        n = self._system.form.written
        # null vectors of the pencil at a short step
        scaled, column = _pencil(self._system, *self._system.jacobian(t, y[:n], yd[:n]))
        right = singular_decomposition(scaled)[2]
        return (right[len(right) - number :] * column)[:, :n], np.flatnonzero(part > NOTHING).tolist()

    def _open(self, t: float, y: Floats, yd: Floats) -> tuple[int, Floats, NDArray[np.bool_]]:
        """How many directions are open; how much the row of each contact has to do with it [contacts]: what has nothing
        closes nothing; the unknowns [unknowns as written] that are determined all the same.
        """
        key = tuple(self.contacts.active.tolist())
        # once for each active set
        if key not in self._regular:
            system, n = self._system, self._system.form.written
            jy, jyd = system.jacobian(t, y[:n], yd[:n])
            # no slopes: taken as determined
            if not (np.isfinite(jy).all() and np.isfinite(jyd).all()):
                return 0, np.zeros(len(key)), np.ones(n, dtype=bool)
            scaled, _ = _pencil(system, jy, jyd)
            # regular beyond doubt: no singular values needed
            if sure_solver(scaled, CERTAIN) is not None:
                self._regular[key] = 0, np.zeros(len(key)), np.ones(n, dtype=bool)
                return self._regular[key]
            left, sigma, right = singular_decomposition(scaled)
            # rank; what null vectors hardly move is determined
            some = count(sigma, CERTAIN)
            part, told = np.zeros(len(key)), np.linalg.norm(right[some:, :n], axis=0) <= NOTHING
            # rows of contacts in the left null space
            if some < sigma.size:
                rows, _, number, _ = switch_rows(system.description, system.form)
                share = np.linalg.norm(left[rows, some:], axis=1)
                at = np.array([c.number for c in self.contacts.contacts])
                total = np.zeros(len(system.description.switches.places) + 1)
                total[-1] = 1.0  # of relations, which have no switch
                np.maximum.at(total, number, share)
                part = total[at]
            self._regular[key] = sigma.size - some, part, told
        return self._regular[key]

    def fit(self, t: float, y: Floats, yd: Floats, settle: Settle, turned: Sequence[int] = ()) -> Point:
        """As Pivoting.fit, of a set that leaves as little open as one can; turned: what has just changed changes back
        last.
        """
        found = self.pivoting.fit(t, y, yd, settle)
        # large models are taken as they are
        if self._system.unknowns > DENSE:
            return found
        open_ = self.nullity(t, *found)
        # while a neighbouring set leaves less open
        while open_ > 0:
            better = next(self._better(t, found, settle, (open_, turned)), None)
            if better is None:
                return found
            found, open_ = better
        return found

    def _better(
        self, t: float, point: Point, settle: Settle, what: tuple[int, Sequence[int]]
    ) -> Iterator[tuple[Point, int]]:
        """Points of neighbouring active sets that fit too and leave less open."""
        contacts, (open_, turned) = self.contacts, what
        values, before, spared = contacts.observer(t, *point), contacts.state(), contacts.spared
        _, part, told = self._open(t, *point)
        # of equal shares the first counts, not what round-off makes the larger
        shares = np.argsort(-np.round(part, ALIKE), kind="stable").tolist()
        order = self._lowest_first(t, point, [k for k in shares if part[k] > NOTHING])
        zero = {k: abs(values[(row := contacts.contacts[k].value)]) <= contacts.observer.zero(row) for k in order}
        # those at zero first, by themselves, then with pivots; then those that are not
        for pivots, small in ((False, True), (True, True), (False, False)):
            for k in sorted(order, key=lambda k: k in turned):
                # wrong size for this pass, or frozen
                if zero[k] != small or k in contacts.frozen:
                    continue
                # gaps and frictions that move are not turned without need
                if not (small or contacts.contacts[k].kind in ("psi", "guarded")):
                    continue
                for turn in self._turns(k, values):
                    turn()
                    contacts.apply()
                    # spared: it may stand against its guard
                    contacts.spared = spared | {k}
                    found = self._near(t, point, settle, pivots=pivots)
                    # the same motion, and less open
                    if found is not None and self._goes_on(k, (point, found), told, small=small):
                        less = self.nullity(t, *found)
                        if less < open_:
                            yield found, less
                    contacts.become(before)
                    contacts.spared = spared

    def _lowest_first(self, t: float, point: Point, order: list[int]) -> list[int]:
        """Contacts by the index of the set in which one is turned: of diodes that may hold a node the one that is there
        anyhow, not one behind a coil, whose current then is a constraint of a constraint.
        """
        contacts, before = self.contacts, self.contacts.state()
        # a single one, or a large model: as they are
        if len(order) < 2 or self._system.unknowns > SMALL:
            return order
        indices = dict[int, int]()
        # the index with each of them turned
        for k in order:
            contacts.active[k] ^= True
            contacts.apply()
            indices[k] = self._index(t, *point)
            contacts.become(before)
        return sorted(order, key=indices.__getitem__)

    def _index(self, t: float, y: Floats, yd: Floats) -> int:
        """That of the equations with the present active set, less 1."""
        key = tuple(self.contacts.active.tolist())
        if key not in self._indices:
            n = self._system.form.written
            jy, jyd = (self._system.dense(part) for part in self._system.jacobian(t, y[:n], yd[:n]))
            # without slopes: behind all others
            finite = np.isfinite(jy).all() and np.isfinite(jyd).all()
            self._indices[key] = _index_of(*equilibrate(jyd, jy)) if finite else FAR
        return self._indices[key]

    def _goes_on(self, k: int, points: tuple[Point, Point], told: NDArray[np.bool_], *, small: bool) -> bool:
        """Whether the motion is the same: what a relation leaves open moves something where its sense decides, but not
        how frictions side by side share an effort, which is a flow of the mirror.  told [unknowns as written]: flows
        that are determined are the same, and those that have a rate of their own go on alike; small: what turns is 0.
        """
        (y, yd), (other, other_d) = points
        flows = self._moves & told
        # what turns is zero: nothing that moves may change
        if small:
            moves = _same(yd, other_d, self._moves & self._rated_unknowns, NOTHING) and _same(y, other, flows, NOTHING)
            return moves or self.contacts.contacts[k].hold < 0
        # it is not: flows and their rates stay within what counts
        least = self.contacts.observer.zero(self.contacts.contacts[k].value) / SAME  # what is less is no flow
        time = self.contacts.time
        size = np.abs(y[: flows.size][flows]).max(initial=least) / time if time > 0.0 else 0.0
        return _same(y, other, flows, SAME, least) and _same(yd, other_d, flows & self._rated_unknowns, SAME, size)

    @cached_property
    def _moves(self) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = np.isin(self._system.kinds, ("f", "s"))[: self._system.form.written]
        return found

    @cached_property
    def _rated_unknowns(self) -> NDArray[np.bool_]:
        """Unknowns [unknowns as written] whose rates the equations as written hold."""
        found = np.zeros(self._system.unknowns, dtype=bool)
        found[self._system.pattern.columns_of()[self._system.structural()[1]]] = True
        return found[: self._system.form.written]

    def _turns(self, k: int, values: Floats) -> Iterator[Callable[[], None]]:
        """What else contact k may be: friction that sticks may be at its bound in either sense, first that in which it
        is loaded, while others hold its bodies.
        """
        contacts, contact = self.contacts, self.contacts.contacts[k]
        # inequalities and guards: the other state
        if contact.kind in ("psi", "phi", "guarded"):
            yield lambda: contacts.flip(k, values)
        # a friction that sticks: at its bound, either way
        elif contact.kind == "friction" and contacts.active[k]:
            loaded = np.copysign(1.0, values[contact.multiplier])
            yield lambda: contacts.slip(k, loaded)
            yield lambda: contacts.slip(k, -loaded)

    def _near(self, t: float, point: Point, settle: Settle, *, pivots: bool) -> Point | None:
        """The point of the present active set where that fits, or with pivots of one that fits; None without."""
        # any set that fits from there
        if pivots:
            try:
                return self.pivoting.fit(t, *point, settle)
            except NoActiveSetError:
                return None
        found = settle(t, *point)
        if found is None or not self.contacts.fits(t, point[0], found):
            return None
        return found[:2]


def _index_of(e: Floats, b: Floats) -> int:
    """Of e y' + b y = r, less 1: the power with which the least singular value falls beyond the fastest rate."""
    # the fastest rate of rows that have one
    rated, own = np.abs(e).max(axis=1, initial=0.0), np.abs(b).max(axis=1, initial=0.0)
    rates = rated > 0.0
    size = np.where(rates, rated, 1.0)
    fast = float((own / size)[rates].max(initial=0.0)) or 1.0
    # at two ever faster rates: index k falls with the power k - 1
    ways = (e / size[:, None] + b / np.where(rates, size * fast * close, 1.0)[:, None] for close in CLOSE)
    near, far = (float(singular_decomposition(m)[1].min(initial=1.0)) for m in ways)
    return round(float(np.log(near / far) / np.log(CLOSE[1] / CLOSE[0]))) if min(near, far) > 0.0 else FAR


def _pencil(system: System, jy: Floats, jyd: Floats) -> tuple[Floats, Floats]:
    """dF/dy + GENERIC dF/dyd [unknowns, unknowns], equilibrated, and the factors of its columns."""
    e, b = system.dense(jyd), system.dense(jy)
    row, column = factors(e, b)
    return row[:, None] * (b + GENERIC * e) * column[None, :], column


def _same(a: Floats, b: Floats, which: NDArray[np.bool_], part: float, size: float = 0.0) -> bool:
    """Whether two vectors differ in these entries by no more than that part of the largest of them; size: at least."""
    pair = np.stack([one[: which.size][which] for one in (a, b)])
    return bool((np.abs(pair[0] - pair[1]) <= part * np.abs(pair).max(initial=size)).all())
