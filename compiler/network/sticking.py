"""Dry friction as relations: the complementary family has no row for flows that are zero, and gammas read any effort
and flow.

Its sense becomes an unknown s, closed by u = 0 while it sticks, else by the sense; its effort is c*s.  That of a
content over nodes becomes a branch between them first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from sysdyn.compiler.network.stated import element
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Constraint, Energy, Network, Switch, Unknown, loop_indices
from sysdyn.dsl.model.rewriting import rewritten
from sysdyn.dsl.model.units import NONE, si


def as_relations(network: Network) -> Network:
    """The network without reactions of what sticks; one without such is handed on as it is."""
    labels = {s.label for s in network.switches if s.kind == "friction" and not s.element}
    for row in [c for c in network.constraints if c.name in labels]:
        network = _between_nodes(network, row)
    frictions = [s for s in network.switches if s.kind == "friction" and s.sense is not None]
    if not frictions:
        return network
    owners = {s.sense.data: s.label for s in frictions if s.sense is not None}
    own = [p for p in network.parameters if p.name in owners]

    def freed(root: Node) -> Node:
        found = [n for n in ex.topological([root]) if n.op == "param" and n.data in owners]
        return ex.substitute(root, {n: ex.var(_set(n.data), "e", *n.args) for n in found}) if found else root

    found = rewritten(network, freed)
    said = {o.name: o.expression for o in found.observations}
    given = dict(pair for s in frictions for pair in _watched(s, said))
    senses = {label: iter([name for name, other in owners.items() if other == label]) for label in owners.values()}
    return replace(
        found,
        parameters=(*found.parameters, *(replace(p, name=_holds(p.name)) for p in own)),
        discretes=found.discretes | {_holds(p.name) for p in own},
        unknowns=(*found.unknowns, *(Unknown(_set(p.name), p.shape, si(NONE), p.place) for p in own)),
        constraints=tuple(_row(c, next(senses[c.name])) if c.name in senses else c for c in found.constraints),
        observations=tuple(replace(o, expression=given.get(o.name, o.expression)) for o in found.observations),
        switches=tuple(_relation(s) if s.sense is not None and s.sense.data in owners else s for s in network.switches),
    )


def _between_nodes(network: Network, row: Constraint) -> Network:
    """The network with the dry friction of a content over nodes as a branch between them; row: its psi u = 0."""
    mine = [s for s in network.switches if s.label == row.name]
    flows = sorted((n for n in ex.variables(row.expression) if n.op == "var"), key=lambda n: n.number)
    if not flows or flows[0].data[1:] != ("nf", 0):
        return network
    senses = {s.sense.data for s in mine if s.sense is not None}
    sign, nodes = derivative(row.expression, flows[0]), {n.name: n.domain for n in network.nodes}
    for k, energy in enumerate(network.energies):
        rest = _without(energy, senses)
        if energy.function != "D" or rest is energy.expression:
            continue
        part = replace(energy, expression=ex.sub(energy.expression, rest))
        branch = element(part, part.expression, f"{row.name} of nodes", nodes)
        if branch is None:
            return network

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


def _without(energy: Energy, senses: set[str]) -> Node:
    """A content without its friction: the terms with one of these senses."""
    found = [n for n in ex.topological([energy.expression]) if n.op == "param" and n.data in senses]
    return ex.substitute(energy.expression, dict.fromkeys(found, ex.const(0.0))) if found else energy.expression


def _set(sense: str) -> str:
    """The unknown in the place of a sense."""
    return f"{sense} set"


def _holds(sense: str) -> str:
    return f"{sense} holds"


def _row(c: Constraint, sense: str) -> Constraint:
    """The psi u = 0 of a statement as the gamma that closes its unknown."""
    at = loop_indices(c.loops)
    slips = ex.sub(ex.var(_set(sense), "e", *at), ex.param(sense, *at))
    sticks = ex.compare("!=", ex.param(_holds(sense), *at), ex.const(0.0))
    return replace(c, kind="gamma", name=_set(sense), at=at, expression=ex.conditional(sticks, c.expression, slips))


def _watched(s: Switch, said: Mapping[str, Node]) -> Iterator[tuple[str, Node]]:
    """What events read of a friction: its effort c*s, and what that lacks to c on both sides."""
    assert s.sense is not None
    bound = said[s.bound or ""]
    effort = ex.mul(bound, ex.var(_set(s.sense.data), "e", *s.sense.args))
    yield s.multiplier, effort
    yield s.upper or "", ex.sub(bound, effort)
    yield s.lower or "", ex.add(bound, effort)


def _relation(s: Switch) -> Switch:
    assert s.sense is not None
    return replace(s, kind="relation", label=_set(s.sense.data), holds=ex.param(_holds(s.sense.data), *s.sense.args))
