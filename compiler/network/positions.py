"""Positions in the complementary family: what stores tell of them, and what initial positions tell of stores.

The contents of stores between common-flow nodes are differences of positions x, c = B x: around every loop of stores,
quadratures and fixed positions they add up to zero at the start.  A spanning forest of the nodes (`primal/forest.py`)
tells these loops, and the positions of what stores hold to the ground or apart.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import Sizes, box_size
from sysdyn.compiler.network.primal.contents import told
from sysdyn.compiler.network.primal.forest import IndexForest
from sysdyn.compiler.network.primal.incidence import indices, loops_over, ranges_over, unrolled
from sysdyn.compiler.network.primal.index_classes import Cell, Cut, End, Link
from sysdyn.compiler.network.primal.overlaps import Ranges, initially, narrowed, ranges_of, untold
from sysdyn.compiler.network.quadratures import Wanted, is_position, quadrature, stores_of
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Initial, Loop, Network, NodeFamily, Terminal
from sysdyn.dsl.model.rewriting import TRACED, rewritten
from sysdyn.dsl.text.diagnostics import ModelError, Place
from sysdyn.values import dataclass

UNWRITTEN = 1e-6
"""Weight (of squares) of a guess that the text does not write, as the consistent start has it."""
_GROUND = Terminal(None, ())


def from_stores(network: Network) -> Network:
    """Traced positions of points that stores hold to the ground, as displacements of these stores."""
    points = _Points(network, [[s for s in _springs(network, frozenset()) if not s.loops]])

    def read(root: Node) -> Node:
        read = [n for n in ex.topological([root]) if n.op == "var" and n.data[1:] == ("nq", 0)]
        change = {n: path for n in read if (path := points.over_ground(n)) is not None}
        return ex.substitute(root, change) if change else root

    return rewritten(network, read, TRACED)


@dataclass(frozen=True, slots=True)
class _Join:
    """Points of a family joined with others: the position of plus over minus; branch: whose displacement it is."""

    plus: Terminal
    minus: Terminal
    content: Node
    loops: tuple[Loop, ...]
    place: Place
    branch: Branch | None = None


def _springs(network: Network, wanted: frozenset[Wanted]) -> list[_Join]:
    """Branches between common-flow nodes whose displacement is an unknown of the start."""
    found = []
    for b in network.branches:
        stores = b.kind == "potential"
        if b.domain.common == "flow" and b.plus and b.minus and (stores or (b.name, "bq") in wanted):
            content = ex.var(b.name, "bq", *b.at) if stores else quadrature(b.name, b.at)
            found.append(_Join(b.plus, b.minus, content, b.loops, b.place, b))
    return found


class _Points:
    """The common-flow nodes of a network in a forest, joined in stages; item 0 is the ground.

    What indices do not tell (no i + c) joins nothing.
    """

    def __init__(self, network: Network, stages: Sequence[Sequence[_Join]], about: Sequence[Initial] = ()) -> None:
        """Cells are cut where a statement about nodes begins or ends."""
        self.sizes = Sizes(network)
        self.nodes = [n for n in network.nodes if n.domain.common == "flow"]
        self._item = {n.name: k for k, n in enumerate(self.nodes, 1)}
        self._joins = [j for stage in stages for j in stage]
        items = [(), *(self.sizes.box(n.shape, n.place) for n in self.nodes)]
        number = itertools.count()
        links = [[link for j in stage if (link := self._link(j, next(number)))] for stage in stages]
        self.forest = IndexForest(items, links, [cut for i in about for cut in self._cuts(i)])

    def _link(self, join: _Join, owner: int) -> tuple[Link, Node] | None:
        try:
            within = ranges_of(join.loops, self.sizes, join.place)
            plus, minus = (self._end(t, within, join.place) for t in (join.plus, join.minus))
        except (ModelError, KeyError):
            return None
        box = tuple(within.values())
        over = dict(zip(map(ex.index, within), indices(box), strict=True))
        return (Link(box, plus, minus, owner=owner), ex.substitute(join.content, over)) if box_size(box) else None

    def _end(self, terminal: Terminal, within: Ranges, place: Place | None) -> End:
        number, item = {name: k for k, name in enumerate(within)}, self._item[terminal.node] if terminal.node else 0
        at = (self.sizes.affine(a, within, place) for a in terminal.at)
        return End(item, tuple((None if a.loop is None else number[a.loop], a.offset) for a in at))

    def _cuts(self, initial: Initial) -> Iterator[Cut]:
        within = ranges_of(initial.loops, self.sizes, initial.place)
        for d, i in enumerate(self.sizes.reach(initial.target.args, within, initial.place)):
            yield from ((self._item[initial.target.data[0]], d, cut) for cut in (i.first, i.last.plus(1)))

    def over_ground(self, node: Node) -> Node | None:
        """The position of a single point; None where nothing joins it to the ground."""
        try:
            return self.forest.between(self._end(Terminal(node.data[0], node.args), {}, None), End(0, ()))
        except (ModelError, KeyError):
            return None

    def left(self) -> list[_Join]:
        """What closes loops in a pattern that index classes cannot hold."""
        return [self._joins[link.owner] for link in self.forest.refused] if self.forest.misses_loops() else []

    def loops(self) -> Iterator[tuple[_Join, tuple[Loop, ...], Node]]:
        """Who closes loops, where, and the position of plus over minus that others tell."""
        for owner, box, around in self.forest.loops:
            join = self._joins[owner]
            names = [loop.index for loop in join.loops]
            back = dict(zip(indices(box), map(ex.index, names), strict=True))
            yield join, narrowed(join.loops, dict(zip(names, box, strict=True))), ex.substitute(around, back)


def with_contents(network: Network, wanted: frozenset[Wanted]) -> Network:
    """Initial positions as initial displacements between them; wanted: displacements with quadratures."""
    found = _Contents(network, wanted)
    stores = stores_of(network)
    kept = tuple(i for i in network.initials if not is_position(i.target, stores))
    return replace(network, initials=(*found.guesses(), *kept, *found.loops()))


class _Contents:
    """What the initial positions of one network say."""

    def __init__(self, network: Network, wanted: frozenset[Wanted]) -> None:
        self.network, self.wanted, self.sizes = network, wanted, Sizes(network)
        self.said: dict[Wanted, list[Initial]] = {}
        for initial in network.initials:
            if initial.target.op == "var" and not initial.target.data[2]:
                kind = "bq" if initial.target.data[1] == "be" else initial.target.data[1]
                self.said.setdefault((initial.target.data[0], kind), []).append(initial)
        self.about = [i for n in network.nodes for i in self.said.get((n.name, "nq"), ())]
        self.known = [_Join(_at(i), _GROUND, i.value, i.loops, i.place) for i in self.about if i.fixed]
        self.springs = _springs(network, wanted)

    def guesses(self) -> Iterator[Initial]:
        """Contents that nothing is written of, by the positions of their ends, of which something is."""
        for moved in tuple(self._moved()):
            self.said.setdefault((moved.target.data[0], "nq"), []).append(moved)
        for j in self.springs:
            within = ranges_of(j.loops, self.sizes, j.place)
            ends = [self._start(t, within) for t in (j.plus, j.minus)]
            if ends == [None, None] or j.branch is None:
                continue
            value = ex.sub(*(end or ex.const(0.0) for end in ends))
            for rest in untold(self.said.get((j.branch.name, "bq"), ()), j.branch.at, within, self.sizes):
                yield Initial(j.content, value, False, narrowed(j.loops, rest), j.place)

    def _start(self, point: Terminal, within: Ranges) -> Node | None:
        """The initial position of points over ranges, as far as it is written."""
        return initially(self.said.get((str(point.node), "nq"), ()), point.at, within, self.sizes)

    def loops(self) -> Iterator[Initial]:
        """Contents around the loops that fixed positions, quadratures and stores close: what they must be."""
        read = [_read(n, self.sizes) for n in self.network.nodes if (n.name, "nq") in self.wanted]
        points = _Points(self.network, [self.known, read, self.springs])
        told = any((j.branch.name, "bq") in self.said for j in self.springs if j.branch is not None)
        for j in points.left() if told or self.about else ():
            (found,) = unrolled("a loop in which contents are said joins nodes along two offsets", j.place).diagnostics
            raise ModelError([replace(found, help="formulation lagrangian, hamiltonian")])
        for join, loops, around in points.loops():
            if join.branch is not None:
                known = not ex.variables(around)
                target, value = (join.content, around) if known else (ex.sub(join.content, around), ex.const(0.0))
                yield Initial(target, value, True, loops, join.place)

    # -- moved guesses --------------------------------------------------------------------------------------

    def _told(self, *, fixed: bool) -> Iterator[_Join]:
        """Contents that the text says, as numbers."""
        for j in self.springs:
            if j.branch is not None and j.branch.kind == "potential":
                said = self.said.get((j.branch.name, "bq"), ())
                numbers = [i for i in said if i.fixed == fixed and not ex.variables(i.value)]
                for _, loops, content in told(j.branch, numbers, self.sizes):
                    yield replace(j, loops=loops, content=content)

    def _moved(self) -> Iterator[Initial]:
        """Positions of points that contents join to others: guesses moved least, written ones less."""
        told = [tuple(self._told(fixed=fixed)) for fixed in (True, False)]
        if not any(told):
            return
        numbers = [j for j in self.known if not ex.variables(j.content)]
        points = _Points(self.network, [numbers, *told], self.about)
        for cells in points.forest.trees():
            shift = self._shift(points, cells)
            for cell in cells:
                if cell[0]:
                    node, box = points.nodes[cell[0] - 1], points.forest.box(cell)
                    value = points.forest.along(cell, shift)
                    target = ex.var(node.name, "nq", *indices(box))
                    yield Initial(target, value, False, loops_over(box), node.place)

    def _shift(self, points: _Points, cells: Sequence[Cell]) -> Node:
        """What is added to the positions of a tree: the ground stands at zero, others have the guessed mean."""
        forest, terms, weights = points.forest, [], []
        for cell in cells:
            if not cell[0]:
                return ex.neg(forest.along(cell))
            box = forest.box(cell)
            guess = self._start(Terminal(points.nodes[cell[0] - 1].name, indices(box)), ranges_over(box))
            weight = UNWRITTEN if guess is None else 1.0
            total, number = forest.summed(cell, ex.sub(guess or ex.const(0.0), forest.along(cell)))
            terms.append((weight, total))
            weights.append((weight, number))
        return ex.div(ex.linear(0.0, terms), ex.linear(0.0, weights))


def _at(initial: Initial) -> Terminal:
    return Terminal(initial.target.data[0], initial.target.args)


def _read(node: NodeFamily, sizes: Sizes) -> _Join:
    """Nodes at their quadratures over the ground."""
    box = sizes.box(node.shape, node.place)
    at = indices(box)
    return _Join(Terminal(node.name, at), _GROUND, quadrature(node.name, at), loops_over(box), node.place)
