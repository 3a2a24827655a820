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
from sysdyn.compiler.network.primal.contents import held_at
from sysdyn.compiler.network.primal.overlaps import (
    Ranges,
    beside,
    common,
    count,
    initially,
    meeting,
    narrowed,
    ranges_of,
    untold,
)
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Domain, Dynamic, Initial, Loop, Network, State, Terminal
from sysdyn.dsl.model.rewriting import TRACED, expressions, rewritten
from sysdyn.dsl.text.diagnostics import Place

Wanted = tuple[str, str]
"""Name and kind (nq, bq) of a displacement."""
_Point = tuple[str, tuple[int | Node, ...]] | None
"""A node by its name and indices, or the ground."""


# -- traced positions --------------------------------------------------------------------------------------


def from_stores(network: Network) -> Network:
    """Traced positions of points that stores hold to the ground, as displacements of these stores."""
    forest = _SpanningForest()
    for b in network.branches:
        single = b.kind == "potential" and b.domain.common == "flow" and not b.loops
        if single and b.plus is not None and b.minus is not None:
            plus, minus = (None if t.node is None else (t.node, t.at) for t in (b.plus, b.minus))
            forest.join(plus, minus, ex.var(b.name, "bq", *b.at))

    def read(root: Node) -> Node:
        read = [n for n in ex.topological([root]) if n.op == "var" and n.data[1:] == ("nq", 0)]
        change = {n: path for n in read if (path := forest.over_ground((n.data[0], n.args))) is not None}
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
    """Quadratures q' = f of what traces, expectations and dynamics read and no store holds, and what of: a dynamic
    variable NAME.q each, which begins as the displacement is written to begin.
    """
    stores = _stores(network)
    roots = ex.topological(expressions(network, "observations", "dynamics", "expectations"))
    wanted = dict.fromkeys((n.data[0], n.data[1]) for n in roots if _is_position(n, stores))

    def read(root: Node) -> Node:
        found = [n for n in ex.topological([root]) if n.op == "var" and n.data[:2] in wanted]
        return ex.substitute(root, {n: _quadrature(n.data[0], n.args, n.data[2]) for n in found}) if found else root

    families: dict[Wanted, list[tuple[tuple[Loop, ...], tuple[Node, ...], Domain, Place]]] = {}
    for n in network.nodes:
        loops = tuple(Loop(f"#x{k}", first, last) for k, (first, last) in enumerate(n.shape))
        families[n.name, "nq"] = [(loops, tuple(ex.index(x.index) for x in loops), n.domain, n.place)]
    for b in network.branches:
        families.setdefault((b.name, "bq"), []).append((b.loops, b.at, b.domain, b.place))
    states, dynamics = [], []
    for name, kind in wanted:
        for loops, at, domain, place in families[name, kind]:
            shape = tuple((loop.first, loop.last) for loop in loops)
            states.append(State(f"{name}.q", shape, domain.displacement, place))
            dynamics.append(Dynamic(_quadrature(name, at), ex.var(name, f"{kind[0]}f", *at), loops, place))
    starts = (i for i in network.initials if i.target.op == "var" and i.target.data in {(*w, 0) for w in wanted})
    begun = (replace(i, target=_quadrature(i.target.data[0], i.target.args)) for i in starts)
    network = rewritten(network, read, (*TRACED, "dynamics"))
    found = replace(
        network,
        states=(*network.states, *states),
        dynamics=(*network.dynamics, *dynamics),
        initials=(*network.initials, *begun),
    )
    return found, frozenset(wanted)


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


# -- contents ----------------------------------------------------------------------------------------------

UNWRITTEN = 1e-6
"""Weight (of squares) of a guess that the text does not write, as the consistent start has it."""


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
        branches = [(b, b.plus, b.minus) for b in network.branches if b.domain.common == "flow" and self._holds(b)]
        self.branches = [(b, plus, minus) for b, plus, minus in branches if plus is not None and minus is not None]
        self.single = [(b, self._point(plus), self._point(minus)) for b, plus, minus in self.branches if not b.loops]
        ends = [end for b, *both in self.branches if not b.loops for end in both]
        self.terminals = {self._point(t): t for t in ends if t.node is not None}

    def _holds(self, b: Branch) -> bool:
        """Whether the branch's displacement is an unknown of the start."""
        return b.kind == "potential" or (b.name, "bq") in self.wanted

    def _content(self, b: Branch) -> Node:
        return ex.var(b.name, "bq", *b.at) if b.kind == "potential" else _quadrature(b.name, b.at)

    def _point(self, terminal: Terminal) -> _Point:
        if terminal.node is None:
            return None
        return terminal.node, tuple(self.sizes.bound(a, None).value for a in terminal.at)

    def guesses(self) -> Iterator[Initial]:
        """Contents that nothing is written of, by the positions of their ends, of which something is."""
        moved = self._moved()
        for b, *terminals in self.branches:
            within = ranges_of(b.loops, self.sizes, b.place)
            ends = [self._start(t, within) for t in terminals]
            if not b.loops:
                ends = [moved.get(self._point(t), end) for t, end in zip(terminals, ends, strict=True)]
            if ends == [None, None]:
                continue
            value = ex.sub(*(end or ex.const(0.0) for end in ends))
            for rest in untold(self.said.get((b.name, "bq"), ()), b.at, within, self.sizes):
                yield Initial(self._content(b), value, False, narrowed(b.loops, rest), b.place)

    def _moved(self) -> dict[_Point, Node]:
        """Positions of points that fixed contents join to others: guesses moved least, written ones less."""
        forest = self._known_points(constant=True)
        for b, plus, minus in self.single:
            for i in self.said.get((b.name, "bq"), ()) if b.kind == "potential" else ():
                if i.fixed and not ex.variables(i.value) and meeting(i, b.at, {}, self.sizes) is not None:
                    content = held_at(b, i.target.data[1], i.value)
                    if content is not None:
                        forest.join(plus, minus, content)
        moved: dict[_Point, Node] = {}
        for points in (points for points in forest.trees.values() if len(points) > 1):
            over = {p: forest.over[p][1] for p in points}
            if None in over:
                shift = ex.neg(over[None])
            else:
                guess = {p: self._start(self.terminals[p], {}) for p in points}
                weights = [UNWRITTEN if g is None else 1.0 for g in guess.values()]
                apart = [ex.sub(g or ex.const(0.0), over[p]) for p, g in guess.items()]
                shift = ex.add(*(ex.scale(w / sum(weights), a) for w, a in zip(weights, apart, strict=True)))
            moved |= {p: ex.add(over[p], shift) for p in points if p is not None}
        return moved

    def _start(self, terminal: Terminal, within: Ranges) -> Node | None:
        """The initial position of a terminal over the branch's loops, as far as it is written."""
        return initially(self.said.get((str(terminal.node), "nq"), ()), terminal.at, within, self.sizes)

    def fixed(self) -> Iterator[Initial]:
        """Contents of the elements of loops between places whose positions are known."""
        for b, plus, minus in self.branches:
            within = ranges_of(b.loops, self.sizes, b.place)
            left = count(within) if b.loops else 0
            for (here, one), (there, other) in itertools.product(self._known(plus, within), self._known(minus, within)):
                both = {name: common(here[name], there[name]) for name in within}
                if left > 0 and count(both):
                    left -= count(both)
                    yield self._equal(b, ex.sub(one, other), narrowed(b.loops, both))

    def loops(self) -> Iterator[Initial]:
        """Equations around the loops that fixed positions, quadratures and single stores close."""
        forest = self._known_points(constant=False)
        for b, plus, minus in self.single:
            around = forest.join(plus, minus, self._content(b))
            if around is not None:
                yield self._equal(b, around, ())

    def _equal(self, b: Branch, value: Node, loops: tuple[Loop, ...]) -> Initial:
        """What a branch holds is fixed at a value, which may read other contents."""
        content = self._content(b)
        if ex.variables(value):
            content, value = ex.sub(content, value), ex.const(0.0)
        return Initial(content, value, True, loops, b.place)

    def _known(self, terminal: Terminal, within: Ranges) -> Iterator[tuple[Ranges, Node]]:
        """Where the position of a terminal is known, and what it is there: fixed, then its quadrature."""
        if terminal.node is None:
            yield within, ex.const(0.0)
            return
        for initial in self.said.get((terminal.node, "nq"), ()):
            found = meeting(initial, terminal.at, within, self.sizes) if initial.fixed else None
            if found is not None:
                yield found
        if (terminal.node, "nq") in self.wanted:
            yield within, _quadrature(terminal.node, terminal.at)

    def _known_points(self, *, constant: bool) -> _SpanningForest:
        """The ends of single branches, joined to the ground where their positions are known; constant: as numbers."""
        forest = _SpanningForest()
        for point, terminal in self.terminals.items():
            values = (value for _, value in self._known(terminal, {}) if not (constant and ex.variables(value)))
            known = next(values, None)
            if known is not None:
                forest.join(point, None, known)
        return forest


class _SpanningForest:
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

    def over_ground(self, point: _Point) -> Node | None:
        """The position of a point; None where nothing joins it to the ground."""
        (root, position), (origin, ground) = self._at(point), self._at(None)
        return ex.sub(position, ground) if root == origin else None

    def _at(self, point: _Point) -> tuple[_Point, Node]:
        if point not in self.over:
            self.over[point] = point, ex.const(0.0)
            self.trees[point] = [point]
        return self.over[point]
