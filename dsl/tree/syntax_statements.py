"""Statements of components and models."""

from __future__ import annotations

from typing import Literal

from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree.syntax_expressions import Arg, Decl, Dotted, Expr, Unit, Word
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Initial:
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
class Action:
    """`target := value`."""

    target: Expr
    value: Expr
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Param:
    """`param k: N/m`, `param k = 3 N/m`."""

    decl: Decl
    unit: Unit | None
    value: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """`node a, b: electrical [= v]`."""

    decls: tuple[Decl, ...]
    domain: Word
    init: Initial | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """`port a: electrical`."""

    decls: tuple[Decl, ...]
    domain: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """`branch [b]: D`; without a name decls is empty."""

    decls: tuple[Decl, ...]
    domain: Word
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Input:
    """`input u: V [= expr]`."""

    decl: Decl
    unit: Unit
    value: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """`output y = expr`."""

    decl: Decl
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Quasi:
    """`quasi w: rad/s = expr`, a quasi-velocity: linear in flows, its coefficients of displacements."""

    decl: Decl
    unit: Unit
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Coord:
    """`coord q: D [tangible|intangible] [= v]`; tangible is None where nothing is asserted."""

    kind: Literal["coord", "cocoord"]
    decls: tuple[Decl, ...]
    domain: Word
    tangible: bool | None
    init: Initial | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Implicit:
    """`implicit e: V [~ guess]`."""

    decls: tuple[Decl, ...]
    unit: Unit
    init: Initial | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """`state s: u = v`."""

    decl: Decl
    unit: Unit | None
    value: Expr | None
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Discrete:
    """`discrete g = 1`."""

    decl: Decl
    unit: Unit | None
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Dynamic:
    """`dynamic s' = expr`."""

    target: Expr
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Let:
    """`let x = expr`."""

    decl: Decl
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """`law e = R*f`."""

    left: Expr
    right: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Energy:
    """`energy T* [name] = expr`."""

    function: Literal["T*", "T", "V*", "V"]
    name: Word | None
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """`content D [name] = expr`."""

    function: Literal["D", "G"]
    name: Word | None
    value: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Work:
    """`work effort on expr`."""

    effort: Expr
    on: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
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
class Init:
    """`init ref = v`, `init ref ~ v`; also in scenes."""

    target: Expr
    initial: Initial
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class When:
    """`when c { a := b }`; also in scenes."""

    condition: Expr
    actions: tuple[Action, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Every:
    """`every 5 ms { a := b }`."""

    period: Expr
    actions: tuple[Action, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class For:
    """`for i in lower..upper { ... }`."""

    index: Word
    lower: Expr
    upper: Expr
    body: tuple[Statement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """`level n [extends m] [default] { ... }`."""

    name: Word
    extends: Word | None
    default: bool
    body: tuple[Statement, ...]
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Require:
    """`require expr`."""

    condition: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Expect:
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
class Golden:
    """`expect golden "file" within r`."""

    file: str
    within: Expr
    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Lossless:
    """`lossless`."""

    span: Span
    doc: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Instance:
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
class Broken:
    """A statement that could not be read; `names` are the names in it, so that later stages can spare
    the author errors that only follow from this one: all names, where ANY is among them.
    """

    names: frozenset[str]
    span: Span


Connection = Across | On | Bind | BindAcross | Single
Statement = (
    Param
    | Node
    | Port
    | Branch
    | Input
    | Output
    | Quasi
    | Coord
    | Implicit
    | State
    | Discrete
    | Dynamic
    | Let
    | Law
    | Energy
    | Content
    | Work
    | Constraint
    | Init
    | When
    | Every
    | For
    | Level
    | Require
    | Expect
    | Golden
    | Lossless
    | Instance
    | Broken
)
