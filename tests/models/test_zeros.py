"""Quantities that are zero by symmetry or by a balance: what round-off leaves of them is nobody's error."""

import numpy as np
import pytest
from sysdyn import api

LINKS = """\
from std.mechanical import body2d, revolute2d

model falling {
  node a, b, c: planar
  A: body2d(m = 2 kg, J = 0.2 kg.m^2) cm = a
  B: body2d(m = 3 kg, J = 0.1 kg.m^2) cm = b
  C: body2d(m = 1 kg, J = 0.3 kg.m^2) cm = c
  ab: revolute2d(ra = [0.3 m, 0.1 m], rb = [-0.4 m, -0.2 m]) a = a, b = b
  bc: revolute2d(ra = [0.2 m, -0.3 m], rb = [-0.5 m, 0.1 m]) a = b, b = c
  init a.th.q = 1.3 rad
  init b.th.q = -0.7 rad
  init c.th.q = 2.2 rad
  init a.x.q = 0.4 m
  init a.y.q = 0 m
  init a.th.f = 0 rad/s
  init b.th.f = 0 rad/s
  init c.th.f = 0 rad/s
  init a.x.f = 0 m/s
  init a.y.f = 0 m/s
}

scene fall of falling {
  time 0 s to 1 s
  trace a.y.q, a.th.f, b.th.f, c.th.f, b.x.f, ab.px.multiplier, ab.py.multiplier, bc.px.multiplier every 0.1 s
  accuracy 1e-6
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_a_chain_that_falls_freely_does_not_turn(tmp_path, formulation):
    """Angular velocities and joint forces have no others of their units: they are round-off of weights and positions."""
    (tmp_path / "model.sd").write_text(LINKS)
    trace = api.simulate(tmp_path / "model.sd", formulation=formulation)
    t = trace.time
    assert np.abs(trace["a.y.q"].values - (-9.80665 / 2 * t**2)).max() < 1e-6 * 4.9
    for name in ("a.th.f", "b.th.f", "c.th.f", "b.x.f", "ab.px.multiplier", "ab.py.multiplier", "bc.px.multiplier"):
        assert np.abs(trace[name].values).max() < 1e-11, name


SHORTED = """\
model shorted {
  node e: electrical
  node r, s: rotation
  L: kinetic(f = 2 A/(1 V.s)*p) e -> ground
  C: potential(e = 0.5 V/(1 C)*q) e -> ground
  R: dissipator(e = 3 ohm*f) e -> ground
  D: dissipator(e = 1.5 N.m.s/rad*f) r -> s
  J: kinetic(f = 0.4 rad/s/(1 N.m.s)*p) s -> ground
  one: gyrator(e1 = 0.9 N.m/(1 A)*f2) r -> ground, e -> ground
  two: gyrator(e1 = 6.4 N.m/(1 A)*f2) r -> ground, e -> ground
  T: effort(e = 2 N.m*sin(3 rad/s*t)) ground -> s
  init L.p = -0.6 V.s
  init C.q = 0 C
  init J.p = 0 N.m.s
}

scene shut of shorted {
  time 0 s to 2 s
  trace L.e, C.e, R.f, L.f, J.f every 0.1 s
  accuracy 1e-6
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
def test_two_gyrators_that_short_each_other(tmp_path, formulation):
    """Two ratios at the same ends leave no voltage, no turning: the flux stays, the inertia has the damper alone."""
    (tmp_path / "model.sd").write_text(SHORTED)
    trace = api.simulate(tmp_path / "model.sd", formulation=formulation)
    t, decay = trace.time, 1.5 * 0.4
    turning = 0.8 * (decay * np.sin(3 * t) - 3 * np.cos(3 * t) + 3 * np.exp(-decay * t)) / (decay**2 + 9)
    assert np.abs(trace["J.f"].values - turning).max() < 1e-6 * np.abs(turning).max()
    assert np.abs(trace["L.f"].values + 1.2).max() < 1e-12
    assert max(np.abs(trace[name].values).max() for name in ("L.e", "C.e", "R.f")) < 1e-12


DRIVEN = """\
model driven {
  node h0, h1: hydraulic
  node t0, t1: translation = 0 m
  X1: kinetic(p = 19 Pa.s*(f/(1 m^3/s))) h1 -> h0
  init X1.p = 0 Pa.s
  X2: kinetic(f = 0.52 m^3/s*(p/(1 Pa.s))) h0 -> ground
  init X2.p = 0 Pa.s
  X3: dissipator(f = 1.76 m^3/s*(e/(1 Pa))) h0 -> ground
  X4: kinetic(p = 29 kg*f) t0 -> ground
  init X4.p = 0 N.s
  X6: dissipator(e = 3.2 N.s/m*f) t1 -> ground
  X7: potential(q = 0.83 m/N*e) t0 -> t1
  init X7.q = 0 m
  X8: potential(e = 0.706 N*sinh(q/(2.997 m))) t1 -> t0
  init X8.q = 0 m
  T0: gyrator(e1 = 0.105 Pa/(1 m/s)*f2) h1 -> ground, t0 -> ground
  S0: flow(f = 0.33 m/s*sin(3 rad/s*t)^5) t0 -> ground
  S1: effort(e = 0.145 N*sin(3 rad/s*t)^5) ground -> t0
}

scene s of driven {
  time 0 s to 0.2 s
  trace X2.f every 5 ms
}
"""


def test_rows_between_steps_leave_the_state_where_it_is(tmp_path):
    """A prescribed velocity settles forces that no state knows; a flux whose size balances overrate a million times
    stays: dp/dt = e with 1.76 e + 0.52 p = (p1 - p)/19, dp1/dt = 0.105 v.
    """
    (tmp_path / "model.sd").write_text(DRIVEN)
    trace = api.simulate(tmp_path / "model.sd", formulation="co_lagrangian", method="radau", rtol=1e-10)
    from scipy.integrate import solve_ivp

    def rates(t, z):
        return [0.105 * 0.33 * np.sin(3 * t) ** 5, ((z[0] - z[1]) / 19 - 0.52 * z[1]) / 1.76]

    wanted = solve_ivp(rates, (0, 0.2), [0, 0], method="DOP853", rtol=1e-12, atol=1e-22, t_eval=trace.time).y[1]
    assert np.abs(trace["X2.f"].values - 0.52 * wanted).max() < 1e-6 * 0.52 * wanted.max()
