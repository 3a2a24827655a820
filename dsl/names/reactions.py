"""What members stand for that no unknown is: ledgers of pseudo domains, efforts of constraints along displacements."""

from __future__ import annotations

from collections.abc import Iterable

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Domain
from sysdyn.dsl.model.rewriting import sum_over_loops


def ledger(domain: Domain, branches: Iterable[Branch]) -> tuple[Node, Node]:
    """Content of the stores that a domain's ground holds, and what all other branches bring in from there.

    At every node the flows (efforts, where nodes have a common flow) add up to zero, so those at ground do: the rate of
    the first is the second.
    """
    content, through, kind = ("bq", "bf", "potential") if domain.common == "effort" else ("bp", "be", "kinetic")
    held: list[Node] = []
    supplied: list[Node] = []
    for b in branches:
        if b.domain.name != domain.name or b.plus is None or b.minus is None:
            continue
        sign = (b.minus.node is None) - (b.plus.node is None)  # +1: from a node to ground
        if not sign:
            continue
        stores = b.kind == kind
        node = ex.scale(float(sign if stores else -sign), ex.var(b.name, content if stores else through, *b.at))
        (held if stores else supplied).append(sum_over_loops(node, b.loops))
    return ex.add(*held), ex.add(*supplied)


_RATES = {"q": "f", "nq": "nf", "bq": "bf"}


def reaction(residual: Node, holonomic: bool, target: Node, multiplier: Node) -> Node:
    """Constraint effort along a displacement: -(d residual/dq) multiplier, projected on grad(target)."""
    top: list[Node] = []
    bottom: list[Node] = []
    for node in sorted((n for n in ex.variables(target) if n.op == "var"), key=lambda n: n.number):
        slope = derivative(target, node)
        held = node if holonomic else ex.var(node.data[0], _RATES.get(node.data[1], "f"), *node.args)
        top.append(ex.mul(derivative(residual, held), slope))
        bottom.append(ex.mul(slope, slope))
    return ex.neg(ex.div(ex.mul(multiplier, ex.add(*top)), ex.add(*bottom)))
