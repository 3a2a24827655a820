"""Inputs: signals that come from outside, of the model itself and of its components.

One that holds a constant is a parameter: setting it compiles nothing.  A scene or the command line gives those of the
model, and by its path that of a component in the place of what its user bound (`set M.u = 3 V`).  An analysis moves
inputs that follow a formula: a parameter of zero is added to what the text gives.
"""

from __future__ import annotations

from dataclasses import replace

from sysdyn.dsl.elaborate.files import FileScope
from sysdyn.dsl.elaborate.instances.head import Interface
from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import Parameter, Shape
from sysdyn.dsl.model.units import Dimension, Unit, si
from sysdyn.dsl.names.calls import walk
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.symbols import Definition, ParameterSymbol, Space, Vector
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class GivenInput:
    """What a scene or the command line gives to the input of a component."""

    statement: syntax.SetStatement
    source: SourceText


class Inputs:
    """Brings inputs into scope."""

    def __init__(self, context: ElaborationContext, files: FileScope, space: Space) -> None:
        self.context, self.resolver, self.parts = context, context.resolver, context.parts
        self.files, self.space = files, space  # of the model
        self.given_inputs: dict[str, GivenInput] = {}  # by path
        self.taken_inputs: set[str] = set()  # those of them that were found
        self.moved: frozenset[str] = frozenset()  # names and paths of inputs that an analysis moves

    def model_input(self, statement: syntax.InputStatement) -> None:
        """An input of the model itself: a scene may set it."""
        decl = statement.decl
        unit = self.context.unit(statement.unit)
        place = self.context.place(decl.span)
        shape = self.context.shape(decl)
        self.parts.inputs[decl.name] = (unit, place)
        self.resolver.inputs.add(decl.name)
        if statement.value is None:
            self.context.enter(
                ParameterSymbol(decl.name, self.context.current.family(decl.name, shape), unit.dimension, False, place)
            )
            self.parts.parameters[decl.name] = Parameter(decl.name, shape, unit, (), (), place)
        else:
            definition = Definition(
                decl.name,
                "input",
                statement.value,
                (),
                unit.dimension,
                self.context.current,
                place,
                decl.span,
                shape=shape,
            )
            self.context.enter(definition)
            self.define_input(definition)

    def define_input(self, definition: Definition) -> None:
        """Give an input its value; one that holds a constant is a run-time value: setting it compiles nothing."""
        name = definition.name
        self._define(definition, self.parts.inputs[name][0], self.context.current)

    def _define(self, definition: Definition, unit: Unit, inside: Space) -> None:
        """An input of the model or of the component `inside`; what it is given is read where the definition says."""
        name, shape = definition.name, definition.shape
        family = inside.family(name, shape)
        if not self._is_constant(definition.expression):
            inside.scope.symbols[name] = self._with_move(definition, family.name, unit)
            return
        inside.scope.symbols[name] = definition
        try:
            with self.resolver.space(definition.space):
                message = f"input '{name}' is declared {dim.show(unit.dimension)} but set to {{}}"
                found = self.resolver.resolve(definition.expression) if shape else None
                written = definition.expression
                items = found.items if isinstance(found, Vector) else (self.resolver.scalar(written),)
                if not self.context.fills(found, shape):
                    what = f"input '{name}' has {len(items)} values, which do not fit its shape"
                    raise self.resolver.fail("E805", what, written.span)
                values = tuple(self.resolver.fitting(i, written, unit.dimension, "E207", message) for i in items)
        except Failed:
            return
        inside.scope.symbols[name] = ParameterSymbol(name, family, unit.dimension, False, definition.place)
        self.parts.parameters[family.name] = Parameter(family.name, shape, unit, values, (), definition.place)

    def _with_move(self, definition: Definition, path: str, unit: Unit) -> Definition:
        """With the parameter that an analysis moves, if it does."""
        if path not in self.moved or definition.shape:
            return definition
        self.parts.parameters[path] = Parameter(path, (), unit, (ex.const(0.0),), (), definition.place)
        return replace(definition, beside=ex.param(path))

    def _is_constant(self, expression: syntax.Expr) -> bool:
        """Whether an expression is made of numbers, parameters and constants only."""
        seen: set[str] = set()
        stack: list[syntax.Expr] = [expression]
        while stack:
            for node in walk(stack.pop()):
                # what is read by a prime or a dot moves, or is not known yet
                if isinstance(node, (syntax.Prime, syntax.Member, syntax.Reduction)):
                    return False
                if isinstance(node, syntax.Name) and node.name not in seen:
                    seen.add(node.name)
                    symbol = self.context.scope.find(node.name)
                    # `pi` and `inf` of the language
                    if symbol is None and node.name in ("pi", "inf"):
                        continue
                    # a constant is as constant as its own expression
                    if isinstance(symbol, Definition) and symbol.kind == "const":
                        stack.append(symbol.expression)
                    elif not isinstance(symbol, ParameterSymbol):
                        return False
        return True

    def bind_inputs(
        self, s: syntax.InstanceStatement, space: Space, head: Interface, inputs: dict[str, syntax.Expr]
    ) -> None:
        """The inputs of a component: what its user gives them, a scene or the command line in its place, a default."""
        sight, around = self.resolver.sight(), self.resolver.loops
        for name, statement in head.inputs.items():
            with self.context.entering(space):
                unit = self.context.unit(statement.unit)
                shape = tuple(
                    (self.context.with_instance_parameters(a), self.context.with_instance_parameters(b))
                    for a, b in self.context.shape(statement.decl)
                )
            place, path = self.context.place(s.span), space.family(name).name
            if not space.prefix and path in self.given_inputs:
                self._give(name, unit, shape, space, self.given_inputs[path])
                continue
            if name in inputs:
                value, here, bound, loops = inputs[name], self.context.current, tuple(sight.items()), around
            else:
                assert statement.value is not None
                value, here, bound, loops = statement.value, space, (), ()
            definition = Definition(
                name, "input", value, (), unit.dimension, here, place, value.span, bound=bound, loops=loops, shape=shape
            )
            space.scope.symbols[name] = definition if space.prefix else self._with_move(definition, path, unit)

    def _give(self, name: str, unit: Unit, shape: Shape, inside: Space, given: GivenInput) -> None:
        """What a scene or the command line gives, read in the scope of the model."""
        self.taken_inputs.add(inside.family(name).name)
        model = self.space
        here = Space("", model.scope, model.file_scope, given.source) if given.source is not model.source else model
        with self.context.entering(here):
            value = bare(self, given.statement.value, unit.dimension)
            place = self.context.place(given.statement.span)
            definition = Definition(
                name, "input", value, (), unit.dimension, here, place, given.statement.span, shape=shape
            )
            self._define(definition, unit, inside)


def path_of(target: syntax.Expr) -> str | None:
    """The path that names a part of a component, without indices: `M.La.L`; None of anything else."""
    parts: list[str] = []
    while isinstance(target, syntax.Member):
        parts.append(target.name)
        target = target.base
    return ".".join((target.name, *reversed(parts))) if isinstance(target, syntax.Name) and parts else None


def bare(it: Inputs, value: syntax.Expr, dimension: Dimension) -> syntax.Expr:
    """On the command line a bare number is in SI units, each of an array too."""
    if isinstance(value, syntax.Array):
        return replace(value, items=tuple(bare(it, item, dimension) for item in value.items))
    inner = value.operand if isinstance(value, syntax.Negative) else value
    if it.resolver.source is it.space.source or not isinstance(inner, syntax.Number) or not dimension:
        return value
    number = syntax.QuantityLiteral(inner.value, inner.text, _si_unit(dimension, inner.span), inner.span)
    it.files.scope.units.update({f"SI {dim.show(dimension)}": si(dimension)})
    return syntax.Negative(number, value.span) if isinstance(value, syntax.Negative) else number


def _si_unit(dimension: Dimension, span: syntax.Span) -> syntax.UnitExpression:
    name = f"SI {dim.show(dimension)}"
    return syntax.UnitExpression((syntax.UnitFactor(name, 1, ".", span),), name, span)
