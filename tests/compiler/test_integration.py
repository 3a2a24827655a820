"""psi rows that touch tangible displacements become phi rows with the initial contents as constants."""

from dataclasses import replace

import numpy as np
import pytest
from carriers import NumpyCarrier
from catalogue import ONE, PLACE, network
from chains import blank, coordinate, parameter
from reference_values import load
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Constraint, EnergyTerm, InitialCondition, Loop, Observation, VirtualWork

pytestmark = pytest.mark.usefixtures("fresh")


def q(name, *at):
    return x.var(name, "q", *at)


def f(name, *at):
    return x.var(name, "f", *at)


def node_network(psi, *, stored="b"):
    """Three branches at a node; `stored` names the one with a capacitor."""
    return blank(
        parameters=(parameter("k", 2.0), parameter("c", 0.5)),
        coordinates=tuple(coordinate(n) for n in "abd"),
        energies=(
            EnergyTerm("V", x.mul(x.param("k"), x.power(q(stored), x.const(2))), (), PLACE),
            *(EnergyTerm("D", x.power(f(n), x.const(2)), (), PLACE) for n in "abd"),
        ),
        constraints=(Constraint("psi", "node", (), psi, (), ONE, PLACE),),
        initials=(
            InitialCondition(q("a"), x.const(7.0), True, (), PLACE),
            InitialCondition(q("b"), x.param("k"), False, (), PLACE),
        ),
        observations=(Observation("v", x.var("node", "mu"), ONE, "v", PLACE),),
    )


def test_constant_coefficients_are_integrated():
    psi = x.linear(0.0, ((1.0, f("a")), (-1.0, x.mul(x.param("c"), f("b"))), (-1.0, f("d"))))
    model = compile_network(node_network(psi))
    (note,) = [d for d in model.notes if d.code == "N501"]
    assert note.message == (
        "psi node was integrated because b is tangible: phi: a - c*b - d - (a(0) - c*b(0) - d(0)) = 0"
    )
    assert not model.form.block("psi")
    binding = model.bind()
    ((row, start, count),) = binding.offsets
    assert (model.form.rows[row].label, count) == ("node", 1)
    assert binding.p[start] == 7.0 - 0.5 * 2.0
    oracle = Oracle(model.form, binding)
    y = np.zeros(oracle.at[-1])
    names = [(u.owner, u.kind) for u in model.form.families]
    y[names.index(("a", "q"))], y[names.index(("b", "q"))] = 7.0, 2.0
    y[names.index(("node", "kappa"))] = 3.0
    assert oracle.rows("phi", 0.0, y, y)[oracle.to[row]] == 0.0
    assert 3.0 in oracle.rows("observe", 0.0, y, y)
    bound = model.bind({"k": 4.0})
    assert bound.p[bound.offsets[0][1]] == 7.0 - 0.5 * 4.0


@pytest.mark.parametrize(
    "psi",
    [
        lambda: x.sub(f("a"), f("d")),  # nothing tangible
        lambda: x.sub(f("b"), x.mul(q("b"), f("a"))),  # coefficient not constant
        lambda: x.sub(f("b"), x.call("sin", x.time())),  # b(t)
    ],
)
def test_others_stay(psi):
    model = compile_network(node_network(psi()))
    assert [d.code for d in model.notes] == []
    assert model.form.block("psi")


def test_constant_source_integrates_to_a_ramp():
    model = compile_network(node_network(x.sub(f("b"), x.param("c"))))
    oracle = Oracle(model.form, model.bind())
    y = np.zeros(oracle.at[-1])
    names = [(u.owner, u.kind) for u in model.form.families]
    y[names.index(("b", "q"))] = 2.0 + 0.5 * 3.0
    assert oracle.rows("phi", 3.0, y, y)[oracle.to[model.bind().offsets[0][0]]] == 0.0


def test_rows_of_an_array():
    i, n = x.index("i"), x.param("n")
    after = x.add(i, x.const(1))
    psi = x.linear(0.0, ((1.0, f("q", i)), (-1.0, f("q", after)), (-1.0, f("z", i))))
    net = blank(
        parameters=(parameter("n", 5.0, whole=True),),
        coordinates=(coordinate("q", ((x.const(1), x.add(n, x.const(1))),)), coordinate("z", ((x.const(1), n),))),
        energies=(
            EnergyTerm("V", x.power(q("z", i), x.const(2)), (Loop("i", x.const(1), n),), PLACE),
            EnergyTerm("T*", x.power(f("q", i), x.const(2)), (Loop("i", x.const(1), x.add(n, x.const(1))),), PLACE),
        ),
        constraints=(Constraint("psi", "node", (i,), psi, (Loop("i", x.const(1), n),), ONE, PLACE),),
        initials=(
            InitialCondition(q("z", i), x.mul(i, i), True, (Loop("i", x.const(1), n),), PLACE),
            InitialCondition(q("q", i), i, True, (Loop("i", x.const(1), x.add(n, x.const(1))),), PLACE),
        ),
    )
    model = compile_network(net, "hamiltonian", "numpy")
    binding = model.bind()
    ((_, start, count),) = binding.offsets
    np.testing.assert_array_equal(binding.p[start : start + count], -1.0 - np.arange(1, 6) ** 2)


def test_carriers_read_the_constants(tmp_path):
    psi = x.linear(0.0, ((1.0, f("a")), (-1.0, f("b")), (-1.0, f("d"))))
    model = compile_network(node_network(psi), backend="numpy")
    binding = model.bind()
    oracle = Oracle(model.form, binding)
    carrier = NumpyCarrier(model.program, model.form, binding, tmp_path)
    y = np.arange(1.0, oracle.at[-1] + 1)
    np.testing.assert_array_equal(carrier.rows("phi", 0.0, y, y), oracle.rows("phi", 0.0, y, y))


def test_multipliers_in_laws_follow():
    psi = x.linear(0.0, ((1.0, f("a")), (-1.0, f("b")), (-1.0, f("d"))))
    net = node_network(psi)
    friction = VirtualWork(x.neg(x.var("node", "mu")), q("a"), (), PLACE)
    model = compile_network(replace(net, works=(friction,)))
    assert model.form.block("dynamics")


def test_the_book_s_circuits_integrate():
    """fluid_tank's node given as flows gives the catalogue's phi with V20 as constant."""
    entry = load("catalogue.json")["fluid_tank"]
    model = dict(entry["models"][0])
    model["psi"], model["phi"] = ["f1-f2-f3"], []
    net = network(entry, model)
    start = InitialCondition(x.var("x2", "q"), x.param("V20"), True, (), PLACE)
    compiled = compile_network(replace(net, initials=(start,)))
    binding = compiled.bind()
    assert binding.p[binding.offsets[0][1]] == -1.0
