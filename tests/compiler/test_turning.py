"""Where what is watched may turn or jump: zeros of the functions that a step ends at, as numbers."""

import math

import numpy as np
import pytest
from sysdyn.compiler.forms.corners.turning import NEAR, RISEN, rising, turning, turns_in_conditions
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate

X = ex.var("x", "q")


def value(node, x):
    return evaluate([node], {X: x}.__getitem__)[0]


def zeros(node, first, last):
    """Where a function of x changes its sign within a range, by bisection."""
    at = np.linspace(first, last, 2001)
    values = [value(node, x) for x in at]
    found = []
    for k in np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:])):
        one, other = at[k], at[k + 1]
        for _ in range(60):
            middle = 0.5 * (one + other)
            same = np.sign(value(node, middle)) == np.sign(value(node, one))
            one, other = (middle, other) if same else (one, middle)
        found.append(one)
    return found


@pytest.mark.parametrize(
    ("node", "turns"),
    [
        (ex.call("abs", ex.sub(X, ex.const(0.3))), [0.3]),
        (ex.power(ex.call("sin", ex.scale(math.pi, X)), ex.const(40.0)), [0.5]),
        (ex.product(1.0, ((1.0, ex.sub(X, ex.const(0.2))), (1.0, ex.sub(X, ex.const(0.7))))), [0.2, 0.7]),
    ],
)
def test_it_is_largest_at_a_zero_or_between_two(node, turns):
    found = sorted(z for one in turning(node) for z in zeros(one, 0.05, 0.95))
    assert found == pytest.approx(turns, abs=1e-12)


def test_whole_numbers_are_met_from_both_sides():
    node = ex.call("floor", X)
    one, other = (z[0] for z in (zeros(n, 0.9, 1.1) for n in turning(node)))
    assert abs(abs(one - other) - 2.0 * NEAR / math.pi) < 1e-12
    assert 0.5 * (one + other) == pytest.approx(1.0, abs=1e-12)
    assert len([*turns_in_conditions(ex.compare("<", node, ex.const(2.0)))]) == 2


def test_of_what_rises_at_once_two_make_a_moment_and_one_does_not():
    steps = [ex.call("tanh", ex.scale(1e4, ex.sub(X, ex.const(c)))) for c in (0.3, 0.31)]
    assert list(rising(steps[0])) == []
    found = list(rising(ex.sub(*steps)))
    assert [until for _, until in found] == [RISEN, RISEN]
    assert sorted(value(square, 0.3) for square, _ in found) == pytest.approx([0.0, 1e4], abs=1e-6)
