"""Expressions and units as text: `format_expression`, `format_unit`.

Terms are spaced (`a + b`), factors and powers are not (`a*b^2`), comparisons and words are. The
author's parentheses are kept; where a tree made elsewhere needs more, they are added. One explicit
stack, so neither long sums nor deep nesting cost recursion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from sysdyn.dsl.tree import syntax as s

_CONDITIONAL, _OR, _AND, _NOT, _COMPARE, _SUM, _PRODUCT, _NEGATIVE, _POWER, _ATOM = range(10)
_LEVELS: dict[type[Any], int] = {
    s.Conditional: _CONDITIONAL,
    s.Or: _OR,
    s.And: _AND,
    s.Not: _NOT,
    s.Compare: _COMPARE,
    s.Sum: _SUM,
    s.Product: _PRODUCT,
    s.Negative: _NEGATIVE,
    s.Power: _POWER,
}

Part = str | tuple[Any, int]
"""A piece of text, or a node with the least binding strength that needs no parentheses there."""


def format_expression(expr: s.Expr | s.Range) -> str:
    """The canonical text of an expression, on one line."""
    return "".join(pieces(expr))


def format_unit(unit: s.UnitExpression) -> str:
    """The canonical text of a unit: as written, without spaces."""
    return unit.text


def pieces(expr: s.Expr | s.Range) -> list[str]:
    """The text of an expression in pieces, which `layout` puts into lines.

    A quantity before `/ name` or `^` keeps its distance, or its unit would swallow what follows.
    """
    out: list[str] = []
    stack: list[Part] = [(expr, _CONDITIONAL)]
    after_unit = False
    while stack:
        part = stack.pop()
        # a sign or a word: goes out as it is
        if isinstance(part, str):
            # `300 K / T` divides by T; `300 K/T` would be a unit
            if after_unit and part == "/" and stack and _begins_like_a_name(stack[-1]):
                part = " / "
            # `(2 m) ^n` likewise
            elif after_unit and part == "^":
                part = " ^"
            after_unit = False
            out.append(part)
            continue
        node, level = part
        # a sum as a factor needs parentheses
        if _LEVELS.get(type(node), _ATOM) < level:
            stack.extend((")", (node, _CONDITIONAL), "("))
            continue
        if isinstance(node, s.QuantityLiteral):
            out.append(f"{node.text} {format_unit(node.unit)}")
            after_unit = True
            continue
        stack.extend(reversed(_PARTS[type(node)](node)))
    return out


def _begins_like_a_name(part: Part) -> bool:
    """Whether the text of a part begins with a letter, which a unit before '/' would swallow."""
    while not isinstance(part, str):
        node, level = part
        if _LEVELS.get(type(node), _ATOM) < level:
            return False
        part = _PARTS[type(node)](node)[0]
    return part[:1].isalpha() or part[:1] == "_"


def comma_list(items: Iterable[Part]) -> list[Part]:
    """Parts with ', ' between them."""
    out: list[Part] = []
    for item in items:
        out.extend((", ", item) if out else (item,))
    return out


def _number(e: s.Number) -> list[Part]:
    return [e.text]


def _quantity(e: s.QuantityLiteral) -> list[Part]:
    return [f"{e.text} {format_unit(e.unit)}"]


def _text(e: s.Text) -> list[Part]:
    return [f'"{e.value}"']


def _bool(e: s.Bool) -> list[Part]:
    return ["true" if e.value else "false"]


def _name(e: s.Name) -> list[Part]:
    return [e.name]


def _member(e: s.Member) -> list[Part]:
    return [(e.base, _ATOM), "." + e.name]


def _item(e: s.Item) -> list[Part]:
    return [(e.base, _ATOM), "[", *comma_list((index, _SUM) for index in e.indices), "]"]


def _range(e: s.Range) -> list[Part]:
    return [(e.lower, _SUM), "..", (e.upper, _SUM)]


def _prime(e: s.Prime) -> list[Part]:
    return [(e.base, _ATOM), "'"]


def _arg(e: s.Arg) -> list[Part]:
    return [(e.value, _CONDITIONAL)] if e.name is None else [f"{e.name} = ", (e.value, _CONDITIONAL)]


def _call(e: s.FunctionCall) -> list[Part]:
    return [e.name + "(", *comma_list((arg, _CONDITIONAL) for arg in e.args), ")"]


def _method(e: s.MethodCall) -> list[Part]:
    return [(e.base, _ATOM), f".{e.name}(", *comma_list((arg, _CONDITIONAL) for arg in e.args), ")"]


def _reduction(e: s.Reduction) -> list[Part]:
    head = f"{e.op}({e.index.name} in "
    return [head, (e.lower, _SUM), "..", (e.upper, _SUM), ": ", (e.body, _CONDITIONAL), ")"]


def _sum(e: s.Sum) -> list[Part]:
    out: list[Part] = ["-"] if e.terms[0][0] == "-" else []
    for number, (sign, term) in enumerate(e.terms):
        if number:
            out.append(f" {sign} ")
        out.append((term, _PRODUCT))
    return out


def _product(e: s.Product) -> list[Part]:
    out: list[Part] = ["1/"] if e.factors[0][0] == "/" else []
    for number, (sign, factor) in enumerate(e.factors):
        if number:
            out.append(sign)
        out.append((factor, _NEGATIVE))
    return out


def _negative(e: s.Negative) -> list[Part]:
    return ["-", (e.operand, _NEGATIVE)]


def _power(e: s.Power) -> list[Part]:
    return [(e.base, _ATOM), "^", (e.exponent, _NEGATIVE)]


def _compare(e: s.Compare) -> list[Part]:
    return [(e.left, _SUM), f" {e.op} ", (e.right, _SUM)]


def _or(e: s.Or) -> list[Part]:
    return _infix(e.operands, " or ", _AND)


def _and(e: s.And) -> list[Part]:
    return _infix(e.operands, " and ", _NOT)


def _infix(operands: Iterable[s.Expr], word: str, level: int) -> list[Part]:
    """Operands with a word between them."""
    out: list[Part] = []
    for operand in operands:
        out.extend((word, (operand, level)) if out else ((operand, level),))
    return out


def _not(e: s.Not) -> list[Part]:
    return ["not ", (e.operand, _NOT)]


def _conditional(e: s.Conditional) -> list[Part]:
    return [
        "if ",
        (e.test, _CONDITIONAL),
        " then ",
        (e.then, _CONDITIONAL),
        " else ",
        (e.other, _CONDITIONAL),
    ]


def _array(e: s.Array) -> list[Part]:
    return ["[", *comma_list((item, _CONDITIONAL) for item in e.items), "]"]


def _group(e: s.Parenthesized) -> list[Part]:
    return ["(", (e.expr, _CONDITIONAL), ")"]


_PARTS: dict[type[Any], Callable[[Any], list[Part]]] = {
    s.Number: _number,
    s.QuantityLiteral: _quantity,
    s.Text: _text,
    s.Bool: _bool,
    s.Name: _name,
    s.Member: _member,
    s.Item: _item,
    s.Range: _range,
    s.Prime: _prime,
    s.Arg: _arg,
    s.FunctionCall: _call,
    s.MethodCall: _method,
    s.Reduction: _reduction,
    s.Sum: _sum,
    s.Product: _product,
    s.Negative: _negative,
    s.Power: _power,
    s.Compare: _compare,
    s.Or: _or,
    s.And: _and,
    s.Not: _not,
    s.Conditional: _conditional,
    s.Array: _array,
    s.Parenthesized: _group,
}
