"""What the C and the NumPy printer share: numbers, sums, products with powers, places."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from sysdyn.compiler.model.integers import ArrayElement, FamilyReference, Index
from sysdyn.values import dataclass

LARGEST_POWER = 64  # whole powers up to this are multiplications; beyond, pow: as exact, and no longer


@dataclass(frozen=True, slots=True)
class Notation:
    """How a language writes the functions that powers need."""

    sqrt: str
    power: str
    whole: str  # (base, whole exponent) by repeated squaring
    infinity: str
    nan: str


def number(value: float, notation: Notation) -> str:
    """A double that reads back as itself, in parentheses where negative."""
    value = float(value)  # NumPy's own doubles print their type
    if math.isnan(value):
        return notation.nan
    if math.isinf(value):
        return notation.infinity if value > 0 else f"(-{notation.infinity})"
    return repr(value) if value >= 0 else f"({value!r})"


def total(data: tuple[float, Sequence[float]], args: Sequence[str], notation: Notation) -> str:
    """Constant + sum of coefficient*argument."""
    constant, coefficients = data
    text = ""
    for c, a in zip(coefficients, args, strict=True):
        sign = "-" if c < 0 else "+"
        body = a if abs(c) == 1.0 else f"{number(abs(c), notation)}*{a}"
        text += f" {sign} {body}" if text else (f"-{body}" if c < 0 else body)
    if constant:
        text += f" {'-' if constant < 0 else '+'} {number(abs(constant), notation)}"
    return text


def factors(exponents: Sequence[float], args: Sequence[str], notation: Notation) -> str:
    """prod(argument^exponent): numerator over denominator."""
    above = [_power(a, e, notation) for e, a in zip(exponents, args, strict=True) if e > 0]
    below = [_power(a, -e, notation) for e, a in zip(exponents, args, strict=True) if e < 0]
    top = "*".join(above) or "1.0"
    if not below:
        return top
    return f"{top}/{below[0]}" if len(below) == 1 and "*" not in below[0] else f"{top}/({'*'.join(below)})"


def _power(base: str, exponent: float, notation: Notation) -> str:
    whole = int(exponent) if exponent < LARGEST_POWER else -1
    if exponent == whole:
        return "*".join([base] * whole) if whole <= 3 else f"{notation.whole}({base}, {whole})"
    if exponent == whole + 0.5:
        root = f"{notation.sqrt}({base})"
        return root if whole == 0 else f"{_power(base, float(whole), notation)}*{root}"
    return f"{notation.power}({base}, {number(exponent, notation)})"


def position(
    place: FamilyReference | ArrayElement, head: str, loop: Callable[[int], str], scaled: bool
) -> tuple[str, str]:
    """(part that no loop variable enters, part with loop variables) of a place in y, r or p."""
    fixed = [head] if head else []
    # the family's first place
    if place.origin >= 0:
        fixed.append(f"ix[{place.origin}]")
    moving = []
    # each index by its stride
    for k, index in enumerate(place.indices):
        stride = f"ix[{place.strides[k]}]" if k < len(place.strides) else ""
        # picked by a table
        if index.table >= 0:
            picked = f"ix[ix[{index.table}] + {bound(index, loop)}]"
            moving.append(f"{stride}*{picked}" if stride and scaled else picked)
            continue
        # constants and slots before loop variables
        still = still_part(index)
        if still:
            fixed.append(f"{stride}*({still})" if stride else still)
        if index.loop >= 0:
            name = loop(index.loop)
            moving.append(f"{stride}*{name}" if stride and scaled else name)
    return " + ".join(fixed) or "0", " + ".join(moving)


def still_part(index: Index) -> str:
    """ix[slot] + constant, as far as there is one."""
    parts = [f"ix[{index.slot}]"] if index.slot >= 0 else []
    if index.constant:
        parts.append(str(index.constant))
    return " + ".join(parts)


def bound(index: Index, loop: Callable[[int], str]) -> str:
    """A loop bound."""
    parts = [loop(index.loop)] if index.loop >= 0 else []
    still = still_part(index)
    return " + ".join([*parts, still] if still else parts) or "0"
