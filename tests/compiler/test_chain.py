"""Arrays stay arrays: one text for every length, the residual of an unrolled reference, large sizes at once."""

from dataclasses import replace

import numpy as np
import pytest
from carriers import CCarrier, NumpyCarrier
from catalogue import ONE, PLACE
from chains import blank, chain, coordinate, parameter, reference
from sysdyn.compiler.binding.manifest import structure
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import BLOCKS, WITHOUT_ENTRIES
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import EnergyTerm, Loop, Observation


def compiled(n, formulation="lagrangian", backend="c"):
    with x.fresh():
        return compile_network(chain(n), formulation, backend)


@pytest.mark.parametrize("backend", ["c", "numpy"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_text_and_structure_do_not_depend_on_the_length(formulation, backend):
    short, long = compiled(10, formulation, backend), compiled(100_000, formulation, backend)
    assert short.text == long.text
    assert structure(short.form, short.program, short.network) == structure(long.form, long.program, long.network)


def point(oracle, seed=1):
    random = np.random.default_rng(seed)
    return 0.3, random.uniform(0.2, 1, oracle.at[-1]), random.uniform(0.2, 1, oracle.at[-1])


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_carriers_agree_with_the_oracle(formulation, tmp_path):
    model = compiled(7, formulation)
    binding = model.bind()
    oracle = Oracle(model.form, binding)
    t, y, yd = point(oracle)
    carriers = (
        CCarrier(model.program, model.form, binding),
        NumpyCarrier(model.program, model.form, binding, tmp_path),
    )
    for block in BLOCKS:
        for carrier in carriers:
            np.testing.assert_allclose(
                carrier.rows(block, t, y, yd), oracle.rows(block, t, y, yd), rtol=1e-12, atol=1e-13
            )
            for order, part in enumerate(("dy", "dyd") if block not in WITHOUT_ENTRIES else ()):
                v, _, _ = oracle.entries(block, order, t, y, yd)
                np.testing.assert_allclose(carrier.entries(block, part, t, y, yd), v, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("n", [1, 2, 10, 1000])
@pytest.mark.one_in(5)
def test_residual_is_that_of_the_unrolled_chain(n, tmp_path):
    model = compiled(n)
    binding = model.bind()
    carriers = (
        CCarrier(model.program, model.form, binding),
        NumpyCarrier(model.program, model.form, binding, tmp_path),
    )
    for carrier in carriers:
        t, y, yd = point(carrier)
        r = sum(carrier.rows(block, t, y, yd) for block in ("dynamics", "phi_reaction", "phi"))
        np.testing.assert_allclose(r[: 3 * n], reference(n, y, yd), rtol=1e-12, atol=1e-12)


@pytest.mark.long
def test_compiling_and_binding_run_as_many_lines_for_any_length(effort):
    def lines(length):
        with x.fresh():
            return effort(lambda: compiled(length).bind())[1]

    lines(10)
    assert lines(100_000) <= 1.05 * lines(10)


@pytest.mark.long
def test_binding_of_the_chain():
    model = compiled(4)
    binding = model.bind({("m", 2): 7.0})
    shapes = dict(zip((f.name for f in model.form.families), binding.shapes, strict=True))
    assert shapes["x"] == shapes["link.multiplier"] == ((1, 4),)
    np.testing.assert_allclose(binding.values["m"], [1.25, 7.0, 1.75, 2.0])
    pinned = {s.label: s for s in binding.initial}
    np.testing.assert_allclose(pinned["x"].values, [0.2, 0.4, 0.6, 0.8])
    assert pinned["x"].fixed
    assert list(pinned["y"].positions) == [3]
    assert not pinned["y"].fixed
    rows = {r.block: s for r, s in zip(model.form.rows, binding.row_shapes, strict=True)}
    assert rows["initial"] == ((2, 4),)


@pytest.mark.long
def test_observations_read_arrays():
    model = compiled(5)
    oracle = Oracle(model.form, model.bind())
    t, y, yd = point(oracle)
    seen = dict(zip((r.label for r in model.form.rows), oracle.rows("observe", t, y, yd)[oracle.to[:-1]], strict=True))
    m = 1 + np.arange(1, 6) / 5
    assert seen["tip"] == y[4]
    assert seen["height"] == pytest.approx(m @ y[5:10] / 3.0)
    assert seen["norm"] == pytest.approx(np.linalg.norm(y[5:10]))
    assert seen["tip.p"] == pytest.approx(m[4] * y[14])
    rates = {r.label: r.rate for r in model.form.rows}
    assert rates["tip.p"]
    assert not rates["pull"]


def plane(n, m):
    """A grid of potentials x[1..n, 1..m] with a triangular double sum."""
    i, j = x.index("i"), x.index("j")
    one, rows, columns = x.const(1), x.param("n"), x.param("m")

    def q(a, b):
        return x.var("u", "q", a, b)

    step = x.power(x.sub(q(i, j), q(x.sub(i, one), j)), x.const(2))
    below = x.reduction("sum", "j", one, i, x.mul(x.param("c", i, j), x.call("sin", q(i, j))))
    coupling = x.power(x.reduction("sum", "i", one, rows, q(i, one)), x.const(2))
    loops = (Loop("i", x.const(2), rows), Loop("j", one, columns))
    shape = ((one, rows), (one, columns))
    total = x.call(
        "ln", x.reduction("sum", "i", one, rows, x.reduction("sum", "j", one, columns, x.call("exp", q(i, j))))
    )
    return blank(
        parameters=(
            parameter("n", float(n), whole=True),
            parameter("m", float(m), whole=True),
            parameter("c", x.add(i, x.mul(x.const(10), j)), shape, ("i", "j")),
        ),
        coordinates=(coordinate("u", shape),),
        energies=(
            EnergyTerm("V", step, loops, PLACE),
            EnergyTerm("V", x.reduction("sum", "i", one, rows, below), (), PLACE),
            EnergyTerm("V", coupling, (), PLACE),
        ),
        observations=(Observation("total", total, ONE, "total", PLACE),),
    )


def test_two_indices_triangles_and_products_of_sums(tmp_path):
    n, m = 4, 5
    with x.fresh():
        model = compile_network(plane(n, m))
        binding = model.bind()
        oracle = Oracle(model.form, binding)
        t, y, yd = point(oracle)
        u = y[: n * m].reshape(n, m)
        force = np.zeros((n, m))
        force[1:] += 2 * np.diff(u, axis=0)
        force[:-1] -= 2 * np.diff(u, axis=0)
        i, j = np.mgrid[1 : n + 1, 1 : m + 1]
        force += np.where(j <= i, (i + 10 * j) * np.cos(u), 0.0)
        force[:, 0] += 2 * u[:, 0].sum()
        carriers = [CCarrier(model.program, model.form, binding)]
        carriers.append(NumpyCarrier(model.program, model.form, binding, tmp_path))
        for carrier in (oracle, *carriers):
            np.testing.assert_allclose(carrier.rows("dynamics", t, y, yd)[: n * m].reshape(n, m), force, rtol=1e-13)
            total = carrier.rows("observe", t, y, yd)[n * m]
            assert total == pytest.approx(np.log(np.exp(u).sum()), rel=1e-14)
        v, r, c = oracle.entries("dynamics", 0, t, y, yd)
        for carrier in carriers:
            np.testing.assert_allclose(carrier.entries("dynamics", "dy", t, y, yd), v, rtol=1e-13)
        jacobian = np.zeros((n * m, n * m))
        np.add.at(jacobian, (r.astype(int), c.astype(int)), v)
        np.testing.assert_allclose(jacobian, jacobian.T, rtol=1e-13)


@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize("first", [1, 2, 6])
@pytest.mark.long
def test_momenta_cover_the_elements_that_have_a_mass(first, given, tmp_path):
    """Rows of massless elements hold no p'; where T is given, their momentum row is p = 0."""
    with x.fresh():
        i, n = x.index("i"), x.param("n")
        one = x.const(1)
        kind, function = ("p", "T") if given else ("f", "T*")
        kinetic = x.mul(x.const(2), x.power(x.var("u", kind, i), x.const(2)))
        net = blank(
            parameters=(parameter("n", 5.0, whole=True), parameter("a", float(first), whole=True)),
            coordinates=(coordinate("u", ((one, n),)),),
            energies=(
                EnergyTerm(function, kinetic, (Loop("i", x.param("a"), n),), PLACE),
                EnergyTerm("D", x.power(x.var("u", "f", i), x.const(2)), (Loop("i", one, n),), PLACE),
            ),
        )
        model = compile_network(net, "hamiltonian")
        binding = model.bind()
        oracle = Oracle(model.form, binding)
        t, y, yd = point(oracle)
        places = {(f.owner, f.kind): oracle.at[k] for k, f in enumerate(model.form.families)}
        f, p = (y[places["u", k] : places["u", k] + 5] for k in "fp")
        rate = yd[places["u", "p"] : places["u", "p"] + 5]
        heavy = np.arange(1, 6) >= first
        rows = {r.block: oracle.to[k] for k, r in enumerate(model.form.rows)}
        carriers = [oracle, CCarrier(model.program, model.form, binding)]
        carriers.append(NumpyCarrier(model.program, model.form, binding, tmp_path))
        for carrier in carriers:
            dynamics = carrier.rows("dynamics", t, y, yd)[rows["dynamics"] :][:5]
            np.testing.assert_allclose(dynamics, np.where(heavy, rate, 0) + 2 * f)
            momentum = carrier.rows("momentum", t, y, yd)[rows["momentum"] :][:5]
            expected = np.where(heavy, 4 * p - f, p) if given else np.where(heavy, p - 4 * f, p)
            np.testing.assert_allclose(momentum, expected)


def test_names_of_traces_are_their_own():
    """A trace may bear the name of an array, or of an audit's member."""
    with x.fresh():
        net = chain(4)
        named = [
            replace(o, name=name) for o, name in zip(net.observations, ("x", "link", "kinetic", "y"), strict=False)
        ]
        model = compile_network(replace(net, observations=tuple(named)))
        binding = model.bind()
        shapes = {r.label: s for r, s in zip(model.form.rows, binding.row_shapes, strict=True) if r.block == "observe"}
        assert shapes["x"] == shapes["link"] == ()
        oracle = Oracle(model.form, binding)
        t, y, yd = point(oracle)
        seen = [oracle.rows("observe", t, y, yd)[oracle.to[k]] for k, r in enumerate(model.form.rows) if r.label == "x"]
        assert y[3] in seen
