"""Dry friction of branches as relations: the complementary family has no row for flows that are zero, and gammas read
any effort and flow.

Its sense becomes an unknown s, closed by u = 0 while the branch sticks, else by the sense; its effort is c*s.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Constraint, Network, Switch, Unknown, loop_indices
from sysdyn.dsl.model.rewriting import rewritten
from sysdyn.dsl.model.units import NONE, si


def as_relations(network: Network) -> Network:
    """The network without reactions of branches that stick; one without such branches is handed on as it is."""
    frictions = [s for s in network.switches if s.kind == "friction" and s.element and s.sense is not None]
    if not frictions:
        return network
    labels = {s.sense.data: s.label for s in frictions if s.sense is not None}
    own = [p for p in network.parameters if p.name in labels]

    def freed(root: Node) -> Node:
        found = [n for n in ex.topological([root]) if n.op == "param" and n.data in labels]
        return ex.substitute(root, {n: ex.var(_set(n.data), "e", *n.args) for n in found}) if found else root

    found = rewritten(network, freed)
    said = {o.name: o.expression for o in found.observations}
    given = dict(pair for s in frictions for pair in _watched(s, said))
    senses = {label: iter([name for name, other in labels.items() if other == label]) for label in labels.values()}
    return replace(
        found,
        parameters=(*found.parameters, *(replace(p, name=_holds(p.name)) for p in own)),
        discretes=found.discretes | {_holds(p.name) for p in own},
        unknowns=(*found.unknowns, *(Unknown(_set(p.name), p.shape, si(NONE), p.place) for p in own)),
        constraints=tuple(_row(c, next(senses[c.name])) if c.name in senses else c for c in found.constraints),
        observations=tuple(replace(o, expression=given.get(o.name, o.expression)) for o in found.observations),
        switches=tuple(_relation(s) if s.sense is not None and s.sense.data in labels else s for s in network.switches),
    )


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
