"""Expressions as sympy objects and back: roots of algebraic equations in one unknown.

Objects are built node by node, parameters as symbols of known sign; no text is ever parsed.  sympy takes half a second
to import and is imported only here, when a root is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from sysdyn.dsl.model.expression import Node, add, call, const, mul, product, topological


class SignedAlgebra:
    """One unknown v, one value w and parameters of known sign."""

    def __init__(self, v: Node, w: Node, signs: Mapping[Node, int], *, positive: bool) -> None:
        """positive: v and w are."""
        import sympy

        self._sympy: Any = sympy
        told = {"positive": True} if positive else {"real": True}
        self._v, self._w = sympy.Symbol("v", **told), sympy.Symbol("w", **told)
        self._objects: dict[Node, Any] = {v: self._v, w: self._w}
        self._nodes: dict[Any, Node] = {self._v: v, self._w: w}
        for k, (node, sign) in enumerate(signs.items()):
            symbol = sympy.Symbol(f"p{k}", positive=True)
            self._objects[node] = sign * symbol
            self._nodes[symbol] = mul(const(float(sign)), node)

    def simplify(self, root: Node) -> Node | None:
        """The expression over one denominator, its factors apart."""
        return self._node(self._sympy.factor(self._sympy.together(self._object(root))))

    def roots(self, law: Node, *, over_value: bool) -> Iterator[Node]:
        """Candidates for the v with law(v) = w; over_value: divided by w.

        The law may hold one square root; freed of it, the equation is of the second degree in v or v^2.
        """
        sympy = self._sympy
        for root in self._rationalize_root(self._object(law) - self._w):
            node = self._node(sympy.factor(root / self._w if over_value else root))
            if node is not None:
                yield node

    def _rationalize_root(self, equation: Any) -> Iterator[Any]:
        """The roots of an equation with one square root, squared."""
        sympy, v = self._sympy, self._v
        powers = [p for p in equation.atoms(sympy.Pow) if p.exp.is_Rational and p.exp.q == 2 and p.has(v)]
        # one square root at most
        if len({p.base for p in powers}) > 1:
            return
        r = sympy.Symbol("r", positive=True)
        whole = sympy.numer(sympy.together(equation.xreplace({p: r ** (2 * p.exp) for p in powers})))
        # r^2 = base: the resultant has no root
        if powers:
            under = sympy.numer(sympy.together(r**2 - powers[0].base))
            whole = sympy.resultant(sympy.expand(whole), sympy.expand(under), r)
        found = sympy.Poly(sympy.expand(whole), v)
        degree, even = found.degree(), all(k % 2 == 0 for (k,) in found.monoms())
        coefficients = [sympy.factor(found.coeff_monomial(v**k)) for k in range(5)]
        # a polynomial in v^2
        if degree in (2, 4) and even:
            for square in self._quadratic(*coefficients[0:5:2]):
                yield from (sympy.sqrt(sympy.factor(square)), -sympy.sqrt(sympy.factor(square)))
        elif degree in (1, 2):
            yield from self._quadratic(*coefficients[:3])

    def _quadratic(self, c: Any, b: Any, a: Any) -> Iterator[Any]:
        """Roots of a x^2 + b x + c, each in the two forms of which one subtracts no near numbers."""
        if a == 0:
            yield -c / b
            return
        inner = self._sympy.sqrt(self._sympy.factor(b * b - 4 * a * c))
        yield from (2 * c / (-b - inner), (-b + inner) / (2 * a), 2 * c / (-b + inner), (-b - inner) / (2 * a))

    def _object(self, root: Node) -> Any:
        """Sums, products and powers as sympy objects; numbers exactly."""
        sympy, done = self._sympy, dict(self._objects)
        for node in topological([root]):
            if node in done:
                continue
            args = [done[a] for a in node.args]
            # exactly: doubles are fractions
            if node.op == "const":
                done[node] = sympy.Rational(node.data)
            elif node.op == "sum":
                terms = (sympy.Rational(c) * a for c, a in zip(node.data[1], args, strict=True))
                done[node] = sympy.Add(sympy.Rational(node.data[0]), *terms)
            elif node.op == "mul":
                done[node] = sympy.Mul(*(a ** sympy.Rational(e) for e, a in zip(node.data, args, strict=True)))
            else:
                raise AssertionError(node.op)
        return done[root]

    def _node(self, root: Any) -> Node | None:
        """The expression of a sympy object; None where it holds what the language has no word for."""
        done: dict[Any, Node | None] = {}
        for part in self._sympy.postorder_traversal(root):
            args = [done[a] for a in part.args]
            done[part] = None if None in args else self._one(part, [a for a in args if a is not None])
        return done[root]

    def _one(self, part: Any, args: list[Node]) -> Node | None:
        """Node of a sympy object from those of its arguments; None where the language does not have it."""
        if part in self._nodes:
            return self._nodes[part]
        if part.is_Rational:
            return const(float(part))
        if part.is_Add:
            return add(*args)
        if part.is_Mul:
            return mul(*args)
        if part.is_Pow and part.exp.is_Rational and part.exp.q <= 2:
            return product(1.0, ((float(part.exp), args[0]),))
        return call("abs", args[0]) if isinstance(part, self._sympy.Abs) else None
