"""What a name can stand for, and the scopes in which names are looked up."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Any

from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Domain, Loop, Shape
from sysdyn.dsl.model.units import Dimension, Unit
from sysdyn.dsl.text.diagnostics import Place, SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

DomainSymbol = Domain


@dataclass(frozen=True, slots=True)
class Typed:
    """A resolved expression: a node and its dimension; None fits every dimension (the numbers 0 and inf)."""

    node: Node
    dimension: Dimension | None
    truth: bool = False


@dataclass(frozen=True, slots=True)
class Vector:
    """A resolved array; first is the index of its first item."""

    items: tuple[Typed, ...]
    first: int = 1


@dataclass(frozen=True, slots=True)
class BundleSymbol:
    """A bundle of nodes: of each member its domain, or the bundle that it is itself."""

    name: str
    members: tuple[tuple[str, DomainSymbol | BundleSymbol], ...]
    place: Place


@dataclass(frozen=True, slots=True)
class ComponentSymbol:
    """A component with the file it stands in; a model is one without ports."""

    name: str
    body: tuple[syntax.Statement, ...]
    file_scope: Scope
    source: SourceText
    place: Place


@dataclass(frozen=True, slots=True)
class TableSymbol:
    """An interpolation table with the dimensions of its arguments and values; key: its name among all files' tables.

    held: of a table of two arguments that holds its values, the tables that take each one to its point of the grid.
    """

    name: str
    key: str
    arguments: tuple[tuple[str, Dimension], ...]
    result: Dimension
    place: Place
    held: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FunctionSymbol:
    """A function, inlined where it is called."""

    definition: syntax.FunctionDefinition
    source: SourceText
    file_scope: Scope
    place: Place

    @property
    def name(self) -> str:
        """The function's name."""
        return self.definition.name.name


@dataclass(frozen=True, slots=True)
class NameFamily:
    """Where a name's values live: the path of its own name, and the indices of the instances around it.

    shape holds the own indices only; `whole` the instances' too.  X[i].cell.q has family X.cell and prefix (i,).
    """

    name: str
    prefix: tuple[Node, ...]
    around: Shape
    shape: Shape

    @property
    def whole(self) -> Shape:
        """First and last of every index."""
        return (*self.around, *self.shape)


@dataclass(frozen=True, slots=True)
class ParameterSymbol:
    """A parameter or an input that holds a constant."""

    name: str
    family: NameFamily
    dimension: Dimension | None
    truth: bool
    place: Place

    @property
    def shape(self) -> Shape:
        """Own indices."""
        return self.family.shape


@dataclass(frozen=True, slots=True)
class UnknownSymbol:
    """A coordinate (kind q), implicit unknown (e) or state (s)."""

    name: str
    kind: str
    family: NameFamily
    dimension: Dimension
    domain: DomainSymbol | None
    complementary: bool
    place: Place

    @property
    def shape(self) -> Shape:
        """Own indices."""
        return self.family.shape


@dataclass(frozen=True, slots=True)
class ConstraintSymbol:
    """The label of a phi, psi or gamma."""

    name: str
    kind: str
    family: NameFamily
    place: Place


@dataclass(frozen=True, slots=True)
class NodeSymbol:
    """A node of a domain; coordinate: the one that is used as such."""

    name: str
    family: NameFamily
    domain: DomainSymbol
    place: Place
    coordinate: UnknownSymbol | None = None


def coordinate_node(symbol: UnknownSymbol) -> NodeSymbol | None:
    """A coordinate of a common-flow domain as the node that it is."""
    if symbol.kind != "q" or symbol.domain is None or symbol.domain.common != "flow":
        return None
    return NodeSymbol(symbol.name, symbol.family, symbol.domain, symbol.place, symbol)


@dataclass(frozen=True, slots=True)
class BundleNode:
    """Several nodes (or ports) handled as one."""

    name: str
    members: dict[str, NodeSymbol | PortSymbol | BundleNode]
    place: Place


@dataclass(frozen=True, slots=True)
class End:
    """A node's element, or the domain's ground (node None)."""

    node: NodeSymbol | None
    at: tuple[Node, ...]  # all indices, those of instances first
    domain: DomainSymbol


@dataclass(frozen=True, slots=True)
class PortSymbol:
    """A component's port, bound to a node of its user."""

    name: str
    end: End
    place: Place


@dataclass(frozen=True, slots=True)
class BranchSymbol:
    """A branch: effort e, flow f, displacement q, momentum p between two ends or along an expression."""

    name: str
    family: NameFamily
    domain: DomainSymbol
    place: Place


@dataclass(frozen=True, slots=True)
class TwoPortSymbol:
    """A transformer or gyrator: its branches carry e1 f1 and e2 f2."""

    name: str
    branches: tuple[BranchSymbol, BranchSymbol]
    place: Place


@dataclass(eq=False, slots=True)
class Space:
    """The inside of a model or of one instance: its scope, its text, the loops of its label."""

    path: str
    scope: Scope
    file_scope: Scope
    source: SourceText
    loops: tuple[Loop, ...] = ()
    prefix: tuple[Node, ...] = ()
    around: Shape = ()
    own: int = 0  # how many of these indices its label has; the others are of the instances around
    component: str = ""
    chain: tuple[str, ...] = ()  # components around, for the check against recursion
    level: str | None = None
    elsewhere: Mapping[str, str] = field(default_factory=dict)  # what other levels declare, and one of these levels
    bound: dict[str, Typed] = field(default_factory=dict)  # e f q p of the component's single branch
    ends: dict[str, Any] = field(default_factory=dict)  # of its branches (instances.Ends)
    laws: dict[str, Place] = field(default_factory=dict)  # branches that have a law

    def family(self, name: str, shape: Shape = ()) -> NameFamily:
        """The family of a name declared inside."""
        return NameFamily(f"{self.path}.{name}" if self.path else name, self.prefix, self.around, shape)


@dataclass(eq=False, slots=True)
class InstanceSymbol:
    """Instances under one label: one space a statement; `fits` says which of them has an index."""

    name: str
    place: Place
    spaces: list[Space] = field(default_factory=list)


@dataclass(frozen=True, slots=True, eq=False)
class Definition:
    """A let, output, quasi, input or const: an expression that is inlined.

    at: loop variables of a family; implied: they are those of the loop around, not written where it is used.
    """

    name: str
    kind: str
    expression: syntax.Expr
    at: tuple[str, ...]
    dimension: Dimension | None  # declared (inputs, quasi-velocities)
    space: Space  # where the expression is read
    place: Place
    span: syntax.Span
    implied: bool = False
    bound: tuple[tuple[str, Typed | Vector], ...] = ()  # loop variables in sight where it is read
    loops: tuple[Loop, ...] = ()  # of these, with those of the space
    shape: Shape = ()  # of an input that is an array
    beside: Node | None = None  # added to an input: a parameter that an analysis moves


@dataclass(frozen=True, slots=True)
class Unsupported:
    """A name whose meaning is built by a later issue (discrete variables)."""

    name: str
    what: str
    place: Place


Symbol = (
    DomainSymbol
    | BundleSymbol
    | ComponentSymbol
    | TableSymbol
    | FunctionSymbol
    | ParameterSymbol
    | UnknownSymbol
    | ConstraintSymbol
    | NodeSymbol
    | BundleNode
    | PortSymbol
    | BranchSymbol
    | TwoPortSymbol
    | InstanceSymbol
    | Definition
    | Unsupported
)


@dataclass(slots=True)
class Scope:
    """Names of one level (prelude, file, model); a name not found is looked up in the outer level."""

    outer: Scope | None = None
    symbols: dict[str, Symbol] = field(default_factory=dict)
    units: dict[str, Unit] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    missed: bool = False
    """Whether a name of a statement that could not be read was asked for."""
    read: dict[tuple[str, int], Unit] | None = None
    """Units that were read here, by their text and the number of those declared then."""
    announced: dict[str, list[Callable[[], None]]] = field(default_factory=dict)
    """What enters an element of this level that is written further below, by its name."""

    def find(self, name: str) -> Symbol | None:
        """The symbol of that name, nearest level first."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.announced and name not in scope.symbols:
                for enter in scope.announced.pop(name):
                    enter()
            if name in scope.symbols:
                return scope.symbols[name]
            scope = scope.outer
        return None

    def component(self, name: str) -> ComponentSymbol | Unsupported | None:
        """The component of that name: nodes, labels and values of the name do not hide it."""
        scope: Scope | None = self
        while scope is not None:
            symbol = scope.symbols.get(name)
            if isinstance(symbol, ComponentSymbol | Unsupported):
                return symbol
            scope = scope.outer
        return None

    def unit(self, name: str) -> Unit | None:
        """A unit declared in a file."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.units:
                return scope.units[name]
            scope = scope.outer
        return None

    @property
    def declaring(self) -> Scope:
        """The nearest scope that declares units of its own, or the outermost: units mean the same in all up to it."""
        scope = self
        while not scope.units and scope.outer is not None:
            scope = scope.outer
        return scope

    def miss(self) -> None:
        """A part of the text could not be read, which has been said."""
        scope: Scope | None = self
        while scope is not None:
            scope.missed, scope = True, scope.outer

    def is_broken(self, name: str) -> bool:
        """Whether the name stands in a statement that could not be read."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.broken or syntax.ANY in scope.broken:
                scope.missed = True
                return True
            scope = scope.outer
        return False

    def names(self) -> Iterable[str]:
        """All names in sight."""
        scope: Scope | None = self
        while scope is not None:
            yield from scope.symbols
            scope = scope.outer


def nearest(name: str, names: Iterable[str]) -> str | None:
    """The most similar name, if one is similar at all."""
    among = list(dict.fromkeys(n for n in names if len(n) < 100))
    alike = [n for n in among if n != name and n.lower() == name.lower()]
    if not alike:
        from difflib import get_close_matches  # of mistakes alone

        alike = get_close_matches(name[:80], among, 1, 0.6)
        if alike and (numbered := _mask_digits(name)) != name:
            alike = [n for n in among if n != name and _mask_digits(n) == numbered] or alike
    return alike[0] if alike else None


def _mask_digits(name: str) -> str:
    """A name with one sign for each number in it: C1 is nearer to C2 than C is."""
    return re.sub(r"[0-9]+", "#", name)
