"""Numbers of parameters before anything is bound, and quasi-velocities as what they multiply."""

import math

import pytest
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import ElementSetting, Loop, Parameter
from sysdyn.dsl.model.quasi import NotLinearError, virtual
from sysdyn.dsl.model.units import Unit
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.text.diagnostics import SourceText

PLACE = SourceText("values", "model\n").place(0, 5)
ONE = Unit((), 1.0, "1")


@pytest.fixture(autouse=True)
def fresh():
    with x.fresh():
        yield


def parameter(name, *values, shape=(), indices=()):
    nodes = tuple(v if isinstance(v, x.Node) else x.const(v) for v in values)
    return Parameter(name, shape, ONE, nodes, indices, PLACE)


def test_elements_follow_from_formulas_lists_and_settings():
    """n = 3, b = n + 1; c[i] = b i^2, d = [10, 20, 30] from index 0; c[2] is set to 7."""
    n, i = x.param("n"), x.index("i")
    made = [
        parameter("n", 3.0),
        parameter("b", x.add(n, x.const(1))),
        parameter("c", x.mul(x.param("b"), x.power(i, x.const(2))), shape=((x.const(1), n),), indices=("i",)),
        parameter("d", 10.0, 20.0, 30.0, shape=((x.const(0), x.const(2)),)),
        parameter("open"),
    ]
    values = Values({p.name: p for p in made}, [ElementSetting("c", (x.const(2),), x.const(7), PLACE)])
    assert [values.element("c", k) for k in (1, 2, 3)] == [4.0, 7.0, 36.0]
    assert values.number(x.param("d", x.sub(n, x.const(1)))) == 30.0
    assert math.isnan(values.element("d", 3))
    assert math.isnan(values.number(x.add(n, x.param("open"))))
    assert math.isnan(values.number(x.var("q", "q")))
    assert values.truth(x.compare("<=", n, x.param("b")))


def test_the_extremes_of_an_index_over_a_triangle_of_loops():
    """Of j + n for i in 1..n, j in i..n; an empty loop has none."""
    n, i, j = x.param("n"), x.index("i"), x.index("j")
    values = Values({"n": parameter("n", 4.0)})
    loops = [Loop("i", x.const(1), n), Loop("j", i, n)]
    assert values.bounds(x.add(j, n), loops) == (5.0, 8.0)
    assert values.bounds(i, [Loop("i", n, x.const(1))]) == (math.inf, -math.inf)


def test_cases_are_all_iterations_where_a_value_follows_them_and_else_the_first():
    """n = 3; a[i] = 5, b[i] = a[i] + n, c[i] = i, d a list, e[i] = 5 but for e[2] = 1."""
    n, i = x.param("n"), x.index("i")
    box = ((x.const(1), n),)
    made = [
        parameter("n", 3.0),
        parameter("a", 5.0, shape=box),
        parameter("b", x.add(x.param("a", i), n), shape=box, indices=("i",)),
        parameter("c", i, shape=box, indices=("i",)),
        parameter("d", 1.0, 2.0, 3.0, shape=box),
        parameter("e", 5.0, shape=box),
    ]
    values = Values({p.name: p for p in made}, [ElementSetting("e", (x.const(2),), x.const(1), PLACE)])
    loops = [Loop("i", x.const(1), n)]

    def many(node):
        return len(list(values.cases(node, loops)))

    assert [many(x.param(p, i)) for p in "abcde"] == [1, 1, 3, 3, 3]
    assert (many(n), many(x.add(n, x.power(i, x.const(2))))) == (1, 3)
    assert many(x.param("f", i)) == 3  # of which nothing is known
    assert list(values.cases(n, [Loop("i", n, x.const(1))])) == []


def test_a_rolling_speed_multiplies_the_displacements_it_moves():
    """Along w = cos(th) x' + sin(th) y' + t th the virtual displacement is cos(th) dx + sin(th) dy."""
    th = x.var("th", "q")
    cos, sin = x.call("cos", th), x.call("sin", th)
    speed = x.add(x.mul(cos, x.var("x", "f")), x.mul(sin, x.var("y", "q", order=1)), x.mul(x.time(), th))
    assert {q: c for c, q in virtual(speed)} == {x.var("x", "q"): cos, x.var("y", "q"): sin}


def test_what_is_no_quasi_velocity_says_why():
    f, p = x.var("x", "f"), x.var("x", "p")
    for speed, why in (
        (x.var("x", "q"), "contains no flow"),
        (x.power(f, x.const(2)), "is not linear in the flow x'"),
        (x.add(f, p), "neither a flow nor a displacement"),
    ):
        with pytest.raises(NotLinearError, match=why):
            virtual(speed)
