"""Quasi-velocities: w = sum a_i(q, s, t) f_i + b(q, s, t), a name for a combination of flows that may be no one's rate.

The virtual displacement along w is sum a_i delta q_i (Greenwood: Advanced Dynamics, 2003, 4.1); it is integrable only
where w is, so a work along it is one work for each coordinate.
"""

from __future__ import annotations

from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node, topological, var, variables

_DISPLACEMENTS = {"f": "q", "nf": "nq", "bf": "bq", "q": "q", "nq": "nq", "bq": "bq"}
_COEFFICIENTS = ("q", "nq", "bq", "s")


class NotLinearError(Exception):
    """Why an expression is no quasi-velocity."""


def virtual(speed: Node) -> tuple[tuple[Node, Node], ...]:
    """Coefficients with the displacements whose rates they multiply; NotLinearError where that is not what it is."""
    flows = sorted((n for n in variables(speed) if _is_flow(n)), key=lambda n: n.number)
    # quasi(w) of what does not move
    if not flows:
        raise NotLinearError("contains no flow")
    # sum(i in 1..n: f[i]) has no single displacement
    inside = {n for r in topological([speed]) if r.op == "reduce" for n in variables(r.args[2])}
    if inside & set(flows):
        raise NotLinearError("sums flows over a range: write 'for i in ... { work E on quasi(w[i]) }'")
    found = []
    # dw is linear in the flows: each has a coefficient and a displacement
    for flow in flows:
        coefficient = derivative(speed, flow)
        if any(_is_flow(n) for n in variables(coefficient)):
            raise NotLinearError(f"is not linear in the flow {flow}")
        family, kind, _ = flow.data
        found.append((coefficient, var(family, _DISPLACEMENTS[kind], *flow.args)))
    # coefficients read displacements and parameters alone
    for node in sorted(variables(speed), key=lambda n: n.number):
        if node.op == "var" and not _is_flow(node) and (node.data[1] not in _COEFFICIENTS or node.data[2]):
            raise NotLinearError(f"contains {node}, which is neither a flow nor a displacement")
    return tuple(found)


def _is_flow(node: Node) -> bool:
    """x.f, or x' where it is written as the rate of a displacement."""
    if node.op != "var":
        return False
    kind, order = node.data[1:]
    return (kind in ("f", "nf", "bf") and not order) or (kind in ("q", "nq", "bq") and order == 1)
