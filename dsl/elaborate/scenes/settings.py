"""What a scene or the command line gives: new values of inputs, parameters and elements of them.

Received: `set` statements, in the scope of the model; handed on: parameters in the elaborator's parts with these
values, and `elements`, the settings of single ones.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.elaborate.scenes.slices import bound_of, each_of, ranges_of
from sysdyn.dsl.elaborate.statements.inputs import GivenInput, bare, path_of
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import ElementSetting, Parameter
from sysdyn.dsl.model.unit_habits import common
from sysdyn.dsl.model.units import NONE, Unit
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.paths import Located
from sysdyn.dsl.names.symbols import (
    Definition,
    InstanceSymbol,
    ParameterSymbol,
    Space,
    Typed,
    Unsupported,
    Vector,
    nearest,
)
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.tree import syntax


class Settings:
    """elements: of parameters, one by one."""

    def __init__(self, elaborator: Elaborator) -> None:
        self.model = elaborator
        self.resolver = elaborator.resolver
        self.elements: list[ElementSetting] = []

    def input(self, s: syntax.SetStatement) -> None:
        """A `set` of an input of the model, or of a component's by its path: the last one counts."""
        if isinstance(s.target, syntax.Name) and s.target.name in self.model.parts.inputs:
            self._input(s.target.name, *self.model.parts.inputs[s.target.name], s)
        elif (path := path_of(s.target)) is not None:
            self.model.inputs.given_inputs[path] = GivenInput(s, self.resolver.source)

    def size(self, s: syntax.SetStatement) -> None:
        """A `set` of a parameter of the model to a number, which may be a size that instances ask for."""
        symbol = self.model.context.scope.symbols.get(s.target.name) if isinstance(s.target, syntax.Name) else None
        if isinstance(symbol, ParameterSymbol) and not symbol.shape and isinstance(s.value, syntax.Number):
            self.parameter(s)

    def parameter(self, s: syntax.SetStatement) -> None:
        """`set ref = value` of a parameter or an element of one, no input; paths lead into instances."""
        if isinstance(s.target, syntax.Name) and s.target.name in self.model.parts.inputs:
            return
        if path_of(s.target) in self.model.inputs.taken_inputs:
            return
        path = s.target.base if isinstance(s.target, syntax.Item) else s.target
        # `set cell[1..3].R = 1 ohm`: one setting for each
        if ranges_of(path):  # a range of components
            for target, _ in each_of(self.model, path):
                whole = replace(s.target, base=target) if isinstance(s.target, syntax.Item) else target
                self.parameter(replace(s, target=whole))
            return
        # a parameter of the model or of something inside
        found = self.resolver.locate(s.target)
        symbol = None if found is None else found.symbol
        if isinstance(symbol, Unsupported):
            raise Failed
        if found is not None and isinstance(symbol, ParameterSymbol):
            self._parameter(symbol, found, s)
            return
        # nothing of that name: what may be meant
        root = s.target
        while isinstance(root, (syntax.Item, syntax.Member)):
            root = root.base
        shown = " ".join(self.resolver.source.text[s.target.span.start : s.target.span.end].split())
        name = root.name if isinstance(root, syntax.Name) else shown
        if self.model.space.scope.is_broken(name):
            raise Failed
        near = nearest(shown, (*self.model.parts.parameters, *self.model.parts.inputs))
        message = f"'{shown}' is not a parameter or input of model '{self.model.model.name.name}'"
        last = shown.rpartition(".")[2]
        inside = [p for p in (*self.model.parts.parameters, *self.model.parts.inputs) if p.endswith(f".{last}")]
        near = near or (inside[0] if inside and (symbol is None or "." in shown) else None)
        started = f"init {shown} = ... sets an initial value" if symbol is not None else None
        own = [p for p in (*self.model.parts.parameters, *self.model.parts.inputs) if p.startswith(f"{shown}.")]
        # `set motor = 3`: its parameters
        if isinstance(symbol, InstanceSymbol) and symbol.spaces:
            said = symbol.spaces[0].scope.symbols
            own += [f"{shown}.{n}" for n, d in said.items() if isinstance(d, Definition) and d.kind == "input"]
        if own and symbol is not None:
            near, started = None, " or ".join(f"set {p} = ..." for p in own[:3])
        help_ = f"nearest: '{near}'" if near else started
        owner = self.resolver.locate(s.target.base) if isinstance(s.target, syntax.Member) else None
        # a parameter of a level that is not chosen
        if owner is not None and isinstance(owner.symbol, InstanceSymbol) and owner.symbol.spaces:
            other = owner.symbol.spaces[0].elsewhere.get(last)
            help_ = f"level {other} of '{shown.rpartition('.')[0]}' has it" if other else help_
        if name in self.model.parts.inputs:
            help_ = f"the whole: set {name} = [a, b, ...]"
        # `set cell[2].u = 1 V` of an array
        if isinstance(symbol, Definition) and symbol.kind == "input":
            message = f"'{shown}' is an input in an array of components: each is given where they stand"
            help_ = f"an input of the model there: input u: ..., and {symbol.name} = u"
        raise self.resolver.fail("E910", message, s.target.span, help=help_)

    def _input(self, name: str, unit: Unit, place: Place, s: syntax.SetStatement) -> None:
        value = bare(self.model.inputs, s.value, unit.dimension)
        self.model.parts.parameters.pop(name, None)
        space = self.model.space
        shape = getattr(space.scope.symbols[name], "shape", ())
        if self.resolver.source is not space.source:  # the command line has a text of its own
            space = Space("", space.scope, space.file_scope, self.resolver.source)
        self.model.inputs.define_input(
            Definition(name, "input", value, (), unit.dimension, space, place, s.span, shape=shape)
        )

    def _parameter(self, symbol: ParameterSymbol, found: Located, s: syntax.SetStatement) -> None:
        """A parameter, or elements of one, with its new value."""
        parameter = self.model.parts.parameters[symbol.family.name]
        value = self.resolver.resolve(bare(self.model.inputs, s.value, symbol.dimension or NONE))
        items = value.items if isinstance(value, Vector) else (value,)
        for item in items:
            self._check_setting(symbol, item, s)
        # of an array of components the indices of the component come first
        around = tuple(ex.substitute(n, found.change) for n in symbol.family.prefix)
        at: list[tuple[Node, ...]] = [(n,) for n in around]
        if around or not self._all(parameter, found.indices):
            at += [self._chosen(symbol, i) for i in found.indices]
        if around and not found.indices:  # of a component in an array: each element
            bounds = (
                [self.model.context.with_instance_parameters(ex.substitute(b, found.change)) for b in pair]
                for pair in symbol.shape
            )
            at += [tuple(ex.const(float(k)) for k in range(round(a.data), round(b.data) + 1)) for a, b in bounds
                   if ex.is_const(a) and ex.is_const(b)]  # fmt: skip
        nodes = tuple(i.node for i in items)
        # a condition is stored as 1 or 0
        if symbol.truth:
            nodes = (ex.conditional(nodes[0], ex.const(1.0), ex.const(0.0)),)
        place = self.resolver.place(s.span)
        # elements: each with its own node; ranges give all their elements
        if at:
            elements = list(itertools.product(*at))
            if len(at) != len(parameter.shape):
                raise self.resolver.index_count(symbol.name, len(symbol.shape), len(found.indices), s.target.span)
            if isinstance(value, Vector) and (sum(len(a) > 1 for a in at) > 1 or len(elements) != len(items)):
                message = f"{len(elements)} elements of '{symbol.name}' are given {len(items)} values"
                raise self.resolver.fail("E805", message, s.value.span)
            given = nodes if isinstance(value, Vector) else nodes * len(elements)
            self.elements += [ElementSetting(parameter.name, a, n, place) for a, n in zip(elements, given, strict=True)]
            return
        # the whole parameter: a number for all, or a list of its length
        if not self.model.context.fills(value, parameter.shape):
            message = f"'{symbol.name}' is given {len(items)} values, which do not fit its shape"
            raise self.resolver.fail("E805", message, s.value.span)
        if self.resolver.source is not self.model.source:  # the command line wins over the scene's elements
            self.elements = [e for e in self.elements if e.name != parameter.name]
        self.model.parts.parameters[parameter.name] = replace(parameter, values=nodes, indices=(), place=place)

    def _all(self, parameter: Parameter, indices: tuple[syntax.Index, ...]) -> bool:
        """Whether ranges take all elements."""
        ranges = [i for i in indices if isinstance(i, syntax.Range)]
        said = [(self.resolver.whole_number(i.lower, "a bound"), self.resolver.whole_number(i.upper, "a bound"))
                for i in ranges]  # fmt: skip
        return len(ranges) == len(indices) and [*said] == [*parameter.shape]

    def _chosen(self, symbol: ParameterSymbol, index: syntax.Index) -> tuple[Node, ...]:
        """The numbers of an index, all those of a range."""
        if not isinstance(index, syntax.Range):
            return (self.resolver.whole_number(index, "an index"),)
        first, last = (bound_of(self.model, bound) for bound in (index.lower, index.upper))
        return tuple(ex.const(float(k)) for k in range(first, last + 1))

    def _check_setting(self, symbol: ParameterSymbol, value: Typed, s: syntax.SetStatement) -> None:
        """E207: a setting is of the kind and the dimension of its parameter."""
        # `set on = 3`
        if value.truth != symbol.truth:
            raise self.resolver.fail(
                "E207", f"'{symbol.name}' is {'a condition' if symbol.truth else 'a number'}", s.value.span
            )
        # `set R = 3 V`
        if value.dimension is not None and value.dimension != symbol.dimension:
            own = common(symbol.dimension) if symbol.dimension else dim.show(symbol.dimension)
            message = f"'{symbol.name}' is in {own} but set to {dim.show(value.dimension)}"
            help_ = self.resolver.missing(value.dimension, symbol.dimension, s.value)
            if help_ is not None and help_.endswith(f": '{symbol.name}'?"):  # itself is no factor of what it is set to
                factor = dim.quotient(symbol.dimension or NONE, value.dimension)
                text = " ".join(self.resolver.source.text[s.value.span.start : s.value.span.end].split())
                help_ = None if factor is None else f"({text})*(1 {dim.show(factor)})"
            raise self.resolver.fail("E207", message, s.value.span, help=help_)
        # `set R = x`: parameters do not vary
        for inner in ex.topological([value.node]):
            if inner.op in ("var", "time"):
                varies = symbol.name in self.model.parts.inputs
                what = f"an element of input '{symbol.name}'" if varies else f"parameter '{symbol.name}'"
                message = f"{what} is set to something that depends on '{inner}'"
                help_ = f"the whole: set {symbol.name} = [a, b, ...]" if varies else None
                raise self.resolver.fail(
                    "E807", message, s.value.span, help=help_ or "a parameter is a constant; an input may vary"
                )
