"""Laws as polynomials of their own variable: antiderivatives and linear inverses, exact on expressions.

A monomial is  c v^a |v|^b  with c free of v; odd powers of |v| occur in laws such as  e = c f |f|.
"""

from __future__ import annotations

from dataclasses import dataclass

from sysdyn.dsl.expression import Node, add, call, const, div, is_const, linear, mul, product, sub, topological
from sysdyn.dsl.expression import variables as unknowns

Monomials = dict[tuple[int, int], Node]
HIGHEST = 12  # degree up to which products of polynomials are multiplied out: laws have 3 or 5


@dataclass(frozen=True, slots=True)
class Line:
    """constant + slope*v."""

    constant: Node
    slope: Node

    def inverse(self, value: Node) -> Node:
        """The v at which the line has this value."""
        return div(sub(value, self.constant), self.slope)


def polynomial(root: Node, v: Node) -> Monomials | None:
    """The monomials of an expression in v; None where it is no polynomial in v and |v|."""
    found: dict[Node, Monomials | None] = {}
    for node in topological([root]):
        found[node] = _monomials(node, v, found)
    return found[root]


def _monomials(node: Node, v: Node, found: dict[Node, Monomials | None]) -> Monomials | None:
    if node is v:
        return {(1, 0): const(1.0)}
    if v not in unknowns(node):
        return {(0, 0): node}
    if node.op == "call" and node.data == "abs" and node.args[0] is v:
        return {(0, 1): const(1.0)}
    if node.op == "sum":
        total: Monomials = {(0, 0): const(node.data[0])}
        for c, a in zip(node.data[1], node.args, strict=True):
            part = found[a]
            if part is None:
                return None
            for power, coefficient in part.items():
                total[power] = linear(0.0, ((1.0, total.get(power, const(0.0))), (c, coefficient)))
        return _kept(total)
    if node.op == "mul":
        result: Monomials = {(0, 0): const(1.0)}
        for exponent, a in zip(node.data, node.args, strict=True):
            if v not in unknowns(a):
                result = {power: mul(c, product(1.0, ((exponent, a),))) for power, c in result.items()}
                continue
            part = found[a]
            if part is None or exponent != int(exponent) or not 0 < exponent <= HIGHEST:
                return None
            for _ in range(int(exponent)):
                result = _times(result, part)
                if max(a + b for a, b in result) > HIGHEST:
                    return None
        return _kept(result)
    return None


def _times(left: Monomials, right: Monomials) -> Monomials:
    total: Monomials = {}
    for (a, b), c in left.items():
        for (d, e), g in right.items():
            odd = (b + e) % 2  # |v|^2 = v^2
            power = (a + d + (b + e) - odd, odd)
            total[power] = add(total.get(power, const(0.0)), mul(c, g))
    return total


def _kept(found: Monomials) -> Monomials:
    return {power: c for power, c in found.items() if not is_const(c, 0.0)}


def line(root: Node, v: Node) -> Line | None:
    """The law as a line in v; None where it is none."""
    found = polynomial(root, v)
    if found is None or (1, 0) not in found or any(power not in ((0, 0), (1, 0)) for power in found):
        return None
    return Line(found.get((0, 0), const(0.0)), found[1, 0])


def antiderivative(root: Node, v: Node) -> Node | None:
    """Integral by v from 0; None where the integrand is no polynomial in v and |v|."""
    found = polynomial(root, v)
    if found is None:
        return None
    size = call("abs", v)
    terms = []
    for (a, b), c in found.items():
        if b == 0:
            power = product(1.0, ((a + 1.0, v),))
        elif a % 2 == 0:  # v^a |v| is even: its integral is odd
            power = mul(v, product(1.0, ((a + 1.0, size),)))
        else:
            power = product(1.0, ((a + 2.0, size),))
        terms.append((1.0 / (a + b + 1.0), mul(c, power)))
    return linear(0.0, terms)
