"""Which rows are steep, and what they are judged against."""

import math

import pytest
from sysdyn.compiler.forms.steepness import magnitude, steep
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate

pytestmark = pytest.mark.usefixtures("fresh")


def unknown(name):
    return ex.var(name, "f")


@pytest.mark.parametrize(
    ("make", "wanted"),
    [
        (lambda x: ex.mul(x, ex.call("sin", x)), False),
        (lambda x: ex.product(1.0, ((-2.0, x),)), False),
        (lambda x: ex.sqrt(ex.add(ex.const(1.0), ex.mul(x, x))), False),
        (lambda x: ex.call("exp", ex.time()), False),
        (lambda x: ex.call("exp", x), True),
        (lambda x: ex.call("tanh", ex.mul(x, ex.param("k"))), True),
        (lambda x: ex.table("f", x), True),
        (lambda x: ex.conditional(ex.compare("<", x, ex.const(0.0)), ex.const(0.0), x), True),
    ],
)
def test_steep(make, wanted):
    assert steep(make(unknown("x"))) is wanted


def test_the_magnitude_is_never_a_difference():
    i, v, w, saturation = unknown("i"), unknown("v"), unknown("w"), ex.param("Is")
    # i - Is (exp(v - w) - 1) at a point where all of it cancels
    law = ex.sub(i, ex.mul(saturation, ex.sub(ex.call("exp", ex.sub(v, w)), ex.const(1.0))))
    values = {i: 1e-3 * (math.exp(0.5) - 1.0), v: 2.5, w: 2.0, saturation: 1e-3}
    row, scale = evaluate([law, magnitude(law)], lambda node: values[node])
    assert row == pytest.approx(0.0, abs=1e-18)
    assert scale == pytest.approx(values[i] + 1e-3 * (math.exp(0.5) + 1.0), rel=1e-12)
