"""Parts of a network that nothing joins to the ground: one node of each is held at effort zero.

The complementary family reads efforts as rates of node coordinates, and those of such a part are determined in
differences only.  The node is the one that the primal family counts efforts from (rule P3), so both read the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from sysdyn.compiler.network.primal.balances import ZERO, NodeEffort, balances
from sysdyn.compiler.network.primal.bounds import WholeNumbers, parts
from sysdyn.compiler.network.primal.incidence import Incidence, ground, indices, loops_over
from sysdyn.compiler.network.primal.series import series
from sysdyn.dsl.model.expression import var
from sysdyn.dsl.model.network import Constraint, Network
from sysdyn.dsl.text.diagnostics import ModelError


def add_references(network: Network) -> Network:
    """The network with a flow constraint `node.reference` of its reflection for each such part."""
    if all(n.domain.common == "flow" for n in network.nodes):
        return network
    try:
        incidence = Incidence(network, WholeNumbers(network))
        found = balances(incidence, series(incidence, network.read).merged).efforts
    except ModelError:  # a pattern of the primal family alone: it says so there
        return network
    free = [e for e in found if e.how == ZERO and e.ground is None and e.node != ground(e.cell.domain)]
    return replace(network, constraints=(*network.constraints, *_constraints(free)))


def _constraints(free: list[NodeEffort]) -> Iterator[Constraint]:
    labels = parts([(f"{e.node}.reference", e.box) for e in free])
    for effort, label in zip(free, labels, strict=True):
        at, box = indices(effort.box), effort.box
        domain, place = effort.cell.domain, effort.cell.place
        yield Constraint("psi", label.name, at, var(effort.node, "ne", *at), loops_over(box), domain.effort, place)
