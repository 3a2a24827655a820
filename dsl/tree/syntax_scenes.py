"""Statements of scenes."""

from __future__ import annotations

from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree.syntax_expressions import Arg, Expr, UnitExpression, Word
from sysdyn.dsl.tree.syntax_statements import (
    BrokenStatement,
    ExpectStatement,
    GoldenStatement,
    InitStatement,
    WhenStatement,
)
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class TraceItem:
    """`expr [in unit] [as alias]`."""

    expr: Expr
    unit: UnitExpression | None
    alias: Word | None
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class TimeStatement:
    """`time a to b`."""

    start: Expr
    stop: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SetStatement:
    """`set ref = expr`."""

    target: Expr
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SceneLevelStatement:
    """`level ref = name`."""

    target: Expr
    level: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class TraceStatement:
    """`trace expr, ... [every dt]`."""

    items: tuple[TraceItem, ...]
    every: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class AccuracyStatement:
    """`accuracy r [on a, b [relative to range]]`."""

    value: Expr
    on: tuple[Expr, ...]
    to_range: bool
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FormulationStatement:
    """`formulation lagrangian`."""

    name: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class SolverStatement:
    """`solver bdf(order = 5)`."""

    name: Word
    args: tuple[Arg, ...] | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class RedundancyStatement:
    """`redundancy drop`."""

    name: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LimitStatement:
    """`limit steps n`."""

    name: Word
    value: Expr
    span: Span
    doc: str | None = None


SceneStatement = (
    TimeStatement
    | SetStatement
    | SceneLevelStatement
    | TraceStatement
    | AccuracyStatement
    | FormulationStatement
    | SolverStatement
    | RedundancyStatement
    | LimitStatement
    | InitStatement
    | WhenStatement
    | ExpectStatement
    | GoldenStatement
    | BrokenStatement
)
