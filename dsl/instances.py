"""Instances: `label: component(arguments) connections`, from elements between nodes to components within components.

A builtin element becomes a branch (or two) with its law.  A component is a macro with a scope of its own: its ports
are bound to nodes, its inputs to expressions, its parameters to values where the instance stands; then its body is
elaborated under the label's path.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sysdyn.dsl import expression as ex
from sysdyn.dsl import syntax
from sysdyn.dsl.calls import walk
from sysdyn.dsl.context import Failed
from sysdyn.dsl.diagnostics import Place, Related
from sysdyn.dsl.elements import ONE_PORTS, TWO_PORTS, law_of, own_variables, ratio_of
from sysdyn.dsl.expression import Node
from sysdyn.dsl.levels import choose_level
from sysdyn.dsl.network import Branch, Coupling, Shape, Terminal
from sysdyn.dsl.parameters import Argument
from sysdyn.dsl.parts import Nested, flatten
from sysdyn.dsl.statements import Statements
from sysdyn.dsl.symbols import (
    BranchSymbol,
    BundleNode,
    BundleSymbol,
    ComponentSymbol,
    Definition,
    DomainSymbol,
    End,
    Family,
    InstanceSymbol,
    NodeSymbol,
    PortSymbol,
    Scope,
    Space,
    TwoPortSymbol,
    Typed,
    UnknownSymbol,
    Unsupported,
    nearest,
)
from sysdyn.dsl.unit_variables import solve_units

BUILTINS = (*ONE_PORTS, *TWO_PORTS)


@dataclass(slots=True)
class Pending:
    """A law to be resolved when every name of the model is known."""

    space: Space
    loops: tuple[syntax.For, ...]
    resolve: Callable[[], None]


@dataclass(slots=True)
class Ends:
    """What a connection says of a branch: two ends, or an expression along which it acts."""

    plus: End | None
    minus: End | None
    on: Typed | None
    domain: DomainSymbol | None


class Instances(Statements):
    """Elaborates instances."""

    def __init__(self, *args: object) -> None:
        super().__init__(*args)  # type: ignore[arg-type]
        self.pending: list[Pending] = []
        self.bodies: list[tuple[Space, list[Nested]]] = []
        self.levels: dict[str, tuple[str, Place]] = {}  # by path: a scene's and the command line's
        self._waiting: dict[int, list[Callable[[], None]]] = {}  # instances not yet elaborated, by their symbol
        self.resolver.awaken = self._awaken

    # -- frame ---------------------------------------------------------------------------------------------

    def announce(self, statements: Sequence[Nested]) -> None:
        """Enter the labels of all instances, then elaborate each (or earlier, when another asks for it)."""
        waiting = []
        for statement, loops in statements:
            if isinstance(statement, syntax.Instance):
                try:
                    waiting.append(self._announced(statement, loops))
                except Failed:
                    self.scope.broken.add(statement.decl.name)
        for do in waiting:
            do()

    def _announced(self, s: syntax.Instance, loops: tuple[syntax.For, ...]) -> Callable[[], None]:
        name = s.component.names[0]
        symbol = self.scope.find(name)
        label = s.decl.name
        if symbol is None and name in BUILTINS and len(s.component.names) == 1:
            return lambda: self.each([(s, loops)], self._builtin)
        if isinstance(symbol, Unsupported):
            raise Failed
        if not isinstance(symbol, ComponentSymbol):
            if self.scope.is_broken(name):
                raise Failed
            components = [n for n in self.scope.names() if isinstance(self.scope.find(n), ComponentSymbol)]
            near = nearest(name, (*components, *BUILTINS))
            help_ = f"nearest name in scope: '{near}'" if near else "from std.x import " + name
            raise self.resolver.fail("E101", f"unknown component '{name}'", s.component.span, help=help_)
        before = self.scope.symbols.get(label)
        if not isinstance(before, InstanceSymbol):
            before = InstanceSymbol(label, self.place(s.decl.span))
            self.enter(before)
        elif not s.decl.indices:
            related = (Related("first declared here", before.place),)
            self.report.error("E106", f"'{label}' is declared twice", self.place(s.decl.span), related=related)
            raise Failed
        return self._wait(before, s, loops, symbol)

    def _wait(
        self, symbol: InstanceSymbol, s: syntax.Instance, loops: tuple[syntax.For, ...], component: ComponentSymbol
    ) -> Callable[[], None]:
        here = self.current
        done: list[bool] = []

        def elaborate() -> None:
            if done:
                return
            done.append(True)
            with self.entering(here):
                self.each([(s, loops)], lambda statement: self._component(symbol, statement, component))

        self._waiting.setdefault(id(symbol), []).append(elaborate)
        return elaborate

    def _awaken(self, symbol: InstanceSymbol) -> None:
        """Another statement reads an instance that has not been elaborated yet."""
        for do in self._waiting.pop(id(symbol), ()):
            do()

    def _label(self, s: syntax.Instance) -> tuple[tuple[Node, ...], Shape]:
        """Indices of a label, and first and last of each; a `for` around must show in them."""
        at = tuple(self.resolver.index(i) for i in s.decl.indices)
        shape = []
        for node, index in zip(at, s.decl.indices, strict=True):
            if node.op == "index":
                shape.append(self.bounds(index))
            elif any(n.op == "index" for n in ex.topological([node])):
                raise self.resolver.fail("E806", "a label is indexed by a loop variable or a number", index.span)
            else:
                shape.append((node, node))
        used = set(at)
        own = self.resolver.loops[len(self.current.loops) :]
        if any(ex.index(loop.index) not in used for loop in own):
            message = f"'{s.decl.name}' stands in a 'for': its label needs the loop variable"
            raise self.resolver.fail("E106", message, s.decl.span, help=f"{s.decl.name}[{own[-1].index}]")
        return at, tuple(shape)

    # -- builtin elements ----------------------------------------------------------------------------------

    def _builtin(self, s: syntax.Instance) -> None:
        kind = s.component.names[0]
        at, shape = self._label(s)
        side, value, span = self._law_argument(s, kind)
        if kind in ONE_PORTS:
            if len(s.connections) != 1:
                wants = "1 connection: label: component() a -> b"
                raise self.resolver.fail(
                    "E402", f"'{s.decl.name}: {kind}' needs {wants}, has {len(s.connections)}", s.span
                )
            ends = self._ends(s, s.connections[0])
            symbol = self._branch_symbol(s, s.decl.name, self._domain_of(s, ends), shape)
            self._enter_element(symbol, symbol)
            self._later_law(symbol, at, side, value, kind, span, ends, s)
            return
        connections = [c for c in s.connections if not isinstance(c, syntax.Bind)]
        if len(connections) != 2:
            raise self.resolver.fail(
                "E402", f"'{s.decl.name}: {kind}' needs 2 branches, has {len(connections)}", s.span
            )
        both = [self._ends(s, c) for c in connections]
        one, two = (
            self._branch_symbol(s, f"{s.decl.name}#{k}", self._domain_of(s, e), shape) for k, e in enumerate(both, 1)
        )
        self._enter_element(TwoPortSymbol(s.decl.name, (one, two), self.place(s.decl.span)), one)
        self._later_ratio((one, two), at, (kind, side, value, span), (both[0], both[1]), s)

    def _law_argument(self, s: syntax.Instance, kind: str) -> tuple[str, syntax.Expr, syntax.Span]:
        sides = ("e", "f", "p", "q") if kind in ONE_PORTS else ("e1", "e2", "f1", "f2")
        args = s.args or ()
        if len(args) != 1:
            help_ = f"{kind}({sides[0]} = ...)"
            raise self.resolver.fail("E303", f"'{kind}' takes one law, {len(args)} given", s.span, help=help_)
        if args[0].name is None:
            raise self.resolver.fail("E404", "positional argument", args[0].span, help=f"{sides[0]} = ...")
        if args[0].name not in sides:
            raise self.resolver.fail(
                "E405", f"'{kind}' has no law '{args[0].name}'", args[0].span, help=", ".join(sides)
            )
        return args[0].name, args[0].value, args[0].span

    def _branch_symbol(self, s: syntax.Instance, name: str, domain: DomainSymbol, shape: Shape) -> BranchSymbol:
        return BranchSymbol(name, self.current.family(name, shape), domain, self.place(s.decl.span))

    def _enter_element(self, symbol: BranchSymbol | TwoPortSymbol, first: BranchSymbol) -> None:
        """Enter a label; several loops over disjoint ranges may declare one."""
        before = self.scope.symbols.get(symbol.name)
        if type(before) is not type(symbol) or not first.family.shape:
            self.enter(symbol)
            return
        assert isinstance(before, (BranchSymbol, TwoPortSymbol))
        if isinstance(before, BranchSymbol) and isinstance(symbol, BranchSymbol):
            self.scope.symbols[symbol.name] = _hull(before, symbol)
        elif isinstance(before, TwoPortSymbol) and isinstance(symbol, TwoPortSymbol):
            one, two = (_hull(a, b) for a, b in zip(before.branches, symbol.branches, strict=True))
            self.scope.symbols[symbol.name] = TwoPortSymbol(symbol.name, (one, two), before.place)

    def _later_law(
        self,
        symbol: BranchSymbol,
        at: tuple[Node, ...],
        side: str,
        value: syntax.Expr,
        kind: str | None,
        span: syntax.Span,
        ends: Ends,
        s: syntax.Instance | syntax.Law,
    ) -> None:
        loops, bound = self.resolver.loops, self.resolver.sight()
        whole = (*symbol.family.prefix, *at)

        def resolve() -> None:
            own = own_variables(symbol, whole)
            self._hidden(value, own, symbol.name)
            with self.resolver.inside(loops, bound), self.resolver.bound(own):
                law = law_of(self.resolver, symbol, whole, side, value, kind, span)
            self.resolver.laws[symbol.family.name] = law
            self.parts.branches.append(
                self._branch(symbol, whole, loops, (law.kind, law.side, law.law), ends, self.place(s.span))
            )

        self.pending.append(Pending(self.current, (), resolve))

    def _branch(
        self,
        symbol: BranchSymbol,
        at: tuple[Node, ...],
        loops: tuple,  # type: ignore[type-arg]
        law: tuple[str, str | None, Node | None],
        ends: Ends,
        place: Place,
    ) -> Branch:
        kind, side, node = law
        name = symbol.family.name
        if ends.on is not None:
            return Branch(name, at, loops, symbol.domain, kind, side, node, None, None, ends.on.node, place)
        assert ends.plus is not None
        assert ends.minus is not None
        plus, minus = (_terminal(e) for e in (ends.plus, ends.minus))
        return Branch(name, at, loops, symbol.domain, kind, side, node, plus, minus, None, place)

    def _later_ratio(
        self,
        branches: tuple[BranchSymbol, BranchSymbol],
        at: tuple[Node, ...],
        law: tuple[str, str, syntax.Expr, syntax.Span],
        ends: tuple[Ends, Ends],
        s: syntax.Instance,
    ) -> None:
        loops, bound = self.resolver.loops, self.resolver.sight()
        whole = (*branches[0].family.prefix, *at)
        kind, side, value, span = law

        def resolve() -> None:
            own = {**own_variables(branches[0], whole, "1"), **own_variables(branches[1], whole, "2")}
            self._hidden(value, own, s.decl.name)
            with self.resolver.inside(loops, bound), self.resolver.bound(own):
                ratio = ratio_of(self.resolver, branches, whole, kind, side, value, span)
            place = self.place(s.span)
            for symbol, end in zip(branches, ends, strict=True):
                self.parts.branches.append(self._branch(symbol, whole, loops, ("port", None, None), end, place))
            first, second = (b.family.name for b in branches)
            self.parts.couplings.append(
                Coupling(ratio.kind, first, second, whole, loops, ratio.side, ratio.ratio, place)
            )

        self.pending.append(Pending(self.current, (), resolve))

    def _hidden(self, value: syntax.Expr, own: dict[str, Typed], name: str) -> None:
        """W101: an element's own variable hides an outer name in its law."""
        for node in walk(value):
            if isinstance(node, syntax.Name) and node.name in own and self.scope.symbols.get(node.name) is not None:
                what = {"e": "effort", "f": "flow", "q": "displacement", "p": "momentum"}[node.name[0]]
                message = f"'{node.name}' in the law of '{name}' is the element's own {what}; it hides the outer name"
                self.report.warning(
                    "W101", message, self.place(node.span), help="rename the outer one, or write it as a let"
                )

    # -- connections ---------------------------------------------------------------------------------------

    def _ends(self, s: syntax.Instance, connection: syntax.Connection, domain: DomainSymbol | None = None) -> Ends:
        """Ends of a branch from `a -> b`, `a` (for a -> ground) or `on expr`."""
        match connection:
            case syntax.Across() | syntax.BindAcross():
                plus, minus = self.end(connection.plus, domain), self.end(connection.minus, domain)
            case syntax.Single():
                plus, minus = self.end(connection.node, domain), None
            case syntax.On():
                value = self.resolver.scalar(connection.expr)
                self._is_displacement(value.node, connection.expr)
                return Ends(None, None, value, self._domain_on(connection.expr, value) or domain)
            case _:
                raise self.resolver.fail(
                    "E407", f"'{s.component.names[0]}' has no port or input '{connection.name.name}'", connection.span
                )
        found = [e for e in (plus, minus) if e is not None]
        domains = [e.domain for e in found if e.domain is not None] or ([domain] if domain else [])
        if not domains:
            raise self.resolver.fail(
                "E403",
                f"the domain of '{s.decl.name}' cannot be inferred",
                connection.span,
                help="connect a node or name the coordinate",
            )
        if any(d.name != domains[0].name for d in domains):
            message = f"'{s.decl.name}' joins {domains[0].name} and {domains[1].name}"
            raise self.resolver.fail("E401", message, connection.span, help="a gyrator or transformer couples domains")
        plus, minus = (
            e if e is not None and e.domain is not None else End(None, (), domains[0]) for e in (plus, minus)
        )
        if plus.node is not None and plus.node is minus.node and plus.at == minus.at:
            message = f"both ends of '{s.decl.name}' are node {plus.node.name}"
            raise self.resolver.fail("E413", message, connection.span)
        return self._along(plus, minus, domains[0])

    def _along(self, plus: End, minus: End, domain: DomainSymbol) -> Ends:
        """A branch that hangs on a coordinate acts along an expression."""
        coordinates = [e for e in (plus, minus) if e.node is not None and e.node.family.name in self._coordinate_names]
        if not coordinates:
            return Ends(plus, minus, None, domain)

        def displacement(end: End) -> Node:
            if end.node is None:
                return ex.const(0.0)
            kind = "q" if end.node.family.name in self._coordinate_names else "nq"
            return ex.var(end.node.family.name, kind, *end.at)

        node = ex.sub(displacement(plus), displacement(minus))
        return Ends(None, None, Typed(node, domain.displacement.dimension), domain)

    @property
    def _coordinate_names(self) -> set[str]:
        return {c.name for c in self.parts.coordinates}

    def end(self, e: syntax.Expr, domain: DomainSymbol | None) -> End | None:
        """One end: a node, a port, a coordinate of a common-flow domain, or ground (None without a domain)."""
        if isinstance(e, syntax.Name) and e.name == "ground":
            return None if domain is None else End(None, (), domain)
        found = self.resolver.located(e)
        symbol = None if found is None else found.symbol
        if found is None or symbol is None:
            root = e
            while isinstance(root, (syntax.Item, syntax.Member)):
                root = root.base
            if isinstance(root, syntax.Name) and self.scope.find(root.name) is None:
                raise self.resolver.unknown(root.name, root.span)
            raise self.resolver.fail("E407", f"'{self._text(e)}' is no node", e.span)
        match symbol:
            case PortSymbol():
                end = symbol.end
                return End(end.node, tuple(ex.substitute(a, found.change) for a in end.at), end.domain)
            case NodeSymbol():
                return self._node_end(symbol, found.indices, found.change, e)
            case UnknownSymbol() if symbol.kind == "q" and symbol.domain is not None:
                if symbol.domain.common == "effort":
                    help_ = f"'on {self._text(e)}' instead of '->'"
                    raise self.resolver.fail(
                        "E415",
                        f"'{symbol.name}' is a coordinate of a common-effort domain, not a node",
                        e.span,
                        help=help_,
                    )
                node = NodeSymbol(symbol.name, symbol.family, symbol.domain, symbol.place)
                return self._node_end(node, found.indices, found.change, e)
            case Unsupported():
                raise Failed
        raise self.resolver.fail("E407", f"'{self._text(e)}' is no node", e.span)

    def _node_end(
        self, symbol: NodeSymbol, indices: tuple[syntax.Index, ...], change: dict[Node, Node], e: syntax.Expr
    ) -> End:
        if len(indices) != len(symbol.family.shape):
            raise self.resolver.index_count(symbol.name, len(symbol.family.shape), len(indices), e.span)
        at = (*symbol.family.prefix, *self.resolver.indices(symbol.name, symbol.family.shape, indices))
        return End(symbol, tuple(ex.substitute(a, change) for a in at), symbol.domain)

    def _text(self, e: syntax.Expr) -> str:
        return self.source_text(e.span)[:60]

    def _domain_of(self, s: syntax.Instance, ends: Ends) -> DomainSymbol:
        if ends.domain is None:
            raise self.resolver.fail(
                "E403",
                f"the domain of '{s.decl.name}' cannot be inferred",
                s.span,
                help="connect a node or name the coordinate",
            )
        return ends.domain

    def _domain_on(self, e: syntax.Expr, value: Typed) -> DomainSymbol | None:
        """Domain of one coordinate, branch or node; else the one domain whose displacement has that dimension."""
        inner = e.expr if isinstance(e, syntax.Group) else e
        found = self.resolver.located(inner.base if isinstance(inner, syntax.Member) and inner.name == "q" else inner)
        if found is not None and isinstance(found.symbol, (UnknownSymbol, BranchSymbol, NodeSymbol)):
            return found.symbol.domain
        if found is not None and isinstance(found.symbol, PortSymbol):
            return found.symbol.end.domain
        domains = {}
        for name in self.scope.names():
            symbol = self.scope.find(name)
            if isinstance(symbol, DomainSymbol) and symbol.displacement.dimension == value.dimension:
                domains[name] = symbol
        return next(iter(domains.values())) if len(domains) == 1 else None

    # -- components ----------------------------------------------------------------------------------------

    def _component(self, symbol: InstanceSymbol, s: syntax.Instance, component: ComponentSymbol) -> None:
        chain = (*self.current.chain, self.current.component)
        if component.name in chain:
            around = (*chain[chain.index(component.name) :], component.name)
            raise self.resolver.fail("E801", f"component contains itself: {' -> '.join(around)}", s.component.span)
        at, shape = self._label(s)
        path = self.current.family(s.decl.name).name
        number = len(symbol.spaces)
        scope = Scope(component.file_scope)
        space = Space(
            path=path if not number else f"{path}#{number + 1}",
            scope=scope,
            file_scope=component.file_scope,
            source=component.source,
            loops=self.resolver.loops,
            prefix=(*self.current.prefix, *at),
            around=(*self.current.around, *shape),
            component=component.name,
            chain=chain,
        )
        level, body = choose_level(self, component, s, path)
        space.level = level
        self._fill(symbol, s, component, space, list(flatten(body)))

    def _fill(
        self, symbol: InstanceSymbol, s: syntax.Instance, component: ComponentSymbol, space: Space, body: list[Nested]
    ) -> None:
        head = Head(body)
        arguments = self._arguments(s, component, head)
        inputs = self._connect(s, component, head, space)
        solve_units(self, s, space, head, arguments, inputs)
        symbol.spaces.append(space)
        with self.entering(space):
            for statement, _ in body:
                if isinstance(statement, syntax.Broken):
                    self.scope.broken |= statement.names
            self.declare_parameters(body, arguments)
            self._required(s, component, head, arguments)
        self._bind_inputs(s, space, head, inputs)
        with self.entering(space):
            self.each(body, self.declare)
            self.bodies.append((space, body))
            self.announce(body)

    def _arguments(self, s: syntax.Instance, component: ComponentSymbol, head: Head) -> dict[str, Argument]:
        found: dict[str, Argument] = {}
        for arg in s.args or ():
            if arg.name is None:
                names = ", ".join(head.parameters)
                raise self.resolver.fail(
                    "E404", "positional argument", arg.span, help=f"name it: {names}" if names else None
                )
            if arg.name in head.inputs:
                head.given[arg.name] = arg.value
                continue
            if arg.name not in head.parameters:
                near = nearest(arg.name, (*head.parameters, *head.inputs))
                listed = f"nearest: '{near}'" if near else f"it has {', '.join(head.parameters) or 'none'}"
                raise self.resolver.fail(
                    "E405", f"'{component.name}' has no parameter '{arg.name}'", arg.span, help=listed
                )
            found[arg.name] = (arg.value, self.resolver.resolve(arg.value))
        return found

    def _required(self, s: syntax.Instance, component: ComponentSymbol, head: Head, given: dict[str, Argument]) -> None:
        for name, statement in head.parameters.items():
            if statement.value is None and name not in given:
                place = Place(self._outer_source(s), s.span)
                unit = statement.unit.text if statement.unit else "..."
                message = f"parameter '{name}' of '{component.name}' has no value"
                self.report.error("E406", message, place, help=f"{component.name}({name} = ... {unit})")

    def _outer_source(self, s: syntax.Instance):  # type: ignore[no-untyped-def]
        return self._instance_source

    def _connect(
        self, s: syntax.Instance, component: ComponentSymbol, head: Head, space: Space
    ) -> dict[str, syntax.Expr]:
        """Bind ports and branches; the inputs' expressions come back."""
        self._instance_source = self.resolver.source
        inputs = dict(head.given)
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
                        wants = ", ".join((*head.ports, *(b for b in head.branches if b))) or "no connection"
                        raise self.resolver.fail(
                            "E402", f"'{s.decl.name}: {component.name}' is connected by name: {wants}", connection.span
                        )
                    self._bind_branch(s, component, head, space, next(iter(head.branches)), connection, bound)
        for name in (*head.ports, *head.branches):
            if name not in bound:
                what = f"port '{name}'" if name in head.ports else f"branch '{name}'" if name else "the branch"
                help_ = "bind it, or to ground"
                raise self.resolver.fail("E408", f"{what} of '{s.decl.name}' is not connected", s.span, help=help_)
        for name, statement in head.inputs.items():
            if name not in inputs and statement.value is None:
                raise self.resolver.fail(
                    "E414", f"input '{name}' of '{s.decl.name}' is not bound", s.span, help=f"{name} = ..."
                )
        return inputs

    def _bind(
        self,
        s: syntax.Instance,
        component: ComponentSymbol,
        head: Head,
        space: Space,
        connection: syntax.Bind,
        inputs: dict[str, syntax.Expr],
        bound: set[str],
    ) -> None:
        name = connection.name.name
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
            raise self.resolver.fail(
                "E407", f"'{component.name}' has no port or input '{name}'", connection.span, help=help_
            )

    def _bind_port(self, s: syntax.Instance, head: Head, space: Space, name: str, value: syntax.Expr) -> None:
        word = head.ports[name].domain
        wanted = space.scope.find(word.name)
        place = self.place(value.span)
        if isinstance(wanted, BundleSymbol):
            found = self.resolver.located(value)
            if found is None or not isinstance(found.symbol, BundleNode):
                raise self.resolver.fail(
                    "E401", f"port '{name}' of '{s.decl.name}' is a bundle {wanted.name}", value.span
                )
            members: dict[str, NodeSymbol | PortSymbol] = {}
            for member, inner in found.symbol.members.items():
                if isinstance(inner, PortSymbol):
                    end = inner.end
                    end = End(end.node, tuple(ex.substitute(a, found.change) for a in end.at), end.domain)
                else:
                    end = self._node_end(inner, found.indices, found.change, value)
                members[member] = PortSymbol(member, end, place)
            space.scope.symbols[name] = BundleNode(name, members, place)
            return
        if not isinstance(wanted, DomainSymbol):
            message = f"'{word.name}' is not a domain"
            self.report.error("E202", message, Place(space.source, word.span))
            raise Failed
        bound_to = self.end(value, wanted)
        assert bound_to is not None
        self._same_domain(s, f"port '{name}'", wanted, bound_to, value)
        space.scope.symbols[name] = PortSymbol(name, bound_to, place)

    def _same_domain(self, s: syntax.Instance, what: str, wanted: DomainSymbol, end: End, value: syntax.Expr) -> None:
        if end.domain.name != wanted.name:
            message = f"{what} of '{s.decl.name}' is {wanted.name}, node '{self._text(value)}' is {end.domain.name}"
            raise self.resolver.fail("E401", message, value.span, help="a gyrator or transformer couples domains")

    def _bind_branch(
        self,
        s: syntax.Instance,
        component: ComponentSymbol,
        head: Head,
        space: Space,
        name: str,
        connection: syntax.Connection,
        bound: set[str],
    ) -> None:
        if name not in head.branches:
            raise self.resolver.fail("E407", f"'{component.name}' has no branch '{name}'", connection.span)
        if name in bound:
            message = f"'{s.decl.name}: {component.name}' needs 1 connection, has {len(s.connections)}"
            raise self.resolver.fail("E402", message, connection.span)
        word = head.branches[name].domain
        wanted = space.scope.find(word.name)
        if not isinstance(wanted, DomainSymbol):
            self.report.error("E202", f"'{word.name}' is not a domain", Place(space.source, word.span))
            raise Failed
        ends = self._ends(s, connection, wanted)
        if ends.domain is not None and ends.on is None and ends.domain.name != wanted.name:
            message = f"'{s.decl.name}' is {wanted.name}, its nodes are {ends.domain.name}"
            raise self.resolver.fail("E401", message, connection.span, help="a gyrator or transformer couples domains")
        family = Family(f"{space.path}.{name}" if name else space.path, space.prefix, space.around, ())
        symbol = BranchSymbol(name or s.decl.name, family, wanted, self.place(s.decl.span))
        space.scope.symbols[name] = symbol
        space.ends[name] = ends
        if not name:
            space.bound.update(own_variables(symbol, space.prefix))
        bound.add(name)

    def _bind_inputs(self, s: syntax.Instance, space: Space, head: Head, inputs: dict[str, syntax.Expr]) -> None:
        sight = self.resolver.sight()
        for name, statement in head.inputs.items():
            with self.entering(space):
                dimension = self.unit(statement.unit).dimension
            place = self.place(s.span)
            if name in inputs:
                value, here, bound = inputs[name], self.current, tuple(sight.items())
            else:
                assert statement.value is not None
                value, here, bound = statement.value, space, ()
            space.scope.symbols[name] = Definition(
                name, "input", value, (), dimension, here, place, value.span, bound=bound
            )

    # -- laws of components --------------------------------------------------------------------------------

    def law(self, s: syntax.Law) -> None:
        """`law e = R*f`, `law b.e = ...`: the right edge of the diagram for a branch of the component."""
        name, letter = "", None
        if isinstance(s.left, syntax.Name):
            letter = s.left.name
        elif isinstance(s.left, syntax.Member) and isinstance(s.left.base, syntax.Name):
            name, letter = s.left.base.name, s.left.name
        symbol = self.scope.symbols.get(name)
        if letter not in ("e", "f", "p", "q") or not isinstance(symbol, BranchSymbol):
            message = "the law must be solved for one port variable of its edge"
            raise self.resolver.fail("E303", message, s.left.span, help="'e = ...(f)'")
        if name in self.current.laws:
            related = (Related("the first law", self.current.laws[name]),)
            message = f"branch '{name or self.current.path}' has two laws"
            raise self.resolver.fail("E305", message, s.span, related=related)
        self.current.laws[name] = self.place(s.span)
        self._later_law(symbol, (), letter, s.right, None, s.span, self.current.ends[name], s)

    def lawless(self, space: Space) -> None:
        """Branches without a law stand in energies and constraints; E306 where they stand in nothing."""
        for name, ends in space.ends.items():
            symbol = space.scope.symbols[name]
            if name in space.laws or not isinstance(symbol, BranchSymbol):
                continue
            where = self.place(symbol.place.span)
            self.parts.branches.append(
                self._branch(symbol, space.prefix, space.loops, ("field", None, None), ends, where)
            )


class Head:
    """What a component asks of its user: parameters, inputs, ports, branches."""

    def __init__(self, body: Sequence[Nested]) -> None:
        self.parameters: dict[str, syntax.Param] = {}
        self.inputs: dict[str, syntax.Input] = {}
        self.ports: dict[str, syntax.Port] = {}
        self.branches: dict[str, syntax.Branch] = {}
        self.given: dict[str, syntax.Expr] = {}  # inputs among the arguments
        for statement, _ in body:
            match statement:
                case syntax.Param():
                    self.parameters[statement.decl.name] = statement
                case syntax.Input():
                    self.inputs[statement.decl.name] = statement
                case syntax.Port():
                    self.ports |= dict.fromkeys((d.name for d in statement.decls), statement)
                case syntax.Branch():
                    self.branches |= dict.fromkeys(
                        (d.name for d in statement.decls) if statement.decls else ("",), statement
                    )


def _terminal(end: End) -> Terminal:
    return Terminal(None, ()) if end.node is None else Terminal(end.node.family.name, end.at)


def _hull(a: BranchSymbol, b: BranchSymbol) -> BranchSymbol:
    """One symbol for two ranges of a label."""
    shape = tuple(
        (ex.call("min", first, other), ex.call("max", last, end))
        for (first, last), (other, end) in zip(a.family.shape, b.family.shape, strict=True)
    )
    return BranchSymbol(a.name, Family(a.family.name, a.family.prefix, a.family.around, shape), a.domain, a.place)
