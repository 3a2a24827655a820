"""What holds of a network between any two arrows; a fault in an arrow shows here, not in a residual.

Every name in an expression is declared, as that kind and with as many indices as its family has; every index is that of
a loop around it; terminals, couplings and initial values belong to something; in coordinates no quantity of a node or
branch is left.
"""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.network import Loop, Network

_COORDINATE = frozenset("qfpe")


class BrokenNetworkError(AssertionError):
    """A network that an arrow has made wrong: a fault in sysdyn, never the author's."""


def verify_network(network: Network, *, coordinates: bool = False) -> None:
    """BrokenNetworkError where something does not hold; coordinates: nodes and branches are gone."""
    families = _families(network)
    for what, loops, roots in _statements(network):
        inside = {loop.index for loop in loops}
        # loop variables of reductions
        for node in topological(roots):
            if node.op == "reduce":
                inside.add(node.data[1])
        # indices are bound, variables declared with as many indices
        for node in topological(roots):
            if node.op == "index" and node.data not in inside:
                raise BrokenNetworkError(f"{what}: index {node.data} belongs to no loop")
            if node.op != "var":
                continue
            name, kind, _ = node.data
            if kind in ("audit", "kappa", "mu"):
                continue
            if coordinates and kind[0] in "nb":
                raise BrokenNetworkError(f"{what}: {node} is no quantity of a coordinate")
            counts = families.get((name, "x")) if kind in _COORDINATE else None
            counts = counts or families.get((name, kind[0]))
            if counts is None:
                raise BrokenNetworkError(f"{what}: {node} ({kind}) is declared nowhere")
            if len(node.args) not in counts:
                raise BrokenNetworkError(f"{what}: {node} has {len(node.args)} indices, its family {sorted(counts)}")
    _ends(network, coordinates)


def _families(network: Network) -> dict[tuple[str, str], set[int]]:
    """Numbers of indices by (name, what it is): x coordinate, e implicit, s state, n node, b branch."""
    found: dict[tuple[str, str], set[int]] = {}
    declared = {"x": network.coordinates, "e": network.unknowns, "n": network.nodes}
    declared["s"] = (*network.states, *network.positions)
    for what, items in declared.items():
        for item in items:
            found.setdefault((item.name, what), set()).add(len(item.shape))  # type: ignore[attr-defined]
    for b in network.branches:
        found.setdefault((b.name, "b"), set()).add(len(b.at))
    return found


def _statements(network: Network) -> Iterator[tuple[str, tuple[Loop, ...], list[Node]]]:
    """Each statement with its loops and expressions."""
    for e in network.energies:
        yield f"energy {e.function}", e.loops, [e.expression]
    for w in network.works:
        yield "work", w.loops, [w.effort, w.on]
    for k in network.constraints:
        yield f"{k.kind} {k.name}", k.loops, [k.expression, *k.at]
    for d in network.dynamics:
        yield f"dynamic {d.state}", d.loops, [d.state, d.expression]
    for i in network.initials:
        yield f"init {i.target}", i.loops, [i.target, i.value]
    for o in network.observations:
        yield f"trace {o.name}", (), [o.expression]
    for x in network.expectations:
        yield f"expect {x.text}", (), [n for n in (x.left, x.right, x.within) if n is not None]
    for b in network.branches:
        own = [n for n in (b.law, b.on, b.energy) if n is not None]
        ends = [n for end in (b.plus, b.minus) if end is not None for n in end.at]
        yield f"branch {b.name}", b.loops, [*b.at, *own, *ends]
    for c in network.couplings:
        yield f"{c.kind} {c.first}", c.loops, [c.ratio, *c.at]


def _ends(network: Network, coordinates: bool) -> None:
    """Terminals lie on nodes of the branch's domain; couplings join branches; nothing of these is left at the end."""
    if coordinates and (network.branches or network.couplings):
        raise BrokenNetworkError("branches are left among coordinates")
    domains: dict[str, set[str]] = {}
    for node in network.nodes:
        domains.setdefault(node.name, set()).add(node.domain.name)
    names = {b.name for b in network.branches}
    # both ends at nodes of the branch's domain
    for b in network.branches:
        for end in (b.plus, b.minus):
            if end is not None and end.node is not None and b.domain.name not in domains.get(end.node, ()):
                raise BrokenNetworkError(f"branch {b.name}: no node {end.node} of {b.domain.name}")
    # couplings between branches that are there
    for c in network.couplings:
        if not {c.first, c.second} <= names:
            raise BrokenNetworkError(f"{c.kind} {c.first}, {c.second}: one of them is no branch")
