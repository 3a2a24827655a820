"""A run judges itself: what it could not keep is exit 3, and the trace says so (CONTRACT, Met)."""

import json
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from sysdyn import api
from sysdyn.cli.main import run
from sysdyn.dsl.text import codes

DUFFING = """
model duffing {
  param m = 2 kg
  coord x: translation = 0.5 m
  energy T* = 1/2*m*x'^2
  energy V = (3 N/m)*x^2 + (40 N/m^3)*x^4
  init x' = 0 m/s
}
scene swing of duffing {
  time 0 s to 20 s
  trace x
  expect always: x < 0.6 m
}
"""


@pytest.fixture
def duffing(tmp_path):
    path = tmp_path / "duffing.sd"
    path.write_text(DUFFING)
    return path


def simulated(path, tmp_path, capsys, *options):
    """(exit code, the object of --json, what was said on standard error)."""
    code = run(["simulate", str(path), "-o", str(tmp_path / "out.h5"), "--json", *options])
    captured = capsys.readouterr()
    return code, json.loads(captured.out), captured.err


@pytest.mark.long
def test_a_run_that_is_met_says_by_what(duffing, tmp_path, capsys):
    code, found, _ = simulated(duffing, tmp_path, capsys)
    assert code == 0
    assert found["result"]["met"] is True
    assert found["result"]["not_met"] == []
    with h5py.File(tmp_path / "out.h5") as trace:
        assert trace.attrs["met"] == 1
        assert trace.attrs["judged"].decode().split() == ["accuracy", "energy"]


def test_a_ledger_that_is_off_is_exit_3_with_element_and_instant(duffing, tmp_path, capsys):
    code, found, _ = simulated(duffing, tmp_path, capsys, "--rtol", "0.2", "--method", "bdf")
    assert code == 3
    (missed,) = found["result"]["not_met"]
    assert missed["what"] == "energy"
    assert missed["element"] == "x"
    with h5py.File(tmp_path / "out.h5") as trace:
        assert (trace.attrs["final"], trace.attrs["met"]) == (1, 0)
        time, balance = trace["time"][:], np.abs(trace["audit/energy"][:])
        assert time[-1] == 20.0
        assert missed["value"] == pytest.approx(balance.max(), rel=0.02)
        # the trace holds every step: its own first beyond the limit is the instant named, but for the staircase's 1 %
        assert missed["time"] == pytest.approx(time[np.argmax(balance > missed["limit"])], abs=0.3)
    # G: what one store held at most, kinetic and potential apart; k = min(0.1, 10 sqrt(rtol))
    assert missed["limit"] == pytest.approx(0.1 * 2 * (3 * 0.25 + 40 * 0.0625), rel=0.5)
    (error,) = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert (error["code"], error["line"]) == ("E921", 5)
    assert [e["ok"] for e in found["result"]["expects"]] == [None]


@pytest.mark.long
def test_an_accuracy_that_is_not_reached_is_exit_3(tmp_path, capsys):
    path = Path(__file__).parents[2] / "models/seed/two_link_arm.sd"
    code, found, _ = simulated(path, tmp_path, capsys, "--accuracy", "1e-13")
    assert code == 3
    missed = found["result"]["not_met"][0]
    assert missed["what"] == "accuracy"
    assert missed["value"] > missed["limit"] == 1e-13
    assert [d["code"] for d in found["diagnostics"] if d["severity"] == "error"] == ["E920"]


@pytest.mark.parametrize("law", ["ln(x)", "asin(2*x - 1)", "sqrt(x)"])
@pytest.mark.one_in(2)
def test_a_traced_value_that_is_no_number_is_told_as_that(tmp_path, capsys, law):
    """x = 0.5 - t is negative from 0.5 s on."""
    path = tmp_path / "m.sd"
    path.write_text(
        f"model m {{\n  state x: 1 = 0.5\n  dynamic x' = -1/(1 s)\n  let y = {law}\n}}\n"
        "scene s of m {\n  time 0 s to 1 s\n  trace y every 0.1 s\n}\n"
    )
    code, found, _ = simulated(path, tmp_path, capsys)
    assert code == 3
    (missed,) = found["result"]["not_met"]
    (said,) = [d for d in found["diagnostics"] if d["code"] == "E920"]
    assert "y is no number from t = " in said["message"]
    since = float(said["message"].partition("t = ")[2].split()[0])
    assert since == pytest.approx(missed["time"]) == pytest.approx(0.5, abs=0.11)


@pytest.mark.long
def test_euler_is_not_judged_and_says_so(duffing, tmp_path, capsys):
    text = duffing.read_text().replace("trace x\n", "trace x\n  solver euler(step = 1 ms)\n")
    duffing.write_text(text)
    code, found, _ = simulated(duffing, tmp_path, capsys)
    assert code == 0
    assert [d["code"] for d in found["diagnostics"]] == ["W920"]
    assert found["result"]["judged"] == []
    assert found["result"]["met"] is True


ROBERTSON = """
model rober {
  state a: 1 = 1
  state b: 1 = 0
  state c: 1 = 0
  dynamic a' = -(0.04 s^-1)*a + (1e4 s^-1)*b*c
  dynamic b' = (0.04 s^-1)*a - (1e4 s^-1)*b*c - (3e7 s^-1)*b^2
  dynamic c' = (3e7 s^-1)*b^2
}
scene s of rober {
  time 0 s to 1 s
  trace a, b, c
}
"""


@pytest.mark.long
def test_a_linear_invariant_of_states_is_judged(tmp_path, capsys):
    path = tmp_path / "rober.sd"
    path.write_text(ROBERTSON)
    code, found, _ = simulated(path, tmp_path, capsys, "--rtol", "1e-6")
    assert code == 0
    assert found["result"]["judged"] == ["invariants"]


def test_the_energy_of_the_audit_counts_as_traced(duffing, tmp_path, capsys):
    text = duffing.read_text().replace("expect always: x < 0.6 m", "accuracy 1e-7 on audit.energy")
    duffing.write_text(text)
    code, found, _ = simulated(duffing, tmp_path, capsys)
    assert code == 0
    with h5py.File(tmp_path / "out.h5") as trace:
        assert np.abs(trace["audit/energy"][:]).max() < 1e-7 * 2 * 3.25
    assert found["result"]["error_estimate"] < 1e-7


def test_quiet_silences_no_refusal(duffing, tmp_path, capsys):
    out = str(tmp_path / "out.h5")
    assert run(["simulate", str(duffing), "-o", out, "--quiet", "--rtol", "0.2", "--method", "bdf"]) == 3
    assert "E921" in capsys.readouterr().err
    assert run(["simulate", str(duffing), "-o", out, "--quiet", "--rtol", "0.2", "--method", "bdf", "--json"]) == 3
    assert json.loads(capsys.readouterr().out)["exit"] == 3
    ahead = "  implicit e: N ~ 1 N\n  work e on x\n  gamma push: e >= 1 N\n  init x'"
    duffing.write_text(duffing.read_text().replace("  init x'", ahead))
    assert run(["simulate", str(duffing), "-o", out, "--quiet"]) == 1
    assert "E608" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "value"), [("--rtol", "9e-15"), ("--accuracy", "9e-14")])
def test_what_double_precision_cannot_tell_is_refused(duffing, tmp_path, capsys, option, value):
    assert run(["simulate", str(duffing), "-o", str(tmp_path / "out.h5"), option, value]) == 2
    assert option in capsys.readouterr().err


@pytest.mark.long
def test_a_scene_without_trace_traces_every_coordinate(tmp_path, capsys):
    path = tmp_path / "three.sd"
    text = DUFFING.replace("  trace x\n  expect always: x < 0.6 m\n", "")
    path.write_text(text.replace("  init x'", "  state s: m = 0 m\n  dynamic s' = x/(1 s)\n  init x'"))
    code, found, _ = simulated(path, tmp_path, capsys)
    assert code == 0
    with h5py.File(tmp_path / "out.h5") as trace:
        assert {"x", "s"} < set(trace)
    assert found["result"]["error_estimate"] > 0.0


def test_the_interface_raises_not_met_with_the_trace(duffing, tmp_path):
    options = {"output": tmp_path / "out.h5", "rtol": 0.2, "method": "bdf"}
    with pytest.raises(api.NotMet, match="energy ledger") as caught:
        api.simulate(duffing, **options)
    assert caught.value.trace.time[-1] == 20.0
    assert not caught.value.trace.met
    with pytest.warns(UserWarning, match="energy ledger"):
        trace = api.simulate(duffing, unmet="warn", **options)
    assert len(trace["x"]) == len(trace.time)


def test_diff_treats_such_a_trace_like_one_that_did_not_end(duffing, tmp_path, capsys):
    out = str(tmp_path / "out.h5")
    run(["simulate", str(duffing), "-o", out, "--rtol", "0.2", "--method", "bdf"])
    assert run(["diff", out, out]) == 1
    assert "not met" in capsys.readouterr().err


def test_golden_record_and_check_refuse_it(duffing, tmp_path, capsys, monkeypatch):
    folder = ["--folder", str(tmp_path / "goldens")]
    assert run(["golden", "record", str(duffing), *folder]) == 0
    monkeypatch.setattr("sysdyn.runtime.judgement.allowed_share", lambda options: 1e-17)
    monkeypatch.setattr("sysdyn.runtime.accuracy.runs.Runs.open_balances", lambda self: [0.0])
    assert run(["golden", "check", "duffing", *folder]) == 3
    assert run(["golden", "accept", "duffing", "--reason", "none", *folder]) == 3
    assert run(["golden", "record", str(duffing), "--name", "other", *folder]) == 3
    assert "energy ledger" in capsys.readouterr().err


RUN = ("E608", "W920", "E931", "E932", "E933", "E934")


@pytest.mark.parametrize("code", RUN)
@pytest.mark.long
def test_pages_of_what_a_run_finds_tell_the_truth(code, tmp_path, capsys):
    page = codes.codes()[code]
    path = tmp_path / "example.sd"
    path.write_text(page.bad)
    exit_, found, _ = simulated(path, tmp_path, capsys)
    assert exit_ == {"E608": 1, "W920": 0}.get(code, 3)
    assert [d["code"] for d in found["diagnostics"] if d["severity"] != "note"] == [code]
    finding = next(d for d in found["diagnostics"] if d["code"] == code)
    assert finding["line"] is not None
    assert finding["help"]
    path.write_text(page.good)
    assert simulated(path, tmp_path, capsys)[0] == 0


def test_strict_refuses_what_cannot_be_run_yet(tmp_path, capsys):
    path = tmp_path / "when.sd"
    path.write_text(codes.codes()["E608"].bad)
    assert run(["check", str(path)]) == 0
    assert run(["check", str(path), "--strict"]) == 1
    assert "E608" in capsys.readouterr().err
    assert run(["check", str(path), "--strict", "--allow-unsupported"]) == 0


def test_a_value_error_inside_is_a_fault_and_no_wrong_usage(duffing, tmp_path, capsys, monkeypatch):
    def broken(*_, **__):
        raise ValueError("operands could not be broadcast together")

    monkeypatch.setattr("sysdyn.runtime.accuracy.runs.Runs.run", broken)
    assert run(["simulate", str(duffing), "-o", str(tmp_path / "out.h5"), "--quiet"]) == 4
    said = capsys.readouterr().err
    assert "a fault in sysdyn: ValueError: operands" in said
    assert "test_met.py:" in said


def test_a_module_that_is_not_the_text_is_exit_4_though_it_conserves_energy(duffing, tmp_path, capsys, monkeypatch):
    from sysdyn.compiler import pipeline

    plain = pipeline.emit_c

    def wrong(program, form):
        # another spring, in the rows and in the audit alike: its energy is conserved
        return plain(program, form).replace("40.0", "44.0").replace("160.0", "176.0")

    monkeypatch.setattr(pipeline, "emit_c", wrong)
    assert run(["simulate", str(duffing), "-o", str(tmp_path / "out.h5")]) == 4
    assert "does not say what the text says: dynamics of x" in capsys.readouterr().err


@pytest.mark.parametrize(("redirection", "arguments"), [(">/dev/full", "--json"), (">&-", "--json"), ("2>&-", "")])
@pytest.mark.long
def test_a_stream_that_takes_nothing_is_exit_5(duffing, tmp_path, redirection, arguments):
    out = tmp_path / "out.h5"
    command = f"{sys.executable} -m sysdyn.cli simulate {duffing} -o {out} {arguments} {redirection}"
    ran = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert ran.returncode == 5
    assert "Traceback" not in ran.stderr + ran.stdout


@pytest.mark.long
def test_independent_parts_have_ledgers_of_their_own(tmp_path, capsys):
    """What is lost in a small part is not hidden by a large one."""
    path = tmp_path / "two.sd"
    path.write_text(
        """
model two {
  coord x: translation = 1 m
  coord y: translation = 1 mm
  energy T* = 1/2*(1e6 kg)*x'^2
  energy V = 1/2*(1e6 N/m)*x^2
  energy T* = 1/2*(1e-6 kg)*y'^2
  energy V = 1/2*(1e-6*400 N/m)*y^2
  init x' = 0 m/s
  init y' = 0 m/s
}
scene s of two {
  time 0 s to 30 s
  trace x
}
"""
    )
    loose = ("--method", "bdf", "--rtol", "1e-5", "--atol", "1e-3", "--no-prune")
    code, found, _ = simulated(path, tmp_path, capsys, *loose)
    with h5py.File(tmp_path / "out.h5") as trace:
        # in all, nothing is amiss
        assert np.abs(trace["audit/energy"][:]).max() < 0.1 * 5e5
    assert code == 3
    assert [m["element"] for m in found["result"]["not_met"]] == ["y"]


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian", "kane"])
@pytest.mark.parametrize(
    ("elements", "end"),
    [
        # c T' = -k (T - 290 K), its heat k (T - 290 K) given as a flow of entropy
        (
            "node h: thermal\n  C: potential(e = 300 K*exp(q/(100 J/K))) h\n  init C.e = 350 K\n"
            "  loss: flow(f = 2 W/K*(h.e - 290 K)/h.e) h -> ground",
            290.0 + 60.0 * np.exp(-1.0),
        ),
        # C u u' = -P
        (
            "node h: electrical\n  C: potential(q = 1 mF*e) h\n  init C.e = 350 V\n"
            "  load: flow(f = (1 W)/h.e) h -> ground",
            np.sqrt(350.0**2 - 2.0 * 50.0 / 1e-3),
        ),
    ],
)
@pytest.mark.long
def test_a_power_that_is_constant_is_no_constant_of_the_ledger(tmp_path, capsys, elements, end, formulation):
    path = tmp_path / "m.sd"
    scene = "scene s of m {\n  time 0 s to 50 s\n  trace C.e as e\n}\n"
    path.write_text(f"model m {{\n  {elements}\n}}\n{scene}")
    code, found, _ = simulated(path, tmp_path, capsys, "--formulation", formulation, "--accuracy", "1e-6")
    assert code == 0, found["result"]["not_met"]
    with h5py.File(tmp_path / "out.h5") as trace:
        assert trace["e"][-1] == pytest.approx(end, rel=1e-5)


LIGHT = """
model light {
  coord x: translation = 1 m
  energy T* = 1/2*(1e-60 kg)*x'^2
  energy V = 1/2*(4 N/m)*x^2
  init x' = 0 m/s
}
scene s of light {
  time 0 s to 1 s
  trace x, x', audit.energy
}
"""


@pytest.mark.parametrize("method", ["auto", "radau", "rosenbrock"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(5)
def test_a_motion_too_fast_for_the_resolution_of_time_is_not_met(tmp_path, capsys, formulation, method):
    """Of 1e-60 kg on 4 N/m a second is 3e29 periods: steps damp what they do not follow, 2 J, which round-off does not
    excuse.
    """
    path = tmp_path / "light.sd"
    path.write_text(LIGHT)
    options = ("--formulation", formulation, "--method", method, "--accuracy", "1e-2")
    code, found, _ = simulated(path, tmp_path, capsys, *options)
    assert code == 3
    if found["result"]["final"]:
        assert "energy" in {m["what"] for m in found["result"]["not_met"]}
