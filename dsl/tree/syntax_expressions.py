"""Expressions, units and the small parts that statements are made of."""

from __future__ import annotations

from fractions import Fraction

from sysdyn.dsl.text.source import Span
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Number:
    """A bare number; `text` as written."""

    value: float
    text: str
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class QuantityLiteral:
    """A number with its unit; `text` is the number as written."""

    value: float
    text: str
    unit: UnitExpression
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Text:
    """A string; `value` without its quotes."""

    value: str
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Bool:
    """`true` or `false`."""

    value: bool
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Name:
    """A name by itself."""

    name: str
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Member:
    """`base.name`; the name's own span is the last `len(name)` code points."""

    base: Expr
    name: str
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Item:
    """`base[index, ...]`."""

    base: Expr
    indices: tuple[Index, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Prime:
    """`base'`, the time derivative."""

    base: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class FunctionCall:
    """`name(arg, ...)`; the name's span is the first `len(name)` code points."""

    name: str
    args: tuple[Arg, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class MethodCall:
    """`base.name(arg, ...)`."""

    base: Expr
    name: str
    args: tuple[Arg, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """`op(index in lower..upper: body)`, op being `sum`, `prod`, `min` or `max`."""

    op: str
    index: Word
    lower: Expr
    upper: Expr
    body: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Sum:
    """Terms with their sign `+` or `-`, left to right; the first sign is `+`."""

    terms: tuple[tuple[str, Expr], ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Product:
    """Factors with their operator `*` or `/`, left to right; the first operator is `*`."""

    factors: tuple[tuple[str, Expr], ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Negative:
    """`-operand`."""

    operand: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Power:
    """`base^exponent`."""

    base: Expr
    exponent: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Compare:
    """`left op right` with one of `== != < <= > >=`."""

    op: str
    left: Expr
    right: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class And:
    """`a and b and ...`."""

    operands: tuple[Expr, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Or:
    """`a or b or ...`."""

    operands: tuple[Expr, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Not:
    """`not operand`."""

    operand: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Conditional:
    """`if test then then else other`."""

    test: Expr
    then: Expr
    other: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Array:
    """`[item, ...]`."""

    items: tuple[Expr, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Parenthesized:
    """`(expr)`: the author's parentheses."""

    expr: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Range:
    """`lower..upper` as an index, both ends included."""

    lower: Expr
    upper: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Arg:
    """An argument, named or positional."""

    name: str | None
    value: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Word:
    """A declared or quoted name with its place."""

    name: str
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Dotted:
    """`std.electrical`, `dc_motor.rl`: names joined by dots."""

    names: tuple[str, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Decl:
    """A declared name with its index ranges; `x[3]` stands for `x[1..3]`."""

    name: str
    indices: tuple[Index, ...]
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class UnitFactor:
    """One factor of a unit; op `.` or `/` (the first is `.`); `$u` is a unit variable, `1` is one."""

    name: str
    exponent: int | Fraction
    op: str
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class UnitExpression:
    """A unit as written."""

    factors: tuple[UnitFactor, ...]
    text: str
    span: Span


Expr = (
    Number
    | QuantityLiteral
    | Text
    | Bool
    | Name
    | Member
    | Item
    | Prime
    | FunctionCall
    | MethodCall
    | Reduction
    | Sum
    | Product
    | Negative
    | Power
    | Compare
    | And
    | Or
    | Not
    | Conditional
    | Array
    | Parenthesized
)
Index = Expr | Range
