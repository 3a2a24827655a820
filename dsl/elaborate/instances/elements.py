"""Elements between nodes: builtin one-ports and two-ports, and the branches that laws make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from sysdyn.dsl.elaborate.instances.connections import Connections, Ends
from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.elaborate.statements import friction
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Coupling, Shape, Terminal
from sysdyn.dsl.model.units import NONE, si
from sysdyn.dsl.names.calls import walk
from sysdyn.dsl.names.laws import ONE_PORTS, law_of, own_variables, ratio_of
from sysdyn.dsl.names.symbols import (
    BranchSymbol,
    DomainSymbol,
    End,
    NameFamily,
    Space,
    TwoPortSymbol,
    Typed,
)
from sysdyn.dsl.text.diagnostics import Place, Related
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass


@dataclass(slots=True)
class Pending:
    """A law to be resolved when every name of the model is known."""

    space: Space
    span: syntax.Span
    resolve: Callable[[], None]


class Elements:
    """Elaborates builtin elements and component laws."""

    def __init__(self, context: ElaborationContext, connections: Connections) -> None:
        self.context, self.resolver, self.parts = context, context.resolver, context.parts
        self.connections = connections
        self.pending: list[Pending] = []

    def add_builtin(self, s: syntax.InstanceStatement) -> None:
        """A one-port or two-port: its ends, its branches, its law for later."""
        kind = s.component.names[0]
        at, shape = self.connections.label_indices(s)
        side, value, span = self._law_argument(s, kind)
        # one branch: potential, kinetic, dissipator, effort, flow
        if kind in ONE_PORTS:
            if len(s.connections) != 1:
                wants = "1 connection: label: component() a -> b"
                raise self.resolver.fail(
                    "E402", f"'{s.decl.name}: {kind}' needs {wants}, has {len(s.connections)}", s.span
                )
            ends = self.connections.ends_of(s, s.connections[0])
            symbol = self._branch_symbol(s, s.decl.name, self.connections.domain_of(s, ends), shape)
            self._enter_element(symbol, symbol)
            self._later_law(symbol, at, side, value, kind, span, ends, s)
            return
        # a transformer or gyrator has two branches, `E#1` and `E#2`
        connections = [c for c in s.connections if not isinstance(c, syntax.Bind)]
        if len(connections) != 2:
            raise self.resolver.fail(
                "E402", f"'{s.decl.name}: {kind}' needs 2 branches, has {len(connections)}", s.span
            )
        both = [self.connections.ends_of(s, c) for c in connections]
        one, two = (
            self._branch_symbol(s, f"{s.decl.name}#{k}", self.connections.domain_of(s, e), shape)
            for k, e in enumerate(both, 1)
        )
        self._enter_element(TwoPortSymbol(s.decl.name, (one, two), self.context.place(s.decl.span)), one)
        self._later_ratio((one, two), at, (kind, side, value, span), (both[0], both[1]), s)

    def _law_argument(self, s: syntax.InstanceStatement, kind: str) -> tuple[str, syntax.Expr, syntax.Span]:
        """Which variable the law of a builtin element gives, the expression, its place."""
        sides = ("e", "f", "p", "q") if kind in ONE_PORTS else ("e1", "e2", "f1", "f2")
        args = s.args or ()
        if len(args) != 1:
            help_ = f"{kind}({sides[0]} = ...)"
            raise self.resolver.fail("E303", f"'{kind}' takes one law, {len(args)} given", s.span, help=help_)
        if args[0].name is None:
            text, side = self.context.source_text(args[0].span), "f" if kind in ("flow", "kinetic") else sides[0]
            message = f"'{text}' is a positional argument: '{kind}' is given its law by name"
            raise self.resolver.fail("E404", message, args[0].span, help=f"{side} = {text}")
        if args[0].name not in sides:
            raise self.resolver.fail(
                "E405", f"'{kind}' has no law '{args[0].name}'", args[0].span, help=", ".join(sides)
            )
        return args[0].name, args[0].value, args[0].span

    def _branch_symbol(
        self, s: syntax.InstanceStatement, name: str, domain: DomainSymbol, shape: Shape
    ) -> BranchSymbol:
        return BranchSymbol(name, self.context.current.family(name, shape), domain, self.context.place(s.decl.span))

    def _enter_element(self, symbol: BranchSymbol | TwoPortSymbol, first: BranchSymbol) -> None:
        """Enter a label; several loops over disjoint ranges may declare one."""
        before = self.context.scope.symbols.get(symbol.name)
        if type(before) is not type(symbol) or not first.family.shape:
            self.context.enter(symbol)
            return
        assert isinstance(before, (BranchSymbol, TwoPortSymbol))
        declared = before if isinstance(before, BranchSymbol) else before.branches[0]
        if len(declared.family.shape) != len(first.family.shape):  # an element and an array of one label
            self.context.enter(symbol)
            return
        if isinstance(before, BranchSymbol) and isinstance(symbol, BranchSymbol):
            self.context.scope.symbols[symbol.name] = _hull(before, symbol)
        elif isinstance(before, TwoPortSymbol) and isinstance(symbol, TwoPortSymbol):
            one, two = (_hull(a, b) for a, b in zip(before.branches, symbol.branches, strict=True))
            self.context.scope.symbols[symbol.name] = TwoPortSymbol(symbol.name, (one, two), before.place)

    def _later_law(
        self,
        symbol: BranchSymbol,
        at: tuple[Node, ...],
        side: str,
        value: syntax.Expr,
        kind: str | None,
        span: syntax.Span,
        ends: Ends,
        s: syntax.InstanceStatement | syntax.LawStatement,
    ) -> None:
        """The law is resolved when all names are known."""
        loops, bound = self.resolver.loops, self.resolver.sight()
        whole = (*symbol.family.prefix, *at)

        def part() -> None:
            """Of the loops in sight: of all, or where the law reads several statements of a label, of a part."""
            law, loops = law_of(self.resolver, symbol, whole, side, value, kind, span), self.resolver.loops
            # set-valued friction: sticks at zero and slips else; becomes an unknown with switches
            if ex.calls(law.law, "setsign"):
                unit = si(own_variables(symbol, whole)[law.side].dimension or NONE)
                node = friction.of_law(
                    self.context, law, symbol.family.name, whole, loops, self.context.place(s.span), unit
                )
                law = replace(law, law=node)
            self.resolver.laws[symbol.family.name] = law
            said = law.kind, law.side, law.law
            branch = self.branch(
                symbol.family.name, symbol.domain, whole, loops, said, ends, self.context.place(s.span)
            )
            self.parts.branches.append(branch)

        def resolve() -> None:
            # a law of a component's own branch has e, f, q, p in sight; a builtin's has those of its symbol
            own = self.context.current.bound if not kind and symbol.family.name == self.context.current.path else None
            own = own_variables(symbol, whole) if own is None else own
            self._hidden(value, own, symbol.name)
            with self.resolver.inside(loops, {**bound, **own}):
                self.context.in_parts(part, span)

        self.pending.append(Pending(self.context.current, span, resolve))

    def branch(
        self,
        name: str,
        domain: DomainSymbol,
        at: tuple[Node, ...],
        loops: tuple,  # type: ignore[type-arg]
        law: tuple[str, str | None, Node | None],
        ends: Ends,
        place: Place,
    ) -> Branch:
        """A branch as the compiler receives it; law: its kind, its side, the law."""
        kind, side, node = law
        if ends.on is not None:
            return Branch(name, at, loops, domain, kind, side, node, None, None, ends.on.node, place)
        assert ends.plus is not None
        assert ends.minus is not None
        plus, minus = _terminal(ends.plus), _terminal(ends.minus)
        return Branch(name, at, loops, domain, kind, side, node, plus, minus, None, place)

    def _later_ratio(
        self,
        branches: tuple[BranchSymbol, BranchSymbol],
        at: tuple[Node, ...],
        law: tuple[str, str, syntax.Expr, syntax.Span],
        ends: tuple[Ends, Ends],
        s: syntax.InstanceStatement,
    ) -> None:
        """The ratio of a two-port is resolved when all names are known."""
        loops, bound = self.resolver.loops, self.resolver.sight()
        whole = (*branches[0].family.prefix, *at)
        kind, side, value, span = law

        def part() -> None:
            ratio, loops = ratio_of(self.resolver, branches, whole, kind, side, value, span), self.resolver.loops
            place = self.context.place(s.span)
            # both branches have no law of their own: the coupling relates them
            for symbol, end in zip(branches, ends, strict=True):
                name, domain, port = symbol.family.name, symbol.domain, ("port", None, None)
                self.parts.branches.append(self.branch(name, domain, whole, loops, port, end, place))
            first, second = (b.family.name for b in branches)
            self.parts.couplings.append(
                Coupling(ratio.kind, first, second, whole, loops, ratio.side, ratio.ratio, place)
            )

        def resolve() -> None:
            # e1, f1, e2, f2 stand for the two sides in the ratio
            own = {**own_variables(branches[0], whole, "1"), **own_variables(branches[1], whole, "2")}
            self._hidden(value, own, s.decl.name)
            with self.resolver.inside(loops, bound), self.resolver.bound(own):
                self.context.in_parts(part, span)

        self.pending.append(Pending(self.context.current, span, resolve))

    def _hidden(self, value: syntax.Expr, own: dict[str, Typed], name: str) -> None:
        """W101: an element's own variable hides an outer name in its law."""
        hidden = {name for name in own if self.context.scope.symbols.get(name) is not None}
        for node in walk(value) if hidden else ():
            if isinstance(node, syntax.Name) and node.name in hidden:
                what = {"e": "effort", "f": "flow", "q": "displacement", "p": "momentum"}[node.name[0]]
                message = f"'{node.name}' in the law of '{name}' is the element's own {what}; it hides the outer name"
                self.context.report.warning(
                    "W101", message, self.context.place(node.span), help="rename the outer one, or write it as a let"
                )

    def law(self, s: syntax.LawStatement) -> None:
        """`law e = R*f`, `law b.e = ...`: the right edge of the diagram for a branch of the component."""
        name, letter = "", None
        if isinstance(s.left, syntax.Name):
            letter = s.left.name
        elif isinstance(s.left, syntax.Member) and isinstance(s.left.base, syntax.Name):
            name, letter = s.left.base.name, s.left.name
        symbol = self.context.scope.symbols.get(name)
        if letter not in ("e", "f", "p", "q") or not isinstance(symbol, BranchSymbol):
            message = "the law must be solved for one port variable of its edge"
            raise self.resolver.fail("E303", message, s.left.span, help="'e = ...(f)'")
        if name in self.context.current.laws:
            related = (Related("the first law", self.context.current.laws[name]),)
            message = f"branch '{name or self.context.current.path}' has two laws"
            raise self.resolver.fail("E305", message, s.span, related=related)
        self.context.current.laws[name] = self.context.place(s.span)
        self._later_law(symbol, (), letter, s.right, None, s.span, self.context.current.ends[name], s)

    def lawless(self, space: Space) -> None:
        """Branches without a law stand in energies and constraints; E306 where they stand in nothing."""
        for name, ends in space.ends.items():
            symbol = space.scope.symbols[name]
            if name in space.laws or not isinstance(symbol, BranchSymbol):
                continue
            family, field = symbol.family.name, ("field", None, None)
            branch = self.branch(family, symbol.domain, space.prefix, space.loops, field, ends, symbol.place)
            self.parts.branches.append(branch)


def _terminal(end: End) -> Terminal:
    return Terminal(None, ()) if end.node is None else Terminal(end.node.family.name, end.at)


def _hull(a: BranchSymbol, b: BranchSymbol) -> BranchSymbol:
    """One symbol for two ranges of a label."""
    shape = tuple(
        (ex.call("min", first, other), ex.call("max", last, end))
        for (first, last), (other, end) in zip(a.family.shape, b.family.shape, strict=True)
    )
    return BranchSymbol(a.name, NameFamily(a.family.name, a.family.prefix, a.family.around, shape), a.domain, a.place)
