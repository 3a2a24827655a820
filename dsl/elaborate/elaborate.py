"""From a model as written to its parts: declarations first, then elements, then every statement resolved.

A statement inside `for` is resolved once with its loops; a component is elaborated once a statement that instantiates
it.  What a later issue builds is reported as N608 with its place, and the rest is still checked.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import groupby

from sysdyn.dsl.elaborate.files import FileScope
from sysdyn.dsl.elaborate.instances.connections import Connections
from sysdyn.dsl.elaborate.instances.elements import Elements, Pending
from sysdyn.dsl.elaborate.instances.head import Body
from sysdyn.dsl.elaborate.instances.instances import Instances
from sysdyn.dsl.elaborate.instances.moulds import Likeness, law_of_cast, required_of
from sysdyn.dsl.elaborate.instances.port_efforts import NotSaidError, conjugate_of
from sysdyn.dsl.elaborate.parts import ElaborationContext, flatten
from sysdyn.dsl.elaborate.statements.declarations import Declarations
from sysdyn.dsl.elaborate.statements.inputs import Inputs
from sysdyn.dsl.elaborate.statements.parameters import ParameterDeclarations
from sysdyn.dsl.elaborate.statements.statements import STATEMENTS, Statements
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import Branch, Derived, Dynamic, InitialCondition, Loop, Observation, State, loop_indices
from sysdyn.dsl.model.rewriting import expressions
from sysdyn.dsl.model.units import Dimension, si
from sysdyn.dsl.names.failures import Failed, NotYetError, SeveralError
from sysdyn.dsl.names.symbols import Definition, End, Scope, Space, Typed
from sysdyn.dsl.text.diagnostics import Place, Related, Report
from sysdyn.dsl.tree import syntax

_ALONE = (
    syntax.InputStatement,
    syntax.PortStatement,
    syntax.BranchStatement,
    syntax.LawStatement,
    syntax.LevelStatement,
)
"""Statements that a model reads otherwise than a component does, or refuses."""
_STATED = tuple(STATEMENTS)
"""Statements that make equations, in the order in which they are resolved."""


_MOVING = (syntax.EnergyStatement, syntax.ContentStatement, syntax.WorkStatement, syntax.DynamicStatement)
"""Those that move something: what they differentiate must not jump."""


class Elaborator:
    """Elaborates one model of a file."""

    def __init__(self, files: FileScope, model: syntax.ModelDefinition, report: Report) -> None:
        self.context = context = ElaborationContext(report)
        self.resolver, self.parts = context.resolver, context.parts
        self.files = files
        self.model = model
        self.source = files.file.source
        self.space = Space("", Scope(files.scope), files.scope, self.source, component=model.name.name)
        self._body = Body(flatten(model.body))
        # each concern is handed those that it needs
        self.parameters = ParameterDeclarations(context)
        self.declarations = Declarations(context, self.parameters)
        self.equations = Statements(context, self.declarations)
        self.element_builder = Elements(context, Connections(context, self.equations))
        self.inputs = Inputs(context, files, self.space)
        self.instances = Instances(context, files, self.declarations, self.inputs, self.element_builder)
        self.resolver.taken = self.effort_into
        self.resolver.discretes = self.parts.discretes

    def names(self) -> None:
        """Bring the model's names into scope; values of inputs may change until `elements`."""
        with self.context.entering(self.space):
            for statement, _ in self._body.statements_of(syntax.BrokenStatement):
                assert isinstance(statement, syntax.BrokenStatement)
                self.context.scope.broken |= statement.names
            self.parameters.declare_parameters(self._body, {})
            self.declarations.declare_all(self._body, self._declare_statement, _ALONE)
            self.instances.bodies.append((self.space, self._body))

    def _declare_statement(self, statement: syntax.Statement) -> None:
        """Statements that stand in components alone are refused in a model; the others declared."""
        match statement:
            # `input u: N` of a model: what drives it from outside
            case syntax.InputStatement():
                self.inputs.model_input(statement)
            # of components alone: whatever is outside connects to them, and outside of a model there is nothing
            case syntax.PortStatement() | syntax.BranchStatement():
                what = "port" if isinstance(statement, syntax.PortStatement) else "branch"
                message = f"a model has no {what}: nothing could be connected to it"
                raise self.resolver.fail("E408", message, statement.span, help="node, or a component")
            # `e = R*f` needs the branch of a component whose law it is
            case syntax.LawStatement():
                raise self.resolver.fail("E303", "a law stands in a component with a branch", statement.span)
            case syntax.LevelStatement():
                raise self.resolver.fail("E803", "levels belong to components", statement.span)
            # param, coord, node, let, ...: in models as in components
            case _:
                self.declarations.declare(statement)

    def elements(self) -> None:
        """Elaborate the model's instances and those inside them; their laws follow once sizes are set (`settle`)."""
        with self.context.entering(self.space):
            self.instances.announce(self._body)
        self._carry_out(syntax.LawStatement, self.element_builder.law)

    def settle(self) -> None:
        """The laws of all branches."""
        for _, group in groupby(self.element_builder.pending, key=lambda pending: id(pending.space)):
            own = list(group)
            with nullcontext() if isinstance(own[0].space, Likeness) else self.context.entering(own[0].space):
                for pending in own:
                    self.settle_law(pending)
        for space, _ in self.instances.bodies:
            if space.ends.keys() - space.laws.keys():
                with self.context.entering(space):
                    self.element_builder.lawless(space)

    def settle_law(self, pending: Pending) -> None:
        """A law; one that reads a constraint waits for it."""
        try:
            pending.resolve()
        except SeveralError as several:
            self.resolver.spread(several, pending.span)
        except NotYetError as early:
            self.context.postpone(early, partial(self.settle_law, pending))
        except Failed:
            return

    def statements(self) -> None:
        """Resolve what the model and its instances say: constraints first, which others may read."""
        self.resolver.complete = True
        self._carry_out(syntax.ConstraintStatement, self.equations.constraint)
        self.context.run_postponed()
        for space, body in self.instances.bodies:
            if isinstance(space, Likeness):
                required_of(self, space, body)
                continue
            kinds = {type(s) for s, _ in body.statements_of(_STATED)}
            if not kinds and all(type(s) is not Definition for s in space.scope.symbols.values()):
                continue
            with self.context.entering(space):
                for kind in (k for k in _STATED if k in kinds):
                    with nullcontext() if kind in _MOVING else self.resolver.aside():
                        self.context.each(body.statements_of(kind), partial(STATEMENTS[kind], self.equations))
                with self.resolver.aside():
                    self._definitions()
        self.resolver.said = True
        self.parts.derived = [Derived(node, *at) for node, at in self.resolver.derived.items()]

    def _carry_out(self, kind: type[syntax.Statement], do: Callable[..., None]) -> None:
        """Carry out all statements of a kind, in the bodies where they stand."""
        for space, body in self.instances.bodies:
            chosen = body.statements_of(kind)
            if chosen and isinstance(space, Likeness):
                self.element_builder.pending.append(
                    Pending(space, space.mould.law.span, partial(law_of_cast, self, space))
                )
            elif chosen:
                with self.context.entering(space):
                    self.context.each(chosen, do)

    def quadratures(self) -> None:
        """States for the integrals that traces, lets and expectations read."""
        for name, found in self.resolver.quadratures.items():
            loops = tuple(Loop(f"#e{k}", first, last) for k, (first, last) in enumerate(found.shape))
            at = loop_indices(loops)
            state = ex.var(name, "s", *at)
            try:
                power = found.power() if callable(found.power) else found.power
            except Failed:
                continue
            self.parts.states.append(State(name, found.shape, si(found.dimension), found.place, measured=True))
            self.parts.dynamics.append(Dynamic(state, self._by_nodes(power), loops, found.place))
            self.parts.given.add(name)
            target = state if found.first is None else ex.sub(state, found.first)
            self.parts.initials.append(InitialCondition(target, ex.const(0.0), True, loops, found.place))

    def _by_nodes(self, power: ex.Node) -> ex.Node:
        """A power with the efforts of branches without a law (coils on one core) by their nodes: what makes them, the
        rate of several momenta, stands in no dynamic.
        """
        efforts = [n for n in ex.variables(power) if n.op == "var" and n.data[1:] == ("be", 0)]
        if not efforts:
            return power
        read = (n for e in self.parts.energies if e.function == "T*" for n in ex.variables(e.expression))
        kinetic = {n.data[0] for n in read if n.op == "var" and n.data[1] == "bf"}
        fields = {b.name: b for b in self.parts.branches if b.kind == "field" and b.domain.common == "effort"}
        change = {n: _between(fields[n.data[0]], n) for n in efforts if n.data[0] in kinetic & fields.keys()}
        return ex.substitute(power, change)

    def add_derivatives(self) -> None:
        """What branches along expressions differentiate by time, and integrals of these read."""
        parts = self.parts
        along = [(b, b.on) for b in parts.branches if b.on is not None]
        roots = expressions(parts, "dynamics", "energies", "works", "constraints", "branches.law") if along else ()
        read = {n.data[0] for root in roots for n in ex.variables(root) if n.op == "var" and n.data[1] == "bf"}
        moved = [(b, on) for b, on in along if b.kind not in ("potential", "effort") or b.name in read]
        parts.derived += [Derived(on, b.loops, replace(b.place, element=b.name)) for b, on in moved]

    def effort_into(self, space: Space, end: End, place: Place, *, rates: bool) -> ex.Node:
        """What an instance takes in at an end; place: where that is read."""
        try:
            return conjugate_of(self.parts, space, end, rates=rates)
        except NotSaidError as error:
            message = f"what goes into '{space.path}' through this port is not told yet: a statement inside {error}"
            related = (Related("this one", error.place),)
            self.context.report.note(
                "N608", message, place, related=related, help="elements inside, which end at the port"
            )
            raise Failed from None

    def _speed(self, symbol: Definition, node: ex.Node, dimension: Dimension) -> None:
        name = symbol.space.family(symbol.name).name
        self.parts.speeds.append(Observation(name, node, si(dimension), symbol.name, symbol.place, False))

    def _definitions(self) -> None:
        """Resolve every let, output and quasi-velocity once, so that unused ones are checked too."""
        for symbol in list(self.context.scope.symbols.values()):
            if isinstance(symbol, Definition):
                try:
                    value = self.resolver.definition(symbol)
                    if symbol.kind == "quasi" and isinstance(value, Typed):
                        with self.resolver.space(symbol.space):
                            self.equations.virtual(value.node, f"quasi '{symbol.name}'", symbol.span)
                        if not symbol.at and symbol.dimension is not None:
                            self._speed(symbol, value.node, symbol.dimension)
                except Failed:
                    continue


def _between(branch: Branch, effort: ex.Node) -> ex.Node:
    """The effort of a branch by its nodes; where an expression is in their place, as it is."""
    ends, here = (branch.plus, branch.minus), dict(zip(branch.at, effort.args, strict=True))
    if None in ends:
        return effort
    found = [ex.var(end.node, "ne", *end.at) if end and end.node else ex.const(0.0) for end in ends]
    return ex.substitute(ex.sub(*found), here)
