"""Ports, inputs and branches of an instance, bound to what its text connects: nodes, expressions, two ends."""

from __future__ import annotations

from dataclasses import field

from sysdyn.dsl.elaborate.instances import bundles
from sysdyn.dsl.elaborate.instances.connections import Connections
from sysdyn.dsl.elaborate.instances.head import Interface
from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.laws import own_variables
from sysdyn.dsl.names.symbols import (
    BranchSymbol,
    BundleNode,
    BundleSymbol,
    ComponentSymbol,
    DomainSymbol,
    End,
    NameFamily,
    NodeSymbol,
    PortSymbol,
    Space,
    UnknownSymbol,
    coordinate_node,
    nearest,
)
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class PortRequest:
    """An instance, what its component asks for, and its space; inputs: what they are bound to; bound: ports and
    branches that are.
    """

    s: syntax.InstanceStatement
    component: ComponentSymbol
    head: Interface
    space: Space
    inputs: dict[str, syntax.Expr]
    bound: set[str] = field(default_factory=set)


def port_declaration(statement: syntax.PortStatement, name: str) -> syntax.Decl:
    """A port's own name and indices, in a statement of several."""
    return next(d for d in statement.decls if d.name == name)


class Ports:
    """Connects instances."""

    def __init__(self, context: ElaborationContext, connections: Connections) -> None:
        self.context, self.resolver, self.connections = context, context.resolver, connections

    def connect(self, asked: PortRequest) -> None:
        """Binds all ports, branches and inputs."""
        s, head = asked.s, asked.head
        for connection in s.connections:
            match connection:
                # `a = n1`
                case syntax.Bind():
                    self._bind(asked, connection)
                # `winding = n1 -> n2`
                case syntax.BindAcross():
                    self._bind_branch(asked, connection.name.name, connection)
                # `n1` alone, and one port that it can mean
                case syntax.Single() if len(head.branches) != 1 and len(head.ports) == 1:
                    self._bind_port(asked, next(iter(head.ports)), connection.node)
                # `n1 -> n2`: the one branch of the component
                case _:
                    if len(head.branches) != 1:
                        raise self._by_name(asked, connection)
                    self._bind_branch(asked, next(iter(head.branches)), connection)
        # each port and branch needs a connection
        for name in (*head.ports, *head.branches):
            if name not in asked.bound:
                what = f"port '{name}'" if name in head.ports else f"branch '{name}'" if name else "the branch"
                help_ = f"{name} = NODE, or {name} = ground" if name else "a -> b"
                raise self.resolver.fail("E408", f"{what} of '{s.decl.name}' is not connected", s.span, help=help_)
        # inputs without a default need a value
        for name, statement in head.inputs.items():
            if name not in asked.inputs and statement.value is None:
                raise self.resolver.fail(
                    "E414", f"input '{name}' of '{s.decl.name}' is not bound", s.span, help=f"{name} = ..."
                )

    def _by_name(self, asked: PortRequest, connection: syntax.Connection) -> Failed:
        """Report E402: nodes in a row where each belongs to a port of its own."""
        s, head = asked.s, asked.head
        ports = [*head.ports, *filter(None, head.branches)]
        nodes = list[syntax.Expr]()
        for c in s.connections:
            nodes += [c.plus, c.minus] if isinstance(c, syntax.Across) else []
            nodes += [c.node] if isinstance(c, syntax.Single) else []
        bound = {c.name.name for c in s.connections if isinstance(c, (syntax.Bind, syntax.BindAcross))}
        across = [c for c in s.connections if isinstance(c, syntax.Across)]
        if len(across) > 1 and all(
            self.context.source_text(c.plus.span) in ports for c in across
        ):  # `p -> a` for `p = a`
            nodes = [c.minus for c in across]
            bound |= set(ports) - {self.context.source_text(c.plus.span) for c in across}
        left = [name for name in (*ports, *head.inputs) if name not in bound]
        texts = iter([self.context.source_text(node.span) for node in nodes])
        pairs = []
        for name, text in zip(left, texts, strict=False):
            pairs.append(f"{name} = {text}" + (f" -> {next(texts, 'ground')}" if name in head.branches else ""))
        if not ports and not head.inputs:
            message = f"'{asked.component.name}' has no port: nothing can be connected to '{s.decl.name}'"
            return self.resolver.fail("E402", message, connection.span, help="port a: electrical in the component")
        message = f"'{s.decl.name}: {asked.component.name}' is connected by name: {', '.join((*ports, *head.inputs))}"
        return self.resolver.fail("E402", message, connection.span, help=", ".join(pairs))

    def _bind(self, asked: PortRequest, connection: syntax.Bind) -> None:
        """`name = value`: a port, an input, or a branch to ground."""
        s, head, inputs = asked.s, asked.head, asked.inputs
        name = connection.name.name
        if name in inputs or (name in asked.bound and name in head.ports):
            what = "input" if name in inputs else "port"
            message = f"{what} '{name}' of '{s.decl.name}' is bound twice"
            raise self.resolver.fail("E402", message, connection.span, help="one of the two")
        if name in head.inputs:
            inputs[name] = connection.value
        elif name in head.ports:
            self._bind_port(asked, name, connection.value)
        elif name in head.branches:
            single = syntax.Single(connection.value, connection.span)
            self._bind_branch(asked, name, single)
        else:
            raise self._no_such_name(asked, connection)

    def _no_such_name(self, asked: PortRequest, connection: syntax.Bind) -> Failed:
        """Report E407: what is meant by a name that the component does not have."""
        s, component, head, name = asked.s, asked.component, asked.head, connection.name.name
        near = nearest(name, (*head.ports, *head.inputs, *head.branches))
        names = ", ".join((*head.ports, *head.inputs, *filter(None, head.branches)))
        help_ = f"nearest: '{near}'" if near else f"it has {names or 'none'}"
        nodes = [s for s in component.body if isinstance(s, syntax.NodeStatement)]
        inner = next((s.domain.name for s in nodes if any(d.name == name for d in s.decls)), None)
        if inner is not None:
            help_ = f"port {name}: {inner} in component '{component.name}': a node is of its inside alone"
        if list(head.branches) == [""] and not head.ports and not head.inputs:  # its two ends have no names
            ends = [self.connections.end_text(c.value) for c in s.connections if isinstance(c, syntax.Bind)]
            help_ = " -> ".join((*ends[:2], "ground")[:2])
        return self.resolver.fail(
            "E407", f"'{component.name}' has no port or input '{name}'", connection.span, help=help_
        )

    def _bind_port(self, asked: PortRequest, name: str, value: syntax.Expr) -> None:
        """A port: one node, an array of them, or a bundle."""
        s, space, statement = asked.s, asked.space, asked.head.ports[name]
        asked.bound.add(name)
        word = statement.domain
        wanted = space.scope.find(word.name)
        place = self.context.place(value.span)
        if isinstance(wanted, BundleSymbol):
            space.scope.symbols[name] = self._bundle_bound(s, name, wanted, value)
            return
        if not isinstance(wanted, DomainSymbol):
            message = f"'{word.name}' is not a domain"
            self.context.report.error("E202", message, Place(space.source, word.span))
            raise Failed
        if port_declaration(statement, name).indices:
            space.scope.symbols[name] = self._array_bound(s, name, wanted, value)
            return
        bound_to = self.connections.end(value, wanted)
        assert bound_to is not None
        self._same_domain(s, f"port '{name}'", wanted, bound_to, value)
        space.scope.symbols[name] = PortSymbol(name, bound_to, place)

    def _array_bound(
        self, s: syntax.InstanceStatement, name: str, wanted: DomainSymbol, value: syntax.Expr
    ) -> NodeSymbol:
        """A port that is an array: the array of nodes that it is bound to, under the port's name."""
        found = self.resolver.locate(value)
        symbol = None if found is None else found.symbol
        coordinate = symbol if isinstance(symbol, UnknownSymbol) else None
        if coordinate is not None:
            symbol = coordinate_node(coordinate)
        if found is None or not isinstance(symbol, NodeSymbol) or found.indices or not symbol.family.shape:
            text = self.connections.end_text(value)
            message = f"port '{name}' of '{s.decl.name}' is an array, '{text}' is no array of nodes"
            raise self.resolver.fail("E805", message, value.span, help=f"node a[1..3]: {wanted.name}, and {name} = a")
        own, place = symbol.family, self.context.place(value.span)
        prefix = tuple(ex.substitute(a, found.change) for a in own.prefix)
        node = NodeSymbol(name, NameFamily(own.name, prefix, own.around, own.shape), symbol.domain, place, coordinate)
        self._same_domain(s, f"port '{name}'", wanted, End(node, (), symbol.domain), value)
        return node

    def port_shapes(self, s: syntax.InstanceStatement, head: Interface) -> None:
        """E805: ports that are arrays have the bounds of the nodes that they are bound to."""
        for name, statement in head.ports.items():
            decl, symbol = port_declaration(statement, name), self.context.scope.symbols.get(name)
            if not decl.indices or not isinstance(symbol, NodeSymbol):
                continue
            bounds = [tuple(map(self.context.with_instance_parameters, b)) for b in self.context.shape(decl)]
            others = [tuple(map(self.context.with_instance_parameters, b)) for b in symbol.family.shape]
            if bounds != others:
                shown = [", ".join(f"{to_text(a)}..{to_text(b)}" for a, b in pairs) for pairs in (bounds, others)]
                message = f"port '{name}' of '{s.decl.name}' runs over {shown[0]}, its nodes over {shown[1]}"
                where = symbol.place
                self.context.report.error("E805", message, where, help=f"nodes over {shown[0]}")

    def _bundle_bound(
        self, s: syntax.InstanceStatement, name: str, wanted: BundleSymbol, value: syntax.Expr
    ) -> BundleNode:
        """A port of several nodes, bound to a bundle of the same members or to ground."""
        place = self.context.place(value.span)
        if isinstance(value, syntax.Name) and value.name == "ground":
            return bundles.ground_bundle(name, wanted, place)
        found = self.resolver.locate(value)
        if found is None or not isinstance(found.symbol, BundleNode) or not bundles.fits(wanted, found.symbol):
            text = self.connections.end_text(value)
            message = f"port '{name}' of '{s.decl.name}' is a bundle {wanted.name}, '{text}' is none"
            members = ", ".join(f"{m}: {kind.name}" for m, kind in wanted.members)
            help_ = f"a node of {wanted.name} ({members}), or ground"
            raise self.resolver.fail("E401", message, value.span, help=help_)
        indices, change = found.indices, found.change
        return bundles.bound(
            name, found.symbol, change, lambda node: self.connections.node_end(node, indices, change, value), place
        )

    def _same_domain(
        self, s: syntax.InstanceStatement, what: str, wanted: DomainSymbol, end: End, value: syntax.Expr
    ) -> None:
        if end.domain.name != wanted.name:
            text = self.connections.end_text(value)
            message = f"{what} of '{s.decl.name}' is {wanted.name}, node '{text}' is {end.domain.name}"
            raise self.connections.other_domain(message, wanted, end, value.span)

    def _bind_branch(self, asked: PortRequest, name: str, connection: syntax.Connection) -> None:
        """A branch between two ends, or along an expression."""
        s, head, space = asked.s, asked.head, asked.space
        # a name that the component does not have, or that is a port of one node
        if name not in head.branches:
            others = [other for other in (*head.branches, *head.ports) if other]
            near = nearest(name, others)
            said = f"nearest: '{near}'" if near else f"it has {', '.join(others) or 'none'}"
            if name in head.ports and isinstance(connection, syntax.BindAcross):
                said = f"{name} = {self.connections.end_text(connection.plus)}: a port is one node"
            raise self.resolver.fail(
                "E407", f"'{asked.component.name}' has no branch '{name}'", connection.span, help=said
            )
        # two connections for one branch, as `R: resistor(...) a b` in place of `a -> b`
        if name in asked.bound:
            message = f"'{s.decl.name}: {asked.component.name}' needs 1 connection, has {len(s.connections)}"
            nodes = [self.connections.end_text(c.node) for c in s.connections if isinstance(c, syntax.Single)]
            help_ = " -> ".join(nodes) if len(s.connections) == len(nodes) == 2 else None
            raise self.resolver.fail("E402", message, connection.span, help=help_)
        word = head.branches[name].domain
        wanted = space.scope.find(word.name)
        if not isinstance(wanted, DomainSymbol):
            self.context.report.error("E202", f"'{word.name}' is not a domain", Place(space.source, word.span))
            raise Failed
        # the ends, which have to be of the branch's domain
        ends = self.connections.ends_of(s, connection, wanted)
        if ends.domain is not None and ends.on is None and ends.domain.name != wanted.name:
            end = next(e for e in (ends.plus, ends.minus) if e is not None and e.node is not None)
            assert end.node is not None
            message = f"'{s.decl.name}' is {wanted.name}, its node '{end.node.name}' is {ends.domain.name}"
            raise self.connections.other_domain(message, wanted, end, connection.span)
        family = NameFamily(f"{space.path}.{name}" if name else space.path, space.prefix, space.around, ())
        symbol = BranchSymbol(name or s.decl.name, family, wanted, self.context.place(s.decl.span))
        space.scope.symbols[name] = symbol
        space.ends[name] = ends
        # the component's own branch: its laws may read e, f, q, p without a name
        if not name:
            space.bound.update(own_variables(symbol, space.prefix))
        asked.bound.add(name)
