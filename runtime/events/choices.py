"""Observed quantities that nothing determines: what floats between contacts that are all closed off.

Four switches of a bridge that are open leave the potential of its load open, and four clutches on two shafts their
shares of a torque.  One of them then stands otherwise than its guard says (determined.py), and what is
observed of it follows from which: the motion does not.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.events.determined import Determined
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.points import normal

SAME = tuning.SAME
"""Of what a move anywhere changes: what one along an open direction may change by round-off."""


class Choices:
    """found: row of block observe -> the contacts between which it floated, at some time."""

    def __init__(self, contacts: Contacts, determined: Determined) -> None:
        self.found: dict[int, tuple[str, ...]] = {}
        self._contacts, self._determined = contacts, determined
        self._begun: dict[tuple[float, ...], list[int]] = {}
        self._seen = set[tuple[float, ...]]()
        self._closed = set[tuple[tuple[float, ...], int]]()  # sets and contacts without which nothing is open
        self._observer = Observer(contacts.system)  # its own: no size is met here

    def begin(self, t: float, y: Floats, yd: Floats) -> None:
        """A piece of the motion begins at a point.  y, yd [unknowns as written]."""
        state = self._contacts.state()
        # each active set is asked about once
        if state not in self._seen:
            self._begun[state] = self._idle(self._observer(t, y, yd))

    def end(self, t: float, y: Floats, yd: Floats) -> None:
        """It ends at a point: of contacts that were idle from its begin on, while others are at work, each set is asked
        once what would be open without one of them.
        """
        contacts, state = self._contacts, self._contacts.state()
        begun = self._begun.pop(state, [])
        # those that were idle at the begin and are idle at the end
        values = self._observer(t, y, yd) if begun else np.zeros(0)
        for k in set(begun) & set(self._idle(values)) if begun else ():
            if (state, k) in self._closed:
                continue
            # without contact k: what is then open, and between which contacts
            contacts.active[k] ^= True
            contacts.apply()
            directions, between = self._determined.directions(t, y, yd)
            contacts.become(state)
            # nothing is open without it
            if not len(directions):
                self._closed.add((state, k))
            # something open that others decide
            elif not all(contacts.idle(i, values) for i in between):
                self._seen.add(state)
                self._add(t, (y, yd), directions, tuple(contacts.contacts[i].name for i in between))

    def _idle(self, values: Floats) -> list[int]:
        """Contacts that do nothing, and are not about to."""
        contacts = self._contacts
        return [k for k, c in enumerate(contacts.contacts) if c.hold < 0 and contacts.rests(k, values)]

    def _add(self, t: float, point: tuple[Floats, Floats], directions: Floats, between: tuple[str, ...]) -> None:
        """What is observed along the directions [number, unknowns as written]."""
        y, yd = point
        # a move of anything, for comparison
        size = np.abs(y).max(initial=0.0) or 1.0
        anywhere = self._change(t, y, yd, size * normal(1, y.size)[0])
        # an observed quantity that moves along an open direction is a choice
        for way in directions:
            change = self._change(t, y, yd, size * way / np.abs(way).max())
            for row in np.flatnonzero(change > SAME * anywhere).tolist():
                self.found.setdefault(row, between)

    def _change(self, t: float, y: Floats, yd: Floats, move: Floats) -> Floats:
        """Of what is observed [observed] by a move [unknowns as written] of y."""
        moved = y.copy()
        moved[: move.size] += move
        change: Floats = np.abs(self._observer(t, moved, yd) - self._observer(t, y, yd))
        return change
