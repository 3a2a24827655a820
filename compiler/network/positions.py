"""Positions in the complementary family: what stores tell of them, and what initial positions tell of stores.

The contents c of stores between common-flow nodes are differences of positions x, c = B x.  Where that matters at the
start, positions are unknowns of it alone: what the text says of them is said of these, and loops close by these rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import Sizes
from sysdyn.compiler.network.primal.cycles import in_loops
from sysdyn.compiler.network.quadratures import Wanted, is_position, quadrature, stores_of, whole
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.joined import Joined
from sysdyn.dsl.model.network import Branch, Initial, Network, State, Terminal
from sysdyn.dsl.model.rewriting import TRACED, expressions, rewritten
from sysdyn.dsl.text.diagnostics import ModelError

_Point = tuple[str, tuple[int, ...]]
"""A node by its name and indices; the ground has none."""
_GROUND = "", ()


def from_stores(network: Network) -> Network:
    """Traced positions of points that single stores hold to the ground, as displacements of these stores."""
    sizes, over = Sizes(network), dict[_Point | None, Node]({_GROUND: ex.const(0.0)})
    left = [
        (_point(plus, sizes), _point(minus, sizes), ex.var(b.name, "bq", *b.at))
        for b, plus, minus in _springs(network, frozenset())
        if not b.loops
    ]
    number = 0
    while number < len(over):
        number = len(over)
        for plus, minus, content in left:
            if minus in over and plus is not None:
                over.setdefault(plus, ex.add(over[minus], content))
            elif plus in over and minus is not None:
                over.setdefault(minus, ex.sub(over[plus], content))

    def read(root: Node) -> Node:
        points = {n: _point(Terminal(n.data[0], n.args), sizes) for n in _positions([root])}
        change = {n: over[point] for n, point in points.items() if point in over}
        return ex.substitute(root, change) if change else root

    return rewritten(network, read, TRACED)


def _positions(roots: Sequence[Node]) -> list[Node]:
    """Positions of points that are read."""
    return [n for n in ex.topological(roots) if n.op == "var" and n.data[1:] == ("nq", 0)]


def _point(end: Terminal, sizes: Sizes) -> _Point | None:
    """A single point; None where its indices are not known."""
    if end.node is None:
        return _GROUND
    try:
        return end.node, tuple(sizes.affine(a, (), None).offset.value for a in end.at)
    except (ModelError, KeyError):
        return None


def _springs(network: Network, wanted: frozenset[Wanted]) -> Iterator[tuple[Branch, Terminal, Terminal]]:
    """Branches between common-flow nodes whose displacement is an unknown of the start, with their ends."""
    for b in network.branches:
        if b.domain.common == "flow" and b.plus and b.minus and (b.kind == "potential" or (b.name, "bq") in wanted):
            yield b, b.plus, b.minus


def with_positions(network: Network, wanted: frozenset[Wanted]) -> Network:
    """Positions as unknowns of the start, in parts where displacements are said or stores may stand in loops; wanted:
    displacements with quadratures.
    """
    springs, stores = tuple(_springs(network, wanted)), stores_of(network)
    asked, rows = _asked(network, springs, wanted), []
    for b, *ends in springs:
        if any(end.node in asked for end in ends):
            content = ex.var(b.name, "bq", *b.at) if b.name in stores else quadrature(b.name, b.at)
            apart = ex.sub(content, ex.sub(*map(_position, ends)))
            rows.append(Initial(apart, ex.const(0.0), True, b.loops, b.place, b.name))
    nodes = [n for n in network.nodes if n.name in asked]
    for n in (n for n in nodes if (n.name, "nq") in wanted):
        loops, at = whole(n)
        apart = ex.sub(quadrature(n.name, at), _position(Terminal(n.name, at)))
        rows.append(Initial(apart, ex.const(0.0), True, loops, n.place, n.name))
    def read(root: Node) -> Node:
        found = _positions([root])
        return ex.substitute(root, {n: _position(Terminal(n.data[0], n.args)) for n in found}) if found else root

    said = (i for i in rewritten(network, read, ("initials",)).initials if not is_position(i.target, stores))
    begun = (State(f"{n.name}.start", n.shape, n.domain.displacement, n.place) for n in nodes)
    return replace(network, positions=tuple(begun), initials=(*said, *rows))


def _position(end: Terminal) -> Node:
    """The position of a point at the start."""
    return ex.const(0.0) if end.node is None else ex.var(f"{end.node}.start", "start", *end.at)


def _asked(
    network: Network, springs: Sequence[tuple[Branch, Terminal, Terminal]], wanted: frozenset[Wanted]
) -> frozenset[str]:
    """Common-flow nodes of parts in which a displacement is said or wanted, or which stores may join in loops."""
    read = (n for n in ex.topological(expressions(network, "initials")) if n.op == "var")
    said = {n.data[0] for n in read if n.data[1] in ("nq", "bq", "be")} | {name for name, _ in wanted}
    parts, loops = Joined[str](), in_loops([(p.node or "", m.node or "", 1 + len(b.loops)) for b, p, m in springs])
    for k, (b, *ends) in enumerate(springs):
        names = [end.node for end in ends if end.node is not None]
        said |= set(names) if k in loops or b.name in said else set()
        if names:
            parts.join(names[0], names[-1])
    asked = {parts.first(name) for name in said}
    return frozenset(n.name for n in network.nodes if n.domain.common == "flow" and parts.first(n.name) in asked)
