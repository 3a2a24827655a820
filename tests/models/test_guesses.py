"""A guess that is consistent comes back, on the root that it is on; every guess that moved is noted."""

import json
import math

import pytest
from model_runs import attempt, trace_of
from sysdyn import api
from sysdyn.cli.main import run

CRANK = """
model crank {{
  param r = 0.21 m
  param l = 0.64 m
  coord th: rotation ~ {angle!r} rad
  coord x: translation ~ {guess}
  energy T* = 1/2*(1.7 kg)*x'^2 + 1/2*(0.3 kg.m^2)*th'^2
  phi rod: (x - r*cos(th))^2 + (r*sin(th))^2 = l^2
  init th' = 0 rad/s
}}
scene turn of crank {{
  formulation {formulation}
  time 0 s to 0.01 s
  trace x, th
}}
"""
ROOT = "r*cos(th) {sign} sqrt(l^2 - (r*sin(th))^2)"


def started(tmp_path, capsys, text):
    """x and th at the start, and what `check` says has moved."""
    from sysdyn.runtime.trace.trace import Trace

    path = tmp_path / "model.sd"
    path.write_text(text)
    assert run(["check", "--json", str(path)]) == 0
    (file,) = json.loads(capsys.readouterr().out)["result"]["files"]
    (target,) = file["targets"]
    assert run(["simulate", str(path), "-q", "--backend", "numpy", "-o", str(tmp_path / "trace.h5")]) == 0
    trace = Trace.open(tmp_path / "trace.h5")
    return float(trace["x"][0]), float(trace["th"][0]), target["moved"]


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("sign", ["+", "-"])
@pytest.mark.parametrize("angle", [0.0, 0.6, 1.2, 2.0, 3.0, 4.4, -0.9])
@pytest.mark.long
def test_a_consistent_guess_comes_back(tmp_path, capsys, angle, sign, formulation):
    text = CRANK.format(angle=angle, guess=ROOT.format(sign=sign), formulation=formulation)
    x, th, moved = started(tmp_path, capsys, text)
    assert th == angle
    root = math.sqrt(0.64**2 - (0.21 * math.sin(angle)) ** 2)
    assert x == pytest.approx(0.21 * math.cos(angle) + (root if sign == "+" else -root), rel=1e-14)
    assert moved == []


@pytest.mark.long
def test_a_guess_by_an_expression_that_moved_is_noted(tmp_path, capsys):
    text = CRANK.format(angle=0.6, guess=ROOT.format(sign="-") + " - 0.02 m", formulation="lagrangian")
    x, th, moved = started(tmp_path, capsys, text)
    root = 0.21 * math.cos(th) - math.sqrt(0.64**2 - (0.21 * math.sin(th)) ** 2)
    assert x == pytest.approx(root, rel=1e-12)
    (line,) = [m for m in moved if m.startswith("x: ")]
    before, after = line.removeprefix("x: ").partition(",")[0].split(" -> ")
    assert float(after) == pytest.approx(x, rel=1e-5)
    assert float(before) == pytest.approx(x - 0.02, rel=1e-4)
    assert "phi rod" in line


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_a_written_guess_stays_where_unwritten_ones_can_move(tmp_path, capsys, formulation):
    path = tmp_path / "pair.sd"
    path.write_text("""
model pair {
  param l = 0.37 m
  coord a: rotation ~ 0.2 rad
  coord b: rotation
  coord x: translation
  energy T* = 1/2*1.3 kg.m^2*a'^2 + 1/2*0.9 kg.m^2*b'^2 + 1/2*2 kg*x'^2
  phi along: l*cos(a) + l*cos(b) = x
  phi across: l*sin(a) + l*sin(b) = 0 m
  init a' ~ 1.7 rad/s
}
scene go of pair { time 0 s to 10 ms; trace a, b, a', b' every 5 ms }
""")
    assert run(["check", str(path)]) == 0
    assert "a':" not in capsys.readouterr().out
    assert run(["simulate", str(path), "-q", "--formulation", formulation, "-o", str(tmp_path / "t.h5")]) == 0
    from sysdyn.runtime.trace.trace import Trace

    trace = Trace.open(tmp_path / "t.h5")
    assert float(trace["a'"][0]) == 1.7
    assert float(trace["b'"][0]) == pytest.approx(-1.7, rel=1e-12)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
@pytest.mark.long
def test_so_does_a_guessed_speed_along_an_edge(tmp_path, formulation):
    path = tmp_path / "edge.sd"
    path.write_text("""
model edge {
  coord x: translation
  coord y: translation
  coord th: rotation = 0.3 rad
  energy T* = 1/2*2.2 kg*(x'^2 + y'^2) + 1/2*0.4 kg.m^2*th'^2
  psi blade: sin(th)*x' = cos(th)*y'
  init x' ~ 1.1 m/s
  init th' = 0.5 rad/s
}
scene go of edge { time 0 s to 10 ms; trace x', y' every 5 ms }
""")
    assert run(["simulate", str(path), "-q", "--formulation", formulation, "-o", str(tmp_path / "t.h5")]) == 0
    from sysdyn.runtime.trace.trace import Trace

    trace = Trace.open(tmp_path / "t.h5")
    assert float(trace["x'"][0]) == 1.1
    assert float(trace["y'"][0]) == pytest.approx(1.1 * math.tan(0.3), rel=1e-12)


CHARGED = """
model charged {
  node a, b: electrical
  C1: potential(q = 3 uF*e + 1 uF/V^2*e^3) a -> b
  C2: potential(q = 5 uF*e) b
  R: dissipator(e = 2 kohm*f) a
  L: kinetic(p = 0.4 H*f) b
  init C1.e ~ 1.25 V
  init C2.e ~ -0.5 V
  init L.f ~ 3 mA
}
scene go of charged { time 0 s to 1 ms; trace C1.e, C2.e, L.f every 0.5 ms }
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_consistent_guesses_of_stores_come_back_in_both_families(tmp_path, capsys, formulation):
    path, out = tmp_path / "charged.sd", tmp_path / "t.h5"
    path.write_text(CHARGED)
    assert run(["simulate", str(path), "-q", "--formulation", formulation, "-o", str(out)]) == 0
    from sysdyn.runtime.trace.trace import Trace

    trace = Trace.open(out)
    first = [float(trace[name][0]) for name in ("C1.e", "C2.e", "L.f")]
    assert first == pytest.approx([1.25, -0.5, 3e-3], rel=1e-12)


@pytest.mark.parametrize("sign", ["=", "~"])
@pytest.mark.parametrize("where", ["node a: electrical {} 5 V", "node a: electrical\n  init a.e {} 5 V"])
def test_the_effort_of_a_node_that_a_source_holds_agrees_or_is_a_guess(tmp_path, where, sign):
    """Rule 24 of the language: a value that is not the source's is E903, one that is guessed moves to it."""
    text = f"""from std.electrical import voltage, resistor
model held {{
  {where.format(sign)}
  node b: electrical
  V: voltage(v = 1 V) a -> ground
  R: resistor(R = 2 ohm) a -> b
  S: resistor(R = 3 ohm) b -> ground
}}
scene s of held {{ time 0 s to 1 s; trace a.e, R.f }}
"""
    if sign == "~":
        trace = trace_of(tmp_path, text)
        assert [trace["a.e"][0], trace["R.f"][0]] == pytest.approx([1.0, 0.2], rel=1e-12)
        return
    ran, report = attempt(tmp_path, text)
    assert ran is None
    assert [(d.code, d.message) for d in report] == [
        ("E903", "an initial value contradicts the constraints: residual 4 V")
    ]


def test_what_is_left_of_a_velocity_has_the_unit_of_one(tmp_path):
    """A ball that begins on the floor and into it; it was 4 m."""
    path = tmp_path / "ball.sd"
    path.write_text(
        "model ball {\n coord y: translation = 0 m\n energy T* = 1/2*(2 kg)*y'^2\n phi floor: y >= 0 m\n"
        " init y' = -4 m/s\n}\nscene fall of ball { time 0 s to 1 s }\n"
    )
    with pytest.raises(api.ModelError, match=r"floor: residual 4 m/s$"):
        api.simulate(path, output=tmp_path / "ball.h5")


HANGING = """model hanging {
  coord x: translation = 0.1 m
  coord turn: rotation ~ 0.3 rad
  coord a: rotation = 1 rad
  phi TIE
  let bob = x + 0.3 m*sin(a)
  let height = -0.3 m*cos(a)
  energy T* = 1/2*(3 kg)*x'^2 + 1/2*(0.06 kg.m^2)*turn'^2 + 1/2*(1 kg)*(bob'^2 + height'^2)
  energy V = (1 kg)*g0*height
  init turn' SAID
}
scene go of hanging { time 0 s to 0.01 s; trace x', turn', a' }
"""


@pytest.mark.parametrize(
    ("tie", "said", "speed", "turns"),
    [
        ("rolls: x = 0.2 m*sin(turn)", "= 5 rad/s", 0.75**0.5, 5.0),
        ("driven: x = 0.1 m + 0.2 m*sin(5 rad/s*t)", "~ 0 rad/s", 1.0, 0.0),
    ],
)
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
@pytest.mark.long
def test_what_constraints_move_moves_nothing_else(tmp_path, formulation, tie, said, speed, turns):
    """A pendulum on a trolley that is told to move hangs at rest, as guessed, though they share momentum."""
    trace = trace_of(tmp_path, HANGING.replace("TIE", tie).replace("SAID", said), formulation=formulation)
    found = [trace[name].values[0] for name in ("x'", "turn'", "a'")]
    assert found == pytest.approx([speed, turns, 0.0], abs=1e-9)


TRANSFORMER = """from std.electrical import coupled_inductors, current, resistor
model transformer {
  node a, b: electrical
  I: current(i = 2 A) ground -> a
  K: coupled_inductors(L1 = 1 H, L2 = 2 H, k = 0.6) one = a -> ground, two = b -> ground
  R: resistor(R = 1 ohm) b -> ground
}
scene go of transformer { time 0 s to 0.01 s; trace K.one.f, K.two.f }
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_a_source_through_one_coil_leaves_the_other_as_guessed(tmp_path, formulation):
    trace = trace_of(tmp_path, TRANSFORMER, formulation=formulation)
    assert [trace[name].values[0] for name in ("K.one.f", "K.two.f")] == pytest.approx([2.0, 0.0], abs=1e-9)
