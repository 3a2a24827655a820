"""Expressions of one instance under the name of another: what instances that are alike say."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import last_of
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.values import Values
from sysdyn.values import dataclass

_SAID = frozenset(("const", "time", "sum", "mul", "pow", "cmp", "and", "or", "not", "cond"))
"""Operations that mean the same under any name; functions too, but for those that make events."""


@dataclass(frozen=True, slots=True)
class Cast:
    """An expression in the names of its instance; steps: operation, its own name, arguments, as met first; named: the
    parameters of the first instance; nodes: of the steps.
    """

    steps: tuple[tuple[str, str, tuple[int, ...], Node], ...]
    named: Mapping[Node, str]
    nodes: tuple[Node, ...]

    def under(self, path: str) -> Node:
        """Rebuild the expression of the mould in the names of an instance at `path`."""
        made: list[Node] = []
        for op, name, at, node in self.steps:
            if op == "param":
                made.append(ex.param(path + name))
            elif op == "var":
                made.append(ex.var(path, name))
            else:
                made.append(ex.rebuild(node, tuple([made[k] for k in at])) if at else node)
        return made[-1]

    def truth(self, path: str, known: Values) -> bool:
        """Whether it is true of another instance, whose own node is not made for that."""
        named = self.named
        return bool(last_of(self.nodes, lambda n: known.element(path + named[n]) if n in named else math.nan))


def cast_of(root: Node, path: str) -> Cast | None:
    """An expression of parameters and branch variables of one instance; None where it reads anything else."""
    steps: list[tuple[str, str, tuple[int, ...], Node]] = []
    place: dict[Node, int] = {}
    for node in ex.topological([root]):
        name = ""
        if node.op == "param" and not node.args and node.data.startswith(f"{path}."):
            name = node.data[len(path) :]
        elif node.op == "var" and not node.args and node.data[0] == path and not node.data[2]:
            name = node.data[1]
        elif node.op not in _SAID and (node.op != "call" or node.data in ("setsign", "signal")):
            return None
        place[node] = len(steps)
        steps.append((node.op, name, tuple(place[a] for a in node.args), node))
    named = {node: name for op, name, _, node in steps if op == "param"}
    return Cast(tuple(steps), named, tuple(node for *_, node in steps))
