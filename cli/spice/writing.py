"""Numbers and names as the language has them."""

from __future__ import annotations

import math
import re
from collections.abc import Collection

from sysdyn.cli.spice.netlist import Unreadable
from sysdyn.dsl.parser.lexing import RESERVED

SHORT = 9
"""Characters of a number that takes a prefix."""
PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_WORDS = """
t pi g0 e f q p ground model scene component param node port branch coord state let init trace from import law
energy work content phi psi gamma when every discrete input output level use for in sum expect require dynamic
implicit table time set accuracy audit parameters events derivatives min max abs mod clip sin cos exp ln
"""
WORDS = RESERVED | frozenset(_WORDS.split())
"""Names that would be read otherwise."""


def quantity(number: float, unit: str) -> str:
    """`4.7 kohm`, to fifteen digits; a plain number where there is no unit."""
    if not math.isfinite(number):
        raise Unreadable(f"{number:g} {unit} is no value")
    if not unit:
        return plain(number)
    for power, prefix in PREFIXES.items():
        shown = f"{number / 10.0**power:.15g}"
        if 1.0 <= abs(float(shown)) < 1000.0 and len(shown) <= SHORT:
            return f"{shown} {prefix}{unit}"
    return f"{plain(number)} {unit}"


def plain(number: float) -> str:
    """A number to fifteen digits."""
    return f"{number:.15g}"


def names(words: Collection[str], taken: Collection[str], prefix: str) -> dict[str, str]:
    """A name of the language for each name of the netlist: its own where that is one."""
    used, found = set(taken), dict[str, str]()
    for word in words:
        base = re.sub(r"\W", "_", word, flags=re.ASCII)
        base = base if re.match(r"[A-Za-z]", base) else f"{prefix}{base}"
        base = f"{base}_" if base in WORDS else base
        name, k = base, 2
        while name in used:
            name, k = f"{base}_{k}", k + 1
        used.add(name)
        found[word] = name
    return found
