"""What would make two dimensions agree: the unit that a number or parameter should have, or the missing factor."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterator, Sequence

from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model.unit_habits import common
from sysdyn.dsl.model.units import NONE, Dimension, find_unit, multiply, si_text
from sysdyn.dsl.names import habits
from sysdyn.dsl.names.symbols import Definition, ParameterSymbol, Scope, UnknownSymbol
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.dsl.tree.walking import children
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Sight:
    """Names in sight, the text that is read, parameters that count (indices, sizes: they have no unit); dynamic: what
    is read is the rate of a state, in which no rate of one may stand.
    """

    scope: Scope
    source: SourceText
    whole: Collection[str]
    dynamic: bool = False

    def written(self, e: syntax.Expr) -> str:
        """An expression as it stands in the text."""
        return " ".join(self.source.text[e.span.start : e.span.end].split())


def missing(sight: Sight, have: Dimension | None, want: Dimension | None, *within: syntax.Expr) -> str | None:
    """What factor would make two dimensions agree, and which parameter has it, or was given without a unit.

    within: expressions of which the first has the dimension `have`, the second `want`.
    """
    if have is None or want is None:
        return None
    # the factor by which either side may be meant to be larger
    pairs = [*zip(within, (dim.quotient(want, have), dim.quotient(have, want)), strict=False)]
    # `4 N/V` meant as 4 N divided by V
    divided = next(filter(None, (_hint_of_division(sight, e, factor) for e, factor in pairs)), None)
    divided = divided or _by_quantities(sight, have, want, within)
    if divided:
        return divided
    # a bare number among the factors: `param R = 5` for 5 ohm
    without = [habits.unitless(*found, factor) for e, factor in pairs if factor and (found := bare(sight, e))]
    turned = [(e, dim.quotient(NONE, factor)) for e, factor in pairs if factor]
    without += [habits.unitless(*found, factor) for e, factor in turned if (found := bare(sight, e, below=True))]
    if without:
        return without[0]
    # a literal: the unit that it needs
    for e, wanted in zip(within, (want, have), strict=False):
        if isinstance(e.operand if isinstance(e, syntax.Negative) else e, (syntax.Number, syntax.QuantityLiteral)):
            return in_unit(e, wanted)
    # a parameter in sight that has the missing dimension
    for factor in (dim.quotient(want, have), dim.quotient(have, want)):
        level: Scope | None = sight.scope
        while level is not None:
            for s in level.symbols.values():
                if isinstance(s, ParameterSymbol) and not s.shape and factor and s.dimension == factor:
                    return f"the missing factor is in {dim.show(factor)}: '{s.name}'?"
            level = level.outer
    # a prime is forgotten more often than it is too much
    # x for x', or x' for x
    rates = [_rate(sight, e, factor, powers) for powers in (-1, 1) for e, factor in pairs]
    others = [fitting_unit(sight.scope, e, factor) for e, factor in pairs if factor]
    said = [*filter(None, (*rates, *others))]
    # a plain number is wanted: divided by its unit
    if not said and within and want == NONE and have:  # a number is wanted
        text = sight.written(within[0])
        said = [f"{text}/(1 {common(have)})"] if len(text) < 40 else []
    return said[0] if said else None


def _hint_of_division(sight: Sight, expression: syntax.Expr, factor: Dimension) -> str | None:
    """A quantity by the last unit of which a variable of that name is meant: `4 N/V` beside `param V: m`."""
    stack: list[object] = [expression]
    while stack:
        e = stack.pop()
        stack += children(e)
        last = e.unit.factors[-1] if isinstance(e, syntax.QuantityLiteral) and len(e.unit.factors) > 1 else None
        if last is None or last.op != "/" or last.exponent != 1:
            continue
        assert isinstance(e, syntax.QuantityLiteral)
        symbol, unit = sight.scope.find(last.name), find_unit(last.name)
        own = symbol.dimension if isinstance(symbol, (ParameterSymbol, UnknownSymbol)) and not symbol.shape else None
        if own and unit and factor in ((meant := dim.quotient(unit[0], own)), dim.quotient(NONE, meant)):
            before = e.unit.text.rpartition("/")[0]
            text = f"{e.text} {e.unit.text}"
            return f"'{e.text} {before} / {last.name}' divides by the variable {last.name}: in '{text}' it is the unit"
    return None


def _by_quantities(sight: Sight, have: Dimension, want: Dimension, within: Sequence[syntax.Expr]) -> str | None:
    """A number over a quantity, `1/2 m`, where a part of it is meant: of the unit, or of a variable of that name."""
    found = [(k, number, by) for k, e in enumerate(within[:2]) for number, by in _quotients(e)]
    off, said = [have, want], ""
    for k, number, by in found:
        own = _dimension(by.unit)
        fraction, unit = f"{number.text}/{by.text}", by.unit.text
        symbol = sight.scope.find(unit)
        if isinstance(symbol, (ParameterSymbol, UnknownSymbol)) and not symbol.shape:
            other = symbol.dimension
            part = f"'{fraction}*{unit}' multiplies by the variable {unit}"
        else:
            other = own
            part = f"'({fraction})*1 {unit}' is that part of a unit"
        if own is None or other is None:
            return None
        off[k] = multiply(multiply(off[k], own), other)
        said = said or f"'{fraction} {unit}' divides by {by.text} {unit}; {part}"
    return said if found and off[0] == off[1] else None


def divided_default(
    sight: Sight, have: Dimension | None, want: Dimension | None, within: Sequence[syntax.Expr]
) -> tuple[ParameterSymbol, str, str] | None:
    """A parameter among what is read whose default divides a number by a quantity, `1/12 kg.m^2`, where dimensions
    would agree if it were that part of the unit; the number and the quantity.
    """
    if have is None or want is None:
        return None
    factor = dim.quotient(want, have)
    stack: list[object] = list(within)
    lets: set[str] = set()
    while stack:
        e = stack.pop()
        symbol = sight.scope.find(e.name) if isinstance(e, syntax.Name) else None
        # through definitions to the parameters that they read
        if isinstance(symbol, Definition) and symbol.kind == "let" and symbol.name not in lets:
            lets.add(symbol.name)
            stack.append(symbol.expression)
        # `param J = 1/12 kg.m^2` is in 1/(kg.m^2): off by the square of its dimension
        elif isinstance(symbol, ParameterSymbol) and symbol.dimension and not symbol.shape:
            twice = multiply(symbol.dimension, symbol.dimension)
            place = symbol.place
            found = _DIVIDED.match(place.source.text, place.span.end)
            if found and factor in (twice, dim.quotient(NONE, twice)):
                return symbol, found[1], found[2]
        else:
            stack += children(e)
    return None


_DIVIDED = re.compile(
    r"[ \t]*=[ \t]*([0-9][\w.]*)[ \t]*/[ \t]*([0-9][\w.]*[ \t]+[^\W\d][^\s#;}]*)[ \t]*(?=[#;}\r\n]|$)"
)


def _dimension(unit: syntax.UnitExpression) -> Dimension | None:
    """The dimension of a unit that is made of the language's own; None for any other."""
    dimension = NONE
    for factor in unit.factors:
        found = find_unit(factor.name)
        if found is None:
            return None
        dimension = multiply(dimension, found[0], -factor.exponent if factor.op == "/" else factor.exponent)
    return dimension


def _quotients(expression: syntax.Expr) -> Iterator[tuple[syntax.Number, syntax.QuantityLiteral]]:
    """Numbers over quantities among the factors of what an expression adds."""
    stack: list[object] = [expression]
    while stack:
        e = stack.pop()
        if isinstance(e, (syntax.Sum, syntax.Negative, syntax.Parenthesized, syntax.Product)):
            stack += children(e)
        if isinstance(e, syntax.Product):
            for (_, number), (sign, by) in itertools.pairwise(e.factors):
                if sign == "/" and isinstance(number, syntax.Number) and isinstance(by, syntax.QuantityLiteral):
                    yield number, by


def _rate(sight: Sight, expression: syntax.Expr, factor: Dimension, sense: int) -> str | None:
    """A prime that is missing (sense -1), or one too many (1): an expression is off by a time (or its square), and one
    thing in it moves.
    """
    # off by s or s^2, in the sense that is asked for
    powers = dict(factor)
    if set(powers) != {"s"} or powers["s"] * sense not in (1, 2):
        return None
    primed, plain = set(), set()
    stack: list[object] = [expression]
    # names with a prime, and moving names without
    while stack:
        e = stack.pop()
        if isinstance(e, syntax.Prime):
            primed.add(sight.written(e.base))
        elif isinstance(e, syntax.Name) and isinstance(sight.scope.find(e.name), UnknownSymbol):
            plain.add(e.name)
        elif not isinstance(e, (syntax.Member, syntax.MethodCall)):
            stack += children(e)
    found = primed if sense > 0 else plain
    # of several nobody can say which is meant
    if len(found) != 1:
        return None
    (name,) = found
    moved = sight.scope.find(name)
    # dynamic s' = s: over a time constant, rather
    if sense < 0 and sight.dynamic and isinstance(moved, UnknownSymbol) and moved.kind == "s":
        unit = "s" if powers["s"] == -1 else "s^2"
        return f"over a time: ({sight.written(expression)})/(1 {unit}), or a parameter in {unit}"
    return f"{name} in place of {name}'?" if sense > 0 else f"{name}' in place of {name}?"


def bare(sight: Sight, expression: syntax.Expr, *, below: bool = False) -> tuple[str, str | None] | None:
    """The one parameter among the factors of an expression, or its divisors (below), that is a bare number: its name
    and that number.
    """
    if isinstance(expression, (syntax.QuantityLiteral, syntax.Number)):
        return None
    inner: object = expression
    # signs and parentheses around it
    while isinstance(inner, (syntax.Negative, syntax.Parenthesized)):
        inner = inner.operand if isinstance(inner, syntax.Negative) else inner.expr
    single = () if below else (inner,)
    factors = [f for op, f in inner.factors if (op == "/") == below] if isinstance(inner, syntax.Product) else single
    found = []
    # parameters that are plain numbers
    for factor in factors:
        if isinstance(factor, syntax.Negative):
            factor = factor.operand
        symbol = sight.scope.find(factor.name) if isinstance(factor, syntax.Name) else None
        if isinstance(symbol, ParameterSymbol) and not symbol.dimension and not symbol.truth and not symbol.shape:
            found.append(symbol)
    if len(found) != 1 or found[0].name in sight.whole:
        return None
    # the number, where its declaration gives it on its line
    place = found[0].place
    line = place.source.text[place.span.end :].partition("\n")[0]
    number = re.match(r"\s*=\s*(-?[0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(?:[#;].*)?$", line)
    return found[0].name, number.group(1) if number else None


def in_unit(number: syntax.Expr, wanted: Dimension) -> str:
    """How a number or a quantity is written in another dimension."""
    inner = number.operand if isinstance(number, syntax.Negative) else number
    assert isinstance(inner, (syntax.Number, syntax.QuantityLiteral))
    text = f"{'-' if inner is not number else ''}{inner.text}"
    unit = [f.name for f in inner.unit.factors] if isinstance(inner, syntax.QuantityLiteral) else []
    if wanted == dim.TIME and unit == ["m"] and inner.value:
        return f"write '{text} min', or '{text} s' where seconds are meant"
    if common(wanted) == "K":
        return f"celsius({text}), or '{text} K' where kelvins are meant"
    return f"write '{text} {_keep_prefix(inner, common(wanted))}'" if wanted else f"write '{text}', a number"


def _keep_prefix(number: syntax.Number | syntax.QuantityLiteral, unit: str) -> str:
    """A unit with the prefix that the quantity was written with, where it bears one: uF of `1 uH`."""
    names = [factor.name for factor in number.unit.factors] if isinstance(number, syntax.QuantityLiteral) else []
    alone = names[0] if len(names) == 1 and names != ["kg"] else ""  # the k of kg says nothing of sizes
    whole, base = (find_unit(name) for name in (alone, alone[1:]))
    prefixed = bool(whole and base and whole[0] == base[0] and whole[1] != base[1] and find_unit(alone[0] + unit))
    return alone[0] + unit if prefixed else unit


def fitting_unit(scope: Scope, expression: syntax.Expr, factor: Dimension) -> str | None:
    """The unit with which a parameter of a product fits, or the factor that is missing in it."""
    inner: object = expression
    while isinstance(inner, (syntax.Negative, syntax.Parenthesized)):
        inner = inner.operand if isinstance(inner, syntax.Negative) else inner.expr
    # a parameter alone
    if isinstance(inner, syntax.Name):
        symbol = scope.find(inner.name)
        if isinstance(symbol, ParameterSymbol) and symbol.dimension:
            wanted = common(multiply(symbol.dimension, factor))
            return f"'{inner.name}' is in {common(symbol.dimension)}, {wanted} is wanted"
    if not isinstance(inner, syntax.Product):
        return None
    missing = f"a factor in {common(factor)} is missing"
    # one factor of a product, in another unit of everyday use
    for op, f in inner.factors:
        symbol = scope.find(f.name) if isinstance(f, syntax.Name) else None
        if isinstance(symbol, ParameterSymbol) and symbol.dimension and not symbol.shape:
            fits = dim.quotient(symbol.dimension, factor) if op == "/" else multiply(symbol.dimension, factor)
            if common(fits) != si_text(fits):  # a unit that engineers use: meant rather than met by chance
                unit = common(fits)
                return f"{missing}; with '{symbol.name}' in {unit} (it is in {common(symbol.dimension)}) it fits"
    return missing
