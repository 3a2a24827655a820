"""Values of expressions: one number a node, where somebody tells those of parameters, unknowns, indices and tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from sysdyn.dsl.model import budget
from sysdyn.dsl.model.expression import Node, index, order_of, topological_unbound, variables
from sysdyn.dsl.model.functions import FUNCTIONS, real_power


def evaluate(roots: Sequence[Node], lookup: Callable[[Node], float]) -> list[float]:
    """Values of scalar nodes; lookup gives those of param, time, index, var and table nodes."""
    values: dict[Node, Any] = {}
    for node in order_of(tuple(roots)):
        values[node] = _value(node, values, lookup)
    return [values[r] for r in roots]


def last_of(nodes: Iterable[Node], lookup: Callable[[Node], float]) -> Any:
    """The value of the last of scalar nodes that stand after those they need."""
    values: dict[Node, Any] = {}
    for node in nodes:
        found = values[node] = lookup(node) if node.op == "param" else _value(node, values, lookup)
    return found


def evaluate_along(root: Node, leaf: Node, points: Iterable[float], lookup: Callable[[Node], float]) -> Iterator[float]:
    """Values of a scalar node where one leaf takes the values of points; what does not read it is evaluated once."""
    values: dict[Node, Any] = {}
    moving: list[Node] = []

    def here(node: Node) -> float:
        return float(values[leaf]) if node is leaf else lookup(node)

    for node in topological_unbound([root]):
        if leaf in variables(node):
            moving.append(node)
        else:
            values[node] = _value(node, values, lookup)
    for x in points:
        for node in moving:
            values[node] = x if node is leaf else _value(node, values, here)
        yield values[root]


_COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}


def _value(node: Node, values: Mapping[Node, Any], lookup: Callable[[Node], float]) -> Any:
    """Value of a node from those of its arguments; leaves by `lookup`. Sums are rounded once (fsum)."""
    args = [values[a] for a in node.args if a in values]
    match node.op:
        case "const":
            return node.data
        case "sum":
            return math.fsum((node.data[0], *(c * a for c, a in zip(node.data[1], args, strict=True))))
        case "mul":
            total = 1.0
            for e, a in zip(node.data, args, strict=True):
                total *= real_power(a, e)
            return total
        case "pow":
            return real_power(args[0], args[1])
        case "call":
            return FUNCTIONS[node.data](*args)
        case "cond":
            return args[1] if args[0] else args[2]
        case "cmp":
            return _COMPARE[node.data](args[0], args[1])
        case "and":
            return all(args)
        case "or":
            return any(args)
        case "not":
            return not args[0]
        # bounds that are no numbers make no sum
        case "reduce":
            finite = math.isfinite(args[0]) and math.isfinite(args[1])
            return _reduce(node, round(args[0]), round(args[1]), lookup) if finite else math.nan
        # a variable, parameter, time, index or table
        case _:
            return lookup(node)


def _reduce(node: Node, first: int, last: int, lookup: Callable[[Node], float]) -> float:
    """A sum, product or extremum over a range first..last, of a body that is evaluated for each index."""
    operator, name = node.data
    me = index(name)

    def term(i: int) -> float:
        return evaluate([node.args[2]], lambda n: float(i) if n is me else lookup(n))[0]

    budget.charge(budget.TERM * max(last - first, 0), f"the terms of a {operator} one by one")
    items = [term(i) for i in range(first, last + 1)]
    match operator:
        case "sum":
            return math.fsum(items)
        case "prod":
            return math.prod(items)
        # of nothing: no bound at all
        case "min":
            return min(items, default=math.inf)
        case _:
            return max(items, default=-math.inf)
