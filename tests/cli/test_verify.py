"""`sysdyn verify`: formulations and methods agree on all scenes of all models, and a wrong one is found and named."""

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from schema import EXPECT, NUMBER, STATISTICS, conforms, envelope
from sysdyn.cli.main import run
from sysdyn.cli.options import TRIED
from sysdyn.cli.verify import twins, verification
from sysdyn.cli.verify.agreement import gaps, horizon
from sysdyn.compiler import pipeline
from sysdyn.dsl.model import expression as ex
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.trace.trace import Quantity, Trace
from texts import FAILING, PENDULUM, ROOT, STUCK, TWO_SCENES, run_json, write

MODELS = ROOT / "models"
LONG = os.environ.get("SYSDYN_LONG") == "1"
FOUR = ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"]
VERIFY = {
    "runs": list,
    "disagreements": list,
    "horizon": (*NUMBER, type(None)),
    "compared": list,
    "not_compared": list,
    "not_expressible": list,
    "backends": list,
}
RUN = {
    "formulation": str,
    "method": str,
    "index": str,
    "accuracy": NUMBER,
    "final": bool,
    "reached": NUMBER,
    "statistics": dict,
    "timings": dict,
    "error_estimate": (*NUMBER, type(None)),
    "energy": NUMBER,
    "constraints": NUMBER,
    "worst": (dict, type(None)),
    "expects": list,
    "warnings": list,
    "failure": (str, type(None)),
    "trace": (str, type(None)),
}
GAP = {"variable": str, "time": NUMBER, "ratio": (*NUMBER, type(None)), "values": list}

CIRCUIT = """\
from std.electrical import resistor, capacitor, inductor, voltage

model ring {
  node a, b: electrical
  V1: voltage(v = 5 V*sin(40 rad/s*t)) a -> ground
  L1: inductor(L = 10 mH) a -> b
  C1: capacitor(C = 2 mF) b -> ground
  R1: resistor(R = 3 ohm) b -> ground
  init C1.e = 1 V
  init L1.f = 0 A
}

scene hum of ring {
  time 0 s to 0.1 s
  trace b.e as v, L1.f as i
}
"""

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


def names(result):
    """(formulation, method) of each run at the accuracy asked; the last is the reference's finer one."""
    return [(r["formulation"], r["method"]) for r in result["runs"][:-1]]


def both(*formulations):
    """Each formulation by both methods, bdf first."""
    return [(f, m) for f in formulations for m in ("bdf", "radau")]


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
@pytest.mark.one_in(9)
def test_models_of_each_kind_agree(name, options, formulations, capsys):
    code, found = run_json(capsys, "verify", str(MODELS / f"{name}.sd"), *options)
    assert code == 0, found["diagnostics"]
    assert names(found["result"]) == both(*formulations)
    assert found["result"]["disagreements"] == []
    assert found["result"]["compared"]
    assert found["result"]["horizon"] == found["result"]["runs"][0]["reached"]
    assert max(r["worst"]["ratio"] for r in found["result"]["runs"][1:]) < 0.2


@pytest.mark.parametrize("name", ["seed/gear_pair", "seed/lever"])
@pytest.mark.one_in(3)
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
@pytest.mark.one_in(204)
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


def test_constants_of_integrated_rows_that_the_start_finds_are_those_of_both_carriers(tmp_path, capsys):
    """'c and numpy disagree in lagrangian: row a by 1.4e-02 of itself', of a right model."""
    code, found = run_json(capsys, "verify", write(tmp_path, CHARGED))
    assert (code, found["result"]["disagreements"]) == (0, [])
    assert all(b["ok"] for b in found["result"]["backends"])


def test_an_expectation_that_fails_is_listed_and_never_decides(tmp_path, capsys):
    code, found = run_json(capsys, "verify", write(tmp_path, FAILING))
    assert code == 0
    assert not [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert [e["ok"] for r in found["result"]["runs"] for e in r["expects"]] == [False] * 5
    assert found["result"]["disagreements"] == []


def test_a_solver_that_stops_is_exit_3_with_time_and_run(tmp_path, capsys):
    code, found = run_json(capsys, "verify", write(tmp_path, STUCK), "--max-wall", "20")
    assert code == 3
    failures = [d for d in found["diagnostics"] if "the solver stopped at t = " in d["message"]]
    assert any(d["message"].startswith("lagrangian bdf: ") for d in failures)
    lines = Path(found["diagnostics"][0]["file"]).read_text().splitlines()
    for d in failures:  # each names its statement
        assert re.fullmatch("E93[0-4]", d["code"])
        assert lines[d["line"] - 1][d["column"] - 1 :].strip()
    stopped = [r for r in found["result"]["runs"] if r["failure"]]
    assert {r["diagnostic"]["code"] for r in stopped} <= {d["code"] for d in failures}
    assert all(r["diagnostic"]["line"] for r in stopped)
    assert all((r["diagnostic"] is None) == (r["failure"] is None) for r in found["result"]["runs"])
    # what the runs had is compared all the same
    assert 0.9 < found["result"]["horizon"] <= 1.0
    assert found["result"]["disagreements"] == []


# --- what is compared -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("at", "shown"), [("co_lagrangian", 4), ("hamiltonian", 2), (None, 0)])
def test_an_interruption_shows_the_runs_so_far(tmp_path, capsys, monkeypatch, at, shown):
    made = verification._Verification._formulation

    def interrupted(self, name):
        if name == at:
            raise KeyboardInterrupt
        made(self, name)

    monkeypatch.setattr(verification._Verification, "_formulation", interrupted)
    code = run(["verify", write(tmp_path, CIRCUIT), "--jobs", "1"])
    out, said = capsys.readouterr()
    assert code == 130
    assert "interrupted" in said
    assert len(re.findall(r"^(?:co_)?(?:lagr|hamilt)\w+ +(?:bdf|radau) ", out, re.M)) == shown + (shown > 0)
    assert (f"{shown} runs agree on" in out) == (shown > 0)


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


def test_a_scene_that_traces_nothing_is_compared_on_its_coordinates(tmp_path, capsys):
    text = re.sub(r"  trace .*\n", "", PENDULUM)
    code, found = run_json(capsys, "verify", write(tmp_path, text))
    assert code == 0
    assert found["result"]["compared"] == ["x", "y"]


def test_without_an_interval_the_runs_share_instants(tmp_path, capsys):
    path = write(tmp_path, PENDULUM.replace(" every 10 ms", ""))
    assert run(["verify", "-q", path, "-o", "kept", "--at", "0.1234"]) == 0
    times = [Trace.open(file).time for file in sorted(Path("kept").glob("*.h5"))]
    assert len(times) == 5
    assert times[0].size == 202
    assert 0.1234 in times[0]
    assert all(np.array_equal(t, times[0]) for t in times)


def test_formulation_and_method_name_the_reference(tmp_path, capsys):
    options = ("--formulation", "co_hamiltonian", "--method", "radau")
    code, found = run_json(capsys, "verify", write(tmp_path, CIRCUIT), *options)
    assert code == 0
    assert names(found["result"])[:2] == [("co_hamiltonian", "radau"), ("co_hamiltonian", "bdf")]
    assert {f for f, _ in names(found["result"])} == set(FOUR)
    finer = found["result"]["runs"][-1]
    assert (finer["formulation"], finer["method"]) == ("co_hamiltonian", "radau")
    assert finer["accuracy"] == pytest.approx(1e-5)


def test_the_numpy_backend_agrees(tmp_path, capsys):
    assert run(["verify", "--backend", "numpy", "--until", "0.05", write(tmp_path, PENDULUM)]) == 0
    assert "residuals of numpy and c: " in capsys.readouterr().out


# --- sizes ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def sized(tmp_path):
    """A model in a folder below a ci.toml that sets its mass."""
    (tmp_path / "own").mkdir()
    (tmp_path / "ci.toml").write_text('[own.swing]\nm = 2.5\nl = "300 cm"\n')
    return write(tmp_path / "own", PENDULUM.replace("expect always: abs(audit.energy) <= 1 J", ""), "swing.sd")


@pytest.mark.parametrize(
    ("options", "mass", "length"),
    [((), 2.5, 3.0), (("--set", "m=5"), 5.0, 3.0), (("--full",), 1.13, 2.34)],
)
def test_sizes_of_ci_toml_hold_unless_the_command_line_wins(sized, options, mass, length, capsys):
    assert run(["verify", sized, "-o", "kept", "--until", "0.1", *options]) == 0
    parameters = Trace.open("kept/lagrangian-bdf.h5").parameters
    assert (parameters["m"][0], parameters["l"][0]) == (mass, length)
    assert ("ci.toml: " in capsys.readouterr().err) == ("--full" not in options)


@pytest.mark.parametrize("text", ["[own.swing]\nm = ", "[own]\nswing = 3\n", "[own.swing]\nm = [1, 2]\n"])
def test_sizes_that_are_none_are_wrong_usage(sized, text, tmp_path, capsys):
    (tmp_path / "ci.toml").write_text(text)
    code, found = run_json(capsys, "verify", sized)
    assert code == 2
    assert "ci.toml" in found["diagnostics"][0]["message"]


# --- the command ------------------------------------------------------------------------------------------------------


def test_the_object_of_json(tmp_path, capsys):
    code, found = run_json(capsys, "verify", write(tmp_path, PENDULUM))
    assert code == 0
    envelope(found, "verify", VERIFY)
    result = found["result"]
    assert names(result) == both("lagrangian", "hamiltonian")
    for item in result["runs"]:
        conforms(item, RUN)
        conforms(item["statistics"], STATISTICS)
        assert item["trace"] is None
        for claim in item["expects"]:
            conforms(claim, {key: EXPECT[key] for key in ("text", "ok")})
    assert result["runs"][0]["worst"] is None
    for item in result["runs"][1:]:
        conforms(item["worst"], GAP)
    assert result["horizon"] == 1.0
    assert sorted(result["compared"]) == ["speed", "x", "y"]
    refused = {r["formulation"]: r["code"] for r in result["not_expressible"]}
    assert (refused["co_lagrangian"], refused["co_hamiltonian"]) == ("E602", "E602")


def test_the_table_is_aligned_and_nothing_is_left_behind(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    assert run(["verify", path]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "swing of pendulum: 0 s to 1 s, apart in units of 10 x 0.0001 x nominal"
    head, *rows = lines[1:7]
    for column in ("formulation", "method", "worst"):
        at = head.index(column)
        assert all(row[at] != " " and (at == 0 or row[at - 1] == " ") for row in rows), column
    for column in ("index", "accuracy", "steps", "estimate", "energy J", "constraints", "apart", "at s"):
        end = head.index(column) + len(column)
        assert all(row[end - 1] != " " and row[end : end + 1] in ("", " ") for row in rows), column
    assert lines[-1] == "4 runs agree on 3 quantities"
    assert [p.name for p in tmp_path.iterdir()] == ["model.sd"]


def test_no_timings_gives_the_same_table_twice(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    shown = []
    for _ in range(2):
        assert run(["verify", "--no-timings", path]) == 0
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1]
    assert "CPU" not in shown[0]


@pytest.mark.parametrize(
    ("text", "options", "exit_code", "said"),
    [
        (TWO_SCENES, (), 2, "several scenes"),
        (PENDULUM, ("--scene", "swig"), 2, "E901"),
        (PENDULUM, ("--method", "euler"), 2, "verify compares bdf and radau"),
        (PENDULUM, ("--accuracy", "1e-5", "--rtol", "1e-5"), 2, "--accuracy together with"),
        (PENDULUM, ("--formulation", "co_lagrangian"), 1, "not expressible in co_lagrangian"),
        (PENDULUM.replace("= l^2", "= l"), (), 1, "the two sides differ"),
    ],
)
def test_wrong_usage_and_wrong_models(tmp_path, capsys, text, options, exit_code, said):
    code, found = run_json(capsys, "verify", write(tmp_path, text), *options)
    assert code == exit_code
    envelope(found, "verify")
    assert said in " ".join(d["message"] for d in found["diagnostics"])


def test_a_missing_file_is_exit_5(capsys):
    assert run(["verify", "missing.sd"]) == 5


# --- agreement --------------------------------------------------------------------------------------------------------


def trace(time, unit="1", **values):
    """A trace of given values."""
    data = {name: Quantity(name, np.asarray(v, dtype=float), unit, None, None) for name, v in values.items()}
    return Trace("", np.asarray(time, dtype=float), {}, {}, data)


def test_between_one_event_of_two_traces_nothing_is_compared():
    """A step at 1.999 s in one, at 2.001 s in the other; what differs behind both is found."""
    one, other = trace([0, 1, 2, 3], x=[0, 0, 1, 1]), trace([0, 1, 2, 3], x=[0, 0, 0, 1])
    assert horizon(one, other, {"x": 0.1})[0] == 1.0
    events = [replace(t, events=(Happened(at, "stop", "stop", "", ""),)) for t, at in ((one, 1.999), (other, 2.001))]
    assert horizon(*events, {"x": 0.1}) == (3.0, None)
    late = replace(trace([0, 1, 2, 3], x=[0, 0, 0, 3]), events=events[1].events)
    assert horizon(events[0], late, {"x": 0.1})[1].time == 3.0


def test_gaps_are_of_the_smaller_nominal_at_common_instants():
    one = trace([0, 1, 2, 3], x=[0, 10, 20, 20])
    other = trace([0, 2, 3, 4], x=[0, 24, 22, 999])
    for pair in ((one, other), (other, one)):
        (gap,) = gaps(*pair, {"x": 0.1}, np.inf)
        assert (gap.variable, gap.time, gap.first) == ("x", 2.0, 2.0)
        assert gap.ratio == pytest.approx(2.0)
    assert gap.values == (24.0, 20.0)
    (gap,) = gaps(one, other, {"x": 0.1}, 1.5)
    assert (gap.time, gap.first, gap.ratio) == (0.0, None, 0.0)
    assert gaps(one, trace([5, 6], x=[0, 0]), {"x": 0.1}, np.inf) == ()


def test_what_is_left_of_a_zero_does_not_count():
    one = trace([0, 1], x=[0, 1e-17], y=[1, 2])
    assert gaps(one, trace([0, 1], x=[0, -1e-17], y=[1, 2]), {"x": 1e-3}, np.inf)[0].ratio < 1e-3
    assert gaps(one, trace([0, 1], x=[0, -1e-10], y=[1, 2]), {"x": 1e-3}, np.inf)[0].ratio > 1.0


def test_what_is_not_a_number_or_has_no_scale_differs():
    one = trace([0, 1], x=[0, 1], z=[0, 0])
    found = gaps(one, trace([0, 1], x=[0, np.nan], z=[0, 0]), {"x": 1.0, "z": 1e-3}, np.inf)
    assert [(g.variable, g.ratio) for g in found] == [("x", np.inf), ("z", 0.0)]
    (gap,) = gaps(one, trace([0, 1], z=[0, 1e-9]), {"z": 1e-3}, np.inf)
    assert gap.ratio == pytest.approx(1e3)


def test_horizon_is_the_last_instant_before_the_first_difference():
    one = trace([0, 1, 2, 3], x=[1, 1, 1, 1], y=[1, 1, 1, 1])
    other = trace([0, 1, 2, 3], x=[1, 1, 1.5, 1], y=[1, 1.05, 1, 3])
    until, beyond = horizon(one, other, {"x": 0.1, "y": 0.1})
    assert (until, beyond.variable, beyond.time) == (1.0, "x", 2.0)
    assert horizon(one, one, {"x": 0.1}) == (3.0, None)
    assert horizon(one, trace([0, 1], x=[9, 9]), {"x": 0.1})[0] == -np.inf


@pytest.mark.parametrize(
    "name", ["coulomb_slide", *(["pendulum", "redundant_pendulum", "incline_friction"] if LONG else [])]
)
@pytest.mark.one_in(3)
def test_processes_side_by_side_find_what_one_finds(name, capsys):
    """Runs, gaps, refusals, warnings and exit code, in the same order, whatever ends first."""
    model = str(Path(__file__).parents[2] / "models" / "seed" / f"{name}.sd")
    one, two = (run_json(capsys, "verify", model, "--no-timings", "--jobs", n) for n in "12")
    for _, found in (one, two):
        for item in found["result"]["runs"]:
            item.pop("trace")
    assert one == two
