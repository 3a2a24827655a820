"""Units as traces spell them (UDUNITS: `m/s`, `kg.m^2/s^2`, `N.m-1`, `(m/s)/s`), and how to convert between two."""

from __future__ import annotations

import re
from fractions import Fraction
from functools import lru_cache

from sysdyn.dsl.model.units import DEGREE_CELSIUS, NONE, Unit, find_unit, multiply, power_of

_TOKEN = re.compile(r"\s*(?:(\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)|([^\W\d_]+|%)|(\*\*|[./*^()+-]))")
_LONGEST = 200
_ALIASES = {
    "%": "percent",
    "degree": "deg",
    "degrees": "deg",
    "radian": "rad",
    "radians": "rad",
    "second": "s",
    "seconds": "s",
    "sec": "s",
    "meter": "m",
    "meters": "m",
    "hour": "h",
    "hours": "h",
}


def conversion(of: str, to: str) -> tuple[float, float] | None:
    """(scale, offset) with value in `to` = scale*value in `of` + offset; None where the dimensions differ."""
    if of == to:
        return 1.0, 0.0
    one, two = read_unit(of), read_unit(to)
    if one is None or two is None or one.dimension != two.dimension:
        return None
    return float(one.scale / two.scale), float((one.offset - two.offset) / two.scale)


@lru_cache(maxsize=1024)
def read_unit(text: str) -> Unit | None:
    """The unit of a text; names that are no units of ours are bases of their own; None where it is no unit."""
    if text.strip() == "degC":
        return DEGREE_CELSIUS
    tokens, place = [], 0
    while place < len(text.rstrip()):
        found = _TOKEN.match(text, place)
        if found is None or len(text) > _LONGEST:
            return None
        tokens.append(found)
        place = found.end()
    try:
        unit, rest = _product(tokens, 0) if tokens else (Unit(NONE, Fraction(1), ""), 0)
    except (ValueError, IndexError, OverflowError, ZeroDivisionError):
        return None
    return unit if rest == len(tokens) else None


def _product(tokens: list[re.Match[str]], k: int) -> tuple[Unit, int]:
    """Unit of the factors from token k on up to a bracket that closes, and the token behind them."""
    total, k = _factor(tokens, k)
    while k < len(tokens) and tokens[k].group(3) != ")":
        operator = tokens[k].group(3)
        power = -1 if operator == "/" else 1
        if operator in (".", "*", "/"):
            k += 1
        factor, k = _factor(tokens, k)
        dimension = multiply(total.dimension, factor.dimension, power)
        total = Unit(dimension, total.scale * factor.scale**power, "")
    return total, k


def _factor(tokens: list[re.Match[str]], k: int) -> tuple[Unit, int]:
    """Unit of one factor with its power, and the token behind it; ValueError where there is none."""
    number, name, operator = tokens[k].groups()
    # a group
    if operator == "(":
        unit, k = _product(tokens, k + 1)
        if tokens[k].group(3) != ")":
            raise ValueError(")")
    elif number:
        unit = Unit(NONE, Fraction(number), "")
    # an unknown unit is a base of its own: it equals itself
    elif name:
        name = _ALIASES.get(name, name)
        found = find_unit(name)
        unit = Unit(*found, name) if found else Unit(((name, Fraction(1)),), Fraction(1), name)
    else:
        raise ValueError(operator)
    power, k = _power(tokens, k + 1)
    if not -30 <= power <= 30:
        raise ValueError("power")
    scale = unit.scale**power if isinstance(power, int) else Fraction(float(unit.scale) ** float(power))
    return Unit(power_of(unit.dimension, power), scale, ""), k


def _power(tokens: list[re.Match[str]], k: int) -> tuple[int | Fraction, int]:
    """`^2`, `**-1`, `^1.5`, `^1/3`, or a number that follows at once: `m2`, `s-1`."""
    # ^2, **-1, ^(1/2)
    if k < len(tokens) and tokens[k].group(3) in ("^", "**"):
        k += 1
        bracket = tokens[k].group(3) == "("
        k += bracket
        sign = -1 if tokens[k].group(3) == "-" else 1
        k += tokens[k].group(3) in ("+", "-")
        power = sign * Fraction(tokens[k].group(1) or "x")
        if k + 2 < len(tokens) and tokens[k + 1].group(3) == "/" and tokens[k + 2].group(1) in ("2", "3", "4"):
            power, k = power / int(tokens[k + 2].group(1)), k + 2
        if bracket and tokens[k + 1].group(3) != ")":
            raise ValueError(")")
        return int(power) if power.denominator == 1 else power.limit_denominator(1000), k + 1 + bracket
    # m2, s-1: a number that follows at once
    close = k < len(tokens) and tokens[k].start() == tokens[k - 1].end() and bool(tokens[k - 1].group(2))
    if close and tokens[k].group(1) and tokens[k].group(1).isdigit():
        return int(tokens[k].group(1)), k + 1
    if close and tokens[k].group(3) in ("-", "+") and k + 1 < len(tokens):
        return int(tokens[k].group(3) + (tokens[k + 1].group(1) or "x")), k + 2
    return 1, k
