"""Numbers of a bound model against closed forms: magnitudes, indices, printed powers, slopes by parameters, columns."""

import math

import numpy as np
import pytest
from catalogue import ONE, PLACE
from chains import blank, coordinate, parameter
from sysdyn.compiler.binding.sampled_rows import Points, SampledRows
from sysdyn.compiler.binding.sensitivity import Sensitivity
from sysdyn.compiler.model.integers import Index, Integers
from sysdyn.compiler.model.magnitudes import magnitudes, rounding
from sysdyn.compiler.pipeline import compile_network
from sysdyn.compiler.program.notation import Notation, factors, number, total
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Constraint, EnergyTerm, InitialCondition, VirtualWork
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")


# -- magnitudes --------------------------------------------------------------------------------------------


def size(root, **known):
    return float(magnitudes([root], lambda n, args: known[n.data], lambda table: 0.0)[0])


def test_what_cancels_is_as_uncertain_as_its_terms():
    a, b = x.param("a"), x.param("b")
    gap = x.sub(a, b)
    near = {"a": 1e6, "b": 1e6 - 1.0}
    assert size(gap, **near) == 2e6 - 1.0
    assert size(x.scale(-3.0, gap), **near) == 3.0 * (2e6 - 1.0)
    # products: by the magnitudes; powers: |e| times the relative one; exp: its argument is the condition
    assert size(x.mul(gap, b), **near) == (2e6 - 1.0) * (1e6 - 1.0)
    # over another factor too, where all of it cancels
    assert size(x.mul(gap, x.power(b, x.const(-1.0))), a=3.0, b=3.0) == 2.0
    assert size(x.mul(x.power(gap, x.const(2.0)), b), a=3.0, b=3.0) == 36.0 * 3.0
    assert size(x.power(gap, x.const(-2.0)), **near) == pytest.approx(1.0 + 2.0 * (2e6 - 1.0))
    assert size(x.call("exp", gap), **near) == pytest.approx(math.e * (1.0 + 2e6 - 1.0))
    assert size(x.call("sin", x.const(0.5)), **near) == pytest.approx(math.sin(0.5))
    assert size(x.conditional(x.compare("<", a, b), a, gap), a=1.0, b=3.0) == 4.0


@pytest.mark.parametrize("f", [1e-12, 3e-9, 2e-5, 0.7])
def test_a_rounding_error_is_no_larger_than_it_is_said(f):
    flow = x.var("f", "f")
    root = x.sqrt(x.add(x.const(1.0), x.mul(flow, flow)))
    energies = {
        x.sub(root, x.const(1.0)): f * f / (math.sqrt(1.0 + f * f) + 1.0),
        x.call("ln", x.call("cosh", flow)): 0.5 * math.log1p(math.sinh(f) ** 2),
        x.mul(flow, flow): f * f,
    }
    for energy, exact in energies.items():
        value, said = evaluate([energy, rounding(energy)], {flow: f}.__getitem__)
        assert abs(value - exact) <= 1.2e-16 * said
        assert said <= 6.0 * max(1.0, exact)  # terms of at most 1.3


# -- whole numbers -----------------------------------------------------------------------------------------


def test_an_index_is_a_loop_a_slot_and_a_number():
    integers, i, n = Integers(), x.index("i"), x.param("n")
    assert integers.index(i, {"i": 2}) == Index(2, -1, 0)
    assert integers.index(x.const(4.0), {}) == Index(-1, -1, 4)
    assert integers.index(x.linear(-1.0, [(1.0, i), (2.0, n)]), {"i": 0}) == Index(0, 0, -1)
    assert integers.index(x.linear(3.0, [(2.0, n)]), {}) == Index(-1, 0, 3)  # the same slot
    assert integers.slots == (("value", x.scale(2.0, n)),)
    for wrong in (x.scale(2.0, i), x.add(i, x.index("j")), x.linear(0.5, [(1.0, i)]), x.mul(i, n)):
        with pytest.raises(ModelError, match="E806"):
            integers.index(wrong, {"i": 0, "j": 1})


# -- printed numbers ---------------------------------------------------------------------------------------

PYTHON = Notation("math.sqrt", "pow", "pow", "math.inf", "math.nan")


def read_back(text, **known):
    return eval(text, {"math": math, "pow": pow}, known)  # noqa: S307


@pytest.mark.parametrize("seed", range(20))
def test_products_and_sums_read_back_as_themselves(seed):
    random = np.random.default_rng(seed)
    known = {f"v{k}": float(v) for k, v in enumerate(random.uniform(0.5, 2.0, 4))}
    exponents = [float(v) for v in random.choice([-3.5, -2.0, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 3.0, 7.0, 0.3], 4)]
    exact = math.prod(v**e for v, e in zip(known.values(), exponents, strict=True))
    assert read_back(factors(exponents, list(known), PYTHON), **known) == pytest.approx(exact, rel=1e-14)
    constant, *coefficients = (float(v) for v in random.choice([-1.0, 1.0, -2.5, 1e-300, 3.0, 0.0], 5))
    data = constant, [c or 1.0 for c in coefficients]
    exact = constant + sum(c * v for c, v in zip(data[1], known.values(), strict=True))
    assert read_back(total(data, list(known), PYTHON), **known) == pytest.approx(exact, rel=1e-14, abs=1e-14)


@pytest.mark.parametrize("value", [0.1, -0.1, 5e-324, 1.7976931348623157e308, math.inf, -math.inf, np.float64(1 / 3)])
def test_a_number_reads_back_as_itself(value):
    assert read_back(number(value, PYTHON)) == value
    assert read_back("2.0-" + number(value, PYTHON)) == 2.0 - value


# -- a driven oscillator -----------------------------------------------------------------------------------

M, K, C = x.param("m"), x.param("k"), x.param("c")
VALUES = {"m": 2.0, "k": 8.0, "c": 0.5}
POINTS = Points(np.array([0.0, 0.7]), np.array([[0.3, -1.5], [2.0, 0.25]]), np.array([[-1.5, 4.0], [0.25, -3.0]]))


def oscillator(**more):
    """m x'' + c x' + k x = m sin t; k = 4 m."""
    m, k, c = (x.param(name) for name in "mkc")
    q, f = x.var("x", "q"), x.var("x", "f")
    half = x.const(0.5)
    network = blank(
        parameters=(parameter("m", 2.0), parameter("k", x.scale(4.0, m)), parameter("c", 0.5)),
        coordinates=(coordinate("x"),),
        energies=(
            EnergyTerm("T*", x.mul(half, m, f, f), (), PLACE),
            EnergyTerm("V", x.mul(half, k, q, q), (), PLACE),
            EnergyTerm("D", x.mul(half, c, f, f), (), PLACE),
        ),
        works=(VirtualWork(x.mul(m, x.call("sin", x.time())), q, (), PLACE),),
        initials=(InitialCondition(q, x.div(c, m), True, (), PLACE),),
        **more,
    )
    return compile_network(network, "lagrangian", "numpy")


def test_rows_and_the_sizes_of_their_terms():
    model = oscillator()
    block = model.form.block("dynamics")
    found = SampledRows(model.form, model.bind()).sample(block, POINTS)
    for k, t in enumerate(POINTS.t):
        (q, f), a = POINTS.y[k], POINTS.yd[k, 1]
        terms = [2.0 * a, 0.5 * f, 8.0 * q, -2.0 * math.sin(t)]
        assert found.value[k] == pytest.approx([sum(terms)], rel=1e-14)
        assert found.size[k] == pytest.approx([sum(map(abs, terms))], rel=1e-14)


def test_slopes_of_a_row_by_parameters_and_what_follows_from_them():
    model = oscillator()
    binding = model.bind()
    t, (q, f), (_, a) = 0.7, *(list(map(float, v[1])) for v in (POINTS.y, POINTS.yd))
    y, yd = (np.append(v[1], np.zeros(20)) for v in (POINTS.y, POINTS.yd))
    row = next(k for k, r in enumerate(model.form.rows) if r.block == "dynamics")
    for name, slope in (("m", a + 4.0 * q - math.sin(t)), ("k", q), ("c", f)):
        found = Sensitivity(model.form, binding, model.network, name, ())
        assert found.rows("dynamics", 0, t, y, yd)[row] == pytest.approx(slope, rel=1e-14), name


def test_a_parameter_that_moves_moves_the_rates_of_constraints():
    """phi: x^2 - l^2 = 0: d phi/dl = -2 l, d phi'/dl' = d phi''/dl'' = -2 l."""
    q = x.var("x", "q")
    rod = x.sub(x.mul(q, q), x.power(x.param("l"), x.const(2.0)))
    network = blank(
        parameters=(parameter("l", 1.5),),
        coordinates=(coordinate("x"),),
        energies=(EnergyTerm("T*", x.mul(x.const(0.5), x.var("x", "f"), x.var("x", "f")), (), PLACE),),
        constraints=(Constraint("phi", "rod", (), rod, (), ONE, PLACE),),
        initials=(InitialCondition(q, x.const(1.5), False, (), PLACE),),
    )
    model = compile_network(network, "lagrangian", "numpy")
    found = Sensitivity(model.form, model.bind(), model.network, "l", ())
    y = np.append([1.5, 0.2], np.zeros(20))
    by = {
        (block, order): float(np.abs(found.rows(block, order, 0.0, y, 0.0 * y)).max())
        for block in ("phi", "phi_rate", "phi_acceleration")
        for order in (0, 1, 2)
    }
    assert by["phi", 0] == by["phi_rate", 1] == by["phi_acceleration", 2] == 3.0
    assert by["phi", 1] == by["phi", 2] == by["phi_rate", 2] == 0.0


def test_columns_over_runs_are_what_each_binding_gives():
    """k = 4 m and x(0) = c/m follow; the numbers are those of one binding a run, bit for bit."""
    model = oscillator()
    varied = {"m": np.array([0.3, 2.0, 7.1]), "c": np.array([0.1, 0.2, 0.3])}
    found = model.columns(model.bind(), varied)
    for run in range(3):
        own = model.bind({name: float(values[run]) for name, values in varied.items()})
        assert found.p[run].tolist() == own.p.tolist()
        ((_, values),) = found.starts
        assert values[run] == own.initial[0].values[0] == varied["c"][run] / varied["m"][run]
    assert found.good.all()
    assert not model.columns(model.bind(), {"m": np.array([1.0, 0.0])}).good.all()
