"""What the functions and powers of the language mean, in doubles: the values that all emitters must meet."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping


def is_whole(value: float) -> bool:
    """Whether a number has no fraction."""
    return value == int(value) if abs(value) < 2**53 else True


def real_power(base: float, exponent: float) -> float:
    """Base^exponent; infinite where it is beyond all numbers, NaN where it is not real."""
    try:
        value = base**exponent
    except (OverflowError, ZeroDivisionError):
        return math.copysign(math.inf, base) if exponent % 2.0 == 1.0 else math.inf
    return value if isinstance(value, float) else math.nan


def _of_math(name: str, own: str | None = None) -> Callable[..., float]:
    """A function of Python's: beyond all numbers infinite with the sign of its limit; NaN where it is none, and at a
    pole, for a constant ln(0) is refused.
    """
    function, odd = getattr(math, own or name), name in ("sinh", "floor", "ceil")

    def call(*values: float) -> float:
        try:
            return float(function(*values))
        except OverflowError:
            return math.copysign(math.inf, values[0]) if odd else math.inf
        except ValueError:
            return math.nan

    return call


def _sign(x: float) -> float:
    return x if math.isnan(x) else math.copysign(1.0, x) if x else 0.0


def _mod(a: float, b: float) -> float:
    return a - b * FUNCTIONS["floor"](a / b) if b else math.nan


# every function of the language with scalar arguments, by its name: the meaning all emitters must meet
FUNCTIONS: Mapping[str, Callable[..., float]] = {
    **{
        n: _of_math(n)
        for n in (
            [
                "sin",
                "cos",
                "tan",
                "asin",
                "acos",
                "atan",
                "atan2",
                "sinh",
                "cosh",
                "tanh",
                "asinh",
                "acosh",
                "atanh",
                "exp",
                "log10",
                "sqrt",
                "hypot",
                "floor",
                "ceil",
            ]
        )
    },
    "ln": _of_math("ln", "log"),
    "abs": abs,
    "sign": _sign,
    "setsign": _sign,
    "min": min,
    "max": max,
    "mod": _mod,
    "step": lambda x: 1.0 if x >= 0.0 else 0.0,
}
