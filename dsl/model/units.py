"""Units: names to SI dimensions and scale factors, exact in the dimensions, checked once and never at run time.

A dimension is a vector of rational exponents over m kg s A K mol cd and the bases that a file declares itself.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache, lru_cache

from sysdyn.values import dataclass

BASES = ("m", "kg", "s", "A", "K", "mol", "cd")
Dimension = tuple[tuple[str, Fraction | int], ...]  # sorted by base, no zero exponents
NONE: Dimension = ()


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: value in SI = scale*value + offset; text is the author's (UDUNITS spelling in `udunits`)."""

    dimension: Dimension
    scale: Fraction
    text: str
    offset: Fraction = Fraction(0)


def quantity(value: float, unit: Unit) -> str:
    """A value in SI as the author says it: `-3 kohm`."""
    number = (value - float(unit.offset)) / float(unit.scale)
    return f"{number:.6g}" if unit.text == "1" else f"{number:.6g} {unit.text}"


@lru_cache(maxsize=4096)
def multiply(a: Dimension, b: Dimension, power: Fraction | int = 1) -> Dimension:
    """Multiply a by b^power."""
    if not b or not power:
        return a
    exponents = dict(a)
    for base, e in b:
        exponents[base] = exponents.get(base, 0) + e * power
    return tuple(sorted((k, v) for k, v in exponents.items() if v))


def power_of(a: Dimension, power: Fraction | int) -> Dimension:
    """Raise a to a power."""
    return tuple((k, v * power) for k, v in a) if power else NONE


def _dimension(**exponents: int) -> Dimension:
    return tuple(sorted(exponents.items()))


_PI = Fraction(math.pi)
_ONE = Fraction(1)
_ENERGY = _dimension(kg=1, m=2, s=-2)
_PRESSURE = _dimension(kg=1, m=-1, s=-2)
_TIME = _dimension(s=1)

# name: (dimension, scale, takes prefixes)
_UNITS: dict[str, tuple[Dimension, Fraction, bool]] = {
    "m": (_dimension(m=1), _ONE, True),
    "g": (_dimension(kg=1), Fraction("1e-3"), True),
    "s": (_TIME, _ONE, True),
    "A": (_dimension(A=1), _ONE, True),
    "K": (_dimension(K=1), _ONE, False),
    "mol": (_dimension(mol=1), _ONE, True),
    "cd": (_dimension(cd=1), _ONE, False),
    "rad": (NONE, _ONE, True),
    "sr": (NONE, _ONE, False),
    "deg": (NONE, _PI / 180, False),
    "turn": (NONE, 2 * _PI, False),
    "rpm": (_dimension(s=-1), 2 * _PI / 60, False),
    "percent": (NONE, Fraction("0.01"), False),
    "N": (_dimension(kg=1, m=1, s=-2), _ONE, True),
    "J": (_ENERGY, _ONE, True),
    "W": (_dimension(kg=1, m=2, s=-3), _ONE, True),
    "Wh": (_ENERGY, Fraction("3600.0"), True),
    "Pa": (_PRESSURE, _ONE, True),
    "bar": (_PRESSURE, Fraction("1e5"), True),
    "atm": (_PRESSURE, Fraction("101325.0"), False),
    "V": (_dimension(kg=1, m=2, s=-3, A=-1), _ONE, True),
    "ohm": (_dimension(kg=1, m=2, s=-3, A=-2), _ONE, True),
    "S": (_dimension(kg=-1, m=-2, s=3, A=2), _ONE, True),
    "C": (_dimension(A=1, s=1), _ONE, True),
    "F": (_dimension(kg=-1, m=-2, s=4, A=2), _ONE, True),
    "H": (_dimension(kg=1, m=2, s=-2, A=-2), _ONE, True),
    "Wb": (_dimension(kg=1, m=2, s=-2, A=-1), _ONE, True),
    "T": (_dimension(kg=1, s=-2, A=-1), _ONE, True),
    "Hz": (_dimension(s=-1), _ONE, True),
    "min": (_TIME, Fraction("60.0"), False),
    "h": (_TIME, Fraction("3600.0"), False),
    "d": (_TIME, Fraction("86400.0"), False),
    "l": (_dimension(m=3), Fraction("1e-3"), True),
    "eV": (_ENERGY, Fraction("1.602176634e-19"), True),
    "t": (_dimension(kg=1), Fraction("1e3"), False),
}
PREFIXES = {
    "f": -15,
    "p": -12,
    "n": -9,
    "u": -6,
    "µ": -6,
    "μ": -6,
    "m": -3,
    "c": -2,
    "d": -1,
    "k": 3,
    "M": 6,
    "G": 9,
    "T": 12,
}
"""Powers of ten."""
DEGREE_CELSIUS = Unit(_dimension(K=1), _ONE, "degC", Fraction("273.15"))


@cache
def find_unit(name: str) -> tuple[Dimension, Fraction] | None:
    """Dimension and scale of a unit's name, prefix included; None if there is no such unit."""
    if name in _UNITS:
        return _UNITS[name][:2]
    head, tail = name[:1], name[1:]
    if head in PREFIXES and tail in _UNITS and _UNITS[tail][2]:
        dimension, scale, _ = _UNITS[tail]
        return dimension, Fraction(10) ** PREFIXES[head] * scale
    return None


def names() -> tuple[str, ...]:
    """All unit names without prefixes."""
    return tuple(_UNITS)


def si_text(dimension: Dimension) -> str:
    """The dimension in SI: a derived unit where it has a name, else base units: 'kg.m^2/s^2' is 'J'."""
    if not dimension:
        return "1"
    for name in ("N", "J", "W", "Pa", "V", "ohm", "C", "F", "H", "Wb", "S"):
        if _UNITS[name][0] == dimension:
            return name
    above = [_factor(k, v) for k, v in sorted(dimension, key=_rank) if v > 0]
    below = [_factor(k, -v) for k, v in sorted(dimension, key=_rank) if v < 0]
    return ".".join(above or ["1"]) + "".join(f"/{b}" for b in below)


def _rank(item: tuple[str, Fraction | int]) -> tuple[int, str]:
    order = ("kg", "m", "s", "A", "K", "mol", "cd")
    return (order.index(item[0]) if item[0] in order else 9, item[0])


def _factor(base: str, exponent: Fraction | int) -> str:
    if exponent == 1:
        return base
    return f"{base}^{exponent_text(exponent)}"


def exponent_text(exponent: Fraction | int) -> str:
    """As a unit has it: an integer, a decimal where it is one, thirds, else what the language cannot write."""
    decimal = format(float(exponent), ".12g")
    if Fraction(decimal) == exponent:
        return decimal
    return str(exponent) if exponent.denominator == 3 else f"({exponent})"


def si(dimension: Dimension) -> Unit:
    """The coherent SI unit of a dimension."""
    return Unit(dimension, _ONE, si_text(dimension))
