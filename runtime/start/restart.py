"""Across an instant at which the text of the model jumps: the state is kept, what follows from it is found anew.

Displacements, momenta, flows with inertia and dynamic variables keep their values unless a constraint forces them
(instant.py); multipliers, implicit efforts, flows without inertia and rates are found behind it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.start.instant import Instant, UnbalancedError
from sysdyn.runtime.start.linearly import contradicting, unmet
from sysdyn.runtime.start.settled import HELD, Settler
from sysdyn.runtime.start.starter import Starter
from sysdyn.runtime.start.strategies import behind

CLOSE = tuning.SAME
"""Scaled residual with which a point lives (settle.c)."""
STILL = tuning.MET
"""Of its magnitude: what a state may move by and has not jumped."""
GUESSES = (0.0, *(sign * size for size in (1.0, 0.1, 1e-2, 1e-3, 10.0) for sign in (1.0, -1.0)))
"""Of their magnitudes: what flows without inertia and implicit efforts are moved by before a state is."""
SLACK = tuning.UNSEEN
"""Of its magnitude: what a state may move by where rows hold only nearly."""
NEXT_TO_ZERO = tuning.UNSEEN
"""Of its magnitude: what follows and is less says nothing of its size."""


def still(
    settler: Settler, t: float, point: tuple[Floats, Floats], state: NDArray[np.bool_], magnitude: Floats
) -> tuple[Floats, Floats] | None:
    """Y, yd [unknowns as written] settled at t where no state [unknowns] moves for it; None where one does."""
    found, moved = _held(settler, t, point, magnitude)
    return None if found is None or moved[state].any() else found


def _held(
    settler: Settler, t: float, point: tuple[Floats, Floats], magnitude: Floats
) -> tuple[tuple[Floats, Floats] | None, NDArray[np.bool_]]:
    """The point settled at t with the state held as far as it may be (None: it does not settle), and what moves."""
    settler.core.contents.ready = 0
    found, rate, done = settler.held(t, *point)
    return (found, rate) if done else None, ~(settler.of_state(found - point[0]) <= STILL * magnitude)


class Restart:
    """state [unknowns as written]: the unknowns that keep their values; sums: whether what rows say together may empty
    a store.  Where something opens for what drives it (a freewheel) no store is emptied.
    """

    def __init__(self, settler: Settler, state: NDArray[np.bool_]) -> None:
        self.settler, self.state, self.sums = settler, state, True
        self.instant = Instant(settler.system)

    def across(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats] | None:
        """y, yd [unknowns as written] on the far side at t; None where none was found, SolverFailure where a balance
        over the instant is not met, or where there is no balance (`bounded`).
        """
        self.bounded(t, y, yd)
        try:
            found = self._struck(t, y, yd, self.magnitude(y.size))
        except UnbalancedError as error:
            raise self.failure(t, error) from error
        return None if found is None else found[:2]

    def failure(self, t: float, error: UnbalancedError) -> SolverFailure:
        """What a balance over the instant t that is not met is told as."""
        return SolverFailure("unbalanced", t, 0.0, row=self.settler.system.row_label(error.row))

    def bounded(self, t: float, y: Floats, yd: Floats) -> None:
        """SolverFailure where what a store holds at the point is none that its law lets it hold."""
        found = self.instant.unbounded(t, y, yd, self.magnitude(y.size))
        if found is not None:
            raise SolverFailure(found[0], t, 0.0, row=self.settler.system.row_label(found[1]))

    def struck(self, t: float, y: Floats, yd: Floats, *, quickly: bool = False) -> tuple[Floats, Floats, Floats] | None:
        """The point on the far side at t with the impulses [unknowns as written] that took the flows there, of a set of
        constraints that is tried; quickly: without a search. Sizes stay as they were: where it has no rank its
        multipliers are without bound.
        """
        known = self.magnitude(y.size)
        try:
            found = self._struck(t, y, yd, known, quickly=quickly, tried=True)
        except UnbalancedError:
            # a balance that is not met: no point of this set
            found = None
        lib.reader(self.settler.core.contents.scale, y.size)[:] = known
        return None if found is None or not found[3] else found[:3]

    def _struck(
        self, t: float, y: Floats, yd: Floats, magnitude: Floats, *, quickly: bool = False, tried: bool = False
    ) -> tuple[Floats, Floats, Floats, bool] | None:
        """The point on the far side, its impulses, and whether rates of rows are met too; magnitude [unknowns as
        written] before it; tried: of a set of constraints that is tried, not across a jump of the text.
        """
        before, yd = y, yd.copy()
        yd[self.settler.system.idle_multipliers()] = 0.0  # what does not hold any more pushes no more
        same, moved = _held(self.settler, t, (y, yd), magnitude)
        moved &= self.state
        if same is not None and not moved.any():  # no state need jump: there is no impulse
            return *same, np.zeros(y.size), self._lives
        # a switch that opens on a coil: the exponential law beside it bears its current, and no store jumps
        if self.settler.system.form.scales and not quickly:
            steep, contradicts = self._search(t, y, yd, free=False)
            if steep is not None and (kept := still(self.settler, t, steep, self.state, magnitude)) is not None:
                return *kept, np.zeros(y.size), True
            # of a set that is tried no linear row asks for an impulse: contents would jump because the search failed
            if tried and steep is None and not contradicts:
                return None
        push = None
        # states jump: displacements first, then flows
        if same is None or moved[self.settler.system.kinds == "q"].any():
            y, push = self.instant.displacements(t, y, yd, magnitude, sums=self.sums)
        y, impulse = self.instant.flows(t, y, yd, magnitude, push=push)
        kept = self._kept(t, y, yd, magnitude)
        # the point that holds the state behind the jump
        if kept is not None:
            return *kept, impulse, self._lives
        # what follows may jump by far more than its magnitude: at equal weights that would move the state
        self.settler.core.contents.ready = 0
        found, rate, done = self.settler.settle(t, y, yd, hold=HELD)
        # settled with a state that hardly moves
        if done and self._stays(found, y, magnitude):
            return found, rate, impulse, self._lives
        # linear algebra tells that there is none
        if quickly or unmet(self.settler, t, y, yd, self.settler.alone(self.state)):
            return None
        # what follows is sought from where it was: impulses move it along slopes that steep laws had before the jump
        searched, _ = self._search(t, np.where(self.state, y, before), yd)
        stays = searched is not None and self._stays(searched[0], y, magnitude)
        return (*searched, impulse, True) if searched is not None and stays else None

    @property
    def _lives(self) -> bool:
        """Whether what settled last meets the rates of rows too: where a law is steep without bound one need not, but a
        source that diodes short where it goes through zero has none.
        """
        return bool(self.settler.core.contents.residual <= CLOSE)

    def _stays(self, found: Floats, y: Floats, magnitude: Floats) -> bool:
        """Whether the state is where the balances of the instant put it; one that moves besides is no answer."""
        return bool((self.settler.of_state(found - y) <= SLACK * magnitude)[self.state].all())

    def _kept(self, t: float, y: Floats, yd: Floats, magnitude: Floats) -> tuple[Floats, Floats] | None:
        """The point settled without a move of the state, searched from flows and efforts of either sign and several
        sizes: at rest a law may be flat, and a state that moves is then the nearest way out, though nothing forces it.
        """
        follows = np.isin(self.settler.system.kinds, ("f", "e")) & ~self.state
        # beside the jump, with guesses of flows and efforts
        for part in GUESSES if follows.any() else GUESSES[:1]:
            beside = np.where(follows, y + part * magnitude, y), yd
            if (found := still(self.settler, t, beside, self.state, magnitude)) is not None:
                return found
        return None

    def magnitude(self, number: int) -> Floats:
        """Magnitudes [number] of the first unknowns."""
        return lib.reader(self.settler.core.contents.scale, number).copy()

    def _search(
        self, t: float, y: Floats, yd: Floats, *, free: bool = True
    ) -> tuple[tuple[Floats, Floats] | None, bool]:
        """y, yd as a start finds them, first with the state held, then (free) with everything free, and whether linear
        rows leave none there.
        """
        # rows of a start, without initial values
        starter = Starter(self.settler.system.another("3"))
        starter.every &= ~starter.groups("initial")
        # nothing is known behind a jump by what was next to zero before it, rates least of all
        near = ~self.state & (np.abs(y) < NEXT_TO_ZERO * self.magnitude(y.size))
        guess = starter.unknowns(t, np.where(near, 0.0, y), np.zeros_like(yd))
        # a rate of a multiplier that is zero because its constraint does not hold stays zero
        idle, state = np.zeros((2, guess.size), dtype=bool)
        idle[starter.n :] = np.isin(starter.rates, starter.system.idle_multipliers())
        guess[idle], state[: y.size] = 0.0, self.state
        # the state held, then free
        for held in (state, np.zeros_like(state))[: 1 + free]:
            may = ~(idle | held)
            contradicts = contradicting(starter, t, guess, may) is not None
            found = None if contradicts else behind(starter, t, guess, may)
            if found is not None:
                return starter.expand(found), False
        return None, contradicts
