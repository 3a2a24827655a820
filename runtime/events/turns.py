"""Friction on a reaction (gamma: R + c*setsign(u)): whether c keeps the sign with which it brakes.

The text may write it with either sign of c, for what c acts on has either sense; what a reaction tells may pass zero
in a run, and what braked until then drives from there on.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.events.succession import Point, Succession
from sysdyn.runtime.model.failures import SolverFailure

if TYPE_CHECKING:
    from sysdyn.runtime.events.watches import Watched


class Turns:
    """Of a run: the relations that are such a c against zero, and the frictions seen to act on their u."""

    def __init__(self, plan: Plan, observer: Observer, succession: Succession) -> None:
        self._plan, self._observer, self._succession = plan, observer, succession
        self._of = {c.turn: k for k, c in enumerate(plan.contacts) if c.turn >= 0}
        self._acting: set[int] = set()

    def seen(self, t: float, point: Point) -> None:
        """Which of them slip and act there; SolverFailure where one drives."""
        active = self._succession.contacts.active
        # frictions that have not been seen acting
        left = {k for k in self._of.values() if k not in self._acting and not active[k]}
        if not left or self._succession.restart is None:
            return
        # one that drives from here on
        drives = self._succession.driving_friction(t, *point, self._observer(t, *point))
        if drives is not None:
            raise SolverFailure("drives", t, 0.0, drives)
        self._acting |= {k for k in left if self._succession.acts(k, t, *point)}

    def verify_passage(self, t: float, which: Sequence[Watched]) -> Sequence[Watched]:
        """What else passes zero there; SolverFailure where c of a friction that slips and acts does, but at a corner,
        which turns it back (abs): that is seen again behind it.
        """
        through = {w.relation: k for w in which if (k := self._of.get(w.relation, -1)) >= 0}
        # a corner turns it back: seen behind it
        if any(w.kink >= 0 for w in which):
            self._acting -= set(through.values())
            return [w for w in which if w.relation not in through]
        # one that acts and slips must not pass zero
        for k in through.values():
            if k in self._acting and not self._succession.contacts.active[k]:
                raise SolverFailure("drives", t, 0.0, self._plan.contacts[k].name)
        return which
