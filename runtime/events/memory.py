"""What followed from active sets before, part by part of the model.

Parts share no unknown (converters on one ground): what happens in one says nothing of the others, and ten of them with
four sets each have forty answers to remember, not four to the power of ten.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.numerics.components import components

State = tuple[float, ...]
"""As `Contacts.state` gives it: what holds [contacts], senses [contacts]."""


class Memory:
    """Of one run."""

    def __init__(self, contacts: Contacts) -> None:
        self.contacts = contacts
        self._followed = dict[tuple[State, tuple[int, ...], int], State]()

    @cached_property
    def _parts(self) -> list[list[int]]:
        """The places in a state of the contacts of each part; of those without a multiplier together."""
        system, number = self.contacts.system, len(self.contacts.contacts)
        label = components(system.pattern.row, system.pattern.columns_of(), system.unknowns)
        # by connected parts; -1: without a multiplier
        found = dict[int, list[int]]()
        for k, at in enumerate(self.contacts.multiplier):
            found.setdefault(int(label[at]) if at >= 0 else -1, []).append(k)
        return [[*part, *(number + k for k in part)] for part in found.values()]

    def _keys(self, stood: State, touched: Sequence[int]) -> list[tuple[State, tuple[int, ...], int]]:
        own = [tuple(stood[k] for k in part) for part in self._parts]
        return [(s, tuple(k for k in touched if k in part), part[0]) for s, part in zip(own, self._parts, strict=True)]

    def recall(self, stood: State, touched: Sequence[int]) -> State | None:
        """The state that followed when this happened before in each part; None where it did not in one."""
        found = [self._followed.get(key) for key in self._keys(stood, touched)]
        after = list(stood)
        for part, own in zip(self._parts, found, strict=True):
            # not seen in this part yet
            if own is None:
                return None
            for k, value in zip(part, own, strict=True):
                after[k] = value
        return tuple(after)

    def learn(self, stood: State, touched: Sequence[int], after: State) -> None:
        """That followed."""
        for part, key in zip(self._parts, self._keys(stood, touched), strict=True):
            self._followed[key] = tuple(after[k] for k in part)
