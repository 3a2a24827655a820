"""Members: `x.f`, `R1.e`, `rod.multiplier`, `audit.energy`, `rod.on(x)`.

A last name that is no symbol where its path leads (paths.py) is a quantity of what was reached (quantities.py).
"""

from __future__ import annotations

from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Constraint, Domain
from sysdyn.dsl.model.paynter import MEMBERS
from sysdyn.dsl.model.units import NONE
from sysdyn.dsl.names import habits
from sysdyn.dsl.names.context import Value
from sysdyn.dsl.names.failures import Failed, NotYetError
from sysdyn.dsl.names.paths import Located
from sysdyn.dsl.names.ports import PortResolver
from sysdyn.dsl.names.quantities import BRANCH, OF_ELEMENTS, branch_words
from sysdyn.dsl.names.reactions import ledger, reaction
from sysdyn.dsl.names.symbols import (
    BranchSymbol,
    ComponentSymbol,
    ConstraintSymbol,
    Definition,
    End,
    InstanceSymbol,
    NodeSymbol,
    ParameterSymbol,
    PortSymbol,
    Space,
    TwoPortSymbol,
    Typed,
    UnknownSymbol,
    Unsupported,
    Vector,
    nearest,
)
from sysdyn.dsl.tree import syntax

_ELEMENTS = (BranchSymbol, TwoPortSymbol, InstanceSymbol)
AUDIT = {"energy": dim.ENERGY, "kinetic": dim.ENERGY, "potential": dim.ENERGY, "dissipated": dim.ENERGY}
AUDIT |= {"supplied": dim.ENERGY, "constraints": NONE, "drift": NONE}


class Members(PortResolver):
    """Members of what a path leads to."""

    # -- elements ------------------------------------------------------------------------------------------

    def _item(self, e: syntax.Item) -> Value:
        """`x[i]`: an element of a parameter, an unknown, a definition or a vector."""
        found = self.locate(e)
        # a path to something that was declared
        if found is not None:
            symbol = found.symbol
            if isinstance(symbol, (ParameterSymbol, UnknownSymbol)):
                return self._substitute(self.own_element(symbol, found.indices, e.span), found.change)
            # a formula with loop variables, at these indices
            if isinstance(symbol, Definition) and symbol.at and not symbol.implied:
                if len(found.indices) != len(symbol.at):
                    raise self.index_count(symbol.name, len(symbol.at), len(found.indices), e.span)
                at = tuple(self.index(i) for i in found.indices)
                return self.outside(lambda: self.definition(symbol, at), found.change, e.span)
            if not isinstance(symbol, Definition):
                return self.value(symbol, e.span)
        # `[a, b, c][2]`, or a list by its name
        value = self.resolve(e.base)
        if not isinstance(value, Vector):
            raise self.fail("E805", "only an array has elements", e.span)
        if len(e.indices) != 1:
            raise self.index_count("the array", 1, len(e.indices), e.span)
        index = e.indices[0]
        if isinstance(index, syntax.Range):
            return self.slice(value, index)
        return self.element_of_list(value, self.index(index), index.span)

    # -- members -------------------------------------------------------------------------------------------

    def _member(self, e: syntax.Member) -> Value:
        """`base.name`: a meter of the audit, something declared inside an instance, or a quantity of what base is."""
        if isinstance(e.base, syntax.Name) and e.base.name == "audit" and self.scope.find("audit") is None:
            return self._audit(e)
        whole = self.locate(e)
        if whole is not None:
            return self.outside(lambda: self.value(whole.symbol, e.span), whole.change, e.span)
        base = self.locate(e.base)
        if base is None:
            self._lacking(e.base)
            root = _root(e.base)
            if root is not None and root.name not in self._bound and self.scope.find(root.name) is None:
                raise self.report_unknown(root.name, root.span)
            raise self.fail("E102", f"'{self._excerpt(e.base)}' has no member '{e.name}'", e.span)
        return self._quantity_of(base, e)

    def _audit(self, e: syntax.Member) -> Value:
        if e.name in AUDIT:
            return Typed(ex.var(e.name, "audit"), AUDIT[e.name])
        domains = {b.domain.name: b.domain for b in self.branches if b.domain.pseudo}
        if e.name not in domains:
            if self.scope.is_broken(e.name):
                raise Failed
            raise self.no_member("audit", e, (*AUDIT, *domains))
        return self._ledger(domains[e.name], e)

    def _lacking(self, e: syntax.Expr) -> None:
        """Say what an instance on the way to a part of it lacks; nothing where it could not be made, as was said."""
        while isinstance(e, (syntax.Member, syntax.Item)):
            outer = self.locate(e.base)
            if outer is not None and isinstance(outer.symbol, InstanceSymbol):
                if not outer.symbol.spaces:
                    raise Failed
                if isinstance(e, syntax.Member):
                    self._instance(outer.symbol, outer, e)
            e = e.base

    def _ledger(self, domain: Domain, e: syntax.Member) -> Value:
        """What the stores of a pseudo domain have gained since the start less what the other branches gave: zero."""
        if not self.complete:
            raise self.fail("E102", f"audit.{e.name} is a result: no law can read it", e.span)
        held, supplied = ledger(domain, self.branches)
        unit = domain.displacement if domain.common == "effort" else domain.momentum
        given = self.balance(f"audit.{domain.name}", supplied, held, unit.dimension, e)
        return Typed(ex.sub(held, given), unit.dimension)

    def _quantity_of(self, base: Located, e: syntax.Member) -> Value:
        """The quantity `e.name` of a coordinate, constraint, node, branch or instance."""
        symbol = base.symbol
        shown = self._excerpt(e.base)
        match symbol:
            case UnknownSymbol() if symbol.kind == "q":
                return self._coordinate(symbol, base, e)
            case ConstraintSymbol():
                return self._constraint_member(symbol, base, e)
            # its own quantities; what an instance takes in where it is one of its ports
            case NodeSymbol():
                at = (
                    *symbol.family.prefix,
                    *self.indices(symbol.name, symbol.family.shape, base.indices, e.span),
                )
                end = End(symbol, at, symbol.domain)
                if e.name == ("e" if end.domain.common == "flow" else "f") and self.of_ports(e.base):
                    return self.taken_in(end, e)
                return self._substitute(self.node_quantity(end, e), base.change)
            # inside a component: the node outside
            case PortSymbol():
                if base.indices:
                    raise self.index_count(symbol.name, 0, len(base.indices), e.span)
                if e.name == ("e" if symbol.end.domain.common == "flow" else "f"):
                    return self.taken_in(symbol.end, e)
                return self._substitute(self.node_quantity(symbol.end, e), base.change)
            # R1.e, R1.f, R1.power
            case BranchSymbol():
                at = self.indices(symbol.name, symbol.family.shape, base.indices, e.span)
                return self._substitute(self.branch_quantity(symbol, at, e.name, e), base.change)
            case TwoPortSymbol():
                return self._two_port(symbol, base, e)
            case InstanceSymbol():
                return self._instance(symbol, base, e)
            case Unsupported():
                raise Failed
        # parameters, definitions and components have no members
        kind = "parameter" if isinstance(symbol, ParameterSymbol) else "value"
        help_ = self._elements_nearby(e)
        if isinstance(symbol, ComponentSymbol) and (near := nearest(e.name, self.scope.names())):
            kind, help_ = "component or model: its names are read by themselves", near
        raise self.fail("E102", f"'{shown}' has no member '{e.name}': it is a {kind}", e.span, help=help_)

    def _elements_nearby(self, e: syntax.Member) -> str | None:
        """The elements that stand beside a name without members: one of them is meant."""
        inner = e.base.base if isinstance(e.base, syntax.Member) else None
        outer = None if inner is None else self.locate(inner)
        scope = self.scope
        if outer is not None and isinstance(outer.symbol, InstanceSymbol):
            scope = self.space_of(outer.symbol, outer, e.span)[0].scope
        names = [n for n in (scope.symbols if scope is not self.scope else scope.names()) if n]
        found = [n for n in names if isinstance(scope.find(n), _ELEMENTS)]
        return f"elements that have members: {', '.join(found[:10])}" if found else None

    def _coordinate(self, symbol: UnknownSymbol, base: Located, e: syntax.Member) -> Value:
        """e, f, p or q of a coordinate."""
        at = (*symbol.family.prefix, *self.indices(symbol.name, symbol.shape, base.indices, e.span))
        return self._substitute(self.coordinate_quantity(symbol, at, e), base.change)

    def _two_port(self, symbol: TwoPortSymbol, base: Located, e: syntax.Member) -> Value:
        """Member of a transformer or gyrator: e1, f2, ... of a side, or what both sides absorb."""
        members = {f"{letter}{k}": (letter, k) for k in (1, 2) for letter in "efqp"}
        if e.name in ("power", "energy"):  # what both sides absorb: zero, but for what a run leaves of it
            both = []
            for branch in symbol.branches:
                at = self.indices(symbol.name, branch.family.shape, base.indices, e.span)
                both.append(self.branch_quantity(branch, at, e.name, e))
            whole = Typed(ex.add(*(side.node for side in both)), both[0].dimension)
            return self._substitute(whole, base.change)
        if e.name not in members:
            raise self.no_member(symbol.name, e, (*members, "power", "energy"))
        letter, k = members[e.name]
        branch = symbol.branches[k - 1]
        at = self.indices(symbol.name, branch.family.shape, base.indices, e.span)
        return self._substitute(self.branch_quantity(branch, at, letter, e), base.change)

    def _instance(self, symbol: InstanceSymbol, base: Located, e: syntax.Member) -> Value:
        """A member of an instance: a quantity of its branch, or what its component declares."""
        space, change = self.space_of(symbol, base, e.base.span)
        branch = space.scope.symbols.get("")
        # a quantity of the component's own branch
        if isinstance(branch, BranchSymbol) and e.name in BRANCH:
            return self._substitute(self.branch_quantity(branch, (), e.name, e), change)
        if space.scope.is_broken(e.name):
            raise Failed
        level = f" at level {space.level}" if space.level else ""
        # another level has it: noted where scenes may be run at several levels
        if e.name in space.elsewhere and self.lenient:
            message = f"'{self._excerpt(e.base)}' has no '{e.name}'{level}: left out"
            self.report.note("N905", message, self.place(e.span))
            raise Failed
        if e.name in space.elsewhere:
            message = f"'{self._excerpt(e.base)}' has no member '{e.name}'{level}"
            raise self.fail("E102", message, e.span, help=f"level {space.elsewhere[e.name]} has it")
        # `R1.v`: the error of the branch names e
        if isinstance(branch, BranchSymbol) and habits.variable(branch.domain.name, e.name) is not None:
            return self._substitute(self.branch_quantity(branch, (), e.name, e), change)  # which says what is meant
        # a near name, or a list of what is there
        names = [n for n in space.scope.symbols if n]
        near = nearest(e.name, (*names, *BRANCH) if branch is not None else names)
        listed = (*branch_words(branch.domain), *names) if isinstance(branch, BranchSymbol) else names
        help_ = f"nearest: '{near}'" if near else f"it has {', '.join(listed[:20])}"
        ports = [n for n, s in space.scope.symbols.items() if isinstance(s, PortSymbol)]
        if branch is None and ports and e.name in ("power", "energy", "energy_through"):
            shown = self._excerpt(e.base)
            through = " + ".join(f"energy_through({shown}.{port})" for port in ports[:4])
            help_ = f"what goes in by its ports: {through}; or of an element inside, {shown}.LABEL.energy"
        # an energy or power of what has several ends: of elements inside
        if branch is None and e.name in MEMBERS:
            help_ = self._holders(space, self._excerpt(e.base), e.name)
        if branch is None and ports and e.name in ("e", "f", "q", "p"):  # several ends have one each
            shown, inside = (
                self._excerpt(e.base),
                [n for n, s in space.scope.symbols.items() if isinstance(s, _ELEMENTS)],
            )
            help_ = " or ".join(f"{shown}.{port}.{e.name}" for port in ports[:4])
            help_ += f"; of an element inside, {shown}.{inside[0]}.{e.name}" if inside else ""
        raise self.fail("E102", f"'{self._excerpt(e.base)}' has no member '{e.name}'{level}", e.span, help=help_)

    def _holders(self, space: Space, shown: str, name: str) -> str:
        """The elements of an instance that have the state function `name`, to write."""
        edge, found = MEMBERS[name].edge, []
        for label, symbol in space.scope.symbols.items():
            inner: object = symbol
            if isinstance(symbol, InstanceSymbol) and symbol.spaces:
                inner = symbol.spaces[0].scope.symbols.get("")
            if isinstance(inner, BranchSymbol) and not inner.family.shape:
                law = self.laws.get(inner.family.name)
                found += [f"{shown}.{label}.{name}"] if law is not None and law.kind == edge else []
        what = "dissipator" if edge == "dissipator" else f"{edge} store"
        return f"of the elements inside, {' + '.join(found[:8])}" if found else f"{OF_ELEMENTS}; no {what} is inside"

    # -- constraints ---------------------------------------------------------------------------------------

    def _constraint_member(self, symbol: ConstraintSymbol, base: Located, e: syntax.Member) -> Value:
        """The residual of a constraint, or its multiplier."""
        at = (*symbol.family.prefix, *(self.index(i) for i in base.indices))
        at = tuple(ex.substitute(a, base.change) for a in at)
        constraint, expression = self.constraint(symbol, at, e.span)
        if e.name == "residual":
            return Typed(expression, constraint.unit.dimension)
        if e.name != "multiplier":
            raise self.no_member(symbol.name, e, ("multiplier", "residual", "on(...)"))
        if symbol.kind == "gamma":
            raise self.fail("E102", f"gamma '{symbol.name}' has no multiplier: it closes an implicit unknown", e.span)
        work = dim.ENERGY if symbol.kind == "phi" else dim.POWER
        return Typed(self.multiplier(symbol, at), dim.quotient(work, constraint.unit.dimension))

    def multiplier(self, symbol: ConstraintSymbol, at: tuple[Node, ...]) -> Node:
        """The multiplier of a phi or psi as an unknown."""
        return ex.var(symbol.family.name, "kappa" if symbol.kind == "phi" else "mu", *at)

    def constraint(self, symbol: ConstraintSymbol, at: tuple[Node, ...], span: syntax.Span) -> tuple[Constraint, Node]:
        """The constraint of a label (its element `at`) and left - right there."""
        found = self.constraints.get(symbol.family.name, [])
        if not found:
            raise NotYetError(symbol.name, span)
        if len(found[0].at) != len(at):
            raise self.index_count(symbol.name, len(found[0].at), len(at), span)
        # the statement whose indices fit: rod[i], or rod[1] by itself
        for constraint in found:
            change: dict[Node, Node] = {}
            fits = True
            for own, asked in zip(constraint.at, at, strict=True):
                loop = [n for n in ex.topological([own]) if n.op == "index"]
                if loop:
                    change[loop[0]] = ex.add(asked, ex.sub(loop[0], own))
                else:
                    fits = fits and own is asked
            if fits:
                return constraint, ex.substitute(constraint.expression, change)
        raise self.fail("E805", f"'{symbol.name}' has no element [{', '.join(map(str, at))}]", span)

    def _method(self, e: syntax.MethodCall) -> Value:
        """`label.on(x)`: the effort of a constraint on a coordinate."""
        base = self.locate(e.base)
        if base is None and isinstance(e.base, syntax.Name) and self.scope.is_broken(e.base.name):
            raise Failed  # its statement was told
        symbol = None if base is None else base.symbol
        wrong = not isinstance(symbol, ConstraintSymbol) or symbol.kind == "gamma"
        # a gamma has no multiplier
        if isinstance(symbol, ConstraintSymbol) and symbol.kind == "gamma" and e.name == "on":
            message = f"gamma '{symbol.name}' acts along nothing: it closes an implicit unknown, and has no multiplier"
            help_ = f"phi {symbol.name}: ... where it ties displacements, psi where it ties flows"
            raise self.fail("E102", message, e.span, help=help_)
        # anything but label.on(expr)
        if base is None or wrong or e.name != "on" or len(e.args) != 1:
            help_ = "label.on(expr) of a phi or psi"
            if e.name == "energy_through" and len(e.args) == 1:
                help_ = f"energy_through({self._excerpt(e.base)}.{self._excerpt(e.args[0].value)})"
            raise self.fail("E102", f"there is no '{e.name}(...)' here", e.span, help=help_)
        assert isinstance(symbol, ConstraintSymbol)
        at = (*symbol.family.prefix, *(self.index(i) for i in base.indices))
        at = tuple(ex.substitute(a, base.change) for a in at)
        _, residual = self.constraint(symbol, at, e.span)
        target = self.scalar(e.args[0].value)
        if target.dimension is None or not any(n.op == "var" for n in ex.variables(target.node)):
            help_ = "a coordinate, or an expression of some, that it acts along"
            raise self.fail("E203", "a constant has no displacement", e.args[0].span, help=help_)
        # multiplier times the gradient along the target
        node = reaction(residual, symbol.kind == "phi", target.node, self.multiplier(symbol, at))
        return Typed(node, dim.quotient(dim.ENERGY, target.dimension))


def _root(e: syntax.Expr) -> syntax.Name | None:
    """The name that a path begins with."""
    while isinstance(e, (syntax.Item, syntax.Member, syntax.Prime)):
        e = e.base
    return e if isinstance(e, syntax.Name) else None
