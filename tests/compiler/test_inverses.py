"""Which laws are inverted, and that law and inverse undo each other."""

import numpy as np
import pytest
from sysdyn.compiler.model.interpret import evaluate
from sysdyn.compiler.model.tables import evaluate as evaluate_table
from sysdyn.compiler.network.primal.integrals import antiderivative
from sysdyn.compiler.network.primal.inverses import inverse
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.network import Table
from sysdyn.dsl.model.signs import ALL, NEGATIVE, NOT_NEGATIVE, POSITIVE, Reals, reals

VALUES = {"a": 2.0, "b": 0.025, "k": 3.0, "n": -1.5, "z": 0.0}
A, B, K, N, Z = (x.param(name) for name in VALUES)


class _Slopes:
    def values(self, branch, node):
        return np.array([float(evaluate([node], lambda leaf, args: VALUES[leaf.data])[0])])


pytestmark = pytest.mark.usefixtures("fresh")


def given():
    return x.var("D", "be")


def call(name, *args):
    return x.call(name, *args)


def over(v, scale):
    return x.div(v, scale)


def one(*nodes):
    return x.linear(1.0, ((1.0, n) for n in nodes))


def root(v):
    return x.mul(call("sign", v), x.sqrt(call("abs", v)))


LINEAR = ((-2.0, -1.0, 0.0, 3.0), (-5.0, -1.0, 0.5, 1.0))


def a_table(method="linear", outside="extend", values=LINEAR[1], name="T"):
    return Table(name, method, outside, (LINEAR[0],), values, None)


TABLES = (
    a_table(),
    a_table(values=LINEAR[1][::-1], name="falling"),
    a_table(values=(0.0, 1.0, 1.0, 2.0), name="flat"),
    a_table(outside="clamp", name="clamp"),
    a_table("pchip", name="pchip"),
    a_table("hold", name="hold"),
)
YES = {
    "a sinh(e/b)": lambda v: x.mul(A, call("sinh", over(v, B))),
    "n sinh(e/b) + k": lambda v: x.add(x.mul(N, call("sinh", over(v, B))), K),
    "a asinh(e/b)": lambda v: x.mul(A, call("asinh", over(v, B))),
    "b ln(1 + f/a)": lambda v: x.mul(B, call("ln", one(over(v, A)))),
    "a atanh(f/b)": lambda v: x.mul(A, call("atanh", over(v, B))),
    "sinh of asinh's": lambda v: call("sinh", x.scale(0.5, call("asinh", x.mul(N, v)))),
    "sign sqrt": lambda v: x.mul(A, root(v)),
    "e/|e|^(1/2)": lambda v: x.mul(N, x.div(v, x.sqrt(over(call("abs", v), B)))),
    "e/|e|^(2/3)": lambda v: x.div(v, x.power(call("abs", v), x.const(0.75))),
    "m f/sqrt(1 - f^2/c^2)": lambda v: x.mul(
        A, x.div(v, x.sqrt(x.sub(x.const(1.0), x.power(over(v, K), x.const(2.0)))))
    ),
    "n f/sqrt(1 - f^2/n^2)": lambda v: x.mul(
        N, x.div(v, x.sqrt(x.sub(x.const(1.0), x.power(over(v, N), x.const(2.0)))))
    ),
    "a f + k f |f|": lambda v: x.add(x.mul(A, v), x.mul(K, v, call("abs", v))),
    "-a f - k f |f|": lambda v: x.neg(x.add(x.mul(A, v), x.mul(K, v, call("abs", v)))),
    "f sqrt(1 + f^2)": lambda v: x.mul(A, v, x.sqrt(one(x.mul(v, v)))),
    "table": lambda v: x.mul(N, x.table("T", over(v, K))),
    "falling table": lambda v: x.table("falling", over(v, K)),
}
NO = {
    "diode f(e)": lambda v: x.mul(A, x.sub(call("exp", over(v, B)), x.const(1.0))),
    "tanh": lambda v: x.mul(A, call("tanh", over(v, B))),
    "tan": lambda v: call("tan", v),
    "f/sqrt(1 + f^2)": lambda v: x.div(v, x.sqrt(one(x.mul(v, v)))),
    "f|f|: no slope at 0": lambda v: x.mul(K, v, call("abs", v)),
    "f^3": lambda v: x.mul(v, v, v),
    "a f + k f^3: Cardano": lambda v: x.add(x.mul(A, v), x.mul(K, v, v, v)),
    "a f + n f |f|": lambda v: x.add(x.mul(A, v), x.mul(N, v, call("abs", v))),
    "a f + z f |f|": lambda v: x.add(x.mul(A, v), x.mul(Z, v, call("abs", v))),
    "z sinh f": lambda v: x.mul(Z, call("sinh", v)),
    "sqrt: half the values": x.sqrt,
    "even": lambda v: x.mul(v, v),
    "1/f": lambda v: x.div(A, v),
    "f - 1/f": lambda v: x.sub(v, x.div(x.const(1.0), v)),
    "ln f + f": lambda v: x.add(call("ln", v), v),
    "conditional": lambda v: x.conditional(x.compare("<", v, x.const(0.0)), v, x.scale(2.0, v)),
    "flat table": lambda v: x.table("flat", v),
    "clamped table": lambda v: x.table("clamp", v),
    "pchip table": lambda v: x.table("pchip", v),
    "hold table": lambda v: x.table("hold", v),
}


def at(node, name, values, tables=TABLES):
    held = {t.name: t for t in tables}

    def lookup(leaf, args):
        if leaf.op == "table":
            return evaluate_table(held[leaf.data[0]], args, (leaf.data[1],))
        return values if leaf is name else VALUES[leaf.data]

    return evaluate([node], lookup)[0]


@pytest.mark.parametrize("name", YES)
@pytest.mark.one_in(3)
def test_inverted(name):
    v, w = given(), x.var("D", "bf")
    law = YES[name](v)
    found = inverse(None, law, v, w, _Slopes(), TABLES)
    assert found is not None
    points = np.concatenate([s * 10.0 ** np.arange(-8.0, 1.0) for s in (-1.0, 1.0)])
    values = at(law, v, points)
    kept = np.isfinite(values)
    again = at(found.expression, w, values[kept], (*TABLES, *found.tables))
    assert again == pytest.approx(points[kept], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", NO)
def test_not_inverted(name):
    v, w = given(), x.var("D", "bf")
    assert inverse(None, NO[name](v), v, w, _Slopes(), TABLES) is None


def test_intervals_hold_what_they_enclose():
    u, p, n = (x.param(name) for name in "upn")
    known = {u: ALL, p: POSITIVE, n: NEGATIVE}
    square = x.mul(u, u)
    assert reals(square, known) == NOT_NEGATIVE
    assert reals(one(square), known) == Reals(1.0, np.inf, True)
    assert reals(x.add(square, p), known).sign == 1
    assert reals(x.add(square, n), known).sign == 0
    assert reals(x.div(p, n), known).sign == -1
    assert reals(x.power(n, x.const(-2.0)), known).sign == 1
    assert reals(x.power(u, x.const(-1.0)), known) == Reals(-np.inf, np.inf, True)
    assert reals(x.power(u, x.const(-1.5)), known).sign == 1  # where it is defined
    assert reals(call("exp", u), known).sign == 1
    far = known | {u: Reals(1e200, 2e200, True)}  # powers beyond doubles
    assert reals(x.power(u, x.const(3.0)), far).sign == 1
    assert reals(x.sub(x.power(u, x.const(-2.0)), x.power(u, x.const(4.0))), far).sign == -1
    assert reals(call("sin", u), known) == Reals(-1.0, 1.0)
    assert reals(call("tan", u), known) == ALL
    choice = x.conditional(x.compare("<", u, x.const(0.0)), p, x.const(-2.0))
    assert reals(choice, known) == Reals(-2.0, np.inf, True)
    assert reals(x.power(one(square), x.const(-1.0)), known) == Reals(0.0, 1.0, True)


@pytest.mark.parametrize(
    "integrand",
    [
        lambda v: call("exp", x.mul(K, v)),
        lambda v: x.mul(A, call("sinh", over(v, K))),
        lambda v: call("cosh", one(v)),
        lambda v: x.add(call("sin", v), call("cos", v), x.mul(v, v)),
        lambda v: call("asinh", x.mul(N, v)),
        lambda v: call("atan", x.mul(A, v)),
        lambda v: x.mul(A, x.div(v, x.sqrt(one(x.mul(K, v, v))))),
    ],
)
def test_antiderivatives(integrand):
    v, rests = given(), []
    root = integrand(v)
    found = antiderivative(root, v, rests)
    points = np.linspace(-0.4, 0.4, 9)
    assert at(derivative(found, v), v, points) == pytest.approx(at(root, v, points), rel=1e-12, abs=1e-15)
    assert at(found, v, np.zeros(1)) == pytest.approx(0.0, abs=1e-15)
    assert rests
