"""Units as they are written elsewhere, rewritten: `Nm` is `N.m`, `m/s²` is `m/s^2`, `kN*s/m` is `kN.s/m`.

Pure functions from a text to the right text, or None where no reading is certain.  No edit distance: a suggestion is
made only where all its factors are units.
"""

from __future__ import annotations

import re
from functools import cache

from sysdyn.dsl.model.units import NONE, Dimension, find_unit, multiply, names, si_text
from sysdyn.values import dataclass

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_RAISED = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+")
_SIGNS = {
    "·": ".",
    "⋅": ".",
    "*": ".",
    "×": ".",
    "\u03a9": "ohm",  # the letter omega
    "\u2126": "ohm",  # the sign of the unit
    "°": "deg",
    "%": "percent",
    "**": "^",
    "∕": "/",
}
_FACTOR = re.compile(r"([^\W\d_]+)(?:\^?(-?[0-9]+))?")
_WORDS = {
    "ohms": "ohm", "volt": "V", "volts": "V", "amp": "A", "amps": "A", "ampere": "A", "amperes": "A",
    "newton": "N", "newtons": "N", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "gram": "g", "grams": "g",
    "second": "s", "seconds": "s", "sec": "s", "secs": "s", "hour": "h", "hours": "h", "hr": "h", "hrs": "h",
    "minute": "min", "minutes": "min", "mins": "min", "day": "d", "days": "d", "kilogram": "kg", "kilograms": "kg",
    "kgs": "kg", "joule": "J", "joules": "J", "watt": "W", "watts": "W", "pascal": "Pa", "pascals": "Pa",
    "hertz": "Hz", "cps": "Hz", "farad": "F", "farads": "F", "henry": "H", "henries": "H", "henrys": "H",
    "tesla": "T", "weber": "Wb", "coulomb": "C", "coulombs": "C", "kelvin": "K", "degree": "deg", "degrees": "deg",
    "radian": "rad", "radians": "rad", "rads": "rad", "mps": "m/s", "rev": "turn", "revs": "turn", "revolution": "turn",
    "revolutions": "turn", "liter": "l", "liters": "l", "litre": "l", "litres": "l", "lt": "l", "ltr": "l",
    "tonne": "t", "tonnes": "t", "ton": "t", "siemens": "S", "mho": "S", "bars": "bar", "percentage": "percent",
    "pct": "percent", "rps": "turn/s", "kph": "km/h", "kmh": "km/h", "kmph": "km/h", "cc": "cm^3", "micron": "um",
}  # fmt: skip
"""Names in words; with a prefix in front of them too."""
OTHER_SYSTEMS = {
    "inch": "25.4 mm", "ft": "304.8 mm", "foot": "304.8 mm", "feet": "304.8 mm", "yd": "0.9144 m",
    "mile": "1609.344 m", "lb": "0.45359237 kg", "lbs": "0.45359237 kg", "lbm": "0.45359237 kg",
    "lbf": "4.4482216152605 N", "psi": "6894.757293168 Pa", "hp": "745.69987158227 W", "mph": "1609.344 m/h",
    "kgf": "9.80665 N", "kp": "9.80665 N", "gal": "3.785411784 l", "gpm": "3.785411784 l/min", "oz": "28.349523125 g",
    "cal": "4.184 J", "btu": "1055.05585262 J", "torr": "133.322368421 Pa", "mmhg": "133.322387415 Pa",
    "psig": "6894.757293168 Pa", "slug": "14.593902937 kg", "knot": "1852 m/h", "kt": "1852 m/h",
    "au": "149597870700 m", "ps": "735.49875 W", "cv": "735.49875 W",
}  # fmt: skip
"""Units that a text can declare for itself."""
_STRONG = ("N", "V", "A", "W", "Pa", "kg", "J", "C", "Wb", "rad", "K")
"""Bases with which names that have grown together begin: `Nm`, `kgm`, `Vs`, `Ah`, `rads`."""
_SUFFIXES = {"meg": "e6", "k": "e3", "K": "e3", "M": "e6", "G": "e9", "m": "e-3", "u": "e-6", "µ": "e-6", "n": "e-9"}
_SUFFIXES |= {"p": "e-12", "f": "e-15", "T": "e12", "g": "e9", "t": "e12", "Meg": "e6", "MEG": "e6"}
PREFIXED = {"e3": "kohm", "e6": "Mohm", "e-6": "uF", "e-3": "mH", "e-9": "nF", "e-12": "pF"}
"""A unit with the prefix that stands for a power of ten."""


def correct_spelling(text: str) -> str | None:
    """A wrong unit as it is meant; None where that is not certain, or where it is right already."""
    whole = _normal(text)
    return whole if whole != text else None


def _normal(text: str) -> str | None:
    """The unit with each factor as the language writes it; None where one is no unit."""
    plain = _RAISED.sub(lambda m: "^" + m.group().translate(_SUPERSCRIPTS), text).replace("**", "^")
    for sign, right in _SIGNS.items():
        plain = plain.replace(sign, right)
    found = []
    sign = ""
    for k, part in enumerate(re.split(r"([./])", plain)):
        if k % 2:
            sign = part
            continue
        factors = _factors(part)
        if factors is None:
            return None
        # what has grown together behind a '/' is divided by, each factor: J/kgK is J/kg/K
        found.append(sign + (sign or ".").join(factors))
    return "".join(found)


def _factors(text: str) -> list[str] | None:
    """The factors between two signs, more than one where they have grown together: `m^2K`, `kgm2`, `Nm`."""
    if text == "1":
        return ["1"]
    found: list[str] = []
    end = 0
    # name and exponent, without gaps
    for match in _FACTOR.finditer(text):
        if match.start() != end:
            return None
        end = match.end()
        name, exponent = match.groups()
        parts = [name] if find_unit(name) else _as_unit_list(name) or _split_units(name)
        if parts is None:
            return None
        # `kgm2`: the exponent belongs to the last of those that grew together
        if exponent is not None:
            if re.search(r"[/^]", parts[-1]):
                return None
            parts[-1] = f"{parts[-1]}^{exponent}"
        found += parts
    return found if found and end == len(text) else None


def _as_unit_list(name: str) -> list[str] | None:
    found = _word(name) or _only_case_variant(name)
    return None if found is None else [found]


def _word(name: str) -> str | None:
    """A unit's name in words, with or without a prefix: `volts`, `kOhm`, `mVolt`, `milliamps`."""
    lower = name.lower()
    if lower in _WORDS:
        return _WORDS[lower]
    if lower == "ohm":
        return "ohm"
    # `milliamps`: a prefix in words, and a word
    for long, short in _LONG_PREFIXES.items():
        if lower.startswith(long):
            rest = _word(lower[len(long) :])
            if rest is not None and find_unit(short + rest):
                return short + rest
    # `kOhm`, `mVolt`: a prefix of one letter, and a word
    tail = lower[1:]
    base = "ohm" if tail == "ohm" else _WORDS.get(tail)
    return name[0] + base if base and find_unit(name[0] + base) else None


_LONG_PREFIXES = {"milli": "m", "micro": "u", "nano": "n", "pico": "p", "kilo": "k", "mega": "M", "giga": "G"}
_LONG_PREFIXES |= {"centi": "c", "deci": "d"}


def _only_case_variant(name: str) -> str | None:
    """The unit that differs in upper and lower case alone: `hz`, `RPM`, `KN`, `Kg`, `mhz`; never `Nm` as `nm`."""
    found = case_variants(name)
    return found[0] if len(found) == 1 else None


def case_variants(name: str) -> list[str]:
    """All units that differ in upper and lower case alone, those without a prefix first: `pa` is Pa or pA; none of what
    may be milli or mega.
    """
    head, tail = name[:1], name[1:]
    prefix = "k" if head == "K" else head
    whole, prefixed = [], []
    for base in names():
        if base.lower() == name.lower():
            whole.append(base)
        elif head.lower() == "m" and tail.lower() == base.lower() and base != "l":
            return whole
        elif base.lower() == tail.lower() and find_unit(prefix + base) and (tail != base or prefix != head):
            prefixed.append(prefix + base)
    return [*whole, *prefixed]


def _split_units(name: str) -> list[str] | None:
    """A name that has grown together of two or three units, the longest first: `Nm`, `Nms`, `kgm`, `Ah`, `Pas`."""
    # the longest head that is a unit which occurs in such words
    for end in range(len(name) - 1, 0, -1):
        head, tail = name[:end], name[end:]
        base = head if head in _STRONG else head[1:]
        if find_unit(head) is None or base not in _STRONG:
            continue
        # `Nms` is N m s, not N times milliseconds
        if tail == "ms":
            return [head, "m", "s"]
        # `Nm`
        if find_unit(tail):
            return [head, tail]
        # three of them: `kgms`
        rest = _split_units(tail)
        if rest is not None:
            return [head, *rest]
    return None


def declaration(name: str) -> str | None:
    """The line that declares a unit of another system: `unit psi = 6894.757293168 Pa`."""
    value = OTHER_SYSTEMS.get(name.lower())
    return f"unit {name} = {value}" if value else None


_GLUED = re.compile(r"([0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)(meg|[kKMGmunpfTgtµ]|Meg|MEG)([0-9]*)$")


def expand_suffix(text: str) -> str | None:
    """A number with the suffix of a circuit simulator: `10k` is `10e3`, `4u7` is `4.7e-6`; None for anything else."""
    match = _GLUED.match(text)
    if match is None:
        return None
    number, suffix, behind = match.groups()
    if behind and "." in number:
        return None
    return f"{number}{'.' + behind if behind else ''}{_SUFFIXES[suffix]}"


@cache
def _quantity() -> re.Pattern[str]:
    """A number and what may be its unit; compiled when it is first asked for, 1 ms of each command."""
    return re.compile(
        r"(?<![\w.])([0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)[ \t]+("
        r"[^\W\d]\w*(?:\^-?[0-9]+)?(?:[ \t]*[.*/·][ \t]*[^\W\d]\w*(?:\*?\*?\^?-?[0-9]+)?)+"
        r"|[^\W\d]\w*(?:\^-?[0-9]+)?(?:[ \t]+[^\W\d]\w*(?:\^-?[0-9]+)?)+(?:/[^\W\d]\w*(?:\^-?[0-9]+)?)*)"
    )


@dataclass(frozen=True, slots=True)
class Chained:
    """A quantity whose unit was written as a product: its offsets in the text, and how it is written here."""

    start: int
    end: int
    right: str


TIMES_TIME = "*t"
"""Behind a unit and a blank `t` is the time, never the tonne: `50 Hz t`."""


def find_product(text: str, offset: int) -> Chained | None:
    """The quantity around an offset whose unit was written as a product: `3 kN*s/m` or `3 N m`; None where none is."""
    first = text.rfind("\n", 0, offset) + 1
    last = text.find("\n", offset)
    line = text[first : last if last >= 0 else len(text)]
    for match in _quantity().finditer(line):
        if match.start() + first <= offset < match.end() + first:
            written, time = match.group(2), re.search(r"[ \t]+t$", match.group(2))
            unit = re.sub(r"[ \t]*([.*/·])[ \t]*", r"\1", written[: time.start()] if time else written)
            unit = re.sub(r"[ \t]+", ".", unit)
            right = _normal(unit)
            found = f"{match.group(1)} {right}{TIMES_TIME if time else ''}"
            return Chained(match.start() + first, match.end() + first, found) if right else None
    return None


UNGROUPED = "a unit has no parentheses: '.' multiplies, '/' divides the next factor only"
_HEAD = re.compile(r"(?<![\w.])([0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)[ \t]+(?=[^\W\d]|[1(])|:[ \t]*(?=[^\W\d]|\()")
_TOKEN = re.compile(r"[ \t]*(?:([^\W\d_]+|1(?=[ \t]*/))|([(./*·)])|\^(-?[0-9]+))")


def find_parenthesized(text: str, offset: int) -> Chained | None:
    """The quantity (or the unit behind a colon) around an offset whose unit was written with parentheses:
    `30 N/(m.s)`; None where none is.
    """
    first = text.rfind("\n", 0, offset) + 1
    last = text.find("\n", offset)
    line = text[first : last if last >= 0 else len(text)]
    for head in _HEAD.finditer(line):
        found = _expand_parentheses(line, head.end())
        if found is None or not head.start() <= offset - first < found[0] or "(" not in line[head.end() : found[0]]:
            continue
        number, start = head.group(1), head.start() if head.group(1) else head.end()
        return Chained(start + first, found[0] + first, f"{number} {found[1]}" if number else found[1])
    return None


def _expand_parentheses(line: str, at: int) -> tuple[int, str] | None:
    """Where a unit with parentheses ends and how it is written without; None where a factor is no unit."""
    factors: list[tuple[str, int]] = []
    signs, sign, begun, end, starts = [1], 1, [0], at, True  # of each open parenthesis: its sign, its first factor
    while (token := _TOKEN.match(line, at)) is not None:
        name, mark, exponent = token.groups()
        # a unit, above or below by all the parentheses around it
        if name:
            if find_unit(name) is None and name != "1":
                if len(signs) > 1:
                    return None
                break
            factors.append((name, signs[-1] * sign))
            sign = 1
        # what stands inside inherits the sign before it
        elif mark == "(":
            signs.append(signs[-1] * sign)
            begun.append(len(factors))
            sign = 1
        # the group that ends here may get an exponent
        elif mark == ")":
            if len(signs) == 1 or starts:
                break
            signs.pop()
            last = begun.pop()
        # '.', '*' or '/': of the next factor
        elif mark:
            if starts:
                return None
            sign = -1 if mark == "/" else 1
        # an exponent without a base
        elif starts:
            return None
        # an exponent: of one factor, or of the group before it
        else:
            whole = len(factors) - 1 if line[at - 1 : at] != ")" else last
            factors[whole:] = [(n, p * int(exponent)) for n, p in factors[whole:]]
        at = token.end()
        starts = bool(mark) and mark != ")"
        end = at if len(signs) == 1 and not starts else end
    if len(signs) > 1 or not factors:
        return None
    # first what stands above, then what is divided by
    real = [(n, p) for n, p in factors if n != "1"]
    above = ".".join(n if p == 1 else f"{n}^{p}" for n, p in real if p > 0)
    below = [(n, -p) for n, p in real if p < 0]
    if above:
        return end, above + "".join(f"/{n}" if p == 1 else f"/{n}^{p}" for n, p in below)
    return (end, ".".join(f"{n}^-{p}" for n, p in below)) if below else None


_COMMON = [
    "N/m",
    "N.s/m",
    "kg.m^2",
    "m/s",
    "m/s^2",
    "m^2",
    "m^3",
    "m^3/s",
    "N.m.s",
    "Pa.s",
    "Pa.s/m^3",
    "W/K",
    "J/K",
    "K/W",
    "V.s",
    "V/m",
    "A/m",
    "kg/m",
    "kg/m^3",
    "N/m^2",
    "N.s",
    "N/A",
]
"""Units in which engineers say a dimension that has no name of its own."""


def common(dimension: Dimension) -> str:
    """The unit in which a dimension is usually said: `N/m` for kg/s^2."""
    text = si_text(dimension)
    if text.startswith("1/"):
        return ".".join(f"{n}^-{e or 1}" for n, e in re.findall(r"/([A-Za-z]+)(?:\^([0-9]+))?", text))
    if not re.search(r"[./^]", text):
        return text
    return next((unit for unit in _COMMON if _dimension(unit) == dimension), text)


def _dimension(unit: str) -> Dimension:
    found = NONE
    for sign, name, exponent in re.findall(r"([./]?)([A-Za-z]+)(?:\^([0-9]+))?", unit):
        factor = find_unit(name)
        assert factor is not None
        found = multiply(found, factor[0], int(exponent or 1) * (-1 if sign == "/" else 1))
    return found
