"""Positions in the complementary family: what stores tell of them, and what initial positions tell of stores.

The contents c of stores between common-flow nodes are differences of positions x, c = B x.  Where that matters at the
start, positions are unknowns of it alone: what the text says of them is said of these, and loops close by these rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import WholeNumbers
from sysdyn.compiler.network.primal.cycles import in_loops
from sysdyn.compiler.network.quadratures import Wanted, is_position, quadrature, stores_of, whole
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import InitialCondition, Loop, Network, NodeFamily, State, Terminal
from sysdyn.dsl.model.rewriting import TRACED, expressions, rewritten
from sysdyn.dsl.text.diagnostics import ModelError, Place
from sysdyn.values import dataclass

_Point = tuple[str, tuple[int, ...]]
"""A node by its name and indices; the ground has none."""
_GROUND = "", ()


def from_stores(network: Network) -> Network:
    """Traced positions of points that single stores hold to the ground, as displacements of these stores."""
    sizes, over = WholeNumbers(network), dict[_Point | None, Node]({_GROUND: ex.const(0.0)})
    springs = [j for j in _springs(network, frozenset()) if not j.loops]
    left = [(_point(j.plus, sizes), _point(j.minus, sizes), j.content) for j in springs]
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


def _point(end: Terminal, sizes: WholeNumbers) -> _Point | None:
    """A single point; None where its indices are not known."""
    if end.node is None:
        return _GROUND
    try:
        return end.node, tuple(sizes.affine(a, (), None).offset.value for a in end.at)
    except (ModelError, KeyError):
        return None


@dataclass(frozen=True, slots=True)
class _Join:
    """Points of a family joined with others: the displacement of plus over minus, and whose it is."""

    name: str
    content: Node
    plus: Terminal
    minus: Terminal
    loops: tuple[Loop, ...]
    place: Place

    @property
    def nodes(self) -> tuple[str, ...]:
        """Families of nodes at the ends; the ground is none."""
        return tuple(end.node for end in (self.plus, self.minus) if end.node is not None)


def _springs(network: Network, wanted: frozenset[Wanted]) -> Iterator[_Join]:
    """Branches between common-flow nodes whose displacement is an unknown of the start."""
    for b in network.branches:
        stores = b.kind == "potential"
        if b.domain.common == "flow" and b.plus and b.minus and (stores or (b.name, "bq") in wanted):
            content = ex.var(b.name, "bq", *b.at) if stores else quadrature(b.name, b.at)
            yield _Join(b.name, content, b.plus, b.minus, b.loops, b.place)


def with_positions(network: Network, wanted: frozenset[Wanted]) -> Network:
    """Positions as unknowns of the start, in parts where displacements are said or stores may stand in loops; wanted:
    displacements with quadratures.
    """
    # contents of stores tell differences of positions
    springs = tuple(_springs(network, wanted))
    read = (n for n in ex.topological(expressions(network, "initials")) if n.op == "var")
    said = {n.data[0] for n in read if n.data[1] in ("nq", "bq", "be")}
    # where anything else is said, all parts have positions
    open_ = _says_of_others(network) or _massless(network, springs)
    parts = _parts(network, springs, said | {name for name, _ in wanted}, open_=open_)

    def position(end: Terminal) -> Node:
        return ex.const(0.0) if end.node is None else ex.var(f"{end.node}.start", "start", *end.at)

    def initial_of(join: _Join) -> InitialCondition:
        apart = ex.sub(position(join.plus), position(join.minus))
        return InitialCondition(ex.sub(join.content, apart), ex.const(0.0), True, join.loops, join.place, join.name)

    def substitute_positions(root: Node) -> Node:
        found = _positions([root])
        return ex.substitute(root, {n: position(Terminal(n.data[0], n.args)) for n in found}) if found else root

    nodes = [n for n in network.nodes if n.name in parts]
    points = (_point_of(n) for n in network.nodes if n.name in parts and (n.name, "nq") in wanted)
    kept = rewritten(network, substitute_positions, ("initials",)).initials
    return replace(
        network,
        positions=tuple(State(f"{n.name}.start", n.shape, n.domain.displacement, n.place) for n in nodes),
        initials=(
            *(i for i in kept if not is_position(i.target, stores_of(network))),
            *(initial_of(join) for join in (*springs, *points) if any(name in parts for name in join.nodes)),
        ),
    )


def _point_of(node: NodeFamily) -> _Join:
    """Nodes at their quadratures over the ground."""
    loops, at = whole(node)
    return _Join(node.name, quadrature(node.name, at), Terminal(node.name, at), Terminal(None, ()), loops, node.place)


def _says_of_others(network: Network) -> bool:
    """Whether initial conditions are about what holds neither a content nor a momentum, and may ask for these."""
    stores = {b.name for b in network.branches if b.kind in ("potential", "kinetic")}
    moved = {b.plus.node for b in network.branches if b.kind == "kinetic" and b.plus}
    read = (n for n in ex.topological(expressions(network, "initials")) if n.op == "var")
    return any(
        n.data[1] == "ne"
        or (n.data[1] == "nf" and n.data[0] not in moved)
        or (n.data[1] in ("be", "bf") and n.data[0] not in stores)
        for n in read
    )


def _massless(network: Network, springs: Sequence[_Join]) -> bool:
    """Whether nothing is inert at a point between stores: its balance may ask for their contents."""
    inert = {end.node for b in network.branches if b.kind == "kinetic" for end in (b.plus, b.minus) if end}
    return any(name not in inert for join in springs for name in join.nodes)


def _parts(network: Network, springs: Sequence[_Join], said: set[str], *, open_: bool) -> dict[str, str]:
    """Common-flow nodes, each with what stands for its part, of parts of which something is said, or in which stores
    may stand in loops; open_: of all that stores join; said: nodes and branches.
    """
    parts, ends = Joined[str](), [(j.plus.node or "", j.minus.node or "", 1 + len(j.loops)) for j in springs]
    looped = in_loops(ends)
    for k, join in enumerate(springs):
        among = k in looped or join.name in said or (open_ and len(join.nodes) > 1)
        said = said | set(join.nodes) if among else said
        if join.nodes:
            parts.join(join.nodes[0], join.nodes[-1])
    asked = {parts.first(name) for name in said}
    heads = {n.name: parts.first(n.name) for n in network.nodes if n.domain.common == "flow"}
    return {name: head for name, head in heads.items() if head in asked}
