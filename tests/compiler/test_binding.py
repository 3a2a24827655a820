"""Numbers of a binding: overrides, arrays, dependencies, and what is wrong with values."""

import json
from dataclasses import replace

import numpy as np
import pytest
from carriers import NumpyCarrier
from catalogue import ONE, PLACE
from chains import blank, chain, coordinate, parameter
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Constraint, ElementSetting, EnergyTerm, InitialCondition, Loop
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")


def oscillator(parameters, stiffness, **more):
    a = x.var("a", "q")
    return blank(
        parameters=parameters,
        coordinates=(coordinate("a"),),
        energies=(
            EnergyTerm("T*", x.power(x.var("a", "f"), x.const(2)), (), PLACE),
            EnergyTerm("V", x.mul(stiffness, a, a), (), PLACE),
        ),
        **more,
    )


def codes(error):
    return [d.code for d in error.value.diagnostics]


def test_values_follow_dependencies_and_overrides(tmp_path):
    k, m, b = x.param("k"), x.param("m"), x.param("b")
    parameters = (parameter("k", x.mul(x.const(2), m)), parameter("b", x.add(k, m)), parameter("m", 3.0))
    model = compile_network(oscillator(parameters, b), backend="numpy")
    assert model.bind().values == {"m": 3.0, "k": 6.0, "b": 9.0}
    assert model.bind({"m": 5.0}).values == {"m": 5.0, "k": 10.0, "b": 15.0}
    assert model.bind({"k": 1.0}).values == {"m": 3.0, "k": 1.0, "b": 4.0}
    np.testing.assert_array_equal(model.bind({"m": 5.0}).p, [10.0, 15.0, 5.0])
    carrier = NumpyCarrier(model.program, model.form, model.bind({"k": 1.0}), tmp_path)
    y = np.ones(carrier.at[-1])
    assert carrier.rows("dynamics", 0.0, y, 0 * y)[0] == 8.0


@pytest.mark.long
def test_long_chains_of_dependencies():
    parameters = tuple(parameter(f"p{i}", x.add(x.param(f"p{i + 1}"), x.const(1))) for i in range(3000))
    model = compile_network(oscillator((*parameters, parameter("p3000", 0.0)), x.param("p0")))
    assert model.bind().values["p0"] == 3000.0


def test_arrays():
    i, n, one = x.index("i"), x.param("n"), x.const(1)
    shape = ((one, n),)
    parameters = (
        parameter("n", 4.0, whole=True),
        parameter("a", x.mul(i, i), shape, ("i",)),
        parameter("s", x.reduction("sum", "j", one, n, x.param("a", x.index("j")))),
        Literal := parameter("c", (x.const(5), x.const(6), x.param("s")), ((x.const(0), x.const(2)),)),
    )
    assert Literal.values[0].data == 5
    model = compile_network(oscillator(parameters, x.mul(x.param("s"), x.param("a", n), x.param("c", x.const(0)))))
    values = model.bind().values
    np.testing.assert_array_equal(values["a"], [1, 4, 9, 16])
    assert values["s"] == 30.0
    np.testing.assert_array_equal(values["c"], [5, 6, 30])
    assert model.bind({"n": 5}).values["s"] == 55.0
    assert model.bind({("a", 2): 0.0}).values["s"] == 26.0
    assert model.bind({"a": [1.0, 1.0, 1.0, 1.0]}).values["s"] == 4.0
    assert model.bind({"a": 2.0}).values["s"] == 8.0


def test_settings_of_elements():
    one, n = x.const(1), x.param("n")
    parameters = (parameter("n", 3.0, whole=True), parameter("a", x.const(1), ((one, n),), ("i",)))
    setting = ElementSetting("a", (n,), x.mul(n, n), PLACE)
    model = compile_network(oscillator(parameters, x.param("a", n), elements=(setting,)))
    np.testing.assert_array_equal(model.bind().values["a"], [1, 1, 9])
    np.testing.assert_array_equal(model.bind({"n": 4}).values["a"], [1, 1, 1, 16])
    np.testing.assert_array_equal(model.bind({("a", 3): 2.0}).values["a"], [1, 1, 2])


def test_division_by_zero_is_e324():
    parameters = (parameter("m", 1.0), parameter("w", x.div(x.const(1), x.param("m"))))
    model = compile_network(oscillator(parameters, x.param("w")))
    with pytest.raises(ModelError) as error:
        model.bind({"m": 0.0})
    assert codes(error) == ["E324"]
    assert "'w'" in error.value.diagnostics[0].message
    assert error.value.diagnostics[0].place is PLACE


def test_a_parameter_that_is_said_to_be_inf_is_told_so():
    model = compile_network(oscillator((parameter("hi", x.const(float("inf"))),), x.param("hi")))
    with pytest.raises(ModelError, match="'hi' is inf"):
        model.bind()


@pytest.mark.parametrize(
    ("overrides", "code"),
    [
        ({"n": 2.5}, "E805"),
        ({"nothing": 1.0}, "E405"),
        ({("m", 11): 1.0}, "E805"),
        ({("m", 1, 1): 1.0}, "E805"),
        ({"m": [1.0, 2.0]}, "E805"),
    ],
)
def test_wrong_overrides(overrides, code):
    with pytest.raises(ModelError) as error:
        compile_network(chain(10)).bind(overrides)
    assert codes(error) == [code]


def test_cycles_are_refused():
    parameters = (parameter("a", x.param("b")), parameter("b", x.param("a")))
    with pytest.raises(ModelError) as error:
        compile_network(oscillator(parameters, x.param("a"))).bind()
    assert codes(error) == ["E807"]


def test_initial_values_outside_a_family():
    i, one, n = x.index("i"), x.const(1), x.param("n")
    net = chain(4)
    wrong = InitialCondition(x.var("x", "q", x.add(i, one)), x.const(0), True, (Loop("i", one, n),), PLACE)
    with pytest.raises(ModelError) as error:
        compile_network(replace(net, initials=(wrong,))).bind()
    assert codes(error) == ["E805"]
    assert "index 5 outside 1..4" in error.value.diagnostics[0].message


@pytest.mark.parametrize(("first", "message"), [(3, "link[2] is missing"), (1, "link[1] is given twice")])
def test_labels_cover_their_hull_once(first, message):
    net = chain(4)
    link = net.constraints[0]
    later = Constraint("phi", "link", link.at, link.expression, (Loop("i", x.const(first), x.param("n")),), ONE, PLACE)
    model = compile_network(replace(net, constraints=(later, net.constraints[1])))
    with pytest.raises(ModelError) as error:
        model.bind()
    assert codes(error) == ["E805"]
    assert message in error.value.diagnostics[0].message


@pytest.mark.long
def test_large_arrays_bind_without_loops_in_python(effort):
    model = compile_network(chain(10))
    _, few = effort(lambda: model.bind({"n": 10}))
    binding, many = effort(lambda: model.bind({"n": 1_000_000}))
    assert many <= 1.05 * few
    assert binding.values["m"].shape == (1_000_000,)


def test_manifest():
    model = compile_network(chain(10), "hamiltonian")
    binding = model.bind()
    found = model.manifest(binding, 3)
    assert json.loads(json.dumps(found)) == found
    assert found["unknowns"][0] == {
        "name": "x[1..10]",
        "shape": [[1, 10]],
        "kind": "q",
        "unit": "1",
        "differential": True,
    }
    names = [u["name"] for u in found["unknowns"]]
    assert names == [
        "x[1..10]",
        "y[1..10]",
        "x[1..10]'",
        "y[1..10]'",
        "x[1..10].p",
        "y[1..10].p",
        "link[1..10].multiplier",
    ]
    differential = {u["name"]: u["differential"] for u in found["unknowns"]}
    assert differential == dict.fromkeys(names[:2], True) | dict.fromkeys(names[2:4], False) | dict.fromkeys(
        names[4:6], True
    ) | {names[6]: False}
    assert [r["kind"] for r in found["rows"]] == ["kinematic"] * 2 + ["dynamics"] * 2 + ["momentum"] * 2 + ["phi"]
    assert found["parameters"][2] == {"name": "n", "unit": "1", "value": 10.0}
    assert set(found) == {
        "version",
        "model",
        "scene",
        "formulation",
        "index",
        "unknowns",
        "rows",
        "parameters",
        "structure",
    }
    assert len(json.dumps(model.manifest(model.bind({"n": 100_000}))["unknowns"])) < 1000


def test_indices_outside_their_family_are_e805_before_anything_reads_them():
    i, one, n = x.index("i"), x.const(1), x.param("n")
    stretch = x.power(x.sub(x.var("x", "q", i), x.var("x", "q", x.sub(i, one))), x.const(2))
    net = chain(4)
    wrong = EnergyTerm("V", stretch, (Loop("i", one, n),), PLACE)
    with pytest.raises(ModelError) as error:
        compile_network(replace(net, energies=(*net.energies, wrong))).bind()
    assert [(d.code, d.message) for d in error.value.diagnostics] == [("E805", "x: index 0 outside 1..4")]
    norm = x.sqrt(x.reduction("sum", "i", one, x.add(n, one), x.power(x.var("y", "q", i), x.const(2))))
    seen = replace(net.observations[0], expression=norm)
    with pytest.raises(ModelError) as error:
        compile_network(replace(net, observations=(seen,))).bind()
    assert [d.message for d in error.value.diagnostics] == ["y: index 5 outside 1..4"]


def test_arrays_beyond_all_memory_are_refused():
    with pytest.raises(ModelError) as error:
        compile_network(chain(4)).bind({"n": 1e9})
    assert codes(error) == ["E805"]
