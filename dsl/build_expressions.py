"""Nodes of expressions, units and small parts from the rules of `sd.lark`.

One function for each rule, named as the rule or its alias there. Each gets the values of the
rule's symbols (signs and keywords left out, None for an optional part that is absent), the span,
and the `Notes` for findings.
"""

from __future__ import annotations

from typing import Any

from sysdyn.dsl import syntax as s
from sysdyn.dsl.notes import Notes
from sysdyn.dsl.source import Span

Values = list[Any]


def name(v: Values, span: Span, notes: Notes) -> s.Name:
    return s.Name(v[0].name, span)


def member(v: Values, span: Span, notes: Notes) -> s.Member:
    return s.Member(v[0], v[1].name, span)


def item_of(v: Values, span: Span, notes: Notes) -> s.Item:
    return s.Item(v[0], v[1], span)


def prime(v: Values, span: Span, notes: Notes) -> s.Prime:
    return s.Prime(v[0], span)


def indices(v: Values, span: Span, notes: Notes) -> tuple[s.Index, ...]:
    return tuple(v)


def range_(v: Values, span: Span, notes: Notes) -> s.Range:
    return s.Range(v[0], v[1], span)


def call(v: Values, span: Span, notes: Notes) -> s.Call:
    return s.Call(v[0].name, tuple(v[1:]), span)


def method(v: Values, span: Span, notes: Notes) -> s.Method:
    return s.Method(v[0], v[1].name, tuple(v[2:]), span)


def args(v: Values, span: Span, notes: Notes) -> tuple[s.Arg, ...]:
    return tuple(v)


def arg(v: Values, span: Span, notes: Notes) -> s.Arg:
    return s.Arg(None, v[0], span)


def named_arg(v: Values, span: Span, notes: Notes) -> s.Arg:
    return s.Arg(v[0].name, v[1], span)


def reduction(v: Values, span: Span, notes: Notes) -> s.Reduction | s.Call:
    operation, index, bounds, body = v
    if operation.name not in ("sum", "prod", "min", "max"):
        notes.error(
            "E113",
            f"'{operation.name}' does not run over an index",
            operation.span,
            "sum, prod, min or max(i in 1..n: ...)",
        )
    notes.declared(index)
    return s.Reduction(operation.name, index, bounds.lower, bounds.upper, body, span)


def arith(v: Values, span: Span, notes: Notes) -> s.Sum:
    notes.counted(v[::2], span)
    return s.Sum((("+", v[0]), *zip(v[1::2], v[2::2], strict=True)), span)


def term(v: Values, span: Span, notes: Notes) -> s.Product:
    notes.counted(v[::2], span, "factors")
    return s.Product((("*", v[0]), *zip(v[1::2], v[2::2], strict=True)), span)


def negative(v: Values, span: Span, notes: Notes) -> s.Negative:
    return s.Negative(v[0], span)


def power(v: Values, span: Span, notes: Notes) -> s.Power:
    return s.Power(v[0], v[1], span)


def compare(v: Values, span: Span, notes: Notes) -> s.Compare:
    return s.Compare(v[1], v[0], v[2], span)


def or_(v: Values, span: Span, notes: Notes) -> s.Or:
    notes.counted(v, span)
    return s.Or(tuple(v), span)


def and_(v: Values, span: Span, notes: Notes) -> s.And:
    notes.counted(v, span)
    return s.And(tuple(v), span)


def negation(v: Values, span: Span, notes: Notes) -> s.Not:
    return s.Not(v[0], span)


def conditional(v: Values, span: Span, notes: Notes) -> s.Conditional:
    return s.Conditional(v[0], v[1], v[2], span)


def true(v: Values, span: Span, notes: Notes) -> s.Bool:
    return s.Bool(True, span)


def false(v: Values, span: Span, notes: Notes) -> s.Bool:
    return s.Bool(False, span)


def group(v: Values, span: Span, notes: Notes) -> s.Group:
    return s.Group(v[0], span)


def array(v: Values, span: Span, notes: Notes) -> s.Array:
    items = tuple(item for item in v if item is not None)
    notes.counted(items, span, "items")
    return s.Array(items, span)


def negative_number(v: Values, span: Span, notes: Notes) -> s.Number:
    return s.Number(-v[0].value, "-" + v[0].text, span)


def unit(v: Values, span: Span, notes: Notes) -> s.Unit:
    factors = [v[0]]
    for sign, factor in zip(v[1::2], v[2::2], strict=True):
        factors.append(s.UnitFactor(factor.name, factor.exponent, sign, factor.span))
    text = "".join(notes.source.text[span.start : span.end].split())
    return s.Unit(tuple(factors), text, span)


def unit_factor(v: Values, span: Span, notes: Notes) -> s.UnitFactor:
    exponent = 1 if len(v) == 1 else notes.exponent(v[1].text, v[1].span)
    return s.UnitFactor(v[0].name, exponent, ".", span)


def unit_variable(v: Values, span: Span, notes: Notes) -> s.UnitFactor:
    factor = unit_factor(v, span, notes)
    return s.UnitFactor("$" + factor.name, factor.exponent, ".", span)


def unit_one(v: Values, span: Span, notes: Notes) -> s.UnitFactor:
    if v[0].text != "1":
        notes.error("E113", f"a unit has no number {v[0].text} in it; only 1 stands for none", span)
    return s.UnitFactor("1", 1, ".", span)


def domain_name(v: Values, span: Span, notes: Notes) -> s.Word:
    # read like a unit, so that any other text is no domain (E202) and not a fault of syntax
    return s.Word(v[0].text, span)


def decl(v: Values, span: Span, notes: Notes) -> s.Decl:
    return s.Decl(v[0].name, v[1] if len(v) > 1 else (), span)


def decls(v: Values, span: Span, notes: Notes) -> tuple[s.Decl, ...]:
    return tuple(v)


def words(v: Values, span: Span, notes: Notes) -> tuple[s.Word, ...]:
    return tuple(v)


def ariths(v: Values, span: Span, notes: Notes) -> tuple[s.Expr, ...]:
    return tuple(v)


def dotted(v: Values, span: Span, notes: Notes) -> s.Dotted:
    return s.Dotted(tuple(word.name for word in v), span)


def fixed(v: Values, span: Span, notes: Notes) -> s.Initial:
    return s.Initial("fixed", v[0], span)


def guess(v: Values, span: Span, notes: Notes) -> s.Initial:
    return s.Initial("guess", v[0], span)
