"""Statements of components and models."""

from __future__ import annotations

from typing import Literal

from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree.syntax_expressions import Arg, Decl, Dotted, Expr, UnitExpression, Word
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class InitialValue:
    """`= value` or `~ value`."""

    kind: Literal["fixed", "guess"]
    value: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Guard:
    """`while expr` or `restitution expr` of a constraint."""

    kind: Literal["while", "restitution"]
    expr: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Across:
    """Connection `plus -> minus`."""

    plus: Expr
    minus: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class On:
    """Connection `on expr`."""

    expr: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Bind:
    """Connection `name = value`."""

    name: Word
    value: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class BindAcross:
    """Connection `name = plus -> minus`."""

    name: Word
    plus: Expr
    minus: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Single:
    """Connection `node`, short for `node -> ground`."""

    node: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class ActionStatement:
    """`target := value`."""

    target: Expr
    value: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class ParamStatement:
    """`param k: N/m`, `param k = 3 N/m`."""

    decl: Decl
    unit: UnitExpression | None
    value: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class NodeStatement:
    """`node a, b: electrical [= v]`."""

    decls: tuple[Decl, ...]
    domain: Word
    init: InitialValue | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PortStatement:
    """`port a: electrical`."""

    decls: tuple[Decl, ...]
    domain: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class BranchStatement:
    """`branch [b]: D`; without a name decls is empty."""

    decls: tuple[Decl, ...]
    domain: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class InputStatement:
    """`input u: V [= expr]`."""

    decl: Decl
    unit: UnitExpression
    value: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class OutputStatement:
    """`output y = expr`."""

    decl: Decl
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class QuasiStatement:
    """`quasi w: rad/s = expr`, a quasi-velocity: linear in flows, its coefficients of displacements."""

    decl: Decl
    unit: UnitExpression
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class CoordStatement:
    """`coord q: D [tangible|intangible] [= v]`; tangible is None where nothing is asserted."""

    kind: Literal["coord", "cocoord"]
    decls: tuple[Decl, ...]
    domain: Word
    tangible: bool | None
    init: InitialValue | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ImplicitStatement:
    """`implicit e: V [~ guess]`."""

    decls: tuple[Decl, ...]
    unit: UnitExpression
    init: InitialValue | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class StateStatement:
    """`state s: u = v`."""

    decl: Decl
    unit: UnitExpression | None
    value: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class DiscreteStatement:
    """`discrete g = 1`."""

    decl: Decl
    unit: UnitExpression | None
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class DynamicStatement:
    """`dynamic s' = expr`."""

    target: Expr
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LetStatement:
    """`let x = expr`."""

    decl: Decl
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LawStatement:
    """`law e = R*f`."""

    left: Expr
    right: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class EnergyStatement:
    """`energy T* [name] = expr`."""

    function: Literal["T*", "T", "V*", "V"]
    name: Word | None
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ContentStatement:
    """`content D [name] = expr`."""

    function: Literal["D", "G"]
    name: Word | None
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class WorkStatement:
    """`work effort on expr`."""

    effort: Expr
    on: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintStatement:
    """`phi n: left = right [while g] [restitution r]`."""

    kind: Literal["phi", "psi", "gamma"]
    decl: Decl
    left: Expr
    relation: Literal["=", ">=", "<="]
    right: Expr
    guards: tuple[Guard, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class InitStatement:
    """`init ref = v`, `init ref ~ v`; also in scenes."""

    target: Expr
    initial: InitialValue
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class WhenStatement:
    """`when c { a := b }`; also in scenes."""

    condition: Expr
    actions: tuple[ActionStatement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class EveryStatement:
    """`every 5 ms { a := b }`."""

    period: Expr
    actions: tuple[ActionStatement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ForStatement:
    """`for i in lower..upper { ... }`."""

    index: Word
    lower: Expr
    upper: Expr
    body: tuple[Statement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LevelStatement:
    """`level n [extends m] [default] { ... }`."""

    name: Word
    extends: Word | None
    default: bool
    body: tuple[Statement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class RequireStatement:
    """`require expr`."""

    condition: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ExpectStatement:
    """`expect [moment:] left op right [within d]`; `at` is the time of moment `at`."""

    moment: Literal["always", "finally", "static", "at"] | None
    at: Expr | None
    left: Expr
    op: str
    right: Expr
    within: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class GoldenStatement:
    """`expect golden "file" within r`."""

    file: str
    within: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LosslessStatement:
    """`lossless`."""

    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class InstanceStatement:
    """`label: comp.level(p = v) a -> b`; args is None where no parentheses are written."""

    decl: Decl
    component: Dotted
    args: tuple[Arg, ...] | None
    connections: tuple[Connection, ...]
    span: Span
    doc: str | None = None


ANY = "*"
"""Stands for every name."""


@dataclass(frozen=True, slots=True, eq=False)
class BrokenStatement:
    """A statement that could not be read; `names` are the names in it, so that later stages can spare
    the author errors that only follow from this one: all names, where ANY is among them.
    """

    names: frozenset[str]
    span: Span


Connection = Across | On | Bind | BindAcross | Single
Statement = (
    ParamStatement
    | NodeStatement
    | PortStatement
    | BranchStatement
    | InputStatement
    | OutputStatement
    | QuasiStatement
    | CoordStatement
    | ImplicitStatement
    | StateStatement
    | DiscreteStatement
    | DynamicStatement
    | LetStatement
    | LawStatement
    | EnergyStatement
    | ContentStatement
    | WorkStatement
    | ConstraintStatement
    | InitStatement
    | WhenStatement
    | EveryStatement
    | ForStatement
    | LevelStatement
    | RequireStatement
    | ExpectStatement
    | GoldenStatement
    | LosslessStatement
    | InstanceStatement
    | BrokenStatement
)
