"""What `sysdyn linearize` prints and refuses, and what other tools say of the same matrices."""

import numpy as np
import pytest
from linearized import ALL, CLOSE, RLC, SEED, alike, linear
from scipy import signal
from sysdyn.api import linearize
from sysdyn.cli.main import run
from texts import run_json, write


@pytest.mark.long
def test_the_reduction_is_a_state_space_of_scipy(tmp_path, capsys):
    found = linear(capsys, write(tmp_path, RLC), "--equilibrium", "--outputs", "c.e")
    small = found["reduced"]
    system = signal.StateSpace(*(np.array(small[k]) for k in "ABCD"))
    time = np.linspace(0.0, 1.5, 40)
    _, response = signal.step(system, T=time)
    w = np.sqrt(100 - 9.0)
    expected = 1 - np.exp(-3 * time) * (np.cos(w * time) + 3 / w * np.sin(w * time))
    assert response == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.long
def test_the_descriptor_matrices_have_the_transfer_function(formulation, tmp_path, capsys):
    found = linear(capsys, write(tmp_path, RLC), "--formulation", formulation, "--equilibrium", "--outputs", "v,v_r")
    e, a, b, c, d = (np.array(found[k]) for k in "EABCD")
    for s in (0.3j, 7.0j, 2.0 + 1.0j):
        response = (c + s * np.array(found.get("Cd", 0.0 * c))) @ np.linalg.solve(s * e - a, b) + d
        below = 0.01 * s**2 + 0.06 * s + 1
        assert response[:, 0] == pytest.approx([1 / below, 0.06 * s / below], rel=CLOSE)


# -- the command -------------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_the_table_names_modes_and_transfer_functions(tmp_path, capsys):
    assert run(["linearize", str(write(tmp_path, RLC)), "--outputs", "v", "--backend", "numpy"]) == 0
    out, err = capsys.readouterr()
    assert "-3" in out
    assert "v [V] by u [V]" in out
    assert "gain   100, at rest 1" in out
    assert "at rest" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--inputs", "uu"), "there is no parameter or input 'uu'; nearest: 'u'"),
        (("--inputs", "supply.e"), "'supply.e' is no parameter or input, but what an element gives"),
        (("--inputs", "u[1]"), "'u[1]': is no array"),
        (("--at", "1", "--equilibrium"), "an instant of a run, or a state of rest"),
        (("--at", "-1"), "--at -1 s lies before the start"),
    ],
)
@pytest.mark.one_in(3)
def test_wrong_usage(options, message, tmp_path, capsys):
    code, found = run_json(capsys, "linearize", str(write(tmp_path, RLC)), "--backend", "numpy", *options)
    assert code == 2
    assert message in found["diagnostics"][0]["message"]


def test_an_output_that_does_not_exist(tmp_path, capsys):
    code, found = run_json(capsys, "linearize", str(write(tmp_path, RLC)), "--outputs", "c.z", "--backend", "numpy")
    assert code == 2
    assert found["diagnostics"][0]["severity"] == "error"


@pytest.mark.parametrize(("model", "outputs"), [("motor", ("om", "i")), ("circuit", ("c.e", "v_r"))])
def test_python_control_says_the_same(model, outputs, tmp_path):
    """Poles, zeros, static gain and frequency response by python-control of the reduction, where it is installed."""
    control = pytest.importorskip("control")
    path = SEED / "dc_motor.sd" if model == "motor" else write(tmp_path, RLC)
    found = linearize(path, inputs=["E"] if model == "motor" else None, outputs=outputs)
    system = found.control()
    assert list(system.output_labels) == [name.replace(".", "_") for name in found.outputs]
    alike(np.sort_complex(control.poles(system)), np.sort_complex(found.eigenvalues))
    for k in range(len(outputs)):
        single, ours = system[k, 0], found.transfer_function(k)
        theirs = control.zeros(single)  # those of modes that the output does not see among them
        assert all(np.abs(theirs - zero).min() <= CLOSE * abs(zero) for zero in ours.zeros)
        for s in (0.3j, 7.0j, 200.0j):
            by_poles = ours.gain * np.prod(s - np.asarray(ours.zeros)) / np.prod(s - np.asarray(ours.poles))
            assert single(s) == pytest.approx(by_poles, rel=CLOSE)
        assert single.dcgain() == pytest.approx(found.transfers[k].static, rel=CLOSE, abs=1e-12)


def test_a_response_of_nothing_says_what_is_missing(tmp_path, capsys):
    text = "model m {\n  state v: V = 1 V\n  dynamic v' = (3 V*sin(t/(1 s)) - v)/(1 s)\n}\n"
    path = write(tmp_path, text + "scene s of m { time 0 s to 1 s; trace v }\n")
    for options, said in (((), "the model has no input"), (("--inputs", "t"), None)):
        code = run(["linearize", str(path), "--response", "bode", "--backend", "numpy", *options])
        err = capsys.readouterr().err
        assert (code, "no bode: " in err) == ((0, True) if said else (2, False))
        assert said is None or said in err
