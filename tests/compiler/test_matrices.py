"""Matrices and equations of expressions against closed forms: minors, roots, motions that constraints leave free."""

import math
from dataclasses import replace

import numpy as np
import pytest
from catalogue import ONE, PLACE
from chains import blank, coordinate
from sysdyn.compiler.forms.kane import constraints, projection
from sysdyn.compiler.forms.minors import determinant, inverse
from sysdyn.compiler.forms.speeds import speeds_of
from sysdyn.compiler.model.energies import TracedQuantity, energies
from sysdyn.compiler.network.primal.symbolic import SignedAlgebra
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Constraint, EnergyTerm
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")


def value(node, **known):
    return evaluate([node], lambda leaf: known[leaf.data if leaf.op == "param" else leaf.data[0]])[0]


def matrix(rows):
    return [[x.const(float(v)) for v in row] for row in rows]


# -- minors ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_the_determinant_of_vandermonde_is_the_product_of_differences(n):
    names = "abcde"[:n]
    known = dict(zip(names, (2.0, -1.0, 3.5, 0.25, 7.0), strict=False))
    rows = [[x.power(x.param(name), x.const(float(k))) for k in range(n)] for name in names]
    exact = math.prod(known[b] - known[a] for k, a in enumerate(names) for b in names[k + 1 :])
    assert value(determinant(rows), **known) == pytest.approx(exact, rel=1e-13)


def test_the_inverse_of_hilbert_s_matrix_has_whole_numbers():
    hilbert = matrix([[1 / (j + k + 1) for k in range(3)] for j in range(3)])
    expected = [[9, -36, 30], [-36, 192, -180], [30, -180, 180]]
    assert [[value(v) for v in row] for row in inverse(hilbert)] == [pytest.approx(row, rel=1e-11) for row in expected]


def test_rows_and_columns_of_an_inverse_are_not_exchanged():
    found = inverse([[x.param("a"), x.param("b")], [x.const(0.0), x.param("c")]])
    known = {"a": 2.0, "b": 3.0, "c": 5.0}
    assert [[value(v, **known) for v in row] for row in found] == [[0.5, pytest.approx(-0.3)], [0.0, 0.2]]


# -- roots -------------------------------------------------------------------------------------------------


def roots(law, w, a=2.0, b=3.0, *, positive=True):
    """The v that the candidates give at w, of a law in v, a, b."""
    v, y = x.param("v"), x.param("w")
    algebra = SignedAlgebra(v, y, {x.param("a"): 1, x.param("b"): 1}, positive=positive)
    found = []
    for root in algebra.roots(law(v, x.param("a"), x.param("b")), over_value=False):
        try:
            found.append(value(root, w=w, a=a, b=b))
        except (ValueError, ZeroDivisionError):
            continue
    return [r for r in found if not isinstance(r, complex)]


def one_of(found, expected):
    return min(abs(r - expected) for r in found) < 1e-12 * max(1.0, abs(expected))


def test_a_quadratic_law():
    """a v + b v^2 = w: v = (-a + sqrt(a^2 + 4 b w))/(2 b), also as 2 w/(a + sqrt(...)), which cancels nothing."""
    found = roots(lambda v, a, b: x.add(x.mul(a, v), x.mul(b, v, v)), 8.0)
    assert one_of(found, 4.0 / 3.0)
    small = roots(lambda v, a, b: x.add(x.mul(a, v), x.mul(b, v, v)), 1e-17)
    assert min(abs(r / 5e-18 - 1.0) for r in small if r) < 1e-13


def test_a_law_with_a_square_root_under_it():
    """Momentum of a relativistic mass: a v/sqrt(1 - v^2) = w: v = w/sqrt(a^2 + w^2)."""

    def law(v, a, b):
        return x.div(x.mul(a, v), x.sqrt(x.linear(1.0, [(-1.0, x.mul(v, v))])))

    assert one_of(roots(law, 1.5), 0.6)


def test_roots_of_two_different_radicands_are_not_sought():
    def law(v, a, b):
        return x.add(x.sqrt(x.add(a, v)), x.sqrt(x.add(b, v)))

    assert roots(law, 4.0) == []


def test_a_parameter_that_is_known_to_be_negative_keeps_its_sign():
    v, w, n = x.param("v"), x.param("w"), x.param("n")
    algebra = SignedAlgebra(v, w, {n: -1}, positive=False)
    (root, *_) = algebra.roots(x.linear(0.0, [(-2.0, x.mul(n, v))]), over_value=False)
    assert value(root, w=6.0, n=-3.0) == pytest.approx(1.0)


# -- motions that constraints on flows leave free ----------------------------------------------------------


def model(names, psi, **quasi):
    """An energy model with unit masses; psi: rows as expressions of flows; quasi-velocities by name."""
    flows = [x.var(n, "f") for n in names]
    kinetic = x.mul(x.const(0.5), x.add(*(x.mul(f, f) for f in flows)))
    rows = tuple(Constraint("psi", label, (), node, (), ONE, PLACE) for label, node in psi.items())
    network = blank(
        coordinates=tuple(map(coordinate, names)), energies=(EnergyTerm("T*", kinetic, (), PLACE),), constraints=rows
    )
    speeds = tuple(TracedQuantity(name, node, False, "1", PLACE) for name, node in quasi.items())
    return replace(energies(network), speeds=speeds)


def flow(name):
    return x.var(name, "f")


def place(name):
    return x.var(name, "q")


def knife_edge(**quasi):
    a = place("a")
    edge = x.sub(x.mul(x.call("sin", a), flow("x")), x.mul(x.call("cos", a), flow("y")))
    return model(["x", "y", "a"], {"edge": edge}, **quasi)


def test_a_knife_edge_leaves_the_motion_along_itself():
    """Psi = sin a x' - cos a y': B holds (cos a, sin a) up to a factor, and the turn."""
    found = projection(knife_edge(), constraints(knife_edge())[0])
    columns = [{k: value(v, a=0.3) for k, v in column.items()} for column in found.free.values()]
    turn = [c for c in columns if "a" in c]
    along = [c for c in columns if "a" not in c]
    assert turn == [{"a": 1.0}]
    assert len(along) == 1
    assert along[0]["y"] / along[0]["x"] == pytest.approx(math.tan(0.3), rel=1e-14)


@pytest.mark.parametrize("seed", range(25))
def test_columns_span_what_the_rows_leave(seed):
    """Rows of numbers and of functions: Psi_f B = 0, and B has the rank that is left."""
    random = np.random.default_rng(seed)
    names = [f"c{k}" for k in range(int(random.integers(3, 7)))]
    parameters = {"c0": 0.4, "c1": -0.7}
    psi, numbers = {}, []
    for r in range(int(random.integers(1, len(names)))):
        terms, row = [], []
        for n in names:
            c = float(random.choice([0.0, 0.0, 1.0, -2.0, 0.5]))
            curved = random.random() < 0.3
            slope = x.mul(x.const(c), x.call("cos", place("c0"))) if curved else x.const(c)
            row.append(c * math.cos(0.4) if curved else c)
            terms.append(x.mul(slope, flow(n)))
        psi[f"r{r}"] = x.add(*terms)
        numbers.append(row)
    made = model(names, psi)
    full = np.array(numbers)
    dependent = np.linalg.matrix_rank(full) < len(psi)
    if dependent:
        with pytest.raises(ModelError):
            projection(made, constraints(made)[0])
        return
    found = projection(made, constraints(made)[0])
    columns = np.zeros((len(names), len(found.free)))
    for k, column in enumerate(found.free.values()):
        for name, node in column.items():
            columns[names.index(name), k] = value(node, **{**dict.fromkeys(names, 0.0), **parameters})
    assert len(found.free) == len(names) - len(psi)
    assert np.abs(full @ columns).max(initial=0.0) < 1e-12
    assert np.linalg.matrix_rank(columns) == len(found.free)


def test_the_speed_along_a_knife_edge():
    """u = cos a x' + sin a y': x' = u cos a, y' = u sin a, and the edge holds by that."""
    a = place("a")
    u = x.add(x.mul(x.call("cos", a), flow("x")), x.mul(x.call("sin", a), flow("y")))
    made = knife_edge(u=u)
    found = speeds_of(made, frozenset())
    assert [s.name for s in found.speeds] == ["u"]
    assert found.left_out == {"edge"}
    flows = [value(found.flow(name), a=0.3, u=2.0) for name in ("x", "y")]
    assert flows == pytest.approx([2.0 * math.cos(0.3), 2.0 * math.sin(0.3)], rel=1e-14)
    # a reaction that something reads keeps the row
    assert speeds_of(made, frozenset({"edge"})).speeds == ()


def test_a_constraint_that_moves_by_itself():
    """x' - y' = 2 and u = x' + y' + 1: x' = (u + 1)/2, y' = (u - 3)/2."""
    psi = {"belt": x.linear(-2.0, [(1.0, flow("x")), (-1.0, flow("y"))])}
    found = speeds_of(model(["x", "y"], psi, u=x.linear(1.0, [(1.0, flow("x")), (1.0, flow("y"))])), frozenset())
    assert [value(found.flow(name), u=4.0) for name in ("x", "y")] == [2.5, 0.5]


def test_a_speed_that_follows_from_others_is_a_name():
    """u, v and u + v of two flows: two unknown speeds; one alone is completed by a flow."""
    one, two = flow("x"), x.linear(0.0, [(1.0, flow("x")), (4.0, flow("y"))])
    found = speeds_of(model(["x", "y"], {}, u=one, v=two, w=x.add(one, two)), frozenset())
    assert [s.name for s in found.speeds] == ["u", "v"]
    assert [value(found.flow(name), u=4.0, v=12.0) for name in ("x", "y")] == [4.0, 2.0]
    alone = speeds_of(model(["x", "y"], {}, v=two), frozenset())
    assert [s.name for s in alone.speeds] == ["v", "u.x"]
