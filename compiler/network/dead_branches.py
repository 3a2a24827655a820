"""Branches that end at a node which no other element touches: their flow is zero (their effort, at common-flow nodes).

Such an element acts on nothing: the balance of that node is its flow alone.  It stays where anything reads it or its
node, where an initial value is given to either, and where it is a source of what the node balances (the contradiction
is the compiler's to tell).  Single nodes only; a part without a ground keeps them, for the node that its efforts
count from is chosen by how many elements touch it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence

from sysdyn.compiler.network.influence import Link, Quantity
from sysdyn.dsl.model.network import Branch, Network

STORES = frozenset(("kinetic", "potential", "dissipator"))


def dead_branches(network: Network, found: Sequence[Link], asked: frozenset[Quantity]) -> list[frozenset[Quantity]]:
    """Each dead branch with its end node."""
    touched = Counter(q for link in found for q in link.joined)
    read = set(asked)
    for link in found:
        read |= link.reads - link.joined if isinstance(link.item, Branch) else link.reads
    alone = {q for q, links in touched.items() if links == 1 and q not in read}
    ends = [(b, end) for b in network.branches if ("b", b.name) in alone for end in _ends(b, alone)]
    if not ends:
        return []
    grounded = _grounded(network)
    single = {("n", n.name) for n in network.nodes if n.name in grounded and not n.shape}
    dead = {b.name: end for b, end in reversed(ends) if end in single}  # of two ends the first
    return [frozenset({("b", b.name), dead[b.name]}) for b in network.branches if b.name in dead]


def _ends(b: Branch, alone: Collection[Quantity]) -> Iterator[Quantity]:
    """End nodes of the branch among those that nothing else touches or reads."""
    balanced = "flow" if b.domain.common == "effort" else "effort"
    allowed = STORES | {"effort", "flow"} - {balanced}
    names = [end.node for end in (b.plus, b.minus) if end is not None and end.node is not None]
    if b.loops or b.kind not in allowed or len(names) != 2 or names[0] == names[1]:
        return
    yield from (("n", name) for name in names if ("n", name) in alone)


def _grounded(network: Network) -> set[str | None]:
    """Nodes that branches join to the ground of their domain (None)."""
    beside: dict[str | None, set[str | None]] = {}
    for b in network.branches:
        ends = {end.node for end in (b.plus, b.minus) if end is not None}
        for end in ends:
            beside.setdefault(end, set()).update(ends)
    seen: set[str | None] = {None}
    ahead: list[str | None] = [None]
    while ahead:
        new = beside.get(ahead.pop(), set()) - seen
        seen |= new
        ahead += new
    return seen
