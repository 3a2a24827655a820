"""What the seed asks a modeller to be able to do (tests/data/README.md): numerics and beyond, 44 to 59."""

import json

import numpy as np
import pytest
from book_entries import BOOK, begin, filled, solution, state
from capabilities import REFERENCES, counts, entries, meets, printed
from model_runs import trace_of
from reduced import ROOT
from sysdyn.cli.main import run
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.dsl.model import expression as ex


@pytest.mark.parametrize(
    ("method", "error"), [("euler", 2e-2), ("bdf", 1e-6), ("radau", 1e-6)],
    ids=["44_implicit_euler", "45_bdf", "46_implicit_runge_kutta"],
)  # fmt: skip
@pytest.mark.one_in(5)
def test_44_45_46_methods(method, error, tmp_path):
    """The undamped oscillator over one of its periods."""
    text = (BOOK / "mass_spring.sd").read_text().replace("scene reference of mass_spring {", "scene s of mass_spring {")
    how = "solver euler(step = 1 ms)" if method == "euler" else f"solver {method}\n  accuracy 1e-8"
    text = text.replace("  trace q1", f"  {how}\n  trace q1")
    found = trace_of(tmp_path, text, until="1")
    values = REFERENCES["mass_spring"]
    m, k = (values["parameters"][n] for n in ("M", "k"))
    x, v = (values["initial"][n] for n in ("x", "v"))
    w = np.sqrt(k / m)
    exact = x * np.cos(w * found.time) + v / w * np.sin(w * found.time)
    assert np.max(np.abs(found["q1"].values - exact)) <= error * np.max(np.abs(exact))


@pytest.mark.long
def test_47_differential_index():
    """0 to 3, of each kind of constraint; none where a constraint is stated twice."""
    wanted = {"mass_spring": 0, "dc_motor": 1, "knife_edge": 2, "slider_crank": 3, "redundant_pendulum": None}
    for key, index in wanted.items():
        assert {facts.index for _, _, facts in meets(key, "lagrangian")} == {index}


@pytest.mark.long
def test_48_index_reduction():
    """Phi replaced by its second derivative: the rows hold on the solution and determine f' and kappa."""
    (entry,) = entries("slider_crank", "lagrangian")
    with ex.fresh():
        prepared, found = begin(entry)
        form = prepared.compiled.form
        oracle = Oracle(form, prepared.binding)
        for t, row in solution(entry):
            y, yd = state(form, row)
            yd = filled(oracle, t, y, yd)
            for block in ("phi_rate", "phi_acceleration"):
                scale = oracle.magnitudes(block, t, y, yd).max()
                assert np.max(np.abs(oracle.rows(block, t, y, yd))) <= 1e-13 * max(scale, 1.0)
        assert found.system.another("1").form.name == "1"


@pytest.mark.long
def test_49_drift_and_its_stabilisation(tmp_path):
    """Forms of lower index keep the constraint where the plain underlying equation leaves it (the seed: 4e-6)."""
    text = (BOOK / "pendulum.sd").read_text().replace("trace q1", "trace q1^2 + q2^2 as square, q1")
    for index in ("1", "2"):
        found = trace_of(tmp_path, text, scene="reference", accuracy=1e-5, index=index)
        length = REFERENCES["pendulum"]["parameters"]["l"]
        assert np.max(np.abs(found["square"].values - length**2)) <= 1e-8


@pytest.mark.long
def test_50_generated_files(tmp_path, capsys):
    """Function file, its data, and the names of rows and unknowns."""
    options = ["--scene", "reference", "-o", str(tmp_path), "--quiet"]
    assert run(["compile", str(BOOK / "slider_crank.sd"), *options]) == 0
    capsys.readouterr()
    assert {"residual.c", "binding.json", "manifest.json", "sysdyn_model.h"} <= {p.name for p in tmp_path.iterdir()}
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert "phi_1.multiplier" in [u["name"] for u in manifest["unknowns"]]


@pytest.mark.long
def test_51_constraint_errors(tmp_path):
    """A meter in every trace."""
    found = trace_of(tmp_path, (BOOK / "slider_crank.sd").read_text(), scene="reference", until="1")
    assert 0.0 <= np.max(found["audit/constraints"].values) <= 1e-6


@pytest.mark.long
def test_52_verification_by_a_transfer_function(tmp_path):
    """(6.43): the lead filter in the steady state against its transfer function."""
    text = (ROOT / "models" / "seed" / "lead_filter.sd").read_text()
    found = trace_of(tmp_path, text, scene="reference", accuracy=1e-7)
    p = REFERENCES["lead_filter"]["parameters"]
    s = 1j * p["w"]
    gain = p["R2"] * (1 + p["R1"] * p["C"] * s) / (p["R1"] + p["R2"] + p["R1"] * p["R2"] * p["C"] * s)
    rate = (p["R1"] + p["R2"]) / (p["R1"] * p["R2"] * p["C"])
    late = np.exp(-rate * found.time) < 1e-7
    assert late.sum() > 100
    steady = np.imag(p["E"] * gain * np.exp(s * found.time))
    assert np.max(np.abs(found["e_o"].values - steady)[late]) <= 1e-6 * abs(p["E"] * gain)


# -- afterword ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["bouncing_ball", "stiction_oscillator"])
@pytest.mark.long
def test_53_inequality_constraints(model, tmp_path):
    """Unilateral contact with restitution, dry friction with sticking: against the exact piecewise solutions."""
    reference = REFERENCES[model]
    text = (ROOT / "models" / "seed" / f"{model}.sd").read_text()
    times = reference["t"][1:]
    found = trace_of(tmp_path, text, scene="reference", accuracy=1e-7, at=",".join(map(repr, times)))
    places = [int(np.argmin(np.abs(found.time - t))) for t in times]
    for name, values in reference["values"].items():
        assert np.max(np.abs(found[name].values[places] - values[1:])) <= 1e-6 * np.max(np.abs(values)), name


@pytest.mark.long
def test_54_stability_of_constrained_systems(capsys):
    """Of the inverted pendulum in Cartesian coordinates: one growing mode, that of th'' = (g/l) th - (c/m) th'."""
    path = str(ROOT / "models" / "seed" / "inverted_pendulum.sd")
    assert run(["linearize", path, "--scene", "reference", "--set", "th_0=3.141592653589793", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["result"]["eigenvalues"]
    p = REFERENCES["inverted_pendulum"]["parameters"]
    damping = p["c"] / p["m"] / 2
    growing = -damping + np.sqrt(damping**2 + p["g"] / p["l"])
    assert max(re for re, _ in found) == pytest.approx(growing, rel=1e-6)


@pytest.mark.long
def test_55_distributed_parameters():
    """A line in pieces: eight cells, 17 branches, 8 junctions."""
    assert counts("lc_ladder") == {(17, 8, 0, 0, 0)}


@pytest.mark.long
def test_56_multibody():
    """A closed chain, an arm, slider and crank."""
    for key in ("parallelogram", "two_link_arm", "slider_crank"):
        meets(key)


@pytest.mark.long
def test_57_kane(capsys):
    """Without the multiplier of the blade, and of an effort constraint; quasi-velocities: test_kane.py."""
    lines = printed(capsys, "knife_edge_sin_cos_form", "kane")
    assert not any("μ" in line for line in lines)
    assert "J f3' = 0" in lines
    assert not any("μ" in line for line in printed(capsys, "two_tank", "co_kane"))


@pytest.mark.long
def test_58_control_laws():
    """Integral and proportional-integral: a dynamic and an effort constraint."""
    for key in ("integral_controller", "pi_controller", "brake_by_wire"):
        assert all(m3 and m4 for _, _, _, m3, m4 in counts(key))


@pytest.mark.long
def test_59_redundant_constraints():
    """The rod stated twice: its rows hold for any share of the two multipliers, and one row is named redundant."""
    for _, _, facts in meets("redundant_pendulum"):
        assert (facts.dof, facts.redundant, facts.index) == (1, 1, None)
