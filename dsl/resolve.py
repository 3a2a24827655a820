"""From an expression as written to a node: names bound, quantities in SI, every dimension checked.

Received: syntax expressions and the scope they stand in.  Returned: `Typed` values.  A rule that fails is reported
once and stands for itself with an unknown dimension, so that one mistake gives one message.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction

from sysdyn.dsl import dimensions as dim
from sysdyn.dsl import expression as ex
from sysdyn.dsl import syntax
from sysdyn.dsl.diagnostics import Place, Related, Report, SourceText
from sysdyn.dsl.expression import Node
from sysdyn.dsl.network import Constraint, Loop
from sysdyn.dsl.symbols import (
    BundleSymbol,
    ComponentSymbol,
    ConstraintSymbol,
    Definition,
    DomainSymbol,
    FunctionSymbol,
    ParameterSymbol,
    Scope,
    Symbol,
    TableSymbol,
    Typed,
    UnknownSymbol,
    Unsupported,
    Vector,
    nearest,
)
from sysdyn.dsl.unit_reading import read_unit
from sysdyn.dsl.units import NONE, Dimension, known, multiply, raised

Value = Typed | Vector
AUDIT = {"energy": dim.ENERGY, "kinetic": dim.ENERGY, "potential": dim.ENERGY, "dissipated": dim.ENERGY}
AUDIT |= {"supplied": dim.ENERGY, "constraints": NONE}
STATICS = ("coordinates", "m1", "m2", "dof", "configuration_dof", "redundant", "order", "manifold", "index")
_BAD = Typed(ex.const(math.nan), None)


@dataclass(slots=True)
class Use:
    """An index used on a family, to be checked against its shape once the sizes are known."""

    shape: tuple[Node, Node]
    value: Node
    loops: tuple[Loop, ...]
    name: str
    place: Place


class Failed(Exception):  # noqa: N818
    """The expression is wrong and has been reported."""



class Resolver:
    """Resolves the expressions of one model; holds what has been learnt on the way."""

    def __init__(self, report: Report) -> None:
        self.report = report
        self.uses: list[Use] = []
        self.whole: set[str] = set()  # parameters used as sizes or indices
        self.inputs: set[str] = set()  # parameters that are inputs: no sizes
        self.constraints: dict[str, list[Constraint]] = {}
        self._values: dict[Definition, Value] = {}
        self._active: list[Definition] = []
        self._loops: list[Loop] = []
        self._bound: dict[str, Typed] = {}  # loop variables and function arguments in sight
        self._names: dict[str, int] = {}
        self.scope = Scope()
        self.source = SourceText("", "")
        self._unknown = ("E101", "unknown name '{}'")
        self.statics = False  # static quantities are in sight (expect static)

    # -- context -------------------------------------------------------------------------------------------

    @contextmanager
    def within(self, scope: Scope, source: SourceText) -> Iterator[None]:
        """Resolve names in that scope and take spans as parts of that text."""
        before = self.scope, self.source
        self.scope, self.source = scope, source
        try:
            yield
        finally:
            self.scope, self.source = before

    @contextmanager
    def unknown_as(self, code: str, message: str) -> Iterator[None]:
        """Report unknown names under another code (message: with {} for the name)."""
        before, self._unknown = self._unknown, (code, message)
        try:
            yield
        finally:
            self._unknown = before

    @contextmanager
    def loop(self, name: str, first: Node, last: Node, unique: bool = False) -> Iterator[Loop]:
        """Bring a loop variable into sight; unique: under a name that no other loop has."""
        inner = name
        if unique or any(loop.index == name for loop in self._loops):
            self._names[name] = self._names.get(name, 0) + 1
            inner = f"{name}_{self._names[name]}"
        before = self._bound
        loop = Loop(inner, first, last)
        self._bound = {**before, name: Typed(ex.index(inner), NONE)}
        self._loops.append(loop)
        try:
            yield loop
        finally:
            self._loops.pop()
            self._bound = before

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The loops around the present statement, outermost first."""
        return tuple(self._loops)

    def bound_loops(self) -> list[str]:
        """Names of the loop variables in sight, as written."""
        return [n for n, v in self._bound.items() if v.node.op == "index"]

    def place(self, span: syntax.Span) -> Place:
        """A span of the present text."""
        return Place(self.source, span)

    def fail(self, code: str, message: str, span: syntax.Span, **more: object) -> Failed:
        """Report an error; raise what is returned."""
        self.report.error(code, message, self.place(span), **more)  # type: ignore[arg-type]
        return Failed()

    # -- entries -------------------------------------------------------------------------------------------

    def scalar(self, expression: syntax.Expr) -> Typed:
        """A scalar value of any dimension."""
        value = self.resolve(expression)
        if isinstance(value, Vector):
            raise self.fail("E203", "an array stands where one number is wanted", expression.span)
        if value.truth:
            raise self.fail("E203", "a condition stands where a number is wanted", expression.span)
        return value

    def wanted(self, expression: syntax.Expr, dimension: Dimension, code: str, message: str) -> Node:
        """A scalar of one dimension; otherwise code with message (its {} is what was found)."""
        value = self.scalar(expression)
        if value.dimension is not None and value.dimension != dimension:
            raise self.fail(code, message.format(dim.show(value.dimension)), expression.span)
        return value.node

    def condition(self, expression: syntax.Expr) -> Node:
        """A condition."""
        value = self.resolve(expression)
        if isinstance(value, Vector) or not value.truth:
            raise self.fail("E203", "a condition is wanted here: a comparison such as a < b", expression.span)
        return value.node

    def whole_number(self, expression: syntax.Expr, what: str) -> Node:
        """An index or a bound: made of whole numbers, loop variables and dimensionless parameters."""
        value = self.scalar(expression)
        if value.dimension not in (None, NONE):
            raise self.fail("E805", f"{what} is in {dim.show(value.dimension)}, not a number", expression.span)
        for node in ex.topological([value.node]):
            if node.op in ("var", "time", "table"):
                raise self.fail("E807", f"{what} depends on '{node}', which is no constant", expression.span)
            if node.op == "param" and node.data in self.inputs:
                raise self.fail("E807", f"{what} depends on the input '{node.data}', which may vary", expression.span, help="a param")
            if node.op == "param":
                self.whole.add(node.data)
            if node.op == "const" and node.data != node.data:
                raise Failed
        return value.node

    def resolve(self, expression: syntax.Expr) -> Value:
        """The value of an expression."""
        return _RULES[type(expression)](self, expression)

    # -- leaves --------------------------------------------------------------------------------------------

    def _number(self, e: syntax.Number) -> Value:
        return Typed(ex.const(e.value), None if e.value == 0.0 else NONE)

    def _quantity(self, e: syntax.Quantity) -> Value:
        unit = read_unit(e.unit, self.scope, self.source, self.report)
        if unit is None:
            raise Failed
        if unit.offset:
            raise self.fail(
                "E201", "degC is no unit of a quantity: its zero is not 0 K", e.span, help=f"celsius({e.text})"
            )
        self._looks_like_division(e)
        value = e.value if unit.scale == 1 else float(Fraction(e.text) * unit.scale)
        return Typed(ex.const(value), unit.dimension)

    def _looks_like_division(self, e: syntax.Quantity) -> None:
        """W201: the last unit has the name and the dimension of a variable in sight."""
        last = e.unit.factors[-1]
        if len(e.unit.factors) < 2 or last.op != "/" or last.exponent != 1:
            return
        symbol = self.scope.find(last.name)
        own = known(last.name)
        if isinstance(symbol, ParameterSymbol) and not symbol.shape and own is not None and symbol.dimension == own[0]:
            before = e.unit.text.rpartition("/")[0]
            message = f"in '{e.text} {e.unit.text}' {last.name} is the unit; a variable {last.name} is in scope"
            help_ = f"'{e.text} {before} / {last.name}' divides by it"
            self.report.warning("W201", message, self.place(e.span), help=help_)

    def _bool(self, e: syntax.Bool) -> Value:
        return Typed(ex.compare("==", ex.const(float(e.value)), ex.const(1.0)), NONE, truth=True)

    def _text(self, e: syntax.Text) -> Value:
        raise self.fail("E203", "a text stands where a value is wanted", e.span)

    def _name(self, e: syntax.Name) -> Value:
        name = e.name
        if name in self._bound:
            return self._bound[name]
        symbol = self.scope.find(name)
        if symbol is None:
            return self._predefined(name, e.span)
        return self._symbol(symbol, e.span)

    def _predefined(self, name: str, span: syntax.Span) -> Value:
        match name:
            case "t":
                return Typed(ex.time(), dim.TIME)
            case "pi":
                return Typed(ex.const(math.pi), NONE)
            case "inf":
                return Typed(ex.const(math.inf), None)
            case "ground" | "audit":
                members = "its nodes' potential is zero" if name == "ground" else "write audit.energy or another member"
                raise self.fail("E104", f"'{name}' is not a value", span, help=members)
        if self.statics and name in STATICS:
            return Typed(ex.param(f"static {name}"), NONE)
        raise self.unknown(name, span)

    def unknown(self, name: str, span: syntax.Span) -> Failed:
        """Report E101 (E908 among static quantities)."""
        if self.scope.is_broken(name):
            return Failed()
        if self.statics:
            return self.fail("E908", f"unknown static quantity '{name}'", span, help=f"one of {', '.join(STATICS)}")
        near = nearest(name, (*self.scope.names(), *self._bound, "t", "pi", "inf"))
        return self.fail(
            "E101", f"unknown name '{name}'", span, help=f"nearest name in scope: '{near}'" if near else None
        )

    def _symbol(self, symbol: Symbol, span: syntax.Span) -> Value:
        match symbol:
            case ParameterSymbol():
                return self._parameter(symbol, span)
            case UnknownSymbol():
                return self._expanded(symbol, span) if symbol.shape else self._element(symbol, ())
            case Definition():
                return self.definition(symbol, self._implied(symbol, span) if symbol.implied else None)
            case ConstraintSymbol():
                members = "multiplier, residual, on(...)"
                raise self.fail(
                    "E104", f"constraint '{symbol.name}' is not a value", span, help=f"write its member: {members}"
                )
            case Unsupported():
                raise self._not_yet(symbol, span)
            case DomainSymbol() | BundleSymbol() | ComponentSymbol() | TableSymbol() | FunctionSymbol():
                raise self.fail("E104", f"'{symbol.name}' is not a value", span)

    def _not_yet(self, symbol: Unsupported, span: syntax.Span) -> Failed:
        """The declaration has been reported as N608; an imported component is no value at all."""
        if symbol.what == "library component":
            return self.fail("E104", f"'{symbol.name}' is a component, not a value", span)
        return Failed()

    def _implied(self, symbol: Definition, span: syntax.Span) -> tuple[Node, ...]:
        if not all(name in self._bound for name in symbol.at):
            raise self.fail("E101", f"'{symbol.name}' is known only inside its 'for {symbol.at[-1]}'", span)
        return tuple(self._bound[name].node for name in symbol.at)

    def _parameter(self, symbol: ParameterSymbol, span: syntax.Span) -> Value:
        if symbol.shape:
            return self._expanded(symbol, span)
        node = ex.param(symbol.name)
        if symbol.truth:
            return Typed(ex.compare("!=", node, ex.const(0.0)), NONE, truth=True)
        return Typed(node, symbol.dimension)

    def _expanded(self, symbol: ParameterSymbol | UnknownSymbol, span: syntax.Span) -> Vector:
        """A whole array as a value: only where its bounds are written as numbers."""
        if len(symbol.shape) != 1 or not all(ex.is_const(b) for b in symbol.shape[0]):
            help_ = f"{symbol.name}[i] in a sum or a 'for'"
            raise self.fail("E806", f"'{symbol.name}' is an array: name the element", span, help=help_)
        first, last = (int(b.data) for b in symbol.shape[0])
        items = [self._element(symbol, (ex.const(i),)) for i in range(first, last + 1)]
        return Vector(tuple(items), first)

    def _element(self, symbol: ParameterSymbol | UnknownSymbol, at: tuple[Node, ...]) -> Typed:
        if isinstance(symbol, ParameterSymbol):
            return Typed(ex.param(symbol.name, *at), symbol.dimension)
        return Typed(ex.var(symbol.name, symbol.kind, *at), symbol.dimension)

    # -- definitions ---------------------------------------------------------------------------------------

    def definition(self, symbol: Definition, at: tuple[Node, ...] | None = None) -> Value:
        """The value of a let, output, input or const, inlined; at: indices of a family's element."""
        value = self._template(symbol)
        if at is None:
            return value
        if isinstance(value, Vector):
            return _pick(value, at)
        change = {ex.index(f"{symbol.name}.{name}"): node for name, node in zip(symbol.at, at, strict=True)}
        return Typed(ex.substitute(value.node, change), value.dimension, value.truth)

    def _template(self, symbol: Definition) -> Value:
        if symbol in self._active:
            chain = [s.name for s in self._active[self._active.index(symbol) :]] + [symbol.name]
            place = Place(symbol.source, symbol.span)
            help_ = "break it with a state or an implicit closed by a gamma"
            self.report.error("E105", f"circular definition: {' -> '.join(chain)}", place, help=help_)
            raise Failed
        if symbol in self._values:
            value = self._values[symbol]
            if value is _BAD:
                raise Failed
            return value
        bound, loops = self._bound, self._loops
        self._bound = {n: Typed(ex.index(f"{symbol.name}.{n}"), NONE) for n in symbol.at}
        self._loops = []
        self._active.append(symbol)
        self._values[symbol] = _BAD
        try:
            with self.within(self.scope if symbol.kind != "const" else self._file_scope(), symbol.source):
                value = self.resolve(symbol.expression)
                self._declared(symbol, value)
                self._values[symbol] = value
        finally:
            self._bound, self._loops = bound, loops
            self._active.pop()
        return value

    def _file_scope(self) -> Scope:
        scope = self.scope
        return scope.outer if scope.outer is not None and scope.outer.outer is not None else scope

    def _declared(self, symbol: Definition, value: Value) -> None:
        if symbol.dimension is None or not isinstance(value, Typed) or value.dimension in (None, symbol.dimension):
            return
        message = (
            f"input '{symbol.name}' is declared {dim.show(symbol.dimension)} but set to {dim.show(value.dimension)}"
        )
        raise self.fail("E207", message, symbol.expression.span)

    # -- composed ------------------------------------------------------------------------------------------

    def _group(self, e: syntax.Group) -> Value:
        return self.resolve(e.expr)

    def _item(self, e: syntax.Item) -> Value:
        if isinstance(e.base, syntax.Name):
            symbol = None if e.base.name in self._bound else self.scope.find(e.base.name)
            if isinstance(symbol, (ParameterSymbol, UnknownSymbol)):
                return self._indexed(symbol, e)
            if isinstance(symbol, Definition) and symbol.at and not symbol.implied:
                if len(e.indices) != len(symbol.at):
                    raise self._index_count(symbol.name, len(symbol.at), e)
                return self.definition(symbol, tuple(self._index(i) for i in e.indices))
        value = self.resolve(e.base)
        if not isinstance(value, Vector):
            raise self.fail("E805", "only an array has elements", e.span)
        if len(e.indices) != 1:
            raise self._index_count("the array", 1, e)
        index = e.indices[0]
        if isinstance(index, syntax.Range):
            return self._slice(value, index)
        return self._vector_item(value, self._index(index), index.span)

    def _vector_item(self, value: Vector, at: Node, span: syntax.Span) -> Typed:
        if not ex.is_const(at):
            if at.op == "index":
                return _pick(value, (at,))
            raise self.fail("E806", "an array written as a list is indexed by a number or a loop variable", span)
        k = int(at.data) - value.first
        if not 0 <= k < len(value.items):
            last = value.first + len(value.items) - 1
            raise self.fail("E805", f"index {at} is outside {value.first}..{last}", span)
        return value.items[k]

    def _slice(self, value: Vector, index: syntax.Range) -> Vector:
        bounds = [self._index(b) for b in (index.lower, index.upper)]
        if not all(ex.is_const(b) for b in bounds):
            raise self.fail("E806", "the bounds of a slice are numbers", index.span)
        first, last = (int(b.data) for b in bounds)
        return Vector(tuple(self._vector_item(value, ex.const(k), index.span) for k in range(first, last + 1)), first)

    def _index_count(self, name: str, count: int, e: syntax.Item) -> Failed:
        plural = "index" if count == 1 else "indices"
        return self.fail("E805", f"'{name}' has {count or 'no'} {plural}, {len(e.indices)} given", e.span)

    def _indexed(self, symbol: ParameterSymbol | UnknownSymbol, e: syntax.Item) -> Value:
        if len(e.indices) != len(symbol.shape):
            raise self._index_count(symbol.name, len(symbol.shape), e)
        if any(isinstance(i, syntax.Range) for i in e.indices):
            if len(e.indices) == 1:
                return self._slice(self._expanded(symbol, e.span), e.indices[0])  # type: ignore[arg-type]
            raise self.fail("E806", "a slice of an array with several indices", e.span)
        at = tuple(self._index(i) for i in e.indices)
        for node, shape, index in zip(at, symbol.shape, e.indices, strict=True):
            self.uses.append(Use(shape, node, self.loops, symbol.name, self.place(index.span)))
        return self._element(symbol, at)

    def _index(self, index: syntax.Index) -> Node:
        """An affine index: loop variable + constant."""
        if isinstance(index, syntax.Range):
            raise self.fail("E806", "one element is wanted here, not a slice", index.span)
        node = self.whole_number(index, "an index")
        loops = [n for n in ex.topological([node]) if n.op == "index"]
        if loops:
            rest = node
            for n in loops[:1]:
                rest = ex.sub(node, n)
            if len(loops) > 1 or any(n.op == "index" for n in ex.topological([rest])):
                message = f"index {node} is not affine in one loop variable: the array would have to be unrolled"
                raise self.fail("E806", message, index.span, help="i + c, or a table over the index")
        return node

    def _prime(self, e: syntax.Prime) -> Value:
        base = e.base.expr if isinstance(e.base, syntax.Group) else e.base
        value = self.resolve(base)
        if isinstance(value, Vector):
            raise self.fail("E203", "an array stands where one number is wanted", e.span)
        dimension = None if value.dimension is None else dim.quotient(value.dimension, dim.TIME)
        return Typed(self.rate(value.node, e.span), dimension)

    def rate(self, node: Node, span: syntax.Span) -> Node:
        """The time derivative of a node."""
        try:
            return ex.time_derivative(node)
        except ValueError as error:
            raise self.fail("E518", f"{error} has no time derivative among the variables", span) from None

    def _sum(self, e: syntax.Sum) -> Value:
        values = [self.resolve(t) for _, t in e.terms]
        if any(isinstance(v, Vector) for v in values):
            return self._vector_sum(e, values)
        found: Dimension | None = None
        where = e.terms[0][1]
        for (_, term), value in zip(e.terms, values, strict=True):
            assert isinstance(value, Typed)
            self._is_number(value, term)
            if value.dimension is None:
                continue
            if found is None:
                found, where = value.dimension, term
            elif value.dimension != found:
                message = f"the two operands differ: {dim.show(found)} + {dim.show(value.dimension)}"
                related = (Related(dim.show(found), self.place(where.span)),)
                raise self.fail("E203", message, term.span, related=related, help=self.missing(found, value.dimension))
        signs = [-1.0 if s == "-" else 1.0 for s, _ in e.terms]
        return Typed(ex.linear(0.0, zip(signs, (v.node for v in values), strict=True)), found)  # type: ignore[union-attr]

    def _vector_sum(self, e: syntax.Sum, values: Sequence[Value]) -> Value:
        total = None
        for (sign, term), value in zip(e.terms, values, strict=True):
            if not isinstance(value, Vector) or (total is not None and len(value.items) != len(total)):
                raise self.fail("E203", "an array is added to something of another size", term.span)
            signed = [Typed(ex.neg(v.node) if sign == "-" else v.node, v.dimension) for v in value.items]
            total = (
                signed if total is None else [self._add(a, b, term.span) for a, b in zip(total, signed, strict=True)]
            )
        return Vector(tuple(total or ()))

    def _add(self, a: Typed, b: Typed, span: syntax.Span) -> Typed:
        if None not in (a.dimension, b.dimension) and a.dimension != b.dimension:
            raise self.fail("E203", f"the two operands differ: {dim.show(a.dimension)} + {dim.show(b.dimension)}", span)
        return Typed(ex.add(a.node, b.node), a.dimension if a.dimension is not None else b.dimension)

    def missing(self, have: Dimension | None, want: Dimension | None) -> str | None:
        """What factor would make two dimensions agree, and which parameter has it."""
        if have is None or want is None:
            return None
        for factor in (dim.quotient(want, have), dim.quotient(have, want)):
            level: Scope | None = self.scope
            while level is not None:
                for s in level.symbols.values():
                    if isinstance(s, ParameterSymbol) and not s.shape and factor and s.dimension == factor:
                        return f"the missing factor is in {dim.show(factor)}: '{s.name}'?"
                level = level.outer
        return None

    def _is_number(self, value: Typed, e: syntax.Expr) -> None:
        if value.truth:
            raise self.fail("E203", "a condition stands where a number is wanted", e.span)

    def _product(self, e: syntax.Product) -> Value:
        nodes: list[tuple[float, Node]] = []
        dimension: Dimension | None = NONE
        vector: Vector | None = None
        for op, factor in e.factors:
            value = self.resolve(factor)
            if isinstance(value, Vector):
                if vector is not None or op == "/":
                    raise self.fail(
                        "E203", "the product of two arrays is written dot(a, b) or cross(a, b)", factor.span
                    )
                vector = value
                continue
            self._is_number(value, factor)
            power = -1 if op == "/" else 1
            nodes.append((float(power), value.node))
            if value.dimension is None:
                dimension = None
            elif dimension is not None:
                dimension = multiply(dimension, value.dimension, power)
        node = ex.product(1.0, nodes)
        if vector is None:
            return Typed(node, dimension)
        items = []
        for v in vector.items:
            d = None if v.dimension is None or dimension is None else multiply(dimension, v.dimension)
            items.append(Typed(ex.mul(node, v.node), d))
        return Vector(tuple(items), vector.first)

    def _negative(self, e: syntax.Negative) -> Value:
        value = self.resolve(e.operand)
        if isinstance(value, Vector):
            return Vector(tuple(Typed(ex.neg(v.node), v.dimension) for v in value.items), value.first)
        self._is_number(value, e.operand)
        return Typed(ex.neg(value.node), value.dimension)

    def _power(self, e: syntax.Power) -> Value:
        base, exponent = self.scalar(e.base), self.scalar(e.exponent)
        if exponent.dimension not in (None, NONE):
            raise self.fail("E204", f"the exponent is in {dim.show(exponent.dimension)}", e.exponent.span)
        if not base.dimension:
            return Typed(ex.power(base.node, exponent.node), base.dimension if exponent.dimension else NONE)
        if not ex.is_const(exponent.node):
            message = f"the exponent must be a rational constant because the base is in {dim.show(base.dimension)}"
            raise self.fail("E204", message, e.exponent.span, help="make the base dimensionless")
        exact = Fraction(exponent.node.data).limit_denominator(1000)
        if abs(exact) > 100:
            raise self.fail("E204", f"the exponent {exponent.node} of a quantity is out of reason", e.exponent.span)
        power: Fraction | int = int(exact) if exact.denominator == 1 else exact
        dimension = tuple((k, int(v) if v == int(v) else v) for k, v in raised(base.dimension, power))
        return Typed(ex.power(base.node, exponent.node), dimension)

    # -- conditions ----------------------------------------------------------------------------------------

    def _compare(self, e: syntax.Compare) -> Value:
        left, right = self.resolve(e.left), self.resolve(e.right)
        if isinstance(left, Vector) or isinstance(right, Vector):
            raise self.fail("E203", "arrays are not compared", e.span)
        if left.truth or right.truth:
            raise self.fail("E203", "a condition is not compared", e.span, help="and, or, not")
        if None not in (left.dimension, right.dimension) and left.dimension != right.dimension:
            message = f"the two operands differ: {dim.show(left.dimension)} {e.op} {dim.show(right.dimension)}"
            raise self.fail("E203", message, e.span)
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
            raise self.fail("E203", message, e.span)
        dimension = then.dimension if then.dimension is not None else other.dimension
        return Typed(ex.conditional(test, then.node, other.node), dimension)

    # -- calls ---------------------------------------------------------------------------------------------

    def _array(self, e: syntax.Array) -> Value:
        return Vector(tuple(self.scalar(i) for i in e.items))

    def _reduction(self, e: syntax.Reduction) -> Value:
        first, last = self.whole_number(e.lower, "a bound"), self.whole_number(e.upper, "a bound")
        if self._indexes_list(e):
            return self._unrolled(e, first, last)
        with self.loop(e.index.name, first, last, unique=True) as loop:
            body = self.scalar(e.body)
        if e.op == "prod" and body.dimension:
            raise self.fail("E203", "the factors of a product over a range are dimensionless", e.body.span)
        return Typed(ex.reduction(e.op, loop.index, first, last, body.node), body.dimension)

    def _indexes_list(self, e: syntax.Reduction) -> bool:
        """Whether the body takes elements of an array whose items were written out one by one."""
        for inner in walk(e.body):
            if isinstance(inner, syntax.Item) and isinstance(inner.base, syntax.Name):
                symbol = self.scope.find(inner.base.name)
                if isinstance(symbol, Definition) and not symbol.at:
                    return True
        return False

    def _unrolled(self, e: syntax.Reduction, first: Node, last: Node) -> Value:
        if not (ex.is_const(first) and ex.is_const(last)):
            message = "the body takes elements of a list, so the bounds must be numbers"
            raise self.fail("E806", message, e.span, help="an array with a formula for its elements")
        before, values = self._bound, []
        for k in range(int(first.data), int(last.data) + 1):
            self._bound = {**before, e.index.name: Typed(ex.const(k), NONE)}
            try:
                values.append(self.scalar(e.body))
            finally:
                self._bound = before
        if not values:
            return Typed(ex.const(0.0 if e.op == "sum" else 1.0), None)
        total = values[0]
        for value in values[1:]:
            if e.op == "sum":
                total = self._add(total, value, e.body.span)
            elif e.op == "prod":
                d = None if None in (total.dimension, value.dimension) else multiply(total.dimension, value.dimension)  # type: ignore[arg-type]
                total = Typed(ex.mul(total.node, value.node), d)
            else:
                total = Typed(ex.call(e.op, total.node, value.node), total.dimension)
        return total

    def _call(self, e: syntax.Call) -> Value:
        for arg in e.args:
            if arg.name is not None:
                raise self.fail("E404", f"functions take their arguments by position, not '{arg.name} ='", arg.span)
        symbol = self.scope.find(e.name)
        if isinstance(symbol, FunctionSymbol):
            return self._function(symbol, e)
        if isinstance(symbol, TableSymbol):
            return self._table(symbol, e)
        if e.name in ("dot", "cross", "norm"):
            return self._vector_call(e)
        if e.name not in dim.FUNCTIONS:
            near = nearest(e.name, (*dim.FUNCTIONS, *self.scope.names(), "sum", "prod", "dot", "cross", "norm"))
            help_ = f"nearest name in scope: '{near}'" if near else None
            if self.scope.is_broken(e.name):
                raise Failed
            raise self.fail("E101", f"unknown function '{e.name}'", e.span, help=help_)
        return self._builtin(e)

    def _builtin(self, e: syntax.Call) -> Value:
        name = e.name
        count, _ = dim.FUNCTIONS[name]
        values: list[Typed] = []
        for arg in e.args:
            value = self.resolve(arg.value)
            values += list(value.items) if isinstance(value, Vector) and count == -1 else [self.scalar(arg.value)]
        if (count == -1 and not values) or (count >= 0 and len(values) != count):
            wants = "at least one argument" if count == -1 else f"{count} argument{'s' * (count != 1)}"
            raise self.fail("E206", f"{name} takes {wants}, {len(values)} given", e.span)
        common: Dimension | None = None
        for k, value in enumerate(values):
            where = e.args[min(k, len(e.args) - 1)].value
            if dim.wants_plain(name) and value.dimension not in (None, NONE):
                self._not_plain(name, value.dimension, where)
            if value.dimension is not None and common is None:
                common = value.dimension
            elif value.dimension is not None and value.dimension != common:
                message = f"the arguments of {name} differ: {dim.show(common)} and {dim.show(value.dimension)}"
                raise self.fail("E206", message, where.span)
        if name == "setsign":
            raise self.fail("N608", "setsign is not supported yet (planned: events and inequalities)", e.span)
        if name == "celsius":
            return Typed(ex.add(values[0].node, ex.const(273.15)), dim.result(name, NONE))
        return Typed(ex.call(name, *(v.node for v in values)), dim.result(name, common))

    def _not_plain(self, name: str, dimension: Dimension | None, e: syntax.Expr) -> None:
        text = self.source.text[e.span.start : e.span.end]
        help_ = f"{name}({text}/(1 {dim.show(dimension)}))" if len(text) < 60 else None
        raise self.fail("E205", f"the argument of {name} is in {dim.show(dimension)}", e.span, help=help_)

    def _vector_call(self, e: syntax.Call) -> Value:
        wanted = 1 if e.name == "norm" else 2
        values = [self.resolve(a.value) for a in e.args]
        if len(values) != wanted or not all(isinstance(v, Vector) for v in values):
            raise self.fail("E206", f"{e.name} takes {wanted} array{'s' * (wanted > 1)}", e.span)
        a = values[0].items  # type: ignore[union-attr]
        b = values[-1].items  # type: ignore[union-attr]
        if len(a) != len(b) or (e.name == "cross" and len(a) != 3):
            raise self.fail("E206", f"the arrays of {e.name} have {len(a)} and {len(b)} elements", e.span)
        if e.name == "cross":
            at = ((1, 2), (2, 0), (0, 1))
            return Vector(tuple(self._add(_times(a[i], b[j]), _minus(_times(a[j], b[i])), e.span) for i, j in at))
        total = _times(a[0], b[0])
        for x, y in zip(a[1:], b[1:], strict=True):
            total = self._add(total, _times(x, y), e.span)
        if e.name == "dot":
            return total
        return Typed(ex.sqrt(total.node), None if total.dimension is None else dim.halved(total.dimension))

    def _arguments(self, name: str, heads: Sequence[tuple[str, Dimension]], e: syntax.Call) -> list[Node]:
        if len(heads) != len(e.args):
            raise self.fail("E206", f"{name} takes {len(heads)} arguments, {len(e.args)} given", e.span)
        nodes = []
        for (head, dimension), arg in zip(heads, e.args, strict=True):
            message = f"argument '{head}' of {name} is in {{}}, wants {dim.show(dimension)}"
            nodes.append(self.wanted(arg.value, dimension, "E206", message))
        return nodes

    def _table(self, symbol: TableSymbol, e: syntax.Call) -> Value:
        return Typed(ex.table(symbol.name, *self._arguments(symbol.name, symbol.arguments, e)), symbol.result)

    def _function(self, symbol: FunctionSymbol, e: syntax.Call) -> Value:
        definition = symbol.definition
        file_scope = self._file_scope()
        with self.within(file_scope, symbol.source):
            units = [read_unit(p.unit, file_scope, symbol.source, self.report) for p in definition.params]
            result = read_unit(definition.result, file_scope, symbol.source, self.report)
        if result is None or None in units:
            raise Failed
        nodes = self._arguments(
            definition.name.name, [(p.name, u.dimension) for p, u in zip(definition.params, units, strict=True) if u], e
        )
        marker = Definition(
            definition.name.name, "fn", definition.value, (), None, symbol.source, symbol.place, definition.name.span
        )
        if any(s.kind == "fn" and s.expression is definition.value for s in self._active):
            raise self.fail("E105", f"circular definition: {marker.name} -> {marker.name}", e.span)
        bound, loops = self._bound, self._loops
        self._active.append(marker)
        self._loops = []
        self._bound = {
            p.name: Typed(n, u.dimension) for p, n, u in zip(definition.params, nodes, units, strict=True) if u
        }
        try:
            with self.within(file_scope, symbol.source):
                message = f"function '{marker.name}' is declared {dim.show(result.dimension)} but its value is {{}}"
                node = self.wanted(definition.value, result.dimension, "E207", message)
        finally:
            self._bound, self._loops = bound, loops
            self._active.pop()
        return Typed(node, result.dimension)

    # -- members -------------------------------------------------------------------------------------------

    def _member(self, e: syntax.Member) -> Value:
        if isinstance(e.base, syntax.Name) and e.base.name == "audit" and self.scope.find("audit") is None:
            if e.name not in AUDIT:
                raise self._no_member("audit", e, AUDIT)
            return Typed(ex.var(e.name, "audit"), AUDIT[e.name])
        root, indices = _root(e.base)
        symbol = None if root is None else self.scope.find(root.name)
        if root is not None and symbol is None and root.name not in self._bound:
            raise self.unknown(root.name, root.span)
        if isinstance(symbol, UnknownSymbol) and symbol.kind == "q" and isinstance(e.base, (syntax.Name, syntax.Item)):
            return self._coordinate_member(symbol, e)
        if isinstance(symbol, ConstraintSymbol):
            return self._constraint_member(symbol, indices, e)
        if isinstance(symbol, Unsupported):
            raise self._not_yet(symbol, e.span)
        raise self.fail("E102", f"'{root.name if root else 'this'}' has no member '{e.name}'", e.span)

    def _no_member(self, owner: str, e: syntax.Member, members: Sequence[str] | dict[str, Dimension]) -> Failed:
        return self.fail("E102", f"'{owner}' has no member '{e.name}'", e.span, help=f"it has {', '.join(members)}")

    def _coordinate_member(self, symbol: UnknownSymbol, e: syntax.Member) -> Value:
        value = self.scalar(e.base)
        family = value.node.data[0]
        assert symbol.domain is not None
        at = value.node.args
        domain = symbol.domain
        match e.name:
            case "q" if not symbol.complementary:
                return value
            case "p" if symbol.complementary:
                return value
            case "f" if not symbol.complementary:
                return Typed(ex.var(family, "f", *at), domain.flow.dimension)
            case "e" if symbol.complementary:
                return Typed(ex.var(family, "f", *at), domain.effort.dimension)
            case "p":
                return Typed(ex.var(family, "p", *at), domain.momentum.dimension)
        raise self._no_member(symbol.name, e, ("q", "f", "p"))

    def _constraint_member(
        self, symbol: ConstraintSymbol, indices: tuple[syntax.Index, ...], e: syntax.Member
    ) -> Value:
        at = tuple(self._index(i) for i in indices)
        constraint, expression = self.constraint(symbol, at, e.span)
        if e.name == "residual":
            return Typed(expression, constraint.unit.dimension)
        if e.name != "multiplier":
            raise self._no_member(symbol.name, e, ("multiplier", "residual", "on(...)"))
        if symbol.kind == "gamma":
            raise self.fail("E102", f"gamma '{symbol.name}' has no multiplier: it closes an implicit unknown", e.span)
        return Typed(self.multiplier(symbol, at), self._multiplier_dimension(symbol, constraint))

    def multiplier(self, symbol: ConstraintSymbol, at: tuple[Node, ...]) -> Node:
        """The multiplier of a phi or psi as an unknown."""
        return ex.var(symbol.name, "kappa" if symbol.kind == "phi" else "mu", *at)

    def _multiplier_dimension(self, symbol: ConstraintSymbol, constraint: Constraint) -> Dimension:
        return dim.quotient(dim.ENERGY if symbol.kind == "phi" else dim.POWER, constraint.unit.dimension)

    def constraint(self, symbol: ConstraintSymbol, at: tuple[Node, ...], span: syntax.Span) -> tuple[Constraint, Node]:
        """The constraint of a label (its element `at`) and left - right there."""
        found = self.constraints.get(symbol.name, [])
        if not found:
            raise Failed
        if len(found[0].at) != len(at):
            raise self.fail("E805", f"'{symbol.name}' has {len(found[0].at)} indices, {len(at)} given", span)
        for constraint in found:
            change: dict[Node, Node] = {}
            fits = True
            for own, asked in zip(constraint.at, at, strict=True):
                loop = [n for n in ex.topological([own]) if n.op == "index"]
                if loop:
                    change[loop[0]] = ex.add(asked, ex.sub(loop[0], own))
                else:
                    fits = fits and own is asked
            if fits:
                return constraint, ex.substitute(constraint.expression, change)
        raise self.fail("E805", f"'{symbol.name}' has no element [{', '.join(map(str, at))}]", span)

    def _method(self, e: syntax.Method) -> Value:
        root, indices = _root(e.base)
        symbol = None if root is None else self.scope.find(root.name)
        if not isinstance(symbol, ConstraintSymbol) or e.name != "on" or len(e.args) != 1 or symbol.kind == "gamma":
            raise self.fail("E102", f"there is no '{e.name}(...)' here", e.span, help="label.on(expr) of a phi or psi")
        at = tuple(self._index(i) for i in indices)
        _, residual = self.constraint(symbol, at, e.span)
        target = self.scalar(e.args[0].value)
        if target.dimension is None:
            raise self.fail("E203", "a constant has no displacement", e.args[0].span)
        node = reaction(residual, "q" if symbol.kind == "phi" else "f", target.node, self.multiplier(symbol, at))
        return Typed(node, dim.quotient(dim.ENERGY, target.dimension))


def reaction(residual: Node, kind: str, target: Node, multiplier: Node) -> Node:
    """Constraint effort along a displacement: -(d residual/dq) multiplier, projected on grad(target)."""
    top: list[Node] = []
    bottom: list[Node] = []
    for node in sorted((n for n in ex.variables(target) if n.op == "var"), key=lambda n: n.number):
        slope = ex.derivative(target, node)
        held = ex.var(node.data[0], kind, *node.args)
        top.append(ex.mul(ex.derivative(residual, held), slope))
        bottom.append(ex.mul(slope, slope))
    return ex.neg(ex.div(ex.mul(multiplier, ex.add(*top)), ex.add(*bottom)))


def walk(root: syntax.Expr) -> Iterator[object]:
    """All syntax nodes below an expression."""
    stack: list[object] = [root]
    while stack:
        node = stack.pop()
        yield node
        for name in getattr(type(node), "__slots__", ()):
            child = getattr(node, name)
            for part in child if isinstance(child, tuple) else (child,):
                for item in part if isinstance(part, tuple) else (part,):
                    if type(item).__module__.startswith("sysdyn.dsl.syntax"):
                        stack.append(item)


def _times(a: Typed, b: Typed) -> Typed:
    d = None if a.dimension is None or b.dimension is None else multiply(a.dimension, b.dimension)
    return Typed(ex.mul(a.node, b.node), d)


def _minus(a: Typed) -> Typed:
    return Typed(ex.neg(a.node), a.dimension)


def _pick(value: Vector, at: tuple[Node, ...]) -> Typed:
    """The item of a list at a loop variable, as nested conditionals (observations of small lists)."""
    node = value.items[-1].node
    for k in range(len(value.items) - 2, -1, -1):
        node = ex.conditional(ex.compare("==", at[0], ex.const(value.first + k)), value.items[k].node, node)
    return Typed(node, value.items[0].dimension)


def _root(e: syntax.Expr) -> tuple[syntax.Name | None, tuple[syntax.Index, ...]]:
    """The name that a member hangs on, and the indices between."""
    indices: tuple[syntax.Index, ...] = ()
    while isinstance(e, (syntax.Item, syntax.Member, syntax.Prime)):
        if isinstance(e, syntax.Item):
            indices = e.indices
        e = e.base
    return (e, indices) if isinstance(e, syntax.Name) else (None, indices)


_RULES: dict[type, Callable[[Resolver, object], Value]] = {
    syntax.Number: Resolver._number,
    syntax.Quantity: Resolver._quantity,
    syntax.Text: Resolver._text,
    syntax.Bool: Resolver._bool,
    syntax.Name: Resolver._name,
    syntax.Group: Resolver._group,
    syntax.Member: Resolver._member,
    syntax.Item: Resolver._item,
    syntax.Prime: Resolver._prime,
    syntax.Call: Resolver._call,
    syntax.Method: Resolver._method,
    syntax.Reduction: Resolver._reduction,
    syntax.Sum: Resolver._sum,
    syntax.Product: Resolver._product,
    syntax.Negative: Resolver._negative,
    syntax.Power: Resolver._power,
    syntax.Compare: Resolver._compare,
    syntax.And: Resolver._and,
    syntax.Or: Resolver._or,
    syntax.Not: Resolver._not,
    syntax.Conditional: Resolver._conditional,
    syntax.Array: Resolver._array,
}  # type: ignore[dict-item]
