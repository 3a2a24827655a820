"""Nodes of expressions, units and small parts from the rules of `sd.lark`.

One function for each rule, named as the rule or its alias there. Each gets the values of the
rule's symbols (signs and keywords left out, None for an optional part that is absent), the span,
and the `Notes` for findings.
"""

from __future__ import annotations

import re
from typing import Any

from sysdyn.dsl.parser.notes import Notes
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree import syntax as s

Values = list[Any]


def name(v: Values, span: Span, notes: Notes) -> s.Name:
    """`NAME`."""
    return s.Name(v[0].name, span)


def member(v: Values, span: Span, notes: Notes) -> s.Member:
    """`ref . NAME`."""
    return s.Member(v[0], v[1].name, span)


def item_of(v: Values, span: Span, notes: Notes) -> s.Item:
    """`ref [ indices ]`."""
    return s.Item(v[0], v[1], span)


def prime(v: Values, span: Span, notes: Notes) -> s.Prime:
    """`ref '`."""
    return s.Prime(v[0], span)


def indices(v: Values, span: Span, notes: Notes) -> tuple[s.Index, ...]:
    """`index (, index)*`."""
    return tuple(v)


def range_(v: Values, span: Span, notes: Notes) -> s.Range:
    """`arith .. arith`."""
    return s.Range(v[0], v[1], span)


def call(v: Values, span: Span, notes: Notes) -> s.FunctionCall:
    """`NAME ( [_args] )`."""
    return s.FunctionCall(v[0].name, tuple(v[1:]), span)


def method(v: Values, span: Span, notes: Notes) -> s.MethodCall:
    """`ref . NAME ( [_args] )`."""
    return s.MethodCall(v[0], v[1].name, tuple(v[2:]), span)


def args(v: Values, span: Span, notes: Notes) -> tuple[s.Arg, ...]:
    """`( [_args] )`."""
    return tuple(v)


def arg(v: Values, span: Span, notes: Notes) -> s.Arg:
    """`expr`."""
    return s.Arg(None, v[0], span)


def named_arg(v: Values, span: Span, notes: Notes) -> s.Arg:
    """`NAME = expr`."""
    return s.Arg(v[0].name, v[1], span)


def reduction(v: Values, span: Span, notes: Notes) -> s.Reduction | s.FunctionCall:
    """`NAME ( NAME in range : expr )`."""
    operation, index, bounds, body = v
    if operation.name not in ("sum", "prod", "min", "max"):
        notes.error(
            "E113",
            f"'{operation.name}' does not run over an index",
            operation.span,
            "sum, prod, min or max(i in 1..n: ...)",
        )
        operation = s.Word("sum", operation.span)  # as one of them it is read on
    notes.check_declared(index)
    return s.Reduction(operation.name, index, bounds.lower, bounds.upper, body, span)


def arith(v: Values, span: Span, notes: Notes) -> s.Sum:
    """`term ((PLUS | MINUS) term)*`."""
    notes.check_count(v[::2], span)
    return s.Sum((("+", v[0]), *zip(v[1::2], v[2::2], strict=True)), span)


def term(v: Values, span: Span, notes: Notes) -> s.Product:
    """`unary ((TIMES | SLASH) unary)*`."""
    notes.check_count(v[::2], span, "factors")
    return s.Product((("*", v[0]), *zip(v[1::2], v[2::2], strict=True)), span)


def negative(v: Values, span: Span, notes: Notes) -> s.Negative:
    """`- unary`."""
    return s.Negative(v[0], span)


def power(v: Values, span: Span, notes: Notes) -> s.Power:
    """`atom`."""
    return s.Power(v[0], v[1], span)


def compare(v: Values, span: Span, notes: Notes) -> s.Compare:
    """`arith`."""
    return s.Compare(v[1], v[0], v[2], span)


def or_(v: Values, span: Span, notes: Notes) -> s.Or:
    """`and_ (or and_)*`."""
    notes.check_count(v, span)
    return s.Or(tuple(v), span)


def and_(v: Values, span: Span, notes: Notes) -> s.And:
    """`not_ (and not_)*`."""
    notes.check_count(v, span)
    return s.And(tuple(v), span)


def negation(v: Values, span: Span, notes: Notes) -> s.Not:
    """`not not_`."""
    return s.Not(v[0], span)


def conditional(v: Values, span: Span, notes: Notes) -> s.Conditional:
    """`if expr then expr else expr`."""
    return s.Conditional(v[0], v[1], v[2], span)


def true(v: Values, span: Span, notes: Notes) -> s.Bool:
    """`true`."""
    return s.Bool(True, span)


def false(v: Values, span: Span, notes: Notes) -> s.Bool:
    """`false`."""
    return s.Bool(False, span)


def group(v: Values, span: Span, notes: Notes) -> s.Parenthesized:
    """`( expr )`."""
    return s.Parenthesized(v[0], span)


def array(v: Values, span: Span, notes: Notes) -> s.Array:
    """`[ [expr (, expr)*] ]`."""
    items = tuple(item for item in v if item is not None)
    notes.check_count(items, span, "items")
    return s.Array(items, span)


_FRACTION = re.compile(r"\^(-?[0-9]+/[0-9]+)$")


def negative_number(v: Values, span: Span, notes: Notes) -> s.Number:
    """`- NUMBER`."""
    return s.Number(-v[0].value, "-" + v[0].text, span)


def unit(v: Values, span: Span, notes: Notes) -> s.UnitExpression:
    """`unit_factor ((DOT | SLASH) unit_factor)*`."""
    factors: list[s.UnitFactor] = []
    for sign, factor in zip((".", *v[1::2]), v[0::2], strict=True):
        if factor.name[0].isdecimal() and factor.name != "1":
            last = factors.pop() if factors else factor
            whole = Span(last.span.start, factor.span.end)
            power = _FRACTION.search("".join(notes.source.text[whole.start : whole.end].split()))
            if power is None:
                notes.error("E113", f"a unit has no number {factor.name} in it; only 1 stands for none", factor.span)
            exponent = last.exponent if power is None else notes.exponent(power[1], whole)
            factors.append(s.UnitFactor(last.name, exponent, last.op, whole))
        else:
            factors.append(s.UnitFactor(factor.name, factor.exponent, sign, factor.span))
    text = "".join(notes.source.text[span.start : span.end].split())
    return s.UnitExpression(tuple(factors), text, span)


def unit_factor(v: Values, span: Span, notes: Notes) -> s.UnitFactor:
    """`NAME [^ _exponent]`."""
    exponent = 1 if len(v) == 1 else notes.exponent(v[1].text, v[1].span)
    return s.UnitFactor(v[0].name, exponent, ".", span)


def unit_variable(v: Values, span: Span, notes: Notes) -> s.UnitFactor:
    """`$ NAME [^ _exponent]`."""
    factor = unit_factor(v, span, notes)
    return s.UnitFactor("$" + factor.name, factor.exponent, ".", span)


def unit_one(v: Values, span: Span, notes: Notes) -> s.UnitFactor:
    """`NUMBER`: 1, or the denominator of an exponent, which the unit knows."""
    return s.UnitFactor(v[0].text, 1, ".", span)


def domain_name(v: Values, span: Span, notes: Notes) -> s.Word:
    """`unit`."""
    # read like a unit, so that any other text is no domain (E202) and not a fault of syntax
    return s.Word(v[0].text, span)


def decl(v: Values, span: Span, notes: Notes) -> s.Decl:
    """`NAME [_indices]`."""
    return s.Decl(v[0].name, v[1] if len(v) > 1 else (), span)


def decls(v: Values, span: Span, notes: Notes) -> tuple[s.Decl, ...]:
    """`decl (, decl)*`."""
    return tuple(v)


def words(v: Values, span: Span, notes: Notes) -> tuple[s.Word, ...]:
    """`NAME (, NAME)*`."""
    return tuple(v)


def ariths(v: Values, span: Span, notes: Notes) -> tuple[s.Expr, ...]:
    """`arith (, arith)*`."""
    return tuple(v)


def dotted(v: Values, span: Span, notes: Notes) -> s.Dotted:
    """`NAME (. NAME)*`."""
    return s.Dotted(tuple(word.name for word in v), span)


def fixed(v: Values, span: Span, notes: Notes) -> s.InitialValue:
    """`= expr`."""
    return s.InitialValue("fixed", v[0], span)


def guess(v: Values, span: Span, notes: Notes) -> s.InitialValue:
    """`~ expr`."""
    return s.InitialValue("guess", v[0], span)
