"""`sysdyn trade`: stated errors are those of the book's values, the choice meets the accuracy and is the cheapest."""

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from reference_values import load
from schema import NUMBER, conforms, envelope
from scipy.integrate import solve_ivp
from sysdyn import api
from sysdyn.cli.main import run
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run as simulate
from sysdyn.cli.trade.search import tolerance
from sysdyn.cli.trade.trade_results import Combination, Measured, cheapest, frontier
from sysdyn.cli.trade.trading import trade
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.trace.trace import Trace
from texts import PENDULUM, ROOT, TWO_SCENES, run_json, write

SEED = ROOT / "models" / "seed"
LONG = os.environ.get("SYSDYN_LONG") == "1"
FACTOR = 3.0
TRADE = {"settings": list, "chosen": (dict, type(None)), "reference": dict, "accuracy": NUMBER, "judged": list}
OPTIONAL = (*NUMBER, type(None))
SETTING = {
    "formulation": str,
    "index": (str, type(None)),
    "method": (str, type(None)),
    "tolerance": OPTIONAL,
    "level": (str, type(None)),
    "error": OPTIONAL,
    "cpu_s": OPTIONAL,
    "steps": (int, type(None)),
    "energy": OPTIONAL,
    "constraints": OPTIONAL,
    "pareto": bool,
    "reason": (str, type(None)),
}

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
  time 0 s to 60 s
  trace x, y, z every 100 ms
}
"""


LEVELS = """\
component bearing {
  port a: translation
  level plain { s: potential(e = 4 N/m*q) a -> ground }
  level full default {
    s: potential(e = 4 N/m*q + 0.02 N/m^3*q^3) a -> ground
    d: dissipator(e = 1e-3 N.s/m*f) a -> ground
    node b[1..4]: translation = 1 m
    k0: potential(e = 90 N/m*q) a -> b[1]
    for i in 1..4 { m[i]: kinetic(p = 1e-3 kg*f) b[i] }
    for i in 1..3 { k[i]: potential(e = 90 N/m*q) b[i] -> b[i+1] }
  }
}
model osc {
  node x: translation = 1 m
  body: kinetic(p = 1 kg*f) x
  B: bearing() a = x
  init body.f = 0 m/s
}
scene run of osc {
  time 0 s to 3 s
  trace x.q as q every 10 ms
}
"""


@pytest.fixture(scope="module")
def references():
    return load("references.json")


def at_the_instants_of_the_book(name, entry, folder):
    """The model with a trace at the coarsest grid that holds all instants of the book."""
    instants = [Fraction(t).limit_denominator(10**6) for t in entry["t"]]
    common = math.lcm(*(t.denominator for t in instants))
    every = math.gcd(*(int(t * common) for t in instants)) / common
    text = (SEED / f"{name}.sd").read_text(encoding="utf-8")
    return write(folder, re.sub(r"every [^;\n}]+", f"every {every!r} s", text), f"{name}.sd")


def true_error(file, m, entry, folder):
    """Of one setting, by the book's values."""
    c = m.combination
    how = {"formulation": c.formulation, "index": c.index, "method": c.method, "rtol": m.tolerance}
    ran = simulate(RunRequest(str(file), scene="reference", output=str(folder / "run.h5"), **how), Report())
    trace, t = ran.outcome.traced, np.array(entry["t"])
    rows = np.searchsorted(trace.time, t + 1e-9 * t[-1], side="right") - 1
    wanted = entry["values"]
    return max(np.abs(trace[v].values[rows] - np.array(wanted[v])).max() / trace[v].nominal for v in entry["variables"])


BOOK = ["dc_motor", "fluid_tank", *(["nonlinear_spring", "thermal_two_node", "lc_ladder"] if LONG else [])]


@pytest.mark.parametrize("name", BOOK)
@pytest.mark.long
def test_stated_errors_are_those_of_the_book(tmp_path, references, name):
    entry = references[name]
    file = at_the_instants_of_the_book(name, entry, tmp_path)
    found = trade(RunRequest(str(file), scene="reference"), Report(), tmp_path)
    known = found.reference.uncertainty
    assert known < 1e-8
    compared = [m for m in found.measured if m.usable and 10.0 * known < m.error < 0.5]
    assert len(compared) >= 10
    some = compared[:: max(len(compared) // 12, 1)]
    ratios = np.array([m.error / true_error(file, m, entry, tmp_path) for m in some])
    assert (ratios >= 1.0 / FACTOR).all(), ratios
    # the largest error may lie between the instants of the book, within a long step of a method of high order
    assert (ratios <= 4.0 * FACTOR).all(), ratios
    best = found.chosen
    assert true_error(file, best, entry, tmp_path) <= found.accuracy


SEARCHED = [("thermal_two_node", "hamiltonian")]
SEARCHED += [("dc_motor", "lagrangian"), ("diode_circuit", "co_lagrangian")] if LONG else []


@pytest.mark.parametrize(("name", "formulation"), SEARCHED)
@pytest.mark.long
def test_the_search_finds_what_the_full_product_does(tmp_path, name, formulation):
    """Twelve models in all formulations: tests/bench/trades.py."""
    request = RunRequest(str(SEED / f"{name}.sd"), scene="reference", formulation=formulation)
    full = trade(request, Report(), tmp_path, full=True)
    spent = sum(m.work - m.fixed for m in full.measured)
    for accuracy in (1e-2, 1e-4, 1e-6):
        thrifty = RunRequest(str(SEED / f"{name}.sd"), scene="reference", formulation=formulation, accuracy=accuracy)
        found = trade(thrifty, Report(), tmp_path)
        best = cheapest(full.measured, accuracy, full.reference.uncertainty)
        assert found.chosen.error + found.reference.uncertainty <= accuracy
        assert found.chosen.work <= 1.5 * best.work
        assert sum(m.work - m.fixed for m in found.measured) <= 0.15 * spent


@pytest.mark.long
def test_the_object_and_the_command_that_uses_the_choice(tmp_path, capsys):
    file = write(tmp_path, PENDULUM)
    code, found = run_json(capsys, "trade", str(file), "--accuracy", "1e-5", "--set", "l=2")
    assert code == 0
    envelope(found, "trade", TRADE)
    result = found["result"]
    for setting in result["settings"]:
        conforms(setting, SETTING)
        if setting["error"] is None:
            assert setting["reason"]
    best = result["chosen"]
    assert best["error"] + result["reference"]["error"] <= 1e-5
    assert best["pareto"]
    enough = [s for s in result["settings"] if s["met"] and s["error"] + result["reference"]["error"] <= 1e-5]
    assert best["work"] == min(s["work"] for s in enough)
    refused = {s["formulation"] for s in result["settings"] if s["method"] is None}
    assert "co_lagrangian" in refused
    words = shlex.split(best["command"])
    assert words[:2] == ["sysdyn", "simulate"]
    assert run([*words[1:], "-o", "used.h5", "--quiet"]) == 0
    capsys.readouterr()
    trace = Trace.open("used.h5")
    assert (trace.attributes["formulation"], trace.attributes["method"]) == (best["formulation"], best["method"])
    assert json.loads(trace.attributes["statistics"])["steps"] == best["steps"]
    assert trace.parameters["l"][0] == 2.0


@pytest.mark.long
def test_two_trades_are_equal_but_for_seconds(tmp_path, capsys):
    file = write(tmp_path, PENDULUM)
    one, two = (run_json(capsys, "trade", str(file), "--no-timings")[1]["result"] for _ in range(2))
    assert one == two


@pytest.mark.parametrize("options", [[], ["--full", "--method", "radau", "--formulation", "lagrangian"]])
@pytest.mark.long
def test_runs_made_ahead_change_nothing(tmp_path, capsys, options):
    file = write(tmp_path, PENDULUM)
    options = ["--no-timings", "--until", "0.3", *options]
    one, two = (run_json(capsys, "trade", str(file), "--jobs", n, *options) for n in "12")
    assert one == two
    assert one[0] == 0


@pytest.mark.long
def test_a_trade_that_is_killed_goes_on_where_it_was(tmp_path, capsys, monkeypatch):
    file = write(tmp_path, PENDULUM)
    _, whole = run_json(capsys, "trade", file, "--no-timings")
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    asked = [sys.executable, "-m", "sysdyn", "trade", file, "--quiet"]
    process = subprocess.Popen(asked, stdout=subprocess.DEVNULL)
    kept: list[str] = []
    while len(kept) < 6 and process.poll() is None:
        time.sleep(0.01)
        for journal in (tmp_path / "cache").glob("trades/*/runs.jsonl"):
            kept = journal.read_text().split("\n")
    process.send_signal(signal.SIGKILL)
    process.wait()
    (journal,) = (tmp_path / "cache").glob("trades/*/runs.jsonl")
    before = [json.loads(line) for line in journal.read_text().splitlines() if line.endswith("}")]
    assert len(before) >= 5
    with journal.open("a") as lines:
        lines.write('\n{"combination": {"formu')  # what a kill may leave
    _, found = run_json(capsys, "trade", file)
    seconds = {tuple(m["combination"].values()) + (m["tolerance"],): m.get("cpu_s") for m in before}
    taken = 0
    for s in found["result"]["settings"]:
        key = s["formulation"], s["index"], s["method"], s["level"] or "", s["tolerance"]
        if seconds.get(key) is not None:
            taken += s["cpu_s"] == seconds[key]
            s["cpu_s"] = None
    assert taken == sum(m.get("cpu_s") is not None for m in before)
    for result in (whole["result"], found["result"]):
        for s in (*result["settings"], result["chosen"]):
            s["cpu_s"] = None
    assert found["result"] == whole["result"]
    assert not list((tmp_path / "cache").glob("trades/*"))


def test_runs_that_are_not_met_are_kept_and_never_chosen():
    def made(work, error, reason="", method="bdf"):
        return Measured(Combination("lagrangian", "2", method), 1e-3, error, 0.1, 9, work, 0.0, 1e-3, 0.0, reason)

    runs = [made(1.0, 1e-6, "the energy ledger is off"), made(2.0, 5e-3), made(3.0, 1e-5), made(4.0, 1e-4)]
    assert cheapest(runs, 1e-4, 1e-6) is runs[2]
    assert cheapest(runs, 1e-4, 1e-4) is None
    assert frontier(runs) == (runs[1], runs[2])


@pytest.mark.long
def test_a_chaotic_scene_counts_errors_as_far_as_its_finest_runs_agree(tmp_path, capsys):
    code, found = run_json(capsys, "trade", str(write(tmp_path, LORENZ)), "--accuracy", "1e-3")
    known = found["result"]["reference"]
    assert code == 0
    assert 10.0 < known["until"] < 50.0
    assert known["error"] <= 1e-3
    assert found["result"]["chosen"]["error"] <= 1e-3


@pytest.mark.parametrize(("accuracy", "levels"), [(1e-1, {"plain"}), (1e-4, {"full"})])
@pytest.mark.one_in(2)
def test_the_accuracy_chooses_the_level(tmp_path, capsys, accuracy, levels):
    """The cheap one where it will do; both against the full model."""
    file = write(tmp_path, LEVELS)
    code, found = run_json(capsys, "trade", file, "--accuracy", str(accuracy), "--lock")
    assert code == 0
    best = found["result"]["chosen"]
    assert best["level"].removeprefix("B=") in levels
    assert "B=full" in found["result"]["reference"]["first"]
    assert {s["level"] for s in found["result"]["settings"] if s["error"] is not None} == {"B=plain", "B=full"}
    full = api.simulate(file, accuracy=1e-9, level={"B": "full"}, output="full.h5")
    chosen = api.simulate(file, accuracy=accuracy, output="chosen.h5")  # by the lock
    assert f"level B = {best['level'][2:]}" in chosen.attributes["lock"]
    assert np.abs(chosen["q"].values - full["q"].values).max() <= accuracy * full["q"].nominal
    # another level on the command line: nothing of the lock was measured there
    other = {"plain": "full", "full": "plain"}[best["level"][2:]]
    again = api.simulate(file, accuracy=accuracy, level={"B": other}, output="again.h5")
    assert "lock" not in again.attributes


@pytest.mark.long
def test_pictures(tmp_path, capsys):
    file = str(write(tmp_path, PENDULUM))
    assert run(["trade", file, "-o", "trade.png", "--formulation", "lagrangian"]) == 0
    assert Path("trade.png").read_bytes().startswith(b"\x89PNG")
    assert run(["trade", file, "-o", "trade.svg", "--formulation", "lagrangian"]) == 0
    assert ElementTree.parse("trade.svg").getroot().tag.endswith("svg")
    assert run(["trade", file, "-o", "trade.html", "--formulation", "lagrangian", "--quiet"]) == 0
    page = Path("trade.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="curves">(.*?)</script>', page)[1])
    assert data["lg"]
    assert {"Pareto set", "chosen"} <= {c["label"] for c in data["panels"][0]["curves"]}
    assert "sysdyn simulate" in page
    out = capsys.readouterr().out
    assert "\n>" in out
    assert "reference:" in out
    assert "sysdyn simulate" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--rtol", "1e-4"], "trade chooses the tolerances"),
        (["--method", "euler"], "methods that control their error"),
        (["-o", "x.pdf"], "one of .html, .png, .svg"),
        (["--max-wall", "soon"], "a number of seconds"),
        (["--max-wall", "-1"], "must be positive"),
    ],
)
@pytest.mark.one_in(3)
def test_wrong_usage(tmp_path, capsys, arguments, said):
    assert run(["trade", str(write(tmp_path, PENDULUM)), *arguments]) == 2
    assert said in capsys.readouterr().err


def test_several_scenes_and_none_named(tmp_path, capsys):
    assert run(["trade", str(write(tmp_path, TWO_SCENES))]) == 2
    assert "--scene swing | again" in capsys.readouterr().err


def test_nothing_is_chosen_when_the_budget_is_spent_first(tmp_path, capsys):
    code = run(["trade", str(write(tmp_path, LORENZ)), "--max-wall", "0.001", "--quiet"])
    assert code == 3
    assert re.search("there is no reference|the budget was spent first", capsys.readouterr().err)


def test_a_trade_without_a_run_names_the_statement(tmp_path, capsys):
    code, found = run_json(capsys, "trade", write(tmp_path, PENDULUM), "--max-steps", "3")
    assert code == 3
    (said,) = found["diagnostics"]
    assert (said["code"], said["line"]) == ("E934", PENDULUM[: PENDULUM.index("scene swing")].count("\n") + 1)
    assert said["message"].startswith("there is no reference: lagrangian index 0 dopri: the solver stopped")


def test_samples_at_every_row_leave_instants_to_compare(tmp_path, capsys):
    """Every row of the trace stood at a sample: "a quantity is no number" in each of 58 runs, all of them right."""
    text = "model m {\n  discrete b = 1\n  state x = 0\n  every 50 us { b := -b }\n  dynamic x' = (b - x)/(1 ms)\n}\n"
    text += "scene s of m { time 0 s to 1 ms; trace x every 50 us }\n"
    code, found = run_json(capsys, "trade", write(tmp_path, text), "--method", "radau", "--formulation", "lagrangian")
    assert code == 0
    assert found["result"]["chosen"]["error"] < 1e-9


def test_tolerances_stand_at_half_decades():
    assert [tolerance(k) for k in (2, 3, 4, 24)] == [0.1, 0.0316, 0.01, 1e-12]


RELAXATION = """model relaxation {
  state x: 1 = 2
  state v: 1 = 0
  dynamic x' = v/(1 s)
  dynamic v' = (100*(1 - x^2)*v - x)/(1 s)
}
scene go of relaxation {
  time 0 s to 250 s
  trace x, v
  accuracy 1e-4
}
"""


def test_a_scene_without_rows_of_its_own_is_judged_where_it_varies(tmp_path):
    """Peaks of 20 ms in 250 s, which an even grid steps over; the true error by SciPy."""
    how = {"formulation": "lagrangian", "method": "radau"}
    file = write(tmp_path, RELAXATION)
    chosen = trade(RunRequest(file, **how), Report(), tmp_path).chosen
    output = tmp_path / "out.h5"
    trace = api.simulate(file, **how, index=chosen.combination.index, rtol=chosen.tolerance, output=output)
    right = solve_ivp(
        lambda t, y: [y[1], 100 * (1 - y[0] ** 2) * y[1] - y[0]],
        (0, 250),
        [2, 0],
        method="Radau",
        rtol=1e-10,
        atol=1e-12,
        t_eval=trace.time,
    ).y
    off = max(np.abs(trace[n].values - r).max() / np.abs(r).max() for n, r in zip("xv", right, strict=True))
    assert off < 3 * chosen.error
    assert chosen.error < 1e-4
