"""Ideal diodes and switches in the complementary family, which has no rows in flows.

A branch without a law carries no effort but the reaction of its constraint: of `f >= 0` (f = 0 while g) either the flow
or the effort is zero.  The same is said of the effort: `-e >= 0` (e = 0 while not g), whose reaction is the flow.  What
holds of the one is free of the other (`Switch.dual`).  Of both on one branch (a thyristor: f = 0 while g, f >= 0
while h) the effort is free while g holds, else -e >= 0 while h does, and zero where neither holds; `f >= 0` beside
`f <= 0 while g` is f = 0 while g, f >= 0 while not g.  An inequality that alone holds at times leaves a wire in
between, for which there is no row.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Constraint, Network, Observation, Switch
from sysdyn.dsl.model.rewriting import expressions, rewritten


def complements(network: Network) -> Network:
    """The network with what holds at times of the flow of a branch said of its effort."""
    alone = _single_flow_constraints(network)
    network = _by_turns(network, alone)
    found = {row.name: (row, effort) for row, effort in _of_effort(network, alone)}
    if not found:
        return network

    def reactions_as_efforts(root: Node) -> Node:
        """Reactions as the effort that they are a part of."""
        read = [n for n in ex.topological([root]) if n.op == "var" and n.data[0] in found and n.data[1] == "mu"]
        return ex.substitute(root, {n: _element_of(found[n.data[0]], n.args)[1] for n in read}) if read else root

    guards = {o.name: o.expression for o in network.observations}
    # switches whose flow constraint becomes a condition on the effort
    dual = [s for s in network.switches if s.label in found]
    watched = dict(pair for s in dual for pair in _watched_efforts(s, found[s.label]))
    watched |= dict(_guard_efforts(dual, found, guards))
    network = rewritten(network, reactions_as_efforts)
    return replace(
        network,
        constraints=tuple(found[c.name][0] if c.name in found else c for c in network.constraints),
        observations=tuple(replace(o, expression=watched.get(o.name, o.expression)) for o in network.observations),
        switches=tuple(replace(s, dual=True) if s in dual else s for s in network.switches),
    )


Alone = dict[Node, list[tuple[Constraint, Node]]]
"""Flows of branches without a law, each with the constraints in it alone, and its factor there."""


def _by_turns(network: Network, alone: Alone) -> Network:
    """An inequality of a flow beside its opposite under a guard as rows of which one holds at a time."""
    pairs = (rows for rows in alone.values() if len(rows) == 2 and rows[0][1].data * rows[1][1].data < 0.0)
    against = {a[0].name: b[0].name for rows in pairs for a, b in (rows, rows[::-1])}
    guards, known = {o.name: o for o in network.observations}, {(s.label, s.at): s for s in network.switches}
    changed: dict[Switch, Switch] = {}
    beside: list[Observation] = []
    for s in network.switches:
        opposite = known.get((against.get(s.label, ""), s.at))
        if opposite is None or (s.kind, opposite.kind) != ("psi", "psi"):
            continue
        if s.guard is None and opposite.guard is not None:
            guard = guards[opposite.guard]
            lets = ex.sub(ex.const(1.0), guard.expression)
            beside.append(replace(guard, name=f"{guard.name}.not", expression=lets))
            changed |= {s: replace(s, guard=f"{guard.name}.not"), opposite: replace(opposite, kind="guarded")}
    switches = tuple(changed.get(s, s) for s in network.switches)
    return replace(network, switches=switches, observations=(*network.observations, *beside)) if changed else network


def _single_flow_constraints(network: Network) -> Alone:
    """Constraints c*f = 0 of the flow of a branch without law or store, by that flow, with c."""
    free = {b.name for b in network.branches if b.law is None and b.kind == "field"}
    said = ex.topological(expressions(network, "energies", "works"))
    stored = {n.data[0] for n in said if n.op == "var" and n.data[1] in ("bf", "bq", "be", "bp")}
    alone: Alone = {}
    for c in network.constraints:
        flows = [n for n in ex.variables(c.expression) if n.op == "var" and n.data[1:] == ("bf", 0)]
        if c.kind == "psi" and len(flows) == 1 and flows[0].data[0] in free - stored:
            factor = derivative(c.expression, flows[0])
            if ex.is_const(factor) and c.expression is ex.mul(factor, flows[0]):
                alone.setdefault(flows[0], []).append((c, factor))
    return alone


def _of_effort(network: Network, alone: Alone) -> Iterator[tuple[Constraint, Node]]:
    """Constraints of an effort for those of a flow of a branch that nothing else holds, and the reactions of these."""
    read = (n for c in network.constraints for n in ex.variables(c.expression) if n.op == "var")
    held = Counter(n.data[0] for n in read if n.data[1] == "bf")
    for flow, rows in alone.items():
        if held[flow.data[0]] == len(rows) and _complete(network, [c for c, _ in rows]):
            effort = ex.var(flow.data[0], "be", *flow.args)
            for c, factor in rows:
                sign = ex.const(-1.0 if factor.data > 0.0 else 1.0)
                yield replace(c, expression=ex.mul(sign, effort)), ex.div(effort, factor)


def _complete(network: Network, rows: list[Constraint]) -> bool:
    """Whether the rows of a branch say all of it: f = 0 while g, f >= 0, or f = 0 while g beside f >= 0 while h."""
    switches = [s for s in network.switches if s.label in {c.name for c in rows}]
    kinds = {s.label: (s.kind, s.guard is not None) for s in switches}
    said = sorted(kinds[c.name] for c in rows if c.name in kinds)
    if len(rows) == 1:
        return said in ([("guarded", True)], [("psi", False)])
    own = {s.multiplier for s in switches}  # its effort is the reaction of either in turn: nothing else may ask which
    nodes = [o.expression for o in network.observations if o.name not in own]
    nodes += expressions(network, "constraints", "energies", "works", "dynamics", "branches.law")
    asked = any(n.op == "var" and n.data[1] == "mu" and n.data[0] in kinds for n in ex.topological(nodes))
    return said == [("guarded", True), ("psi", True)] and rows[0].loops == rows[1].loops and not asked


def _element_of(what: tuple[Constraint, Node], at: tuple[Node, ...]) -> tuple[Node, Node]:
    """The expression of a row, and the reaction, of one element of an array."""
    row, reaction = what
    change = dict(zip(row.at, at, strict=True))
    expression, effort = (ex.substitute(n, change) for n in (row.expression, reaction))
    return expression, effort


def _watched_efforts(s: Switch, what: tuple[Constraint, Node]) -> Iterator[tuple[str, Node]]:
    """What events read of the effort: of an inequality what is not negative while it is free."""
    at = tuple(ex.const(float(k)) for k in s.at)
    row, _ = _element_of(what, at)
    value = row if s.kind == "guarded" else ex.neg(row)
    yield s.value, value
    yield s.rate, time_derivative(value)
    yield s.multiplier, ex.var(s.label, "mu", *at)


def _guard_efforts(
    dual: list[Switch], found: Mapping[str, tuple[Constraint, Node]], guards: Mapping[str, Node]
) -> Iterator[tuple[str, Node]]:
    """When rows of efforts hold: while the flow is not held, and no inequality of it is there beside an equation."""
    branches: dict[Node, list[Switch]] = {}
    # switches of one branch together
    for s in dual:
        if s.guard is not None:
            at = tuple(ex.const(float(k)) for k in s.at)
            (effort,) = (n for n in ex.variables(_element_of(found[s.label], at)[1]) if n.op == "var")
            branches.setdefault(effort, []).append(s)
    # the effort is zero while the flow is free; an inequality takes its place while it holds
    for same in branches.values():
        held = next(s for s in same if s.kind == "guarded")
        open_ = ex.sub(ex.const(1.0), guards[held.guard or ""])
        yield held.guard or "", open_
        for s in same:
            if s.kind == "psi":
                there = guards[s.guard or ""]
                yield s.guard or "", ex.mul(open_, there)
                yield held.guard or "", ex.mul(open_, ex.sub(ex.const(1.0), there))
