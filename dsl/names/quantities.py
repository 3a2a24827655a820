"""Quantities of a node or a branch: efforts, flows, contents, powers, state functions, and integrals of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Domain
from sysdyn.dsl.model.paynter import EFFORT_CLASSES, MEMBERS
from sysdyn.dsl.model.units import Dimension, multiply
from sysdyn.dsl.names import habits
from sysdyn.dsl.names.context import Quadrature
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.paths import Paths
from sysdyn.dsl.names.symbols import BranchSymbol, DomainSymbol, End, Typed, UnknownSymbol, nearest
from sysdyn.dsl.tree import syntax

RATES = ("dot", "der", "d", "dt", "prime")
"""Members by which other languages write a rate."""
BRANCH = ("e", "f", "q", "p", "power", "energy", *MEMBERS)
_WHOLE = {"kinetic": "audit.kinetic", "potential": "audit.potential", "dissipator": "audit.dissipated"}
"""What of the whole model an edge's state functions are, or add up to."""

STORED = {"kinetic": "T", "potential": "V"}
"""What stores of an edge hold."""
OF_ELEMENTS = "stores have T, Tstar or V, Vstar, dissipators D, G"
"""Who has state functions."""


def branch_words(domain: Domain) -> tuple[str, ...]:
    """The members of a branch with their units: `e [V]`, `f [A]`, ..."""
    units = {"e": domain.effort, "f": domain.flow, "q": domain.displacement, "p": domain.momentum}
    return (*(f"{letter} [{unit.text}]" for letter, unit in units.items()), "power [W]", "energy [J]")


class QuantityResolver(Paths):
    """What the members of nodes and branches are."""

    def _excerpt(self, e: syntax.Expr) -> str:
        return " ".join(self.source.text[e.span.start : e.span.end].split())[:60]

    def no_member(self, owner: str, e: syntax.Member, members: Iterable[str]) -> Failed:
        """Report E102 with the members there are."""
        names = list(members)
        if e.name in RATES:
            return self.fail("E102", f"'{owner}' has no member '{e.name}'", e.span, help=f"{owner}'")
        near = nearest(e.name, names)
        help_ = f"nearest: '{near}'" if near else f"it has {', '.join(names[:20])}" if names else None
        if e.name in MEMBERS and e.name not in names:
            edge = MEMBERS[e.name].edge
            help_ = f"{OF_ELEMENTS}: LABEL.{e.name}; of the whole model {_WHOLE[edge]}"
        return self.fail("E102", f"'{owner}' has no member '{e.name}'", e.span, help=help_)

    def _effort(self, family: str, kind: str, at: tuple[Node, ...], dimension: Dimension, e: syntax.Member) -> Typed:
        """The effort of a class that acts on a displacement coordinate."""
        return Typed(ex.var(family, f"{kind}:{e.name}", *at), dimension)

    def node_quantity(self, end: End, e: syntax.Member) -> Typed:
        """Member e of a common-effort node, q and f of a common-flow node."""
        domain = end.domain
        # a node that is a coordinate has its quantities
        if end.node is not None and end.node.coordinate is not None:
            return self.coordinate_quantity(end.node.coordinate, end.at, e)
        # an electrical node has a potential, and no flow of its own
        if domain.common == "effort":
            if e.name != "e":
                shown = self._excerpt(e.base)
                if habits.variable(domain.name, e.name) == "e":
                    help_ = f"write {shown}.e"
                elif e.name in MEMBERS:
                    help_ = f"{OF_ELEMENTS}: LABEL.{e.name}; the node has e"
                else:
                    help_ = "a common-effort node has e; flows belong to elements"
                raise self.fail("E102", f"node '{shown}' has no member '{e.name}'", e.span, help=help_)
            if end.node is None:
                return Typed(ex.const(0.0), domain.effort.dimension)
            return Typed(ex.var(end.node.family.name, "ne", *end.at), domain.effort.dimension)
        # a mechanical node has q, f, p, and e = p'
        kinds = {"q": ("nq", domain.displacement.dimension), "f": ("nf", domain.flow.dimension)}
        kinds["p"] = ("np", domain.momentum.dimension)
        kinds["e"] = ("np", domain.effort.dimension)  # p' = e
        # sums of efforts by their kind
        if e.name in EFFORT_CLASSES:
            # ground: all its quantities are zero
            if end.node is None:
                raise self.fail("E102", f"'{self._excerpt(e.base)}' stands still: no effort moves it", e.span)
            return self._effort(end.node.family.name, "n", end.at, domain.effort.dimension, e)
        meant = habits.variable(domain.name, e.name)
        if e.name not in kinds and meant is not None:
            shown = self._excerpt(e.base)
            raise self.fail("E102", f"'{shown}' has no member '{e.name}'", e.span, help=f"write {shown}.{meant}")
        if e.name not in kinds:
            raise self.no_member(self._excerpt(e.base), e, (*kinds, *EFFORT_CLASSES))
        kind, dimension = kinds[e.name]
        if end.node is None:
            return Typed(ex.const(0.0), dimension)
        return Typed(ex.var(end.node.family.name, kind, *end.at, order=int(e.name == "e")), dimension)

    def coordinate_quantity(self, symbol: UnknownSymbol, at: tuple[Node, ...], e: syntax.Member) -> Typed:
        """e, f, p or q of a coordinate, in the letters of its family.  at: all indices."""
        family, domain, co = symbol.family.name, symbol.domain, symbol.complementary
        assert domain is not None
        kinds: dict[str, tuple[str, Dimension]] = {
            "p" if co else "q": ("q", symbol.dimension),
            "e" if co else "f": ("f", domain.effort.dimension if co else domain.flow.dimension),
        }
        # what the kinetic stores (potential stores, of momentum coordinates) that move with it hold, and its rate
        held, rate = ("q", "f") if co else ("p", "e")
        units = {"q": domain.displacement, "f": domain.flow, "p": domain.momentum, "e": domain.effort}
        kinds[held] = ("p", units[held].dimension)
        if e.name == rate:
            return Typed(ex.var(family, "p", *at, order=1), units[rate].dimension)
        if e.name in EFFORT_CLASSES and not co:
            return self._effort(family, "x", at, units["e"].dimension, e)
        if e.name not in kinds:
            raise self.no_member(self._excerpt(e.base), e, ("q", "f", "p", "e", *(() if co else EFFORT_CLASSES)))
        kind, dimension = kinds[e.name]
        return Typed(ex.var(family, kind, *at), dimension)

    def branch_quantity(self, symbol: BranchSymbol, at: tuple[Node, ...], name: str, e: syntax.Member) -> Typed:
        """Members e f q p of a branch, and the power it absorbs."""
        family, domain = symbol.family, symbol.domain
        at = (*family.prefix, *at)
        meant = habits.variable(domain.name, name)
        # `R1.i`: written with the letter of the language
        if meant is not None and (name not in BRANCH or not self._is_store(symbol, name)):
            shown = self._excerpt(e.base)
            raise self.fail("E102", f"'{shown}' has no member '{name}'", e.span, help=f"write {shown}.{meant}")
        if name not in BRANCH:
            raise self.no_member(self._excerpt(e.base), e, BRANCH if nearest(name, BRANCH) else branch_words(domain))
        power = multiply(domain.effort.dimension, domain.flow.dimension)
        # e f
        if name == "power":
            return Typed(ex.mul(ex.var(family.name, "be", *at), ex.var(family.name, "bf", *at)), power)
        # what was absorbed since the start
        if name == "energy":
            return Typed(self._absorbed_energy(symbol, at, power, e), multiply(power, dim.TIME))
        # an element without momentum: the integral of its effort
        if name == "p" and self.complete and self._has_no_momentum(symbol):
            return Typed(self._impulse(symbol, at, e), branch_dimension(domain, "p"))
        if name in MEMBERS:
            return self._state_function(symbol, at, name, power, e)
        return Typed(ex.var(family.name, f"b{name}", *at), branch_dimension(domain, name))

    def _is_store(self, symbol: BranchSymbol, name: str) -> bool:
        """Whether a branch has the state function `name`."""
        law = self.laws.get(symbol.family.name)
        return name in MEMBERS and law is not None and law.kind == MEMBERS[name].edge

    def _has_no_momentum(self, symbol: BranchSymbol) -> bool:
        """Whether a branch has no momentum of its own: all but kinetic stores and laws that read it."""
        law, name = self.laws.get(symbol.family.name), symbol.family.name
        own = () if law is None else (n for n in ex.variables(law.law) if n.op == "var" and n.data[:2] == (name, "bp"))
        return law is not None and law.kind != "kinetic" and not any(own)

    def _impulse(self, symbol: BranchSymbol, at: tuple[Node, ...], e: syntax.Member) -> Node:
        """The momentum of a branch without a kinetic store, p' = e: the integral of its effort since the start."""
        family = symbol.family
        counters = tuple(ex.index(f"#e{k}") for k in range(len(family.whole)))
        node, unit = ex.var(family.name, "be", *counters), symbol.domain.effort.dimension
        return self.quadrature(f"{family.name}.p", node, family.whole, unit, at, e)

    def _absorbed_energy(self, symbol: BranchSymbol, at: tuple[Node, ...], power: Dimension, e: syntax.Member) -> Node:
        """The energy that a branch has absorbed since the start: what it stores more than then, where its law tells
        that alone; else a quadrature.
        """
        family = symbol.family
        counters = tuple(ex.index(f"#e{k}") for k in range(len(family.whole)))
        if (stored := self._kind_of_store(family.name)) is not None:
            first = ex.var(family.name, stored, *counters)
            begun = self.quadrature(f"{family.name}.begun", ex.const(0.0), family.whole, power, at, e, first)
            return ex.sub(ex.var(family.name, stored, *at), begun)
        node = ex.mul(ex.var(family.name, "be", *counters), ex.var(family.name, "bf", *counters))
        return self.quadrature(f"{family.name}.energy", node, family.whole, power, at, e)

    def _kind_of_store(self, family: str) -> str | None:
        """The kind of what a store holds, T or V, where its law reads nothing but its own variables: what it absorbs is
        then the difference; else None.
        """
        law = self.laws.get(family)
        if law is None or law.kind not in STORED:
            return None
        own = {
            ex.var(family, f"b{letter}", *n.args) for n in ex.variables(law.law) for letter in "efqp" if n.op == "var"
        }
        read = ex.variables(law.law)
        changed = ex.reads(law.law, self.discretes)
        alone = read <= own and len({n.args for n in read}) <= 1 and not changed
        return f"b{STORED[law.kind]}" if alone else None

    def quadrature(
        self,
        name: str,
        power: Node | Callable[[], Node],
        shape: tuple[tuple[Node, Node], ...],
        dimension: Dimension,
        at: tuple[Node, ...],
        e: syntax.Expr,
        first: Node | None = None,
    ) -> Node:
        """The integral of a power (over the counters #e0, #e1, ... of its shape) at one element, from zero or from the
        initial value of `first`.
        """
        found = Quadrature(power, shape, multiply(dimension, dim.TIME), self.place(e.span), first)
        self.quadratures.setdefault(name, found)
        return ex.var(name, "s", *at)

    def balance(self, name: str, rate: Node, first: Node, dimension: Dimension, e: syntax.Expr) -> Node:
        """The integral of a rate that starts at the initial value of `first`."""
        self.quadratures.setdefault(name, Quadrature(rate, (), dimension, self.place(e.span), first))
        return ex.var(name, "s")

    def _state_function(
        self, symbol: BranchSymbol, at: tuple[Node, ...], name: str, power: Dimension, e: syntax.Member
    ) -> Typed:
        """T, T*, V, V* of a store (J), D, G of a dissipator (W): what the compiler makes of its law."""
        function = MEMBERS[name]
        law = self.laws.get(symbol.family.name)
        if law is None or law.kind != function.edge:
            what = "a dissipator" if function.edge == "dissipator" else f"a {function.edge} store"
            own = [m for m, f in MEMBERS.items() if law is not None and f.edge == law.kind]
            shown = self._excerpt(e.base)
            help_ = " or ".join(f"{shown}.{member}" for member in (*own, "power", "energy"))
            raise self.fail("E102", f"'{shown}' has no member '{name}': it is not {what}", e.span, help=help_)
        dimension = power if function.edge == "dissipator" else multiply(power, dim.TIME)
        return Typed(ex.var(symbol.family.name, f"b{function.name}", *at), dimension)


def branch_dimension(domain: DomainSymbol, letter: str) -> Dimension:
    """Dimension of e, f, q or p in a domain."""
    unit = {"e": domain.effort, "f": domain.flow, "q": domain.displacement, "p": domain.momentum}[letter]
    return unit.dimension
