"""Enclosures against ranges known in closed form, and against values of random expressions."""

import math

import numpy as np
import pytest
from sysdyn.compiler.binding.enclosures import _as_arrays, _single, enclose, enclose_over
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression_text import to_text

INF = math.inf
V, W, N = x.var("v", "bf"), x.var("w", "bf"), x.param("n")


def bounds(root, v=(0.0, 0.0), w=(0.0, 0.0), n=2.0):
    return enclose_over(root, {V: v, W: w}, lambda node: evaluate([node], lambda _: n)[0])


def called(name, *args):
    return x.call(name, *args)


def to_the(exponent):
    return x.power(V, x.const(exponent))


RANGES = {
    "a square turns at zero": (to_the(2.0), (-3.0, 2.0), (0.0, 9.0)),
    "a cube does not": (to_the(3.0), (-3.0, 2.0), (-27.0, 8.0)),
    "a square on one side": (to_the(2.0), (-3.0, -2.0), (4.0, 9.0)),
    "one over a range": (to_the(-1.0), (2.0, 4.0), (0.25, 0.5)),
    "a pole inside": (to_the(-1.0), (-2.0, 4.0), (-INF, INF)),
    "a root": (to_the(0.5), (4.0, 9.0), (2.0, 3.0)),
    "over all values": (to_the(2.0), (-INF, INF), (0.0, INF)),
    "a sum with a negative coefficient": (x.linear(1.0, [(-2.0, V)]), (-1.0, 3.0), (-5.0, 3.0)),
    "a whole wave": (called("sin", V), (0.0, 7.0), (-1.0, 1.0)),
    "the top of a wave": (called("sin", V), (math.pi / 6, 5 * math.pi / 6), (0.5, 1.0)),
    "the bottom of a wave": (called("cos", V), (2 * math.pi / 3, 4 * math.pi / 3), (-1.0, -0.5)),
    "a slope of a wave": (called("cos", V), (0.0, math.pi / 2), (0.0, 1.0)),
    "a rising function": (called("tanh", V), (-1.0, 2.0), (math.tanh(-1.0), math.tanh(2.0))),
    "a falling one": (called("acos", V), (-1.0, 0.5), (math.pi / 3, math.pi)),
    "outside of what it is defined for": (called("ln", V), (-1.0, 1.0), (-INF, INF)),
    "a size": (called("abs", V), (-3.0, 2.0), (0.0, 3.0)),
    "an even function": (called("cosh", V), (-1.0, 2.0), (1.0, math.cosh(2.0))),
    "the lesser": (called("min", V, x.const(1.0)), (-3.0, 2.0), (-3.0, 1.0)),
    "the greater": (called("max", V, x.const(1.0)), (-3.0, 2.0), (1.0, 2.0)),
    "a remainder within one turn": (called("mod", V, x.const(2.0)), (4.5, 5.5), (0.5, 1.5)),
    "a remainder over several": (called("mod", V, x.const(2.0)), (1.5, 4.5), (0.0, 2.0)),
    "a step within": (called("step", V), (-1.0, 1.0), (0.0, 1.0)),
    "a step behind": (called("step", V), (0.0, 1.0), (1.0, 1.0)),
    "the hypotenuse": (called("hypot", V, x.const(4.0)), (-3.0, 1.0), (4.0, 5.0)),
    "what nothing is known of": (called("tan", V), (0.0, 1.0), (-INF, INF)),
}


@pytest.mark.parametrize("name", RANGES)
def test_a_range_is_the_one_of_the_book(name):
    root, given, expected = RANGES[name]
    assert bounds(root, given) == pytest.approx(expected, rel=1e-14, abs=1e-15)


@pytest.mark.parametrize(
    ("n", "given", "expected"),
    [
        (2.0, (-3.0, -1.0), (1.0, 9.0)),
        (3.0, (-3.0, 2.0), (-27.0, 8.0)),
        (-1.0, (2.0, 4.0), (0.25, 0.5)),
        (0.5, (4.0, 9.0), (2.0, 3.0)),
    ],
)
def test_an_exponent_that_a_parameter_gives_counts_like_one_of_the_text(n, given, expected):
    assert bounds(x.power(V, N), given, n=n) == expected


def test_an_exponent_that_moves():
    assert bounds(x.power(V, W), (2.0, 3.0), (-1.0, 2.0)) == pytest.approx((1 / 3, 9.0))
    assert bounds(x.power(V, W), (-2.0, 3.0), (1.0, 2.0)) == (-INF, INF)


# what `v OPERATOR 3 ? 1 : 5` is below 3 and above it
DECIDED = {"<": (1, 5), "<=": (1, 5), ">": (5, 1), ">=": (5, 1), "==": (5, 5), "!=": (1, 1)}


@pytest.mark.parametrize("operator", DECIDED)
def test_a_condition_that_is_decided_takes_one_side(operator):
    root = x.conditional(x.compare(operator, V, x.const(3.0)), x.const(1.0), x.const(5.0))
    below, above = DECIDED[operator]
    assert bounds(root, (0.0, 2.0)) == (below, below)
    assert bounds(root, (4.0, 6.0)) == (above, above)
    assert bounds(root, (2.0, 4.0)) == (1.0, 5.0)


def test_conditions_joined():
    less, more = x.compare("<", V, x.const(3.0)), x.compare(">", V, x.const(1.0))

    def told(test, given):
        return bounds(x.conditional(test, x.const(1.0), x.const(5.0)), given)

    assert told(x.both(less, more), (1.5, 2.5)) == (1.0, 1.0)
    assert told(x.both(less, more), (4.0, 5.0)) == (5.0, 5.0)
    assert told(x.either(less, more), (4.0, 5.0)) == (1.0, 1.0)
    assert told(x.negate(x.either(less, more)), (4.0, 5.0)) == (5.0, 5.0)
    assert told(x.both(less, more), (2.0, 4.0)) == (1.0, 5.0)


ONE = ["sin", "cos", "exp", "ln", "atan", "tanh", "asinh", "sinh", "cosh", "abs", "sign", "floor", "ceil", "step"]
TWO = ["min", "max", "mod", "hypot", "atan2"]


def random_expression(random, depth):
    if depth == 0:
        return [V, W, V, x.const(float(random.integers(-2, 3)))][random.integers(4)]
    left, right = (random_expression(random, depth - 1) for _ in range(2))
    match random.integers(7):
        case 0:
            return x.linear(float(random.integers(-1, 2)), [(-1.5, left), (2.0, right)])
        case 1:
            return x.mul(left, right)
        case 2:
            return x.power(left, x.const(float(random.choice([-2.0, -1.0, 0.5, 2.0, 3.0]))))
        case 3:
            return x.call(str(random.choice(ONE)), left)
        case 4:
            return x.call(str(random.choice(TWO)), left, right)
        case 5:
            return x.power(left, random.choice([N, right]))
        case _:
            return x.conditional(x.compare(str(random.choice(["<", ">=", "==", "!="])), left, right), right, left)


@pytest.mark.parametrize("seed", range(150))
def test_no_value_lies_outside(seed):
    random = np.random.default_rng(seed)
    root = random_expression(random, int(random.integers(1, 4)))
    ranges = [tuple(float(v) for v in np.sort(random.uniform(-3.0, 3.0, 2))) for _ in range(2)]
    low, high = bounds(root, *ranges)
    for k in range(60):
        v, w = (r[k % 2] if k < 4 else random.uniform(*r) for r in ranges)
        try:
            value = evaluate([root], lambda n, v=v, w=w: {V: v, W: w, N: 2.0}[n])[0]
        except (ValueError, ZeroDivisionError, OverflowError, TypeError):
            continue
        if not isinstance(value, complex) and math.isfinite(value):
            room = 1e-12 * max(1.0, abs(value))
            assert low - room <= value <= high + room, (to_text(root), v, w)


def test_bounds_shrink_to_the_values_as_intervals_do():
    """t sin t over cells of 1/n: wider than its range by a part of the width (inclusion is of first order)."""
    t = x.time()
    root = x.mul(t, x.call("sin", t))
    excess = []
    for n in (100, 1000):
        ends = np.linspace(0.0, 6.0, n + 1)
        low, high = enclose(root, ends[:-1], ends[1:], lambda nodes: [np.array(float(v.data)) for v in nodes], {})
        inside = np.linspace(ends[:-1], ends[1:], 21)
        values = inside * np.sin(inside)
        assert (low <= values.min(axis=0) + 1e-12).all()
        assert (high >= values.max(axis=0) - 1e-12).all()
        excess.append(np.abs((high - low) - np.ptp(values, axis=0)).max())
    assert 5.0 < excess[0] / excess[1] < 20.0


ENDS = (-INF, -1e308, -2.0, -1e-200, -0.0, 0.0, 5e-324, 1e-200, 0.75, 3.0, 1e308, INF)
SINGLE = {
    "a product": x.mul(V, W),
    "a quotient": x.div(V, W),
    "one over both": x.div(x.const(1.0), x.mul(V, W)),
    "three factors": x.mul(V, W, N),
    "a difference": x.linear(0.0, [(1.0, V), (-3.0, W)]),
    "a sum with a constant": x.linear(-1.0, [(1e10, V), (1e308, W)]),
    "exp": called("exp", V),
}


@pytest.mark.parametrize("name", SINGLE)
@pytest.mark.long
def test_plain_numbers_bound_an_operation_as_arrays_do(name):
    root = SINGLE[name]
    ranges = [(low, high) for low in ENDS for high in ENDS if low <= high] + [(math.nan, math.nan)]
    alone = 0
    for a in ranges:
        for b in ranges:
            args = [a, b, (1e-200, 1e200)][: len(root.args)]
            found = _single(root, args)
            alone += found is not None
            assert found is None or found == _as_arrays(root, args)
    assert alone
