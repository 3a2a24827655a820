"""What functions and powers of the language mean, against NumPy, at their edges too; where an expression is whole."""

import itertools
import math

import numpy as np
import pytest
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.dimensions import result, square_root, wants_plain
from sysdyn.dsl.model.functions import FUNCTIONS, is_whole, real_power

INF = math.inf
POINTS = (-INF, -1e308, -1000.0, -2.5, -1.0, -0.5, -0.0, 0.0, 1e-300, 0.5, 1.0, 1.5, 2.0, 1000.0, 1e308, INF, math.nan)
NUMPY = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh,
    "exp": np.exp, "ln": np.log, "log10": np.log10, "sqrt": np.sqrt, "floor": np.floor, "ceil": np.ceil,
    "abs": np.abs, "sign": np.sign, "setsign": np.sign, "step": lambda x: np.where(x >= 0.0, 1.0, 0.0),
}  # fmt: skip
POLES = (("ln", 0.0), ("log10", 0.0), ("atanh", 1.0))
"""No number here: a constant is refused there."""
TWO = {
    "atan2": np.arctan2, "hypot": np.hypot, "min": lambda a, b: np.where(b < a, b, a),
    "max": lambda a, b: np.where(b > a, b, a), "mod": lambda a, b: a - b * np.floor(a / b),
}  # fmt: skip


def alike(found, expected):
    """Equal to a few units in the last place, infinities with their sign, and no number where there is none."""
    with np.errstate(all="ignore"):
        expected = float(expected())
    if math.isnan(expected) or math.isinf(expected):
        return str(found) == str(expected)
    return found == pytest.approx(expected, rel=4e-15, abs=1e-300)


@pytest.mark.parametrize("name", NUMPY)
def test_functions_of_one_number(name):
    for x in POINTS:
        found = FUNCTIONS[name](x)
        assert type(found) is float
        if (name, abs(x)) in POLES:
            assert math.isnan(found)
        else:
            assert alike(found, lambda x=x: NUMPY[name](np.float64(x))), (x, found)


@pytest.mark.parametrize("name", TWO)
def test_functions_of_two_numbers(name):
    for a, b in itertools.product(POINTS, repeat=2):
        if (math.isfinite(a) and math.isfinite(b)) or name not in ("min", "max"):
            found = FUNCTIONS[name](a, b)
            assert alike(found, lambda a=a, b=b: TWO[name](np.float64(a), np.float64(b))), (a, b, found)


def test_every_function_is_met():
    assert set(NUMPY) | set(TWO) == set(FUNCTIONS)


def test_powers():
    """Of zero and of what is beyond all numbers with the sign of the limit; a root of a negative number is none."""
    for base, exponent in itertools.product(POINTS, (-3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0, 1e9, 1e9 + 1.0)):
        found = real_power(base, exponent)
        assert alike(found, lambda b=base, e=exponent: np.float64(b) ** np.float64(e)), (base, exponent, found)


@pytest.mark.parametrize(
    ("value", "whole"),
    [(0.0, True), (-3.0, True), (0.5, False), (2.0**53, True), (2.0**51 + 0.5, False), (1e300, True)],
)
def test_numbers_without_a_fraction(value, whole):
    assert is_whole(value) == whole


def test_dimensions_of_values():
    area, length = (("m", 2),), (("m", 1),)
    assert result("sqrt", area) == square_root(area) == length
    assert square_root((("m", 1), ("s", -2))) == (("m", pytest.approx(0.5)), ("s", -1))
    assert (result("abs", area), result("sign", area), result("celsius", ())) == (area, (), (("K", 1),))
    assert result("sqrt", None) is None
    assert [wants_plain(name) for name in ("exp", "abs", "atan2")] == [True, False, False]


@pytest.mark.parametrize("name", ["min", "max"])
def test_the_least_of_one_number_is_itself(name):
    x = ex.var("x", "s")
    assert ex.call(name, x) is x
    assert ex.call(name, ex.const(2.0)) is ex.const(2.0)
