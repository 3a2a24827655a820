"""Loops of branches, by families of nodes: what may stand in one."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.compiler.network.primal.bounds import box_size
from sysdyn.compiler.network.primal.incidence import Element
from sysdyn.dsl.model.joined import Joined


def in_loops(elements: Sequence[Element]) -> frozenset[int]:
    """Numbers of those that stand in a part of the network in which a loop of them is closed."""
    parts = Joined[str]()
    within: dict[str, int] = {}
    beside: dict[str, int] = {}
    closed: set[str] = set()
    for e in elements:
        one, other = (contact.node for contact in e.ends)
        if one == other:
            within[one] = within.get(one, 0) + 1
            continue
        for end in (one, other):
            beside[end] = beside.get(end, 0) + box_size(e.box)
        if not parts.join(one, other):
            closed.add(one)
    # a chain within a family closes a loop with another one, or with two ways out of it
    closed |= {name for name, number in within.items() if number > 1 or beside.get(name, 0) > 1}
    found = {parts.first(name) for name in closed}
    return frozenset(e.number for e in elements if parts.first(e.ends[0].node) in found)
