"""What would make two dimensions agree: the unit that a number or parameter should have, or the missing factor."""

from __future__ import annotations

from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model.unit_habits import common
from sysdyn.dsl.model.units import Dimension, multiply, si_text
from sysdyn.dsl.names.symbols import ParameterSymbol, Scope
from sysdyn.dsl.tree import syntax


def in_unit(number: syntax.Expr, wanted: Dimension) -> str:
    """How a number or a quantity is written in another dimension."""
    inner = number.operand if isinstance(number, syntax.Negative) else number
    assert isinstance(inner, (syntax.Number, syntax.Quantity))
    text = f"{'-' if inner is not number else ''}{inner.text}"
    if common(wanted) == "K":
        return f"celsius({text}), or '{text} K' where kelvins are meant"
    return f"write '{text} {common(wanted)}'" if wanted else f"write '{text}', a number"


def refitted(scope: Scope, expression: syntax.Expr, factor: Dimension) -> str | None:
    """The unit with which a parameter of a product fits, or the factor that is missing in it."""
    inner: object = expression
    while isinstance(inner, (syntax.Negative, syntax.Group)):
        inner = inner.operand if isinstance(inner, syntax.Negative) else inner.expr
    if isinstance(inner, syntax.Name):
        symbol = scope.find(inner.name)
        if isinstance(symbol, ParameterSymbol) and symbol.dimension:
            wanted = common(multiply(symbol.dimension, factor))
            return f"'{inner.name}' is in {common(symbol.dimension)}, {wanted} is wanted"
    if not isinstance(inner, syntax.Product):
        return None
    missing = f"a factor in {common(factor)} is missing"
    for op, f in inner.factors:
        symbol = scope.find(f.name) if isinstance(f, syntax.Name) else None
        if isinstance(symbol, ParameterSymbol) and symbol.dimension and not symbol.shape:
            fits = dim.quotient(symbol.dimension, factor) if op == "/" else multiply(symbol.dimension, factor)
            if common(fits) != si_text(fits):  # a unit that engineers use: meant rather than met by chance
                unit = common(fits)
                return f"{missing}; with '{symbol.name}' in {unit} (it is in {common(symbol.dimension)}) it fits"
    return missing
