"""Branches that carry no flow (no effort, at common-flow nodes), for nothing behind them closes a loop.

    end     it ends at a node which no other element touches, and goes with the node
    tie     it alone joins a part of common-effort nodes to the ground (the resistor at a winding): the part floats then

Such an element acts on nothing: the balance of what is behind it is its flow alone.  It stays where anything reads it
or a node behind it, where an initial value is given to either, and where it is a source of what the nodes balance (the
contradiction is the compiler's to tell).  Ends at single nodes only; a part without a ground keeps them, for the node
that its efforts count from is chosen by how many elements touch it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from sysdyn.compiler.network.influence import InfluenceLink, Quantity
from sysdyn.dsl.model.network import Branch, Network

STORES = frozenset(("kinetic", "potential", "dissipator"))


def dead_branches(
    network: Network, found: Sequence[InfluenceLink], asked: frozenset[Quantity]
) -> list[frozenset[Quantity]]:
    """Each dead branch with its end node; ties where there are no ends any more."""
    touched = Counter(q for link in found for q in link.joined)
    read = set(asked)
    for link in found:
        read |= link.reads - link.joined if isinstance(link.item, Branch) else link.reads
    alone = {q for q, links in touched.items() if links == 1 and q not in read}
    able = [b for b in network.branches if ("b", b.name) in alone and _able(b)]
    ends = [(b, q) for b in able for q in _nodes(b) if q in alone and len(set(_ends(b))) == 2]
    grounded = _nodes_joined_to_ground(network) if ends else set[str | None]()
    single = {("n", n.name) for n in network.nodes if n.name in grounded and not n.shape}
    dead = {b.name: end for b, end in reversed(ends) if end in single}  # of two ends the first
    if not dead:
        return list(_ties(network, found, able, asked))
    return [frozenset({("b", b.name), dead[b.name]}) for b in network.branches if b.name in dead]


def _able(b: Branch) -> bool:
    """Whether it may carry nothing."""
    balanced = "flow" if b.domain.common == "effort" else "effort"
    return not b.loops and b.kind in STORES | {"effort", "flow"} - {balanced}


def _ends(b: Branch) -> list[str | None]:
    """The nodes at its ends (None: the ground)."""
    return [end.node for end in (b.plus, b.minus) if end is not None]


def _nodes(b: Branch) -> list[Quantity]:
    return [("n", name) for name in _ends(b) if name is not None]


def _ties(
    network: Network, found: Sequence[InfluenceLink], able: Sequence[Branch], asked: frozenset[Quantity]
) -> Iterator[frozenset[Quantity]]:
    """Each branch that alone joins nodes to the ground, to which nothing but branches refers."""
    ties = [b for b in able if b.domain.common == "effort" and None in _ends(b) and _nodes(b)]
    if not ties:
        return
    told = set(asked)
    # what anything but a plain branch reads or joins must stay
    for link in found:
        plain = isinstance(link.item, Branch) and link.item.on is None
        told |= link.reads if plain else link.reads | link.joined
    beside: dict[Quantity, list[Branch]] = {}
    for b in network.branches:
        for q in set(_nodes(b)):
            beside.setdefault(q, []).append(b)
    seen = set[Quantity]()
    for b in ties:
        part, ahead, joins = set[Quantity](), [q for q in _nodes(b) if q not in seen], 0
        # the part that the branch's nodes belong to, and how many branches join it to the ground
        while ahead:
            q = ahead.pop()
            if q not in part:
                part.add(q)
                joins += sum(None in _ends(other) for other in beside[q])
                ahead += [q for other in beside[q] for q in _nodes(other)]
        seen |= part
        # a single tie carries no flow: the reference alone
        if joins == 1 and not part & told:
            yield frozenset({("b", b.name)})


def _nodes_joined_to_ground(network: Network) -> set[str | None]:
    """Nodes that branches join to the ground of their domain (None)."""
    beside: dict[str | None, set[str | None]] = {}
    for b in network.branches:
        ends = set(_ends(b))
        for end in ends:
            beside.setdefault(end, set()).update(ends)
    seen: set[str | None] = {None}
    ahead: list[str | None] = [None]
    while ahead:
        new = beside.get(ahead.pop(), set()) - seen
        seen |= new
        ahead += new
    return seen
