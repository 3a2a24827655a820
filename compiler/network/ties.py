"""Constraints of flows whose coefficients read no displacement, complementary: transformers into one junction.

    0 = sum c_j f_j + b     is     g_j = c_j f_j,  e_j = -c_j h,  sum g_j + b = 0,  mu = -h

The f_j are flows of points of common flow, or of branches; each gets a transformer, which a branch has in its place
where it has no law and nothing else names it, else beside it between points, or in series at a node of common effort.
Their other sides, all of effort h, make a ring between points of common flow, or a star at a node of common effort.
What b gives is a flow source in it.  A displacement constraint is that of its rate, and what the start fulfils.  Other
constraints stay as written.

Received: a network.  Returned: the network with these constraints as branches, nodes and couplings.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import (
    Branch,
    Constraint,
    Coupling,
    Domain,
    InitialCondition,
    Network,
    NodeFamily,
    Terminal,
    loop_indices,
    loop_ranges,
)
from sysdyn.dsl.model.rewriting import EXPRESSIONS, TRACED, expressions, rewritten

Side = tuple[Node, Node]
"""A flow that a constraint reads, and its factor there."""


def as_transformers(network: Network) -> Network:
    """The network with such constraints as transformers."""
    labels = Counter(c.name for c in network.constraints)
    switched = {s.label for s in network.switches}
    roots = expressions(network, *(sort for sort in EXPRESSIONS if sort not in TRACED))
    named = Counter(n.data[0] for root in roots for n in _read(root) if n.data[1].startswith("b"))
    bare = frozenset(b.name for b in network.branches if b.kind == "field" and named[b.name] == 1)
    for c in network.constraints:
        if c.kind == "gamma" or c.adds or labels[c.name] > 1 or c.name in switched or c.at != loop_indices(c.loops):
            continue
        rate = c if c.kind == "psi" else replace(c, expression=time_derivative(c.expression))
        sides = _sides(network, rate)
        if sides is not None:
            network = _with_junction(network, c, *sides, bare)
    return network


def _read(root: Node) -> Iterator[Node]:
    return (n for n in ex.variables(root) if n.op == "var")


def _sides(network: Network, c: Constraint) -> tuple[list[Side], Node] | None:
    """The flows of a constraint with their factors, and what stands beside them; None of any other constraint."""
    flows = sorted((n for n in _read(c.expression) if n.data[1] != "s"), key=lambda n: n.number)
    nodes = {n.name for n in network.nodes if n.domain.common == "flow"}
    for n in flows:
        point = n.data[1:] == ("nf", 0) and n.data[0] in nodes
        made = [
            b for b in network.branches if n.data == (b.name, "bf", 0) and b.plus is not None and b.minus is not None
        ]
        if not point and [(b.at, b.loops) for b in made] != [(n.args, c.loops)]:
            return None
    sides = [(n, derivative(c.expression, n)) for n in flows]
    if not flows or any(n in ex.variables(factor) for _, factor in sides for n in flows):
        return None
    return sides, ex.substitute(c.expression, {n: ex.const(0.0) for n in flows})


def _with_junction(
    network: Network, c: Constraint, sides: Sequence[Side], beside: Node, bare: frozenset[str]
) -> Network:
    """The constraint as transformers into a junction, a flow source in it where something stands beside."""
    domains = {n.name: n.domain for n in network.nodes} | {b.name: b.domain for b in network.branches}
    known = [domains[n.data[0]] for n, _ in sides]
    # the junction has the domain whose flow the constraint relates
    domain = next((d for d in known if d.flow.dimension == c.unit.dimension), known[0])
    others: list[tuple[str, Node | None]] = [(f"{c.name}#{2 * k}", None) for k in range(1, len(sides) + 1)]
    others += [] if ex.is_const(beside, 0.0) else [(f"{c.name}#0", beside)]
    ends, nodes = _junction(c, domain, len(others))
    made = [_branch(c, name, domain, *two, flow) for (name, flow), two in zip(others, ends, strict=True)]
    couplings, branches = [], {b.name: b for b in network.branches if any(n.data[0] == b.name for n, _ in sides)}
    # a transformer for each flow of the constraint
    for k, (n, factor) in enumerate(sides):
        name, own = f"{c.name}#{2 * k + 1}", branches.get(n.data[0])
        # a node: a branch to ground beside it
        if own is None:
            made.append(_branch(c, name, known[k], Terminal(n.data[0], n.args), Terminal(None, ())))
        # a branch without law is the port itself
        elif own.name in bare:
            name, branches[own.name] = own.name, replace(own, kind="port")
        # in series with the branch at an effort node, beside it at a flow node
        else:
            plus = own.plus
            if own.domain.common == "effort":
                nodes.append(NodeFamily(f"{name}#", loop_ranges(c.loops), own.domain, c.place))
                plus = Terminal(f"{name}#", loop_indices(c.loops))
                branches[own.name] = replace(own, minus=plus)
            made.append(_branch(c, name, own.domain, plus, own.minus))
        at = loop_indices(c.loops)
        couplings.append(Coupling("transformer", name, others[k][0], at, c.loops, "e", ex.neg(factor), c.place))

    def multipliers_as_efforts(root: Node) -> Node:
        named = (n for n in ex.topological([root]) if n.op == "var" and n.data[0] == c.name)
        read = [n for n in named if n.data[1] in ("kappa", "mu")]
        return ex.substitute(root, {n: ex.neg(ex.var(others[0][0], "be", *n.args)) for n in read}) if read else root

    # a displacement constraint holds at the start too
    begun = (InitialCondition(c.expression, ex.const(0.0), True, c.loops, c.place),) if c.kind == "phi" else ()
    kept = tuple(branches.get(b.name, b) for b in network.branches)
    network = rewritten(replace(network, branches=kept), multipliers_as_efforts)
    return replace(
        network,
        initials=(*network.initials, *begun),
        constraints=tuple(other for other in network.constraints if other.name != c.name),
        nodes=(*network.nodes, *nodes),
        branches=(*network.branches, *made),
        couplings=(*network.couplings, *couplings),
    )


def _junction(c: Constraint, domain: Domain, number: int) -> tuple[list[tuple[Terminal, Terminal]], list[NodeFamily]]:
    """The ends of so many branches whose flows add up to zero, and the nodes between them."""
    ground, ring = Terminal(None, ()), domain.common == "flow"
    nodes = [
        NodeFamily(f"{c.name}##{k}", loop_ranges(c.loops), domain, c.place) for k in range(1, number if ring else 2)
    ]
    inner = [Terminal(n.name, loop_indices(c.loops)) for n in nodes]
    if not ring:
        return [(inner[0], ground)] * number, nodes
    points = [ground, *inner, ground]
    return list(zip(points[1:], points, strict=False)), nodes


def _branch(
    c: Constraint, name: str, domain: Domain, plus: Terminal | None, minus: Terminal | None, flow: Node | None = None
) -> Branch:
    kind, side = ("port", None) if flow is None else ("flow", "f")
    return Branch(name, loop_indices(c.loops), c.loops, domain, kind, side, flow, plus, minus, None, c.place)
