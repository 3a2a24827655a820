"""Gaps and one-way flows asked all at once; what each is asked for stands in contacts.py."""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.events.plan import Contact
from sysdyn.runtime.model.description import Floats

if TYPE_CHECKING:
    from sysdyn.runtime.events.contacts import Contacts

BODIES = 4.0
"""Inertias that a contact may stop at once, of the one that its largest multiplier and rate tell."""
BEYOND = tuning.UNSEEN
"""Of the largest value of a gap: one that is less than nothing by more has jumped, and does not stay where it is."""


class Inequalities:
    """Those of gaps and flows that no guard takes away, asked all at once as `Contacts._unilateral` asks one."""

    def __init__(self, contacts: Sequence[Contact], multiplier: Sequence[int], frozen: Container[int]) -> None:
        # gaps and one-way flows without guard, that are not frozen
        found = [
            (k, c.kind == "phi", c.value, c.rate, c.acceleration, c.multiplier, multiplier[k])
            for k, c in enumerate(contacts)
            if c.kind in ("phi", "psi") and c.guard < 0 and k not in frozen
        ]
        table = np.array(found, dtype=np.int64).reshape(len(found), 7).T
        self.number, gap, self._value, self._rate, self._acceleration, self._multiplier, self._unknown = table
        self._gap = gap != 0

    def wrong(self, values: Floats, impulses: Floats, contacts: Contacts) -> NDArray[np.bool_]:
        """Which are wrong as they are [inequalities]."""
        zeros, largest = contacts.observer.zeros, contacts.observer.largest
        value, rate, acceleration = values[self._value], values[self._rate], values[self._acceleration]
        # one that holds pulls
        flow = zeros(np.where(self._gap, self._rate, self._value))
        change = largest[np.where(self._gap, self._acceleration, self._rate)]
        stops = np.divide(BODIES * flow, change, out=np.zeros_like(flow), where=change > 0.0)
        nothing = zeros(self._multiplier)
        small = np.maximum(nothing * contacts.time, stops * largest[self._multiplier])
        struck = np.where(self._unknown >= 0, impulses[self._unknown], 0.0)
        pulls = (struck < -small) | (values[self._multiplier] < -nothing)
        # one that is open closes
        zero, still = zeros(self._value), zeros(self._rate)
        above = value > np.where(np.isin(self.number, list(contacts.open)), 0.0, zero)
        beyond = value < -(zero if contacts.starting else BEYOND * largest[self._value])
        falls = (rate < -still) | ((rate <= still) & (acceleration < -zeros(self._acceleration)))
        closes = ~above & np.where(self._gap, beyond | falls, (value < -zero) | (rate < -still))
        return np.where(contacts.active[self.number], pulls, closes)
