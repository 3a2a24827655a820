"""What rules P1 to P3 made of the nodes and branches of a network, for `compile --explain`."""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.compiler.network.primal.balances import MULTIPLIER, ZERO, Balances
from sysdyn.compiler.network.primal.bounds import Box
from sysdyn.compiler.network.primal.series import Series, SeriesMember
from sysdyn.dsl.model.network import Network
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Step:
    """By `rule`, `what` became `became`."""

    rule: str
    what: str
    became: str


def account(network: Network, classes: Series, nodes: Balances) -> tuple[Step, ...]:
    """Every node and every branch of a common-effort domain once."""
    return (*_displacements(network), *_classes(classes), *_rows(nodes))


def _displacements(network: Network) -> Iterator[Step]:
    for node in network.nodes:
        if node.domain.common == "flow":
            yield Step("P1", f"node {node.name}", f"coordinate {node.name}")


def _classes(classes: Series) -> Iterator[Step]:
    members: dict[str, list[SeriesMember]] = {}
    for m in classes.members:
        members.setdefault(m.coordinate, []).append(m)
    for coordinate in classes.coordinates:
        own = members.get(coordinate.name, ())
        names = [("-" if m.sign < 0 else "") + _box_text(m.element.name, m.box) for m in own]
        yield Step("P2", f"branches {', '.join(names)}", f"coordinate {coordinate.name}: one flow")


def _rows(nodes: Balances) -> Iterator[Step]:
    for effort in nodes.efforts:
        node = f"node {_box_text(effort.node.removeprefix('#').strip(), effort.box)}"
        if effort.how == MULTIPLIER:
            yield Step("P3", node, f"psi {effort.label}: the sum of its flows is zero; its effort is the multiplier")
        elif effort.how == ZERO:
            yield Step("P3", node, "reference of its component: no row")
        else:
            yield Step("P2", node, "merged: two branches, one flow")


def _box_text(name: str, box: Box) -> str:
    """`v[1..n]`, `v[0]`."""
    ranges = [f"{i.first.node}" if i.first.value == i.last.value else f"{i.first.node}..{i.last.node}" for i in box]
    return f"{name}[{', '.join(ranges)}]" if ranges else name
