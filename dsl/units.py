"""Units: names to SI dimensions and scale factors, exact in the dimensions, checked once and never at run time.

A dimension is a vector of rational exponents over m kg s A K mol cd and the bases that a file declares itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache

BASES = ("m", "kg", "s", "A", "K", "mol", "cd")
Dimension = tuple[tuple[str, Fraction], ...]  # sorted by base, no zero exponents
NONE: Dimension = ()


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: value in SI = scale*value + offset; text is the author's (UDUNITS spelling in `udunits`)."""

    dimension: Dimension
    scale: float
    text: str
    offset: float = 0.0


def multiply(a: Dimension, b: Dimension, power: Fraction | int = 1) -> Dimension:
    """a * b^power."""
    if not b or not power:
        return a
    exponents = dict(a)
    for base, e in b:
        exponents[base] = exponents.get(base, Fraction(0)) + e * power
    return tuple(sorted((k, v) for k, v in exponents.items() if v))


def raised(a: Dimension, power: Fraction | int) -> Dimension:
    """a^power."""
    return tuple((k, v * power) for k, v in a) if power else NONE


def _dimension(**exponents: int) -> Dimension:
    return tuple(sorted((k, Fraction(v)) for k, v in exponents.items()))


_PI = 3.141592653589793
_ENERGY = _dimension(kg=1, m=2, s=-2)
_PRESSURE = _dimension(kg=1, m=-1, s=-2)
_TIME = _dimension(s=1)

# name: (dimension, scale, takes prefixes)
_UNITS: dict[str, tuple[Dimension, float, bool]] = {
    "m": (_dimension(m=1), 1.0, True),
    "g": (_dimension(kg=1), 1e-3, True),
    "s": (_TIME, 1.0, True),
    "A": (_dimension(A=1), 1.0, True),
    "K": (_dimension(K=1), 1.0, False),
    "mol": (_dimension(mol=1), 1.0, True),
    "cd": (_dimension(cd=1), 1.0, False),
    "rad": (NONE, 1.0, False),
    "sr": (NONE, 1.0, False),
    "deg": (NONE, _PI / 180.0, False),
    "turn": (NONE, 2.0 * _PI, False),
    "rpm": (_dimension(s=-1), 2.0 * _PI / 60.0, False),
    "percent": (NONE, 0.01, False),
    "N": (_dimension(kg=1, m=1, s=-2), 1.0, True),
    "J": (_ENERGY, 1.0, True),
    "W": (_dimension(kg=1, m=2, s=-3), 1.0, True),
    "Wh": (_ENERGY, 3600.0, True),
    "Pa": (_PRESSURE, 1.0, True),
    "bar": (_PRESSURE, 1e5, True),
    "atm": (_PRESSURE, 101325.0, False),
    "V": (_dimension(kg=1, m=2, s=-3, A=-1), 1.0, True),
    "ohm": (_dimension(kg=1, m=2, s=-3, A=-2), 1.0, True),
    "S": (_dimension(kg=-1, m=-2, s=3, A=2), 1.0, True),
    "C": (_dimension(A=1, s=1), 1.0, True),
    "F": (_dimension(kg=-1, m=-2, s=4, A=2), 1.0, True),
    "H": (_dimension(kg=1, m=2, s=-2, A=-2), 1.0, True),
    "Wb": (_dimension(kg=1, m=2, s=-2, A=-1), 1.0, True),
    "T": (_dimension(kg=1, s=-2, A=-1), 1.0, True),
    "Hz": (_dimension(s=-1), 1.0, True),
    "min": (_TIME, 60.0, False),
    "h": (_TIME, 3600.0, False),
    "d": (_TIME, 86400.0, False),
    "l": (_dimension(m=3), 1e-3, True),
    "eV": (_ENERGY, 1.602176634e-19, True),
    "t": (_dimension(kg=1), 1e3, False),
}
_PREFIXES = {
    "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1,
    "k": 1e3, "M": 1e6, "G": 1e9, "T": 1e12,
}  # fmt: skip
DEGREE_CELSIUS = Unit(_dimension(K=1), 1.0, "degC", 273.15)


@cache
def known(name: str) -> tuple[Dimension, float] | None:
    """Dimension and scale of a unit's name, prefix included; None if there is no such unit."""
    if name in _UNITS:
        dimension, scale, _ = _UNITS[name]
        return dimension, scale
    head, tail = name[:1], name[1:]
    if head in _PREFIXES and tail in _UNITS and _UNITS[tail][2]:
        dimension, scale, _ = _UNITS[tail]
        # decimal prefixes of decimal scales stay exact: 1 mg is 1e-6 kg, not 1.0000000000000002e-06
        return dimension, float(f"{_PREFIXES[head]:.0e}") * scale if scale == 1.0 else _exact(head, scale)
    return None


def _exact(prefix: str, scale: float) -> float:
    return float(Fraction(repr(_PREFIXES[prefix])) * Fraction(repr(scale)))


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


def _rank(item: tuple[str, Fraction]) -> tuple[int, str]:
    order = ("kg", "m", "s", "A", "K", "mol", "cd")
    return (order.index(item[0]) if item[0] in order else 9, item[0])


def _factor(base: str, exponent: Fraction) -> str:
    return base if exponent == 1 else f"{base}^{exponent}" if exponent.denominator == 1 else f"{base}^({exponent})"


def si(dimension: Dimension) -> Unit:
    """The coherent SI unit of a dimension."""
    return Unit(dimension, 1.0, si_text(dimension))
