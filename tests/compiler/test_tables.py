"""Tables against SciPy, in the interpreter and in both carriers."""

import numpy as np
import pytest
from carriers import CCarrier, NumpyCarrier
from catalogue import ONE, PLACE
from chains import blank, coordinate
from scipy.interpolate import CubicSpline, PchipInterpolator, RegularGridInterpolator
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.model.tables import evaluate
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import EnergyTerm, Observation, Table

X = (0.0, 0.3, 1.0, 1.2, 2.5, 3.0)
Z = (1.0, 2.0, 2.5, 0.5, 0.25, 4.0)
INSIDE = np.linspace(0.0, 2.999, 400)
METHODS = {
    "linear": lambda a, b: lambda u, k: np.interp(u, a, b) if k == 0 else None,
    "pchip": PchipInterpolator,
    "cubic": CubicSpline,
}


@pytest.mark.parametrize("size", [2, 3, 4, 6])
@pytest.mark.parametrize("method", ["linear", "pchip", "cubic"])
def test_interpolants_are_scipy_s(method, size):
    a, b = np.array(X[:size]), np.array(Z[:size])
    u = np.linspace(a[0], np.nextafter(a[-1], 0), 301)
    table = Table("f", method, "clamp", (tuple(a),), tuple(b), PLACE)
    expected = METHODS[method](a, b)
    for order in (0,) if method == "linear" else (0, 1, 2, 3):
        if order < 3:
            np.testing.assert_allclose(evaluate(table, [u], (order,)), expected(u, order), rtol=1e-11, atol=1e-10)
        else:
            np.testing.assert_allclose(evaluate(table, [u], (order,)), expected(u, order), rtol=1e-9, atol=1e-8)


def test_hold_is_the_last_node_at_or_before():
    table = Table("f", "hold", "clamp", (X,), Z, PLACE)
    np.testing.assert_array_equal(
        evaluate(table, [np.array([-1.0, 0.0, 0.29, 0.3, 2.99, 3.0, 9.0])], (0,)), [1, 1, 1, 2, 0.25, 4, 4]
    )


@pytest.mark.parametrize("method", ["linear", "pchip", "cubic"])
def test_outside(method):
    clamp = Table("f", method, "clamp", (X,), Z, PLACE)
    extend = Table("f", method, "extend", (X,), Z, PLACE)
    u = np.array([-0.5, 3.5])
    np.testing.assert_array_equal(evaluate(clamp, [u], (0,)), [Z[0], Z[-1]])
    np.testing.assert_array_equal(evaluate(clamp, [u], (1,)), [0, 0])
    slopes = evaluate(extend, [np.array([0.0, np.nextafter(3.0, 0)])], (1,))
    np.testing.assert_allclose(
        evaluate(extend, [u], (0,)), [Z[0] - 0.5 * slopes[0], Z[-1] + 0.5 * slopes[1]], rtol=1e-12
    )


def model_of(tables, energy, observed=()):
    return blank(
        tables=tables,
        coordinates=(coordinate("a"), coordinate("b")),
        energies=(
            EnergyTerm("T*", energy, (), PLACE),
            EnergyTerm("V", x.power(x.var("a", "q"), x.const(2)), (), PLACE),
        ),
        observations=tuple(Observation(f"o{k}", o, ONE, "o", PLACE) for k, o in enumerate(observed)),
    )


@pytest.mark.parametrize("outside", ["clamp", "extend"])
@pytest.mark.parametrize("method", ["linear", "pchip", "cubic", "hold"])
@pytest.mark.one_in(4)
def test_carriers(method, outside, tmp_path):
    """T* = 1/2 L(q) f^2 with L a table: its derivatives enter rows and entries."""
    with x.fresh():
        a, fa, fb = x.var("a", "q"), x.var("a", "f"), x.var("b", "f")
        tables = (
            Table("L", method, outside, (X,), Z, PLACE),
            Table("M", "linear", outside, ((0.0, 1.0, 2.0), (0.0, 0.5)), (1.0, 2.0, 3.0, 5.0, 8.0, 4.0), PLACE),
        )
        both = x.mul(x.table("M", a, x.var("b", "q")), fb, fb)
        model = compile_network(model_of(tables, x.add(x.mul(x.table("L", a), fa, fa), both), (x.table("L", a),)))
        binding = model.bind()
        oracle = Oracle(model.form, binding)
        carriers = [CCarrier(model.program, model.form, binding)]
        carriers.append(NumpyCarrier(model.program, model.form, binding, tmp_path))
        for where, other in ((-0.5, 0.2), (0.0, 0.5), (0.3, 0.1), (0.7, -1.0), (1.7, 0.7), (3.0, 0.3), (4.0, 0.0)):
            y = np.array([where, other, 0.4, 0.6, *np.ones(20)])[: oracle.at[-1]]
            yd = np.linspace(0.3, 0.9, oracle.at[-1])
            for carrier in carriers:
                for block in ("dynamics", "audit", "observe"):
                    np.testing.assert_allclose(
                        carrier.rows(block, 0.0, y, yd), oracle.rows(block, 0.0, y, yd), rtol=1e-12, atol=1e-12
                    )
                for order, part in enumerate(("dy", "dyd")):
                    v, _, _ = oracle.entries("dynamics", order, 0.0, y, yd)
                    np.testing.assert_allclose(carrier.entries("dynamics", part, 0.0, y, yd), v, rtol=1e-12, atol=1e-11)


def test_bilinear_is_scipy_s():
    axes = ((0.0, 1.0, 2.0), (0.0, 0.5))
    values = (1.0, 2.0, 3.0, 5.0, 8.0, 4.0)
    table = Table("M", "linear", "clamp", axes, values, PLACE)
    expected = RegularGridInterpolator(axes, np.reshape(values, (3, 2)))
    u, w = np.random.default_rng(1).uniform(0, [[2], [0.5]], (2, 50))
    np.testing.assert_allclose(evaluate(table, [u, w], (0, 0)), expected(np.stack((u, w), axis=1)), rtol=1e-13)


def test_points_are_run_time_values():
    """The text does not depend on a table's method, size or numbers."""

    def text(table):
        with x.fresh():
            return compile_network(
                model_of((table,), x.mul(x.table("L", x.var("a", "q")), x.var("a", "f"), x.var("b", "f")))
            ).text

    one = text(Table("L", "pchip", "clamp", (X,), Z, PLACE))
    assert one == text(Table("L", "linear", "extend", ((0.0, 1.0),), (1.0, 2.0), PLACE))
