"""Evaluates expressions and descriptor forms with NumPy, straight from their nodes: the oracle of both emitters.

It also gives parameters and initial values their numbers (`binding`).  Loops are flattened into index arrays, last
loop fastest; every value is a scalar or an array over the iterations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.expression import Node, order_of

Value = Any  # float or array
Lookup = Callable[[Node, list[Value]], Value]  # (leaf, values of its indices or arguments) -> value

_FUNCTIONS: Mapping[str, Callable[..., Value]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "atan2": np.arctan2, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "asinh": np.arcsinh,
    "acosh": np.arccosh, "atanh": np.arctanh, "exp": np.exp, "ln": np.log, "log10": np.log10, "abs": np.abs,
    "sign": np.sign, "floor": np.floor, "ceil": np.ceil, "hypot": np.hypot, "min": np.minimum, "max": np.maximum,
    "mod": lambda a, b: a - b * np.floor(a / b), "step": lambda x: np.where(x >= 0.0, 1.0, 0.0),
}  # fmt: skip
_COMPARE: Mapping[str, Callable[[Value, Value], Value]] = {
    "==": np.equal, "!=": np.not_equal, "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal,
}  # fmt: skip
_FOLD: Mapping[str, tuple[Callable[[Value, Value], Value], float]] = {
    "sum": (np.add, 0.0), "prod": (np.multiply, 1.0), "min": (np.minimum, np.inf), "max": (np.maximum, -np.inf),
}  # fmt: skip


def evaluate(roots: Sequence[Node], lookup: Lookup) -> list[Value]:
    """Values of expressions; lookup gives those of param, time, index, var and table nodes."""
    with np.errstate(all="ignore"):
        return _evaluate(roots, lookup)


def last_of(nodes: Sequence[Node], lookup: Lookup) -> Value:
    """The value of the last of nodes that stand after those they need; the caller silences what is no number."""
    return _values(nodes, lookup)[nodes[-1]]


def _evaluate(roots: Sequence[Node], lookup: Lookup) -> list[Value]:
    values = _values(order_of(tuple(roots)), lookup)
    return [values[r] for r in roots]


def _values(nodes: Iterable[Node], lookup: Lookup) -> dict[Node, Value]:
    values: dict[Node, Value] = {}
    for node in nodes:
        if node.op == "param" and not node.args:  # most of what a netlist asks
            values[node] = lookup(node, [])
        else:
            values[node] = _value(node, [values[a] for a in node.args if a in values], lookup)
    return values


def _value(node: Node, args: list[Value], lookup: Lookup) -> Value:
    """Value of a node, an array over iterations, from those of its arguments."""
    match node.op:
        case "const":
            return np.float64(node.data)
        case "sum":
            total: Value = node.data[0]
            for c, a in zip(node.data[1], args, strict=True):
                total = total + c * a
            return total
        case "mul":
            value: Value = np.float64(1.0)
            for e, a in zip(node.data, args, strict=True):
                value = value * np.power(np.asarray(a, dtype=float), e)
            return value
        case "pow":
            return np.power(np.asarray(args[0], dtype=float), args[1])
        case "call":
            return _FUNCTIONS[node.data](*args)
        case "cond":
            return np.where(args[0], args[1], args[2])
        case "cmp":
            return _COMPARE[node.data](args[0], args[1])
        case "and":
            return np.logical_and.reduce(np.broadcast_arrays(*args))
        case "or":
            return np.logical_or.reduce(np.broadcast_arrays(*args))
        case "not":
            return np.logical_not(args[0])
        case "reduce":
            return _reduce(node, args, lookup)
        # leaves and tables
        case _:
            return lookup(node, args)


def _reduce(node: Node, args: list[Value], lookup: Lookup) -> Value:
    """One iteration after the other, over all outer iterations at once; bounds may differ between these."""
    operator, name = node.data
    combine, total = _FOLD[operator]
    first, last = np.rint(args[0]), np.rint(args[1])
    body = node.args[2]
    value: Value = total
    for k in range(int(np.min(first)), int(np.max(last)) + 1):
        item = _evaluate([body], _bound(name, float(k), lookup))[0]
        value = np.where((first <= k) & (k <= last), combine(value, item), value)
    return value


def _bound(name: str, value: float, lookup: Lookup) -> Lookup:
    return lambda node, args: value if node.op == "index" and node.data == name else lookup(node, args)


def grid(nest: Nest, lookup: Lookup) -> dict[str, NDArray[np.float64]]:
    """Loop variables of a nest as arrays over its iterations, last loop fastest."""
    columns: dict[str, NDArray[np.float64]] = {}
    for loop in nest:
        inside = with_loop_variables(columns, lookup)
        low, high = (np.rint(np.asarray(v)) for v in evaluate([loop.first, loop.last], inside))
        size = len(next(iter(columns.values()))) if columns else 1
        low, high = np.broadcast_to(low, size), np.broadcast_to(high, size)
        count = np.maximum(high - low + 1, 0).astype(np.int64)
        start = np.cumsum(count) - count
        within = np.arange(int(count.sum())) - np.repeat(start, count) + np.repeat(low, count)
        columns = {name: np.repeat(values, count) for name, values in columns.items()}
        columns[loop.index] = within.astype(float)
    return columns


def over(nest: Nest, roots: Sequence[Node], lookup: Lookup) -> list[NDArray[np.float64]]:
    """Values of expressions for all iterations of a nest, one array each (one element without loops)."""
    columns = grid(nest, lookup)
    size = len(next(iter(columns.values()))) if columns else 1
    values = evaluate(roots, with_loop_variables(columns, lookup))
    return [np.broadcast_to(np.asarray(v, dtype=float), (size,)).copy() for v in values]


def with_loop_variables(columns: Mapping[str, Value], lookup: Lookup) -> Lookup:
    """Loop variables by name: nodes of other `fresh` blocks mean the same."""
    return lambda node, args: columns[node.data] if node.op == "index" and node.data in columns else lookup(node, args)
