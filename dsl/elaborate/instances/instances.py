"""Instances: `label: component(arguments) connections`, from elements between nodes to components within components.

A builtin element becomes a branch (or two) with its law.  A component is a macro with a scope of its own: its ports
are bound to nodes, its inputs to expressions, its parameters to values where the instance stands; then its body is
elaborated under the label's path.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from itertools import pairwise

from sysdyn.dsl.elaborate.files import FileScope, exported
from sysdyn.dsl.elaborate.instances import bundles
from sysdyn.dsl.elaborate.instances.head import Body, Interface
from sysdyn.dsl.elaborate.instances.levels import choose_level, elsewhere
from sysdyn.dsl.elaborate.instances.moulds import Moulds, charge
from sysdyn.dsl.elaborate.instances.unit_variables import solve_units
from sysdyn.dsl.elaborate.parts import flatten
from sysdyn.dsl.elaborate.statements.declarations import DECLARED
from sysdyn.dsl.elaborate.statements.inputs import Inputs
from sysdyn.dsl.elaborate.statements.parameters import Argument
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import LevelChoice
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS, own_variables
from sysdyn.dsl.names.symbols import (
    BranchSymbol,
    BundleNode,
    BundleSymbol,
    ComponentSymbol,
    DomainSymbol,
    End,
    Family,
    InstanceSymbol,
    NodeSymbol,
    PortSymbol,
    Scope,
    Space,
    UnknownSymbol,
    Unsupported,
    coordinate_node,
    nearest,
)
from sysdyn.dsl.text.diagnostics import Place, Related, Report
from sysdyn.dsl.tree import syntax

BUILTINS = (*ONE_PORTS, *TWO_PORTS)


def _decl(statement: syntax.Port, name: str) -> syntax.Decl:
    return next(d for d in statement.decls if d.name == name)


def _range_text(bounds: tuple[Node, Node]) -> str:
    first, last = map(to_text, bounds)
    return first if first == last else f"{first}..{last}"


class Instances(Inputs):
    """Elaborates instances."""

    def __init__(self, report: Report) -> None:
        super().__init__(report)
        self.files: FileScope
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
        unfinished = self._unfinished(body)
        for statement, loops in body.of(syntax.Instance):
            assert isinstance(statement, syntax.Instance)
            try:
                if id(statement) in unfinished:
                    raise Failed
                waiting.append(self._announced(statement, loops))
            except Failed:
                self.scope.broken.add(statement.decl.name)
        for do in waiting:
            do()
        self.scope.announced.clear()

    def _unfinished(self, body: Body) -> list[int]:
        """Elements whose connections stand, indented, on a line that could not be read: nothing is said of them."""
        if not body.of(syntax.Broken):
            return []
        text = self.current.source.text
        pairs = pairwise(statement for statement, _ in body)
        return [
            id(s) for s, then in pairs if isinstance(then, syntax.Broken) and _column(text, then) > _column(text, s)
        ]

    def _announced(self, s: syntax.Instance, loops: tuple[syntax.For, ...]) -> Callable[[], None]:
        """What is to be done of an instance when it is read or its turn comes: a builtin, or a component."""
        name = s.component.names[0]
        symbol = self.scope.component(name)
        label = s.decl.name
        if symbol is None and name in BUILTINS and len(s.component.names) == 1:
            return self._once(label, lambda: self.each([(s, loops)], self._builtin))
        if isinstance(symbol, Unsupported):
            raise Failed
        if symbol is None:
            if self.scope.is_broken(name):
                raise Failed
            components = [n for n in self.scope.names() if isinstance(self.scope.component(n), ComponentSymbol)]
            library = exported()
            near = name if name in library else nearest(name, (*components, *BUILTINS, *library))
            help_ = f"nearest name in scope: '{near}'" if near else "sysdyn std lists the library"
            if near in library and near not in components:
                help_ = f"from std.{library[near]} import {near}"
            self.scope.broken.add(name)
            raise self.resolver.fail("E101", f"unknown component '{name}'", s.component.span, help=help_)
        ranges = [i for i in s.decl.indices if isinstance(i, syntax.Range)]
        if ranges:
            help_ = f"for i in {self.source_text(ranges[0].span)} {{ {label}[i]: ... }}"
            said = f"'{label}' names one element here: a 'for' makes an array of them"
            raise self.resolver.fail("E806", said, ranges[0].span, help=help_)
        before = self.scope.symbols.get(label)
        if not isinstance(before, InstanceSymbol):
            before = InstanceSymbol(label, self.place(s.decl.span))
            self.enter(before)
        elif not s.decl.indices:
            related = (Related("first declared here", before.place),)
            self.report.error("E106", f"'{label}' is declared twice", self.place(s.decl.span), related=related)
            raise Failed
        return self._wait(before, s, loops, symbol)

    def _once(self, label: str, enter: Callable[[], None]) -> Callable[[], None]:
        """What enters an element in its turn, or before it when an instance above reads it."""
        here, done = self.current, list[bool]()

        def elaborate() -> None:
            if not done:
                done.append(True)
                enter()

        def early() -> None:
            with self.entering(here):
                elaborate()

        self.scope.announced.setdefault(label, []).append(early)
        return elaborate

    def _wait(
        self, symbol: InstanceSymbol, s: syntax.Instance, loops: tuple[syntax.For, ...], component: ComponentSymbol
    ) -> Callable[[], None]:
        """The instance is elaborated once, by whoever needs it first."""
        here = self.current
        done: list[bool] = []

        def elaborate() -> None:
            if done:
                return
            done.append(True)
            body = None if loops else self._moulds.body(self, component, s)
            if body is not None and here is self.current and self._moulds.cast(self, symbol, s, component, body):
                return
            said = len(self.report)
            with self.entering(here):
                self.each([(s, loops)], lambda statement: self._component(symbol, statement, component))
            if body is not None and said == len(self.report):
                self._moulds.keep(self, symbol, s, body, here)

        self._waiting.setdefault(id(symbol), []).append(elaborate)
        return elaborate

    def _awaken(self, symbol: InstanceSymbol) -> None:
        """Another statement reads an instance that has not been elaborated yet."""
        for do in self._waiting.pop(id(symbol), ()):
            do()

    def _component(self, symbol: InstanceSymbol, s: syntax.Instance, component: ComponentSymbol) -> None:
        """One instance of a component: its path and level, then its body; E801 where it contains itself."""
        chain = (*self.current.chain, self.current.component)
        if component.name in chain:
            around = (*chain[chain.index(component.name) :], component.name)
            raise self.resolver.fail("E801", f"component contains itself: {' -> '.join(around)}", s.component.span)
        charge(self, s, component)
        at, shape = self._label(s)
        path = self.current.family(s.decl.name).name
        number = len(symbol.spaces)
        scope = Scope(component.file_scope)
        space = Space(
            path=path if not number else f"{path}[{', '.join(map(_range_text, shape))}]",
            scope=scope,
            file_scope=component.file_scope,
            source=component.source,
            loops=self.resolver.loops,
            prefix=(*self.current.prefix, *at),
            around=(*self.current.around, *shape),
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
        self, symbol: InstanceSymbol, s: syntax.Instance, component: ComponentSymbol, space: Space, body: Body
    ) -> None:
        """Arguments and connections, then the statements of the body, in the space of the instance."""
        head, broken = body.head, body.of(syntax.Broken)
        with self._unread() if broken else nullcontext():
            arguments, inputs = self._arguments(s, component, head, space)
            self._connect(s, component, head, space, inputs)
        if head.generic:
            solve_units(self, s, space, head, arguments, inputs)
        symbol.spaces.append(space)
        with self.entering(space):
            for statement, _ in broken:
                assert isinstance(statement, syntax.Broken)
                self.scope.broken |= statement.names
            self.declare_parameters(body, arguments)
            self._port_shapes(s, head)
            self._required(s, component, head, arguments)
        if head.inputs:
            self.bind_inputs(s, space, head, inputs)
        declared, instances = body.with_loops(DECLARED), body.of(syntax.Instance)
        with self.entering(space) if declared or instances else nullcontext():
            self.each(declared, self.declare)
            self.bodies.append((space, body))
            self.announce(body)

    @contextmanager
    def _unread(self) -> Iterator[None]:
        """What connects a component that lost a statement is no mistake: its port may stand there."""
        before, silent = self.report, Report()
        self.report = self.resolver.report = silent
        try:
            yield
        except Failed:
            self.files.scope.missed = True
            raise
        finally:
            self.report = self.resolver.report = before
            before.extend(d for d in silent if not d.code.startswith("E4"))

    def _arguments(
        self, s: syntax.Instance, component: ComponentSymbol, head: Interface, space: Space
    ) -> tuple[dict[str, Argument], dict[str, syntax.Expr]]:
        """Values of parameters, and inputs; those that a level chosen by the scene has no use for are left out."""
        found: dict[str, Argument] = {}
        inputs: dict[str, syntax.Expr] = {}
        others = set(space.elsewhere) - set(head.parameters) if space.path in self.levels else ()
        for arg in s.args or ():
            if arg.name is None:
                text = self.source_text(arg.span)
                taken: dict[str, syntax.Param | syntax.Input] = {**head.parameters, **head.inputs}
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
            if arg.name in found or arg.name in inputs:
                message = f"'{arg.name}' of '{s.decl.name}' is given twice"
                raise self.resolver.fail("E106", message, arg.span, help="one of the two")
            if arg.name in head.inputs:
                inputs[arg.name] = arg.value
                continue
            if arg.name in others:
                message = f"'{s.decl.name}' has no parameter '{arg.name}' at level {space.level}: left out"
                self.report.note("N905", message, Place(self.resolver.source, arg.span))
                continue
            if arg.name in head.ports:
                text = self.source_text(arg.value.span)
                message = f"'{arg.name}' of '{component.name}' is a port: it stands behind the parentheses"
                raise self.resolver.fail("E405", message, arg.span, help=f"{component.name}(...) {arg.name} = {text}")
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

    def _required(
        self, s: syntax.Instance, component: ComponentSymbol, head: Interface, given: dict[str, Argument]
    ) -> None:
        for name, statement in head.parameters.items():
            if statement.value is None and name not in given:
                place = Place(self._outer_source(s), s.span)
                unit = statement.unit.text if statement.unit else "..."
                message = f"parameter '{name}' of '{component.name}' has no value"
                help_, subject = f"{component.name}({name} = ... {unit})", f"value {self.current.path}.{name}"
                self.report.error("E406", message, place, help=help_, subject=subject)

    def _outer_source(self, s: syntax.Instance):  # type: ignore[no-untyped-def]
        return self._instance_source

    def _connect(
        self,
        s: syntax.Instance,
        component: ComponentSymbol,
        head: Interface,
        space: Space,
        inputs: dict[str, syntax.Expr],
    ) -> None:
        """Bind ports and branches; `inputs` takes the expressions of those that are connected."""
        self._instance_source = self.resolver.source
        bound: set[str] = set()
        for connection in s.connections:
            match connection:
                case syntax.Bind():
                    self._bind(s, component, head, space, connection, inputs, bound)
                case syntax.BindAcross():
                    self._bind_branch(s, component, head, space, connection.name.name, connection, bound)
                case syntax.Single() if len(head.branches) != 1 and len(head.ports) == 1:
                    name = next(iter(head.ports))
                    self._bind_port(s, head, space, name, connection.node)
                    bound.add(name)
                case _:
                    if len(head.branches) != 1:
                        raise self._by_name(s, component, head, connection)
                    self._bind_branch(s, component, head, space, next(iter(head.branches)), connection, bound)
        for name in (*head.ports, *head.branches):
            if name not in bound:
                what = f"port '{name}'" if name in head.ports else f"branch '{name}'" if name else "the branch"
                help_ = f"{name} = NODE, or {name} = ground" if name else "a -> b"
                raise self.resolver.fail("E408", f"{what} of '{s.decl.name}' is not connected", s.span, help=help_)
        for name, statement in head.inputs.items():
            if name not in inputs and statement.value is None:
                raise self.resolver.fail(
                    "E414", f"input '{name}' of '{s.decl.name}' is not bound", s.span, help=f"{name} = ..."
                )

    def _by_name(
        self, s: syntax.Instance, component: ComponentSymbol, head: Interface, connection: syntax.Connection
    ) -> Failed:
        """Report E402: nodes in a row where each belongs to a port of its own."""
        ports = [*head.ports, *filter(None, head.branches)]
        nodes = list[syntax.Expr]()
        for c in s.connections:
            nodes += [c.plus, c.minus] if isinstance(c, syntax.Across) else []
            nodes += [c.node] if isinstance(c, syntax.Single) else []
        bound = {c.name.name for c in s.connections if isinstance(c, (syntax.Bind, syntax.BindAcross))}
        across = [c for c in s.connections if isinstance(c, syntax.Across)]
        if len(across) > 1 and all(self.source_text(c.plus.span) in ports for c in across):  # `p -> a` for `p = a`
            nodes = [c.minus for c in across]
            bound |= set(ports) - {self.source_text(c.plus.span) for c in across}
        left = [name for name in (*ports, *head.inputs) if name not in bound]
        texts = iter([self.source_text(node.span) for node in nodes])
        pairs = []
        for name, text in zip(left, texts, strict=False):
            pairs.append(f"{name} = {text}" + (f" -> {next(texts, 'ground')}" if name in head.branches else ""))
        if not ports and not head.inputs:
            message = f"'{component.name}' has no port: nothing can be connected to '{s.decl.name}'"
            return self.resolver.fail("E402", message, connection.span, help="port a: electrical in the component")
        message = f"'{s.decl.name}: {component.name}' is connected by name: {', '.join((*ports, *head.inputs))}"
        return self.resolver.fail("E402", message, connection.span, help=", ".join(pairs))

    def _bind(
        self,
        s: syntax.Instance,
        component: ComponentSymbol,
        head: Interface,
        space: Space,
        connection: syntax.Bind,
        inputs: dict[str, syntax.Expr],
        bound: set[str],
    ) -> None:
        name = connection.name.name
        if name in inputs or (name in bound and name in head.ports):
            what = "input" if name in inputs else "port"
            message = f"{what} '{name}' of '{s.decl.name}' is bound twice"
            raise self.resolver.fail("E402", message, connection.span, help="one of the two")
        if name in head.inputs:
            inputs[name] = connection.value
        elif name in head.ports:
            self._bind_port(s, head, space, name, connection.value)
            bound.add(name)
        elif name in head.branches:
            single = syntax.Single(connection.value, connection.span)
            self._bind_branch(s, component, head, space, name, single, bound)
        else:
            near = nearest(name, (*head.ports, *head.inputs, *head.branches))
            names = ", ".join((*head.ports, *head.inputs, *filter(None, head.branches)))
            help_ = f"nearest: '{near}'" if near else f"it has {names or 'none'}"
            nodes = [s for s in component.body if isinstance(s, syntax.Node)]
            inner = next((s.domain.name for s in nodes if any(d.name == name for d in s.decls)), None)
            if inner is not None:
                help_ = f"port {name}: {inner} in component '{component.name}': a node is of its inside alone"
            if list(head.branches) == [""] and not head.ports and not head.inputs:  # its two ends have no names
                ends = [self._text(c.value) for c in s.connections if isinstance(c, syntax.Bind)]
                help_ = " -> ".join((*ends[:2], "ground")[:2])
            raise self.resolver.fail(
                "E407", f"'{component.name}' has no port or input '{name}'", connection.span, help=help_
            )

    def _bind_port(self, s: syntax.Instance, head: Interface, space: Space, name: str, value: syntax.Expr) -> None:
        word = head.ports[name].domain
        wanted = space.scope.find(word.name)
        place = self.place(value.span)
        if isinstance(wanted, BundleSymbol):
            space.scope.symbols[name] = self._bundle_bound(s, name, wanted, value)
            return
        if not isinstance(wanted, DomainSymbol):
            message = f"'{word.name}' is not a domain"
            self.report.error("E202", message, Place(space.source, word.span))
            raise Failed
        if _decl(head.ports[name], name).indices:
            space.scope.symbols[name] = self._array_bound(s, name, wanted, value)
            return
        bound_to = self.end(value, wanted)
        assert bound_to is not None
        self._same_domain(s, f"port '{name}'", wanted, bound_to, value)
        space.scope.symbols[name] = PortSymbol(name, bound_to, place)

    def _array_bound(self, s: syntax.Instance, name: str, wanted: DomainSymbol, value: syntax.Expr) -> NodeSymbol:
        """A port that is an array: the array of nodes that it is bound to, under the port's name."""
        found = self.resolver.located(value)
        symbol = None if found is None else found.symbol
        coordinate = symbol if isinstance(symbol, UnknownSymbol) else None
        if coordinate is not None:
            symbol = coordinate_node(coordinate)
        if found is None or not isinstance(symbol, NodeSymbol) or found.indices or not symbol.family.shape:
            message = f"port '{name}' of '{s.decl.name}' is an array, '{self._text(value)}' is no array of nodes"
            raise self.resolver.fail("E805", message, value.span, help=f"node a[1..3]: {wanted.name}, and {name} = a")
        own, place = symbol.family, self.place(value.span)
        prefix = tuple(ex.substitute(a, found.change) for a in own.prefix)
        node = NodeSymbol(name, Family(own.name, prefix, own.around, own.shape), symbol.domain, place, coordinate)
        self._same_domain(s, f"port '{name}'", wanted, End(node, (), symbol.domain), value)
        return node

    def _port_shapes(self, s: syntax.Instance, head: Interface) -> None:
        """E805: ports that are arrays have the bounds of the nodes that they are bound to."""
        for name, statement in head.ports.items():
            decl, symbol = _decl(statement, name), self.scope.symbols.get(name)
            if not decl.indices or not isinstance(symbol, NodeSymbol):
                continue
            bounds = [tuple(map(self.given, b)) for b in self.shape(decl)]
            others = [tuple(map(self.given, b)) for b in symbol.family.shape]
            if bounds != others:
                shown = [", ".join(f"{to_text(a)}..{to_text(b)}" for a, b in pairs) for pairs in (bounds, others)]
                message = f"port '{name}' of '{s.decl.name}' runs over {shown[0]}, its nodes over {shown[1]}"
                where = symbol.place
                self.report.error("E805", message, where, help=f"nodes over {shown[0]}")

    def _bundle_bound(self, s: syntax.Instance, name: str, wanted: BundleSymbol, value: syntax.Expr) -> BundleNode:
        """A port of several nodes, bound to a bundle of the same members or to ground."""
        place = self.place(value.span)
        if isinstance(value, syntax.Name) and value.name == "ground":
            return bundles.grounded(name, wanted, place)
        found = self.resolver.located(value)
        if found is None or not isinstance(found.symbol, BundleNode) or not bundles.fits(wanted, found.symbol):
            message = f"port '{name}' of '{s.decl.name}' is a bundle {wanted.name}, '{self._text(value)}' is none"
            members = ", ".join(f"{m}: {kind.name}" for m, kind in wanted.members)
            help_ = f"a node of {wanted.name} ({members}), or ground"
            raise self.resolver.fail("E401", message, value.span, help=help_)
        indices, change = found.indices, found.change
        return bundles.bound(
            name, found.symbol, change, lambda node: self._node_end(node, indices, change, value), place
        )

    def _same_domain(self, s: syntax.Instance, what: str, wanted: DomainSymbol, end: End, value: syntax.Expr) -> None:
        if end.domain.name != wanted.name:
            message = f"{what} of '{s.decl.name}' is {wanted.name}, node '{self._text(value)}' is {end.domain.name}"
            raise self.other_domain(message, wanted, end, value.span)

    def _bind_branch(
        self,
        s: syntax.Instance,
        component: ComponentSymbol,
        head: Interface,
        space: Space,
        name: str,
        connection: syntax.Connection,
        bound: set[str],
    ) -> None:
        if name not in head.branches:
            others = [other for other in (*head.branches, *head.ports) if other]
            near = nearest(name, others)
            said = f"nearest: '{near}'" if near else f"it has {', '.join(others) or 'none'}"
            if name in head.ports and isinstance(connection, syntax.BindAcross):
                said = f"{name} = {self._text(connection.plus)}: a port is one node"
            raise self.resolver.fail("E407", f"'{component.name}' has no branch '{name}'", connection.span, help=said)
        if name in bound:
            message = f"'{s.decl.name}: {component.name}' needs 1 connection, has {len(s.connections)}"
            nodes = [self._text(c.node) for c in s.connections if isinstance(c, syntax.Single)]
            help_ = " -> ".join(nodes) if len(s.connections) == len(nodes) == 2 else None
            raise self.resolver.fail("E402", message, connection.span, help=help_)
        word = head.branches[name].domain
        wanted = space.scope.find(word.name)
        if not isinstance(wanted, DomainSymbol):
            self.report.error("E202", f"'{word.name}' is not a domain", Place(space.source, word.span))
            raise Failed
        ends = self._ends(s, connection, wanted)
        if ends.domain is not None and ends.on is None and ends.domain.name != wanted.name:
            end = next(e for e in (ends.plus, ends.minus) if e is not None and e.node is not None)
            assert end.node is not None
            message = f"'{s.decl.name}' is {wanted.name}, its node '{end.node.name}' is {ends.domain.name}"
            raise self.other_domain(message, wanted, end, connection.span)
        family = Family(f"{space.path}.{name}" if name else space.path, space.prefix, space.around, ())
        symbol = BranchSymbol(name or s.decl.name, family, wanted, self.place(s.decl.span))
        space.scope.symbols[name] = symbol
        space.ends[name] = ends
        if not name:
            space.bound.update(own_variables(symbol, space.prefix))
        bound.add(name)


def _column(text: str, statement: syntax.Statement) -> int:
    """How far from the left a statement begins."""
    return statement.span.start - text.rfind("\n", 0, statement.span.start)
