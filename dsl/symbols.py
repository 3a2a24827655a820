"""What a name can stand for, and the scopes in which names are looked up."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, field

from sysdyn.dsl import syntax
from sysdyn.dsl.diagnostics import Place, SourceText
from sysdyn.dsl.expression import Node
from sysdyn.dsl.network import Shape
from sysdyn.dsl.units import Dimension, Unit


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
class DomainSymbol:
    """A domain: the units of its four variables and what its nodes have in common."""

    name: str
    effort: Unit
    flow: Unit
    momentum: Unit
    displacement: Unit
    common: str
    pseudo: bool
    place: Place


@dataclass(frozen=True, slots=True)
class BundleSymbol:
    """A bundle of nodes."""

    name: str
    place: Place


@dataclass(frozen=True, slots=True)
class ComponentSymbol:
    """A component: parsed, lowered by a later issue."""

    name: str
    place: Place


@dataclass(frozen=True, slots=True)
class TableSymbol:
    """An interpolation table with the dimensions of its arguments and values."""

    name: str
    arguments: tuple[tuple[str, Dimension], ...]
    result: Dimension
    place: Place


@dataclass(frozen=True, slots=True)
class FunctionSymbol:
    """A function, inlined where it is called."""

    definition: syntax.Function
    source: SourceText
    place: Place

    @property
    def name(self) -> str:
        """The function's name."""
        return self.definition.name.name


@dataclass(frozen=True, slots=True)
class ParameterSymbol:
    """A parameter or an input that holds a constant."""

    name: str
    shape: Shape
    dimension: Dimension | None
    truth: bool
    place: Place


@dataclass(frozen=True, slots=True)
class UnknownSymbol:
    """A coordinate (kind q), implicit unknown (e) or state (s)."""

    name: str
    kind: str
    shape: Shape
    dimension: Dimension
    domain: DomainSymbol | None
    complementary: bool
    place: Place


@dataclass(frozen=True, slots=True)
class ConstraintSymbol:
    """The label of a phi, psi or gamma."""

    name: str
    kind: str
    place: Place


@dataclass(frozen=True, slots=True, eq=False)
class Definition:
    """A let, output, input or const: an expression that is inlined.

    at: loop variables of a family; implied: they are those of the loop around, not written where it is used.
    """

    name: str
    kind: str
    expression: syntax.Expr
    at: tuple[str, ...]
    dimension: Dimension | None  # declared (inputs)
    source: SourceText
    place: Place
    span: syntax.Span
    implied: bool = False


@dataclass(frozen=True, slots=True)
class Unsupported:
    """A name whose meaning is built by a later issue (nodes, instances, discrete variables)."""

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

    def find(self, name: str) -> Symbol | None:
        """The symbol of that name, nearest level first."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.symbols:
                return scope.symbols[name]
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

    def is_broken(self, name: str) -> bool:
        """Whether the name stands in a statement that could not be read."""
        scope: Scope | None = self
        while scope is not None:
            if name in scope.broken:
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
    found = difflib.get_close_matches(name[:80], list(dict.fromkeys(n for n in names if len(n) < 100)), 1, 0.6)
    return found[0] if found else None
