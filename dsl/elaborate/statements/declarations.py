"""Declarations: coordinates, implicit unknowns, states, nodes, inputs, lets and outputs, labels."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace

from sysdyn.dsl.elaborate.instances.head import Body
from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.elaborate.statements import events
from sysdyn.dsl.elaborate.statements.parameters import ParameterDeclarations
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Coordinate, InitialCondition, Loop, NodeFamily, State, Unknown
from sysdyn.dsl.model.units import NONE, Dimension, si
from sysdyn.dsl.names import habits
from sysdyn.dsl.names.context import Use
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.symbols import (
    BundleNode,
    BundleSymbol,
    ConstraintSymbol,
    Definition,
    DomainSymbol,
    NameFamily,
    NodeSymbol,
    PortSymbol,
    UnknownSymbol,
    Vector,
    nearest,
)
from sysdyn.dsl.text.diagnostics import Related
from sysdyn.dsl.tree import syntax

DECLARED = (
    syntax.CoordStatement,
    syntax.ImplicitStatement,
    syntax.StateStatement,
    syntax.NodeStatement,
    syntax.LetStatement,
    syntax.OutputStatement,
    syntax.QuasiStatement,
    syntax.ConstraintStatement,
    syntax.DiscreteStatement,
)
"""Statements that bring names into a scope by `declare`."""
BEGINNING = (syntax.CoordStatement, syntax.ImplicitStatement, syntax.StateStatement, syntax.NodeStatement)
"""Those that may say a value to begin with, which is read by `begin` once all names stand."""


class Declarations:
    """Brings the names of a space into scope."""

    def __init__(self, context: ElaborationContext, parameters: ParameterDeclarations) -> None:
        self.context, self.resolver, self.parts = context, context.resolver, context.parts
        self.parameters = parameters
        self._begun: dict[tuple[Node, tuple[Loop, ...], int], InitialCondition] = {}  # by target, loops, depth

    def declare_all(self, body: Body, do: Callable[[syntax.Statement], None], more: tuple[type, ...] = ()) -> None:
        """The names of a body by `do`, in any order: what takes its unit from a value comes behind what that reads,
        values to begin with behind all names.  more: kinds of statements that `do` reads besides.
        """
        statements = body.with_loops((*DECLARED, *more))
        self.context.each([s for s in statements if not _takes_its_unit(s[0])], do)
        if late := [s for s in statements if _takes_its_unit(s[0])]:
            named = {
                s.decl.name: (s, at)
                for s, at in late
                if isinstance(s, syntax.StateStatement | syntax.DiscreteStatement)
            }
            self.context.each(late if len(named) < len(late) else self.parameters.by_dependence(named), do)
        self.context.each(body.statements_of(BEGINNING), self.begin)

    def declare(self, statement: syntax.Statement) -> None:
        """One declaration; statements of other kinds are passed over."""
        match statement:
            # `coord x: translation`
            case syntax.CoordStatement():
                self._coordinates(statement)
            # `implicit F: N`: an unknown that gammas determine
            case syntax.ImplicitStatement():
                unit = self.context.unit(statement.unit)
                for decl in statement.decls:
                    family = self.context.current.family(decl.name, self.context.shape(decl))
                    self._enter_unknown(decl, "e", family, unit.dimension, None, False)
                    self.parts.unknowns.append(Unknown(family.name, family.whole, unit, self.context.place(decl.span)))
            case syntax.StateStatement():
                self._state(statement)
            case syntax.NodeStatement():
                self._nodes(statement)
            # resolved when they are read first: they may read what stands below
            case syntax.LetStatement() | syntax.OutputStatement() | syntax.QuasiStatement():
                self._definition(statement)
            # a label: its multiplier and residual can be read
            case syntax.ConstraintStatement():
                decl = statement.decl
                family = self.context.current.family(decl.name)
                self.context.enter(ConstraintSymbol(decl.name, statement.kind, family, self.context.place(decl.span)))
            case syntax.DiscreteStatement():
                events.discrete(self.context, statement)

    def _enter_unknown(
        self,
        decl: syntax.Decl,
        kind: str,
        family: NameFamily,
        dimension: Dimension,
        domain: DomainSymbol | None,
        co: bool,
    ) -> None:
        self.context.enter(UnknownSymbol(decl.name, kind, family, dimension, domain, co, self.context.place(decl.span)))

    def _nodes(self, statement: syntax.NodeStatement) -> None:
        """Nodes, and the members of a bundle of them."""
        bundle = self.context.scope.find(statement.domain.name)
        if isinstance(bundle, BundleSymbol):
            if statement.init is not None:
                message = "a bundle has no single initial value"
                raise self.resolver.fail("E207", message, statement.init.span, help="init name.member.q = ...")
            for decl in statement.decls:
                self.context.enter(self._bundle(decl, decl.name, bundle))
            return
        domain = self.domain(statement.domain)
        for decl in statement.decls:
            self.context.enter(self._node(decl, decl.name, domain))

    def _bundle(self, decl: syntax.Decl, name: str, bundle: BundleSymbol) -> BundleNode:
        """The nodes of a bundle, of those within it too; name: the path to it."""
        members: dict[str, NodeSymbol | PortSymbol | BundleNode] = {}
        for member, kind in bundle.members:
            inner = f"{name}.{member}"
            if isinstance(kind, BundleSymbol):
                members[member] = self._bundle(decl, inner, kind)
            else:
                members[member] = self._node(decl, inner, kind)
        return BundleNode(name, members, self.context.place(decl.span))

    def _node(self, decl: syntax.Decl, name: str, domain: DomainSymbol) -> NodeSymbol:
        family = self.context.current.family(name, self.context.shape(decl))
        place = self.context.place(decl.span)
        self.parts.nodes.append(NodeFamily(family.name, family.whole, domain, place))
        return NodeSymbol(name, family, domain, place)

    def _coordinates(self, statement: syntax.CoordStatement) -> None:
        """Coordinates with their rates and conjugates; cocoord: momenta are the positions."""
        domain = self.domain(statement.domain)
        co = statement.kind == "cocoord"
        own, rate = (domain.momentum, domain.effort) if co else (domain.displacement, domain.flow)
        conjugate, effort = (domain.displacement, domain.flow) if co else (domain.momentum, domain.effort)
        for decl in statement.decls:
            family = self.context.current.family(decl.name, self.context.shape(decl))
            self._enter_unknown(decl, "q", family, own.dimension, domain, co)
            place = self.context.place(decl.span)
            self.parts.coordinates.append(
                Coordinate(
                    family.name, family.whole, co, own, rate, conjugate, effort, statement.tangible, place, domain
                )
            )

    def begin(self, statement: syntax.Statement) -> None:
        """The value with which what a declaration names begins; nothing where the name is another's (E106)."""
        match statement:
            # `coord x: translation = 1 m`
            case syntax.CoordStatement() | syntax.ImplicitStatement() | syntax.NodeStatement():
                init, decls = statement.init, statement.decls
            # `state s = 1 m`
            case syntax.StateStatement(decl=decl, value=value) if value is not None:
                init, decls = syntax.InitialValue("fixed", value, value.span), (decl,)
            # nothing else begins with a value
            case _:
                return
        if init is None:
            return
        for decl in decls:
            symbol = self.context.scope.symbols.get(decl.name)
            if not isinstance(symbol, UnknownSymbol | NodeSymbol) or symbol.place != self.context.place(decl.span):
                raise Failed
            # the kind of unknown whose value is given
            if isinstance(symbol, UnknownSymbol):
                kind, dimension = symbol.kind, symbol.dimension
            # an electrical node begins with its effort
            elif symbol.domain.common == "effort":
                kind, dimension = "ne", symbol.domain.effort.dimension
            # a mechanical node with its displacement
            else:
                kind, dimension = "nq", symbol.domain.displacement.dimension
            self._own_initial(decl, kind, symbol.family, dimension, init)

    def _own_initial(
        self, decl: syntax.Decl, kind: str, family: NameFamily, dimension: Dimension, init: syntax.InitialValue
    ) -> None:
        """The initial value in a declaration: for all elements of the family, in a `for` for those of its variables."""
        message = f"'{decl.name}' is in {dim.show(dimension)} but starts at {{}}"
        outer = len(self.resolver.loops)
        with ExitStack() as stack:
            at = tuple(
                self.context.loop_index(index)
                or ex.index(stack.enter_context(self.resolver.loop(f"i{k + 1}", *bounds)).index)
                for k, (index, bounds) in enumerate(zip(decl.indices, family.shape, strict=True))
            )
            target = ex.var(family.name, kind, *family.prefix, *at)
            for one, value, loops in self.values_at_start(target, init.value, dimension, message, outer):
                fixed, unit = init.kind == "fixed", si(dimension).text
                self.add_initial(InitialCondition(one, value, fixed, loops, self.context.place(init.span), unit=unit))

    def values_at_start(
        self, target: Node, written: syntax.Expr, dimension: Dimension, message: str, outer: int
    ) -> Iterator[tuple[Node, Node, tuple[Loop, ...]]]:
        """What begins with which value, under which loops: the elements over the loops behind the first `outer` with
        one value for all, or by a list with one for each.
        """
        found, loops = self.resolver.resolve(written), self.resolver.loops
        if not isinstance(found, Vector) or len(loops) != outer + 1:
            one = self.resolver.one_number(found, written)
            yield target, self.resolver.fitting(one, written, dimension, "E207", message), loops
            return
        own, items = loops[-1], found.items
        name = str(target).partition("[")[0]
        self.resolver.uses.append(
            Use((own.first, own.last), own.last, loops[:outer], name, self.context.place(written.span), len(items))
        )
        for k, item in enumerate(items):
            at = {ex.index(own.index): ex.add(own.first, ex.const(k))}
            value = self.resolver.fitting(item, written, dimension, "E207", message)
            yield ex.substitute(target, at), ex.substitute(value, at), loops[:outer]

    def add_initial(self, initial: InitialCondition, override: bool = False) -> None:
        """Enter an initial value; override: of a scene.  What stands further outside goes before (language, 34)."""
        path = self.context.current.path
        initial = replace(initial, depth=0 if override else 2 + path.count(".") if path else 1)
        before = self._begun.setdefault((initial.target, initial.loops, initial.depth), initial)
        if before is not initial:
            related = (Related("first here", before.place),)
            message = f"'{initial.target}' gets its initial value twice"
            self.context.report.error("E106", message, initial.place, help="one of the two", related=related)
            raise Failed
        self.parts.initials.append(initial)

    def _state(self, statement: syntax.StateStatement) -> None:
        """A dynamic variable; its unit is said, or that of its initial value."""
        decl = statement.decl
        unit = self.context.unit(statement.unit) if statement.unit else None
        if unit is None:
            value = None if statement.value is None else self.resolver.resolve(statement.value)
            first = value.items[0] if isinstance(value, Vector) else value
            unit = si((first.dimension or NONE) if first is not None else NONE)
        family = self.context.current.family(decl.name, self.context.shape(decl))
        self._enter_unknown(decl, "s", family, unit.dimension, None, False)
        self.parts.states.append(State(family.name, family.whole, unit, self.context.place(decl.span)))

    def _definition(self, statement: syntax.LetStatement | syntax.OutputStatement | syntax.QuasiStatement) -> None:
        """let, output, quasi: resolved when they are read first."""
        decl = statement.decl
        kind = {syntax.LetStatement: "let", syntax.OutputStatement: "output", syntax.QuasiStatement: "quasi"}[
            type(statement)
        ]
        dimension = (
            self.context.unit(statement.unit).dimension if isinstance(statement, syntax.QuasiStatement) else None
        )
        at: tuple[str, ...] = ()
        implied = False
        # `for i in 1..n { let x[i] = ... }`: a formula with loop variables
        if decl.indices and not any(isinstance(i, syntax.Range) for i in decl.indices):
            at = tuple(i.name for i in decl.indices if isinstance(i, syntax.Name))
            if len(at) != len(decl.indices):
                raise self.resolver.fail(
                    "E806", f"'{decl.name}' is declared by its loop variables", decl.span, help="let x[i] = ..."
                )
        # `let x[1..3] = 2 m` gives no formula for the elements
        elif decl.indices and not isinstance(statement.value, syntax.Array):
            help_ = f"for i in ... {{ {kind} {decl.name}[i] = ... }}"
            raise self.resolver.fail(
                "E806", f"the elements of '{decl.name}' are given by one formula", decl.span, help=help_
            )
        # `for i in 1..n { let x = ... }`: known inside the loop alone
        elif self.resolver.bound_loops():
            at, implied = tuple(self.resolver.bound_loops()), True
        place = self.context.place(decl.span)
        if kind == "quasi":
            self.parts.quasis.append(self.context.current.family(decl.name).name)
        self.context.enter(
            Definition(decl.name, kind, statement.value, at, dimension, self.context.current, place, decl.span, implied)
        )

    def domain(self, word: syntax.Word) -> DomainSymbol:
        """The domain of that name; E202."""
        symbol = self.context.scope.find(word.name)
        if isinstance(symbol, DomainSymbol):
            return symbol
        domains = [n for n in self.context.scope.names() if isinstance(self.context.scope.find(n), DomainSymbol)]
        near = nearest(word.name, domains)
        if self.context.scope.is_broken(word.name):
            raise Failed
        help_ = f"'{near}'" if near else f"one of {', '.join(domains)}"
        help_ = habits.DOMAINS.get(word.name, help_)
        raise self.resolver.fail("E202", f"'{word.name}' is not a domain", word.span, help=help_)


def _takes_its_unit(statement: syntax.Statement) -> bool:
    """Whether a declaration has no unit but that of its value."""
    return isinstance(statement, syntax.DiscreteStatement) or (
        isinstance(statement, syntax.StateStatement) and statement.unit is None
    )
