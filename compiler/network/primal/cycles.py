"""Loops of branches, by families of nodes: what may stand in one."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.model.connected_components import Joined


def in_loops(branches: Sequence[tuple[str, str, int]]) -> frozenset[int]:
    """Places of those (families of nodes at their two ends, how many they are) that stand in a part of the network in
    which a loop of them is closed.
    """
    parts = Joined[str]()
    within: dict[str, int] = {}
    beside: dict[str, int] = {}
    closed: set[str] = set()
    for one, other, number in branches:
        if one == other:
            within[one] = within.get(one, 0) + 1
            continue
        for end in (one, other):
            beside[end] = beside.get(end, 0) + number
        if not parts.join(one, other):
            closed.add(one)
    # a chain within a family closes a loop with another one, or with two ways out of it
    closed |= {name for name, number in within.items() if number > 1 or beside.get(name, 0) > 1}
    found = {parts.first(name) for name in closed}
    return frozenset(k for k, (one, _, _) in enumerate(branches) if parts.first(one) in found)
