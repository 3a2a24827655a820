"""What expressions have in common that differ in numbers and parameters alone: a shape with holes."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.model.expression import Node, add, call, const, linear, mul, power, product, time, var
from sysdyn.values import dataclass

MOST = 200
"""Nodes of an expression that is looked at."""
SMOOTH = frozenset(("sin", "cos", "tan", "sinh", "cosh", "tanh", "asinh", "atan", "exp", "ln", "sqrt", "hypot"))
"""Functions without kinks: where a law bends, what may slide is told by its own name."""


@dataclass(frozen=True, slots=True)
class Shaped:
    """key: equal for expressions that differ in what stands in the holes (constants and scalar parameters) and in the
    name of the element itself; holes in the order of the key.
    """

    key: tuple[object, ...]
    holes: tuple[Node, ...]


class _StrangeError(Exception):
    """Something that no hole and no key stands for."""


def shape_of(root: Node | None, own: str) -> Shaped | None:
    """The shape of an expression of time and of quantities of the element `own`; None where it reads more or bends."""
    if root is None:
        return None
    holes: list[Node] = []
    left = [MOST]
    try:
        return Shaped(_key(root, own, holes, left, whole=True), tuple(holes))
    except _StrangeError:
        return None


def _key(node: Node, own: str, holes: list[Node], left: list[int], *, whole: bool = False) -> tuple[object, ...]:
    """Text of a node without its numbers, which become holes; raises where it reads more than time and `own`."""
    left[0] -= 1
    # long expressions are rarely alike
    if left[0] < 0:
        raise _StrangeError
    # a sum, and a single term as a sum of one: numbers are holes
    if node.op == "sum" or (whole and node.op not in ("const", "param")):  # 1 ohm*f is f
        (constant, coefficients), args = (node.data, node.args) if node.op == "sum" else ((0.0, (1.0,)), (node,))
        holes += [const(constant), *map(const, coefficients)]
        return "sum", *(_key(a, own, holes, left) for a in args)
    match node.op:
        # numbers and parameters are holes
        case "const":
            holes.append(node)
            return ("hole",)
        case "param" if not node.args:
            holes.append(node)
            return ("hole",)
        case "time":
            return ("time",)
        # quantities of the element itself
        case "var" if node.data[0] == own and not node.args:
            return "own", *node.data[1:]
        case "mul" | "pow":
            return node.op, node.data, *(_key(a, own, holes, left) for a in node.args)
        case "call" if node.data in SMOOTH:
            return node.op, node.data, *(_key(a, own, holes, left) for a in node.args)
    raise _StrangeError


def fill_shape(shape: Shaped, own: str, at: tuple[Node, ...], holes: Sequence[Node]) -> Node:
    """The expression with other things in its holes, of the element `own` at these indices."""
    rest = list(reversed(holes))
    return _fill(shape.key, own, at, rest)


def _fill(key: tuple[object, ...], own: str, at: tuple[Node, ...], rest: list[Node]) -> Node:
    """The node of a key, its holes taken from `rest` in order."""
    what, *inner = key
    match what:
        case "hole":
            return rest.pop()
        case "time":
            return time()
        case "own":
            kind, order = inner
            return var(own, str(kind), *at, order=int(order))  # type: ignore[call-overload]
        case "sum":
            constant, *coefficients = [rest.pop() for _ in range(len(inner) + 1)]
            args = [_fill(part, own, at, rest) for part in inner]  # type: ignore[arg-type]
            terms = [_times(c, a) for c, a in zip(coefficients, args, strict=True)]
            return add(constant, *terms)
    data, *parts = inner
    args = [_fill(part, own, at, rest) for part in parts]  # type: ignore[arg-type]
    if what == "mul":
        return product(1.0, zip(data, args, strict=True))  # type: ignore[call-overload]
    return power(*args) if what == "pow" else call(str(data), *args)


def _times(factor: Node, node: Node) -> Node:
    return linear(0.0, ((factor.data, node),)) if factor.op == "const" else mul(factor, node)
