"""W909: numbers of a run that a claim compares exactly.

An integration gives each number within an accuracy: `==` without `within` asks for the last bit (a `=` in its place has
been told).  What changes at events alone (discrete variables), counts, signs and conditions may be compared exactly.
"""

from __future__ import annotations

from collections.abc import Set

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.text.diagnostics import Report

_STEPS = ("sign", "floor", "ceil", "step")


def exact_claims(model: Elaborator, report: Report) -> None:
    """A warning at each claim that asks a number that varies continuously to equal another to the last bit."""
    moving = {d.state.data[0] for d in model.parts.dynamics if not ex.is_const(d.expression, 0.0)}
    still = {s.name for s in model.parts.states} - moving  # counters: events alone change them
    for e in model.parts.expectations:
        if e.moment == "static" or e.operator != "==" or e.within is not None:
            continue
        if "==" in e.text and _varies(ex.sub(e.left, e.right), still):
            message = f"{e.text}: a number of the run is compared to the last bit"
            unit = "" if e.unit.text == "1" else f" {e.unit.text}"
            report.warning("W909", message, e.place, help=f"{e.text} within 1e-6{unit}, or what accuracy it is worth")


def _varies(root: Node, still: Set[str]) -> bool:
    """Whether the value may vary other than by steps; still: states that rest between events."""
    varies: dict[Node, bool] = {}
    for node in ex.topological([root]):
        if node.op == "var":
            varies[node] = node.data[0] not in still
        elif node.op in ("cmp", "and", "or", "not") or (node.op == "call" and node.data in _STEPS):
            varies[node] = False
        else:  # a conditional varies as its values do, not its condition
            values = node.args[1:] if node.op == "cond" else node.args
            varies[node] = any(varies[arg] for arg in values)
    return varies[root]
