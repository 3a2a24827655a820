"""Branches in series between nodes that are no mere links of two: what irregular netlists have alike.

A *joint* is a node that two branches touch, and nothing else.  A *strand* is a way through joints from one other node,
a *bus*, to the next; a branch between buses is one by itself.  Strands of the same laws in the same senses are alike
whatever they join: the k-th of them is element k of one family of branches for each link, and of one family of nodes
for each joint; which buses they join stands in tables of indices.

Received: a Network, shapes of laws, and what stands in families already.  Returned: classes of strands, and the buses.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence

from sysdyn.compiler.network.neighbourhoods import RUN, BranchSequence, FamilyLaws, Found, Site
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.network import Branch, Network
from sysdyn.values import dataclass

MANY = 4
"""Ends of strands that a family of buses has for each end of another branch there, at least."""


@dataclass(frozen=True, slots=True)
class Strand:
    """Branches in the order of the way, each with its sense, and the nodes before, between and behind them."""

    branches: tuple[tuple[Branch, bool], ...]
    nodes: tuple[str | None, ...]

    def reverse(self) -> Strand:
        """The strand the other way round."""
        return Strand(tuple((b, not sense) for b, sense in reversed(self.branches)), self.nodes[::-1])


@dataclass(frozen=True, slots=True)
class Strands:
    """Classes of strands that are alike; families of buses by a key: names in the order of the text."""

    classes: tuple[tuple[Strand, ...], ...]
    buses: Mapping[str, tuple[str, ...]]


class _Graph:
    """Branches that may stand in families: loose; free: nodes that may, with their domains."""

    def __init__(self, network: Network, laws: FamilyLaws, taken: Collection[str]) -> None:
        told = {i.target.data[0] for i in network.initials if i.target.op == "var" and i.target.data[1] == "ne"}
        self.free = {
            n.name: n.domain.name
            for n in network.nodes
            if not n.shape and n.name not in network.read
            if n.name not in told and n.name not in taken
        }
        self.loose: dict[str, Branch] = {}
        self.at: dict[str, list[Branch]] = {}
        self.parts = Joined[str]()
        # loose branches: of a law with a number, at a node that nothing else reads
        for b in network.branches:
            ends = [end for end in (b.plus, b.minus) if end is not None]
            names = [end.node for end in ends if end.node is not None]
            for name in names:
                self.at.setdefault(name, []).append(b)
            if len(names) == 2 and not any(end.at for end in ends):  # of arrays only the family shows
                self.parts.join(*names)
            known = b.name in laws.numbers and b.name not in taken and len(set(names)) == len(names)
            if known and not self.free.keys().isdisjoint(names) and not any(n in taken for n in names):
                self.loose[b.name] = b
        self.joints: dict[str | None, list[Branch]] = {
            name: here
            for name, here in self.at.items()
            if len(here) == 2 and name in self.free and here[0].name in self.loose and here[1].name in self.loose
        }
        """Nodes where two loose branches meet, and nothing else does."""

    def strands(self) -> Iterator[Strand]:
        """All, in the order of their first branches; circles of joints alone are none."""
        seen = set[str]()
        for b in self.loose.values():
            if b.name in seen:
                continue
            one, two = _end(b, False), _end(b, True)
            if one not in self.joints and two not in self.joints:
                yield Strand(((b, True),), (one, two))
                continue
            ahead, behind = self._way(b, sense=True), self._way(b, sense=False)
            seen |= {c.name for c, _ in (*ahead[0], *behind[0])}
            if ahead[1][-1] not in self.joints:
                back = Strand(*behind).reverse()
                yield Strand((*back.branches[:-1], *ahead[0]), (*back.nodes[:-2], *ahead[1]))

    def _way(self, b: Branch, *, sense: bool) -> tuple[tuple[tuple[Branch, bool], ...], tuple[str | None, ...]]:
        """From a branch on, in one sense, until a node that is no joint or the branch itself."""
        branches, nodes = [(b, sense)], [_end(b, not sense), _end(b, sense)]
        while nodes[-1] in self.joints:
            last, here = branches[-1][0], nodes[-1]
            after = next(c for c in self.joints[here] if c is not last)
            if after is b:
                break
            onward = _end(after, False) == here
            branches.append((after, onward))
            nodes.append(_end(after, onward))
        return tuple(branches), tuple(nodes)


def _end(b: Branch, sense: bool) -> str | None:
    """The node behind a branch that is passed in a sense."""
    end = b.minus if sense else b.plus
    assert end is not None
    return end.node


def in_strands(network: Network, laws: FamilyLaws, kept: Found) -> Found:
    """What stands in families already, and strands in others: joints go on by one, buses are picked."""
    found = strands(network, laws, {b.name for run in kept[1] for b, _ in run.members} | set(kept[0]))
    buses = {name: (f"bus {key}", k) for key, names in found.buses.items() for k, name in enumerate(names)}
    joints: dict[str, Site] = {}
    runs = []
    for number, same in enumerate(found.classes):
        for k, strand in enumerate(same):
            joints |= {n: (f"joint {number} {j}", k) for j, n in enumerate(strand.nodes[1:-1]) if n is not None}
        for j, (head, _) in enumerate(same[0].branches):
            nodes = [end.node for end in (head.plus, head.minus) if end is not None]
            one, two = (joints.get(n or "", buses.get(n or "", (n or "", -1))) for n in nodes)
            moves, picked = ((nodes[0] in of, nodes[1] in of) for of in (joints, buses))
            members = tuple((b, laws.shapes[b.name]) for b, _ in (strand.branches[j] for strand in same))
            runs.append(BranchSequence(members, (one, two), moves, picked))
    return {**kept[0], **buses, **joints}, [*kept[1], *runs]


def strands(network: Network, laws: FamilyLaws, taken: Collection[str]) -> Strands:
    """Classes of at least RUN strands; taken: names of nodes and branches that stand in families already."""
    graph = _Graph(network, laws, taken)
    ways = list(graph.strands())
    met: dict[int, int] = {}  # laws in the order of the strands, by which one of two ways round is chosen
    linked = [
        (way, tuple([(not sense, met.setdefault(laws.numbers[b.name], len(met))) for b, sense in way.branches]))
        for way in ways
    ]
    of = _buses(network, graph, ways)
    # buses that too few strands end at are dropped until nothing changes
    while True:
        size = Counter(of.values())
        of = {name: key for name, key in of.items() if size[key] >= RUN}
        classes = _classes(linked, of)
        ends = Counter(of[n] for same in classes for s in same for n in (s.nodes[0], s.nodes[-1]) if n in of)
        every = Counter(key for name, key in of.items() for _ in graph.at[name or ""])
        lost = {key for key, number in every.items() if (1 + MANY) * (number - ends[key]) > number}
        if not lost:
            break
        of = {name: key for name, key in of.items() if key not in lost}
    # what is left, by class
    buses: dict[str, list[str]] = {}
    for name, key in of.items():
        buses.setdefault(key, []).append(name or "")
    return Strands(classes, {key: tuple(names) for key, names in buses.items()})


def _buses(network: Network, graph: _Graph, ways: Sequence[Strand]) -> dict[str | None, str]:
    """The family of each free node that is no joint of a strand: those of a connected part whose balances are alike in
    whether potential stores, and branches that are no strands, touch them.
    """
    inner = {name for way in ways for name in way.nodes[1:-1]}
    storing = {n for way in ways if any(b.kind == "potential" for b, _ in way.branches) for n in way.nodes}
    found: dict[str | None, str] = {}
    for node in network.nodes:
        if node.name in graph.free and node.name in graph.at and node.name not in inner:
            others = any(b.name not in graph.loose for b in graph.at[node.name])
            key = f"{graph.parts.first(node.name)} {node.domain.name} {node.name in storing} {others}"
            found[node.name] = key
    return found


Links = tuple[tuple[bool, int], ...]
"""Of the branches of a strand: whether each is passed against its sense, and the number of its law."""


def _classes(ways: Sequence[tuple[Strand, Links]], of: Mapping[str | None, str]) -> tuple[tuple[Strand, ...], ...]:
    """Strands of the same laws in the same senses between the same families (or the same nodes), one way round."""
    numbers: dict[object, int] = {}
    found: dict[object, list[Strand]] = {}
    for way, links in ways:
        if way.nodes[0] not in of and way.nodes[-1] not in of:
            continue
        one, two = (numbers.setdefault(("end", of.get(n, n)), len(numbers)) for n in (way.nodes[0], way.nodes[-1]))
        key: object = (links, (one, two))
        back = tuple((not sense, law) for sense, law in reversed(links)), (two, one)
        if back < (links, (one, two)):
            key, way = back, way.reverse()
        found.setdefault(key, []).append(way)
    return tuple(tuple(same) for same in found.values() if len(same) >= RUN)
