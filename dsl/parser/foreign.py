"""Spellings of other languages that are no syntax here, recognised where a token does not fit."""

from __future__ import annotations

import re
import unicodedata

from sysdyn.dsl.model.unit_habits import (
    PREFIXED,
    TIMES_TIME,
    UNGROUPED,
    correct_spelling,
    expand_suffix,
    find_parenthesized,
    find_product,
)
from sysdyn.dsl.model.units import find_unit
from sysdyn.dsl.parser.complaints import Complaint
from sysdyn.dsl.parser.lexing import EXPONENT
from sysdyn.dsl.text.source import Span
from sysdyn.values import dataclass

_DIGITS_BEFORE = re.compile(r"(?<!\w)[0-9]+$")
_FACTOR = rf"[^\W\d]\w*(?:\^{EXPONENT})?"
_UNIT = re.compile(rf"{_FACTOR}(?:[./]{_FACTOR})*")
_POWER = re.compile(EXPONENT)
_GROUPED = re.compile(r"\(([^()\r\n]*)\)")
_DIGITS = re.compile(r"[0-9]+")
_ARGUMENT = re.compile(r"[(,)]\s*\w+\s*=[^=,()]*[^=,()\s]\s*$")
_NAMED = re.compile(r"\s*=(?!=)")
_SPICE = re.compile(r"(?:[\w.+-]+[ \t]+){2,}[\w.+-]+[ \t]*(?:[#;].*)?$")
_PARTS = {"R": "resistor(R = 1 kohm)", "C": "capacitor(C = 1 uF)", "L": "inductor(L = 1 mH)", "V": "voltage(v = 5 V)"}
_PARTS |= {"I": "current(i = 1 A)", "D": "diode()", "K": "spring(k = 1 N/m)", "M": "mass(m = 1 kg)"}


@dataclass(frozen=True, slots=True)
class Slip:
    """A foreign spelling: what is said about it; meant: what certainly belongs at the span instead, if anything."""

    complaint: Complaint
    meant: str | None = None
    span: Span | None = None


def explain_suffix(number: str, unit: str) -> tuple[str, str | None]:
    """What is meant by a number with something grown to it (`3kg`, `5Nm`, `10k`), and what it is for certain."""
    # 10k, 4u7
    plain = expand_suffix(number + unit)
    if plain is not None and find_unit(unit) is None:
        digits, _, exponent = plain.partition("e")
        example = PREFIXED.get(f"e{exponent}")
        return f"{plain}, or with its unit, as in '{digits} {example}'" if example else plain, None
    # 1_000
    if re.fullmatch(r"(_[0-9]{3})+", unit):
        whole = number + unit.replace("_", "")
        return f"{whole}: digits stand together", None
    # 0xff
    if number == "0" and re.fullmatch(r"[xX][0-9a-fA-F]+|[bB][01]+|o[0-7]+", unit):
        return f"{int(number + unit, 0)}: numbers are written in digits of ten", None
    # 1d3 of Fortran
    if re.fullmatch(r"[dD][0-9]+", unit):
        return f"{number}e{unit[1:]} for a power of ten, {number} {unit[0]}^{unit[1:]} for one of a unit", None
    # 3kg, 5Nm
    right = unit if find_unit(unit.partition(".")[0].partition("/")[0].partition("^")[0]) else correct_spelling(unit)
    if right:
        return f"{number} {right}", f"{number} {right}"
    return f"{number} {unit}, or {number}*{unit} for a product", None


def spice(word: str, after: str) -> str | None:
    """A line of a netlist: `R1 a b 1k`."""
    if not _SPICE.match(after):
        return None
    plus, minus = after.split()[:2]
    part = _PARTS.get(word[:1].upper(), "component(name = value)")
    ends = ["ground" if node in ("0", "gnd", "GND") else node for node in (plus, minus)]
    return f"{word}: {part} {ends[0]} -> {ends[1]}"


def find_slip(text: str, start: int, end: int, kind: str) -> Slip | None:
    """The slip at a token start..end that other languages explain; None for any other."""
    sign = text[start:end]
    first = text.rfind("\n", 0, start) + 1
    line = text[first:start]
    before = _DIGITS_BEFORE.search(line)
    # 1,5; of three digits it may be a thousand
    if sign == "," and before and (behind := _DIGITS.match(text, end)):
        meant = f"{before.group()}.{behind.group()}"
        span = Span(first + before.start(), behind.end())
        said = f"'{text[span.start : span.end]}': a comma separates; decimals follow a point"
        if len(behind.group()) == 3:
            either = f"{meant}, or {before.group()}{behind.group()}"
            return Slip(("E113", said, either))
        return Slip(("E113", said, meant), meant, span)
    # (R = 1 ohm C = 2 F)
    if kind == "<name>" and _ARGUMENT.search(line) and _NAMED.match(text, end):
        said = f"'{sign} = ...' is an argument of its own: a comma stands before it"
        span = Span(first + len(line.rstrip()), end)
        return Slip(("E113", said, f", {sign} = ..."), f", {sign}", span)
    unclosed = _unclosed_parameters(text, Span(start, end), line) if kind == "<name>" else None
    if unclosed is not None:
        return Slip(unclosed)
    # 3 N/(m.s)
    quantity = find_parenthesized(text, start) if kind in ("<name>", "<number>", "(") else None
    if quantity is not None:
        said = f"'{text[quantity.start : quantity.end]}': {UNGROUPED}"
        return Slip(("E113", said, f"write '{quantity.right}'"), quantity.right, Span(quantity.start, quantity.end))
    # 3 N m, 3 kN*s/m
    quantity = find_product(text, start)
    apart = quantity is not None and text[quantity.start : quantity.end] != quantity.right
    if quantity is not None and apart and (kind == "<name>" or sign in ("·", "⋅", "×", "*")):
        written = text[quantity.start : quantity.end]
        said = f"'{written}': a unit is written without spaces, its factors are joined by dots"
        if quantity.right.endswith(TIMES_TIME):
            said = f"'{written}': factors are joined by '*'"
        return Slip(("E113", said, f"write '{quantity.right}'"), quantity.right, Span(quantity.start, quantity.end))
    return _known_sign(text, Span(start, end), kind, line)


def _known_sign(text: str, span: Span, kind: str, line: str) -> Slip | None:
    """The slips that one sign tells."""
    sign = text[span.start : span.end]
    before = _DIGITS_BEFORE.search(line)
    # a remark of C
    if sign in ("/", "*") and line.endswith("/"):
        return Slip(("E113", f"'/{sign}': a remark is no part of a statement", "a comment begins with '#'"))
    # x**2
    if sign == "*" and line.endswith("*"):
        return Slip(("E113", "'**': a power is written with '^'", "a^b"), "^", Span(span.start - 1, span.end))
    # N^(2)
    grouped_ = _GROUPED.match(text, span.start) if sign == "(" and line.endswith("^") else None
    if grouped_ is not None:  # of a declared unit; one of a quantity is read with it
        meant = f"^{grouped_.group(1)}" if _POWER.fullmatch(grouped_.group(1)) else "^2, ^1.5 or ^1/3"
        return Slip(("E115", "the exponent of a unit stands without parentheses", meant))
    found = _element_slip(text, span, line)
    if found is not None:
        return Slip(found)
    # a -> 0
    if sign == "0" and line.rstrip().endswith("->"):
        return Slip(("E113", "the reference of every domain has a name", "ground"), "ground")
    # [1, 2] m; (1 + 2) m
    if kind == "<name>" and line.rstrip().endswith((")", "]")) and find_unit(sign) is not None:
        unit = _UNIT.match(text, span.start)
        shown = unit.group() if unit else sign
        if line.rstrip().endswith("]"):
            said = f"'{shown}' stands behind a list: each of its numbers has its unit"
            return Slip(("E113", said, f"[1 {shown}, 2 {shown}]"))
        said = f"'{shown}' stands behind an expression: a unit belongs to a number"
        return Slip(("E113", said, f"the unit to one of its numbers, as in 2 {shown}*sqrt(2)"))
    # from std.electrical import *
    if sign == "*" and line.rstrip().endswith("import"):
        module = line.split()[1] if len(line.split()) > 1 else "std.electrical"
        said = "names are imported one by one, never all with '*'"
        return Slip(("E113", said, f"from {module} import NAME, NAME: sysdyn std lists them"))
    # x² with a superscript
    power = unicodedata.normalize("NFKC", sign)
    if kind == "<name>" and power.isascii() and power.isdigit():
        return Slip(("E113", f"'{sign}': a power is written with '^'", f"^{power}"), f"^{power}", span)
    # (a + b)(c + d)
    if kind in ("<name>", "(") and line.endswith(")"):
        return Slip(("E113", "a product is written with its sign", f")*{sign}"))
    # 20 °C
    if sign == "°" and text[span.end : span.end + 1] == "C":
        return Slip(("E113", "'°C' is no unit of a quantity: its zero is not 0 K", "celsius(20)"))
    # c ? a : b
    if sign == "?":
        return Slip(("E113", "'?': a choice is written in words", "if c then a else b"))
    # a if c else b
    if kind == "<name>" and re.search(r"[0-9][ \t]+if[ \t]+$", line):
        return Slip(("E113", "the condition of a choice comes first", "if c then a else b"))
    # 5. without a digit
    if sign == "." and before and not text[span.end : span.end + 1].isdigit():
        return Slip(("E113", "a number ends with a digit", f"{before.group()}.0"), ".0")
    return None


_ELEMENT = re.compile(r"\s*[\w\[\], +-]+:\s*([\w.]+)\s*(\(.*\))?\s*(.*)$")
"""An element's line up to a token: component, parameters, what stands behind them."""


def _unclosed_parameters(text: str, span: Span, line: str) -> Complaint | None:
    """A first node behind parameters that are not closed: `resistor(R = 1 ohm a -> b`."""
    found = _ELEMENT.match(line)
    if found is None or re.match(r"[\w.]*(?:\[[^\]]*\])?\s*->", text[span.end :]) is None:
        return None
    given = line[found.end(1) :].strip()
    if not given.startswith("(") or given.count("(") != given.count(")") + 1:
        return None
    shown = f"{found[1]}{given}) {text[span.start : span.end]} -> ..."
    return "E112", f"the parentheses of '{found[1]}' are not closed", shown


def _element_slip(text: str, span: Span, line: str) -> Complaint | None:
    """What does not fit in `label: component(name = value) a -> b`."""
    sign = text[span.start : span.end]
    found = _ELEMENT.match(line)
    if found is None:
        return None
    component, parameters, behind = found[1], found[2], found[3].strip()
    rest = text[span.end : text.find("\n", span.end) if "\n" in text[span.end :] else len(text)]
    other = re.match(r"[-=~]*>?\s*([\w\[\]]+)", rest)
    second = other[1] if other else "b"
    # a => b
    if parameters and re.fullmatch(r"[\w\[\]]+\s*=", behind) and sign == ">":
        return "E113", "'=>' joins no nodes", f"{behind[:-1].strip()} -> {second}"
    # a <- b
    if parameters and re.fullmatch(r"[\w\[\]]+", behind) and sign == "<" and rest.startswith("-"):
        return "E113", "'<-' joins no nodes: the arrow goes from plus to minus", f"{second} -> {behind}"
    # a -> b -> c
    if parameters and sign == "->" and "->" in behind:
        said = "an element has two ends; those in series are elements of their own"
        return "E113", said, f"{behind}, and another element {behind.rpartition('->')[2].strip()} -> {second}"
    # 1 -> 2: numbers of nodes
    if parameters and not behind and sign.isdigit():
        to = re.match(r"[\w\s]*->\s*(\w+)", rest)
        end = f"n{to[1]}" if to and to[1].isdigit() else "ground"
        named = f"n{sign} -> {end}, and node n{sign}: DOMAIN"
        return "E113", "nodes have names, which begin with a letter", named
    # resistor{R = 1 ohm}
    if sign == "{" and not parameters and not behind:
        return "E113", "parameters stand in parentheses", f"{component}(name = value) a -> b"
    # resistor R = 1 ohm a -> b
    if not parameters and re.fullmatch(r"\w+\s*=.*", behind) and sign[:1].isalpha():
        given = " ".join(behind.split())
        return "E113", "parameters stand in parentheses", f"{component}({given}) {sign} -> ..."
    # resistor a -> b (R = 1 ohm)
    if not parameters and "->" in behind and sign == "(" and (late := re.match(r"(\s*\w+\s*=.*)\)", rest)):
        return "E113", "parameters stand behind the component", f"{component}({late[1].strip()}) {behind}"
    # motor(...) shaft: n1
    if parameters and sign == ":" and re.search(r"(^|,\s*)\w+$", behind):
        name = re.findall(r"\w+", behind)[-1]
        return "E113", "a port is bound by '='", f"{name} = {second}"
    # a(1) -> b
    if parameters and sign == "(" and re.search(r"\w$", behind):
        name = re.findall(r"\w+", behind)[-1]
        return "E113", "an index stands in square brackets", f"{name}[...]"
    # resistor(R: 1 ohm)
    if sign == ":" and (inside := re.search(r"\(\s*(?:.*,\s*)?(\w+)\s*$", line)) is not None:
        return "E113", "a parameter is given by '='", f"{component}({inside[1]} = ...)"
    return None
