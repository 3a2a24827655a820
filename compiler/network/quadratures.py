"""Displacements and momenta that a family has no coordinate for: quadratures q' = f, p' = e of what is read.

Where a displacement is read that no potential store of the complementary family holds, by a trace or by the law of what
stores nothing (a memristor), its quadrature is added as a dynamic variable NAME.q; in the primal one likewise NAME.p of
a dissipator whose law reads its momentum.  Momenta of points are those of the kinetic stores that move with them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import Box, WholeNumbers, box_difference
from sysdyn.compiler.network.primal.overlaps import ranges_of
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import (
    Branch,
    Domain,
    Dynamic,
    Loop,
    Network,
    NodeFamily,
    State,
    loop_indices,
    loop_ranges,
)
from sysdyn.dsl.model.rewriting import TRACED, expressions, rewritten
from sysdyn.dsl.text.diagnostics import Place

Wanted = tuple[str, str]
"""Name and kind (nq, bq) of a displacement."""


def from_masses(network: Network) -> Network:
    """Momenta of points, and their rates, as those of the kinetic stores that move with them."""
    whole = massive(network)
    held: dict[str, list[tuple[float, Branch, tuple[Node, ...]]]] = {}
    # kinetic stores at each node, with their sense
    for b in network.branches:
        for terminal, sign in ((b.plus, 1.0), (b.minus, -1.0)):
            if b.kind == "kinetic" and terminal is not None and terminal.node is not None:
                held.setdefault(terminal.node, []).append((sign, b, terminal.at))

    def stores(node: Node) -> Node:
        """A store stands at all points of a family, or at one of them."""
        terms = []
        # a store at this point, or one of a family at all of them
        for sign, b, at in held.get(node.data[0], ()):
            if not b.loops and at == node.args:
                terms.append((sign, ex.var(b.name, "bp", *b.at, order=node.data[2])))
            elif b.loops and node.data[0] in whole and at == loop_indices(b.loops):
                here = dict(zip(at, node.args, strict=True))
                own = (ex.substitute(a, here) for a in b.at)
                terms.append((sign, ex.var(b.name, "bp", *own, order=node.data[2])))
        return ex.linear(0.0, terms) if terms else node

    def read(root: Node) -> Node:
        found = [n for n in ex.topological([root]) if n.op == "var" and n.data[1] == "np"]
        return ex.substitute(root, {n: stores(n) for n in found}) if found else root

    return rewritten(network, read, (*TRACED, "dynamics"))


def with_quadratures(network: Network) -> tuple[Network, frozenset[Wanted]]:
    """Quadratures q' = f of what traces, expectations, dynamics and laws read and no store holds, and what of: a
    dynamic variable NAME.q each.  That of a branch begins as written, that of a node at its position.
    """
    stores = stores_of(network)
    roots = ex.topological(expressions(network, "observations", "dynamics", "expectations", "branches.law"))
    wanted = dict.fromkeys((n.data[0], n.data[1]) for n in roots if is_position(n, stores))
    return _add_quadratures(network, wanted, "f"), frozenset(wanted)


def with_momenta(network: Network) -> Network:
    """The primal family's: NAME.p, p' = e, of dissipators whose law reads their own momentum."""
    wanted = {(b.name, "bp"): None for b in network.branches if b.kind == "dissipator" and reads(b, "bp")}
    return _add_quadratures(network, wanted, "e") if wanted else network


def reads(branch: Branch, kind: str) -> bool:
    """Whether the law of a branch reads its own variable of this kind."""
    law = () if branch.law is None else ex.variables(branch.law)
    return any(n.op == "var" and n.data[:2] == (branch.name, kind) for n in law)


def _add_quadratures(network: Network, wanted: Iterable[Wanted], rate: str) -> Network:
    """With a dynamic variable for each of these, of this rate (e or f), read in their places."""
    wanted = dict.fromkeys(wanted)

    # the variable where it is read, and its rate
    def read(root: Node) -> Node:
        found = [n for n in ex.topological([root]) if n.op == "var" and n.data[:2] in wanted]
        change = {n: _quadrature(n.data[0], n.data[1][1], n.args, n.data[2]) for n in found}
        return ex.substitute(root, change) if found else root

    families: dict[Wanted, list[tuple[tuple[Loop, ...], tuple[Node, ...], Domain, Place]]] = {}
    # loops and indices of all families that have displacements
    for n in network.nodes:
        families[n.name, "nq"] = [(*whole(n), n.domain, n.place)]
    for b in network.branches:
        for kind in ("bq", "bp"):
            families.setdefault((b.name, kind), []).append((b.loops, b.at, b.domain, b.place))
    # quadratures that a law reads take part in the motion; others are measured alone
    laws = (n for law in expressions(network, "branches.law") for n in ex.variables(law) if n.op == "var")
    lawful = {n.data[:2] for n in laws}
    states, dynamics = [], []
    # a state of the variable's range with its rate
    for name, kind in wanted:
        measured = (name, kind) not in lawful
        for loops, at, domain, place in families[name, kind]:
            shape, unit = loop_ranges(loops), domain.momentum if kind == "bp" else domain.displacement
            states.append(State(f"{name}.{kind[1]}", shape, unit, place, measured=measured))
            own = _quadrature(name, kind[1], at)
            dynamics.append(Dynamic(own, ex.var(name, f"{kind[0]}{rate}", *at), loops, place))
    # what is said of their start is said of the states
    told = {(*w, 0) for w in wanted if w[1] != "nq"}
    starts = [i for i in network.initials if i.target.op == "var" and i.target.data in told]
    begun = (replace(i, target=read(i.target)) for i in starts)
    placed = tuple(i for i in network.initials if i not in starts or i.target.data[1] != "bp")
    network = replace(rewritten(network, read, (*TRACED, "dynamics", "branches")), initials=placed)
    return replace(
        network,
        states=(*network.states, *states),
        dynamics=(*network.dynamics, *dynamics),
        initials=(*network.initials, *begun),
    )


def whole(node: NodeFamily) -> tuple[tuple[Loop, ...], tuple[Node, ...]]:
    """Loops over all points of a family, and their indices."""
    loops = tuple(Loop(f"#x{k}", first, last) for k, (first, last) in enumerate(node.shape))
    return loops, loop_indices(loops)


def massive(network: Network) -> frozenset[str]:
    """Families of common-flow nodes on each of which a mass stands."""
    sizes = WholeNumbers(network)
    found: dict[str, list[Box]] = {}
    for b in network.branches:
        alone = b.minus is None or b.minus.node is None
        if b.kind == "kinetic" and alone and b.plus is not None and b.plus.node is not None:
            reach = sizes.reach(b.plus.at, ranges_of(b.loops, sizes, b.place), b.place)
            found.setdefault(b.plus.node, []).append(reach)
    boxes = {n.name: sizes.box(n.shape, n.place) for n in network.nodes}
    return frozenset(name for name, holes in found.items() if not box_difference(boxes[name], *holes))


def stores_of(network: Network) -> frozenset[str]:
    """Potential stores, which hold their displacements."""
    return frozenset(b.name for b in network.branches if b.kind == "potential")


def is_position(node: Node, stores: frozenset[str]) -> bool:
    """Whether it reads a displacement that no potential store holds."""
    return node.op == "var" and (node.data[1] == "nq" or (node.data[1] == "bq" and node.data[0] not in stores))


def quadrature(name: str, at: Sequence[Node], order: int = 0) -> Node:
    """The dynamic variable that a displacement without a store is."""
    return _quadrature(name, "q", at, order)


def _quadrature(name: str, letter: str, at: Sequence[Node], order: int = 0) -> Node:
    return ex.var(f"{name}.{letter}", "s", *at, order=order)
