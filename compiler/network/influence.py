"""What influences what in a network, statement by statement: the graph that pruning walks.

A statement *joins* quantities that determine each other, and *reads* others, which influence the joined ones and are
not influenced by the statement:

    energy, content        joins the coordinates, nodes and branches of each summand
    work E on u            joins those of u, reads E
    phi, psi               joins its multiplier and what it constrains; signals in it are read (section 11, 25)
    gamma                  joins the implicit unknowns that it closes, reads the rest
    dynamic s' = ...       joins s, reads the right side
    branch                 joins its nodes and what it acts along; its law reads other elements (a transactor)
    two-port               joins both sides; signals in its ratio are read
    init                   joins all that it names: the consistent start moves each of them

Dynamic variables and implicit unknowns are read wherever they stand.  A family is one quantity.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from sysdyn.compiler.model.terms import summands
from sysdyn.dsl.model.calculus import signals_held
from sysdyn.dsl.model.expression import Node, variables
from sysdyn.dsl.model.network import Branch, Constraint, Coupling, Network, Shape, loop_indices, loop_ranges
from sysdyn.values import dataclass

Quantity = tuple[str, str]
"""What it is (x coordinate, n node, b branch, u implicit unknown, s state, c constraint) and its name."""
MECHANICAL = frozenset("xnb")
NOTHING = frozenset[Quantity]()
EVERYTHING: Quantity = ("*", "")
"""What an expression reads that no quantity stands for: a member of the audit."""


@dataclass(frozen=True, slots=True)
class InfluenceLink:
    """One statement.  item: what the network holds; piece: of an energy, its summand."""

    item: Any
    joined: frozenset[Quantity]
    reads: frozenset[Quantity]
    piece: Node | None = None

    def goes(self, gone: frozenset[Quantity]) -> bool:
        """Whether the statement is about what is left out; one that joins nothing goes with all that it reads."""
        return bool((self.joined or self.reads) & gone)


def read_by(network: Network, roots: Iterable[Node]) -> frozenset[Quantity]:
    """The quantities that stand in expressions."""
    unknowns = {u.name for u in network.unknowns}
    return frozenset([_quantity(n, unknowns) for root in roots for n in variables(root) if n.op == "var"])


def _quantity(node: Node, unknowns: set[str]) -> Quantity:
    """What a variable stands for in the graph of influences: its kind's letter and its owner's name."""
    name, kind, _ = node.data
    match kind:
        case "s":
            return "s", name
        case "kappa" | "mu":
            return "c", name
        case "e" if name in unknowns:
            return "u", name
        case "q" | "f" | "p" | "e":
            return "x", name
        case _ if kind[0] == "x":
            return "x", name
    return (kind[0], name) if kind[0] in "nb" else EVERYTHING


def quantities(network: Network) -> list[Quantity]:
    """All quantities of a network, by kind and in the order of the text."""
    groups: dict[str, Iterable[Any]] = {
        "x": network.coordinates,
        "n": network.nodes,
        "b": network.branches,
        "u": network.unknowns,
        "s": network.states,
        "c": (c for c in network.constraints if c.kind != "gamma"),
    }
    return list(dict.fromkeys((letter, item.name) for letter, items in groups.items() for item in items))


def links(network: Network) -> tuple[InfluenceLink, ...]:
    """One link a statement, and one a summand of an energy."""
    return tuple(_links(network))


def _links(network: Network) -> Iterator[InfluenceLink]:
    """All statements of a network as links between quantities: joined both ways, or read one way."""
    # summand by summand: a term that nobody needs may go alone
    for e in network.energies:
        for piece in summands(e.expression):
            yield replace(_acting(network, e, [piece], []), piece=piece)
    for w in network.works:
        yield _acting(network, w, [w.on], [w.effort])
    yield from _constraints(network)
    for d in network.dynamics:
        yield InfluenceLink(d, frozenset({("s", d.state.data[0])}), read_by(network, [d.expression]))
    for i in network.initials:
        yield InfluenceLink(i, read_by(network, [i.target, i.value]), frozenset())
    for b in network.branches:
        yield _branch(network, b)
    for c in network.couplings:
        yield _coupling(network, c)


def _acting(network: Network, item: Any, acted: Sequence[Node], read: Sequence[Node]) -> InfluenceLink:
    """A statement that acts on the coordinates, nodes and branches of some expressions."""
    all_ = read_by(network, acted)
    joined = frozenset(q for q in all_ if q[0] in MECHANICAL)
    return InfluenceLink(item, joined, (all_ - joined) | read_by(network, read))


def _link_of_workless(network: Network, item: Any, root: Node, own: frozenset[Quantity]) -> InfluenceLink:
    """A workless statement: its reactions hold signals fixed."""
    found = _acting(network, item, [signals_held(root)[0]], [root])
    return replace(found, joined=found.joined | own)


def _branch(network: Network, b: Branch) -> InfluenceLink:
    ends = [("n", end.node) for end in (b.plus, b.minus) if end is not None and end.node is not None]
    own, reads = frozenset([*ends, ("b", b.name)]), NOTHING if b.law is None else read_by(network, [b.law])
    if b.on is None:
        return InfluenceLink(b, own, reads)
    along = _acting(network, b, [b.on], [])
    return InfluenceLink(b, along.joined | own, along.reads | reads)


def _coupling(network: Network, c: Coupling) -> InfluenceLink:
    return _link_of_workless(network, c, c.ratio, frozenset({("b", c.first), ("b", c.second)}))


def _constraints(network: Network) -> Iterator[InfluenceLink]:
    for c in network.constraints:
        if c.kind != "gamma":
            yield _link_of_workless(network, c, c.expression, frozenset({("c", c.name)}))
    for item, closed in _closures(network):
        yield InfluenceLink(item, closed, read_by(network, [item.expression]))


def _closures(network: Network) -> Iterator[tuple[Constraint, frozenset[Quantity]]]:
    """Each gamma with the implicit unknowns that it closes.

    One whose rows are those of its only unknown that no other closes, closes that one; what is left closes together.
    """
    shapes = {u.name: u.shape for u in network.unknowns}
    gammas = [c for c in network.constraints if c.kind == "gamma"]
    open_ = [{q[1] for q in read_by(network, [c.expression]) if q[0] == "u"} for c in gammas]
    labels = [c.name for c in gammas]
    closes: dict[int, str] = {}
    while True:
        for k in (k for k in range(len(gammas)) if k not in closes):
            left = open_[k] - set(closes.values())
            if len(left) == 1 and labels.count(labels[k]) == 1 and _whole(gammas[k], shapes[min(left)]):
                closes[k] = left.pop()
                break
        else:
            break
    for k, c in enumerate(gammas):
        names = {closes[k]} if k in closes else open_[k] - set(closes.values())
        yield c, frozenset(("u", name) for name in names)


def _whole(c: Constraint, shape: Shape) -> bool:
    """Whether there is one row for each element of an unknown of that shape."""
    ranges = loop_ranges(c.loops)
    return ranges == shape and c.at == loop_indices(c.loops)


def influences_on(found: Sequence[InfluenceLink], asked: frozenset[Quantity]) -> frozenset[Quantity]:
    """All that influences what is asked: through what is joined both ways, through what is read one way."""
    of: dict[Quantity, list[int]] = {}
    # which links join each quantity
    for k, link in enumerate(found):
        for q in link.joined:
            of.setdefault(q, []).append(k)
    kept, ahead = set(asked), list(asked)
    followed = bytearray(len(found))
    # a joined quantity brings all that its links join and read
    while ahead:
        for k in of.get(ahead.pop(), ()):
            if not followed[k]:
                followed[k] = True
                new = (found[k].joined | found[k].reads) - kept
                kept |= new
                ahead += new
    return frozenset(kept)
