"""Where a text bends or jumps, against what is known of the functions: their one-sided values and slopes."""

import numpy as np
import pytest
from sysdyn.compiler.forms.corners.broken import broken
from sysdyn.compiler.forms.corners.kinks import JUMPS, KINK, SMOOTH, side, smoothness
from sysdyn.compiler.model.tables import evaluate as evaluate_table
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Table

pytestmark = pytest.mark.usefixtures("fresh")


def q():
    return x.var("a", "q")


def f():
    return x.var("a", "f")


def past(level):
    return x.compare(">", q(), x.const(level))


def beyond():
    return x.sub(q(), x.param("p"))


def far_off():
    return x.sub(x.param("far"), x.const(1e5))


def far():
    return x.compare(">", far_off(), x.const(0.0))


def mode(number):
    return x.compare("==", x.param("mode"), x.const(number))


CASES = {
    "drag": (lambda: x.mul(f(), x.call("abs", f())), f, SMOOTH),
    "a size": (lambda: x.call("abs", f()), f, KINK),
    "a cubed size": (lambda: x.power(x.call("abs", f()), x.const(3.0)), f, SMOOTH),
    "friction": (lambda: x.mul(q(), x.call("sign", f())), f, JUMPS),
    "friction against its own flow": (lambda: x.mul(f(), x.call("sign", f())), f, KINK),
    "a stop": (lambda: x.call("max", q(), x.const(0.0)), q, KINK),
    "a soft stop": (lambda: x.power(x.call("max", q(), x.const(0.0)), x.const(2.0)), q, SMOOTH),
    "springs that meet": (lambda: x.conditional(past(2.0), x.linear(-4.0, [(3.0, q())]), q()), None, KINK),
    "springs that do not": (lambda: x.conditional(past(2.0), x.scale(3.0, q()), q()), None, JUMPS),
    "a spring that goes on": (lambda: x.conditional(past(2.0), x.scale(3.0, q()), x.scale(3.0, q())), None, SMOOTH),
    "the larger of two": (lambda: x.call("max", q(), f()), lambda: x.sub(q(), f()), KINK),
    "a step at a parameter": (lambda: x.call("step", beyond()), beyond, JUMPS),
    "a flat beginning": (lambda: x.mul(x.call("step", beyond()), x.mul(beyond(), beyond())), beyond, SMOOTH),
    "a step beside another": (lambda: x.conditional(x.both(past(2.0), far()), x.const(0.0), f()), None, JUMPS),
    "a step within another": (lambda: x.mul(x.call("step", far_off()), x.call("step", beyond())), beyond, JUMPS),
    "a step in one mode": (lambda: x.conditional(x.both(past(2.0), mode(2.0)), x.const(0.0), f()), None, JUMPS),
    "a later piece": (lambda: x.conditional(past(2.0), x.conditional(past(3.0), past(4.0), q()), q()), None, SMOOTH),
    "a rectified wave": (lambda: x.call("abs", x.call("sin", q())), lambda: x.call("sin", q()), KINK),
}


@pytest.mark.parametrize("name", CASES)
def test_the_least_derivative_that_jumps(name):
    made, surface, level = CASES[name]
    u = x.sub(q(), x.const(2.0)) if surface is None else surface()
    assert smoothness(made(), u) == level


def test_a_side_is_one_branch_everywhere():
    """|f| f + max(f, q): on the one side of f = 0 f^2, on the other -f^2; the maximum is of another surface."""
    rest = x.call("max", f(), q())
    root = x.add(x.mul(f(), x.call("abs", f())), rest)
    for above, sign in ((True, 1.0), (False, -1.0)):
        assert side(root, f(), above) is x.add(x.scale(sign, x.mul(f(), f())), rest)
    apart = x.sub(f(), q())
    for name, larger, smaller in (("max", f(), q()), ("min", q(), f())):
        assert [side(x.call(name, f(), q()), apart, above) for above in (True, False)] == [larger, smaller]


POINTS, VALUES = (-1.0, 0.5, 2.0, 4.0), (3.0, -1.0, 0.0, 5.0)
BESIDE = np.linspace(-2.0, 5.0, 141)


PIECES = [("linear", "clamp"), ("linear", "extend"), ("hold", "clamp"), ("hold", "extend"), ("pchip", "clamp")]


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize(("method", "outside"), PIECES)
def test_a_table_in_pieces_reads_as_the_table(method, outside, order):
    table = Table("T", method, outside, (POINTS,), VALUES, None)
    whole = x.table("T", q(), order=order)
    root = broken(whole, {"T": table})
    assert root is not whole
    places = BESIDE + 0.003 * order  # slopes at the points are of one side

    def known(at, order):
        return float(evaluate_table(table, [np.array([at])], (order,))[0])

    def leaf(node, at):
        return known(at, node.data[1]) if node.op == "table" else at

    found = [evaluate([root], lambda node, at=at: leaf(node, at))[0] for at in places]
    assert found == pytest.approx([known(at, order) for at in places], rel=1e-13, abs=1e-13)
    if (method, outside, order) == ("linear", "clamp", 0):
        assert found == pytest.approx(np.interp(BESIDE, POINTS, VALUES))
