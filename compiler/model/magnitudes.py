"""Magnitudes of expressions: what their rounding errors are relative to.

A difference that cancels is as uncertain as its terms: |a - b| has the magnitude |a| + |b|; a product, a function or
a power of it inherits that (first-order propagation of relative errors, with the conditions of the functions).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sysdyn.compiler.model.interpret import Lookup, Value, evaluate
from sysdyn.dsl.model.expression import Node, topological_unbound


def magnitudes(roots: Sequence[Node], lookup: Lookup) -> list[Value]:
    """Magnitude of each expression, at least that of its value; sums over ranges count as their value."""
    nodes = [n for n in topological_unbound(roots) if n.op != "index"]
    with np.errstate(all="ignore"):
        value = dict(zip(nodes, evaluate(nodes, lookup), strict=True))
        found: dict[Node, Value] = {}
        for node in nodes:
            found[node] = np.maximum(_own(node, value, found), np.abs(np.asarray(value[node], dtype=float)))
    return [found[root] for root in roots]


def _own(node: Node, value: dict[Node, Value], found: dict[Node, Value]) -> Value:
    """Magnitude by those of the arguments."""
    if any(a not in found for a in node.args):
        return 0.0
    own = np.abs(np.asarray(value[node], dtype=float))
    sizes = [found[a] for a in node.args]
    relative = [_ratio(found[a], value[a]) for a in node.args]
    match node.op:
        case "sum":
            return abs(node.data[0]) + sum(abs(c) * s for c, s in zip(node.data[1], sizes, strict=True))
        case "mul":
            if all(e == 1.0 for e in node.data):
                return np.prod(np.broadcast_arrays(*sizes), axis=0)
            return own * (1.0 + sum(abs(e) * r for e, r in zip(node.data, relative, strict=True)))
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
