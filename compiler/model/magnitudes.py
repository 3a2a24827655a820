"""Magnitudes of expressions: what their rounding errors are relative to.

A difference that cancels is as uncertain as its terms: |a - b| has the magnitude |a| + |b|; a product, a function or
a power of it inherits that (first-order propagation of relative errors, with the conditions of the functions).
`rounding` is the same as an expression, absolute and by derivatives, for what a program has to tell from zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from sysdyn.compiler.model.interpret import Lookup, Value, evaluate
from sysdyn.dsl.model.calculus import partials
from sysdyn.dsl.model.expression import Node, add, call, compare, conditional, const, linear, mul, topological_unbound

EXACT = ("const", "param", "var", "time", "index", "reduce", "cmp", "and", "or", "not")
"""What `rounding` takes as it is."""


def magnitudes(roots: Sequence[Node], lookup: Lookup, table_size: Callable[[Node], float]) -> list[Value]:
    """Magnitude of each expression, at least that of its value; sums over ranges count as their value.  table_size: of
    the terms that a table's value is made of.
    """
    nodes = [n for n in topological_unbound(roots) if n.op != "index"]
    with np.errstate(all="ignore"):
        value = dict(zip(nodes, evaluate(nodes, lookup), strict=True))
        found: dict[Node, Value] = {}
        for node in nodes:
            found[node] = np.maximum(_own(node, value, found), np.abs(np.asarray(value[node], dtype=float)))
            if node.op == "table":
                found[node] = found[node] + table_size(node)
    return [found[root] for root in roots]


def _own(node: Node, value: dict[Node, Value], found: dict[Node, Value]) -> Value:
    """Magnitude by those of the arguments."""
    if any(a not in found for a in node.args):
        return 0.0
    own = np.abs(np.asarray(value[node], dtype=float))
    sizes = [found[a] for a in node.args]
    relative = [_ratio(found[a], value[a]) for a in node.args]
    match node.op:
        # terms that cancel leave the size of the terms
        case "sum":
            return abs(node.data[0]) + sum(abs(c) * s for c, s in zip(node.data[1], sizes, strict=True))
        # relative errors add up; of a product that is zero the other factors count
        case "mul":
            if all(e == 1.0 for e in node.data):
                return np.prod(np.broadcast_arrays(*sizes), axis=0)
            own = own * (1.0 + sum(abs(e) * r for e, r in zip(node.data, relative, strict=True)))
            parts = zip(node.data, sizes, node.args, strict=True)
            factors = [s**e if e > 0.0 else np.abs(value[a]) ** e for e, s, a in parts]  # of zeros that cancel above
            return np.where(value[node] == 0.0, np.prod(np.broadcast_arrays(*factors), axis=0), own)
        # the exponent multiplies the relative error of the base
        case "pow":
            return own * (1.0 + np.abs(value[node.args[1]]) * relative[0])
        case "call" | "table":
            # exp: its argument is the condition; of bounded and flat functions it is at most the argument's size
            return own * (1.0 + sizes[0]) if node.data == "exp" else own + sum(sizes)
        case "cond":
            return np.maximum(sizes[1], sizes[2])
        case _:
            return own


def _ratio(size: Value, value: Value) -> Value:
    return size / np.maximum(np.abs(np.asarray(value, dtype=float)), 1e-300)


def rounding(root: Node) -> Node:
    """Rounding error of an expression in units of the last place, first order (running error analysis: Higham,
    Accuracy and Stability of Numerical Algorithms, section 3.3); unknowns, parameters and sums over ranges are exact.
    """
    found: dict[Node, Node] = {}
    for node in topological_unbound([root]):
        exact = node.op in EXACT or any(a not in found for a in node.args)
        found[node] = const(0.0) if exact else add(_own_rounding(node), *_propagated_errors(node, found))
    return found[root]


def _own_rounding(node: Node) -> Node:
    """Of the last operation alone: of a sum relative to its terms."""
    if node.op != "sum":
        return call("abs", node)
    return linear(abs(node.data[0]), [(abs(c), call("abs", a)) for c, a in zip(node.data[1], node.args, strict=True)])


def _propagated_errors(node: Node, found: dict[Node, Node]) -> Iterator[Node]:
    """What the errors of the arguments come to; of an exact argument none, also where the derivative is a pole."""
    for argument, partial in zip(node.args, partials(node), strict=True):
        error = found[argument]
        if error is not const(0.0):
            some = compare(">", error, const(0.0))
            yield conditional(some, mul(call("abs", partial), error), const(0.0))
