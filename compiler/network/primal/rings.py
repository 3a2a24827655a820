"""Loops of branches, by families of nodes: what may close one."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.compiler.network.primal.bounds import box_size
from sysdyn.compiler.network.primal.incidence import Element
from sysdyn.dsl.model.joined import Joined
from sysdyn.dsl.model.network import Branch, Terminal


def _family(branch: Branch, terminal: Terminal | None) -> str:
    """The node family at an end of a branch; the ground of its domain has a name of its own."""
    node = None if terminal is None else terminal.node
    return f"#ground {branch.domain.name}" if node is None else node


def closes(branch: Branch, others: Sequence[Branch]) -> bool:
    """Whether other branches lead from one end of a branch to the other."""
    pairs = [{_family(b, t) for t in (b.plus, b.minus)} for b in others if b is not branch]
    reached, goal = {_family(branch, branch.plus)}, _family(branch, branch.minus)
    if goal in reached:
        return reached in pairs
    while found := [pair for pair in pairs if pair & reached and pair - reached]:
        reached.update(*found)
    return goal in reached


def in_loops(stores: Sequence[Element]) -> list[Element]:
    """Those of parts of the network in which a loop of them is closed."""
    parts = Joined[str]()
    within: dict[str, int] = {}
    beside: dict[str, int] = {}
    closed: set[str] = set()
    for e in stores:
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
    return [e for e in stores if parts.first(e.ends[0].node) in found]
