"""Stiction on many bodies: complementarity over all of them at once, no chatter, rest that is a balance of forces."""

import numpy as np
import pytest
from sysdyn import api
from sysdyn.api import simulate

CHAIN = """
model chain {
  param n = 20
  param m = 0.1 kg
  param k = 50 N/m
  param Fc = 0.05 N
  coord x[1..n]: translation = 0 m
  energy T* = sum(i in 1..n: 1/2*m*x[i]'^2)
  energy V = 1/2*k*x[1]^2 + sum(i in 2..n: 1/2*k*(x[i] - x[i-1])^2)
  for i in 1..n { content D = Fc*abs(x[i]') }
  for i in 1..n-1 { init x[i]' = 0 m/s }
  init x[n]' = 1 m/s
}
scene s of chain {
  time 0 s to 5 s
  trace TRACED, audit.energy every 50 ms
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_a_chain_of_twenty_comes_to_rest(formulation, tmp_path):
    file = tmp_path / "m.sd"
    traced = ", ".join(f"x[{i}] as x{i}, x[{i}]' as v{i}" for i in range(1, 21))
    file.write_text(CHAIN.replace("TRACED", traced))
    trace = simulate(file, output=tmp_path / "m.h5", formulation=formulation)
    speeds = [trace[f"v{i}"].values[-1] for i in range(1, 21)]
    assert np.abs(speeds).max() < 1e-9
    x = np.array([0.0, *(trace[f"x{i}"].values[-1] for i in range(1, 21))])
    pull = np.append(np.diff(x), 0.0)
    assert np.abs(50.0 * np.diff(pull)).max() <= 0.05 * (1.0 + 1e-3)  # what the springs leave, friction holds
    assert np.abs(trace["audit.energy"].values).max() < 1e-4 * 0.05
    assert len(trace.events) < 400


BOX = """
model box {
  param w = 0.5 m
  coord x: translation = 0 m
  coord y: translation = 0.1 m
  coord th: rotation = 0 rad
  energy T* = 1/2*2 kg*(x'^2 + y'^2) + 1/2*0.1 kg.m^2*th'^2
  energy V = 2 kg*g0*y
  phi f1: y - w*sin(th) >= 0 m restitution 0
  phi f2: y - w/3*sin(th) >= 0 m restitution 0
  phi f3: y + w/3*sin(th) >= 0 m restitution 0
  phi f4: y + w*sin(th) >= 0 m restitution 0
}
scene drop of box {
  time 0 s to 1 s
  trace y, th, y' as v every 10 ms
  accuracy 1e-6
}
"""


@pytest.mark.long
def test_a_box_drops_on_four_feet_and_stays_level(tmp_path):
    file = tmp_path / "box.sd"
    file.write_text(BOX)
    trace = simulate(file, output=tmp_path / "box.h5")
    assert trace.attributes["met"] == 1
    landed = np.sqrt(0.2 / 9.80665)
    y = np.where(trace.time < landed, 0.1 - 0.5 * 9.80665 * trace.time**2, 0.0)
    assert np.abs(np.asarray(trace["y"]) - y).max() < 1e-12
    assert np.abs(np.asarray(trace["th"])).max() < 1e-30


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_friction_on_a_reaction_of_the_wrong_sign_is_told(tmp_path, formulation):
    """The multiplier of y = 0 is minus the reaction: what would rub drives, from 25 N*sin(1.3 t) = 0.3 m g on."""
    text = """\
model m {
  coord x, y: translation = 0 m
  energy T* = 1/2*(3 kg)*(x'^2 + y'^2)
  energy V = (3 kg)*g0*y
  phi floor: y = 0 m
  implicit R: N ~ 0 N
  work R on x
  gamma fr: R + 0.3*REACTION*setsign(x') = 0 N
  work 25 N*sin(1.3 rad/s*t) on x
  init x' = 0 m/s
}
scene s of m { time 0 s to 1 s; trace x }
"""
    (tmp_path / "m.sd").write_text(text.replace("REACTION", "floor.multiplier"))
    with pytest.raises(api.SolverFailure, match="drives") as failed:
        api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5", formulation=formulation)
    assert failed.value.time == pytest.approx(np.arcsin(0.9 * 9.80665 / 25.0) / 1.3, abs=1e-6)
    for reaction in ("floor.on(y)", "abs(floor.multiplier)"):
        (tmp_path / "m.sd").write_text(text.replace("REACTION", reaction))
        assert api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5", formulation=formulation).final == 1


def test_friction_of_the_wrong_sign_is_told_of_what_moves_already(tmp_path):
    """A bowling ball that its lane pushed on, told as met: no event happens that would ask."""
    text = """model ball {
  coord x, y: translation = 0 m
  coord th: rotation = 0 rad
  energy T* = 1/2*(6 kg)*(x'^2 + y'^2) + 1/5*(6 kg)*(11 cm)^2*th'^2
  energy V = (6 kg)*g0*y
  phi lane: y = 0 m
  implicit R: N
  work R on x - 11 cm*th
  gamma fr: R + 0.2*REACTION*setsign(x' - 11 cm*th') = 0 N
  init x' = 7 m/s
  init th' = 0 rad/s
}
scene s of ball { time 0 s to 1.5 s; trace x, x' }
"""
    (tmp_path / "m.sd").write_text(text.replace("REACTION", "lane.multiplier"))
    with pytest.raises(api.SolverFailure, match="drives at t = 0 s"):
        api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")
    (tmp_path / "m.sd").write_text(text.replace("REACTION", "lane.on(y)"))
    trace = api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")
    slides = np.minimum(trace.time, 2.0 * 7.0 / (7.0 * 0.2 * 9.80665))
    assert np.abs(trace["x'"].values - (7.0 - 0.2 * 9.80665 * slides)).max() < 1e-3


TURNING = """model lifted {
  coord x, y: translation = 0 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  work (1 kg)*g0*cos(t/(1 s)) on y
  phi lane: y = 0 m
  implicit R: N
  work R on x
  gamma fr: R + 0.3*REACTION*setsign(x') = 0 N
  init x' = 50 m/s
}
scene s of lifted { time 0 s to 3 s; trace x' }
"""


@pytest.mark.parametrize(
    ("reaction", "formulation"),
    [("lane.multiplier", "lagrangian"), ("lane.multiplier", "hamiltonian"), ("(-lane.on(y))", "kane")],
)
def test_friction_on_a_reaction_that_turns_is_told_where_it_begins_to_drive(tmp_path, reaction, formulation):
    """cos t passes zero: from there on it drove, told as met.  What its text keeps above zero (abs) brakes on."""
    file = tmp_path / "m.sd"
    file.write_text(TURNING.replace("REACTION", reaction))
    with pytest.raises(api.SolverFailure, match="drives") as failed:
        api.simulate(file, output=tmp_path / "m.h5", formulation=formulation)
    assert failed.value.time == pytest.approx(np.pi / 2, abs=1e-6)
    file.write_text(TURNING.replace("REACTION", f"abs({reaction})"))
    trace = api.simulate(file, output=tmp_path / "m.h5", formulation=formulation)
    braked = np.where(trace.time < np.pi / 2, np.sin(trace.time), 2.0 - np.sin(trace.time))
    assert np.abs(trace["x'"].values - (50.0 - 0.3 * 9.80665 * braked)).max() < 5e-3


def test_a_sign_on_a_reaction_that_turns_drives_nobody(tmp_path):
    """A relay of a position has either sense: x'' = -30 x - 0.5 cos t sign x."""
    text = TURNING.replace("setsign(x')", "setsign(x)").replace("init x' = 50 m/s", "init x' = 5 m/s")
    text = text.replace("0.3*REACTION", "0.05*lane.multiplier").replace("  phi", "  energy V = 1/2*(30 N/m)*x^2\n  phi")
    (tmp_path / "m.sd").write_text(text)
    assert api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5").attributes["met"] == 1


SUMS = """model m {
  param n = 3
  param mu = 0.25
  for i in 1..n { param Fc[i] = 2 N*i }
  coord x[1..n]: translation = 0.3 m
  energy T* = sum(i in 1..n: 1/2*(1 kg)*x[i]'^2)
  energy V = sum(i in 1..n: 1/2*(10 N/m)*x[i]^2)
  content D = 2*mu*sum(i in 1..n: Fc[i]*abs(x[i]'))
}
scene s of m { time 0 s to 0.9 s; trace x[1..n] every 0.1 s; accuracy 1e-6 }
"""


def test_friction_in_a_sum_is_that_of_each_element(tmp_path):
    """x = F/k + (x0 - F/k) cos(w t) until the first turn, F = 1, 2 and 3 N: the last is as much as the spring's."""
    (tmp_path / "m.sd").write_text(SUMS)
    trace = simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")
    for k, force in enumerate((1.0, 2.0, 3.0), 1):
        exact = force / 10.0 + (0.3 - force / 10.0) * np.cos(np.sqrt(10.0) * trace.time)
        assert np.abs(trace[f"x[{k}]"].values - exact).max() < 1e-6
