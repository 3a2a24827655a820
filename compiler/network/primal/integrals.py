"""Laws as polynomials of their own variable: antiderivatives and linear inverses, exact on expressions.

A monomial is  c v^a |v|^b  with c free of v; odd powers of |v| occur in laws such as  e = c f |f|.  Antiderivatives are
found also of functions of a line in v, and of  v/sqrt(a + b v^2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from sysdyn.dsl.model.expression import (
    Node,
    add,
    call,
    const,
    div,
    is_const,
    linear,
    mul,
    neg,
    product,
    scale,
    sqrt,
    sub,
    topological,
)
from sysdyn.dsl.model.expression import variables as unknowns
from sysdyn.values import dataclass

Rests = list[tuple[Node, int]]
"""Expressions free of v that are not zero (0) or have a sign where the result holds."""
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
    """A node as a polynomial in v and abs(v): coefficient by the two powers; None where it is none or of too high
    degree.
    """
    if node is v:
        return {(1, 0): const(1.0)}
    if v not in unknowns(node):
        return {(0, 0): node}
    if node.op == "call" and node.data == "abs" and node.args[0] is v:
        return {(0, 1): const(1.0)}
    # coefficients add
    if node.op == "sum":
        total: Monomials = {(0, 0): const(node.data[0])}
        for c, a in zip(node.data[1], node.args, strict=True):
            part = found[a]
            if part is None:
                return None
            for power, coefficient in part.items():
                total[power] = linear(0.0, ((1.0, total.get(power, const(0.0))), (c, coefficient)))
        return _drop_zeros(total)
    # products of polynomials, whole powers by repetition
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
        return _drop_zeros(result)
    return None


def _times(left: Monomials, right: Monomials) -> Monomials:
    total: Monomials = {}
    for (a, b), c in left.items():
        for (d, e), g in right.items():
            odd = (b + e) % 2  # |v|^2 = v^2
            power = (a + d + (b + e) - odd, odd)
            total[power] = add(total.get(power, const(0.0)), mul(c, g))
    return total


def _drop_zeros(found: Monomials) -> Monomials:
    return {power: c for power, c in found.items() if not is_const(c, 0.0)}


def line(root: Node, v: Node) -> Line | None:
    """The law as a line in v; None where it is none."""
    found = polynomial(root, v)
    if found is None or (1, 0) not in found or any(power not in ((0, 0), (1, 0)) for power in found):
        return None
    return Line(found.get((0, 0), const(0.0)), found[1, 0])


_PRIMITIVES: Mapping[str, Callable[[Node], Node]] = {
    "exp": lambda x: call("exp", x),
    "sinh": lambda x: call("cosh", x),
    "cosh": lambda x: call("sinh", x),
    "sin": lambda x: neg(call("cos", x)),
    "cos": lambda x: call("sin", x),
    "asinh": lambda x: sub(mul(x, call("asinh", x)), sqrt(add(const(1.0), mul(x, x)))),
    "atan": lambda x: sub(mul(x, call("atan", x)), scale(0.5, call("ln", add(const(1.0), mul(x, x))))),
}


def _ln_cosh(x: Node) -> Node:
    """Without overflow; its second derivative at 0 is lost."""
    size = call("abs", x)
    return add(size, call("ln", scale(0.5, add(const(1.0), call("exp", scale(-2.0, size))))))


_VALUED: Mapping[str, Callable[[Node], Node]] = {
    "tanh": _ln_cosh,
    "ln": lambda x: sub(mul(x, call("ln", x)), x),
}
"""Primitives whose values are right, but which are not to be differentiated; of ln where it is defined at 0."""


def antiderivative(root: Node, v: Node, rests: Rests, *, valued: bool = False) -> Node | None:
    """Integral by v from 0, None where it is not found; what it rests on is added to `rests`.

    valued: only its value is wanted, it is not going to be differentiated.
    """
    # polynomials, abs(v) included
    found = polynomial(root, v)
    if found is not None:
        return _of_polynomial(found, v)
    # term by term
    if root.op == "sum":
        parts = [antiderivative(a, v, rests, valued=valued) for a in root.args]
        if None in parts:
            return None
        pieces = [(c, part) for c, part in zip(root.data[1], parts, strict=True) if part is not None]
        return linear(0.0, [*pieces, (root.data[0], v)])
    # a factor that does not depend on v
    if root.op == "mul" and any(v not in unknowns(a) for a in root.args):
        factors = list(zip(root.data, root.args, strict=True))
        inner = antiderivative(product(1.0, ((e, a) for e, a in factors if v in unknowns(a))), v, rests, valued=valued)
        outer = product(1.0, ((e, a) for e, a in factors if v not in unknowns(a)))
        return None if inner is None else mul(outer, inner)
    if root.op == "mul":
        return _over_root(root, v, rests)
    primitives = {**_PRIMITIVES, **_VALUED} if valued else _PRIMITIVES
    # f(a v + b): its primitive divided by a
    if root.op == "call" and root.data in primitives and (inside := line(root.args[0], v)) is not None:
        primitive = primitives[root.data]
        rests.append((inside.slope, 0))
        if root.data == "ln":
            rests.append((inside.constant, 1))
        return div(sub(primitive(root.args[0]), primitive(inside.constant)), inside.slope)
    return None


def _over_root(root: Node, v: Node, rests: Rests) -> Node | None:
    """Of v/sqrt(a + b v^2): v^2/(sqrt(a + b v^2) + sqrt(a)), which subtracts no near numbers."""
    powers = {a: e for e, a in zip(root.data, root.args, strict=True)}
    under = next((a for a, e in powers.items() if e == -0.5), None)
    if under is None or len(powers) != 2 or powers.get(v) != 1.0:
        return None
    found = polynomial(under, v)
    if found is None or not set(found) <= {(0, 0), (2, 0)} or (0, 0) not in found:
        return None
    rests.append((found[0, 0], 1))
    return div(mul(v, v), add(sqrt(under), sqrt(found[0, 0])))


def _of_polynomial(found: Monomials, v: Node) -> Node:
    """Integral of a polynomial in v and abs(v) from 0."""
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
