"""What a component takes in through a port: the sum of what its branches and statements ask of the port's node.

Received: the elaborated parts of a model, the path of an instance, an end; handed on: the effort that a common-flow
node exerts on the component there, or the flow that goes into it from a common-effort node.
"""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.elaborate.parts import NetworkBuilder
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Constraint, Energy, Work
from sysdyn.dsl.model.rewriting import summed
from sysdyn.dsl.names.reactions import reaction
from sysdyn.dsl.names.symbols import End
from sysdyn.dsl.text.diagnostics import Place


class NotSaidError(Exception):
    """A statement at `place` acts on the port in a way that has no closed form here."""

    def __init__(self, what: str, place: Place) -> None:
        super().__init__(what)
        self.place = place


def conjugate_of(parts: NetworkBuilder, path: str, end: End) -> Node:
    """The effort (common flow) or flow (common effort) with which an instance takes in power at an end; zero of ground.

    NotSaidError where a statement inside acts on it by an inertia, an impact, or on its effort.
    """
    if end.node is None:
        return ex.const(0.0)
    name, held = end.node.family.name, "e" if end.domain.common == "flow" else "f"
    terms = []
    for branch in parts.branches:
        if not _inside(branch.name, path):
            continue
        for terminal, sign in ((branch.plus, 1.0), (branch.minus, -1.0)):
            if terminal is not None and terminal.node == name and terminal.at == end.at:
                own = ex.var(branch.name, f"b{held}", *branch.at)
                terms.append(summed(ex.scale(sign, own), branch.loops))
    said = [s for owner, statements in parts.owned.items() if _inside(owner, path) for s in statements]
    along = [b for b in parts.branches if b.on is not None and _inside(b.name, path)]
    if end.domain.common == "effort":
        effort = ex.var(name, "ne", *end.at)
        for s in said:
            if any(effort in ex.variables(root) for root in _roots(s)):
                raise NotSaidError("acts on its effort", s.place)
        return ex.add(*terms)
    q, f, p = (ex.var(name, f"n{letter}", *end.at) for letter in "qfp")
    terms += [summed(ex.mul(ex.var(b.name, "be", *b.at), derivative(b.on, q)), b.loops) for b in along if b.on]
    jumps = {draft.label: draft.place for draft in parts.drafts if draft.kind in ("phi", "psi", "guarded")}
    for s in said:
        if any({q, f, p} & ex.variables(root) for root in _roots(s)):
            terms.append(summed(_asked(s, q, f, jumps), s.loops))
    return ex.add(*terms)


def _inside(name: str, path: str) -> bool:
    return name == path or name.startswith((f"{path}.", f"{path}#"))


def _roots(s: Energy | Work | Constraint) -> Sequence[Node]:
    return (s.on, s.effort) if isinstance(s, Work) else (s.expression,)


def _asked(s: Energy | Work | Constraint, q: Node, f: Node, jumps: dict[str, Place]) -> Node:
    """The effort that a statement asks of the node: it is taken from where it acts."""
    if isinstance(s, Work):
        return ex.neg(ex.mul(s.effort, derivative(s.on, q)))
    if isinstance(s, Constraint):
        if s.name in jumps:
            raise NotSaidError("may give it impulses", s.place)
        if s.kind == "gamma":
            return ex.const(0.0)
        multiplier = ex.var(s.name, "kappa" if s.kind == "phi" else "mu", *s.at)
        return ex.neg(reaction(s.expression, s.kind == "phi", q, multiplier))
    if s.function.startswith("kept"):  # for the audit alone
        return ex.const(0.0)
    if s.function == "V" and f not in ex.variables(s.expression):
        return derivative(s.expression, q)
    if s.function == "D":
        return derivative(s.expression, f)
    raise NotSaidError("gives it an inertia", s.place)
