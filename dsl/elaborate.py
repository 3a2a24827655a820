"""From a model as written to its network: declarations first, then every statement resolved.

A statement inside `for` is resolved once with its loops.  What a later issue builds (nodes, components, events,
inequalities, levels) is reported as N608 with its place, and the rest is still checked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

from sysdyn.dsl import dimensions as dim
from sysdyn.dsl import expression as ex
from sysdyn.dsl import syntax
from sysdyn.dsl.diagnostics import Place, Related, Report
from sysdyn.dsl.expression import Node
from sysdyn.dsl.files import FileScope
from sysdyn.dsl.format import format_expression
from sysdyn.dsl.network import (
    Constraint,
    Coordinate,
    Dynamic,
    Energy,
    Expectation,
    Golden,
    Initial,
    Loop,
    Parameter,
    Shape,
    State,
    Unknown,
    Work,
)
from sysdyn.dsl.resolve import Failed, Resolver, walk
from sysdyn.dsl.symbols import (
    ConstraintSymbol,
    Definition,
    DomainSymbol,
    ParameterSymbol,
    Scope,
    Symbol,
    Typed,
    UnknownSymbol,
    Unsupported,
    Vector,
    nearest,
)
from sysdyn.dsl.unit_reading import read_unit
from sysdyn.dsl.units import NONE, Dimension, Unit, multiply, si

_LATER = {
    syntax.Node: "node",
    syntax.Port: "port",
    syntax.Branch: "branch",
    syntax.Instance: "element",
    syntax.Level: "level",
    syntax.Law: "law",
    syntax.Lossless: "lossless",
    syntax.Discrete: "discrete variable",
    syntax.When: "when",
    syntax.Every: "every",
}
_PLANNED = {
    **dict.fromkeys((syntax.Discrete, syntax.When, syntax.Every), "planned: events and discrete time"),
}
_NETWORKS = "planned: networks and components"

Nested = tuple[syntax.Statement, tuple[syntax.For, ...]]


class Elaborator:
    """Elaborates one model of a file."""

    def __init__(self, files: FileScope, model: syntax.Model, report: Report) -> None:
        self.files = files
        self.model = model
        self.report = report
        self.source = files.file.source
        self.scope = Scope(files.scope)
        self.resolver = Resolver(report)
        self.parameters: dict[str, Parameter] = {}
        self.coordinates: list[Coordinate] = []
        self.unknowns: list[Unknown] = []
        self.states: list[State] = []
        self.energies: list[Energy] = []
        self.works: list[Work] = []
        self.constraints: list[Constraint] = []
        self.dynamics: list[Dynamic] = []
        self.initials: list[Initial] = []
        self.expectations: list[Expectation] = []
        self.goldens: list[Golden] = []
        self.requirements: list[tuple[Node, tuple[Loop, ...], Place, str]] = []
        self._body = list(_flatten(model.body, ()))
        self.inputs: dict[str, tuple[Unit, Place]] = {}
        self.given: set[str] = set()  # states that have a dynamic, sound or not

    # -- frame ---------------------------------------------------------------------------------------------

    def declare(self) -> None:
        """Bring the model's names into scope; values of inputs may change until `statements`."""
        for statement, _ in self._body:
            if isinstance(statement, syntax.Broken):
                self.scope.broken |= statement.names
        with self.resolver.within(self.scope, self.source):
            self._declare_parameters(self._body)
            self._each(self._body, self._declare)

    def statements(self) -> None:
        """Resolve what the model says."""
        with self.resolver.within(self.scope, self.source):
            self._each([s for s in self._body if isinstance(s[0], syntax.Constraint)], self._constraint)
            for kind, method in _STATEMENTS.items():
                self._each([s for s in self._body if isinstance(s[0], kind)], lambda s, m=method: m(self, s))  # type: ignore[misc]
            self._definitions()

    def _each(self, statements: Sequence[Nested], do: Callable[..., None]) -> None:
        for statement, loops in statements:
            try:
                with self._inside(loops):
                    do(statement)
            except Failed:  # reported; what it would have declared is not reported again where it is used
                for decl in _declared(statement):
                    if decl.name not in self.scope.symbols:
                        self.scope.broken.add(decl.name)

    @contextmanager
    def _inside(self, loops: tuple[syntax.For, ...]) -> Iterator[None]:
        with ExitStack() as stack:
            for loop in loops:
                first = self.resolver.whole_number(loop.lower, "a bound")
                last = self.resolver.whole_number(loop.upper, "a bound")
                stack.enter_context(self.resolver.loop(loop.index.name, first, last))
            yield

    def place(self, span: syntax.Span) -> Place:
        """A span of the model's text."""
        return Place(self.resolver.source, span)

    def _enter(self, symbol: Symbol) -> None:
        before = self.scope.symbols.get(symbol.name)
        if before is None:
            self.scope.symbols[symbol.name] = symbol
        elif not (
            isinstance(before, ConstraintSymbol) and isinstance(symbol, ConstraintSymbol) and before.kind == symbol.kind
        ):
            related = (Related("first declared here", before.place),)
            self.report.error("E106", f"'{symbol.name}' is declared twice", symbol.place, related=related)
            raise Failed

    # -- declarations --------------------------------------------------------------------------------------

    def _declare(self, statement: syntax.Statement) -> None:
        match statement:
            case syntax.Coord():
                self._coordinates(statement)
            case syntax.Implicit():
                unit = self._unit(statement.unit)
                for decl in statement.decls:
                    shape = self._shape(decl)
                    self._unknown(decl, "e", shape, unit.dimension, None, False)
                    self.unknowns.append(Unknown(decl.name, shape, unit, self.place(decl.span)))
            case syntax.State():
                self._state(statement)
            case syntax.Let() | syntax.Output():
                self._definition(statement)
            case syntax.Input():
                self._input(statement)
            case syntax.Constraint():
                self._enter(ConstraintSymbol(statement.decl.name, statement.kind, self.place(statement.decl.span)))
            case _:
                self._later(statement)

    def _later(self, statement: syntax.Statement) -> None:
        what = _LATER.get(type(statement))
        if what is None:
            return
        decls = _declared(statement)
        names = ", ".join(f"'{d.name}'" for d in decls)
        planned = _PLANNED.get(type(statement), _NETWORKS)
        message = " ".join(filter(None, (what, names, f"is not supported yet ({planned})")))
        self.report.error("N608", message, self.place(statement.span))
        for decl in decls:
            self._enter(Unsupported(decl.name, what, self.place(decl.span)))

    def _unit(self, unit: syntax.Unit) -> Unit:
        found = read_unit(unit, self.scope, self.resolver.source, self.report)
        if found is None:
            raise Failed
        return found

    def _shape(self, decl: syntax.Decl) -> Shape:
        """First and last index of each index of a declared family."""
        return tuple(self._bounds(i) for i in decl.indices)

    def _bounds(self, index: syntax.Index) -> tuple[Node, Node]:
        if isinstance(index, syntax.Range):
            return self.resolver.whole_number(index.lower, "a bound"), self.resolver.whole_number(
                index.upper, "a bound"
            )
        node = self.resolver.whole_number(index, "an index")
        inside = {ex.index(loop.index): loop for loop in self.resolver.loops}
        used = [n for n in ex.topological([node]) if n in inside]
        if not used:
            return ex.const(1), node
        lows = {n: inside[n].first for n in used}
        highs = {n: inside[n].last for n in used}
        return ex.substitute(node, lows), ex.substitute(node, highs)

    def _domain(self, word: syntax.Word) -> DomainSymbol:
        symbol = self.scope.find(word.name)
        if isinstance(symbol, DomainSymbol):
            return symbol
        domains = [n for n in self.scope.names() if isinstance(self.scope.find(n), DomainSymbol)]
        near = nearest(word.name, domains)
        if self.scope.is_broken(word.name):
            raise Failed
        help_ = f"'{near}'" if near else f"one of {', '.join(domains)}"
        raise self.resolver.fail("E202", f"'{word.name}' is not a domain", word.span, help=help_)

    def _unknown(
        self, decl: syntax.Decl, kind: str, shape: Shape, dimension: Dimension, domain: DomainSymbol | None, co: bool
    ) -> None:
        self._enter(UnknownSymbol(decl.name, kind, shape, dimension, domain, co, self.place(decl.span)))

    def _coordinates(self, statement: syntax.Coord) -> None:
        domain = self._domain(statement.domain)
        co = statement.kind == "cocoord"
        own, rate = (domain.momentum, domain.effort) if co else (domain.displacement, domain.flow)
        conjugate, effort = (domain.displacement, domain.flow) if co else (domain.momentum, domain.effort)
        for decl in statement.decls:
            shape = self._shape(decl)
            self._unknown(decl, "q", shape, own.dimension, domain, co)
            place = self.place(decl.span)
            self.coordinates.append(
                Coordinate(decl.name, shape, co, own, rate, conjugate, effort, statement.tangible, place)
            )
            if statement.init is not None:
                self._own_initial(decl, "q", shape, own.dimension, statement.init)

    def _own_initial(
        self, decl: syntax.Decl, kind: str, shape: Shape, dimension: Dimension, init: syntax.Initial
    ) -> None:
        message = f"'{decl.name}' is in {dim.show(dimension)} but starts at {{}}"
        with ExitStack() as stack:
            at = tuple(
                ex.index(stack.enter_context(self.resolver.loop(f"i{k + 1}", first, last)).index)
                for k, (first, last) in enumerate(shape)
            )
            value = self.resolver.wanted(init.value, dimension, "E207", message)
            target = ex.var(decl.name, kind, *at)
            self.add_initial(Initial(target, value, init.kind == "fixed", self.resolver.loops, self.place(init.span)))

    def add_initial(self, initial: Initial, override: bool = False) -> None:
        """Enter an initial value; a scene's replaces the model's."""
        for k, before in enumerate(self.initials):
            if before.target is initial.target and before.loops == initial.loops:
                if override:
                    self.initials[k] = initial
                    return
                related = (Related("first here", before.place),)
                message = f"'{initial.target}' gets its initial value twice"
                self.report.error("E106", message, initial.place, related=related)
                raise Failed
        self.initials.append(initial)

    def _state(self, statement: syntax.State) -> None:
        decl = statement.decl
        value = None if statement.value is None else self.resolver.scalar(statement.value)
        unit = self._unit(statement.unit) if statement.unit else None
        if unit is None:
            unit = si((value.dimension or NONE) if value is not None else NONE)
        shape = self._shape(decl)
        self._unknown(decl, "s", shape, unit.dimension, None, False)
        self.states.append(State(decl.name, shape, unit, self.place(decl.span)))
        if statement.value is not None:
            init = syntax.Initial("fixed", statement.value, statement.value.span)
            self._own_initial(decl, "s", shape, unit.dimension, init)

    def _definition(self, statement: syntax.Let | syntax.Output) -> None:
        decl = statement.decl
        kind = "let" if isinstance(statement, syntax.Let) else "output"
        at: tuple[str, ...] = ()
        implied = False
        if decl.indices and not any(isinstance(i, syntax.Range) for i in decl.indices):
            at = tuple(i.name for i in decl.indices if isinstance(i, syntax.Name))
            if len(at) != len(decl.indices):
                raise self.resolver.fail(
                    "E806", f"'{decl.name}' is declared by its loop variables", decl.span, help="let x[i] = ..."
                )
        elif decl.indices and not isinstance(statement.value, syntax.Array):
            help_ = f"for i in ... {{ {kind} {decl.name}[i] = ... }}"
            raise self.resolver.fail(
                "E806", f"the elements of '{decl.name}' are given by one formula", decl.span, help=help_
            )
        elif self.resolver.loops:
            at, implied = tuple(self.resolver.bound_loops()), True
        self._enter(
            Definition(
                decl.name, kind, statement.value, at, None, self.source, self.place(decl.span), decl.span, implied
            )
        )

    def _input(self, statement: syntax.Input) -> None:
        decl = statement.decl
        unit = self._unit(statement.unit)
        place = self.place(decl.span)
        if decl.indices:
            raise self.resolver.fail("N608", f"an array of inputs ('{decl.name}') is not supported yet", decl.span)
        self.inputs[decl.name] = (unit, place)
        self.resolver.inputs.add(decl.name)
        if statement.value is None:
            self._enter(ParameterSymbol(decl.name, (), unit.dimension, False, place))
            self.parameters[decl.name] = Parameter(decl.name, (), unit, (), (), place)
        else:
            definition = Definition(
                decl.name, "input", statement.value, (), unit.dimension, self.source, place, decl.span
            )
            self._enter(definition)
            self.define_input(definition)

    def define_input(self, definition: Definition) -> None:
        """Give an input its value; one that holds a constant is a run-time value: setting it compiles nothing."""
        self.scope.symbols[definition.name] = definition
        if not self._is_constant(definition.expression):
            return
        unit = self.inputs[definition.name][0]
        try:
            with self.resolver.within(self.scope, definition.source):
                message = f"input '{definition.name}' is declared {dim.show(unit.dimension)} but set to {{}}"
                value = self.resolver.wanted(definition.expression, unit.dimension, "E207", message)
        except Failed:
            return
        name = definition.name
        self.scope.symbols[name] = ParameterSymbol(name, (), unit.dimension, False, definition.place)
        self.parameters[name] = Parameter(name, (), unit, (value,), (), definition.place)

    def _is_constant(self, expression: syntax.Expr) -> bool:
        """Whether an expression is made of numbers, parameters and constants only."""
        seen: set[str] = set()
        stack: list[syntax.Expr] = [expression]
        while stack:
            for node in walk(stack.pop()):
                if isinstance(node, (syntax.Prime, syntax.Member, syntax.Reduction)):
                    return False
                if isinstance(node, syntax.Name) and node.name not in seen:
                    seen.add(node.name)
                    symbol = self.scope.find(node.name)
                    if symbol is None and node.name in ("pi", "inf"):
                        continue
                    if isinstance(symbol, Definition) and symbol.kind == "const":
                        stack.append(symbol.expression)
                    elif not isinstance(symbol, ParameterSymbol):
                        return False
        return True

    # -- parameters ----------------------------------------------------------------------------------------

    def _declare_parameters(self, statements: Sequence[Nested]) -> None:
        """Parameters in the order of their dependence: the default of one may name another."""
        found: dict[str, tuple[syntax.Param, tuple[syntax.For, ...]]] = {}
        for statement, loops in statements:
            if isinstance(statement, syntax.Param):
                name = statement.decl.name
                if name in found:
                    related = (Related("first declared here", self.place(found[name][0].decl.span)),)
                    self.report.error(
                        "E106", f"'{name}' is declared twice", self.place(statement.decl.span), related=related
                    )
                    continue
                found[name] = (statement, loops)
        for name in self._by_dependence(found):
            statement, loops = found[name]
            try:
                with self._inside(loops):
                    self._parameter(statement)
            except Failed:
                self.scope.broken.add(name)

    def _by_dependence(self, found: dict[str, tuple[syntax.Param, tuple[syntax.For, ...]]]) -> list[str]:
        needs = {name: _names_in(statement) & found.keys() for name, (statement, _) in found.items()}
        order: list[str] = []
        state: dict[str, int] = {}
        for start in found:
            stack = [(start, False)]
            while stack:
                name, done = stack.pop()
                if done:
                    state[name] = 2
                    order.append(name)
                elif name not in state:
                    state[name] = 1
                    stack.append((name, True))
                    for other in sorted(needs[name]):
                        if state.get(other) == 1:
                            span = found[name][0].span
                            message = (
                                f"circular definition: {other} -> {name} -> {other}"
                                if other != name
                                else f"circular definition: {name} -> {name}"
                            )
                            self.report.error("E105", message, self.place(span))
                        elif other not in state:
                            stack.append((other, False))
        return order

    def _parameter(self, statement: syntax.Param) -> None:
        decl = statement.decl
        place = self.place(decl.span)
        unit = self._unit(statement.unit) if statement.unit else None
        shape = self._shape(decl)
        indices = tuple(loop.index for loop in self.resolver.loops) if self.resolver.loops else ()
        if indices and not decl.indices:
            raise self.resolver.fail("E806", f"'{decl.name}' needs its loop variable: {decl.name}[i]", decl.span)
        values: tuple[Node, ...] = ()
        truth = False
        if statement.value is not None:
            values, unit, truth = self._default(statement, unit, shape)
        if unit is None:
            raise self.resolver.fail("E207", f"'{decl.name}' has neither a unit nor a default", decl.span)
        self._enter(ParameterSymbol(decl.name, shape, unit.dimension, truth, place))
        self.parameters[decl.name] = Parameter(decl.name, shape, unit, values, indices, place)

    def _default(self, statement: syntax.Param, unit: Unit | None, shape: Shape) -> tuple[tuple[Node, ...], Unit, bool]:
        assert statement.value is not None
        value = self.resolver.resolve(statement.value)
        items = value.items if isinstance(value, Vector) else (value,)
        for item in items:
            self._is_run_constant(item.node, statement)
        if isinstance(value, Vector) and (len(shape) != 1 or not self._fits(shape, len(items))):
            message = f"'{statement.decl.name}' has {len(items)} values, which do not fit its shape"
            raise self.resolver.fail("E805", message, statement.value.span)
        known = [i.dimension for i in items if i.dimension is not None]
        dimension = unit.dimension if unit is not None else (known[0] if known else NONE)
        for item in items:
            if item.dimension is not None and item.dimension != dimension:
                have, want = dim.show(item.dimension), dim.show(dimension)
                is_ = "dimensionless" if have == "dimensionless" else f"in {have}"
                message = f"'{statement.decl.name}' is declared {want} but its default is {is_}"
                if unit is None:
                    message = f"the values of '{statement.decl.name}' differ: {want} and {have}"
                help_ = self._with_unit(statement.value, unit) if have == "dimensionless" else None
                raise self.resolver.fail("E207", message, statement.value.span, help=help_)
        truth = isinstance(value, Typed) and value.truth
        nodes = tuple(i.node for i in items)
        if truth:
            nodes = (ex.conditional(nodes[0], ex.const(1.0), ex.const(0.0)),)
        return nodes, unit or self._default_unit(statement.value, dimension), truth

    def _with_unit(self, value: syntax.Expr, unit: Unit | None) -> str | None:
        return f"write '{value.text} {unit.text}'" if isinstance(value, syntax.Number) and unit else None

    def _default_unit(self, value: syntax.Expr, dimension: Dimension) -> Unit:
        if isinstance(value, syntax.Negative):
            value = value.operand
        if isinstance(value, syntax.Quantity):
            found = read_unit(value.unit, self.scope, self.resolver.source, self.report)
            if found is not None:
                return found
        return si(dimension)

    def _is_run_constant(self, node: Node, statement: syntax.Param) -> None:
        for inner in ex.topological([node]):
            if inner.op in ("var", "time"):
                message = f"parameter '{statement.decl.name}' depends on '{inner}': a parameter is a constant"
                raise self.resolver.fail("E807", message, statement.value.span if statement.value else statement.span)

    def _fits(self, shape: Shape, count: int) -> bool:
        first, last = shape[0]
        if not (ex.is_const(first) and ex.is_const(last)):
            return False
        return int(last.data) - int(first.data) + 1 == count

    # -- statements ----------------------------------------------------------------------------------------

    def _constraint(self, s: syntax.Constraint) -> None:
        place = self.place(s.span)
        if s.relation != "=":
            what = "inequality" if s.kind != "gamma" else "inequality of a gamma"
            raise self.resolver.fail(
                "N608",
                f"{s.kind} {s.decl.name}: an {what} is not supported yet (planned: events and inequalities)",
                s.span,
            )
        for guard in s.guards:
            if guard.kind == "restitution":
                message = f"{s.kind} {s.decl.name}: restitution on an equality"
                raise self.resolver.fail("E514", message, guard.span, help=f"{s.kind} ... >=")
            raise self.resolver.fail(
                "N608", f"{s.kind} {s.decl.name}: 'while' is not supported yet (planned: events)", guard.span
            )
        left, right = self.resolver.scalar(s.left), self.resolver.scalar(s.right)
        dimension = self._sides(f"{s.kind} {s.decl.name}", left, right, s.right)
        at = tuple(self.resolver.whole_number(i, "an index") for i in s.decl.indices if not isinstance(i, syntax.Range))
        loops = {ex.index(loop.index) for loop in self.resolver.loops}
        used = {n for a in at for n in ex.topological([a]) if n.op == "index"}
        if loops - used:
            message = f"'{s.decl.name}' stands in a 'for': its label needs the loop variable"
            raise self.resolver.fail("E106", message, s.decl.span, help=f"{s.decl.name}[i]")
        node = ex.sub(left.node, right.node)
        constraint = Constraint(s.kind, s.decl.name, at, node, self.resolver.loops, si(dimension), place)
        self.constraints.append(constraint)
        self.resolver.constraints.setdefault(s.decl.name, []).append(constraint)

    def _sides(self, what: str, left: Typed, right: Typed, where: syntax.Expr) -> Dimension:
        if left.dimension is None or right.dimension is None or left.dimension == right.dimension:
            return (left.dimension if left.dimension is not None else right.dimension) or NONE
        message = f"{what}: the two sides differ: {dim.show(left.dimension)} and {dim.show(right.dimension)}"
        help_ = self.resolver.missing(left.dimension, right.dimension)
        raise self.resolver.fail("E208", message, where.span, help=help_)

    def _wants(self, what: str, expression: syntax.Expr, dimension: Dimension) -> Node:
        value = self.resolver.scalar(expression)
        if value.dimension is not None and value.dimension != dimension:
            want, have = dim.show(dimension), dim.show(value.dimension)
            factor = dim.show(dim.quotient(dimension, value.dimension))
            message = f"{what}: {want} expected, {have} found (factor: {factor})"
            help_ = self.resolver.missing(value.dimension, dimension)
            raise self.resolver.fail("E208", message, expression.span, help=help_)
        return value.node

    def _energy(self, s: syntax.Energy) -> None:
        node = self._wants(f"energy {s.function}", s.value, dim.ENERGY)
        self.energies.append(Energy(s.function, node, self.resolver.loops, self.place(s.span)))

    def _content(self, s: syntax.Content) -> None:
        node = self._wants(f"content {s.function}", s.value, dim.POWER)
        self.energies.append(Energy(s.function, node, self.resolver.loops, self.place(s.span)))

    def _work(self, s: syntax.Work) -> None:
        effort, on = self.resolver.scalar(s.effort), self.resolver.scalar(s.on)
        self._is_displacement(on.node, s.on)
        if effort.dimension is not None and on.dimension is not None:
            found = multiply(effort.dimension, on.dimension)
            if found != dim.ENERGY:
                factor = dim.show(dim.quotient(dim.ENERGY, found))
                message = f"work: effort*displacement is {dim.show(found)}, not J (factor: {factor})"
                raise self.resolver.fail("E208", message, s.effort.span, help=self.resolver.missing(found, dim.ENERGY))
        self.works.append(Work(effort.node, on.node, self.resolver.loops, self.place(s.span)))

    def _is_displacement(self, node: Node, where: syntax.Expr) -> None:
        others = [n for n in ex.variables(node) if n.op == "var" and n.data[1] not in ("q", "s")]
        if others:
            what = f"the flow {others[0]}" if others[0].data[1] == "f" else f"{others[0]}, which is no displacement"
            message = f"work on an expression that contains {what}"
            raise self.resolver.fail("E319", message, where.span, help="work is done on displacements: work E on q")

    def _dynamic(self, s: syntax.Dynamic) -> None:
        target = s.target.base if isinstance(s.target, syntax.Prime) else s.target
        value = self.resolver.scalar(target)
        if not isinstance(s.target, syntax.Prime) or value.node.op != "var" or value.node.data[1] != "s":
            raise self.resolver.fail(
                "E508", "a dynamic gives the rate of a state", s.target.span, help="dynamic s' = ..."
            )
        rate = dim.quotient(value.dimension or NONE, dim.TIME)
        node = self._wants(f"dynamic {value.node}'", s.value, rate)
        for inner in sorted(ex.variables(node), key=lambda n: n.number):
            if inner.op == "var" and inner.data[2]:
                message = f"dynamic {value.node}' = ... contains {inner}"
                help_ = f"define {inner.data[0]} first, or use a gamma"
                raise self.resolver.fail("E508", message, s.value.span, help=help_)
        self.dynamics.append(Dynamic(value.node, node, self.resolver.loops, self.place(s.span)))

    def initial(self, s: syntax.Init, override: bool = False) -> None:
        """`init ref = value`, in a model or (override) in a scene."""
        with ExitStack() as stack:
            target_syntax = self._sliced(s.target, stack)
            target = self.resolver.scalar(target_syntax)
            message = f"'{target.node}' is in {dim.show(target.dimension)} but starts at {{}}"
            value = self.resolver.wanted(s.initial.value, target.dimension or NONE, "E207", message)
            for inner in ex.variables(value):
                message = f"the initial value of '{target.node}' depends on '{inner}'"
                raise self.resolver.fail("E807", message, s.initial.value.span, help="parameters and constants only")
            fixed = s.initial.kind == "fixed"
            self.add_initial(Initial(target.node, value, fixed, self.resolver.loops, self.place(s.span)), override)

    def _sliced(self, target: syntax.Expr, stack: ExitStack) -> syntax.Expr:
        """`x[1..n].f` becomes a loop over x[i].f."""
        if isinstance(target, syntax.Member):
            return syntax.Member(self._sliced(target.base, stack), target.name, target.span)
        if isinstance(target, syntax.Prime):
            return syntax.Prime(self._sliced(target.base, stack), target.span)
        if isinstance(target, syntax.Item) and any(isinstance(i, syntax.Range) for i in target.indices):
            at: list[syntax.Index] = []
            for k, index in enumerate(target.indices):
                if isinstance(index, syntax.Range):
                    name = f"i{k + 1}"
                    first, last = self._bounds(index)
                    stack.enter_context(self.resolver.loop(name, first, last))
                    at.append(syntax.Name(name, index.span))
                else:
                    at.append(index)
            return syntax.Item(target.base, tuple(at), target.span)
        if isinstance(target, syntax.Name):
            symbol = self.scope.find(target.name)
            if isinstance(symbol, UnknownSymbol) and symbol.shape:
                names = []
                for k, (first, last) in enumerate(symbol.shape):
                    stack.enter_context(self.resolver.loop(f"i{k + 1}", first, last))
                    names.append(syntax.Name(f"i{k + 1}", target.span))
                return syntax.Item(target, tuple(names), target.span)
        return target

    def _require(self, s: syntax.Require) -> None:
        node = self.resolver.condition(s.condition)
        text = format_expression(s.condition)
        self.requirements.append((node, self.resolver.loops, self.place(s.span), text))

    def expect(self, s: syntax.Expect) -> None:
        """`expect`, in a model or in a scene."""
        moment = s.moment or "always"
        at = None
        if s.at is not None:
            at = self.resolver.wanted(s.at, dim.TIME, "E208", "expect at: an instant is wanted, {} found")
        self.resolver.statics = moment == "static"
        try:
            left, right = self.resolver.scalar(s.left), self.resolver.scalar(s.right)
            dimension = self._sides("expect", left, right, s.right)
            message = f"expect: within is in {{}}, wants {dim.show(dimension)}"
            within = None if s.within is None else self.resolver.wanted(s.within, dimension, "E208", message)
        finally:
            self.resolver.statics = False
        text = self.source_text(s.span)
        self.expectations.append(
            Expectation(moment, at, s.op, left.node, right.node, within, si(dimension), text, self.place(s.span))
        )

    def source_text(self, span: syntax.Span) -> str:
        """The author's text of a span on one line."""
        return " ".join(self.resolver.source.text[span.start : span.end].split())

    def golden(self, s: syntax.Golden) -> None:
        """`expect golden`, in a model or in a scene."""
        within = self.resolver.wanted(s.within, NONE, "E208", "expect golden: within is a ratio, {} found")
        self.goldens.append(Golden(s.file, within, self.place(s.span)))

    def _definitions(self) -> None:
        """Resolve every let and output once, so that unused ones are checked too."""
        for symbol in list(self.scope.symbols.values()):
            if isinstance(symbol, Definition):
                try:
                    self.resolver.definition(symbol)
                except Failed:
                    continue


_STATEMENTS: dict[type, Callable[..., None]] = {
    syntax.Energy: Elaborator._energy,
    syntax.Content: Elaborator._content,
    syntax.Work: Elaborator._work,
    syntax.Dynamic: Elaborator._dynamic,
    syntax.Init: Elaborator.initial,
    syntax.Require: Elaborator._require,
    syntax.Expect: Elaborator.expect,
    syntax.Golden: Elaborator.golden,
}


def _flatten(body: Sequence[syntax.Statement], loops: tuple[syntax.For, ...]) -> Iterator[Nested]:
    for statement in body:
        if isinstance(statement, syntax.For):
            yield from _flatten(statement.body, (*loops, statement))
        else:
            yield statement, loops


def _declared(statement: syntax.Statement) -> tuple[syntax.Decl, ...]:
    """The names that a statement declares."""
    decls: tuple[syntax.Decl, ...] = getattr(statement, "decls", ())
    own = getattr(statement, "decl", None)
    return decls if own is None else (*decls, own)


def _names_in(statement: syntax.Param) -> set[str]:
    roots: list[object] = [statement.value, *statement.decl.indices]
    return {n.name for r in roots if r is not None for n in walk(r) if isinstance(n, syntax.Name)}  # type: ignore[arg-type]
