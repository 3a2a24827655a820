"""Instances that differ in numbers and nodes alone: elaborated once, then cast with other names in it.

A netlist repeats a component of one branch tens of thousands of times.  The first instance with the same parameters
given takes the whole way (instances.py) and leaves a *mould*: units of its parameters, values of those that it does not
give, its law, what it requires.  Another is cast where nothing can be wrong with it: quantities in units that have been
found to fit, between two nodes of the domain that stand alone.  All others take the whole way, and so do laws that
made a finding or read more than the instance's own names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING

from sysdyn.dsl.elaborate.instances.casts import Cast, cast_of
from sysdyn.dsl.elaborate.instances.connections import Ends
from sysdyn.dsl.elaborate.instances.head import Body
from sysdyn.dsl.elaborate.parts import CastRequirement
from sysdyn.dsl.model import budget
from sysdyn.dsl.model.network import Parameter
from sysdyn.dsl.model.units import Unit
from sysdyn.dsl.names.laws import LawOf, own_variables
from sysdyn.dsl.names.symbols import (
    BranchSymbol,
    ComponentSymbol,
    DomainSymbol,
    End,
    InstanceSymbol,
    NameFamily,
    NodeSymbol,
    ParameterSymbol,
    Scope,
    Space,
    Symbol,
    Typed,
)
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

if TYPE_CHECKING:
    from sysdyn.dsl.elaborate.elaborate import Elaborator
    from sysdyn.dsl.elaborate.instances.instances import Instances

_NOWHERE: Mapping[str, str] = {}
_NOTHING: dict[str, Typed] = {}
_KINDS = {syntax.ParamStatement, syntax.BranchStatement, syntax.LawStatement, syntax.RequireStatement}


@dataclass(frozen=True, slots=True)
class MouldParameter:
    """A parameter: its unit and its place; value: where the instance does not give it."""

    name: str
    unit: Unit
    place: Place
    value: Cast | None


@dataclass(slots=True)
class Mould:
    """What the instances of a body have in common that give the same parameters."""

    domain: DomainSymbol
    parameters: tuple[MouldParameter, ...]
    law: syntax.LawStatement
    fitting: set[tuple[str, str]] = field(default_factory=set)
    """Parameters with texts of units that fit."""
    branch: tuple[str, str, Cast, Place] | None = None
    """Kind, side and law of the branch, and where the law stands, once they are known."""
    required: tuple[tuple[Cast, Place, syntax.Expr], ...] | None = None


class Likeness(Space):
    """The inside of an instance that was cast: its names are entered when somebody looks for one."""

    __slots__ = ("_scope", "label", "mould")

    def __init__(
        self, outer: Space, component: ComponentSymbol, path: str, label: Place, mould: Mould, ends: Ends
    ) -> None:
        """label: where its name stands."""
        self.label, self.mould = label, mould
        self._scope: Scope | None = None
        file = component.file_scope
        super().__init__(
            path=path,
            scope=file,
            file_scope=file,
            source=component.source,
            component=component.name,
            chain=(*outer.chain, outer.component),
            elsewhere=_NOWHERE,
            bound=_NOTHING,
            ends={"": ends},
        )

    @property
    def scope(self) -> Scope:
        """The names of its branch and of its parameters."""
        if self._scope is None:
            branch = BranchSymbol(self.path.rpartition(".")[2], self._family(""), self.mould.domain, self.label)
            symbols: dict[str, Symbol] = {"": branch}
            for held in self.mould.parameters:
                family = self._family(f".{held.name}")
                symbols[held.name] = ParameterSymbol(held.name, family, held.unit.dimension, False, held.place)
            self._scope = Scope(self.file_scope, symbols)
        return self._scope

    @scope.setter
    def scope(self, _: Scope) -> None:
        """It follows from the mould."""

    def _family(self, name: str) -> NameFamily:
        return NameFamily(self.path + name, (), (), ())

    @property
    def bound(self) -> dict[str, Typed]:
        """The variables e f q p of its branch."""
        branch = self.scope.symbols[""]
        assert isinstance(branch, BranchSymbol)
        return own_variables(branch, ())

    @bound.setter
    def bound(self, _: dict[str, Typed]) -> None:
        """It follows from the branch."""


class Moulds:
    """Those of one model."""

    def __init__(self) -> None:
        self._bodies: dict[int, tuple[ComponentSymbol, Body | None]] = {}  # by component
        self._moulds: dict[tuple[int, ...], Mould] = {}

    def body(self, it: Instances, component: ComponentSymbol, s: syntax.InstanceStatement) -> Body | None:
        """The body of a component of which this instance may be cast."""
        if s.decl.indices or len(s.component.names) != 1 or it.levels:
            return None
        if id(component) not in self._bodies:
            levels = any(isinstance(b, syntax.LevelStatement) for b in component.body)
            body = None if levels else it.inside_of(component, None, component.body)
            self._bodies[id(component)] = component, body if body is not None and _plain(body) else None
        return self._bodies[id(component)][1]

    @staticmethod
    def _key(s: syntax.InstanceStatement, body: Body, scope: Scope) -> tuple[int, ...]:
        """Instances of one mould: of one body, with the same parameters given, where units mean the same."""
        return id(body), id(scope.declaring), *(id(body.head.parameters.get(a.name or "")) for a in s.args or ())

    def keep(self, it: Instances, symbol: InstanceSymbol, s: syntax.InstanceStatement, body: Body, here: Space) -> None:
        """What an instance that has taken the whole way without a finding leaves for others."""
        given = {a.name or "": a.value for a in s.args or ()}
        if (
            len(symbol.spaces) != 1
            or here.prefix
            or not all(isinstance(v, syntax.QuantityLiteral) for v in given.values())
        ):
            return
        space, key = symbol.spaces[0], self._key(s, body, here.scope)
        if key not in self._moulds:
            held = [_cast_parameter(it, space, name, given=name in given) for name in body.head.parameters]
            branch, (law, _) = space.scope.symbols[""], body.statements_of(syntax.LawStatement)[0]
            assert isinstance(branch, BranchSymbol)
            assert isinstance(law, syntax.LawStatement)
            if None in held:
                return
            self._moulds[key] = Mould(branch.domain, tuple(h for h in held if h is not None), law)
        self._moulds[key].fitting |= {
            (n, v.unit.text) for n, v in given.items() if isinstance(v, syntax.QuantityLiteral)
        }

    def cast(
        self, it: Instances, symbol: InstanceSymbol, s: syntax.InstanceStatement, component: ComponentSymbol, body: Body
    ) -> bool:
        """Cast an instance where it stands, if there is a mould and nothing can be wrong with it."""
        here, given = it.context.current, {a.name or "": a.value for a in s.args or ()}
        mould = self._moulds.get(self._key(s, body, here.scope))
        # no mould of this shape; an array; loops around; coordinates, which a cast cannot read
        if mould is None or symbol.spaces or here.prefix or not it.resolver.free or it.context.parts.coordinates:
            return False
        # casts have one branch, and none contains itself
        if len(s.connections) != 1 or component.name in (*here.chain, here.component):
            return False
        # each argument is a quantity in a unit that fitted before: nothing can be wrong with it
        for name, value in given.items():
            if not isinstance(value, syntax.QuantityLiteral) or (name, value.unit.text) not in mould.fitting:
                return False
        ends = _between(it.context.scope, s.connections[0], mould.domain)
        if ends is None or len(given) != len(s.args or ()):
            return False
        charge(it, s, component)
        values = {name: it.resolver.scalar(value).node for name, value in given.items()}
        path = f"{here.path}.{s.decl.name}" if here.path else s.decl.name
        space = Likeness(here, component, path, it.context.place(s.decl.span), mould, ends)
        # the value that the instance gives, or the formula of the component in its names
        for held in mould.parameters:
            name = f"{path}.{held.name}"
            node = values[held.name] if held.value is None else held.value.under(path)
            it.context.parts.parameters[name] = Parameter(name, (), held.unit, (node,), (), held.place)
        symbol.spaces.append(space)
        it.bodies.append((space, body))
        return True


def charge(it: Instances, s: syntax.InstanceStatement, component: ComponentSymbol) -> None:
    """An instance counts, whichever way it takes."""
    try:
        budget.check_depth(len(it.context.current.chain), "components are")
        budget.unfold(budget.INSTANCE, f"instances of component '{component.name}'")
    except budget.SpentError as spent:
        spent.place = spent.place or it.context.place(s.span)
        raise


def _cast_parameter(it: Instances, space: Space, name: str, *, given: bool) -> MouldParameter | None:
    """A parameter as an instance has it; None where another may have it otherwise."""
    parameter, symbol = it.context.parts.parameters.get(f"{space.path}.{name}"), space.scope.symbols.get(name)
    if parameter is None or not isinstance(symbol, ParameterSymbol) or symbol.truth:
        return None
    value = None if given else cast_of(parameter.values[0], space.path)
    if value is None and not given:
        return None
    return MouldParameter(name, parameter.unit, parameter.place, value)


def law_of_cast(it: Elaborator, space: Likeness) -> None:
    """The law of an instance that was cast; that of the first takes the whole way, and all if it reads more."""
    mould, path = space.mould, space.path
    if mould.branch is not None:
        kind, side, law, place = mould.branch
        node, ends = law.under(path), space.ends[""]
        space.laws[""], it.resolver.laws[path] = place, LawOf(kind, side, node)
        it.parts.branches.append(it.element_builder.branch(path, mould.domain, (), (), (kind, side, node), ends, place))
        return
    before, waiting = _learnt(it), len(it.element_builder.pending)
    with it.context.entering(space):
        it.context.each([(mould.law, ())], it.element_builder.law)
        if len(it.element_builder.pending) > waiting:
            it.settle_law(it.element_builder.pending.pop())
    branch = it.parts.branches[-1] if it.parts.branches else None
    if before == _learnt(it) and branch is not None and branch.name == path and branch.law is not None:
        found = cast_of(branch.law, path)
        if found is not None and branch.side is not None:
            mould.branch = branch.kind, branch.side, found, branch.place


def required_of(it: Elaborator, space: Likeness, body: Body) -> None:
    """What an instance that was cast requires."""
    mould = space.mould
    if mould.required is not None:
        for node, place, written in mould.required:
            it.parts.requirements.append(CastRequirement(node, space.path, place, written))
        return
    before, first, said = _learnt(it), len(it.parts.requirements), body.statements_of(syntax.RequireStatement)
    with it.context.entering(space):
        it.context.each(said, it.equations.require)
    own = it.parts.requirements[first:]
    casts = [(cast_of(r.condition, space.path), r.place, r.written) for r in own]
    sound = tuple((node, place, written) for node, place, written in casts if node is not None)
    if before == _learnt(it) and len(sound) == len(said):
        mould.required = sound


def _learnt(it: Elaborator) -> tuple[int, ...]:
    """How much has been found beside what a statement becomes."""
    beside = it.resolver.uses, it.resolver.whole, it.resolver.quadratures, it.parts.drafts, it.parts.watched
    return len(it.context.report), it.context.waiting, len(it.resolver.derived), *map(len, beside)


def _plain(body: Body) -> bool:
    """Whether all that a component says is parameters, one branch with one law, and what it requires."""
    said = [s for s, loops in body if not loops]
    if len(said) < len(body.statements) or not {type(s) for s in said} <= _KINDS or body.head.generic:
        return False
    branches = [s for s in said if isinstance(s, syntax.BranchStatement)]
    laws = [s for s in said if isinstance(s, syntax.LawStatement)]
    arrays = any(s.decl.indices for s in said if isinstance(s, syntax.ParamStatement))
    own = len(laws) == 1 and isinstance(laws[0].left, syntax.Name)
    return own and not arrays and len(branches) == 1 and not branches[0].decls


def _between(scope: Scope, connection: syntax.Connection, domain: DomainSymbol) -> Ends | None:
    """The ends of a branch between two nodes of a domain that stand alone, or one and ground; None: anything else."""
    # `a -> b`
    if isinstance(connection, syntax.Across):
        said: Sequence[syntax.Expr | None] = (connection.plus, connection.minus)
    # `a`: to ground
    elif isinstance(connection, syntax.Single):
        said = (connection.node, None)
    else:
        return None
    found = []
    for e in said:
        if e is None or (isinstance(e, syntax.Name) and e.name == "ground"):
            found.append(End(None, (), domain))
            continue
        # nodes of arrays, of other domains and undeclared ones go the long way, which reports what is wrong
        node = scope.find(e.name) if isinstance(e, syntax.Name) else None
        if not isinstance(node, NodeSymbol) or node.domain is not domain or node.family.shape or node.family.prefix:
            return None
        found.append(End(node, (), domain))
    plus, minus = found
    return None if plus.node is minus.node else Ends(plus, minus, None, domain)
