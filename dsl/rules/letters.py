"""Letters of unknowns on Paynter's diagram, and expressions at sampled points: what the rules look with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Domain, Network
from sysdyn.dsl.model.paynter import REFLECTED

_CLASS = {k: k[-1] for k in ("nq", "nf", "np", "bq", "bf", "bp")} | {"be": "e", "ne": "e"}
LEAVES = ("var", "param", "time", "index", "table")


def letter(node: Node) -> str:
    """Kind q f p e s kappa mu audit: nodes' and branches' quantities count as those of coordinates."""
    kind: str = node.data[1]
    return _CLASS.get(kind, kind)


def unknowns_of(node: Node, kinds: str = "") -> list[Node]:
    """The unknowns of an expression (of those kinds) in the order of their making."""
    found = (n for n in ex.variables(node) if n.op == "var" and (not kinds or letter(n) in kinds.split()))
    return sorted(found, key=lambda n: n.number)


def samples(node: Node, held: Mapping[Node, float] | None = None) -> Iterable[float]:
    """Finite values of an expression at three points; held: what is known of its leaves."""
    leaves = [n for n in ex.topological([node]) if n.op in LEAVES]
    for seed in (1.0, 2.0, 3.0):
        values = {n: 0.3 + ((k + 1) * seed * 0.6180339887) % 1.0 for k, n in enumerate(leaves)}
        values |= held or {}
        value = evaluate([node], lambda n, v=values: v.get(n, 0.5))[0]  # type: ignore[misc]
        if math.isfinite(value):
            yield value


class Diagram:
    """Where on the diagram each unknown of a network stands, and in which domain."""

    def __init__(self, network: Network) -> None:
        self.complementary = {c.name for c in network.coordinates if c.complementary}
        self._coordinates = {c.name: c.domain for c in network.coordinates}
        self._nodes = {n.name: n.domain for n in network.nodes}
        self._branches = {b.name: b.domain for b in network.branches}

    def letter(self, node: Node) -> str:
        """One of e f p q as the author reads it; another kind where it stands on no vertex."""
        found = letter(node)
        written = node.data[1] in ("q", "f", "p") and node.data[0] in self.complementary
        return REFLECTED[found] if written else found

    def domain(self, node: Node) -> Domain | None:
        """The domain of a coordinate, a node or a branch."""
        name, kind = node.data[0], node.data[1]
        if kind in ("q", "f", "p"):
            return self._coordinates.get(name)
        return (self._nodes if kind[0] == "n" else self._branches).get(name)

    def domains(self, node: Node) -> Iterator[tuple[Node, Domain]]:
        """The unknowns of an expression that stand on the diagram, with their domains."""
        for n in unknowns_of(node):
            domain = self.domain(n)
            if domain is not None:
                yield n, domain
