"""Elements written out by hand with the same law and the same kind of neighbourhood as families: a netlist as an array.

Nodes that equal branch ends touch are one family, in the order of the text; branches of one law (numbers and scalar
parameters apart) whose ends run along such families by one are one statement in a loop, their numbers an array.  So a
chain, a mesh or a row of stages is lowered once.  What has no such order is gathered by strands (`strands.py`) between
nodes of any neighbourhood, which tables of indices tell; what is left stays as it is written.

Received: a Network as the front end made it.  Returned: the same model; `Network.authors` holds what the author calls
each element of a family, so that nothing else shows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.neighbourhoods import MARK, RUN, BranchSequence, Found, Site, laws_of, side_by_side
from sysdyn.compiler.network.skeleton import Shaped, fill_shape, shape_of
from sysdyn.compiler.network.strands import in_strands
from sysdyn.dsl.model.expression import Node, add, const, index, param, substitute, var, variables
from sysdyn.dsl.model.network import Branch, InitialCondition, Loop, Network, NodeFamily, Parameter, Terminal
from sysdyn.dsl.model.rewriting import rewritten
from sysdyn.dsl.model.units import Unit, si
from sysdyn.dsl.text.diagnostics import Place

LEAST = 128
"""Branches and nodes that must become fewer: of less, what is written is lowered as it stands."""
FEW = 64
"""Statements that may remain beside families whose elements stand side by side; of more, tables are tried."""
_INDEX = "#g"


def gather_families(network: Network, *, irregular: bool = True) -> Network:
    """The network with families for what is alike; the network itself where little is.

    irregular: also where only tables tell what is joined to what.
    """
    if len(network.branches) < LEAST:
        return network
    laws = laws_of(network)
    best = side_by_side(network, laws)
    for kept in (best, ({}, [])) if irregular else ():
        if _count_remaining(network, best) > FEW:
            best = min(best, in_strands(network, laws, kept), key=lambda found: _count_remaining(network, found))
    sites, runs = best
    if sum(len(run.members) for run in runs) - len(runs) < LEAST:
        return network
    return _Families(network, sites, runs).network()


def _count_remaining(network: Network, found: Found) -> int:
    """Statements of branches and nodes that remain."""
    sites, runs = found
    fewer = sum(len(run.members) - 1 for run in runs) + len(sites) - len({family for family, _ in sites.values()})
    return len(network.branches) + len(network.nodes) - fewer


class _Families:
    """The network under way; sites: of the nodes that stand in families."""

    def __init__(self, network: Network, sites: dict[str, Site], runs: Sequence[BranchSequence]) -> None:
        self.whole, self.sites, self.runs = network, sites, runs
        self.names: dict[str, list[str]] = {}
        for name, (family, _) in sites.items():
            self.names.setdefault(family, []).append(name)
        self.at: dict[str, tuple[str, int]] = {}
        for name, (family, k) in sites.items():
            self.at[name] = self.names[family][0] + MARK, k
        for run in runs:
            for k, (b, _) in enumerate(run.members):
                self.at[b.name] = run.members[0][0].name + MARK, k
        self.units = {p.name: p.unit for p in network.parameters}
        self.parameters: list[Parameter] = []

    def network(self) -> Network:
        """The whole."""
        whole, heads = self.whole, {run.members[0][0].name: run for run in self.runs}
        branches = []
        for b in whole.branches:
            if b.name in heads:
                branches.append(self._branch(heads[b.name]))
            elif b.name not in self.at:
                branches.append(replace(b, plus=self._end(b.plus), minus=self._end(b.minus)))
        nodes = [f for node in whole.nodes for f in self._node(node)]
        found = replace(rewritten(replace(whole, branches=tuple(branches)), self.in_families), nodes=tuple(nodes))
        initials = tuple(self._initials(found.initials))
        places = {n.name: n.place for n in whole.nodes}
        authors = {names[0] + MARK: tuple((n, places[n]) for n in names) for names in self.names.values()}
        authors |= {r.members[0][0].name + MARK: tuple((b.name, b.place) for b, _ in r.members) for r in self.runs}
        parameters = (*whole.parameters, *self.parameters)
        return replace(found, initials=initials, parameters=parameters, authors=authors)

    def _node(self, node: NodeFamily) -> Iterator[NodeFamily]:
        family = self.sites.get(node.name, ("", -1))
        if family[1] < 0:
            yield node
        elif family[1] == 0:
            names = self.names[family[0]]
            yield replace(node, name=names[0] + MARK, shape=((const(0), const(len(names) - 1)),))

    def _end(self, end: Terminal | None) -> Terminal | None:
        if end is None or end.node not in self.at:
            return end
        name, k = self.at[end.node]
        return Terminal(name, (const(k),))

    def _branch(self, run: BranchSequence) -> Branch:
        """A run as one statement in a loop."""
        head, shape = run.members[0]
        name, k, last = head.name + MARK, index(_INDEX), const(len(run.members) - 1)
        law = fill_shape(shape, name, (k,), self._numbers(name, [s.holes for _, s in run.members], head.place))
        ends = []
        for side, end in enumerate((head.plus, head.minus)):
            found = self._end(end)
            if found is not None and run.moves[side]:
                found = Terminal(found.node, (add(k, found.at[0]),))
            elif found is not None and run.picked[side]:
                own = [(b.plus, b.minus)[side] for b, _ in run.members]
                found = Terminal(found.node, (self._index_of_element(own, head.place),))
            ends.append(found)
        loops = (Loop(_INDEX, const(0), last),)
        return replace(head, name=name, at=(k,), loops=loops, law=law, plus=ends[0], minus=ends[1])

    def _index_of_element(self, ends: Sequence[Terminal | None], place: Place) -> Node:
        """Which element of its family each branch of a run meets."""
        places = [self.at[end.node][1] for end in ends if end is not None and end.node is not None]
        if places == list(range(places[0], places[0] + len(places))):
            return add(index(_INDEX), const(places[0]))
        return self._array("ends", si(()), [const(k) for k in places], place, whole=True)

    def _array(self, name: str, unit: Unit, values: Sequence[Node], place: Place, *, whole: bool = False) -> Node:
        """The element of a new array that the loop of a statement is at."""
        array = f"#{name}{len(self.parameters)}"
        shape = ((const(0), const(len(values) - 1)),)
        self.parameters.append(Parameter(array, shape, unit, tuple(values), (), place, whole))
        return param(array, index(_INDEX))

    def _numbers(self, name: str, holes: Sequence[tuple[Node, ...]], place: Place) -> list[Node]:
        """What stands in each hole: the number that all have, or the element of an array."""
        found = []
        for values in zip(*holes, strict=True):
            if all(v is values[0] for v in values):
                found.append(values[0])
                continue
            found.append(self._array(name, self._unit(values), values, place))
        return found

    def _unit(self, values: Sequence[Node]) -> Unit:
        named = next((v for v in values if v.op == "param"), None)
        return si(()) if named is None else self.units[named.data]

    def in_families(self, root: Node) -> Node:
        """An expression with elements of families for what stands by itself."""
        change = {}
        for n in sorted(variables(root), key=lambda n: n.number):
            if n.op == "var" and n.data[1][0] in "nb" and n.data[0] in self.at and not n.args:
                family, k = self.at[n.data[0]]
                change[n] = var(family, n.data[1], const(k), order=n.data[2])
        return substitute(root, change) if change else root

    def _initials(self, initials: Sequence[InitialCondition]) -> Iterator[InitialCondition]:
        """Initial values of neighbours that are said alike as one statement in a loop, in the place of the first."""
        groups: dict[tuple[object, ...], list[tuple[int, InitialCondition, Shaped]]] = {}
        # statements that differ by the element and numbers alone
        for i in initials:
            target, store = i.target, self.at.get(i.store, (i.store, 0))[0]
            shape = shape_of(i.value, "") if target.op == "var" and target.data[0].endswith(MARK) else None
            if shape is not None and not i.loops:
                key = (target.data, i.fixed, store, i.unit, i.depth, i.said, shape.key)
                groups.setdefault(key, []).append((int(target.args[0].data), i, shape))
        alike: dict[int, list[tuple[int, InitialCondition, Shaped]]] = {}
        # a run of neighbours, long enough
        for found in groups.values():
            places = [k for k, _, _ in found]
            if len(found) >= RUN and places == list(range(places[0], places[0] + len(found))):
                alike |= {id(i): found if k == places[0] else [] for k, i, _ in found}
        # the run in the place of its first statement
        for i in initials:
            if id(i) not in alike:
                yield replace(i, store=self.at.get(i.store, (i.store, 0))[0])
            elif alike[id(i)]:
                yield self._gather_initials(alike[id(i)])

    def _gather_initials(self, found: Sequence[tuple[int, InitialCondition, Shaped]]) -> InitialCondition:
        first, head, shape = found[0]
        (name, kind, order), k = head.target.data, index(_INDEX)
        value = fill_shape(shape, "", (), self._numbers(name, [s.holes for _, _, s in found], head.place))
        target = var(name, kind, add(k, const(first)), order=order)
        loops = (Loop(_INDEX, const(0), const(len(found) - 1)),)
        return replace(head, target=target, value=value, loops=loops, store=self.at.get(head.store, (head.store, 0))[0])
