"""Interval arithmetic over the reals: signs of expressions for all values of one variable.

An interval is (low, high, strict), strict where zero is excluded.  Parameters are known by their signs alone; a power
that is not whole is taken where its base is positive, so a sign that is found holds on the domain of the expression.
Correlations are not seen: what is returned holds for certain, what is not is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from sysdyn.dsl.model.expression import Node, topological
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Reals:
    """All x with low <= x <= high, without zero where strict."""

    low: float
    high: float
    strict: bool = False

    @property
    def sign(self) -> int:
        """1 or -1 where all values are positive or negative, else 0."""
        if self.low > 0.0 or (self.low == 0.0 and self.strict):
            return 1
        return -1 if self.high < 0.0 or (self.high == 0.0 and self.strict) else 0


ALL = Reals(-math.inf, math.inf)
NOT_NEGATIVE = Reals(0.0, math.inf)
POSITIVE = Reals(0.0, math.inf, True)
NEGATIVE = Reals(-math.inf, 0.0, True)
_CALLS = {"exp": POSITIVE, "cosh": Reals(1.0, math.inf, True), "abs": NOT_NEGATIVE}
_CALLS |= dict.fromkeys(("tanh", "sin", "cos"), Reals(-1.0, 1.0)) | dict.fromkeys(
    ("step", "smoothstep"), Reals(0.0, 1.0)
)
_ODD = ("sinh", "asinh", "atan", "sign")


def reals(root: Node, known: Mapping[Node, Reals]) -> Reals:
    """Where the values of an expression lie; `known`: those of variables and parameters."""
    found: dict[Node, Reals] = {}
    for node in topological([root]):
        found[node] = known[node] if node in known else _reals_of(node, [found[a] for a in node.args])
    return found[root]


def _reals_of(node: Node, args: list[Reals]) -> Reals:
    """Where the value of a node lies, from where those of its arguments do; ALL where nothing is known."""
    match node.op:
        case "const":
            return Reals(node.data, node.data, node.data != 0.0)
        case "sum":
            parts = [Reals(node.data[0], node.data[0], node.data[0] != 0.0)]
            return _sum([*parts, *(_times(Reals(c, c, True), a) for c, a in zip(node.data[1], args, strict=True))])
        case "mul":
            total = Reals(1.0, 1.0, True)
            for e, a in zip(node.data, args, strict=True):
                total = _times(total, _power(a, e))
            return total
        # an odd function has the sign of its argument
        case "call" if node.data in _ODD:
            return {1: POSITIVE, -1: NEGATIVE}.get(args[0].sign, ALL)
        case "call":
            return _CALLS.get(node.data, ALL)
        # either branch
        case "cond":
            one, other = args[1:]
            return Reals(min(one.low, other.low), max(one.high, other.high), one.strict and other.strict)
    return ALL


def _sum(parts: Iterable[Reals]) -> Reals:
    parts = list(parts)
    low, high = _sum_of_ends((p.low for p in parts), -math.inf), _sum_of_ends((p.high for p in parts), math.inf)
    upward = all(p.low >= 0.0 for p in parts) and any(p.sign > 0 for p in parts)
    downward = all(p.high <= 0.0 for p in parts) and any(p.sign < 0 for p in parts)
    return Reals(low, high, upward or downward or low > 0.0 or high < 0.0)


def _sum_of_ends(ends: Iterable[float], open_: float) -> float:
    """The sum of lower or of upper ends; open_: what it is where one of them is that, or it is no double."""
    ends = list(ends)
    try:
        return open_ if open_ in ends else math.fsum(ends)
    except OverflowError:
        return open_


def _times(a: Reals, b: Reals) -> Reals:
    ends = [0.0 if x == 0.0 or y == 0.0 else x * y for x in (a.low, a.high) for y in (b.low, b.high)]
    return Reals(min(ends), max(ends), a.strict and b.strict)


def _power(base: Reals, exponent: float) -> Reals:
    if exponent != int(exponent):  # only positive bases have one
        base = Reals(max(base.low, 0.0), max(base.high, 0.0), base.strict)
    if exponent < 0:
        return _reciprocal(_power(base, -exponent), always=exponent != int(exponent) or exponent % 2 == 0)
    ends = [_saturating_power(x, exponent) for x in (base.low, base.high)]
    low = 0.0 if exponent % 2 == 0 and base.low < 0.0 < base.high else min(ends)
    return Reals(low, max(ends), base.strict)


def _saturating_power(x: float, exponent: float) -> float:
    """A power that is no less than zero."""
    try:
        size = abs(x) ** exponent
    except OverflowError:
        size = math.inf
    return math.copysign(size, x) if exponent % 2 == 1 else size


def _reciprocal(a: Reals, *, always: bool) -> Reals:
    """1/a where a is not zero; always: a is no less than zero."""
    if a.sign == 0 and not always:
        return Reals(-math.inf, math.inf, True)
    if a.sign < 0:
        flipped = _reciprocal(Reals(-a.high, -a.low, True), always=True)
        return Reals(-flipped.high, -flipped.low, True)
    low = 0.0 if a.high == math.inf else 1.0 / a.high if a.high else 0.0
    return Reals(low, 1.0 / a.low if a.low > 0.0 else math.inf, True)
