"""Elements along expressions (`on`) as elements between nodes (language, section 4, S5; section 11, 36).

An element `on b.q` has the flow of b and adds its effort to it: between common-flow nodes it stands beside b, between
common-effort nodes in series with it.  One on a combination  c1 q1 + c2 q2  has transformers of ratios c_i, whose far
sides stand along the q_i; the primal family needs none of these and lowers it as virtual work.  What is no combination
with constant coefficients stays along its expression.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Coupling, Network, NodeFamily, Terminal, loop_indices, loop_ranges
from sysdyn.dsl.model.rewriting import expressions, rewritten
from sysdyn.values import dataclass

Parts = list[tuple[Node, Node]]
"""Coefficient and displacement of each part of a combination."""


def along(network: Network, *, complementary: bool) -> Network:
    """The network with such elements between nodes; complementary: those on combinations too."""
    if all(b.on is None for b in network.branches) or not (network.nodes or network.branches):
        return network
    if complementary:
        network = _with_transformers(network)
    return _in_series(_connect_along_nodes(network))


def _combination(root: Node) -> Parts | None:
    """The parts of a linear combination of displacements with constant coefficients and no constant; else None."""
    unknowns = sorted(ex.variables(root), key=lambda n: n.number)
    if not unknowns or any(n.op != "var" or n.data[1] not in ("nq", "bq") or n.data[2] for n in unknowns):
        return None
    parts = [(derivative(root, n), n) for n in unknowns]
    rest = ex.substitute(root, {n: ex.const(0.0) for n in unknowns})
    constant = all(not ex.variables(c) for c, _ in parts) and ex.is_const(rest, 0.0)
    return parts if constant and not any(n.op == "reduce" for n in ex.topological([root])) else None


def _unit(coefficient: Node) -> int:
    """The sign of a coefficient of one; 0 of others."""
    return 1 if ex.is_const(coefficient, 1.0) else -1 if ex.is_const(coefficient, -1.0) else 0


# -- combinations ------------------------------------------------------------------------------------------


def _with_transformers(network: Network) -> Network:
    """Elements on combinations that are neither one displacement nor the difference of two nodes."""
    common = {n.name: n.domain for n in network.nodes} | {b.name: b.domain for b in network.branches}
    nodes: list[NodeFamily] = []
    branches: list[Branch] = []
    couplings: list[Coupling] = []
    for b in network.branches:
        parts = None if b.on is None else _combination(b.on)
        own = b.at == loop_indices(b.loops)
        # one displacement, or the difference of two nodes: connected without a transformer
        if parts is None or not own or _plain(parts):
            branches.append(b)
            continue
        shape = loop_ranges(b.loops)
        # effort nodes: one point for all parts; flow nodes: a chain of points, which adds up displacements
        effort = b.domain.common == "effort"
        names = [f"{b.name}.inner{k}" for k in range(1, 2 if effort else len(parts) + 1)]
        nodes += [NodeFamily(name, shape, b.domain, b.place) for name in names]
        points = [Terminal(name, b.at) for name in names]
        ground = Terminal(None, ())
        branches.append(replace(b, on=None, plus=points[-1], minus=ground))
        # a transformer for each part, its ratio the coefficient
        for k, (coefficient, displacement) in enumerate(parts):
            ends = (ground, points[0]) if effort else (points[k], points[k - 1] if k else ground)
            one, two = f"{b.name}.along{k + 1}#1", f"{b.name}.along{k + 1}#2"
            port = replace(b, kind="port", side=None, law=None, on=None)
            domain = common[displacement.data[0]]
            branches.append(replace(port, name=one, plus=ends[0], minus=ends[1]))
            branches.append(replace(port, name=two, domain=domain, plus=None, minus=None, on=displacement))
            couplings.append(Coupling("transformer", one, two, b.at, b.loops, "f", coefficient, b.place))
    return replace(
        network,
        nodes=(*network.nodes, *nodes),
        branches=tuple(branches),
        couplings=(*network.couplings, *couplings),
    )


def _plain(parts: Parts) -> bool:
    """One displacement, or the difference of two nodes."""
    signs = [_unit(c) for c, _ in parts]
    pair = len(parts) == 2 and all(n.data[1] == "nq" for _, n in parts) and sorted(signs) == [-1, 1]
    return pair or (len(parts) == 1 and signs[0] != 0)


# -- between common-flow nodes -----------------------------------------------------------------------------


def _connect_along_nodes(network: Network) -> Network:
    """Elements along displacements of common-flow nodes and branches, between these nodes."""
    targets = _single(network.branches)
    absorbed: dict[str, list[tuple[int, Branch]]] = {}

    def ends(b: Branch) -> Branch:
        found = _ends(b, targets, absorbed)
        return b if found is None else replace(b, on=None, plus=found[0], minus=found[1])

    branches = tuple(ends(b) if b.on is not None else b for b in network.branches)
    return _drop_paths(replace(network, branches=branches), absorbed)


def _ends(
    b: Branch, targets: dict[str, Branch], absorbed: dict[str, list[tuple[int, Branch]]]
) -> tuple[Terminal, Terminal] | None:
    """Ends of an element along a displacement of nodes or branches, None where it is none of these; absorbed: by
    branch.
    """
    assert b.on is not None
    parts = _combination(b.on)
    if parts is None or b.domain.common != "flow" or not all(_unit(c) for c, _ in parts):
        return None
    ground = Terminal(None, ())
    # q of nodes: plus at one, minus at the other or the ground
    if all(n.data[1] == "nq" for _, n in parts):
        signed = {_unit(c): Terminal(n.data[0], n.args) for c, n in parts}
        return (signed.get(1, ground), signed.get(-1, ground)) if len(signed) == len(parts) else None
    # along a branch: between that branch's own ends
    root = _root(b, targets)
    if root is None:
        return None
    sign, target = root
    plus, minus = target.plus, target.minus
    if plus is None or minus is None:
        return None
    absorbed.setdefault(target.name, []).append((sign, b))
    return (plus, minus) if sign > 0 else (minus, plus)


def _single(branches: tuple[Branch, ...]) -> dict[str, Branch]:
    """Branch families of one statement."""
    found: dict[str, list[Branch]] = {}
    for b in branches:
        found.setdefault(b.name, []).append(b)
    return {name: bs[0] for name, bs in found.items() if len(bs) == 1}


def _root(b: Branch, targets: dict[str, Branch]) -> tuple[int, Branch] | None:
    """The branch between nodes whose displacement, or the negative of it, a branch has; through others that do."""
    sign, seen, here = 1, {b.name}, b
    while here.on is not None:
        parts = _combination(here.on)
        if parts is None or len(parts) != 1 or not _unit(parts[0][0]) or parts[0][1].data[1] != "bq":
            return None
        target = targets.get(parts[0][1].data[0])
        if target is None or target.name in seen or target.at != parts[0][1].args or target.loops != b.loops:
            return None
        sign *= _unit(parts[0][0])
        seen.add(target.name)
        here = target
    return sign, here


def _drop_paths(network: Network, found: dict[str, list[tuple[int, Branch]]]) -> Network:
    """The network without the branches that are only the way of the elements along them."""
    bare = _bare(network)
    ways = {name: elements for name, elements in found.items() if name in bare}
    if not ways:
        return network
    network = replace(network, branches=tuple(b for b in network.branches if b.name not in ways))
    return rewritten(network, lambda root: _through(root, ways))


def _bare(network: Network) -> frozenset[str]:
    """Branches without a law over which no energy, work or constraint stands."""
    roots = expressions(network, "energies", "works.on")
    roots += [c.expression for c in network.constraints if c.kind != "gamma"]
    used = {n.data[0] for n in ex.topological(roots) if n.op == "var" and n.data[1] in ("be", "bf", "bq", "bp")}
    return frozenset(b.name for b in network.branches if b.kind == "field" and b.name not in used)


# -- between common-effort nodes ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Chain:
    """Elements in the flow of one branch, each with its sense; whether the branch itself is one of them."""

    root: Branch
    elements: tuple[tuple[int, Branch], ...]
    kept: bool


def _in_series(network: Network) -> Network:
    """Elements along displacements of branches between common-effort nodes, in series with these."""
    targets = _single(network.branches)
    found: dict[str, list[tuple[int, Branch]]] = {}
    for b in network.branches:
        root = None if b.on is None or b.name not in targets else _root(b, targets)
        if root is not None and root[1].plus is not None and root[1].domain == b.domain and b.domain.common == "effort":
            found.setdefault(root[1].name, []).append((root[0], b))
    if not found:
        return network
    bare = _bare(network)
    chains = [_Chain(targets[name], tuple(elements), name not in bare) for name, elements in found.items()]
    placed: dict[str, Branch] = {}
    nodes: list[NodeFamily] = []
    for chain in chains:
        inner, branches = _place_chain(chain)
        nodes += inner
        placed |= {b.name: b for b in branches}
    network = replace(network, nodes=(*network.nodes, *nodes))
    return _drop_paths(replace(network, branches=tuple(placed.get(b.name, b) for b in network.branches)), found)


def _place_chain(chain: _Chain) -> tuple[list[NodeFamily], Iterator[Branch]]:
    """Nodes between the elements of a chain, and the elements there."""
    root = chain.root
    members = [*chain.elements, *([(1, root)] if chain.kept else [])]
    shape = loop_ranges(root.loops)
    at = loop_indices(root.loops)
    names = [f"{root.name}.inner{k}" for k in range(1, len(members))]
    points = [root.plus, *(Terminal(name, at) for name in names), root.minus]

    def place() -> Iterator[Branch]:
        for k, (sign, b) in enumerate(members):
            ends = points[k : k + 2] if sign > 0 else points[k : k + 2][::-1]
            yield replace(b, on=None, plus=ends[0], minus=ends[1])

    return [NodeFamily(name, shape, root.domain, root.place) for name in names], place()


def _through(root: Node, ways: dict[str, list[tuple[int, Branch]]]) -> Node:
    """What is read of a branch that is only the way of others: their flow, and the sum of their efforts."""
    change = {}
    for n in ex.topological([root]):
        if n.op == "var" and n.data[0] in ways and n.data[1] in ("be", "bf", "bq", "bp"):
            name, kind, order = n.data
            taken = ways[name] if kind in ("be", "bp") else ways[name][:1]
            change[n] = ex.linear(0.0, [(float(s), ex.var(b.name, kind, *n.args, order=order)) for s, b in taken])
    return ex.substitute(root, change) if change else root
