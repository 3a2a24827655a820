"""`sysdyn reduce`: activities in closed form, and a reduced model whose error is measured by a run of its own."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from schema import NUMBER, conforms, envelope
from sysdyn import api
from sysdyn.cli.main import run
from sysdyn.cli.reduce import activity
from sysdyn.cli.reduce.activity import variation
from sysdyn.cli.reduce.sankey import flows
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.comparison.arrays import arrays_of
from sysdyn.runtime.comparison.compare import compare
from sysdyn.runtime.comparison.verdict import Tolerance
from sysdyn.runtime.trace.trace import Quantity
from texts import ROOT, TWO_SCENES, run_json, write

REDUCE = {"activity": list, "total": NUMBER, "accuracy": NUMBER, "trials": list, "error": NUMBER, "ended": bool}
ACTIVITY = {"element": str, "role": str, "activity": NUMBER, "share": NUMBER, "file": str, "line": int}
TRIAL = {"element": str, "change": str, "error": (*NUMBER, type(None)), "kept": bool, "reason": (str, type(None))}

OSCILLATOR = """\
model oscillator {
  param m = 2 kg
  param k = 8 N/m
  node x: translation = 0.3 m
  body: kinetic(p = m*f) x
  spring: potential(e = k*q) x -> ground
  init body.f = 0 m/s
}
scene run of oscillator {
  time 0 s to 7 s
  trace x.q as q
  accuracy 1e-6
}
"""

CHARGING = """\
model charging {
  param R = 3 ohm
  param C = 0.5 F
  node a, b: electrical
  V: effort(e = 4 V) a -> ground
  r: dissipator(e = R*f) a -> b
  c: potential(q = C*e) b -> ground
  init c.e = 0 V
}
scene run of charging {
  time 0 s to 2 s
  trace c.e as v
  accuracy 1e-6
}
"""

DRIVE = """\
## A motor with a wire, two discs and a seal.
from std.electrical import voltage, resistor, capacitor, inductor

model drive {
  param J1 = 0.2 kg.m^2
  param J2 = 1e-6 kg.m^2    # of the ring
  param Lw = 1 uH
  node s, a, c: electrical
  node shaft: rotation
  V: voltage(v = 12 V) s -> ground
  R: resistor(R = 1 ohm) s -> a
  wire: inductor(L = Lw) a -> c
  stray: capacitor(C = 1 pF) c -> ground
  emf: gyrator(e1 = 0.5 V.s/rad*f2) c -> ground, shaft -> ground
  rotor: kinetic(p = J1*f) shaft
  ring: kinetic(p = J2*f) shaft
  bearing: dissipator(e = 0.02 N.m.s/rad*f) shaft -> ground
  seal: dissipator(e = 1e-8 N.m.s/rad*f) shaft -> ground
  init wire.f = 0 A
  init stray.e ~ 0 V
  init shaft.f = 0 rad/s
}

scene go of drive {
  time 0 s to 3 s
  trace shaft.f as om
  accuracy 1e-3
}
"""


def activities(capsys, folder, text):
    code, found = run_json(capsys, "reduce", write(folder, text), "--activity")
    assert code == 0
    envelope(found, "reduce", REDUCE)
    for item in found["result"]["activity"]:
        conforms(item, ACTIVITY)
    return {a["element"]: a for a in found["result"]["activity"]}


def test_a_spring_and_a_mass_turn_their_energy_over_four_times_a_period(tmp_path, capsys):
    found = activities(capsys, tmp_path, OSCILLATOR)
    # the energy of the spring falls from 1/2 k a^2 to 0 and back twice a period, w = 2 rad/s
    whole, part = divmod(2.0 * 7.0, np.pi / 2)
    last = np.cos(2.0 * 7.0) ** 2
    half = 1.0 - last if whole % 2 == 0 else last
    wanted = 0.5 * 8.0 * 0.3**2 * (whole + half)
    assert part > 0.0
    for name in ("spring", "body"):
        assert found[name]["activity"] == pytest.approx(wanted, rel=1e-5)
        assert found[name]["share"] == pytest.approx(0.5, rel=1e-5)
        assert found[name]["role"] == "stored"


@pytest.mark.long
def test_a_capacitor_is_charged(tmp_path, capsys):
    found = activities(capsys, tmp_path, CHARGING)
    v = 4.0 * (1.0 - np.exp(-2.0 / 1.5))
    assert found["V"]["activity"] == pytest.approx(0.5 * 4.0 * v, rel=1e-5)
    assert found["c"]["activity"] == pytest.approx(0.25 * v**2, rel=1e-5)
    assert found["r"]["activity"] == pytest.approx(0.25 * 16.0 * (1.0 - np.exp(-4.0 / 1.5)), rel=1e-5)


@pytest.mark.long
def test_the_largest_come_first_and_shares_add_up(tmp_path, capsys):
    code, found = run_json(capsys, "reduce", str(ROOT / "models/seed/dc_motor.sd"), "--activity")
    assert code == 0
    items = found["result"]["activity"]
    assert [a["activity"] for a in items] == sorted((a["activity"] for a in items), reverse=True)
    assert sum(a["share"] for a in items if a["role"] != "passed on") == pytest.approx(1.0)
    sides = [a["activity"] for a in items if a["element"].startswith("emf")]
    assert sides[0] == pytest.approx(sides[1], rel=1e-4)


CORNER = """\
model corner {
  coord x, y: translation = 1 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  phi left: x >= 0 m restitution 0.5
  phi floor: y >= 0 m restitution 0.5
  init x' = -2 m/s
  init y' = -2 m/s
}
scene run of corner {
  time 0 s to 2 s
  trace x, y every 50 ms
}
"""


def test_impacts_take_what_they_take(tmp_path, capsys):
    """Of 4 J two impacts at once leave a quarter; what events watch is no quantity of the scene."""
    code, found = run_json(capsys, "reduce", write(tmp_path, CORNER))
    assert code == 0
    (kinetic,) = found["result"]["activity"]
    assert kinetic["activity"] == pytest.approx(3.0, rel=1e-9)


def test_the_variation_of_a_cubic_is_that_of_its_extremes():
    # y = s (s - 1/4) (s - 1) on [0, 1] and its mirror image: two cells, extremes inside both
    def y(s):
        return s * (s - 0.25) * (s - 1.0)

    def rate(s):
        return 3 * s * s - 2.5 * s + 0.25

    time = np.array([0.0, 1.0, 2.0])
    values = np.array([y(0.0), y(1.0), y(0.0)])
    found = variation(time, Quantity("y", values, "1", None, np.array([rate(0.0), rate(1.0), -rate(0.0)])))
    s = np.linspace(0.0, 1.0, 200_001)
    one = np.abs(np.diff(y(s))).sum()
    h = np.linspace(0.0, 1.0, 200_001)
    # from (0, y'(1)) back to (0, -y'(0)): the cubic of the second cell
    other = np.abs(np.diff(rate(1.0) * (h - 2 * h**2 + h**3) - rate(0.0) * (h**3 - h**2))).sum()
    assert found == pytest.approx(one + other, rel=1e-9)


def test_what_a_scene_does_not_need_is_left_out_of_the_text(tmp_path, capsys):
    file = write(tmp_path, DRIVE)
    code, found = run_json(capsys, "reduce", file)
    assert code == 0
    result = found["result"]
    for trial in result["trials"]:
        conforms(trial, TRIAL)
    kept = {t["element"] for t in result["trials"] if t["kept"]}
    assert kept == {"stray", "seal", "wire", "ring"}
    assert result["reduced"]["unknowns"] < result["full"]["unknowns"]
    text = Path(result["file"]).read_text(encoding="utf-8")
    for gone in ("stray:", "seal:", "  ring:", "J2", "Lw", "1 pF", "init wire.f", "init stray"):
        assert gone not in text
    for needed in ("## A motor", "rotor: kinetic(p = J1*f) shaft", "bearing:", "init shaft.f"):
        assert needed in text
    assert run(["fmt", "--check", result["file"]]) == 0
    # an error that is measured once more, by runs of its own, at their steps
    full = api.simulate(file, accuracy=1e-5, output="full.h5")
    reduced = api.simulate(result["file"], accuracy=1e-5, output="reduced.h5")
    verdict = compare(arrays_of(full), arrays_of(reduced), Tolerance(rtol=1e-3, tau=3e-9))
    assert verdict.equal, verdict.worst
    assert result["error"] <= 1e-3
    capsys.readouterr()


@pytest.mark.long
def test_a_finer_accuracy_keeps_more(tmp_path, capsys):
    file = write(tmp_path, DRIVE)
    kept = []
    for accuracy in ("1e-2", "1e-6"):
        result = run_json(capsys, "reduce", file, "--accuracy", accuracy)[1]["result"]
        assert result["error"] <= float(accuracy)
        kept.append({t["element"] for t in result["trials"] if t["kept"]})
    assert kept[1] < kept[0]


def test_a_model_that_needs_everything_is_left_as_it_is(tmp_path, capsys):
    assert run(["reduce", write(tmp_path, OSCILLATOR)]) == 0
    out = capsys.readouterr().out
    assert "every element that was tried is needed" in out
    assert not Path(tmp_path / "model-reduced.sd").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--rtol", "1e-4"], "--accuracy says what is wanted"),
        (["-o", "model.sd"], "is the model itself"),
        (["--max-wall", "soon"], "a number of seconds"),
    ],
)
def test_wrong_usage(tmp_path, capsys, arguments, said):
    assert run(["reduce", write(tmp_path, OSCILLATOR), *arguments]) == 2
    assert said in capsys.readouterr().err


def test_several_scenes_and_none_named(tmp_path, capsys):
    assert run(["reduce", write(tmp_path, TWO_SCENES)]) == 2
    assert "--scene swing | again" in capsys.readouterr().err


def test_a_model_without_powers_is_told_so(tmp_path, capsys):
    text = "model m {\n  state y: 1 = 1\n  dynamic y' = -1 Hz*y\n}\nscene s of m { time 0 s to 1 s; trace y }\n"
    assert run(["reduce", write(tmp_path, text)]) == 1
    assert "powers of the elements" in capsys.readouterr().err


LINKED = """\
## Two discs on a stiff shaft with its damper, a rubber foot under the second bearing.
from std.mechanical import inertia, torsion, rotary_damper

model linked {
  node left, right: rotation = 0 rad
  node foot: rotation = 0 rad
  drive: effort(e = 2 N.m) ground -> left
  one: inertia(J = 0.3 kg.m^2) left
  shaft: torsion(k = 1e7 N.m/rad) left -> right
  loss: rotary_damper(b = 3 N.m.s/rad) left -> right
  other: inertia(J = 0.2 kg.m^2) right
  bearing: rotary_damper(b = 0.1 N.m.s/rad) right -> foot
  rubber: torsion(k = 1e6 N.m/rad) foot -> ground
  init one.f = 0 rad/s
  init right.f = 0 rad/s
}

scene go of linked {
  time 0 s to 4 s
  trace one.f as om
  accuracy 1e-4
}
"""


@pytest.mark.long
def test_what_a_stiff_shaft_joins_becomes_one_node(tmp_path, capsys):
    file = write(tmp_path, LINKED.replace("  init right.f = 0 rad/s\n", ""))
    code, found = run_json(capsys, "reduce", file, "-o", str(tmp_path / "small.sd"))
    assert code == 0
    kept = {(t["element"], t["change"]) for t in found["result"]["trials"] if t["kept"]}
    assert {("loss", "left out"), ("shaft", "ends one"), ("rubber", "ends one")} <= kept
    text = (tmp_path / "small.sd").read_text()
    assert "node left: rotation" in text
    assert "right" not in text
    assert "foot:" not in text
    assert "other: inertia(J = 0.2 kg.m^2) left" in text
    assert "bearing: rotary_damper(b = 0.1 N.m.s/rad) left -> ground" in text
    trace = api.simulate(tmp_path / "small.sd", output=tmp_path / "small.h5")
    exact = 20.0 * -np.expm1(-0.2 * np.asarray(trace.time))  # J om' = M - b om
    assert np.abs(np.asarray(trace["om"]) - exact).max() < 2e-4 * exact.max()


@pytest.mark.long
def test_a_node_that_something_speaks_of_keeps_its_name(tmp_path, capsys):
    code, _found = run_json(capsys, "reduce", write(tmp_path, LINKED), "-o", str(tmp_path / "small.sd"))
    assert code == 0
    text = (tmp_path / "small.sd").read_text()
    assert "right" in text  # `init right.f` does


@pytest.mark.skipif(os.environ.get("SYSDYN_LONG") != "1", reason="SYSDYN_LONG=1 reduces the drivetrain")
def test_a_drivetrain_of_forty_elements(tmp_path, capsys):
    file = str(ROOT / "models/gallery/drivetrain.sd")
    code, found = run_json(capsys, "reduce", file, "--scene", "start", "-o", str(tmp_path / "small.sd"))
    assert code == 0
    assert found["result"]["error"] <= 1e-2
    text = (tmp_path / "small.sd").read_text()
    assert "flow(f = 0" not in text
    assert len(re.findall(r"^  \w+: \w+\(", text, re.MULTILINE)) < 25


def test_energies_go_from_bus_to_bus(tmp_path):
    file = write(tmp_path, DRIVE)
    report = Report()
    request = RunRequest(file)
    target = targets.one(targets.read(file, report), file, None, None, report)
    found = activity.activities(request, target, report, tmp_path, 0.0, None)
    where = flows(found.items)
    assert [bus.name for bus in where.buses] == ["electrical", "rotation"]
    (passed,) = where.passes
    assert (passed.label, passed.source, passed.target) == ("emf", "electrical", "rotation")
    trace = api.simulate(file, accuracy=1e-8, output=tmp_path / "out.h5")
    speed = trace[trace.names[0]].values[-1]
    for bus, moved in zip(where.buses, (-passed.energy, passed.energy), strict=True):
        rest = sum(s.energy for s in bus.enters) - sum(s.energy for s in bus.leaves) + moved
        assert abs(rest) < 1e-4 * passed.energy
    stored = sum(s.energy for s in where.buses[1].leaves if s.role == "held")
    assert stored == pytest.approx(0.5 * 0.200001 * speed**2, rel=1e-4)


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_the_picture_shows_activities_and_where_the_energy_went(tmp_path, kind):
    file = write(tmp_path, DRIVE)
    target = tmp_path / f"energy.{kind}"
    assert run(["reduce", file, "--activity", "--plot", str(target), "--quiet"]) == 0
    drawn = target.read_bytes()
    if kind == "svg":
        for word in (b"electrical", b"rotation", b"emf", b"dissipated", b"activity"):
            assert word in drawn
    else:
        assert drawn.startswith(b"\x89PNG")
    assert run(["reduce", file, "--activity", "--plot", str(tmp_path / "energy.pdf"), "--quiet"]) == 2


SHELL = """\
model shell {
  param n = 3
  coord x[1..n]: translation = 0 m
  energy T* = sum(i in 1..n: 1/2*(1 kg)*x[i]'^2)
  energy V = 2 J*cosh(sum(i in 1..n: x[i])/(1 m)) + sum(i in 1..n: 1/2*(10 N/m)*i*x[i]^2)
  work 1 N*sin(2*t/(1 s)) on sqrt(sum(i in 1..n: (x[i] + 1 m)^2))
  init x[3]' = 0.2 m/s
}
scene c of shell {
  time 0 s to 2 s
  trace x[1], audit.energy
  accuracy 1e-6
}
"""


def test_work_along_a_function_of_a_sum_and_a_traced_balance(tmp_path, capsys):
    """The activity of the work is the variation of what it supplied; audit.energy has a unit of its own."""
    path = write(tmp_path, SHELL)
    code, answer = run_json(capsys, "reduce", path, "--scene", "c", "-o", str(tmp_path / "r.sd"))
    assert code == 0, answer["diagnostics"]
    found = {a["element"].partition(" (")[0]: a["activity"] for a in answer["result"]["activity"]}
    got = api.simulate(path, scene="c", output=str(tmp_path / "t.h5"), accuracy=1e-6)
    trace = api.simulate(write(tmp_path, SHELL.replace("audit.energy", "audit.supplied")), scene="c",
                         output=str(tmp_path / "s.h5"))  # fmt: skip
    assert np.abs(got["audit.energy"].values).max() < 1e-5
    supplied = trace["audit.supplied"].values
    assert found["work"] == pytest.approx(np.abs(np.diff(supplied)).sum(), rel=0.02)


SPLIT = """\
from std.electrical import resistor, capacitor, voltage
model ladder {
  param n = 4
  node v[0..n]: electrical
  V: voltage(v = 1 V*sin(2*pi*50 Hz*t)) v[0] -> ground
  R[1]: resistor(R = 1 ohm) v[0] -> v[1]
  for i in 2..n-1 { R[i]: resistor(R = 1 ohm) v[i-1] -> v[i] }
  R[n]: resistor(R = 1 kohm) v[n-1] -> v[n]
  for i in 1..n { C[i]: capacitor(C = 1 mF) v[i] -> ground }
}
scene hum of ladder { time 0 s to 0.1 s; trace v[1].e }
"""


def test_elements_of_several_statements_go_one_by_one(tmp_path, capsys):
    """`R[n][n]` stood for R[1], and n of `1..n` was taken for read nowhere: nothing could go."""
    code, told = run_json(capsys, "reduce", write(tmp_path, SPLIT), "--accuracy", "1e-2")
    assert code == 0
    named = {item["element"] for item in told["result"]["activity"]}
    assert named == {"V", "R[1]", "R[2..n - 1]", "R[n]", "C[1..n]"}
    assert [(t["element"], t["kept"]) for t in told["result"]["trials"]] == [("R[n]", True)]
    text = Path(told["result"]["file"]).read_text(encoding="utf-8")
    assert "R[n]:" not in text
    assert "R[1]:" in text
    assert "param n" in text
