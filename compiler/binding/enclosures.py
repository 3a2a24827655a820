"""Bounds of an expression of time over intervals of it: interval arithmetic on the expression's own nodes.

An enclosure holds every value that the expression takes in the interval, and more where a variable occurs twice; it
shrinks to the values as the interval does (Moore, Interval Analysis, 1966).  Rounding is not directed: what is looked
for is larger by far.  Where nothing is known of an operation, or it has a pole inside, the bound is infinite.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isnan

import numpy as np
from numpy.typing import NDArray
from sysdyn.dsl.model.expression import Node, order_of, variables

Array = NDArray[np.float64]
Bounds = tuple[Array, Array]
Range = tuple[float, float]
Values = Callable[[Sequence[Node]], list[Array]]
"""Values of nodes that do not depend on time."""
Outline = Callable[[Array, Array], Bounds]
"""Bounds of a table of one argument over intervals of it."""

_RISING: Mapping[str, Callable[[Array], Array]] = {
    "exp": np.exp, "ln": np.log, "log10": np.log10, "atan": np.arctan, "tanh": np.tanh, "sinh": np.sinh,
    "asinh": np.arcsinh, "acosh": np.arccosh, "asin": np.arcsin, "atanh": np.arctanh, "sign": np.sign,
    "setsign": np.sign, "floor": np.floor, "ceil": np.ceil,
    "step": lambda x: np.where(x >= 0.0, 1.0, 0.0), "signal": lambda x: x,
}  # fmt: skip


def _hull(*ends: Array) -> Bounds:
    """The least and the largest of some values; no numbers are no bounds."""
    low = high = ends[0]
    for end in ends[1:]:
        low, high = np.minimum(low, end), np.maximum(high, end)
    wrong = np.isnan(low)  # either carries what is no number
    return (np.where(wrong, -np.inf, low), np.where(wrong, np.inf, high)) if wrong.any() else (low, high)


def _product(a: Bounds, b: Bounds) -> Bounds:
    with np.errstate(invalid="ignore"):
        ends = [np.where((x == 0.0) | (y == 0.0), 0.0, x * y) for x in a for y in b]
    return _hull(*ends)


def _power(a: Bounds, exponent: float) -> Bounds:
    """Bounds of x^exponent, a number: whole powers of either sign, others of what is not negative."""
    low, high = a
    around = (low <= 0.0) & (high >= 0.0)
    with np.errstate(all="ignore"):
        if exponent == round(exponent):
            found = _hull(low**exponent, high**exponent)
            # an even power of a range around zero is least at zero
            if exponent > 0:
                least = np.where(around & (exponent % 2 == 0), 0.0, found[0])
                return least, found[1]
            # a pole within
            return np.where(around, -np.inf, found[0]), np.where(around, np.inf, found[1])
        found = _hull(np.maximum(low, 0.0) ** exponent, np.maximum(high, 0.0) ** exponent)
    return found


def _power_by_interval(a: Bounds, exponent: Bounds) -> Bounds:
    """Bounds of a power whose exponent is no number of the text: one number all the same, or a range."""
    every = np.concatenate([np.ravel(e) for e in exponent])
    if (every == every[0]).all():
        return _power(a, float(every[0]))
    with np.errstate(all="ignore"):
        low, high = _hull(*(np.power(np.maximum(x, 0.0), y) for x in a for y in exponent))
    # a negative base has powers of either sign, at whole exponents alone
    return np.where(a[0] < 0.0, -np.inf, low), np.where(a[0] < 0.0, np.inf, high)


def _wave(a: Bounds, shift: float) -> Bounds:
    """Bounds of cos(x - shift)."""
    low, high = a[0] - shift, a[1] - shift
    turn = 2.0 * np.pi
    with np.errstate(invalid="ignore"):
        top = np.floor(high / turn) >= np.ceil(low / turn)
        bottom = np.floor((high - np.pi) / turn) >= np.ceil((low - np.pi) / turn)
        found = _hull(np.cos(low), np.cos(high))
    return np.where(bottom, -1.0, found[0]), np.where(top, 1.0, found[1])


def _bounds_of_call(name: str, args: list[Bounds]) -> Bounds:
    """Bounds of a function of the language over bounds of its arguments; unbounded where it is not known."""
    a = args[0]
    # monotone: the ends
    if name in _RISING:
        with np.errstate(all="ignore"):
            found = _RISING[name]
            return _hull(found(a[0]), found(a[1]))
    if name in ("sin", "cos"):
        return _wave(a, 0.5 * np.pi if name == "sin" else 0.0)
    # falling: the ends, exchanged
    if name == "acos":
        with np.errstate(all="ignore"):
            return _hull(np.arccos(a[0]), np.arccos(a[1]))
    # even: least at zero where that lies within
    if name in ("abs", "cosh"):
        size = np.maximum(np.abs(a[0]), np.abs(a[1]))
        least = np.where((a[0] <= 0.0) & (a[1] >= 0.0), 0.0, np.minimum(np.abs(a[0]), np.abs(a[1])))
        with np.errstate(over="ignore"):
            return (least, size) if name == "abs" else (np.cosh(least), np.cosh(size))
    if name in ("min", "max"):
        pick = np.minimum if name == "min" else np.maximum
        return pick(a[0], args[1][0]), pick(a[1], args[1][1])
    # within one period the value moves with its argument, else anything below the period
    if name == "mod":
        b = args[1]
        with np.errstate(all="ignore"):
            turns = np.floor(a[0] / b[0])
            one = (b[0] == b[1]) & (turns == np.floor(a[1] / b[0]))
            low, high = a[0] - b[0] * turns, a[1] - b[0] * turns
        return np.where(one, low, np.minimum(b[0], 0.0)), np.where(one, high, np.maximum(b[1], 0.0))
    if name == "hypot":
        squares = [_power(x, 2.0) for x in args]
        return np.sqrt(squares[0][0] + squares[1][0]), np.sqrt(squares[0][1] + squares[1][1])
    if name == "atan2":
        return np.full_like(a[0], -np.pi), np.full_like(a[0], np.pi)
    return np.full_like(a[0], -np.inf), np.full_like(a[0], np.inf)


def _truth(node: Node, args: list[Bounds]) -> Bounds:
    """Bounds of a condition: 0 false, 1 true."""
    if node.op == "not":
        return 1.0 - args[0][1], 1.0 - args[0][0]
    if node.op in ("and", "or"):
        pick = np.minimum if node.op == "and" else np.maximum
        return pick.reduce([a[0] for a in args]), pick.reduce([a[1] for a in args])
    # a relation: surely true where the intervals lie in order, surely false where in the other
    (low, high), (left, right) = args
    sure, never = {
        "<": (high < left, low >= right),
        "<=": (high <= left, low > right),
        ">": (low > right, high <= left),
        ">=": (low >= right, high < left),
        # == is never sure, and != is its contrary
    }.get(node.data, (np.zeros_like(low, bool), (high < left) | (low > right)))
    if node.data == "!=":
        sure, never = never, sure
    return np.where(sure, 1.0, 0.0), np.where(never, 0.0, 1.0)


def _bounds_of_node(node: Node, args: list[Bounds], outlines: Mapping[str, Outline]) -> Bounds:
    """Bounds of a node by interval arithmetic; tables of one argument by their own outline."""
    match node.op:
        case "sum":
            low = high = np.full_like(args[0][0], node.data[0])
            for c, (a, b) in zip(node.data[1], args, strict=True):
                low, high = (low + c * a, high + c * b) if c > 0.0 else (low + c * b, high + c * a)
            return low, high
        case "mul":
            found = _power(args[0], node.data[0])
            for e, bounds in zip(node.data[1:], args[1:], strict=True):
                found = _product(found, _power(bounds, e))
            return found
        case "pow":
            return _power_by_interval(*args)
        case "call":
            return _bounds_of_call(node.data, args)
        # the branch that is sure, else the hull of both
        case "cond":
            (never, sure), then, other = args
            low = np.where(never == 1.0, then[0], np.where(sure == 0.0, other[0], np.minimum(then[0], other[0])))
            high = np.where(never == 1.0, then[1], np.where(sure == 0.0, other[1], np.maximum(then[1], other[1])))
            return low, high
        case "cmp" | "and" | "or" | "not":
            return _truth(node, args)
        case "table" if len(args) == 1 and node.data[1] == 0 and node.data[0] in outlines:
            return outlines[node.data[0]](*args[0])
        case _:
            return np.full_like(args[0][0], -np.inf), np.full_like(args[0][0], np.inf)


def enclose(root: Node, low: Array, high: Array, fixed: Values, outlines: Mapping[str, Outline]) -> Bounds:
    """Bounds of `root`, which depends on time alone, over the intervals low..high [s] [k]."""
    order = order_of((root,))
    # a number or a formula of parameters: a point
    if not variables(root):
        value = np.broadcast_to(np.asarray(fixed([root])[0], dtype=float), low.shape)
        return value, value
    still = [n for n in order if not variables(n)]
    points = dict(zip(still, fixed(still), strict=True))
    found: dict[Node, Bounds] = {}
    for node in order:
        if node in points:
            value = np.broadcast_to(np.asarray(points[node], dtype=float), low.shape)
            found[node] = value, value
        # time is the interval itself; everything else from its arguments
        elif node.op == "time":
            found[node] = low, high
        else:
            with np.errstate(all="ignore"):
                bounds = _bounds_of_node(node, [found[a] for a in node.args if a in found], outlines)
            found[node] = _hull(*bounds)
    return found[root]


def enclose_over(
    root: Node, known: Mapping[Node, tuple[float, float]], fixed: Callable[[Node], float]
) -> tuple[float, float]:
    """Bounds of an expression over ranges of its unknowns and of time; those that are not known go from -inf to inf.

    fixed: values of expressions without unknowns.
    """
    found: dict[Node, Range] = {}
    for node in order_of((root,)):
        if node in known or node.op in ("var", "time"):
            found[node] = known.get(node, (-np.inf, np.inf))
        elif not variables(node):
            value = fixed(node)
            found[node] = value, value
        else:
            args = [found[a] for a in node.args if a in found]
            found[node] = _single(node, args) or _as_arrays(node, args)
    return found[root]


def _as_arrays(node: Node, args: Sequence[Range]) -> Range:
    """Bounds of one operation, by the arrays of one interval each."""
    with np.errstate(all="ignore"):
        low, high = _hull(*_bounds_of_node(node, [(np.array([a]), np.array([b])) for a, b in args], {}))
    return float(low[0]), float(high[0])


def _single(node: Node, args: Sequence[Range]) -> Range | None:
    """Bounds in plain numbers, where few operations do (most laws are such): arrays of one take ten times as long."""
    if node.op == "sum":
        low = high = node.data[0]
        for c, (a, b) in zip(node.data[1], args, strict=True):
            low, high = (low + c * a, high + c * b) if c > 0.0 else (low + c * b, high + c * a)
        return _least_and_largest((low, high))
    if node.op == "mul":
        found: Range | None = None
        for e, (low, high) in zip(node.data, args, strict=True):
            # a factor
            if e == 1.0:
                factor = _least_and_largest((low, high))
            # a divisor: unbounded where zero lies within
            elif e == -1.0:
                pole = low <= 0.0 <= high
                factor = (-np.inf, np.inf) if pole else _least_and_largest((1.0 / low, 1.0 / high))
            # other powers take the general way
            else:
                return None
            if found is None:
                found = factor
            else:
                ends = [x * y if x and y else 0.0 for x in found for y in factor]
                found = _least_and_largest(ends)
        return found
    if node.op == "call" and node.data == "exp" and all(x in _EXACT for x in args[0]):
        return _EXACT[args[0][0]], _EXACT[args[0][1]]
    return None


_EXACT = {-np.inf: 0.0, 0.0: 1.0, np.inf: np.inf}
"""Arguments at which exp has no rounding."""


def _least_and_largest(ends: Sequence[float]) -> Range:
    """`_hull` of numbers."""
    if any(map(isnan, ends)):
        return -np.inf, np.inf
    return min(ends), max(ends)
