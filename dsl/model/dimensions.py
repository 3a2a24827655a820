"""Dimension rules of functions, and how dimensions are shown to the author."""

from __future__ import annotations

from fractions import Fraction

from sysdyn.dsl.model.units import NONE, Dimension, multiply, si_text

# name: (number of arguments; -1: one or more, rule); the rule says what the arguments want and what comes out
_PLAIN = "plain"  # dimensionless in, dimensionless out
_SAME = "same"  # any dimension in, the same out
_ANY = "any"  # any dimension in, dimensionless out
_ANGLE = "angle"  # two equal dimensions in, dimensionless out
_ROOT = "root"  # square root of the dimension

FUNCTIONS: dict[str, tuple[int, str]] = {
    **dict.fromkeys(
        (
            [
                "sin",
                "cos",
                "tan",
                "asin",
                "acos",
                "atan",
                "sinh",
                "cosh",
                "tanh",
                "asinh",
                "acosh",
                "atanh",
                "exp",
                "ln",
                "log10",
                "floor",
                "ceil",
                "frac",
                "smoothstep",
            ]
        ),
        (1, _PLAIN),
    ),
    "atan2": (2, _ANGLE),
    "sqrt": (1, _ROOT),
    "hypot": (2, _SAME),
    "abs": (1, _SAME),
    "sign": (1, _ANY),
    "setsign": (1, _ANY),
    "step": (1, _ANY),
    "min": (-1, _SAME),
    "max": (-1, _SAME),
    "mod": (2, _SAME),
    "clip": (3, _SAME),
    "celsius": (1, _PLAIN),
}


def wants_plain(name: str) -> bool:
    """Whether the arguments must be dimensionless."""
    return FUNCTIONS[name][1] == _PLAIN


def result(name: str, dimension: Dimension | None) -> Dimension | None:
    """Dimension of the value from the common dimension of the arguments."""
    rule = FUNCTIONS[name][1]
    if name == "celsius":
        return (("K", 1),)
    if rule == _ROOT:
        return None if dimension is None else square_root(dimension)
    return dimension if rule == _SAME else NONE


def square_root(dimension: Dimension) -> Dimension:
    """The dimension of a square root."""
    halves = ((k, Fraction(v) / 2) for k, v in dimension)
    return tuple((k, int(v) if v.denominator == 1 else v) for k, v in halves)


def show(dimension: Dimension | None) -> str:
    """A dimension for a message: in SI, 'dimensionless' in words."""
    if dimension is None:
        return "any unit"
    return "dimensionless" if not dimension else si_text(dimension)


def quotient(a: Dimension, b: Dimension) -> Dimension:
    """Divide a by b."""
    return multiply(a, b, -1)


TIME: Dimension = (("s", 1),)
POWER: Dimension = (("kg", 1), ("m", 2), ("s", -3))
ENERGY: Dimension = (("kg", 1), ("m", 2), ("s", -2))
