"""Inductive loops: kinetic stores in parallel that start with different momenta.

In the complementary family a common-effort node has one momentum, and a store between two nodes holds their difference.
Around a loop of stores the initial momenta need not add up to zero: each store of such a part of the network then holds
the difference and a constant, its own initial momentum (the reflection of language, section 11, 11).  A store in such a
loop that nothing is said of, beside one of which something is, has a dynamic variable of rate zero for it, which the
start chooses.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from sysdyn.compiler.network.initially import initially
from sysdyn.compiler.network.primal.bounds import Sizes
from sysdyn.compiler.network.primal.contents import momentum
from sysdyn.compiler.network.primal.overlaps import count, ranges_of
from sysdyn.compiler.network.primal.rings import closes, family
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.joined import Joined
from sysdyn.dsl.model.network import Branch, Dynamic, Initial, Network, Parameter, Shape, State


def with_linkages(network: Network) -> Network:
    """The network with a constant `branch.linkage` for each store of a loop that starts with a momentum, or may."""
    given: dict[str, list[Initial]] = {}
    for initial in network.initials:
        if initial.target.op == "var" and initial.target.data[1:] in (("bf", 0), ("bp", 0)):
            given.setdefault(initial.target.data[0], []).append(initial)
    kinetic = [b for b in network.branches if b.kind == "kinetic" and b.domain.common == "effort"]
    stores = [b for b in kinetic if b.minus is not None]
    parameters: dict[str, Parameter] = {}
    statements = Counter(b.name for b in network.branches)
    looped = [b for b in _in_loops(stores, Sizes(network)) if statements[b.name] == 1]
    for branch in looped:
        begun = _momentum(branch, given.get(branch.name, ()))
        if begun is not None:
            counters = tuple(loop.index for loop in branch.loops)
            name, unit = f"{branch.name}.linkage", branch.domain.momentum
            parameters[branch.name] = Parameter(name, _shape(branch), unit, (begun,), counters, branch.place)
    if not parameters:
        return network
    free = {b.name: b for b in looped if b.name not in given and b.law is not None and closes(b, stores)}

    constants = {*parameters, *free}

    def constant(name: str, at: tuple[Node, ...]) -> Node:
        if name in free:
            return ex.var(f"{name}.linkage", "s", *at)
        return ex.param(parameters[name].name, *at)

    def held(root: Node) -> Node:
        """Momenta of these stores as the node's difference and the constant."""
        change = {
            n: ex.add(n, constant(n.data[0], n.args))
            for n in ex.topological([root])
            if n.op == "var" and n.data[1:] == ("bp", 0) and n.data[0] in constants
        }
        return ex.substitute(root, change) if change else root

    def law(branch: Branch) -> Branch:
        if branch.name not in constants or branch.law is None:
            return replace(branch, law=None if branch.law is None else held(branch.law))
        shift = constant(branch.name, branch.at)
        if branch.side == "p":
            return replace(branch, law=ex.sub(held(branch.law), shift), shift=shift)
        return replace(branch, law=held(branch.law), shift=shift)

    def start(initial: Initial) -> Initial:
        target = initial.target
        if target.op == "var" and target.data[1:] == ("bp", 0) and target.data[0] in parameters:
            return replace(initial, value=ex.sub(initial.value, constant(target.data[0], target.args)))
        return replace(initial, target=held(target))

    states = [State(f"{name}.linkage", _shape(b), b.domain.momentum, b.place) for name, b in free.items()]

    def unsaid(branch: Branch) -> Initial:
        content = held(ex.var(branch.name, "bp", *branch.at))
        zero, unit = ex.const(0.0), branch.domain.momentum.text
        return Initial(content, zero, False, branch.loops, branch.place, branch.name, unit, said=False)

    return replace(
        network,
        parameters=(*network.parameters, *parameters.values()),
        branches=tuple(law(b) for b in network.branches),
        initials=(*(start(i) for i in network.initials), *(unsaid(b) for b in free.values())),
        states=(*network.states, *states),
        constraints=tuple(replace(c, expression=held(c.expression)) for c in network.constraints),
        dynamics=(
            *(replace(d, expression=held(d.expression)) for d in network.dynamics),
            *(Dynamic(constant(b.name, b.at), ex.const(0.0), b.loops, b.place) for b in free.values()),
        ),
        observations=tuple(replace(o, expression=held(o.expression)) for o in network.observations),
        speeds=tuple(replace(o, expression=held(o.expression)) for o in network.speeds),
        expectations=tuple(
            replace(e, left=held(e.left), right=held(e.right), within=None if e.within is None else held(e.within))
            for e in network.expectations
        ),
    )


def _shape(branch: Branch) -> Shape:
    return tuple((loop.first, loop.last) for loop in branch.loops)


def _in_loops(stores: Sequence[Branch], sizes: Sizes) -> list[Branch]:
    """Stores of parts of the network in which a loop of them is closed, by families of nodes."""
    parts = Joined[str]()
    ends = {id(b): tuple(family(b, t) for t in (b.plus, b.minus)) for b in stores}
    within: dict[str, int] = {}
    beside: dict[str, int] = {}
    closed: set[str] = set()
    for b in stores:
        one, other = ends[id(b)]
        if one == other:
            within[one] = within.get(one, 0) + 1
            continue
        for end in (one, other):
            beside[end] = beside.get(end, 0) + count(ranges_of(b.loops, sizes, b.place))
        if not parts.join(one, other):
            closed.add(one)
    # a chain within a family closes a loop with another one, or with two ways out of it
    closed |= {name for name, number in within.items() if number > 1 or beside.get(name, 0) > 1}
    found = {parts.first(name) for name in closed}
    return [b for b in stores if parts.first(ends[id(b)][0]) in found]


def _momentum(branch: Branch, initials: Sequence[Initial]) -> Node | None:
    """The initial momentum of a store over its loops; None where it has none that the law gives."""
    if branch.law is None:
        return None
    found: list[Initial] = []
    for initial in initials:
        if initial.target.data[1] == "bp":
            found.append(initial)
            continue
        mark = ex.index("#v")
        held = momentum(branch, mark)
        if held is None:
            return None
        here = dict(zip(branch.at, initial.target.args, strict=True))
        value = ex.substitute(ex.substitute(held, here), {mark: initial.value})
        found.append(replace(initial, value=value))
    return initially(found, branch.at)
