"""`sysdyn verify`: formulations and methods agree on all scenes of all models, and a wrong one is found and named."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from schema import conforms
from sysdyn.cli.main import run
from sysdyn.cli.options import TRIED
from sysdyn.cli.verify import twins, verification
from sysdyn.compiler import pipeline
from sysdyn.dsl.model import expression as ex
from sysdyn.runtime.trace.trace import Trace
from texts import PENDULUM, ROOT, run_json, write
from verified import CIRCUIT, FOUR, GAP, LONG, both, names

MODELS = ROOT / "models"

LORENZ = """\
model lorenz {
  state x: 1 = 1
  state y: 1 = 1
  state z: 1 = 20
  dynamic x' = 10 Hz*(y - x)
  dynamic y' = 1 Hz*(x*(28 - z) - y)
  dynamic z' = 1 Hz*(x*y - 8/3*z)
}

scene chaos of lorenz {
  time 0 s to 40 s
  trace x, y, z every 10 ms
}
"""


@pytest.fixture(autouse=True)
def _without_co_kane(request, monkeypatch):
    """Every circuit has it, beside co_lagrangian: some tests, and scenes with SYSDYN_LONG=1, run it."""
    name = request.node.originalname
    if not name.startswith("test_kane") and not (LONG and name == "test_every_scene_agrees"):
        monkeypatch.setattr(verification, "EVERY", TRIED)


# --- models -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "options", "formulations"),
    [
        ("gallery/slider_crank", ("--scene", "coast"), FOUR[:2]),  # phi
        ("gallery/knife_edge", ("--until", "2"), FOUR[:2]),  # psi, whose reaction is traced
        ("seed/knife_edge", ("--until", "2"), (*FOUR[:2], "kane")),  # psi
        ("gallery/friction_book", (), FOUR[:2]),  # gamma
        ("gallery/chain_1000", ("--until", "0.05"), FOUR[:2]),  # arrays, reduced by ci.toml
        ("seed/dc_motor", (), FOUR),
        ("seed/two_tank", (), FOUR),
        ("seed/nonlinear_spring", (), FOUR),
    ],
)
@pytest.mark.long
def test_models_of_each_kind_agree(name, options, formulations, capsys):
    code, found = run_json(capsys, "verify", str(MODELS / f"{name}.sd"), *options)
    assert code == 0, found["diagnostics"]
    assert names(found["result"]) == both(*formulations)
    assert found["result"]["disagreements"] == []
    assert found["result"]["compared"]
    assert found["result"]["horizon"] == found["result"]["runs"][0]["reached"]
    assert max(r["worst"]["ratio"] for r in found["result"]["runs"][1:]) < 0.2


@pytest.mark.parametrize("name", ["seed/gear_pair", "seed/lever"])
@pytest.mark.long
def test_kane_agrees_in_momenta_too(name, capsys):
    code, found = run_json(capsys, "verify", str(MODELS / f"{name}.sd"))
    assert code == 0, found["diagnostics"]
    assert {("co_kane", "bdf"), ("co_kane", "radau")} <= set(names(found["result"]))
    assert found["result"]["disagreements"] == []


@pytest.mark.long
def test_kane_is_not_run_where_every_reaction_is_read(capsys):
    """What a source supplies reads its reaction: the rows are those of the Lagrangian in momenta."""
    code, found = run_json(capsys, "verify", str(MODELS / "seed/lead_filter.sd"))
    assert code == 0, found["diagnostics"]
    assert "co_lagrangian" in {formulation for formulation, _ in names(found["result"])}
    assert "co_kane" not in {formulation for formulation, _ in names(found["result"])}


def scenes():
    """(file, scene) of every scene in models/ but the book's variants, whose solutions are those of models/seed."""
    for path in sorted(p for p in MODELS.glob("*/*.sd") if p.parent.name != "book"):
        for scene in re.findall(r"^scene (\w+)", path.read_text(), re.MULTILINE):
            yield path.relative_to(MODELS).as_posix(), scene


WARNED = ("gallery/piston_pump.sd",)
"""Models whose index kane cannot tell at the start, where both valves are closed and nothing flows."""


SHORT = {
    ("benchmark/ring.sd", "reference"): "10 us",
    ("benchmark/beam.sd", "reference"): "0.2 s",
    ("gallery/chain_1000.sd", "fall"): "0.5 s",
    ("gallery/ev_powertrain.sd", "accurate"): "10 s",
}
"""Ends of scenes that take long; SYSDYN_LONG=1: whole."""

COSTLY = (
    ("benchmark/tube.sd", "reference"), ("benchmark/crank.sd", "reference"),  # stiff: their first percent takes long
    ("benchmark/nltl.sd", "reference"), ("benchmark/lc_line.sd", "reference"),  # lines like gallery/transmission_line
    ("gallery/ev_powertrain.sd", "launch"), ("gallery/ev_powertrain.sd", "fast"),  # the car of "accurate"
)  # fmt: skip
"""Scenes with SYSDYN_LONG=1 alone: tests/models run them always."""


@pytest.mark.parametrize(("file", "scene"), list(scenes()))
@pytest.mark.long
def test_every_scene_agrees(file, scene, capsys):
    if (file, scene) in COSTLY and not LONG:
        pytest.skip("SYSDYN_LONG=1 verifies it")
    end = [] if LONG or (file, scene) not in SHORT else ["--until", SHORT[file, scene]]
    code, found = run_json(capsys, "verify", str(MODELS / file), "--scene", scene, "--max-wall", "600", *end)
    errors = [d["message"] for d in found["diagnostics"] if d["severity"] == "error"]
    assert code == 0, errors
    assert found["result"]["horizon"] == found["result"]["runs"][0]["reached"]
    assert file in WARNED or all(not r["warnings"] for r in found["result"]["runs"])


@pytest.mark.long
def test_a_method_is_verified_beside_bdf_where_a_formulation_has_it(capsys):
    """Of an amplifier without capacitors at its nodes the complementary forms have no underlying equation."""
    path = str(MODELS / "benchmark/transistor.sd")
    code, found = run_json(capsys, "verify", path, "--method", "dopri", "--until", "1 ms")
    assert code == 0, found["diagnostics"]
    by = {f: [m for g, m in names(found["result"]) if g == f] for f, _ in names(found["result"])}
    assert by["lagrangian"] == by["hamiltonian"] == ["dopri", "bdf"]
    assert by["co_lagrangian"] == by["co_hamiltonian"] == ["bdf", "radau"]
    assert max(r["worst"]["ratio"] for r in found["result"]["runs"][1:]) < 0.1


# --- what is wrong is found -------------------------------------------------------------------------------------------


def wrong_potential(lowering):
    """A lowering that takes the potential energy with the other sign."""

    def lowered(model):
        terms = tuple(replace(term, expression=ex.neg(term.expression)) for term in model.function("V"))
        return lowering(replace(model, functions={**model.functions, "V": terms}))

    return lowered


def wrong_resistor(reflect):
    """A reflection that gives dissipators the other sign."""

    def reflected(network):
        found = reflect(network)
        branches = (replace(b, law=ex.neg(b.law)) if b.kind == "dissipator" else b for b in found.branches)
        return replace(found, branches=tuple(branches))

    return reflected


def test_a_wrong_sign_in_one_formulation_is_found_and_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(pipeline.FORMULATIONS, "hamiltonian", wrong_potential(pipeline.FORMULATIONS["hamiltonian"]))
    path = write(tmp_path, PENDULUM.replace("  expect always: abs(audit.energy) <= 1 J\n", ""))
    code, found = run_json(capsys, "verify", path)
    assert code == 1
    pairs = [[(r["formulation"], r["method"]) for r in d["runs"]] for d in found["result"]["disagreements"]]
    assert pairs == [[("lagrangian", "bdf"), ("hamiltonian", m)] for m in ("bdf", "radau")]
    worst = found["result"]["disagreements"][0]
    conforms(worst, GAP)
    assert worst["variable"] in ("x", "y", "speed")
    assert worst["ratio"] > 100.0
    assert 0.0 < worst["first"] <= worst["time"] <= 1.0
    messages = [d["message"] for d in found["diagnostics"] if d["severity"] == "error"]
    assert len(messages) == 2
    assert f"lagrangian bdf and hamiltonian bdf disagree: {worst['variable']} is" in messages[0]


def test_a_wrong_sign_in_the_complementary_family_is_found(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(pipeline, "reflect", wrong_resistor(pipeline.reflect))
    assert run(["verify", write(tmp_path, CIRCUIT)]) == 1
    shown = capsys.readouterr()
    assert "8 runs: they disagree" in shown.out
    assert "lagrangian bdf and co_lagrangian bdf disagree: " in shown.err
    assert "and hamiltonian" not in shown.err


@pytest.mark.long
def test_a_reference_that_explodes_differs_from_all_others(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(pipeline.FORMULATIONS, "lagrangian", wrong_potential(pipeline.FORMULATIONS["lagrangian"]))
    path = write(tmp_path, CIRCUIT)
    code, found = run_json(capsys, "verify", path, "--formulation", "lagrangian", "--max-steps", "5000")
    assert code in (1, 3)
    others = [d["runs"] for d in found["result"]["disagreements"] if d["runs"][0] == found_run("lagrangian", "bdf")]
    assert {pair[1]["formulation"] for pair in others} == set(FOUR[1:])


def found_run(formulation, method):
    """A run as disagreements name it."""
    return {"formulation": formulation, "method": method}


def test_carriers_that_differ_are_found(tmp_path, capsys, monkeypatch):
    class Off(twins.System):
        def residual(self, t, y, yd):
            return super().residual(t, y, yd) * (1.0 + 1e-6)

    monkeypatch.setattr(twins, "System", Off)
    code, found = run_json(capsys, "verify", write(tmp_path, PENDULUM))
    assert code == 1
    assert found["result"]["disagreements"] == []
    assert [b["ok"] for b in found["result"]["backends"]] == [False, False]
    assert "c and numpy disagree in hamiltonian: row" in found["diagnostics"][-1]["message"]


CHARGED = """model charged {
  node a, d: electrical
  V: effort(e = 3 V*cos(200 rad/s*t)) a -> ground
  R: dissipator(e = 20 ohm*f) a -> d
  C1: potential(q = 100 uF*e) d -> ground
  C2: potential(e = q/(50 uF)) d -> ground
  C3: potential(q = 10 uF*e) a -> d
  init C1.e = 1 V
}
scene s of charged {
  time 0 s to 10 ms
  trace d.e
}
"""


@pytest.mark.long
def test_constants_of_integrated_rows_that_the_start_finds_are_those_of_both_carriers(tmp_path, capsys):
    """'c and numpy disagree in lagrangian: row a by 1.4e-02 of itself', of a right model."""
    code, found = run_json(capsys, "verify", write(tmp_path, CHARGED))
    assert (code, found["result"]["disagreements"]) == (0, [])
    assert all(b["ok"] for b in found["result"]["backends"])


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.one_in(2)
def test_a_chaotic_model_is_compared_up_to_its_horizon(tmp_path, method, capsys):
    path = write(tmp_path, LORENZ)
    assert run(["verify", path, "--method", method]) == 0
    shown = capsys.readouterr()
    (line,) = (line for line in shown.out.splitlines() if line.startswith("horizon: "))
    # roundoff of 1e-16 grows by exp(0.9/s t): to 1e-3 in about 33 s at best
    assert 10.0 < float(line.split()[1]) < 35.0
    assert "of 40 s, then" in line
    assert "accuracy asked for was not reached" in shown.err


def test_multipliers_of_redundant_constraints_are_left_out(tmp_path, capsys):
    text = PENDULUM.replace("  init x'", "  phi again: 2*x^2 + 2*y^2 = 2*l^2\n  init x'")
    text = text.replace("time 0 s to 1 s", "time 0 s to 0.5 s\n  redundancy minimum_norm")
    text = text.replace("x' as speed", "rod.multiplier as tension, -again.multiplier as other")
    code, found = run_json(capsys, "verify", write(tmp_path, text))
    assert code == 0, found["diagnostics"]
    assert found["result"]["compared"] == ["x", "y"]
    assert [item["variable"] for item in found["result"]["not_compared"]] == ["other", "tension"]


def test_quantities_without_an_accuracy_are_left_out(tmp_path, capsys):
    text = PENDULUM.replace("every 10 ms", "every 10 ms\n  accuracy 1e-5 on x")
    code, found = run_json(capsys, "verify", write(tmp_path, text))
    assert code == 0, found["diagnostics"]
    assert found["result"]["compared"] == ["x"]
    assert {item["reason"] for item in found["result"]["not_compared"]} == {"no accuracy is asked of it"}


@pytest.mark.long
def test_a_scene_that_traces_nothing_is_compared_on_its_coordinates(tmp_path, capsys):
    text = re.sub(r"  trace .*\n", "", PENDULUM)
    code, found = run_json(capsys, "verify", write(tmp_path, text))
    assert code == 0
    assert found["result"]["compared"] == ["x", "y"]


@pytest.mark.long
def test_without_an_interval_the_runs_share_instants(tmp_path, capsys):
    path = write(tmp_path, PENDULUM.replace(" every 10 ms", ""))
    assert run(["verify", "-q", path, "-o", "kept", "--at", "0.1234"]) == 0
    times = [Trace.open(file).time for file in sorted(Path("kept").glob("*.h5"))]
    assert len(times) == 5
    assert times[0].size == 202
    assert 0.1234 in times[0]
    assert all(np.array_equal(t, times[0]) for t in times)
