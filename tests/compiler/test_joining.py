"""Like terms joined: what a book would write, and an expression of the same value."""

import math

import numpy as np
import pytest
from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.joining import collect_terms, shorter, shortest
from sysdyn.compiler.equations.order import FactorOrder
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression_text import to_text

PARAMETERS = ("m", "l", "J")

pytestmark = pytest.mark.usefixtures("fresh")


def algebra():
    return Algebra(FactorOrder(PARAMETERS), map(x.param, PARAMETERS))


def leaves():
    m, l, j = map(x.param, PARAMETERS)
    return m, l, j, x.var("a", "q"), x.var("a", "f"), x.var("b", "f"), x.var("a", "f", order=1), x.var("r", "kappa")


def value(node, numbers):
    return evaluate([node], lambda leaf: numbers[leaf])[0]


def texts(terms):
    return [to_text(t) for t in terms]


def test_inertias_of_one_rate_are_one():
    m, l, j, a, _, _, rate, _ = leaves()
    root = x.add(x.mul(m, l, l, rate), x.mul(j, rate), x.mul(m, x.param("g"), l, x.call("sin", a)))
    first, rest = collect_terms(algebra(), root)
    assert x.variables(rest) >= {a}
    assert rate in x.variables(first)
    assert value(first, {m: 2.0, l: 3.0, j: 5.0, rate: 1.0}) == 23.0
    assert texts([first]) in (["(m*l^2 + J)*a''"], ["(J + m*l^2)*a''"])


@pytest.mark.long
def test_squares_of_sine_and_cosine_are_one():
    m, _, _, a, _, _, rate, _ = leaves()
    squares = x.add(x.power(x.call("sin", a), x.const(2.0)), x.power(x.call("cos", a), x.const(2.0)))
    assert texts(collect_terms(algebra(), x.mul(m, squares, rate))) == ["m*a''"]


def test_rates_come_first_then_multipliers_then_flows():
    m, l, _, a, f, other, rate, kappa = leaves()
    root = x.add(x.mul(l, f), x.mul(m, x.sub(rate, rate)), x.mul(m, kappa), x.mul(l, rate), x.mul(a, f, other), a)
    found = collect_terms(algebra(), root)
    assert [sorted(n.data[1:] for n in x.variables(t) if n.op == "var") for t in found] == [
        [("f", 1)], [("kappa", 0)], [("f", 0), ("f", 0), ("q", 0)], [("f", 0)], [("q", 0)],
    ]  # fmt: skip


def test_what_cancels_is_gone():
    m, _, _, a, f, *_ = leaves()
    assert collect_terms(algebra(), x.sub(x.mul(x.add(m, a), f), x.add(x.mul(m, f), x.mul(a, f)))) == ()
    assert collect_terms(algebra(), x.const(0.0)) == ()


CALLS = ["sin", "cos", "tan", "exp", "atan", "sinh", "cosh", "tanh", "abs", "sign"]


def random_expression(random, depth, own):
    if depth == 0:
        return own[random.integers(len(own))] if random.random() < 0.9 else x.const(float(random.integers(-3, 4)))
    one, two = (random_expression(random, depth - 1, own) for _ in range(2))
    match random.integers(6):
        case 0 | 1:
            return x.linear(float(random.integers(-1, 2)), [(float(random.choice([-2.0, 0.5, 1.0])), one), (1.0, two)])
        case 2 | 3:
            return x.mul(one, two)
        case 4:
            return x.power(one, x.const(float(random.choice([-1.0, 2.0, 0.5, -2.0]))))
        case _:
            return x.call(str(random.choice(CALLS)), one)


@pytest.mark.parametrize("arrow", [collect_terms, shorter])
@pytest.mark.parametrize("seed", range(40))
@pytest.mark.one_in(5)
def test_the_terms_are_worth_what_was_joined(seed, arrow):
    random = np.random.default_rng(seed)
    own = leaves()
    root = x.add(*(random_expression(random, int(random.integers(1, 4)), own) for _ in range(3)))
    terms = arrow(algebra(), root)
    for _ in range(4):
        numbers = dict(zip(own, (float(v) for v in random.uniform(0.3, 1.5, len(own))), strict=True))
        try:
            exact = value(root, numbers)
        except (ValueError, ZeroDivisionError, TypeError):
            continue
        if isinstance(exact, complex) or not math.isfinite(exact):
            continue
        parts = [value(t, numbers) for t in terms]
        assert sum(parts) == pytest.approx(exact, rel=1e-8, abs=1e-9 * sum(map(abs, parts))), to_text(root)


@pytest.mark.parametrize("power", [False, True])
def test_a_fast_exponential_is_no_polynomial_of_its_degree(power):
    """exp(-t/(0.1 ms)) and a power to nine digits: as polynomials of degree 9999 and 141421356 they end never."""
    m, _, _, a, *_ = leaves()
    fast = x.power(x.add(a, x.const(1.0)), x.const(1.41421356)) if power else x.call("exp", x.mul(x.const(-9999.0), a))
    root = x.sub(x.mul(m, fast), m)
    terms = algebra()
    short = terms.node(shortest(terms, terms.object(root)))
    numbers = {m: 2.0, a: 1e-5}
    assert value(short, numbers) == pytest.approx(value(root, numbers), rel=1e-12)
