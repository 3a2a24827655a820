"""Statements of scenes."""

from __future__ import annotations

from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree.syntax_expressions import Arg, Expr, Unit, Word
from sysdyn.dsl.tree.syntax_statements import Broken, Expect, Golden, Init, When
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class TraceItem:
    """`expr [in unit] [as alias]`."""

    expr: Expr
    unit: Unit | None
    alias: Word | None
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Time:
    """`time a to b`."""

    start: Expr
    stop: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Set:
    """`set ref = expr`."""

    target: Expr
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SceneLevel:
    """`level ref = name`."""

    target: Expr
    level: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """`trace expr, ... [every dt]`."""

    items: tuple[TraceItem, ...]
    every: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Accuracy:
    """`accuracy r [on a, b [relative to range]]`."""

    value: Expr
    on: tuple[Expr, ...]
    to_range: bool
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Formulation:
    """`formulation lagrangian`."""

    name: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Solver:
    """`solver bdf(order = 5)`."""

    name: Word
    args: tuple[Arg, ...] | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Redundancy:
    """`redundancy drop`."""

    name: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """`limit steps n`."""

    name: Word
    value: Expr
    span: Span
    doc: str | None = None


SceneStatement = (
    Time
    | Set
    | SceneLevel
    | Trace
    | Accuracy
    | Formulation
    | Solver
    | Redundancy
    | Limit
    | Init
    | When
    | Expect
    | Golden
    | Broken
)
