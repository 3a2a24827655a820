"""Sums, products, powers and conditions, with the dimensions of their operands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.units import NONE, Dimension, multiply, power_of
from sysdyn.dsl.names.context import Context, Value
from sysdyn.dsl.names.symbols import Definition, Typed, Vector
from sysdyn.dsl.text.diagnostics import Related
from sysdyn.dsl.tree import syntax


class Arithmetic(Context):
    """Sums, products, powers and conditions, with the dimensions of their operands."""

    def _sum(self, e: syntax.Sum) -> Value:
        """Terms of one dimension, or vectors of one length; E203 names the two that differ."""
        values = [self.resolve(t) for _, t in e.terms]
        # [1, 2] + x[1..2]
        if any(isinstance(v, Vector) for v in values):
            return self._vector_sum(e, values)
        found: Dimension | None = None
        where = e.terms[0][1]
        # a term without dimension (0, inf) fits any sum
        for (_, term), value in zip(e.terms, values, strict=True):
            assert isinstance(value, Typed)
            self.is_number(value, term)
            if value.dimension is None:
                continue
            if found is None:
                found, where = value.dimension, term
            elif value.dimension != found:
                message = f"the two operands differ: {dim.show(found)} + {dim.show(value.dimension)}"
                related = (Related(dim.show(found), self.place(where.span)),)
                raise self.fail(
                    "E203", message, term.span, related=related, help=self.missing(value.dimension, found, term, where)
                )
        signs = [-1.0 if s == "-" else 1.0 for s, _ in e.terms]
        return Typed(ex.linear(0.0, zip(signs, (v.node for v in values), strict=True)), found)  # type: ignore[union-attr]

    def _vector_sum(self, e: syntax.Sum, values: Sequence[Value]) -> Value:
        total = None
        for (sign, term), value in zip(e.terms, values, strict=True):
            if not isinstance(value, Vector) or (total is not None and len(value.items) != len(total)):
                help_ = "arrays of one size are added; an element of one is a[1]"
                raise self.fail("E203", "an array is added to something of another size", term.span, help=help_)
            signed = [Typed(ex.neg(v.node) if sign == "-" else v.node, v.dimension) for v in value.items]
            total = signed if total is None else [self.add(a, b, term.span) for a, b in zip(total, signed, strict=True)]
        return Vector(tuple(total or ()))

    def _product(self, e: syntax.Product) -> Value:
        """Factors and divisors; at most one is a vector."""
        nodes: list[tuple[float, Node]] = []
        dimension: Dimension | None = NONE
        vector: Vector | None = None
        # dimensions multiply; one that is not known makes the product's unknown
        for op, factor in e.factors:
            value = self.resolve(factor)
            # 2*[a, b]; of two lists it is said which product is meant
            if isinstance(value, Vector):
                if vector is not None or op == "/":
                    raise self.fail(
                        "E203", "the product of two arrays is written dot(a, b) or cross(a, b)", factor.span
                    )
                vector = value
                continue
            self.is_number(value, factor)
            power = -1 if op == "/" else 1
            # x/0, as it is written
            if op == "/" and ex.is_const(value.node) and value.node.data == 0.0:
                text = self.source.text[factor.span.start : factor.span.end]
                raise self.fail("E324", f"division by '{text}', which is zero", factor.span)
            nodes.append((float(power), value.node))
            if value.dimension is None:
                dimension = None
            elif dimension is not None:
                dimension = multiply(dimension, value.dimension, power)
        node = ex.product(1.0, nodes)
        if vector is None:
            return Typed(node, dimension)
        items = []
        # each element by the factors
        for v in vector.items:
            d = None if v.dimension is None or dimension is None else multiply(dimension, v.dimension)
            items.append(Typed(ex.mul(node, v.node), d))
        return Vector(tuple(items), vector.first)

    def _negative(self, e: syntax.Negative) -> Value:
        value = self.resolve(e.operand)
        if isinstance(value, Vector):
            return Vector(tuple(Typed(ex.neg(v.node), v.dimension) for v in value.items), value.first)
        self.is_number(value, e.operand)
        return Typed(ex.neg(value.node), value.dimension)

    def _power(self, e: syntax.Power) -> Value:
        """The exponent is a number without unit, and a rational constant where the base has a unit (E204)."""
        base, exponent = self.scalar(e.base), self.scalar(e.exponent)
        # x^(2 m)
        if exponent.dimension not in (None, NONE):
            help_ = None
            if isinstance(e.exponent, syntax.QuantityLiteral):
                number, unit = e.exponent.text, e.exponent.unit.text
                help_ = f"factors are joined by '*': ^{number}*{unit}; '{number} {unit}' is a quantity"
            raise self.fail("E204", f"the exponent is in {dim.show(exponent.dimension)}", e.exponent.span, help=help_)
        if ex.is_const(exponent.node) and not math.isfinite(exponent.node.data):
            message = f"the exponent is {exponent.node.data}: beyond all numbers"
            raise self.fail("E204", message, e.exponent.span, help="a finite exponent")
        # a number to any power
        if not base.dimension:
            return Typed(ex.power(base.node, exponent.node), base.dimension if exponent.dimension else NONE)
        # (2 m)^n has a dimension that depends on n
        if not ex.is_const(exponent.node):
            message = f"the exponent must be a rational constant because the base is in {dim.show(base.dimension)}"
            raise self.fail("E204", message, e.exponent.span, help="make the base dimensionless")
        # m^0.5 and m^(1/3): the dimension's exponents are rational
        exact = Fraction(exponent.node.data).limit_denominator(1000)
        if abs(exact) > 100:
            raise self.fail("E204", f"the exponent {exponent.node} of a quantity is out of reason", e.exponent.span)
        power: Fraction | int = int(exact) if exact.denominator == 1 else exact
        dimension = tuple((k, int(v) if v == int(v) else v) for k, v in power_of(base.dimension, power))
        return Typed(ex.power(base.node, exponent.node), dimension)

    def _signal_of(self, e: syntax.Expr) -> tuple[str, str] | None:
        """The input that an expression names, and what it is bound to as it is written."""
        symbol = self.scope.find(e.name) if isinstance(e, syntax.Name) else None
        if not isinstance(symbol, Definition) or symbol.kind != "input":
            return None
        span = symbol.expression.span
        return symbol.name, " ".join(symbol.space.source.text[span.start : span.end].split())

    def _compare(self, e: syntax.Compare) -> Value:
        """Two numbers of one dimension compared; conditions and arrays are not (E203)."""
        left, right = self.resolve(e.left), self.resolve(e.right)
        if isinstance(left, Vector) or isinstance(right, Vector):
            raise self.fail("E203", "arrays are not compared", e.span, help="an element of one: a[1] < b[1]")
        if left.truth or right.truth:
            bound = self._signal_of(e.left if left.truth else e.right)
            said, number = "a condition is not compared", "and, or, not"
            if bound:
                said, number = f"'{bound[0]}' is a condition: it is not compared", f"(if {bound[1]} then 1 else 0)"
            raise self.fail("E203", said, e.span, help=number)
        if None not in (left.dimension, right.dimension) and left.dimension != right.dimension:
            message = f"the two operands differ: {dim.show(left.dimension)} {e.op} {dim.show(right.dimension)}"
            help_ = self.missing(right.dimension, left.dimension, e.right, e.left)
            raise self.fail("E203", message, e.span, help=help_)
        return Typed(ex.compare(e.op, left.node, right.node), NONE, truth=True)

    def _and(self, e: syntax.And) -> Value:
        return Typed(ex.both(*(self.condition(o) for o in e.operands)), NONE, truth=True)

    def _or(self, e: syntax.Or) -> Value:
        return Typed(ex.either(*(self.condition(o) for o in e.operands)), NONE, truth=True)

    def _not(self, e: syntax.Not) -> Value:
        return Typed(ex.negate(self.condition(e.operand)), NONE, truth=True)

    def _conditional(self, e: syntax.Conditional) -> Value:
        test = self.condition(e.test)
        then, other = self.scalar(e.then), self.scalar(e.other)
        if None not in (then.dimension, other.dimension) and then.dimension != other.dimension:
            message = f"the two branches differ: {dim.show(then.dimension)} and {dim.show(other.dimension)}"
            help_ = self.missing(other.dimension, then.dimension, e.other, e.then)
            raise self.fail("E203", message, e.span, help=help_)
        dimension = then.dimension if then.dimension is not None else other.dimension
        return Typed(ex.conditional(test, then.node, other.node), dimension)
