"""What `linearize` says of a state and of inputs: no derivative that is round-off, no rest of what rolls."""

import json

import pytest
from sysdyn.cli.main import run

TWO_DISCS = """model lin {
  coord a, b: rotation
  energy T* = 1/2*(1 kg.m^2)*(a'^2 + b'^2)
  energy V = 1/2*(100 N.m/rad)*(a - b)^2
  input M: N.m = 0 N.m
  work M on a
}
scene s of lin {
  time 0 s to 1 s
  trace a', b', a'' as acceleration
}
"""
WHEEL = """model wheel {
  coord x: translation = 0 m
  coord th: rotation = 0 rad
  energy T* = 1/2*(1 kg)*x'^2 + 1/2*(0.1 kg.m^2)*th'^2
  psi roll: x' = 0.5 m*th'
  init x' = SPEED m/s
}
scene s of wheel {
  time 0 s to 1 s
  trace x'
}
"""
SKATE = """model skate {
  coord x, y: translation = 0 m
  coord th: rotation = 0 rad
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2) + 1/2*(0.1 kg.m^2)*th'^2
  psi edge: x'*sin(th) - y'*cos(th) = 0 m/s
  init x' = SPEED m/s
  init th' = 0 rad/s
}
scene s of skate {
  time 0 s to 1 s
  trace x'
}
"""
DISC = """model disc {
  param R = 0.3 m
  coord x, y: translation = 0 m
  coord a, h, r: rotation = 0 rad
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2 + (R*sin(a)*a')^2) + 1/2*(0.02 kg.m^2)*(a'^2 + (h'*cos(a))^2)
  energy T* = 1/2*(0.04 kg.m^2)*(r' + h'*sin(a))^2
  energy V = (1 kg)*g0*R*cos(a)
  psi px: x' = R*r'*cos(h) + R*(a'*cos(a)*sin(h) + h'*sin(a)*cos(h))
  psi py: y' = R*r'*sin(h) - R*(a'*cos(a)*cos(h) - h'*sin(a)*sin(h))
  init r' = SPEED rad/s
  init a' = 0 rad/s
  init h' = 0 rad/s
}
scene s of disc {
  time 0 s to 1 s
  trace a
}
"""
MOTOR = """model motor {
  node s: rotation
  J: kinetic(p = 2 kg.m^2*f) s
  D: dissipator(e = (1 N.m.s)*f) s -> ground
  T: effort(e = SPEED N.m) ground -> s
  init s.f = SPEED rad/s
}
scene s of motor {
  time 0 s to 1 s
  trace s.f
}
"""
DIVIDER = """from std.electrical import resistor, voltage, capacitor
model divider {
  node a, b: electrical
  V: voltage(v = 1 V) a -> ground
  R: resistor(R = 1 ohm) a -> b
  R2: resistor(R = 1 ohm) b -> ground
  C: capacitor(C = 1 F) b -> ground
  init C.e = 0.5 V
}
scene s of divider {
  time 0 s to 1 s
  trace b.e
}
"""


def told(text, folder, capsys, *options):
    path = folder / "m.sd"
    path.write_text(text)
    assert run(["linearize", str(path), *options]) == 0
    out = capsys.readouterr()
    return out.out, out.err


def test_what_is_zero_but_for_round_off_is_no_derivative(tmp_path, capsys):
    """a''/M = (s^2 + 100)/(s^2 + 200) has a direct part and no more; the modes are undamped to the last digit."""
    out, _ = told(TWO_DISCS, tmp_path, capsys)
    assert "differentiates" not in out
    assert "e-" not in out
    path = tmp_path / "m.sd"
    run(["linearize", str(path), "--json"])
    result = json.loads(capsys.readouterr().out)["result"]
    assert [re for re, _ in result["eigenvalues"]] == [0.0] * 4
    assert not {"D1", "D2"} & result["reduced"].keys()


@pytest.mark.long
def test_a_true_derivative_is_told(tmp_path, capsys):
    """The torque of a path a = u is J u'': -1 s^2 is exact."""
    text = TWO_DISCS.replace("  input M: N.m = 0 N.m\n  work M on a\n", "  input u: 1 = 0\n  phi path: a = u\n")
    out, _ = told(text.replace("a', b', a'' as acceleration", "path.multiplier as torque"), tmp_path, capsys)
    assert "differentiates its input" in out


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
@pytest.mark.parametrize("text", [WHEEL, SKATE, DISC, MOTOR], ids=["wheel", "skate", "disc", "motor"])
@pytest.mark.one_in(12)
def test_what_rolls_steadily_is_not_at_rest(text, formulation, tmp_path, capsys):
    """Also where its position is no unknown, for nothing depends on it; without speed it is at rest."""
    options = "--formulation", formulation
    assert ", in steady motion" in told(text.replace("SPEED", "3"), tmp_path, capsys, *options)[1]
    assert ", at rest" in told(text.replace("SPEED", "0"), tmp_path, capsys, *options)[1]


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_a_current_through_a_circuit_at_rest_is_no_motion(formulation, tmp_path, capsys):
    """In every formulation; of a motor the complementary ones know the momentum."""
    options = "--formulation", formulation
    assert ", at rest" in told(DIVIDER, tmp_path, capsys, *options)[1]
    assert ", in steady motion" in told(MOTOR.replace("SPEED", "3"), tmp_path, capsys, *options)[1]
