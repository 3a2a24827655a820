"""Displacements in the complementary family: quadratures of what is read, and what initial positions say of stores.

A displacement that no potential store holds has no place there; where it is traced, its quadrature q' = f is added.
The contents of stores between common-flow nodes are differences of positions: along every loop of stores, quadratures
and fixed positions they add up to zero at the start, which the least change of guesses must meet.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import Sizes
from sysdyn.compiler.network.primal.contents import charge
from sysdyn.compiler.network.primal.overlaps import (
    Ranges,
    beside,
    common,
    count,
    initially,
    meeting,
    narrowed,
    ranges_of,
)
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Domain, Dynamic, Initial, Loop, Network, Shape, State, Terminal
from sysdyn.dsl.model.rewriting import TRACED, expressions, rewritten
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass

Wanted = tuple[str, str]
"""Name and kind (nq, bq) of a displacement."""
_At = tuple[str, tuple[Node, ...]]
"""An element of a node family."""
_Point = tuple[str, tuple[int, ...]] | None
"""A node, or the ground."""


# -- traced positions --------------------------------------------------------------------------------------


def from_stores(network: Network) -> Network:
    """Traced positions of points that stores hold to the ground, as displacements of these stores."""
    links: dict[_At | None, list[tuple[_At | None, Node]]] = {}
    for b in network.branches:
        single = b.kind == "potential" and b.domain.common == "flow" and not b.loops
        if single and b.plus is not None and b.minus is not None:
            plus, minus = (None if t.node is None else (t.node, t.at) for t in (b.plus, b.minus))
            content = ex.var(b.name, "bq", *b.at)
            links.setdefault(plus, []).append((minus, content))
            links.setdefault(minus, []).append((plus, ex.neg(content)))

    def over_ground(start: _At) -> Node | None:
        """The shortest way."""
        paths: dict[_At | None, Node] = {start: ex.const(0.0)}
        ahead: list[_At | None] = [start]
        for here in ahead:
            for there, content in links.get(here, ()):
                if there not in paths:
                    paths[there] = ex.add(paths[here], content)
                    ahead.append(there)
        return paths.get(None)

    def read(root: Node) -> Node:
        read = [n for n in ex.topological([root]) if n.op == "var" and n.data[1:] == ("nq", 0)]
        change = {n: path for n in read if (path := over_ground((n.data[0], n.args))) is not None}
        return ex.substitute(root, change) if change else root

    return rewritten(network, read, TRACED)


def from_masses(network: Network) -> Network:
    """Momenta of points, and their rates, as those of the kinetic stores that move with them."""
    whole = massive(network)
    held: dict[str, list[tuple[float, Branch, tuple[Node, ...]]]] = {}
    for b in network.branches:
        for terminal, sign in ((b.plus, 1.0), (b.minus, -1.0)):
            if b.kind == "kinetic" and terminal is not None and terminal.node is not None:
                held.setdefault(terminal.node, []).append((sign, b, terminal.at))

    def stores(node: Node) -> Node:
        """A store stands at all points of a family, or at one of them."""
        terms = []
        for sign, b, at in held.get(node.data[0], ()):
            if not b.loops and at == node.args:
                terms.append((sign, ex.var(b.name, "bp", *b.at, order=node.data[2])))
            elif b.loops and node.data[0] in whole and at == tuple(ex.index(loop.index) for loop in b.loops):
                here = dict(zip(at, node.args, strict=True))
                own = (ex.substitute(a, here) for a in b.at)
                terms.append((sign, ex.var(b.name, "bp", *own, order=node.data[2])))
        return ex.linear(0.0, terms) if terms else node

    def read(root: Node) -> Node:
        found = [n for n in ex.topological([root]) if n.op == "var" and n.data[1] == "np"]
        return ex.substitute(root, {n: stores(n) for n in found}) if found else root

    return rewritten(network, read, (*TRACED, "dynamics"))


# -- quadratures -------------------------------------------------------------------------------------------


def with_quadratures(network: Network) -> tuple[Network, frozenset[Wanted]]:
    """Quadratures q' = f of what traces, expectations and dynamics read and no store holds, and what of."""
    roots = expressions(network, "observations", "dynamics", "expectations")
    stores = _stores(network)
    wanted: dict[Wanted, None] = {}
    for node in ex.topological(roots):
        if node.op == "var" and _is_position(node, stores):
            wanted.setdefault((node.data[0], node.data[1]))
    nodes = {n.name: (n.shape, n.domain, n.place) for n in network.nodes}
    for name, kind in wanted:
        if kind == "nq":
            shape, domain, place = nodes[name]
            loops = tuple(Loop(f"#x{k}", first, last) for k, (first, last) in enumerate(shape))
            network = _with_position(
                network, (name, kind), (shape, loops, tuple(ex.index(x.index) for x in loops)), domain, place
            )
        else:
            for b in network.branches:
                if b.name == name:
                    shape = tuple((loop.first, loop.last) for loop in b.loops)
                    network = _with_position(network, (name, kind), (shape, b.loops, b.at), b.domain, b.place)
    return network, frozenset(wanted)


def massive(network: Network) -> frozenset[str]:
    """Families of common-flow nodes on each of which a mass stands."""
    sizes = Sizes(network)
    found: dict[str, list[Ranges]] = {}
    for b in network.branches:
        alone = b.minus is None or b.minus.node is None
        if b.kind == "kinetic" and alone and b.plus is not None and b.plus.node is not None:
            within = ranges_of(b.loops, sizes, b.place)
            places = [sizes.affine(a, within, b.place) for a in b.plus.at]
            found.setdefault(b.plus.node, []).append({f"{k}": a.over(within) for k, a in enumerate(places)})
    boxes = {n.name: {f"{k}": i for k, i in enumerate(sizes.box(n.shape, n.place))} for n in network.nodes}
    return frozenset(name for name, holes in found.items() if not list(beside(boxes[name], holes)))


def _stores(network: Network) -> frozenset[str]:
    return frozenset(b.name for b in network.branches if b.kind == "potential")


def _is_position(node: Node, stores: frozenset[str]) -> bool:
    return node.op == "var" and (node.data[1] == "nq" or (node.data[1] == "bq" and node.data[0] not in stores))


def _quadrature(name: str, at: Sequence[Node], order: int = 0) -> Node:
    return ex.var(f"{name}.q", "s", *at, order=order)


def _with_position(
    network: Network,
    what: Wanted,
    family: tuple[Shape, tuple[Loop, ...], tuple[Node, ...]],
    domain: Domain,
    place: Place,
) -> Network:
    """One dynamic variable NAME.q for a displacement var(name, kind); it begins as that is written to begin."""
    shape, loops, at = family
    state = _quadrature(what[0], at)
    starts = [
        replace(i, target=_quadrature(what[0], i.target.args))
        for i in network.initials
        if i.target.op == "var" and i.target.data == (*what, 0)
    ]

    def read(root: Node) -> Node:
        found = [n for n in ex.topological([root]) if n.op == "var" and n.data[:2] == what]
        return ex.substitute(root, {n: _quadrature(what[0], n.args, n.data[2]) for n in found}) if found else root

    network = rewritten(network, read, (*TRACED, "dynamics"))
    rate = ex.var(what[0], "nf" if what[1] == "nq" else "bf", *at)
    return replace(
        network,
        states=(*network.states, State(f"{what[0]}.q", shape, domain.displacement, place)),
        dynamics=(*network.dynamics, Dynamic(state, rate, loops, place)),
        initials=(*network.initials, *starts),
    )


UNWRITTEN = 1e-6
"""Weight (of squares) of a guess that the text does not write, as the consistent start has it."""


# -- contents ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Known:
    """Where the position of a branch's end is known, and what it is there."""

    within: Ranges
    value: Node


def with_contents(network: Network, wanted: frozenset[Wanted]) -> Network:
    """Initial positions as initial displacements between them; wanted: displacements with quadratures."""
    found = _Contents(network, wanted)
    stores = _stores(network)
    kept = tuple(i for i in network.initials if not _is_position(i.target, stores))
    return replace(network, initials=(*found.guesses(), *kept, *found.fixed(), *found.loops()))


class _Contents:
    """What the initial positions of one network say."""

    def __init__(self, network: Network, wanted: frozenset[Wanted]) -> None:
        self.sizes = Sizes(network)
        self.wanted = wanted
        self.said: dict[Wanted, list[Initial]] = {}
        for initial in network.initials:
            if initial.target.op == "var" and not initial.target.data[2]:
                kind = "bq" if initial.target.data[1] == "be" else initial.target.data[1]
                self.said.setdefault((initial.target.data[0], kind), []).append(initial)
        self.branches = [b for b in network.branches if b.domain.common == "flow" and self._holds(b)]

    def _holds(self, b: Branch) -> bool:
        """Whether the branch's displacement is an unknown of the start: between two ends."""
        return b.plus is not None and b.minus is not None and (b.kind == "potential" or (b.name, "bq") in self.wanted)

    def _content(self, b: Branch) -> Node:
        return ex.var(b.name, "bq", *b.at) if b.kind == "potential" else _quadrature(b.name, b.at)

    def guesses(self) -> Iterator[Initial]:
        """Contents that nothing is written of, by the positions of their ends, of which something is."""
        moved = self._moved()
        for b in self.branches:
            within = ranges_of(b.loops, self.sizes, b.place)
            ends = [self._start(t, within) for t in (b.plus, b.minus)]
            if not b.loops and b.plus is not None and b.minus is not None:
                ends = [moved.get(self._point(t), end) for t, end in zip((b.plus, b.minus), ends, strict=True)]
            if ends == [None, None]:
                continue
            value = ex.sub(ends[0] or ex.const(0.0), ends[1] or ex.const(0.0))
            holes = [m[0] for i in self.said.get((b.name, "bq"), ()) if (m := meeting(i, b.at, within, self.sizes))]
            for rest in beside(within, holes):
                yield Initial(self._content(b), value, False, narrowed(b.loops, rest), b.place)

    def _moved(self) -> dict[_Point, Node]:
        """Positions of points that fixed contents join to others: guesses moved least, written ones less."""
        forest, guess = _Forest(), dict[_Point, tuple[Node, float]]()
        for b in (b for b in self.branches if not b.loops and b.kind == "potential"):
            assert b.plus is not None
            assert b.minus is not None
            for t in (b.plus, b.minus):
                if t.node is not None and self._point(t) not in guess:
                    found = self._start(t, {})
                    guess[self._point(t)] = (ex.const(0.0), UNWRITTEN) if found is None else (found, 1.0)
                    for known in itertools.islice(self._fixed(t, {}), 1):
                        forest.join(self._point(t), None, known.value)
            for initial in self.said.get((b.name, "bq"), ()):
                content = self._said_content(b, initial)
                if content is not None:
                    forest.join(self._point(b.plus), self._point(b.minus), content)
        moved: dict[_Point, Node] = {}
        for points in (points for points in forest.trees.values() if len(points) > 1):
            over = {p: forest.over[p][1] for p in points}
            if None in over:
                shift = ex.neg(over[None])
            else:
                total = sum(guess[p][1] for p in points)
                shift = ex.add(*(ex.scale(guess[p][1] / total, ex.sub(guess[p][0], over[p])) for p in points))
            moved |= {p: ex.add(over[p], shift) for p in points if p is not None}
        return moved

    def _said_content(self, b: Branch, initial: Initial) -> Node | None:
        """The fixed content that a statement gives a single store; None where it gives none."""
        if not initial.fixed or ex.variables(initial.value) or meeting(initial, b.at, {}, self.sizes) is None:
            return None
        return initial.value if initial.target.data[1] == "bq" else charge(b, initial.value)

    def _start(self, terminal: Terminal | None, within: Ranges) -> Node | None:
        """The initial position of a terminal over the branch's loops, as far as it is written."""
        if terminal is None or terminal.node is None:
            return None
        return initially(self.said.get((terminal.node, "nq"), ()), terminal.at, within, self.sizes)

    def fixed(self) -> Iterator[Initial]:
        """Contents of the elements of loops between places whose positions are known."""
        for b in self.branches:
            if not b.loops:
                continue
            within = ranges_of(b.loops, self.sizes, b.place)
            ends = [self._known(t, within) for t in (b.plus, b.minus)]
            left, content = count(within), self._content(b)
            for one, other in itertools.product(*ends):
                both = {name: common(one.within[name], other.within[name]) for name in within}
                if left > 0 and count(both):
                    left -= count(both)
                    value = ex.sub(one.value, other.value)
                    loops = narrowed(b.loops, both)
                    if ex.variables(value):
                        yield Initial(ex.sub(content, value), ex.const(0.0), True, loops, b.place)
                    else:
                        yield Initial(content, value, True, loops, b.place)

    def _known(self, terminal: Terminal | None, within: Ranges) -> Iterator[_Known]:
        """Positions of a terminal: fixed ones, then its quadrature."""
        if terminal is None or terminal.node is None:
            yield _Known(within, ex.const(0.0))
            return
        yield from self._fixed(terminal, within)
        if (terminal.node, "nq") in self.wanted:
            yield _Known(within, _quadrature(terminal.node, terminal.at))

    def _fixed(self, terminal: Terminal, within: Ranges) -> Iterator[_Known]:
        """What fixed statements say of the position of a terminal at a node."""
        for initial in self.said.get((str(terminal.node), "nq"), ()):
            found = meeting(initial, terminal.at, within, self.sizes) if initial.fixed else None
            if found is not None:
                yield _Known(*found)

    def loops(self) -> Iterator[Initial]:
        """Equations around the loops that fixed positions, quadratures and single stores close."""
        forest = _Forest()
        for b in self.branches:
            for t in () if b.loops else (b.plus, b.minus):
                if t is not None and t.node is not None and self._point(t) not in forest.over:
                    known = next(self._known(t, {}), None)
                    if known is not None:
                        forest.join(self._point(t), None, known.value)
        for b in self.branches:
            if not b.loops and b.plus is not None and b.minus is not None:
                content = self._content(b)
                around = forest.join(self._point(b.plus), self._point(b.minus), content)
                if around is None:
                    continue
                if ex.variables(around):
                    yield Initial(ex.sub(content, around), ex.const(0.0), True, (), b.place)
                else:
                    yield Initial(content, around, True, (), b.place)

    def _point(self, terminal: Terminal) -> _Point:
        if terminal.node is None:
            return None
        return terminal.node, tuple(self.sizes.bound(a, None).value for a in terminal.at)


class _Forest:
    """Points joined by displacements: the position of each over the root of its tree."""

    def __init__(self) -> None:
        self.over: dict[_Point, tuple[_Point, Node]] = {}
        self.trees: dict[_Point, list[_Point]] = {}

    def join(self, plus: _Point, minus: _Point, content: Node) -> Node | None:
        """Join two points; where they are joined already, the position of the first over the second."""
        (root, one), (other_root, other) = self._at(plus), self._at(minus)
        if root == other_root:
            return ex.sub(one, other)
        # the first tree hangs at the second: position of its root over the other's
        shift = ex.add(other, content, ex.neg(one))
        for point in self.trees.pop(root):
            self.over[point] = other_root, ex.add(self.over[point][1], shift)
            self.trees[other_root].append(point)
        return None

    def _at(self, point: _Point) -> tuple[_Point, Node]:
        if point not in self.over:
            self.over[point] = point, ex.const(0.0)
            self.trees[point] = [point]
        return self.over[point]
