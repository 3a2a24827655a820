"""Branches that end at a node which no other element touches: their flow is zero (their effort, at common-flow nodes).

Such an element acts on nothing: the balance of that node is its flow alone.  It stays where anything reads it or its
node, where an initial value is given to either, and where it is a source of what the node balances (the contradiction
is the compiler's to tell).  Single nodes only; a part without a ground keeps them, for the node that its efforts
count from is chosen by how many elements touch it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.compiler.network.influence import Link, Quantity
from sysdyn.dsl.model.network import Branch, Network, Shape

STORES = frozenset(("kinetic", "potential", "dissipator"))


def dead_branches(network: Network, found: Sequence[Link], asked: frozenset[Quantity]) -> list[frozenset[Quantity]]:
    """Each dead branch with its end node."""
    touched: dict[Quantity, list[Link]] = {}
    read = set(asked)
    for link in found:
        read |= link.reads - (link.joined if isinstance(link.item, Branch) else frozenset())
        for q in link.joined:
            touched.setdefault(q, []).append(link)
    dead: list[frozenset[Quantity]] = []
    grounded = _grounded(network)
    shapes = {n.name: n.shape for n in network.nodes if n.name in grounded}
    for b in network.branches:
        if len(touched["b", b.name]) == 1 and ("b", b.name) not in read:
            dead += [frozenset({("b", b.name), end}) for end in _ends(shapes, b, touched, read)][:1]
    return dead


def _ends(
    shapes: dict[str, Shape], b: Branch, touched: dict[Quantity, list[Link]], read: set[Quantity]
) -> Iterator[Quantity]:
    """End nodes of the branch that nothing else touches or reads; shapes: of all nodes that are joined to a ground."""
    balanced = "flow" if b.domain.common == "effort" else "effort"
    allowed = STORES | {"effort", "flow"} - {balanced}
    names = [end.node for end in (b.plus, b.minus) if end is not None and end.node is not None]
    if b.loops or b.kind not in allowed or len(names) != 2 or names[0] == names[1]:
        return
    for name in names:
        if shapes.get(name) == () and len(touched["n", name]) == 1 and ("n", name) not in read:
            yield "n", name


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
