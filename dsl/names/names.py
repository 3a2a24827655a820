"""Names and what stands behind them: quantities, parameters, unknowns, definitions, elements of arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cache

from sysdyn.dsl.model import budget
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import time_derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.units import NONE, find_unit
from sysdyn.dsl.names import habits
from sysdyn.dsl.names.context import Context, Use, Value
from sysdyn.dsl.names.failures import Failed, NotYetError, SeveralError, circular
from sysdyn.dsl.names.symbols import (
    BranchSymbol,
    BundleNode,
    BundleSymbol,
    ComponentSymbol,
    ConstraintSymbol,
    Definition,
    DomainSymbol,
    FunctionSymbol,
    InstanceSymbol,
    NodeSymbol,
    ParameterSymbol,
    PortSymbol,
    Symbol,
    TableSymbol,
    TwoPortSymbol,
    Typed,
    UnknownSymbol,
    Unsupported,
    Vector,
    nearest,
)
from sysdyn.dsl.names.unit_reading import read_unit
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.tree import syntax

STATICS = ("coordinates", "m1", "m2", "dof", "configuration_dof", "redundant", "order", "manifold", "index")
VALUES = ("t", "pi", "inf")
"""Words of the language that are values, which the label of an element, no value by itself, does not hide."""
ELEMENTS = (BranchSymbol, TwoPortSymbol, InstanceSymbol)


def _times_scale(text: str, scale: Fraction) -> float:
    """The double nearest to a number, as written, times a scale."""
    power = _power_of_ten(scale)
    if power is None or not text.replace(".", "").isdecimal():
        return float(Fraction(text) * scale)
    return float(f"{text}e{power}")


@cache
def _power_of_ten(scale: Fraction) -> int | None:
    """Its exponent, where the scale is one, as that of most units is."""
    digits = len(str(max(scale.numerator, scale.denominator))) - 1
    power = digits if scale > 1 else -digits
    return power if Fraction(10) ** power == scale else None


class NameResolver(Context):
    """Names, quantities, elements of arrays, inlined definitions."""

    # -- leaves --------------------------------------------------------------------------------------------

    def _number(self, e: syntax.Number) -> Value:
        return Typed(ex.const(e.value), None if e.value == 0.0 else NONE)

    def _quantity(self, e: syntax.QuantityLiteral) -> Value:
        """A number with its unit, in SI."""
        scope = self.scope.declaring
        key = id(scope), len(scope.units), e.text, e.unit.text
        known_ = self._quantities.get(key)
        if known_ is not None:
            self._looks_like_division(e)
            return known_[1]
        unit = read_unit(e.unit, self.scope, self.source, self.report, self._bound)
        if unit is None:
            raise Failed
        if unit.offset:
            help_ = f"celsius({e.text})"
            raise self.fail("E201", "degC is no unit of a quantity: its zero is not 0 K", e.span, help=help_)
        self._looks_like_division(e)
        value = e.value if unit.scale == 1 else _times_scale(e.text, unit.scale)
        found = Typed(ex.const(value), unit.dimension)
        if "$" not in e.unit.text:
            self._quantities[key] = scope, found
        return found

    def _looks_like_division(self, e: syntax.QuantityLiteral) -> None:
        """W201: the last unit has the name and the dimension of a variable in sight."""
        last = e.unit.factors[-1]
        if len(e.unit.factors) < 2 or last.op != "/" or last.exponent != 1:
            return
        symbol = self.scope.find(last.name)
        own = find_unit(last.name)
        if isinstance(symbol, ParameterSymbol) and not symbol.shape and own is not None and symbol.dimension == own[0]:
            before = e.unit.text.rpartition("/")[0]
            message = f"in '{e.text} {e.unit.text}' {last.name} is the unit; a variable {last.name} is in scope"
            help_ = f"'{e.text} {before} / {last.name}' divides by it"
            self.report.warning("W201", message, self.place(e.span), help=help_)

    def _bool(self, e: syntax.Bool) -> Value:
        return Typed(ex.compare("==", ex.const(float(e.value)), ex.const(1.0)), NONE, truth=True)

    def _text(self, e: syntax.Text) -> Value:
        raise self.fail("E203", "a text stands where a value is wanted", e.span, help="a number: texts are no values")

    def _group(self, e: syntax.Parenthesized) -> Value:
        return self.resolve(e.expr)

    def _name(self, e: syntax.Name) -> Value:
        if e.name in self._bound:
            return self._bound[e.name]
        symbol = self.scope.find(e.name)
        if symbol is None or (e.name in VALUES and isinstance(symbol, ELEMENTS)):
            return self._predefined_value(e.name, e.span)
        return self.value(symbol, e.span)

    def _predefined_value(self, name: str, span: syntax.Span) -> Value:
        """What a word of the language itself stands for: t, pi, inf."""
        match name:
            case "t":
                return Typed(ex.time(), dim.TIME)
            case "pi":
                return Typed(ex.const(math.pi), NONE)
            case "inf":
                return Typed(ex.const(math.inf), None)
            # names that have members only
            case "ground" | "audit":
                members = "its nodes' potential is zero" if name == "ground" else "write audit.energy or another member"
                raise self.fail("E104", f"'{name}' is not a value", span, help=members)
        if self.statics and name in STATICS:
            return Typed(ex.param(f"static {name}"), NONE)
        raise self.report_unknown(name, span)

    def report_unknown(self, name: str, span: syntax.Span) -> Failed:
        """Report a name that stands for nothing (E101, E905; E908 among static quantities)."""
        # its declaration is wrong and reported: no second finding
        if self.scope.is_broken(name):
            return Failed()
        if self.statics:
            return self.fail("E908", f"unknown static quantity '{name}'", span, help=f"one of {', '.join(STATICS)}")
        if name == "ground":
            text = "'ground' is not a value: it is the reference of every domain"
            return self.fail("E104", text, span, help="0: its effort, flow and displacement are zero")
        code, message = self._unknown
        # a name of other languages: `xdot`, `PI`
        remedy = habits.name(name, self.source.text, span.start, self._moves)
        if remedy is not None:
            return self.fail_with_remedy(code, message.format(name), span, remedy)
        if name in dim.FUNCTIONS:
            said = {"celsius": "celsius(20)"}.get(name, f"{name}(...)")
            return self.fail(code, message.format(name), span, help=f"a function: {said}")
        # a name that differs by little, or the line that would declare it
        near = nearest(name, (*self.scope.names(), *self._bound, "t", "pi", "inf"))
        near = None if code == "E905" and name in habits.RESULTS else near
        help_ = f"nearest name in scope: '{near}'" if near else f"declare it by param {name} = ..., let, coord or node"
        if find_unit(name) is not None:
            help_ += f"; the unit stands behind a number, with a space: 1 {name}"
        if code == "E905" and not near:
            help_ = habits.RESULTS.get(name, f"let {name} = ... in the model; sysdyn list FILE shows what can be read")
        return self.fail(code, message.format(name), span, help=help_, subject=f"name {name}")

    def _moves(self, name: str) -> bool:
        """Whether a name has a rate."""
        symbol = self.scope.find(name)
        return isinstance(symbol, UnknownSymbol) or (isinstance(symbol, Definition) and symbol.kind == "let")

    # -- symbols -------------------------------------------------------------------------------------------

    def value(self, symbol: Symbol, span: syntax.Span) -> Value:
        """What a symbol is worth by itself; E104 where it has members only."""
        match symbol:
            # a number or an unknown; an array as a list where its size is a number
            case ParameterSymbol() | UnknownSymbol():
                return self._array_value(symbol, span) if symbol.shape else self.element(symbol, ())
            # its expression, with the indices of the loops around
            case Definition():
                if symbol.at and not symbol.implied:
                    raise self._report_array(symbol.name, span)
                return self.definition(symbol, self._implicit_indices(symbol, span) if symbol.implied else None)
            case Unsupported():
                raise Failed  # its declaration has been reported as N608
            case BundleNode():
                names = ", ".join(f"{symbol.name}.{m}" for m in symbol.members)
                raise self.fail("E104", f"'{symbol.name}' is a bundle, not a value", span, help=f"its nodes: {names}")
            # nodes, constraints and elements: the member that may be meant
            case NodeSymbol() | PortSymbol():
                domain = symbol.domain if isinstance(symbol, NodeSymbol) else symbol.end.domain
                shown = " ".join(self.source.text[span.start : span.end].split())
                help_ = f"write {shown}.e (potential)" if domain.common == "effort" else f"write {shown}.q or {shown}.f"
                raise self.fail("E104", f"node '{symbol.name}' is not a value", span, help=help_)
            case ConstraintSymbol():
                help_ = "write its member: multiplier, residual, on(...)"
                raise self.fail("E104", f"constraint '{symbol.name}' is not a value", span, help=help_)
            case BranchSymbol() | TwoPortSymbol() | InstanceSymbol():
                said = symbol.spaces[0].scope.symbols if isinstance(symbol, InstanceSymbol) and symbol.spaces else {}
                outputs = [n for n, d in said.items() if isinstance(d, Definition) and d.kind == "output"]
                help_ = "a member: " + " or ".join(f"{symbol.name}.{n}" for n in outputs or ("e", "f"))
                raise self.fail("E104", f"element '{symbol.name}' is not a value", span, help=help_)
            # kinds of things, tables and functions without arguments
            case DomainSymbol() | BundleSymbol() | ComponentSymbol() | TableSymbol() | FunctionSymbol():
                remedy = habits.name(symbol.name, self.source.text, span.start, self._moves)
                message, called = f"'{symbol.name}' is not a value", None
                if isinstance(symbol, (TableSymbol, FunctionSymbol)):
                    heads = symbol.arguments if isinstance(symbol, TableSymbol) else symbol.definition.params
                    listed = ", ".join(head[0] if isinstance(head, tuple) else head.name for head in heads)
                    called = f"its value at an argument: {symbol.name}({listed})"
                if remedy:
                    raise self.fail_with_remedy("E104", message, span, remedy)
                raise self.fail("E104", message, span, help=called)

    def _implicit_indices(self, symbol: Definition, span: syntax.Span) -> tuple[Node, ...]:
        if not all(name in self._bound for name in symbol.at):
            help_ = f"behind its '}}' stands what is one of a kind; of all of them: sum({symbol.at[-1]} in 1..n: ...)"
            said = f"'{symbol.name}' is known only inside its 'for {symbol.at[-1]}'"
            raise self.fail("E101", said, span, help=help_)
        return tuple(v.node for name in symbol.at if isinstance(v := self._bound[name], Typed))

    def _array_value(self, symbol: ParameterSymbol | UnknownSymbol, span: syntax.Span) -> Vector:
        """A whole array as a value: where its bounds are written as numbers; of parameters with the sizes given."""
        bounds: tuple[Node, ...] = symbol.shape[0] if len(symbol.shape) == 1 else ()
        if isinstance(symbol, ParameterSymbol):
            bounds = tuple(self.with_sizes(b) for b in bounds)
        if not bounds or not all(ex.is_const(b) for b in bounds):
            raise self._report_array(symbol.name, span)
        return self._elements(symbol, bounds)

    def _elements(self, symbol: ParameterSymbol | UnknownSymbol, bounds: Sequence[Node]) -> Vector:
        """The elements between two constants."""
        first, last = (int(b.data) for b in bounds)
        budget.charge(budget.NODE * max(last - first, 0), f"the elements of '{symbol.name}' one by one")
        return Vector(tuple(self.element(symbol, (ex.const(i),)) for i in range(first, last + 1)), first)

    def _report_array(self, name: str, span: syntax.Span) -> Failed:
        """Report E806: an array where one of its elements is wanted."""
        return self.fail("E806", f"'{name}' is an array: name the element", span, help=f"{name}[i] in a sum or a 'for'")

    def element(self, symbol: ParameterSymbol | UnknownSymbol, at: tuple[Node, ...]) -> Typed:
        """One element of a parameter or unknown."""
        family = symbol.family
        at = (*family.prefix, *at)
        if isinstance(symbol, UnknownSymbol):
            return Typed(ex.var(family.name, symbol.kind, *at), symbol.dimension)
        node = ex.param(family.name, *at)
        if symbol.truth:
            return Typed(ex.compare("!=", node, ex.const(0.0)), NONE, truth=True)
        return Typed(node, symbol.dimension)

    # -- definitions ---------------------------------------------------------------------------------------

    def definition(self, symbol: Definition, at: tuple[Node, ...] | None = None) -> Value:
        """The value of a let, output, input or const, inlined; at: indices of a family's element."""
        value = self._template(symbol)
        given = zip(symbol.at, at or (), strict=False)
        change = {ex.index(f"{symbol.name}.{name}"): node for name, node in given}
        for node, (_, place) in self._derived[symbol, self.virtual].items():
            self.derived[ex.substitute(node, change)] = self.loops, place
        if at is None:
            return value
        if isinstance(value, Vector):
            return pick(value, at)
        return Typed(ex.substitute(value.node, change), value.dimension, value.truth)

    def _template(self, symbol: Definition) -> Value:
        """The expression of a definition, resolved once where it was written (where a loop runs over several statements
        of a label that it reads, in each of its parts); E105 where it needs itself.
        """
        # let a = b, let b = a
        if symbol in self._active:
            place = Place(symbol.space.source, symbol.span)
            message, help_ = circular(self._active[self._active.index(symbol) :])
            self.report.error("E105", message, place, help=help_)
            raise Failed
        key = symbol, self.virtual
        # resolved before; None: with an error, which is reported
        if key in self._values:
            value = self._values[key]
            if value is None:
                raise Failed
            return value
        self._values[key], before = None, self.chosen_read
        self._active.append(symbol)
        # loop variables of the definition stand for themselves until indices are given
        placeholders = {n: Typed(ex.index(f"{symbol.name}.{n}"), NONE) for n in symbol.at}
        try:
            loops = symbol.loops or symbol.space.loops
            sight = {**symbol.space.bound, **dict(symbol.bound), **placeholders}
            around = self.space(symbol.space), self.inside(loops, sight), self.aside()
            budget.check_depth(len(self._active), "definitions are")
            with around[0], around[1], around[2] as self._derived[key]:
                value = self.resolve(symbol.expression)
                value = self._check_declaration(symbol, value)
                if symbol.beside is not None and isinstance(value, Typed):
                    value = Typed(ex.add(value.node, symbol.beside), value.dimension, value.truth)
                if self.virtual and symbol.kind in ("output", "input"):
                    value = _signal(value)
        # a range over several statements of one label: its reader knows which part it means
        except SeveralError as several:
            del self._values[key]  # where it is read, the range is known
            if any(several.loop == n.node.data for n in placeholders.values()):
                raise self.spread(several, symbol.span) from None
            raise
        # reads what is not known yet: again when it is
        except NotYetError:
            del self._values[key]
            raise
        except budget.SpentError as spent:
            spent.place = spent.place or Place(symbol.space.source, symbol.span)
            raise
        finally:
            self._active.pop()
        self._values[key] = value
        # depends on the part of a loop that is read: not kept
        if self.chosen_read != before:
            del self._values[key]
        return value

    def _check_declaration(self, symbol: Definition, value: Value) -> Value:
        """A value as its declaration wants it: of its dimension (E207), an input's of its shape (E805)."""
        items = value.items if isinstance(value, Vector) else (value,)
        wrong = next((i.dimension for i in items if i.dimension not in (None, symbol.dimension)), None)
        # `input u: N = 3 m`
        if symbol.dimension is not None and wrong is not None:
            declared = dim.show(symbol.dimension)
            message = f"{symbol.kind} '{symbol.name}' is declared {declared} but set to {dim.show(wrong)}"
            help_ = self.missing(wrong, symbol.dimension, symbol.expression)
            raise self.fail("E207", message, symbol.expression.span, help=help_)
        # only an input says its size
        if symbol.kind != "input" or (not symbol.shape and isinstance(value, Typed)):
            return value
        message = f"input '{symbol.name}' is one number, not an array"
        # a list of the declared length
        if symbol.shape:
            (first, last), *others = symbol.shape
            size = last.data - first.data + 1 if ex.is_const(first) and ex.is_const(last) and not others else None
            if isinstance(value, Vector) and size == len(items):
                return Vector(value.items, int(first.data))
            known = "of numbers" if size is None else f"of {size:g}"
            found = f"{len(items)} of them" if isinstance(value, Vector) else "one number"
            message = f"input '{symbol.name}' is an array {known}, found {found}"
        help_ = "[a, b, ...]" if symbol.shape else "an element: x[1]"
        if symbol.shape and isinstance(value, Vector) and size is None:
            help_ = f"what varies is listed for a size that is a number: input {symbol.name}[1..{len(items)}]"
        raise self.fail("E805", message, symbol.expression.span, help=help_)

    # -- elements of arrays --------------------------------------------------------------------------------

    def element_of_list(self, value: Vector, at: Node, span: syntax.Span) -> Typed:
        """The item of an array written as a list."""
        if not ex.is_const(at):
            if at.op == "index":
                return pick(value, (at,))
            raise self.fail("E806", "an array written as a list is indexed by a number or a loop variable", span)
        k = int(at.data) - value.first
        if not 0 <= k < len(value.items):
            last = value.first + len(value.items) - 1
            raise self.fail("E805", f"index {at} is outside {value.first}..{last}", span)
        return value.items[k]

    def slice(self, value: Vector, index: syntax.Range) -> Vector:
        """The part of a list between two numbers."""
        bounds = [self.index(b) for b in (index.lower, index.upper)]
        if not all(ex.is_const(b) for b in bounds):
            raise self.fail("E806", "the bounds of a slice are numbers", index.span)
        first, last = (int(b.data) for b in bounds)
        items = (self.element_of_list(value, ex.const(k), index.span) for k in range(first, last + 1))
        return Vector(tuple(items), first)

    def index_count(self, name: str, count: int, given: int, span: syntax.Span) -> Failed:
        """Report E805: a wrong number of indices."""
        plural = "index" if count == 1 else "indices"
        help_ = f"an element of it: {name}[{', '.join('ij'[k % 2] for k in range(count))}]"
        if not count:
            help_ = f"{name} as it is; or declare an array, {name}[1..3]"
        message, subject = f"'{name}' has {count or 'no'} {plural}, {given} given", f"indices of {name}"
        return self.fail("E805", message, span, help=help_, subject=subject)

    def own_element(
        self, symbol: ParameterSymbol | UnknownSymbol, indices: tuple[syntax.Index, ...], span: syntax.Span
    ) -> Value:
        """`x[i]` of a parameter or unknown."""
        if any(isinstance(i, syntax.Range) for i in indices) and len(indices) == len(symbol.shape):
            if len(indices) == 1 and isinstance(indices[0], syntax.Range):
                return self._part(symbol, indices[0], span)
            raise self.fail("E806", "a slice of an array with several indices", span)
        return self.element(symbol, self.indices(symbol.name, symbol.shape, indices, span))

    def _part(self, symbol: ParameterSymbol | UnknownSymbol, index: syntax.Range, span: syntax.Span) -> Vector:
        """`x[1..3]`: the elements between two numbers, whatever size the array has."""
        bounds = [self.index(b) for b in (index.lower, index.upper)]
        if isinstance(symbol, ParameterSymbol):
            bounds = [self.with_sizes(b) for b in bounds]
        if not all(ex.is_const(b) for b in bounds):
            return self.slice(self._array_value(symbol, span), index)
        for bound in bounds:
            self.uses.append(Use(symbol.shape[0], bound, self.loops, symbol.name, self.place(index.span)))
        return self._elements(symbol, bounds)

    def indices(
        self, name: str, shape: tuple[tuple[Node, Node], ...], indices: tuple[syntax.Index, ...], span: syntax.Span
    ) -> tuple[Node, ...]:
        """Affine indices of a family, as many as it has (E805), remembered for the check against its shape."""
        if len(indices) != len(shape):
            raise self.index_count(name, len(shape), len(indices), span)
        at = tuple(self.index(i) for i in indices)
        for node, bounds, index in zip(at, shape, indices, strict=True):
            self.uses.append(Use(bounds, node, self.loops, name, self.place(index.span)))
        return at

    # -- rates ---------------------------------------------------------------------------------------------

    def _prime(self, e: syntax.Prime) -> Value:
        base = e.base.expr if isinstance(e.base, syntax.Parenthesized) else e.base
        value = self.resolve(base)
        if isinstance(value, Vector):
            return Vector(tuple(self._rate_of(v, e.span) for v in value.items), value.first)
        return self._rate_of(value, e.span)

    def _rate_of(self, value: Typed, span: syntax.Span) -> Typed:
        dimension = None if value.dimension is None else dim.quotient(value.dimension, dim.TIME)
        return Typed(self.rate(value.node, span), dimension)

    def rate(self, node: Node, span: syntax.Span) -> Node:
        """The time derivative of a node."""
        if node.op != "var":
            self.derived[node] = self.loops, self.place(span)
        try:
            return time_derivative(node)
        except ValueError as error:
            raise self.fail("E518", f"{error} has no time derivative among the variables", span) from None


def pick(value: Vector, at: tuple[Node, ...]) -> Typed:
    """The item of a list at a loop variable, as nested conditionals (observations of small lists)."""
    node = value.items[-1].node
    for k in range(len(value.items) - 2, -1, -1):
        node = ex.conditional(ex.compare("==", at[0], ex.const(value.first + k)), value.items[k].node, node)
    return Typed(node, value.items[0].dimension)


def _signal(value: Value) -> Value:
    """The value marked as one that virtual displacements hold."""
    if isinstance(value, Vector):
        return Vector(tuple(Typed(ex.signal(v.node), v.dimension) for v in value.items), value.first)
    return Typed(ex.signal(value.node), value.dimension, value.truth)
