"""Elements written out by hand with the same law and the same kind of neighbourhood as families: a netlist as an array.

Nodes that equal branch ends touch are one family, in the order of the text; branches of one law (numbers and scalar
parameters apart) whose ends run along such families by one are one statement in a loop, their numbers an array.  So a
chain, a mesh or a row of stages is lowered once.  What has no such order stays as it is written.

Received: a Network as the front end made it.  Returned: the same model; `Network.authors` holds what the author calls
each element of a family, so that nothing else shows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.skeleton import Shaped, filled, shaped
from sysdyn.dsl.model.expression import Node, add, const, index, param, substitute, var, variables
from sysdyn.dsl.model.joined import Joined
from sysdyn.dsl.model.network import Branch, Initial, Loop, Network, NodeFamily, Parameter, Terminal
from sysdyn.dsl.model.rewriting import rewritten
from sysdyn.dsl.model.units import Unit, si
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass

LEAST = 128
"""Branches and nodes that must become fewer: of less, what is written is lowered as it stands."""
RUN = 8
"""Branches of a statement in a loop, at least."""
SHORT = 2
"""Nodes between two places where the neighbourhood changes, at least on the average."""
ROUNDS = 8
"""Times that families are left out before all are: one that goes may tear others."""
MARK = "#"
"""Behind the first element's name: a family's own."""
_INDEX = "#g"
Site = tuple[str, int]
"""A family's key and a place in it; of a node by itself its name and -1, of ground "" and -1."""


@dataclass(frozen=True, slots=True)
class _Run:
    """Branches one after the other; moves: whether each end goes on by one."""

    members: tuple[tuple[Branch, Shaped], ...]
    ends: tuple[Site, Site]
    moves: tuple[bool, bool]


def gathered(network: Network) -> Network:
    """The network with families for what is alike; the network itself where little is."""
    if len(network.branches) < LEAST:
        return network
    free = _free(network)
    shapes = {b.name: s for b in network.branches if b.name in free and (s := shaped(b.law, b.name)) is not None}
    sites, runs = _whole(network, shapes, _sites(network, shapes))
    used = {site[0] for run in runs for site in run.ends if site[1] >= 0}
    fewer = sum(len(run.members) for run in runs) - len(runs)
    if fewer < LEAST:
        return network
    return _Families(network, {n: s for n, s in sites.items() if s[0] in used}, runs).network()


def _free(network: Network) -> set[str]:
    """Scalar branches between nodes that nothing but expressions names."""
    held = {name for c in network.couplings for name in (c.first, c.second)} | {s.element for s in network.switches}
    held |= {n for n, count in Counter(b.name for b in network.branches).items() if count > 1}
    return {
        b.name
        for b in network.branches
        if b.name not in held and not (b.loops or b.at or b.stated or MARK in b.name)
        if None is b.on is b.energy and None is not b.law
        if b.plus is not None and b.minus is not None and not (b.plus.at or b.minus.at)
    }


def _sites(network: Network, shapes: dict[str, Shaped]) -> dict[str, Site]:
    """Where each node stands: among those of its connected part that ends of the same branches touch."""
    parts = Joined[str]()
    touched: dict[str, list[tuple[object, ...]]] = {}
    for b in network.branches:
        names = [end.node for end in (b.plus, b.minus) if end is not None and end.node is not None]
        if len(names) == 2:
            parts.join(*names)
        key = shapes[b.name].key if b.name in shapes else ("", b.name)
        for k, end in enumerate((b.plus, b.minus)):
            if end is not None and end.node is not None:
                touched.setdefault(end.node, []).append((b.kind, b.side or "", k, len(names), key))
    found: dict[str, Site] = {}
    size: dict[str, int] = {}
    numbers: dict[tuple[object, ...], int] = {}
    for node in network.nodes:
        if node.shape or node.name in network.read or MARK in node.name or node.name not in touched:
            continue
        own = sorted(numbers.setdefault(t, len(numbers)) for t in touched[node.name])
        family = f"{parts.first(node.name)} {node.domain.name} {own}"
        found[node.name] = family, size.get(family, 0)
        size[family] = size.get(family, 0) + 1
    return {name: site for name, site in found.items() if size[site[0]] >= RUN}


def _whole(
    network: Network, shapes: dict[str, Shaped], sites: dict[str, Site]
) -> tuple[dict[str, Site], list[_Run]]:
    """Sites and runs without the families that single branches tear to pieces: these stay as they are written."""
    for _ in range(ROUNDS):
        runs = list(_runs(network, shapes, sites))
        torn = _torn(network, sites, runs)
        if not torn:
            return sites, runs
        sites = {name: site for name, site in sites.items() if site[0] not in torn}
    return {}, []


def _torn(network: Network, sites: dict[str, Site], runs: Sequence[_Run]) -> set[str]:
    """Families of which alike neighbours are fewer than SHORT on the average."""
    cuts: dict[str, set[int]] = {}
    for run in runs:
        for (family, first), moves in zip(run.ends, run.moves, strict=True):
            cuts.setdefault(family, set()).update((first, first + (len(run.members) if moves else 1)))
    held = {b.name for run in runs for b, _ in run.members}
    for b in network.branches:
        for end in (b.plus, b.minus) if b.name not in held else ():
            if end is not None and end.node in sites:
                family, k = sites[end.node]
                cuts.setdefault(family, set()).update((k, k + 1))
    size = Counter(family for family, _ in sites.values())
    return {family for family, number in size.items() if SHORT * len(cuts.get(family, ())) > number + SHORT}


def _runs(network: Network, shapes: dict[str, Shaped], sites: dict[str, Site]) -> Iterator[_Run]:
    """Branches of one law whose ends go along their families by one, or stay."""

    def site(end: Terminal | None) -> Site:
        assert end is not None
        return ("", -1) if end.node is None else sites.get(end.node, (end.node, -1))

    groups: dict[tuple[object, ...], list[tuple[int, int, Branch, tuple[Site, Site]]]] = {}
    for b in network.branches:
        if b.name in shapes:
            ends = site(b.plus), site(b.minus)
            if ends[0][1] >= 0 or ends[1][1] >= 0:
                apart = ends[1][1] - ends[0][1] if min(ends[0][1], ends[1][1]) >= 0 else 0
                key = (b.domain.name, b.kind, b.side, shapes[b.name].key, ends[0][0], ends[1][0], apart)
                groups.setdefault(key, []).append((ends[0][1], ends[1][1], b, ends))
    for found in groups.values():
        found.sort(key=lambda item: item[:2])
        first = 0
        for k in range(1, len(found) + 1):
            if k < len(found) and _next(found[k - 1][3], found[k][3]):
                continue
            if k - first >= RUN:
                own = found[first:k]
                members = tuple((b, shapes[b.name]) for _, _, b, _ in own)
                yield _Run(members, own[0][3], (own[0][0] >= 0, own[0][1] >= 0))
            first = k


def _next(before: tuple[Site, Site], here: tuple[Site, Site]) -> bool:
    """Whether each end that stands in a family goes on by one."""
    return all(b[1] == (a[1] + 1 if a[1] >= 0 else -1) for a, b in zip(before, here, strict=True))


class _Families:
    """The network under way; sites: of the nodes that stand in families."""

    def __init__(self, network: Network, sites: dict[str, Site], runs: Sequence[_Run]) -> None:
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
        found = replace(rewritten(replace(whole, branches=tuple(branches)), self.moved), nodes=tuple(nodes))
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

    def _branch(self, run: _Run) -> Branch:
        """A run as one statement in a loop."""
        head, shape = run.members[0]
        name, k, last = head.name + MARK, index(_INDEX), const(len(run.members) - 1)
        law = filled(shape, name, (k,), self._numbers(name, [s.holes for _, s in run.members], head.place))
        ends = []
        for end, moves in zip((head.plus, head.minus), run.moves, strict=True):
            found = self._end(end)
            if moves:
                assert found is not None
                found = Terminal(found.node, (add(k, found.at[0]),))
            ends.append(found)
        loops = (Loop(_INDEX, const(0), last),)
        return replace(head, name=name, at=(k,), loops=loops, law=law, plus=ends[0], minus=ends[1])

    def _numbers(self, name: str, holes: Sequence[tuple[Node, ...]], place: Place) -> list[Node]:
        """What stands in each hole: the number that all have, or the element of an array."""
        found = []
        for values in zip(*holes, strict=True):
            if all(v is values[0] for v in values):
                found.append(values[0])
                continue
            array = f"#{name}{len(self.parameters)}"
            shape = ((const(0), const(len(values) - 1)),)
            self.parameters.append(Parameter(array, shape, self._unit(values), values, (), place))
            found.append(param(array, index(_INDEX)))
        return found

    def _unit(self, values: Sequence[Node]) -> Unit:
        named = next((v for v in values if v.op == "param"), None)
        return si(()) if named is None else self.units[named.data]

    def moved(self, root: Node) -> Node:
        """An expression with elements of families for what stands by itself."""
        change = {}
        for n in sorted(variables(root), key=lambda n: n.number):
            if n.op == "var" and n.data[1][0] in "nb" and n.data[0] in self.at and not n.args:
                family, k = self.at[n.data[0]]
                change[n] = var(family, n.data[1], const(k), order=n.data[2])
        return substitute(root, change) if change else root

    def _initials(self, initials: Sequence[Initial]) -> Iterator[Initial]:
        """Initial values of neighbours that are said alike as one statement in a loop, in the place of the first."""
        groups: dict[tuple[object, ...], list[tuple[int, Initial, Shaped]]] = {}
        for i in initials:
            target, store = i.target, self.at.get(i.store, (i.store, 0))[0]
            shape = shaped(i.value, "") if target.op == "var" and target.data[0].endswith(MARK) else None
            if shape is not None and not i.loops:
                key = (target.data, i.fixed, store, i.unit, i.depth, i.said, shape.key)
                groups.setdefault(key, []).append((int(target.args[0].data), i, shape))
        alike: dict[int, list[tuple[int, Initial, Shaped]]] = {}
        for found in groups.values():
            places = [k for k, _, _ in found]
            if len(found) >= RUN and places == list(range(places[0], places[0] + len(found))):
                alike |= {id(i): found if k == places[0] else [] for k, i, _ in found}
        for i in initials:
            if id(i) not in alike:
                yield replace(i, store=self.at.get(i.store, (i.store, 0))[0])
            elif alike[id(i)]:
                yield self._said(alike[id(i)])

    def _said(self, found: Sequence[tuple[int, Initial, Shaped]]) -> Initial:
        first, head, shape = found[0]
        (name, kind, order), k = head.target.data, index(_INDEX)
        value = filled(shape, "", (), self._numbers(name, [s.holes for _, _, s in found], head.place))
        target = var(name, kind, add(k, const(first)), order=order)
        loops = (Loop(_INDEX, const(0), const(len(found) - 1)),)
        return replace(head, target=target, value=value, loops=loops, store=self.at.get(head.store, (head.store, 0))[0])
