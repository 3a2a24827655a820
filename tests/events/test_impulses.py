"""Impulses on one-way flows, against closed forms: what would pull lets go, whatever unit the flow is told in."""

import numpy as np
import pytest
from sysdyn.api import simulate

FREEWHEEL = """from std.mechanical import torque, inertia, ratchet
model m {
  node a, f: rotation
  M: torque(M = 2 N.m) ground -> a
  A: inertia(J = 0.1 kg.m^2) a
  F: inertia(J = 0.3 kg.m^2) f
  R: ratchet() f -> a
  discrete locked = false
  psi lock: a.f = 0 rad/s while locked
  when t >= 1 s { locked := true }
  init a.f = 0 rad/s
  init f.f = 0 rad/s
}
scene s of m { time 0 s to 2 s; trace a.f as driver, f.f as wheel every 0.4 s }
"""
"""A shaft that drives a wheel through a freewheel is locked."""

BOOST = """from std.electrical import switch, diode, resistor, inductor, capacitor, voltage
model m {
  node i, x, o: electrical
  V: voltage(v = 12 V) i -> ground
  L: inductor(L = 50 uH) i -> x
  S: switch(gate = if t < 7 us or t >= 20 us then 1 else 0) x -> ground
  D: diode.complementary() x -> o
  C: capacitor(C = 20 uF) o -> ground
  R: resistor(R = 60 ohm) o -> ground
  init L.f = 0 A
  init C.e = 0 V
}
scene s of m { time 0 s to 30 us; trace C.e as v every 5 us }
"""
"""A switch that closes beside a capacitor, which a diode keeps from it."""

SQUEEZED = """
model m {
  coord x: translation = 0.2 m
  coord y: translation = 0.5 m
  energy T* = 1/2*(1 kg)*x'^2 + 1/2*(1e6 kg)*y'^2
  phi wall: x >= 0 m restitution 0.9
  phi gap: y >= x restitution 1
  init x' = 0 m/s
  init y' = -0.3 m/s
}
scene s of m { time 0 s to 2 s; trace x, y, y' as v every 0.1 s }
"""
"""A ball between a wall and a heavy one that comes, which it stops by impacts without end."""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_a_freewheel_does_not_stop_what_turns_on(formulation, tmp_path):
    (tmp_path / "m.sd").write_text(FREEWHEEL)
    trace = simulate(tmp_path / "m.sd", output=tmp_path / "m.h5", formulation=formulation)
    after = trace.time > 1.0
    assert trace["wheel"].values == pytest.approx(np.minimum(5.0 * trace.time, 5.0), abs=1e-9)
    assert trace["driver"].values[after] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("formulation", ["lagrangian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_a_diode_keeps_a_capacitor_from_a_switch_that_closes(formulation, tmp_path):
    (tmp_path / "m.sd").write_text(BOOST)
    trace = simulate(tmp_path / "m.sd", output=tmp_path / "m.h5", formulation=formulation)
    v = dict(zip(np.round(trace.time * 1e6).tolist(), trace["v"].values.tolist(), strict=True))
    assert v[20] > 2.0
    assert v[30] == pytest.approx(v[20] * np.exp(-10e-6 / (60 * 20e-6)), rel=1e-6)


@pytest.mark.long
def test_a_wall_gives_a_ball_no_more_than_it_brought(tmp_path):
    (tmp_path / "m.sd").write_text(SQUEEZED)
    trace = simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")
    late = trace.time > 1.7
    assert np.abs(trace["v"].values).max() <= 0.3 + 1e-9
    assert trace["y"].values[late] == pytest.approx(0.0, abs=1e-4)
    assert trace["x"].values[late] == pytest.approx(0.0, abs=1e-4)
