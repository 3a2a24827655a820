"""Parameters of a model or component: units, defaults, arguments, in the order of their dependence."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TypeVar

from sysdyn.dsl.elaborate.instances.head import Body
from sysdyn.dsl.elaborate.parts import ElaborationContext, declarations_of
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.dependence import in_order
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Parameter, Shape
from sysdyn.dsl.model.units import NONE, Dimension, Unit, si
from sysdyn.dsl.names.calls import walk
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.symbols import ParameterSymbol, Typed, Vector
from sysdyn.dsl.names.unit_reading import read_unit
from sysdyn.dsl.parser.notes import PREDEFINED
from sysdyn.dsl.text.diagnostics import Place, Related
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

Valued = TypeVar("Valued", syntax.ParamStatement, syntax.StateStatement | syntax.DiscreteStatement)
"""A declaration with a value."""
Stated = tuple[syntax.ParamStatement, tuple[syntax.ForStatement, ...]]


@dataclass(frozen=True, slots=True)
class Argument:
    """As written, its value and place where the instance stands; bare: the parameter that it is, one without a unit."""

    written: syntax.Expr
    value: Typed | Vector
    bare: str | None
    place: Place


class ParameterDeclarations:
    """Declares parameters."""

    def __init__(self, context: ElaborationContext) -> None:
        self.context, self.resolver, self.parts = context, context.resolver, context.parts

    def declare_parameters(self, body: Body, given: dict[str, Argument]) -> None:
        """Parameters in the order of their dependence (the default of one may name another); given: arguments."""
        said = len(self.context.report)
        order = body.order if body.order is not None else self.by_dependence(self._first(body))
        if len(self.context.report) == said:  # what is wrong is told of each instance
            body.order = order
        for statement, loops in order:
            try:
                with self.context.inside(loops) if loops else nullcontext():
                    self._is_of_constants(body, statement, statement.decl.name in given)
                    self._parameter(statement, given.get(statement.decl.name))
            except Failed:
                self.context.scope.broken.add(statement.decl.name)

    def _first(self, body: Body) -> dict[str, Stated]:
        """The parameters of a body by their names; E106 where there are two of one."""
        found: dict[str, Stated] = {}
        for statement, loops in body.statements_of(syntax.ParamStatement):
            assert isinstance(statement, syntax.ParamStatement)
            name = statement.decl.name
            if name in found:
                related = (Related("first declared here", self.context.place(found[name][0].decl.span)),)
                self.context.report.error(
                    "E106", f"'{name}' is declared twice", self.context.place(statement.decl.span), related=related
                )
                continue
            found[name] = (statement, loops)
        return found

    def by_dependence(
        self, found: dict[str, tuple[Valued, tuple[syntax.ForStatement, ...]]]
    ) -> tuple[tuple[Valued, tuple[syntax.ForStatement, ...]], ...]:
        """Declarations by name, those that others name before these; E105."""
        needs = {name: _names_in(*stated) & found.keys() for name, stated in found.items()}
        order, circles = in_order(found, lambda name: sorted(needs[name]))
        for circle in circles:
            names = " or ".join(f"'{name}'" for name in circle[:-1])
            text, span = f"circular definition: {' -> '.join(circle)}", found[circle[-2]][0].span
            self.context.report.error("E105", text, self.context.place(span), help=f"a value of its own for {names}")
            self.context.scope.broken |= set(circle)
        return tuple(found[name] for name in order)

    def _parameter(self, statement: syntax.ParamStatement, given: Argument | None) -> None:
        """Declare a parameter: its unit, shape and values, by the argument of the instance or else its default; E207 of
        neither.
        """
        decl = statement.decl
        place = self.context.place(decl.span)
        unit = self.context.unit(statement.unit) if statement.unit else None
        shape = self.context.shape(decl)
        family = self.context.current.family(decl.name, shape)
        own = self.resolver.loops[len(self.context.current.loops) :]
        # `for i in 1..n { param R = ... }`
        if own and not decl.indices:
            raise self.resolver.fail("E806", f"'{decl.name}' needs its loop variable: {decl.name}[i]", decl.span)
        values: tuple[Node, ...] = ()
        truth = False
        # its default
        if statement.value is not None and given is None:
            value = self.resolver.resolve(statement.value)
            values, unit, truth = self._values(statement, statement.value, value, unit, shape)
        # an argument of the instance, in the unit of the declaration
        elif given is not None:
            if unit is None and statement.value is not None:  # the default fixes the dimension
                unit = self._values(statement, statement.value, self.resolver.resolve(statement.value), None, shape)[1]
            values, unit, truth = self._values(statement, given.written, given.value, unit, shape, given)
        # `param k` says neither unit nor value
        if unit is None:
            help_ = f"param {decl.name} = 3 N/m, or param {decl.name}: N/m where somebody else sets it"
            raise self.resolver.fail("E207", f"'{decl.name}' has neither a unit nor a default", decl.span, help=help_)
        around = tuple(n.data if n.op == "index" else f"_{k}" for k, n in enumerate(family.prefix))
        indices = (*around, *(loop.index for loop in own))
        self.context.enter(ParameterSymbol(decl.name, family, unit.dimension, truth, place))
        self.parts.parameters[family.name] = Parameter(family.name, family.whole, unit, values, indices, place)

    def _values(
        self,
        statement: syntax.ParamStatement,
        written: syntax.Expr,
        value: Typed | Vector,
        unit: Unit | None,
        shape: Shape,
        given: Argument | None = None,
    ) -> tuple[tuple[Node, ...], Unit, bool]:
        """Nodes of a default or an argument, and the unit that it fixes where none is declared."""
        items = value.items if isinstance(value, Vector) else (value,)
        # a parameter is constant in a run
        for item in items:
            self._is_run_constant(item.node, statement, given)
        # `param k[1..3] = [1, 2]`
        if not self.context.fills(value, shape):
            message = f"'{statement.decl.name}' has {len(items)} values, which do not fit its shape"
            help_ = None if shape or not isinstance(value, Vector) else f"param {statement.decl.name}[1..{len(items)}]"
            if given is not None:
                help_ = None if shape else "one value"
            raise self._wrong("E805", message, statement, given, help=help_)
        # where no unit is declared, the first value with one gives it
        what = "default" if written is statement.value else "argument"
        known = [i.dimension for i in items if i.dimension is not None]
        dimension = unit.dimension if unit is not None else (known[0] if known else NONE)
        # each value has the dimension of the declaration
        for item in items:
            if item.dimension is not None and item.dimension != dimension:
                literal = written.operand if isinstance(written, syntax.Negative) else written
                have, want = dim.show(item.dimension), dim.show(dimension)
                have = literal.unit.text if isinstance(literal, syntax.QuantityLiteral) else have
                is_ = "dimensionless" if have == "dimensionless" else f"in {have}"
                message = f"'{statement.decl.name}' is declared {want} but its {what} is {is_}"
                if unit is None:
                    message = f"the values of '{statement.decl.name}' differ: {want} and {have}"
                help_ = self._with_unit(written, unit) if have == "dimensionless" else None
                help_ = help_ or self.resolver.missing(item.dimension, dimension, written)
                code = "E207" if what == "default" else "E214"
                # an argument: the finding stands at the instance, and names both
                if code == "E214":
                    name = self.context.current.path or self.context.current.component
                    want = unit.text if unit is not None else want
                    message = f"argument {statement.decl.name} of '{name}' is {is_}, wants {want}"
                    if help_ is None and isinstance(written, syntax.Name) and have != "dimensionless":
                        help_ = f"'{written.name}' is {is_}, {want} is wanted"
                    bare = given.bare if given is not None else None
                    if bare is not None and help_ is None and have == "dimensionless":
                        help_ = f"'{bare}' is a number without unit; in {want} it fits"
                raise self._wrong(code, message, statement, given, help=help_)
        truth = isinstance(value, Typed) and value.truth
        nodes = tuple(i.node for i in items)
        # a condition is stored as 1 or 0
        if truth:
            nodes = (ex.conditional(nodes[0], ex.const(1.0), ex.const(0.0)),)
        return nodes, unit or self._default_unit(written, dimension), truth

    def _with_unit(self, value: syntax.Expr, unit: Unit | None) -> str | None:
        return f"write '{value.text} {unit.text}'" if isinstance(value, syntax.Number) and unit else None

    def _default_unit(self, value: syntax.Expr, dimension: Dimension) -> Unit:
        if isinstance(value, syntax.Negative):
            value = value.operand
        if isinstance(value, syntax.QuantityLiteral):
            found = read_unit(value.unit, self.context.scope, self.resolver.source, self.context.report)
            if found is not None:
                return found
        return si(dimension)

    def _is_run_constant(self, node: Node, statement: syntax.ParamStatement, given: Argument | None) -> None:
        discretes = self.parts.discretes
        for inner in ex.topological([node]):
            assigned = inner.op == "param" and inner.data in discretes
            if assigned or inner.op in ("var", "time"):
                message = f"parameter '{statement.decl.name}' depends on '{inner}': a parameter is a constant"
                varies = f"a law could read '{inner}'" if assigned else f"'input {statement.decl.name}' could vary"
                vary = f"numbers and parameters alone; {varies}"
                raise self._wrong("E807", message, statement, given, help=None if given is None else vary)

    def _is_of_constants(self, body: Body, statement: syntax.ParamStatement, given: bool) -> None:
        """E807: a default that names what the body declares beside parameters, all of which are known before it."""
        if given or statement.value is None:
            return
        names = [n for n in walk(statement.value) if isinstance(n, syntax.Name) and n.name not in PREDEFINED]
        names = [n for n in names if self.context.scope.find(n.name) is None]
        if not names:
            return
        own = {n.index.name for n in walk(statement.value) if isinstance(n, syntax.Reduction)}
        others = {
            d.name for other, _ in body if not isinstance(other, syntax.ParamStatement) for d in declarations_of(other)
        }
        for name in names:
            if name.name in others - own - self.resolver.sight().keys():
                what = statement.decl.name
                message = f"parameter '{what}' depends on '{name.name}': a parameter is a constant"
                help_ = f"let {what} = ..., which may vary"
                raise self.resolver.fail("E807", message, name.span, help=help_)

    def _wrong(
        self, code: str, message: str, statement: syntax.ParamStatement, given: Argument | None, help: str | None
    ) -> Failed:
        """Report an error in a default, or in what an instance gives instead; raise what is returned."""
        if given is None:
            return self.resolver.fail(code, message, (statement.value or statement.decl).span, help=help)
        where = Related(f"in component '{self.context.current.component}'", self.context.place(statement.decl.span))
        return self.resolver.fail(code, message, given.place, help=help, related=(where,))


def _names_in(
    statement: syntax.ParamStatement | syntax.StateStatement | syntax.DiscreteStatement,
    loops: tuple[syntax.ForStatement, ...],
) -> set[str]:
    """What a declaration reads, with the loops around it."""
    bounds = [bound for loop in loops for bound in (loop.lower, loop.upper)]
    roots: list[object] = [statement.value, *statement.decl.indices, *bounds]
    return {n.name for r in roots if r is not None for n in walk(r) if isinstance(n, syntax.Name)}  # type: ignore[arg-type]
