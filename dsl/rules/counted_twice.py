"""E311: a law already stands for its integral; an energy over the same branch would be the store a second time.

A coupling, which vanishes where the other unknowns are zero (M f1 f2 beside two inductors), is none.
"""

from __future__ import annotations

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.model.paynter import STATE_FUNCTIONS
from sysdyn.dsl.rules.letters import letter, samples, unknowns_of
from sysdyn.dsl.text.diagnostics import Related, Report


def counted_twice(network: Network, report: Report) -> None:
    """Branches with a law whose own energy or content is written as well."""
    laws = {b.name: b for b in network.branches if b.law is not None}
    for energy in network.energies:
        function = STATE_FUNCTIONS[energy.function]
        for node in unknowns_of(energy.expression):
            branch = laws.get(node.data[0]) if node.data[1][0] == "b" else None
            if branch is None or branch.kind != function.edge or letter(node) != function.own:
                continue
            if _changes_alone(energy.expression, node):
                name = branch.name.partition("#")[0]
                word = "content" if function.edge == "dissipator" else "energy"
                message = f"energy of '{name}' is counted twice: a law and '{word} {function.name}' on the same branch"
                related = (Related("its law", branch.place),)
                report.error("E311", message, energy.place, related=related, help="keep one of the two")
                break


def _changes_alone(expression: Node, own: Node) -> bool:
    """Whether the expression changes with `own` while all other unknowns are zero."""
    others = {n: ex.const(0.0) for n in unknowns_of(expression) if n is not own and letter(n) != "s"}
    slope = derivative(ex.substitute(expression, others), own)
    return any(abs(value) > 0.0 for value in samples(slope))
