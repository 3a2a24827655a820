"""What a component takes in through a port: the sum of what its branches and statements ask of the port's node.

Received: the elaborated parts of a model, the inside of an instance, an end; handed on: the effort that a common-flow
node exerts on the component there, or the flow that goes into it from a common-effort node.  Of an array of instances
both are those of the element that the variables of its loops name.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

from sysdyn.dsl.elaborate.parts import NetworkBuilder
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Constraint, EnergyTerm, Loop, VirtualWork
from sysdyn.dsl.model.rewriting import sum_over_loops
from sysdyn.dsl.names.reactions import reaction
from sysdyn.dsl.names.symbols import End, Space
from sysdyn.dsl.text.diagnostics import Place


class NotSaidError(Exception):
    """A statement at `place` acts on the port in a way that has no closed form here."""

    def __init__(self, what: str, place: Place) -> None:
        super().__init__(what)
        self.place = place


def conjugate_of(parts: NetworkBuilder, space: Space, end: End, *, rates: bool = True) -> Node:
    """The effort (common flow) or flow (common effort) with which an instance takes in power at an end; zero of ground.

    rates: accelerations may stand in it.
    NotSaidError where a statement inside acts on it by an energy of momenta, an impact, or on its effort.
    """
    if end.node is None:
        return ex.const(0.0)
    name, held = end.node.family.name, "e" if end.domain.common == "flow" else "f"
    around = len(space.loops)
    terms = []
    # branches inside that end at the port: what they carry, in at their plus and out at their minus end
    for branch in parts.branches:
        if not _inside(branch.name, branch.loops, space):
            continue
        for terminal, sign in ((branch.plus, 1.0), (branch.minus, -1.0)):
            if terminal is not None and terminal.node == name:
                own = ex.scale(sign, ex.var(branch.name, f"b{held}", *branch.at))
                terms.append(sum_over_loops(_where(terminal.at, end.at, own), branch.loops[around:]))
    said = [s for owner, all_ in parts.owned.items() for s in all_ if _inside(owner, s.loops, space)]
    along = [b for b in parts.branches if b.on is not None and _inside(b.name, b.loops, space)]
    # an array of ports: no statement inside may read it, for which element it reads is not told apart
    if end.node.family.shape and space.scope.symbols.get(end.node.name) is end.node:  # a port that is an array
        for s in said:
            if any(name == n.data[0] for root in _roots(s) for n in ex.variables(root) if n.op == "var"):
                raise NotSaidError("acts on this array of ports", s.place)
        for b in along:
            if any(name == n.data[0] for n in ex.variables(b.on or ex.const(0.0)) if n.op == "var"):
                raise NotSaidError("acts on this array of ports", b.place)
        return ex.add(*terms)
    # an electrical node: branches alone carry its flow
    if end.domain.common == "effort":
        effort = ex.var(name, "ne", *end.at)
        for s in said:
            if any(effort in ex.variables(root) for root in _roots(s)):
                raise NotSaidError("acts on its effort", s.place)
        return ex.add(*terms)
    # a common-flow node: energies, works and constraints inside act on it too
    coordinate = end.node.coordinate
    if coordinate is not None and coordinate.complementary:
        raise NotSaidError("acts on a momentum coordinate", end.node.place)
    q, f, p = (ex.var(name, letter if coordinate else f"n{letter}", *end.at) for letter in "qfp")
    terms += [
        sum_over_loops(ex.mul(ex.var(b.name, "be", *b.at), derivative(b.on, q)), b.loops[around:])
        for b in along
        if b.on
    ]
    # constraints of switches may give impulses, which no effort at an instant tells
    jumps = {draft.label: draft.place for draft in parts.drafts if draft.kind in ("phi", "psi", "guarded")}
    for s in said:
        if any({q, f, p} & ex.variables(root) for root in _roots(s)):
            terms.append(sum_over_loops(_effort_of_statement(s, q, f, jumps, rates=rates), s.loops[around:]))
    return ex.add(*terms)


def _where(own: Sequence[Node], at: Sequence[Node], node: Node) -> Node:
    """The node where an element of a family, of loops inside, is the one asked for; else zero."""
    for mine, asked in zip(own, at, strict=True):
        if mine is asked:
            continue
        if mine.op == asked.op == "const":
            return ex.const(0.0)
        node = ex.conditional(ex.compare("==", mine, asked), node, ex.const(0.0))
    return node


def _inside(name: str, loops: Sequence[Loop], space: Space) -> bool:
    """Whether what has this name and stands in these loops is of the instance: a label may be declared in several."""
    path = space.path
    own = name == path or name.startswith((f"{path}.", f"{path}#"))
    return own and tuple(loops[: len(space.loops)]) == space.loops


def _roots(s: EnergyTerm | VirtualWork | Constraint) -> Sequence[Node]:
    return (s.on, s.effort) if isinstance(s, VirtualWork) else (s.expression,)


def _effort_of_statement(
    s: EnergyTerm | VirtualWork | Constraint, q: Node, f: Node, jumps: dict[str, Place], *, rates: bool
) -> Node:
    """The effort that a statement asks of the node: it is taken from where it acts."""
    # delta W = F delta x delivers F
    if isinstance(s, VirtualWork):
        return ex.neg(ex.mul(s.effort, derivative(s.on, q)))
    # a reaction: multiplier times the gradient; a gamma does no work
    if isinstance(s, Constraint):
        if s.name in jumps:
            raise NotSaidError("may give it impulses", s.place)
        if s.kind == "gamma":
            return ex.const(0.0)
        multiplier = ex.var(s.name, "kappa" if s.kind == "phi" else "mu", *s.at)
        return ex.neg(reaction(s.expression, s.kind == "phi", q, multiplier))
    if s.function.startswith("kept"):  # for the audit alone
        return ex.const(0.0)
    # a spring: dV/dq
    if s.function == "V" and f not in ex.variables(s.expression):
        return derivative(s.expression, q)
    # a damper: dD/df
    if s.function == "D":
        return derivative(s.expression, f)
    if s.function == "T*" and rates:  # Lagrange's equation: what gives its momentum a rate
        with contextlib.suppress(ValueError):
            return ex.sub(time_derivative(derivative(s.expression, f)), derivative(s.expression, q))
    raise NotSaidError(f"acts on it by energy {s.function}", s.place)
