"""Impacts among dry friction, ratchets and closed chains, and friction that is held more often than needed."""

import numpy as np
import pytest
from sysdyn import api

FORMULATIONS = pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
LINE = """\
component gap {
  param lo = 0 m
  param bounce = 0
  branch: translation
  phi lower: q >= lo restitution bounce
}
component ratchet {
  branch: translation
  psi one_way: f >= 0 m/s
}
"""


def run(tmp_path, text, formulation):
    (tmp_path / "model.sd").write_text(text)
    return api.simulate(tmp_path / "model.sd", formulation=formulation, output=tmp_path / "out.h5")


def off(trace, name, expected, instant=0.1):
    """Largest difference of a quantity, the rows of the impact itself (before and behind it) left out."""
    return np.abs(trace[name].values - expected)[np.abs(trace.time - instant) > 1e-9].max()


STRUCK = (
    LINE
    + """\
from std.mechanical import mass, coulomb
model struck {
  node a, b: translation
  A: mass(m = 2 kg) a
  B: mass(m = 3 kg) b
  rest: coulomb(Fc = 40 N) b -> ground
  gap: gap(lo = -0.5 m, bounce = 0.5) b -> a
  init a.q = 0 m
  init b.q = 0 m
  init a.f = 5 m/s
  init b.f = 0 m/s
}
scene hit of struck {
  time 0 s to 0.4 s
  trace a.f, b.f, b.q every 0.01 s
  accuracy 1e-8
}
"""
)


@FORMULATIONS
def test_dry_friction_gives_way_to_an_impact(tmp_path, formulation):
    """No finite effort has an impulse: the body at rest takes its part of the momentum, and slides until it stops."""
    trace = run(tmp_path, STRUCK, formulation)
    a, b = 5 - 3 / 5 * 1.5 * 5, 2 / 5 * 1.5 * 5
    since = trace.time - 0.1
    behind = since > 0
    slid = np.minimum(since, b * 3 / 40)
    assert off(trace, "b.f", np.where(behind, b - 40 / 3 * slid, 0.0)) < 3e-7
    assert off(trace, "b.q", np.where(behind, b * slid - 20 / 3 * slid**2, 0.0)) < 3e-9
    assert off(trace, "a.f", np.where(behind, a, 5.0)) < 3e-7


FOLLOWED = (
    LINE
    + """\
from std.mechanical import mass
model followed {
  node a, b: translation
  A: mass(m = 2 kg) a
  B: mass(m = 3 kg) b
  wall: gap(bounce = 0.8) a -> ground
  pawl: ratchet b -> a
  init a.q = 0.5 m
  init b.q = 7 m
  init a.f = -5 m/s
  init b.f = -4 m/s
}
scene hit of followed {
  time 0 s to 0.2 s
  trace a.f, b.f every 0.01 s
  accuracy 1e-8
}
"""
)


@FORMULATIONS
@pytest.mark.long
def test_a_ratchet_hands_an_impact_on(tmp_path, formulation):
    """What rebounds at 0.8 of its speed takes along what may not be slower than it."""
    trace = run(tmp_path, FOLLOWED, formulation)
    behind = trace.time > 0.1
    assert off(trace, "a.f", np.where(behind, 4.0, -5.0)) < 1e-7
    assert off(trace, "b.f", np.where(behind, 4.0, -4.0)) < 1e-7


JAMMED = (
    LINE
    + """\
from std.mechanical import mass
model jammed {
  node a, b, c: translation
  A: mass(m = 2 kg) a
  B: mass(m = 3 kg) b
  C: mass(m = 5 kg) c
  one: gap(lo = -0.5 m, bounce = 0.5) c -> a
  two: gap(bounce = 0.5) a -> b
  pawl: ratchet b -> c
  init a.q = 0 m
  init b.q = 0 m
  init c.q = 0 m
  init a.f = 5 m/s
  init b.f = 5 m/s
  init c.f = 0 m/s
}
scene hit of jammed {
  time 0 s to 0.2 s
  trace a.f, b.f, c.f every 0.01 s
  accuracy 1e-8
}
"""
)


@FORMULATIONS
def test_a_closed_chain_of_contacts_goes_on_as_one(tmp_path, formulation):
    """c may not part from a, for a pushes b and b may not be slower than c: no restitution can be met."""
    trace = run(tmp_path, JAMMED, formulation)
    behind = trace.time > 0.1
    for name, before in (("a.f", 5.0), ("b.f", 5.0), ("c.f", 0.0)):
        assert off(trace, name, np.where(behind, 2.5, before)) < 1e-7


HELD = """\
from std.mechanical import inertia, coulomb_joint, torque
model held {
  node a, b: rotation
  A: inertia(J = 2 kg.m^2) a
  B: inertia(J = 3 kg.m^2) b
  one: coulomb_joint(Mc = 4 N.m) a -> ground
  two: coulomb_joint(Mc = 3 N.m) a -> b
  three: coulomb_joint(Mc = 5 N.m) b -> ground
  T: torque(M = 10 N.m/(1 s)*t) ground -> a
  init a.q = 0 rad
  init b.q = 0 rad
  init a.f = 0 rad/s
  init b.f = 0 rad/s
}
scene pull of held {
  time 0 s to 1.5 s
  trace a.q, a.f, b.q, b.f every 0.05 s
  accuracy 1e-7
}
"""


@FORMULATIONS
@pytest.mark.parametrize(("pulled", "other", "bound", "inertia"), [("a", "b", 7.0, 2.0), ("b", "a", 8.0, 3.0)])
@pytest.mark.one_in(5)
def test_friction_that_holds_in_a_loop(tmp_path, formulation, pulled, other, bound, inertia):
    """Three joints hold two bodies: how they share the load is open, that one slides at the sum of its two is not."""
    trace = run(tmp_path, HELD.replace("ground -> a\n  init", f"ground -> {pulled}\n  init"), formulation)
    since = np.maximum(trace.time - bound / 10, 0.0)
    assert np.abs(trace[f"{pulled}.q"].values - 10 / 6 / inertia * since**3).max() < 1e-7
    assert np.abs(trace[f"{pulled}.f"].values - 5 / inertia * since**2).max() < 3e-7
    assert np.abs(trace[f"{other}.q"].values).max() < 1e-12
    assert abs(max(e.time for e in trace.events) - bound / 10) < 1e-7


@FORMULATIONS
@pytest.mark.one_in(2)
def test_what_friction_holds_is_at_rest(tmp_path, formulation):
    """A load below all bounds moves nothing: a trace of zeros, judged as such."""
    trace = run(tmp_path, HELD.replace("10 N.m/(1 s)*t", "2 N.m*sin(9 rad/s*t)"), formulation)
    assert trace.attributes["met"] == 1
    assert max(np.abs(trace[name].values).max() for name in ("a.q", "a.f", "b.q")) < 1e-14


PUCK = """\
model puck {
  coord x: translation = 0 m
  coord y: translation = 0 m
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2)
  content D = 4 N*FRICTION
  init x' = 0 m/s
  init y' = 0 m/s
  PUSH
}
scene slide of puck {
  time 0 s to 1 s
  trace x, y, x', y' every 0.05 s
  accuracy 1e-7
}
"""


@FORMULATIONS
@pytest.mark.parametrize("friction", ["abs(y')", "hypot(x', y')"])
@pytest.mark.long
def test_a_flow_that_is_assigned_frees_what_sticks(tmp_path, formulation, friction):
    """The blow of an event is an impulse as any other: friction brakes what it set going, and does not undo it."""
    text = PUCK.replace("FRICTION", friction).replace("PUSH", "when t >= 0.5 s { y' := 3 m/s }")
    trace = run(tmp_path, text, formulation)
    since = np.maximum(trace.time - 0.5, 0.0)
    assert off(trace, "y", 3 * since - since**2, 0.5) < 1e-7
    assert off(trace, "y'", np.where(trace.time > 0.5, 3 - 2 * since, 0.0), 0.5) < 3e-7


@FORMULATIONS
@pytest.mark.one_in(2)
def test_a_puck_is_pulled_from_rest(tmp_path, formulation):
    """In the plane it sticks until the pull is its bound, and slides along the pull."""
    push = "work 6 N/(1 s)*t*cos(2.1 rad) on x; work 6 N/(1 s)*t*sin(2.1 rad) on y"
    trace = run(tmp_path, PUCK.replace("FRICTION", "hypot(x', y')").replace("PUSH", push), formulation)
    since = np.maximum(trace.time - 4 / 6, 0.0)
    for name, part in (("x", np.cos(2.1)), ("y", np.sin(2.1))):
        assert np.abs(trace[name].values - part * 0.5 * since**3).max() < 3e-8
        assert np.abs(trace[name + "'"].values - part * 1.5 * since**2).max() < 1e-7


BALL = """\
model ball {
  param mu = 0.3
  coord x: translation = 0 m
  coord y: translation = 1 m
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2)
  work -(2 kg)*g0 on y
  phi floor: y >= 0 m restitution 0.5
  rub: dissipator(e = mu*floor.multiplier*setsign(f)) on x
  init x' = 2.5 m/s
  init y' = 0 m/s
}
scene bounce of ball {
  time 0 s to 2 s
  trace x', y every 0.02 s
  accuracy 1e-6
}
"""


@FORMULATIONS
@pytest.mark.parametrize("mu", [0.1, 0.9])
@pytest.mark.one_in(2)
def test_a_bounce_rubs_by_its_impulse(tmp_path, formulation, mu):
    """Coulomb's law for impulses: each bounce takes mu of its impulse along the floor, at most what turns back; what is
    left when the ball rests slides on by its weight.
    """
    trace = run(tmp_path, BALL.replace("mu = 0.3", f"mu = {mu}"), formulation)
    g, t, speed, down = 9.80665, np.sqrt(2 / 9.80665), 2.5, np.sqrt(2 * 9.80665)
    expected = np.full(trace.time.shape, speed)
    while down > 1e-12:
        speed = max(speed - mu * 1.5 * down, 0.0)
        expected[trace.time > t] = speed
        down *= 0.5
        t += 2 * down / g
    expected = np.where(trace.time > t, np.maximum(speed - mu * g * (trace.time - t), 0.0), expected)
    instants = np.array([event.time for event in trace.events])
    between = np.abs(trace.time[:, None] - instants).min(axis=1) > 1e-6
    assert np.abs(trace["x'"].values - expected)[between].max() < 1e-5


READ = """\
model read {
  coord x: translation = 0 m
  coord y: translation = 0 m
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2)
  work 3 N on y
  LAW
  phi rail: y = 0 m
  init x' = 2 m/s
  init y' = 0 m/s
}
scene slow of read {
  time 0 s to 3 s
  trace x' every 0.1 s
  accuracy 1e-8
}
"""


@FORMULATIONS
@pytest.mark.parametrize(
    "law",
    [
        "drag: dissipator(e = 0.4*rail.multiplier*f/(1 m/s)) on x",
        "let load = 0.4*rail.multiplier\n  drag: dissipator(e = load*f/(1 m/s)) on x",
        "implicit F: N ~ 1 N\n  gamma rub: F = 0.4*rail.multiplier*x'/(1 m/s)\n  work -F on x",
    ],
)
@pytest.mark.long
def test_a_law_reads_the_reaction_of_a_constraint_behind_it(tmp_path, formulation, law):
    """The order of statements does not matter: an element whose law read a later constraint was left out in silence."""
    trace = run(tmp_path, READ.replace("LAW", law), formulation)
    assert np.abs(trace["x'"].values - 2 * np.exp(-0.4 * 3 / 2 * trace.time)).max() < 1e-7


PRESSED = """\
from std.fluid import ram
from std.mechanical import mass, stops
model pressed {
  node c: hydraulic
  node x: translation
  P: effort(e = 1 kPa) c -> ground
  K: potential(e = 1e6 Pa/m^3*q) c -> ground
  R: ram(A = 20 cm^2) a = c, rod = x
  M: mass(m = 4 kg) x
  W: stops(lo = -1 m, hi = 0.25 m, bounce = 0.5) x
  init x.q = 0 m
  init x.f = 0 m/s
}
scene hit of pressed {
  time 0 s to 1.9 s
  trace x.q, x.f every 0.01 s
  accuracy 1e-8
}
"""


@FORMULATIONS
@pytest.mark.long
def test_an_impact_where_rates_of_balances_are_settled_too(tmp_path, formulation):
    """A vessel that its source holds leaves a flow to the rates; a piston under constant force bounces beside it."""
    trace = run(tmp_path, PRESSED, formulation)
    back = 0.5 * 0.5  # 0.5 m/s at t = 1 s; half of it, and 0.5 s out and 0.5 s in again, under 0.5 m/s^2
    since = trace.time - 1.0
    expected = np.where(since < 0, 0.5 * trace.time, -back + 0.5 * since)
    assert off(trace, "x.f", expected, 1.0) < 1e-8
    place = np.where(since < 0, 0.25 * trace.time**2, 0.25 - back * since + 0.25 * since**2)
    assert np.abs(trace["x.q"].values - place).max() < 1e-8
