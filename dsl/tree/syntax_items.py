"""Items of a file: imports, domains, units, functions, tables, components, models, scenes."""

from __future__ import annotations

from typing import Literal

from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree.syntax_expressions import Dotted, Expr, Number, UnitExpression, Word
from sysdyn.dsl.tree.syntax_scenes import SceneStatement
from sysdyn.dsl.tree.syntax_statements import BrokenStatement, Statement
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class FormalParameter:
    """An argument in the head of a function or table."""

    name: str
    size: Expr | None
    unit: UnitExpression
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class TableRow:
    """One row of a table; signs are part of the numbers."""

    numbers: tuple[Number, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class DomainRole:
    """`effort force: N`."""

    kind: Literal["effort", "flow", "momentum", "displacement"]
    name: Word
    unit: UnitExpression
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class DomainNode:
    """`node common effort`."""

    common: Literal["effort", "flow"]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class DomainGround:
    """`ground "what the reference is"`."""

    text: str
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class DomainPseudo:
    """`pseudo: W.K`: the unit of effort times flow."""

    unit: UnitExpression
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class BundleMember:
    """`x, y: translation`."""

    names: tuple[Word, ...]
    domain: Word
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Import:
    """`from std.x import a, b`."""

    module: Dotted
    names: tuple[Word, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class DomainDefinition:
    """`domain D { ... }`."""

    name: Word
    body: tuple[DomainPart, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class BundleDefinition:
    """`bundle planar { x, y: translation }`."""

    name: Word
    members: tuple[BundleMember | BrokenStatement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class UnitAlias:
    """`unit rpm2 = 2*pi/(60 s)`."""

    name: Word
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class UnitBase:
    """`unit EUR base`."""

    name: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ConstDefinition:
    """`const g0 = 9.81 m/s^2`."""

    name: Word
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FunctionDefinition:
    """`fn f(x: m) -> H = expr`."""

    name: Word
    params: tuple[FormalParameter, ...]
    result: UnitExpression
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class TableDefinition:
    """`table f(x: mm) -> mH pchip clamp [ ... ]` or `file "f.csv"` (then rows is None)."""

    name: Word
    params: tuple[FormalParameter, ...]
    result: UnitExpression
    interpolation: str
    extrapolation: str | None
    rows: tuple[TableRow, ...] | None
    file: str | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ComponentDefinition:
    """`component N { ... }`."""

    name: Word
    body: tuple[Statement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ModelDefinition:
    """`model N { ... }`."""

    name: Word
    body: tuple[Statement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SceneDefinition:
    """`scene N of M { ... }`."""

    name: Word
    model: Dotted
    body: tuple[SceneStatement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Comment:
    """A comment with its `#`; `own_line` where nothing else stands before it on its line."""

    text: str
    span: Span
    own_line: bool


@dataclass(frozen=True, slots=True, eq=False)
class File:
    """The root of one text: its items in the order of the author, and its comments."""

    source: SourceText
    items: tuple[TopLevel, ...]
    comments: tuple[Comment, ...]
    span: Span


DomainPart = DomainRole | DomainNode | DomainGround | DomainPseudo | BrokenStatement
TopLevel = (
    Import
    | DomainDefinition
    | BundleDefinition
    | UnitAlias
    | UnitBase
    | ConstDefinition
    | FunctionDefinition
    | TableDefinition
    | ComponentDefinition
    | ModelDefinition
    | SceneDefinition
    | BrokenStatement
)
