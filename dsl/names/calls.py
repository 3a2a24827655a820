"""Functions, tables, reductions and arrays written as lists."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.dsl.model import budget
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Loop
from sysdyn.dsl.model.units import NONE, Dimension, multiply
from sysdyn.dsl.names import habits
from sysdyn.dsl.names.context import Context, Value
from sysdyn.dsl.names.failures import Failed, SeveralError
from sysdyn.dsl.names.symbols import (
    Definition,
    FunctionSymbol,
    ParameterSymbol,
    Space,
    TableSymbol,
    Typed,
    UnknownSymbol,
    Vector,
    nearest,
)
from sysdyn.dsl.names.unit_reading import read_unit
from sysdyn.dsl.tree import syntax
from sysdyn.dsl.tree.walking import children

Head = tuple[str, Dimension, int | None]
"""An argument in the head of a function or table: its name and dimension, of an array how many elements it has."""


class CallResolver(Context):
    """Functions, tables, reductions and arrays written as lists."""

    def _array(self, e: syntax.Array) -> Value:
        nested = next((i for i in e.items if isinstance(i, syntax.Array)), None)
        if nested is not None:
            help_ = "one row of values: [1, 2, 3]; of several indices one value for all, and --set M[1,2]=3"
            raise self.fail("E203", "a list stands in a list", nested.span, help=help_)
        return Vector(tuple(self.scalar(i) for i in e.items))

    def _reduction(self, e: syntax.Reduction) -> Value:
        first, last = self.whole_number(e.lower, "a bound"), self.whole_number(e.upper, "a bound")
        if self._indexes_list(e):
            return self._unroll(e, first, last)
        with self.loop(e.index.name, first, last, unique=True) as loop:
            return self._reduce_over(e, loop)

    def _reduce_over(self, e: syntax.Reduction, loop: Loop) -> Typed:
        """The reduction over a loop in sight, cut where it runs over several statements of one label."""
        try:
            body = self.scalar(e.body)
        except SeveralError as several:
            if several.loop != loop.index:
                raise
            parts = []
            for part in several.parts:
                with self.narrowing(several, part) as inner:
                    parts.append(self._reduce_over(e, inner))
            nodes = [p.node for p in parts]
            if e.op in ("sum", "prod"):
                return Typed(ex.add(*nodes) if e.op == "sum" else ex.mul(*nodes), parts[0].dimension)
            return Typed(ex.call(e.op, *nodes), parts[0].dimension)
        if e.op == "prod" and body.dimension:
            raise self.fail("E203", "the factors of a product over a range are dimensionless", e.body.span)
        return Typed(ex.reduction(e.op, loop.index, loop.first, loop.last, body.node), body.dimension)

    def _indexes_list(self, e: syntax.Reduction) -> bool:
        """Whether the body takes elements of an array whose items were written out one by one."""
        for inner in walk(e.body):
            if isinstance(inner, syntax.Item) and isinstance(inner.base, syntax.Name):
                if isinstance(self._bound.get(inner.base.name), Vector):
                    return True
                symbol = self.scope.find(inner.base.name)
                if isinstance(symbol, Definition) and not symbol.at:
                    return True
        return False

    def _unroll(self, e: syntax.Reduction, first: Node, last: Node) -> Value:
        """A reduction whose body takes elements of a list: written out, so that its bounds must be numbers (E806)."""
        if not (ex.is_const(first) and ex.is_const(last)):
            message = "the body takes elements of a list, so the bounds must be numbers"
            raise self.fail("E806", message, e.span, help="an array with a formula for its elements")
        budget.charge(budget.NODE * max(last.data - first.data, 0.0), "a range that is written out")
        before, values = self._bound, []
        # the body once for each number in place of the index
        for k in range(int(first.data), int(last.data) + 1):
            self._bound = {**before, e.index.name: Typed(ex.const(k), NONE)}
            try:
                values.append(self.scalar(e.body))
            finally:
                self._bound = before
        # an empty range: the neutral element
        if not values:
            return Typed(ex.const(0.0 if e.op == "sum" else 1.0), None)
        total = values[0]
        for value in values[1:]:
            if e.op == "sum":
                total = self.add(total, value, e.body.span)
            elif e.op == "prod":
                d = None if None in (total.dimension, value.dimension) else multiply(total.dimension, value.dimension)
                total = Typed(ex.mul(total.node, value.node), d)
            else:
                total = Typed(ex.call(e.op, total.node, value.node), total.dimension)
        return total

    def _call(self, e: syntax.FunctionCall) -> Value:
        """A call of a function of the text, a table or a function of the language."""
        for arg in e.args:
            if arg.name is not None:
                raise self.fail("E404", f"functions take their arguments by position, not '{arg.name} ='", arg.span)
        # what the text declares comes before what the language has
        symbol = self.scope.find(e.name)
        if isinstance(symbol, FunctionSymbol):
            return self._function(symbol, e)
        if isinstance(symbol, TableSymbol):
            return self._table(symbol, e)
        # `energy_through(cell.a)`: of a port, not a value
        if e.name == "energy_through" and len(e.args) == 1:
            return self.through(e.args[0].value)
        if e.name in ("dot", "cross", "norm"):
            return self._vector_call(e)
        if e.name == "quasi":
            raise self.fail("E319", "quasi(w) is what a work acts on", e.span, help="work E on quasi(w)")
        # nothing of that name can be called
        if e.name not in dim.FUNCTIONS:
            texts = [self.source.text[a.span.start : a.span.end] for a in e.args]
            # `R(t)`, `k(x + 1)`: a value followed by parentheses
            if isinstance(symbol, (ParameterSymbol, UnknownSymbol, Definition)):
                meant = e.name if texts == ["t"] else f"{e.name}*({', '.join(texts)})"
                raise self.fail("E101", f"'{e.name}' is a value, no function", e.span, help=meant)
            # `sqr(x)`, `log10(x)`: what other languages have
            remedy = habits.function(e.name, texts)
            if remedy is not None and not self.scope.is_broken(e.name):
                raise self.fail_with_remedy("E101", f"unknown function '{e.name}'", e.span, remedy)
            near = nearest(e.name, (*dim.FUNCTIONS, *self.scope.names(), "sum", "prod", "dot", "cross", "norm"))
            help_ = f"nearest name in scope: '{near}'" if near else f"fn {e.name}(x: 1) -> 1 = ... declares one"
            if self.scope.is_broken(e.name):
                raise Failed
            raise self.fail("E101", f"unknown function '{e.name}'", e.span, help=help_)
        return self._builtin(e)

    def _builtin(self, e: syntax.FunctionCall) -> Value:
        """A function of the language: its arguments counted, their dimensions checked."""
        name = e.name
        count, _ = dim.FUNCTIONS[name]
        values: list[Typed] = []
        # max([a, b, c]) takes a list as its arguments
        for arg in e.args:
            value = self.resolve(arg.value)
            if isinstance(value, Vector) and count == -1:
                values += value.items
            else:
                values.append(self.one_number(value, arg.value))
        if (count == -1 and not values) or (count >= 0 and len(values) != count):
            wants = "at least one argument" if count == -1 else f"{count} argument{'s' * (count != 1)}"
            shape = f"{name}({', '.join('xyz'[:count]) if count > 0 else 'x, y, ...'})"
            raise self.fail("E206", f"{name} takes {wants}, {len(values)} given", e.span, help=shape)
        common: Dimension | None = None
        # sin, exp and others take plain numbers; max, hypot arguments of one dimension
        for k, value in enumerate(values):
            where = e.args[min(k, len(e.args) - 1)].value
            if dim.wants_plain(name) and value.dimension not in (None, NONE):
                self._not_plain(name, value.dimension, where)
            if value.dimension is not None and common is None:
                common = value.dimension
            elif value.dimension is not None and value.dimension != common:
                message = f"the arguments of {name} differ: {dim.show(common)} and {dim.show(value.dimension)}"
                help_ = self.missing(value.dimension, common, where) or f"both in {dim.show(common)}"
                raise self.fail("E206", message, where.span, help=help_)
        # an offset, no factor
        if name == "celsius":
            return Typed(ex.add(values[0].node, ex.const(273.15)), dim.result(name, NONE))
        return Typed(ex.call(name, *(v.node for v in values)), dim.result(name, common))

    def _hint_of_division(self, e: object) -> str | None:
        """What is meant by a quantity whose last unit is a variable in sight too: `300 K/T` is not divided by it."""
        if not isinstance(e, syntax.QuantityLiteral) or len(e.unit.factors) < 2:
            return None
        last = e.unit.factors[-1]
        if last.op != "/" or last.exponent != 1 or self.scope.find(last.name) is None:
            return None
        written = f"{e.text} {e.unit.text.rpartition('/')[0]} / {last.name}"
        return f"'{written}' divides by the variable {last.name}; '{e.text} {e.unit.text}' is one quantity"

    def _not_plain(self, name: str, dimension: Dimension | None, e: syntax.Expr) -> None:
        """Raise E205: a function of plain numbers given a quantity, with the division that makes it plain."""
        text = self.source.text[e.span.start : e.span.end]
        help_ = f"{name}({text}/(1 {dim.show(dimension)}))" if len(text) < 60 else None
        divided = next(filter(None, map(self._hint_of_division, walk(e))), None)
        # `exp(300 K/T)`: meant is 300 K divided by the variable T
        if divided is not None:
            raise self.fail("E205", f"the argument of {name} is in {dim.show(dimension)}", e.span, help=divided)
        if help_ and dimension == dim.TIME:
            help_ += ", or the unit of a frequency: 50 Hz"
        # sin(50 Hz): a frequency for an angle
        if name in ("sin", "cos") and dimension == dim.quotient(NONE, dim.TIME):
            help_ = f"an angle: {name}({text}*t)" if "pi" in text else f"an angle: {name}(2*pi*{text}*t)"
        raise self.fail("E205", f"the argument of {name} is in {dim.show(dimension)}", e.span, help=help_)

    def _vector_call(self, e: syntax.FunctionCall) -> Value:
        """dot, cross, norm: of vectors of one length."""
        wanted = 1 if e.name == "norm" else 2
        values = [self.resolve(a.value) for a in e.args]
        if len(values) != wanted or not all(isinstance(v, Vector) for v in values):
            raise self.fail("E206", f"{e.name} takes {wanted} array{'s' * (wanted > 1)}", e.span)
        a = values[0].items  # type: ignore[union-attr]
        b = values[-1].items  # type: ignore[union-attr]
        if len(a) != len(b) or (e.name == "cross" and len(a) != 3):
            raise self.fail("E206", f"the arrays of {e.name} have {len(a)} and {len(b)} elements", e.span)
        # a x b by its components
        if e.name == "cross":
            at = ((1, 2), (2, 0), (0, 1))
            return Vector(tuple(self.add(_times(a[i], b[j]), _minus(_times(a[j], b[i])), e.span) for i, j in at))
        # the scalar product, of which norm is the root
        total = _times(a[0], b[0])
        for x, y in zip(a[1:], b[1:], strict=True):
            total = self.add(total, _times(x, y), e.span)
        if e.name == "dot":
            return total
        return Typed(ex.sqrt(total.node), None if total.dimension is None else dim.square_root(total.dimension))

    def _arguments(self, name: str, heads: Sequence[Head], e: syntax.FunctionCall) -> list[Value]:
        """Values of the arguments of a function of the text, each of its parameter's dimension and size (E206)."""
        if len(heads) != len(e.args):
            wants = f"{len(heads)} argument{'s' * (len(heads) != 1)}"
            shape = f"{name}({', '.join(head for head, _, _ in heads)})"
            raise self.fail("E206", f"{name} takes {wants}, {len(e.args)} given", e.span, help=shape)
        values: list[Value] = []
        for (head, dimension, size), arg in zip(heads, e.args, strict=True):
            message = f"argument '{head}' of {name} is in {{}}, wants {dim.show(dimension)}"
            # one number
            if size is None:
                values.append(Typed(self.scalar_of(arg.value, dimension, "E206", message), dimension))
                continue
            # `v[3]: m`: a list of three
            value = self.resolve(arg.value)
            if not isinstance(value, Vector) or len(value.items) != size:
                found = f"{len(value.items)} of them" if isinstance(value, Vector) else "one number"
                said = f"argument '{head}' of {name} is an array of {size}, found {found}"
                raise self.fail("E206", said, arg.value.span)
            items = (self.fitting(i, arg.value, dimension, "E206", message) for i in value.items)
            values.append(Vector(tuple(Typed(node, dimension) for node in items)))
        return values

    def _table(self, symbol: TableSymbol, e: syntax.FunctionCall) -> Value:
        heads = [(name, dimension, None) for name, dimension in symbol.arguments]
        nodes = _nodes(self._arguments(symbol.name, heads, e))
        at = [ex.table(name, node) for name, node in zip(symbol.held, nodes, strict=False)] or nodes
        return Typed(ex.table(symbol.key, *at), symbol.result)

    def _function(self, symbol: FunctionSymbol, e: syntax.FunctionCall) -> Value:
        """A function of the text: its body with the arguments in place; E105 where it calls itself."""
        definition, name = symbol.definition, symbol.name
        units = [read_unit(p.unit, symbol.file_scope, symbol.source, self.report) for p in definition.params]
        result = read_unit(definition.result, symbol.file_scope, symbol.source, self.report)
        if result is None or None in units:
            raise Failed
        sizes = [self._size(p, symbol) for p in definition.params]
        heads = [(p.name, u.dimension, n) for p, u, n in zip(definition.params, units, sizes, strict=True) if u]
        values = self._arguments(name, heads, e)
        if any(s.expression is definition.value for s in self._active):
            raise self.fail("E105", f"circular definition: {name} -> {name}", e.span)
        key = definition, _nodes(values)
        if key not in self._applied:
            budget.unfold(budget.EXPANSION, f"what function '{name}' is expanded to")
            self._applied[key] = None
            self._applied[key] = self._body(symbol, values, result.dimension)
        node = self._applied[key]
        if node is None:
            raise Failed  # reported where it was first applied to these
        return Typed(node, result.dimension)

    def _size(self, parameter: syntax.FormalParameter, symbol: FunctionSymbol) -> int | None:
        """How many elements an argument has; None of one number."""
        if parameter.size is None:
            return None
        with self.space(Space("", symbol.file_scope, symbol.file_scope, symbol.source)):
            node = self.whole_number(parameter.size, "the size of an argument")
            if not ex.is_const(node) or node.data < 1:
                message = f"the size of argument '{parameter.name}' of {symbol.name} is no number of elements"
                raise self.fail("E807", message, parameter.size.span, help=f"{parameter.name}[3]: ...")
        return int(node.data)

    def _body(self, symbol: FunctionSymbol, values: Sequence[Value], result: Dimension) -> Node:
        """The value of a function of the file at its arguments, of dimension `result`."""
        definition, name = symbol.definition, symbol.name
        space = Space("", symbol.file_scope, symbol.file_scope, symbol.source)
        marker = Definition(name, "fn", definition.value, (), None, space, symbol.place, definition.name.span)
        arguments = {p.name: value for p, value in zip(definition.params, values, strict=True)}
        self._active.append(marker)
        try:
            with self.space(space), self.bound(arguments):
                message = f"function '{name}' is declared {dim.show(result)} but its value is {{}}"
                return self.scalar_of(definition.value, result, "E207", message)
        finally:
            self._active.pop()


def walk(root: syntax.Expr) -> Iterator[object]:
    """All syntax nodes below an expression."""
    stack: list[object] = [root]
    while stack:
        node = stack.pop()
        yield node
        stack += children(node)


def _nodes(values: Sequence[Value]) -> tuple[Node, ...]:
    """The numbers in values, arrays written out."""
    return tuple(i.node for v in values for i in (v.items if isinstance(v, Vector) else (v,)))


def _times(a: Typed, b: Typed) -> Typed:
    d = None if a.dimension is None or b.dimension is None else multiply(a.dimension, b.dimension)
    return Typed(ex.mul(a.node, b.node), d)


def _minus(a: Typed) -> Typed:
    return Typed(ex.neg(a.node), a.dimension)
