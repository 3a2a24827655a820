"""Where laws begin and end that are nothing but within a narrow range, against closed forms."""

import math

import numpy as np
import pytest
from sysdyn.compiler.forms.corners.peaks import FADES, FEW, FLAT, _hidden
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Table

pytestmark = pytest.mark.usefixtures("fresh")

AT, WIDE = 0.3, 1e-3
"""Where a peak stands, and its width."""


def apart():
    """(x - AT)/WIDE."""
    return ex.linear(-AT / WIDE, [(1.0 / WIDE, ex.var("x", "q"))])


def square():
    return ex.power(apart(), ex.const(2.0))


def value(node, x):
    return float(evaluate([node], {ex.var("x", "q"): x}.__getitem__)[0])


PEAKS = {
    "a Gaussian": (lambda: ex.call("exp", ex.neg(square())), math.sqrt(FADES), math.exp(-FADES)),
    "one that is higher": (
        lambda: ex.call("exp", ex.linear(3.0, [(-1.0, square())])),
        math.sqrt(FADES),
        math.exp(-FADES),
    ),
    "a power of two": (
        lambda: ex.power(ex.const(2.0), ex.neg(square())),
        math.sqrt(FADES / math.log(2.0)),
        math.exp(-FADES),
    ),
    "a soliton": (lambda: ex.power(ex.call("cosh", apart()), ex.const(-2.0)), math.sqrt(FLAT), 4.0 * math.exp(-24.0)),
    "a resonance": (
        lambda: ex.power(ex.linear(1.0, [(1.0, square())]), ex.const(-3.0)),
        FEW ** (1.0 / 6.0),
        1.0 / FEW,
    ),
    "a power of a cosine": (
        lambda: ex.power(ex.call("cos", ex.scale(0.1, apart())), ex.const(100.0)),
        10.0 * math.asin(math.sqrt(0.72)),
        0.28**50.0,
    ),
}


@pytest.mark.parametrize("name", PEAKS)
def test_a_peak_begins_and_ends_where_nothing_is_left_of_it(name):
    law, half, left = PEAKS[name]
    law = law()
    ((u, passage),) = _hidden(law, {}, watched=False)
    top = value(law, AT)
    for side in (-1.0, 1.0):
        end = AT + side * half * WIDE
        assert abs(value(u, end)) < 1e-6 * value(u, AT)
        assert value(u, end - side * 0.01 * WIDE) > 0.0 > value(u, end + side * 0.01 * WIDE)
        assert value(law, end) <= 1.01 * left * top
    assert 0.0 < value(u, AT) <= passage


@pytest.mark.parametrize(
    "law",
    [
        lambda x: ex.call("exp", x),
        lambda x: ex.call("exp", ex.neg(ex.power(x, ex.const(3.0)))),
        lambda x: ex.power(ex.call("cos", x), ex.const(4.0)),
        lambda x: ex.power(ex.linear(-1.0, [(1.0, ex.power(x, ex.const(2.0)))]), ex.const(-3.0)),
        lambda x: ex.power(ex.call("cosh", x), ex.const(2.0)),
    ],
    ids=["an exponential", "an odd power", "a wide cosine", "a pole", "what grows"],
)
def test_what_is_no_peak_hides_nothing(law):
    assert not list(_hidden(law(apart()), {}, watched=False))


def test_beside_a_swing_a_peak_is_as_wide_as_it_may_become():
    """exp(2 sin x - q): nothing is left of its largest, e^2, where q is FADES + 4."""
    x = ex.var("x", "q")
    law = ex.call("exp", ex.linear(0.0, [(2.0, ex.call("sin", x)), (-1.0, square())]))
    ((u, _),) = _hidden(law, {}, watched=False)
    for side in (-1.0, 1.0):
        outer = AT + side * WIDE * math.sqrt(FADES + 4.0)
        assert value(u, outer) < 1e-9
        assert value(law, AT + side * WIDE * 1e3) <= value(law, outer) <= math.exp(2.0 - FADES)


def test_narrow_cells_of_a_table_are_a_peak():
    points = (0.0, 1.0, 2.0, 2.01, 2.02, 3.0, 4.0)
    table = Table("T", "linear", "clamp", (points,), (0.0, 0.1, 0.2, 5.0, 0.2, 0.1, 0.0), None)
    ((u, _),) = _hidden(ex.table("T", ex.var("x", "q")), {"T": table}, watched=False)
    at = np.linspace(0.0, 4.0, 4001)
    inside = [x for x in at if value(u, x) > 0.0]
    assert min(inside) == pytest.approx(2.0, abs=2e-3)
    assert max(inside) == pytest.approx(2.02, abs=2e-3)
