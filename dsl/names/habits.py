"""Names and functions of other languages, with what is written here: what an E101 suggests before the nearest name."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable

from sysdyn.dsl.model.unit_habits import UNGROUPED, common, find_parenthesized, find_product
from sysdyn.dsl.model.units import Dimension, find_unit
from sysdyn.values import dataclass

_NAMES = {
    **dict.fromkeys(("PI", "Pi", "M_PI", "π"), "pi"),
    **dict.fromkeys(("gnd", "GND", "Gnd", "Ground", "GROUND", "vss", "VSS"), "ground"),
    **dict.fromkeys(("time", "Time", "TIME"), "t"),
    **dict.fromkeys(("True", "TRUE"), "true"),
    **dict.fromkeys(("False", "FALSE"), "false"),
    **dict.fromkeys(("Inf", "INF", "infinity", "Infinity", "oo"), "inf"),
    **dict.fromkeys(("g", "grav", "gravity", "g_n"), "g0"),
}
RESULTS = {
    **dict.fromkeys(("T", "Ekin", "E_kin", "KE", "kinetic"), "audit.kinetic"),
    **dict.fromkeys(("V", "Epot", "E_pot", "PE", "potential"), "audit.potential"),
    **dict.fromkeys(("E", "H", "energy", "Etot"), "audit.kinetic + audit.potential, or audit.energy: the balance"),
    **dict.fromkeys(("lambda", "lam", "kappa", "mu", "multiplier", "reaction"), "LABEL.multiplier of a phi or psi"),
    **dict.fromkeys(("all", "everything"), "no trace at all: a scene without one traces every coordinate"),
}
"""What a run knows by another name."""
_FUNCTIONS = {
    "log": "ln (the natural one), or log10",
    "loge": "ln",
    "pow": "a^b",
    "power": "a^b",
    "sqr": "x^2",
    "square": "x^2",
    "fabs": "abs",
    "arcsin": "asin",
    "arccos": "acos",
    "arctan": "atan",
    "arctan2": "atan2",
    "sgn": "sign",
    "signum": "sign",
    "heaviside": "step",
    "round": "floor(x + 0.5)",
    "int": "state s: m = 0 m, and dynamic s' = ...",
    "integral": "state s: m = 0 m, and dynamic s' = ...",
    "integrate": "state s: m = 0 m, and dynamic s' = ...",
    "where": "if c then a else b",
    "ifelse": "if c then a else b",
    "sat": "clip(x, lo, hi)",
    "saturate": "clip(x, lo, hi)",
    "limit": "clip(x, lo, hi)",
    "clamp": "clip(x, lo, hi)",
    "rem": "mod",
    "fmod": "mod",
    "deg2rad": "90 deg",
    "radians": "90 deg",
    "interp": "table f(x: m) -> N linear clamp [ (0, 0), (1, 2) ]",
    "interp1": "table f(x: m) -> N linear clamp [ (0, 0), (1, 2) ]",
    "lookup": "table f(x: m) -> N linear clamp [ (0, 0), (1, 2) ]",
    **dict.fromkeys(("db", "dB", "mag2db"), "20*log10(x)"),
    "edge": "when c { ... }",
    "pre": "the name itself: right-hand sides are read before anything changes",
    "sample": "every 5 ms { ... }",
    "delay": "std.control.sample_hold holds a value between samples",
}
_DERIVATIVES = frozenset({"der", "diff", "ddt", "deriv", "derivative", "D", "dot_", "Der", "DER"})
_PROBES = {"V": "e", "v": "e", "I": "f", "i": "f"}
"""What SPICE reads of nodes and elements."""
_VARIABLES = {
    "electrical": dict.fromkeys(("v", "V", "u", "U", "voltage"), "e") | dict.fromkeys(("i", "I", "current"), "f"),
    "translation": dict.fromkeys(("F", "force"), "e") | dict.fromkeys(("v", "velocity", "speed"), "f"),
    "rotation": dict.fromkeys(("M", "tau", "torque"), "e") | dict.fromkeys(("w", "omega", "n", "speed"), "f"),
    "hydraulic": dict.fromkeys(("P", "dp", "pressure"), "e") | dict.fromkeys(("Q", "flow"), "f"),
    "heat": dict.fromkeys(("T", "temperature"), "e") | dict.fromkeys(("Q", "P", "heat"), "f"),
    "thermal": dict.fromkeys(("T", "temperature"), "e") | dict.fromkeys(("S", "entropy"), "f"),
}
_ENDINGS = ("_dot", "dot", "_d", "_prime", "Dot")


DOMAINS = {"mechanical": "'translation' or 'rotation'", "mechanics": "'translation' or 'rotation'"} | {
    **dict.fromkeys(("fluid", "pneumatic", "hydraulics"), "'hydraulic'"),
    **dict.fromkeys(("rotational", "angular"), "'rotation'"),
    **dict.fromkeys(("translational", "linear"), "'translation'"),
}
"""Domains of other languages -> those of the prelude."""


@dataclass(frozen=True, slots=True)
class Remedy:
    """What to write; meant: what certainly belongs at start..end (of the name, where None) instead."""

    said: str
    meant: str | None = None
    span: tuple[int, int] | None = None


def name(word: str, text: str, offset: int, moves: Callable[[str], bool]) -> Remedy | None:
    """What to write for an unknown name at an offset of a text; moves: whether a name has a rate."""
    # `xdot`, where x has a rate
    for ending in _ENDINGS:
        base = word.removesuffix(ending)
        if base != word and moves(base):
            return Remedy(f"{base}'", f"{base}'")
    # `dx`
    if len(word) > 1 and word[0] == "d" and moves(word[1:]):
        return Remedy(f"{word[1:]}'")
    # the rest of a unit that was written with spaces or parentheses
    if find_unit(word) is not None:
        quantity = find_parenthesized(text, offset)
        if quantity is not None:
            said = f"{quantity.right}: {UNGROUPED}"
            return Remedy(said, quantity.right, (quantity.start, quantity.end))
        quantity = find_product(text, offset)
        if quantity is not None:
            said = f"{quantity.right}: a unit is written without spaces, its factors are joined by dots"
            return Remedy(said, quantity.right, (quantity.start, quantity.end))
    # superscripts and fraction signs from other texts
    power = re.match(r"^(.*?)([\u00b2\u00b3\u00b9\u2070-\u2079]+)$", word)
    fraction = unicodedata.normalize("NFKC", word).replace("\u2044", "/")
    if power is not None and power[1]:
        return Remedy(f"{power[1]}^{unicodedata.normalize('NFKC', power[2])}")
    if "/" in fraction:
        return Remedy(fraction)
    right = _NAMES.get(word)
    return None if right is None else Remedy(right, None if right == "g0" else right)


def function(word: str, arguments: list[str]) -> Remedy | None:
    """What to write for an unknown function of these arguments (as texts)."""
    if word in _DERIVATIVES and arguments:
        inner = arguments[0]
        if inner.replace(".", "").replace("_", "").replace("'", "").isalnum():
            return Remedy(f"{inner}'", f"{inner}'" if len(arguments) == 1 or arguments[1] == "t" else None)
        return Remedy(f"let y = {inner}, and y' where its rate is read")
    if word in ("pow", "power") and len(arguments) == 2:
        whole = "^".join(a if a.replace("_", "").replace(".", "").isalnum() else f"({a})" for a in arguments)
        return Remedy(whole, whole)
    if word in _PROBES and all(a.replace("_", "").isalnum() for a in arguments) and 0 < len(arguments) < 3:
        return Remedy(" - ".join(f"{a}.{_PROBES[word]}" for a in arguments))
    right = _FUNCTIONS.get(word)
    return None if right is None else Remedy(right)


def variable(domain: str, word: str) -> str | None:
    """The letter of the variable that a domain's own word or symbol means."""
    return _VARIABLES.get(domain, {}).get(word)


def unitless_parameter(said: object) -> str | None:
    """The parameter that `unitless` says the same of, wherever it is read."""
    name, found, _ = said.partition("' is a number without unit") if isinstance(said, str) else ("", "", "")
    return f"unit of {name[1:]}" if found else None


def unitless(name: str, value: str | None, factor: Dimension) -> str:
    """That a parameter was given as a bare number where a quantity of that dimension would fit."""
    unit = common(factor)
    return f"'{name}' is a number without unit; in {unit} it fits: param {name} = {value or '...'} {unit}"
