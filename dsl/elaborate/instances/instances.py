"""Instances: `label: component(arguments) connections`, from elements between nodes to components within components.

A builtin element becomes a branch (or two) with its law.  A component is a macro with a scope of its own: its ports
are bound to nodes, its inputs to expressions, its parameters to values where the instance stands; then its body is
elaborated under the label's path.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from itertools import pairwise

from sysdyn.dsl.elaborate.files import FileScope, library_components
from sysdyn.dsl.elaborate.instances.elements import Elements
from sysdyn.dsl.elaborate.instances.head import Body, Interface
from sysdyn.dsl.elaborate.instances.levels import choose_level, elsewhere
from sysdyn.dsl.elaborate.instances.moulds import Moulds, charge
from sysdyn.dsl.elaborate.instances.port_binding import PortRequest, Ports
from sysdyn.dsl.elaborate.instances.unit_variables import solve_units
from sysdyn.dsl.elaborate.parts import ElaborationContext, flatten
from sysdyn.dsl.elaborate.statements.declarations import DECLARED, Declarations
from sysdyn.dsl.elaborate.statements.inputs import Inputs
from sysdyn.dsl.elaborate.statements.parameters import Argument
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import LevelChoice
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
from sysdyn.dsl.names.symbols import (
    ComponentSymbol,
    InstanceSymbol,
    Scope,
    Space,
    Unsupported,
    nearest,
)
from sysdyn.dsl.text.diagnostics import Place, Related, Report
from sysdyn.dsl.tree import syntax

BUILTINS = (*ONE_PORTS, *TWO_PORTS)


def _range_text(bounds: tuple[Node, Node]) -> str:
    first, last = map(to_text, bounds)
    return first if first == last else f"{first}..{last}"


class Instances:
    """Elaborates instances."""

    def __init__(
        self,
        context: ElaborationContext,
        files: FileScope,
        declarations: Declarations,
        inputs: Inputs,
        element_builder: Elements,
    ) -> None:
        self.context, self.resolver, self.files = context, context.resolver, files
        self.declarations, self.parameters, self.inputs = declarations, declarations.parameters, inputs
        self.element_builder, self.connections = element_builder, element_builder.connections
        self.ports = Ports(context, self.connections)
        self.bodies: list[tuple[Space, Body]] = []
        self.choices: dict[str, LevelChoice] = {}
        self.levels: dict[str, tuple[str, Place]] = {}  # by path: a scene's and the command line's
        self._waiting: dict[int, list[Callable[[], None]]] = {}  # instances not yet elaborated, by their symbol
        self._moulds = Moulds()
        self._insides: dict[tuple[int, str | None], tuple[ComponentSymbol, Body]] = {}  # by component and level
        self.resolver.awaken = self._awaken

    def announce(self, body: Body) -> None:
        """Enter the labels of all instances, then elaborate each (or earlier, when another asks for it)."""
        waiting = []
        unfinished = self._unread_elements(body)
        for statement, loops in body.statements_of(syntax.InstanceStatement):
            assert isinstance(statement, syntax.InstanceStatement)
            try:
                if id(statement) in unfinished:
                    raise Failed
                waiting.append(self._plan(statement, loops))
            except Failed:
                self.context.scope.broken.add(statement.decl.name)
        for do in waiting:
            do()
        self.context.scope.announced.clear()

    def _unread_elements(self, body: Body) -> list[int]:
        """Elements whose connections stand, indented, on a line that could not be read: nothing is said of them."""
        if not body.statements_of(syntax.BrokenStatement):
            return []
        text = self.context.current.source.text
        pairs = pairwise(statement for statement, _ in body)
        return [
            id(s)
            for s, then in pairs
            if isinstance(then, syntax.BrokenStatement) and _column(text, then) > _column(text, s)
        ]

    def _plan(self, s: syntax.InstanceStatement, loops: tuple[syntax.ForStatement, ...]) -> Callable[[], None]:
        """What is to be done of an instance when it is read or its turn comes: a builtin, or a component."""
        name = s.component.names[0]
        symbol = self.context.scope.component(name)
        label = s.decl.name
        # `R: dissipator(...)` is of the language itself, unless a file declares a component of that name
        if symbol is None and name in BUILTINS and len(s.component.names) == 1:
            return self._once(label, lambda: self.context.each([(s, loops)], self.element_builder.add_builtin))
        if isinstance(symbol, Unsupported):
            raise Failed
        # a component that nobody declared: a near name, or the import that would bring it
        if symbol is None:
            if self.context.scope.is_broken(name):
                raise Failed
            components = [
                n for n in self.context.scope.names() if isinstance(self.context.scope.component(n), ComponentSymbol)
            ]
            library = library_components()
            near = name if name in library else nearest(name, (*components, *BUILTINS, *library))
            help_ = f"nearest name in scope: '{near}'" if near else "sysdyn std lists the library"
            if near in library and near not in components:
                help_ = f"from std.{library[near]} import {near}"
            # once for a name: its other instances are not reported again
            self.context.scope.broken.add(name)
            raise self.resolver.fail("E101", f"unknown component '{name}'", s.component.span, help=help_)
        # `R[1..3]: resistor(...)`: a label names one element
        ranges = [i for i in s.decl.indices if isinstance(i, syntax.Range)]
        if ranges:
            help_ = f"for i in {self.context.source_text(ranges[0].span)} {{ {label}[i]: ... }}"
            said = f"'{label}' names one element here: a 'for' makes an array of them"
            raise self.resolver.fail("E806", said, ranges[0].span, help=help_)
        # the parts of one array (`R[1]: ...`, `R[2]: ...`) share a symbol
        before = self.context.scope.symbols.get(label)
        if not isinstance(before, InstanceSymbol):
            before = InstanceSymbol(label, self.context.place(s.decl.span))
            self.context.enter(before)
        elif not s.decl.indices:
            related = (Related("first declared here", before.place),)
            self.context.report.error(
                "E106", f"'{label}' is declared twice", self.context.place(s.decl.span), related=related
            )
            raise Failed
        return self._wait(before, s, loops, symbol)

    def _once(self, label: str, enter: Callable[[], None]) -> Callable[[], None]:
        """What enters an element in its turn, or before it when an instance above reads it."""
        here, done = self.context.current, list[bool]()

        def elaborate() -> None:
            if not done:
                done.append(True)
                enter()

        def early() -> None:
            with self.context.entering(here):
                elaborate()

        self.context.scope.announced.setdefault(label, []).append(early)
        return elaborate

    def _wait(
        self,
        symbol: InstanceSymbol,
        s: syntax.InstanceStatement,
        loops: tuple[syntax.ForStatement, ...],
        component: ComponentSymbol,
    ) -> Callable[[], None]:
        """The instance is elaborated once, by whoever needs it first."""
        here = self.context.current
        done: list[bool] = []

        def elaborate() -> None:
            if done:
                return
            done.append(True)
            body = None if loops else self._moulds.body(self, component, s)
            if (
                body is not None
                and here is self.context.current
                and self._moulds.cast(self, symbol, s, component, body)
            ):
                return
            said = len(self.context.report)
            with self.context.entering(here):
                self.context.each([(s, loops)], lambda statement: self._component(symbol, statement, component))
            if body is not None and said == len(self.context.report):
                self._moulds.keep(self, symbol, s, body, here)

        self._waiting.setdefault(id(symbol), []).append(elaborate)
        return elaborate

    def _awaken(self, symbol: InstanceSymbol) -> None:
        """Another statement reads an instance that has not been elaborated yet."""
        for do in self._waiting.pop(id(symbol), ()):
            do()

    def _component(self, symbol: InstanceSymbol, s: syntax.InstanceStatement, component: ComponentSymbol) -> None:
        """One instance of a component: its path and level, then its body; E801 where it contains itself."""
        chain = (*self.context.current.chain, self.context.current.component)
        # a component that has itself inside, at any depth
        if component.name in chain:
            around = (*chain[chain.index(component.name) :], component.name)
            raise self.resolver.fail("E801", f"component contains itself: {' -> '.join(around)}", s.component.span)
        charge(self, s, component)
        at, shape = self.connections.label_indices(s)
        path = self.context.current.family(s.decl.name).name
        # several statements of one label: the later ones have their range in the path
        number = len(symbol.spaces)
        scope = Scope(component.file_scope)
        space = Space(
            path=path if not number else f"{path}[{', '.join(map(_range_text, shape))}]",
            scope=scope,
            file_scope=component.file_scope,
            source=component.source,
            loops=self.resolver.loops,
            prefix=(*self.context.current.prefix, *at),
            around=(*self.context.current.around, *shape),
            own=len(shape),
            component=component.name,
            chain=chain,
        )
        level, body = choose_level(self, component, s, path)
        space.level, space.elsewhere = level, elsewhere(component, level)
        self._fill(symbol, s, component, space, self.inside_of(component, level, body))

    def inside_of(self, component: ComponentSymbol, level: str | None, body: tuple[syntax.Statement, ...]) -> Body:
        """The statements of a component at a level: one value for all instances."""
        key = id(component), level
        if key not in self._insides:
            self._insides[key] = component, Body(flatten(body))
        return self._insides[key][1]

    def _fill(
        self, symbol: InstanceSymbol, s: syntax.InstanceStatement, component: ComponentSymbol, space: Space, body: Body
    ) -> None:
        """Arguments and connections, then the statements of the body, in the space of the instance."""
        head, broken, place = body.head, body.statements_of(syntax.BrokenStatement), self.context.place(s.span)
        # a component with lines that could not be read: what seems to be missing may stand there
        with self._unread() if broken else nullcontext():
            arguments, inputs = self._arguments(s, component, head, space)
            self.ports.connect(PortRequest(s, component, head, space, inputs))
        # `$u` in units: found from the arguments before anything is declared
        if head.generic:
            solve_units(self, s, space, head, arguments, inputs)
        symbol.spaces.append(space)
        # parameters first: sizes of ports and bounds of loops may read them
        with self.context.entering(space):
            for statement, _ in broken:
                assert isinstance(statement, syntax.BrokenStatement)
                self.context.scope.broken |= statement.names
            self.parameters.declare_parameters(body, arguments)
            self.ports.port_shapes(s, head)
            self._require_values(s, place, component, head, arguments)
        if head.inputs:
            self.inputs.bind_inputs(s, space, head, inputs)
        with (
            self.context.entering(space)
            if body.with_loops(DECLARED) or body.statements_of(syntax.InstanceStatement)
            else nullcontext()
        ):
            self.declarations.declare_all(body, self.declarations.declare)
            self.bodies.append((space, body))
            self.announce(body)

    @contextmanager
    def _unread(self) -> Iterator[None]:
        """What connects a component that lost a statement is no mistake: its port may stand there."""
        before, silent = self.context.report, Report()
        self.context.report = self.resolver.report = silent
        try:
            yield
        except Failed:
            self.files.scope.missed = True
            raise
        finally:
            self.context.report = self.resolver.report = before
            before.extend(d for d in silent if not d.code.startswith("E4"))

    def _arguments(
        self, s: syntax.InstanceStatement, component: ComponentSymbol, head: Interface, space: Space
    ) -> tuple[dict[str, Argument], dict[str, syntax.Expr]]:
        """Values of parameters, and inputs; those that a level chosen by the scene has no use for are left out."""
        found: dict[str, Argument] = {}
        inputs: dict[str, syntax.Expr] = {}
        others = set(space.elsewhere) - set(head.parameters) if space.path in self.levels else ()
        for arg in s.args or ():
            # `resistor(5 ohm)`
            if arg.name is None:
                text = self.context.source_text(arg.span)
                taken: dict[str, syntax.ParamStatement | syntax.InputStatement] = {**head.parameters, **head.inputs}
                names = [n for n, p in taken.items() if p.value is None] or [*taken]
                help_ = (
                    f"{names[0]} = {text}"
                    if len(names) == 1
                    else f"name it: {', '.join(taken)}"
                    if taken
                    else "leave it out"
                )
                message = f"'{text}' is a positional argument: those of '{component.name}' are named"
                raise self.resolver.fail("E404", message, arg.span, help=help_)
            # `resistor(R = 1 ohm, R = 2 ohm)`
            if arg.name in found or arg.name in inputs:
                message = f"'{arg.name}' of '{s.decl.name}' is given twice"
                raise self.resolver.fail("E106", message, arg.span, help="one of the two")
            # an input may vary: it is bound when the names of the body are known
            if arg.name in head.inputs:
                inputs[arg.name] = arg.value
                continue
            # another level of the component has it, and the scene chose this one
            if arg.name in others:
                message = f"'{s.decl.name}' has no parameter '{arg.name}' at level {space.level}: left out"
                self.context.report.note("N905", message, Place(self.resolver.source, arg.span))
                continue
            # `resistor(a = n1)`: ports stand behind the parentheses
            if arg.name in head.ports:
                text = self.context.source_text(arg.value.span)
                message = f"'{arg.name}' of '{component.name}' is a port: it stands behind the parentheses"
                raise self.resolver.fail("E405", message, arg.span, help=f"{component.name}(...) {arg.name} = {text}")
            # no such name at any level
            if arg.name not in head.parameters:
                near = nearest(arg.name, (*head.parameters, *head.inputs))
                known = ", ".join((*head.parameters, *head.inputs))
                listed = f"nearest: '{near}'" if near else f"it has {known or 'none'}"
                raise self.resolver.fail(
                    "E405", f"'{component.name}' has no parameter '{arg.name}'", arg.span, help=listed
                )
            value, bare = self.resolver.resolve(arg.value), self.resolver.bare(arg.value)
            found[arg.name] = Argument(arg.value, value, bare, Place(self.resolver.source, arg.span))
        return found, inputs

    def _require_values(
        self,
        s: syntax.InstanceStatement,
        place: Place,
        component: ComponentSymbol,
        head: Interface,
        given: dict[str, Argument],
    ) -> None:
        """Report parameters of a component that neither its text nor the instance gives a value (E406)."""
        for name, statement in head.parameters.items():
            if statement.value is None and name not in given:
                unit = statement.unit.text if statement.unit else "..."
                message = f"parameter '{name}' of '{component.name}' has no value"
                help_, subject = f"{component.name}({name} = ... {unit})", f"value {self.context.current.path}.{name}"
                self.context.report.error("E406", message, place, help=help_, subject=subject)


def _column(text: str, statement: syntax.Statement) -> int:
    """How far from the left a statement begins."""
    return statement.span.start - text.rfind("\n", 0, statement.span.start)
