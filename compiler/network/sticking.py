"""Dry friction as relations: the complementary family has no row for flows that are zero, and gammas read any effort
and flow.

Its effort c*sense becomes an unknown, closed by u = 0 while it sticks, else by c*sense: c may fall to zero meanwhile.
Where a sense stands in other terms too it is the unknown itself.  The friction of a content over nodes becomes a branch
between them first.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import replace

from sysdyn.compiler.network.written_energies import element
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Constraint, EnergyTerm, Network, Switch, Unknown, loop_indices
from sysdyn.dsl.model.rewriting import EXPRESSIONS, expressions, rewritten
from sysdyn.dsl.model.units import NONE, Unit, si


def as_relations(network: Network) -> Network:
    """The network without reactions of what sticks; one without such is handed on as it is."""
    labels = {s.label for s in network.switches if s.kind == "friction" and not s.element}
    # contents over nodes first become branches
    for row in [c for c in network.constraints if c.name in labels]:
        network = _between_nodes(network, row)
    frictions = [s for s in network.switches if s.kind == "friction" and s.sense is not None]
    if not frictions:
        return network
    # senses that the contact sets: each becomes an unknown within its bound
    owners = {s.sense.data: s.label for s in frictions if s.sense is not None}
    own = [p for p in network.parameters if p.name in owners]
    efforts = _efforts(network, set(owners))

    # c*sense becomes c*unknown, or the unknown itself where it is an effort
    def with_set_values(root: Node) -> Node:
        for n in _senses(root, owners):
            unknown = ex.var(_set(n.data), "e", *n.args)
            alone = ex.substitute(root, {n: ex.const(0.0)})
            root = ex.add(alone, unknown) if n.data in efforts else ex.substitute(root, {n: unknown})
        return root

    found = rewritten(network, with_set_values)
    said = {o.name: o.expression for o in found.observations}
    given = dict(pair for s in frictions for pair in _watched_friction(s, said, efforts))
    senses = {label: iter([name for name, other in owners.items() if other == label]) for label in owners.values()}
    return replace(
        found,
        parameters=(*found.parameters, *(replace(p, name=_holds(p.name)) for p in own)),
        discretes=found.discretes | {_holds(p.name) for p in own},
        unknowns=(*found.unknowns, *(Unknown(_set(p.name), p.shape, _unit(p.name, efforts), p.place) for p in own)),
        constraints=tuple(_row(c, next(senses[c.name]), efforts) if c.name in senses else c for c in found.constraints),
        observations=tuple(replace(o, expression=given.get(o.name, o.expression)) for o in found.observations),
        switches=tuple(_relation(s) if s.sense is not None and s.sense.data in owners else s for s in network.switches),
    )


def _senses(root: Node, names: Container[str]) -> list[Node]:
    return [n for n in ex.topological([root]) if n.op == "param" and n.data in names]


def _coefficient(root: Node, sense: Node) -> Node:
    """What a sense is multiplied by; it reads the sense where that stands in another way."""
    mark = ex.var("#sense", "s")
    return ex.substitute(derivative(ex.substitute(root, {sense: mark}), mark), {mark: sense})


def _efforts(network: Network, names: set[str]) -> dict[str, tuple[Branch, Node]]:
    """The branch and the c of senses that stand in nothing but c*sense, its effort."""
    found = {}
    # c*sense as the only such term of a branch's law
    for branch in network.branches:
        law = branch.law or ex.const(0.0)
        for n in _senses(law, names):
            c = _coefficient(law, n)
            if n.args == loop_indices(branch.loops) and not _senses(c, names):
                found[n.data] = branch, c
    # and nowhere with another factor
    for root in expressions(network, *EXPRESSIONS):
        for n in _senses(root, names):
            if n.data in found and _coefficient(root, n) is not _factor(found[n.data], n.args):
                del found[n.data]
    return found


def _factor(effort: tuple[Branch, Node], at: tuple[Node, ...]) -> Node:
    """The c of an effort at these indices."""
    branch, c = effort
    return ex.substitute(c, dict(zip(loop_indices(branch.loops), at, strict=True)))


def _between_nodes(network: Network, row: Constraint) -> Network:
    """The network with the dry friction of a content over nodes as a branch between them; row: its psi u = 0."""
    mine = [s for s in network.switches if s.label == row.name]
    # friction of flows of nodes alone
    flows = sorted((n for n in ex.variables(row.expression) if n.op == "var"), key=lambda n: n.number)
    if not flows or flows[0].data[1:] != ("nf", 0):
        return network
    senses = {s.sense.data for s in mine if s.sense is not None}
    sign, nodes = derivative(row.expression, flows[0]), {n.name: n.domain for n in network.nodes}
    # the content that holds the friction, split in two
    for k, energy in enumerate(network.energies):
        rest = _without_friction(energy, senses)
        if energy.function != "D" or rest is energy.expression:
            continue
        part = replace(energy, expression=ex.sub(energy.expression, rest))
        branch = element(part, part.expression, f"{row.name} of nodes", nodes)
        if branch is None:
            return network

        # the flow of the new branch in the place of the combination of nodes
        def flow(at: tuple[Node, ...], order: int = 0, name: str = branch.name) -> Node:
            return ex.mul(sign, ex.var(name, "bf", *at, order=order))

        given = {s.value: flow(tuple(ex.const(float(i)) for i in s.at)) for s in mine}
        given |= {s.rate: flow(tuple(ex.const(float(i)) for i in s.at), 1) for s in mine}
        own = replace(row, expression=flow(branch.at))
        return replace(
            network,
            energies=(*network.energies[:k], replace(energy, expression=rest), *network.energies[k + 1 :]),
            branches=(*network.branches, branch),
            constraints=tuple(own if c is row else c for c in network.constraints),
            observations=tuple(replace(o, expression=given.get(o.name, o.expression)) for o in network.observations),
        )
    return network


def _without_friction(energy: EnergyTerm, senses: set[str]) -> Node:
    """A content without its friction: the terms with one of these senses."""
    found = [n for n in ex.topological([energy.expression]) if n.op == "param" and n.data in senses]
    return ex.substitute(energy.expression, dict.fromkeys(found, ex.const(0.0))) if found else energy.expression


def _set(sense: str) -> str:
    """The unknown in the place of a sense."""
    return f"{sense} set"


def _holds(sense: str) -> str:
    return f"{sense} holds"


def _unit(sense: str, efforts: Mapping[str, tuple[Branch, Node]]) -> Unit:
    return efforts[sense][0].domain.effort if sense in efforts else si(NONE)


def _row(c: Constraint, sense: str, efforts: Mapping[str, tuple[Branch, Node]]) -> Constraint:
    """The psi u = 0 of a statement as the gamma that closes its unknown."""
    at = loop_indices(c.loops)
    factor = _factor(efforts[sense], at) if sense in efforts else ex.const(1.0)
    slips = ex.sub(ex.var(_set(sense), "e", *at), ex.mul(factor, ex.param(sense, *at)))
    sticks = ex.compare("!=", ex.param(_holds(sense), *at), ex.const(0.0))
    return replace(c, kind="gamma", name=_set(sense), at=at, expression=ex.conditional(sticks, c.expression, slips))


def _watched_friction(s: Switch, said: Mapping[str, Node], efforts: Container[str]) -> Iterator[tuple[str, Node]]:
    """What events read of a friction: its effort, and what that lacks to c on both sides."""
    assert s.sense is not None
    bound, effort = said[s.bound or ""], ex.var(_set(s.sense.data), "e", *s.sense.args)
    effort = effort if s.sense.data in efforts else ex.mul(bound, effort)
    yield s.multiplier, effort
    yield s.upper or "", ex.sub(bound, effort)
    yield s.lower or "", ex.add(bound, effort)


def _relation(s: Switch) -> Switch:
    assert s.sense is not None
    return replace(s, kind="relation", label=_set(s.sense.data), holds=ex.param(_holds(s.sense.data), *s.sense.args))
