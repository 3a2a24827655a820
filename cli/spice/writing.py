"""Numbers and names as the language has them."""

from __future__ import annotations

import math
import re
from collections.abc import Collection

from sysdyn.cli.spice.netlist import UnreadableCard
from sysdyn.dsl.format.format import format_text
from sysdyn.dsl.format.layout import WIDTH
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
        raise UnreadableCard(f"{number:g} {unit} is no value")
    if not unit:
        return plain(number)
    digits = 3 * math.floor(math.log10(abs(number)) / 3.0) if number else 0
    for power in (digits, digits + 3):  # a number just below a power of ten is shown as one
        shown = f"{number / 10.0**power:.15g}" if power in PREFIXES else ""
        if shown and 1.0 <= abs(float(shown)) < 1000.0 and len(shown) <= SHORT:
            return f"{shown} {PREFIXES[power]}{unit}"
    return f"{plain(number)} {unit}"


def plain(number: float) -> str:
    """A number to fifteen digits."""
    return f"{number:.15g}"


LINE = 2000
"""Characters of a line that is written; one that the language reads may have five times as many."""


def wrap_lines(text: str) -> str:
    """Longer lines broken behind commas and signs."""
    return "\n".join(_broken(line) if len(line) > LINE else line for line in text.split("\n"))


def _broken(line: str) -> str:
    parts, length = [], 0
    for part in re.split(r"(?<=, )|(?<= \+ )", line):
        if length + len(part) > LINE:
            parts.append("\n")
            length = 0
        parts.append(part)
        length += len(part)
    return "".join(parts)


_RUN = re.compile(r"(?:^  (?:\w+: \w+\(\w+ = [\d.e+-]+ \w+\) \w+ -> \w+|init \w+\.\w = 0 \w)\n)+", re.MULTILINE)
"""Statements whose layout is the formatter's already, if they are short: most of a large netlist."""


def format_fast(text: str) -> str:
    """The formatter's layout of a text; runs of plain statements go by it, which would take most of the time."""
    runs: list[str] = []

    def keep(found: re.Match[str]) -> str:
        if len(max(found[0].split("\n"), key=len)) > WIDTH:
            return found[0]
        runs.append(found[0])
        return f"  # {len(runs) - 1}\n"

    laid = format_text(_RUN.sub(keep, text))
    return re.sub(r"(?m)^  # (\d+)\n", lambda found: runs[int(found[1])], laid)


class NetlistNames:
    """Gives each name of a netlist one of the language that is not taken: its own where it is one."""

    def __init__(self, taken: Collection[str], prefix: str) -> None:
        self._next = dict.fromkeys(taken, 2)
        self._prefix = prefix

    def new(self, word: str) -> str:
        """A name that none has had."""
        base = re.sub(r"\W", "_", word, flags=re.ASCII)
        base = base if re.match(r"[A-Za-z]", base) else f"{self._prefix}{base}"
        base = f"{base}_" if base in WORDS else base
        name, k = base, self._next.get(base, 2)
        while name in self._next:
            name, k = f"{base}_{k}", k + 1
        self._next[base] = k
        self._next.setdefault(name, 2)
        return name


def names(words: Collection[str], taken: Collection[str], prefix: str) -> dict[str, str]:
    """A name of the language for each name of the netlist."""
    given = NetlistNames(taken, prefix)
    return {word: given.new(word) for word in words}
