"""Connections: what `a -> b`, `a`, `on expr` and a label's indices mean."""

from __future__ import annotations

from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.elaborate.statements.statements import Statements
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Shape
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.symbols import (
    BranchSymbol,
    DomainSymbol,
    End,
    NodeSymbol,
    PortSymbol,
    Typed,
    UnknownSymbol,
    Unsupported,
    coordinate_node,
    nearest,
)
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass


@dataclass(slots=True)
class Ends:
    """What a connection says of a branch: two ends, or an expression along which it acts."""

    plus: End | None
    minus: End | None
    on: Typed | None
    domain: DomainSymbol | None


class Connections:
    """Resolves ends of branches and labels of instances."""

    def __init__(self, context: ElaborationContext, equations: Statements) -> None:
        self.context, self.resolver, self.parts = context, context.resolver, context.parts
        self.equations = equations

    def label_indices(self, s: syntax.InstanceStatement) -> tuple[tuple[Node, ...], Shape]:
        """Indices of a label, and first and last of each; a `for` around must show in them."""
        own = self.resolver.loops[len(self.context.current.loops) :]
        # `R1: resistor(...)`: one element
        if not own and not s.decl.indices:
            return (), ()
        at = tuple(self.resolver.index(i) for i in s.decl.indices)
        shape = []
        for node, index in zip(at, s.decl.indices, strict=True):
            # `R[i]` in `for i in 1..n`: the array has the range of the loop
            if node.op == "index":
                shape.append(self.context.bounds(index))
            # `R[i+1]`: which elements there are could not be told from the label
            elif any(n.op == "index" for n in ex.topological([node])):
                help_ = f"{s.decl.name}[{own[-1].index}] in a 'for' over the range that is meant" if own else None
                message = "a label is indexed by a loop variable or a number"
                raise self.resolver.fail("E806", message, index.span, help=help_)
            # `R[3]`: one element of a number
            else:
                shape.append((node, node))
        # `for i in 1..n { R: ... }` would declare one name n times
        used = set(at)
        if any(ex.index(loop.index) not in used for loop in own):
            message = f"'{s.decl.name}' stands in a 'for': its label needs the loop variable"
            raise self.resolver.fail("E106", message, s.decl.span, help=f"{s.decl.name}[{own[-1].index}]")
        return at, tuple(shape)

    def ends_of(
        self, s: syntax.InstanceStatement, connection: syntax.Connection, domain: DomainSymbol | None = None
    ) -> Ends:
        """Ends of a branch from `a -> b`, `a` (for a -> ground) or `on expr`."""
        match connection:
            # `a -> b`
            case syntax.Across() | syntax.BindAcross():
                plus, minus = self.end(connection.plus, domain), self.end(connection.minus, domain)
            # `a`: to the ground of its domain
            case syntax.Single():
                plus, minus = self.end(connection.node, domain), None
            # `on x`: along a displacement, whose rate is the flow of the branch
            case syntax.On():
                value = self.resolver.scalar(connection.expr)
                self.equations.require_displacement(value.node, connection.expr, s.decl.name)
                own = self._domain_on(connection.expr, value)
                if own is not None and domain is not None and own.name != domain.name:
                    message = f"'{s.decl.name}' is {domain.name}, '{self.end_text(connection.expr)}' is {own.name}"
                    help_ = "a gyrator or transformer couples domains"
                    raise self.resolver.fail("E401", message, connection.span, help=help_)
                self._is_displacement_of(s, own or domain, value, connection)
                return Ends(None, None, value, own or domain)
            # `foo = a` where the component has neither a port nor an input of that name
            case _:
                raise self.resolver.fail(
                    "E407", f"'{s.component.names[0]}' has no port or input '{connection.name.name}'", connection.span
                )
        # the ends tell the domain; of a generic element (`resistor`) it is that of its nodes
        found = [e for e in (plus, minus) if e is not None]
        domains = [e.domain for e in found if e.domain is not None] or ([domain] if domain else [])
        # `ground -> ground`
        if not domains:
            raise self.resolver.fail(
                "E403",
                f"the domain of '{s.decl.name}' cannot be inferred",
                connection.span,
                help="connect a node or name the coordinate",
            )
        own = domain or domains[0]
        # one node of another domain: `R: resistor(...) a -> shaft`
        other = next((e for e in found if e.node is not None and e.domain.name != own.name), None)
        if other is not None and other.node is not None:
            first = next((e.node.name for e in found if e.node is not None and e is not other), None)
            what = f"its node '{other.node.name}' is {other.domain.name}"
            message = f"'{s.decl.name}' is {own.name}, {what}"
            if domain is None:
                message = f"'{s.decl.name}' joins {own.name} and {other.domain.name}: {first} and {other.node.name}"
            raise self.other_domain(message, own, other, connection.span)
        # `ground` has the domain of the other end
        plus, minus = (
            e if e is not None and e.domain is not None else End(None, (), domains[0]) for e in (plus, minus)
        )
        # both ends at one node: the element would be short-circuited
        if plus.node is not None and plus.node is minus.node and plus.at == minus.at:
            message = f"both ends of '{s.decl.name}' are node {plus.node.name}"
            raise self.resolver.fail("E413", message, connection.span)
        return self._along(plus, minus, domains[0])

    def other_domain(self, message: str, wanted: DomainSymbol, end: End, span: syntax.Span) -> Failed:
        """Report E401: an end of another domain than is wanted, with the nodes that would do."""
        right = [
            n
            for n in self.context.scope.names()
            if isinstance(s := self.context.scope.find(n), NodeSymbol) and s.domain is wanted
        ]
        help_ = f"{wanted.name}: {', '.join(right[:5])}; " if right else f"a node of {wanted.name}; "
        help_ += "a transformer, gyrator or source couples domains"
        declared = None if end.node is None else end.node.place.start[0]
        subject = None if end.node is None else f"{end.domain.name} for {wanted.name} at nodes of line {declared}"
        return self.resolver.fail("E401", message, span, help=help_, subject=subject)

    def _is_displacement_of(
        self, s: syntax.InstanceStatement, domain: DomainSymbol | None, value: Typed, connection: syntax.On
    ) -> None:
        """E208: the expression along which an element acts is a displacement of its domain."""
        if domain is None or value.dimension is None or value.dimension == domain.displacement.dimension:
            return
        wanted, found = dim.show(domain.displacement.dimension), dim.show(value.dimension)
        message = f"'{s.decl.name}' acts along a displacement of '{domain.name}' in {wanted}, not in {found}"
        help_ = self.resolver.missing(value.dimension, domain.displacement.dimension)
        raise self.resolver.fail("E208", message, connection.span, help=help_)

    def _along(self, plus: End, minus: End, domain: DomainSymbol) -> Ends:
        """A branch that hangs on a coordinate acts along an expression."""
        names = {c.name for c in self.parts.coordinates} if self.parts.coordinates else ()
        if not any(e.node is not None and e.node.family.name in names for e in (plus, minus)):
            return Ends(plus, minus, None, domain)

        def displacement(end: End) -> Node:
            if end.node is None:
                return ex.const(0.0)
            kind = "q" if end.node.family.name in names else "nq"
            return ex.var(end.node.family.name, kind, *end.at)

        node = ex.sub(displacement(plus), displacement(minus))
        return Ends(None, None, Typed(node, domain.displacement.dimension), domain)

    def end(self, e: syntax.Expr, domain: DomainSymbol | None) -> End | None:
        """One end: a node, a port, a coordinate of a common-flow domain, or ground (None without a domain)."""
        # `ground` is of any domain
        if isinstance(e, syntax.Name) and e.name == "ground":
            return None if domain is None else End(None, (), domain)
        found = self.resolver.locate(e)
        symbol = None if found is None else found.symbol
        # a name that nobody declared, or an expression that is no path
        if found is None or symbol is None:
            root = e
            while isinstance(root, (syntax.Item, syntax.Member)):
                root = root.base
            if isinstance(root, syntax.Name) and self.context.scope.find(root.name) is None:
                raise self._unknown_node(root, domain)
            raise self._no_node(e, None)
        match symbol:
            # inside a component: the node that the instance was connected to
            case PortSymbol():
                if found.indices:
                    raise self.resolver.index_count(symbol.name, 0, len(found.indices), e.span)
                end = symbol.end
                return End(end.node, tuple(ex.substitute(a, found.change) for a in end.at), end.domain)
            case NodeSymbol():
                return self.node_end(symbol, found.indices, found.change, e)
            # `coord x: translation` is a node of a common-flow domain; one of a common-effort domain (a charge) is not
            case UnknownSymbol() if symbol.kind == "q" and symbol.domain is not None:
                if symbol.domain.common == "effort":
                    help_ = f"'on {self.end_text(e)}' instead of '->'"
                    raise self.resolver.fail(
                        "E415",
                        f"'{symbol.name}' is a coordinate of a common-effort domain, not a node",
                        e.span,
                        help=help_,
                    )
                node = coordinate_node(symbol)
                assert node is not None
                return self.node_end(node, found.indices, found.change, e)
            case Unsupported():
                raise Failed
        raise self._no_node(e, symbol)

    def _unknown_node(self, root: syntax.Name, domain: DomainSymbol | None) -> Failed:
        """Report E101: a name that stands for nothing where a node is wanted."""
        nodes = [
            n for n in self.context.scope.names() if isinstance(self.context.scope.find(n), (NodeSymbol, PortSymbol))
        ]
        near = nearest(root.name, nodes)
        if near is not None or domain is None or nearest(root.name, ("ground", "gnd", "GND", "vss")):
            return self.resolver.report_unknown(root.name, root.span)
        if self.context.scope.is_broken(root.name):
            return Failed()
        message, help_ = f"unknown name '{root.name}': no node is called so", f"node {root.name}: {domain.name}"
        return self.resolver.fail("E101", message, root.span, help=help_, subject=f"name {root.name}")

    def _no_node(self, e: syntax.Expr, symbol: object) -> Failed:
        text = self.end_text(e)
        help_ = f"on {text}.q: the element shares the ends of '{text}'" if isinstance(symbol, BranchSymbol) else None
        return self.resolver.fail("E407", f"'{text}' is no node", e.span, help=help_)

    def node_end(
        self, symbol: NodeSymbol, indices: tuple[syntax.Index, ...], change: dict[Node, Node], e: syntax.Expr
    ) -> End:
        """A node as an end, with its indices; change: of loop variables by those of the instance around."""
        if not indices and not symbol.family.shape and not symbol.family.prefix:
            return End(symbol, (), symbol.domain)
        at = (*symbol.family.prefix, *self.resolver.indices(symbol.name, symbol.family.shape, indices, e.span))
        return End(symbol, tuple(ex.substitute(a, change) for a in at), symbol.domain)

    def end_text(self, e: syntax.Expr) -> str:
        """The author's text of an end, as messages quote it."""
        return self.context.source_text(e.span)[:60]

    def domain_of(self, s: syntax.InstanceStatement, ends: Ends) -> DomainSymbol:
        """The domain of a branch by its ends (E403 where they have none)."""
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
        inner = e.expr if isinstance(e, syntax.Parenthesized) else e
        found = self.resolver.locate(inner.base if isinstance(inner, syntax.Member) and inner.name == "q" else inner)
        if found is not None and isinstance(found.symbol, (UnknownSymbol, BranchSymbol, NodeSymbol)):
            return found.symbol.domain
        if found is not None and isinstance(found.symbol, PortSymbol):
            return found.symbol.end.domain
        domains = {}
        for name in self.context.scope.names():
            symbol = self.context.scope.find(name)
            if isinstance(symbol, DomainSymbol) and symbol.displacement.dimension == value.dimension:
                domains[name] = symbol
        return next(iter(domains.values())) if len(domains) == 1 else None
