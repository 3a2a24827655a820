"""Loose tolerances beside steep laws: rows are off by some tolerances, not by what no law bears (by SciPy)."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn import models
from sysdyn.api import simulate

RECTIFIER = """from std.electrical import voltage, resistor, capacitor
model rectifier {
  node a, b: electrical
  Vs: voltage(v = 10 V*sin(2*pi*50 Hz*t)) a -> ground
  D: dissipator(f = 1e-14 A*(exp(D.e/(25.852 mV)) - 1)) a -> b
  C: capacitor(C = 100 uF) b -> ground
  R: resistor(R = 1 kohm) b -> ground
  init C.e = 0 V
}
scene mains of rectifier {
  time 0 s to 50 ms
  trace b.e as v
}
"""
CLIPPER = """from std.electrical import voltage, resistor, capacitor
model clipper {
  node a, b: electrical
  Vs: voltage(v = 5 V*sin(2*pi*1 kHz*t)) a -> ground
  R: resistor(R = 2.2 kohm) a -> b
  C: capacitor(C = 10 nF) b -> ground
  D1: dissipator(f = 2.52 nA*(exp(D1.e/(45.3 mV)) - 1)) b -> ground
  D2: dissipator(f = 2.52 nA*(exp(D2.e/(45.3 mV)) - 1)) ground -> b
  init C.e = 0 V
}
scene tone of clipper {
  time 0 s to 5 ms
  trace b.e as v
}
"""
RELAXATION = """model relaxation {
  param mu = 1000
  state x: 1 = 2
  state v: 1/s = 0 s^-1
  dynamic x' = v
  dynamic v' = mu*(1 - x^2)*v/(1 s) - x/(1 s)^2
}
scene two of relaxation {
  time 0 s to 2000 s
  trace x
}
"""

NARROW = """model narrow {
  cocoord p: electrical = 0 Wb
  cocoord r: electrical = 0 Wb
  energy V* = 1/2*(10 uF)*p'^2 + 1/4*(1 uF/V^2)*r'^4 + 1/2*(2 uF)*r'^2
  energy T = 1/2*(p - r)^2/(20 mH)
  content G = 1/2*(0.01 S)*p'^2 + 1/4*(1 mS/V^2)*r'^4
  work 5 mA*cos(900 rad/s*t) on p
  init p' = 1 V
  init r' = 0 V
}
scene s of narrow {
  time 0 s to 20 ms
  trace p' as u, r' as w, (p - r)/(20 mH) as i
}
"""


def rectified(t, v):
    forward = (10 * np.sin(100 * np.pi * t) - v) / 0.025852
    return (1e-14 * np.expm1(np.minimum(forward, 300)) - v / 1e3) / 100e-6


def clipped(t, v):
    return ((5 * np.sin(2e3 * np.pi * t) - v) / 2200 - 2 * 2.52e-9 * np.sinh(v / 0.0453)) / 10e-9


@pytest.mark.parametrize(
    ("text", "rate", "method", "rtol", "within"),
    [
        (RECTIFIER, rectified, "bdf", 0.1, 0.1),  # 3.9 times off: the diode stood 18 V forward
        (CLIPPER, clipped, "bdf", 0.1, 0.3),  # a fault 48 times off
        (CLIPPER, clipped, "rosenbrock", 0.02, 0.1),  # a step over a half period: 1.7 times off
    ],
)
@pytest.mark.long
def test_rows_beside_diodes_are_some_tolerances_off(tmp_path, text, rate, method, rtol, within):
    path = tmp_path / "m.sd"
    path.write_text(text)
    trace = simulate(path, method=method, rtol=rtol, output=tmp_path / "t.h5")
    found = solve_ivp(
        rate, (0.0, trace.time[-1]), [0.0], "Radau", trace.time, rtol=1e-8, atol=1e-10, max_step=trace.time[-1] / 500
    )
    off = np.abs(trace["v"].values - found.y[0]).max() / np.abs(found.y[0]).max()
    assert off < within


@pytest.mark.parametrize("rtol", [0.03, 0.01, 1e-3])
@pytest.mark.long
def test_a_relaxation_returns_to_its_limit_cycle(tmp_path, rtol):
    """Slopes taken within the jump made what was left behind it look small: x went on to 3.7, 6.8, 3.7, told as done.
    The amplitude is 2 + 0.78 mu^(-4/3) (J. Cole, Perturbation Methods in Applied Mathematics, 1968).
    """
    path = tmp_path / "m.sd"
    path.write_text(RELAXATION)
    trace = simulate(path, method="bdf", rtol=rtol, output=tmp_path / "t.h5")
    amplitude = np.abs(trace["x"].values).max()
    assert abs(amplitude - 2.0) < 2.0 * rtol


def test_rows_of_an_explicit_step_at_the_edge_of_stability_stay_between_its_ends(tmp_path):
    """Between ends that the error test had passed further stages lay 16 V too high: rows of 1e189 A, told as done."""
    path = Path(models.__file__).parent / "seed" / "rectifier_motor_crank.sd"
    loose, fine = (
        simulate(path, method=method, rtol=rtol, scene="reference", output=tmp_path / "t.h5")
        for method, rtol in (("dopri", 1e-3), ("radau", 1e-8))
    )
    v, true = (trace["v_C"].values for trace in (loose, fine))
    assert np.abs(v - np.interp(loose.time, fine.time, true)).max() < 0.1 * np.abs(true).max()
    assert np.abs(loose["i1"].values).max() < 4.0 * np.abs(fine["i1"].values).max()


def _narrow(t, y):
    u, w, i = y
    stored = 3e-6 * w**2 + 2e-6  # F
    return [(5e-3 * np.cos(900 * t) - i - 0.01 * u) / 1e-5, (i - 1e-3 * w**3) / stored, (u - w) / 0.02]


@pytest.mark.long
def test_rows_of_an_explicit_step_through_a_narrow_minimum_of_a_capacity_are_those_of_the_motion(tmp_path):
    """A step that is fast for a moment was taken for one at the edge of stability: its rows were those of a cubic
    between the ends, 2 % off beside ends that are within 1e-6, told as met at 1e-3.
    """
    path = tmp_path / "m.sd"
    path.write_text(NARROW)
    at = np.linspace(0.0, 0.02, 33)[1:]
    for options, within in (({"rtol": 1.3e-7, "method": "dopri"}, 1e-5), ({"accuracy": 1e-3}, 1e-3)):
        trace = simulate(path, at=list(at), output=tmp_path / "t.h5", **options)
        found = solve_ivp(_narrow, (0.0, 0.02), [1.0, 0.0, 0.0], "DOP853", trace.time, rtol=1e-11, atol=1e-13)
        for name, true in zip("uwi", found.y, strict=True):
            assert np.abs(trace[name].values - true).max() < within * np.abs(true).max()


BESIDE = """model beside {
  coord x: translation = 1 m
  node a, b: electrical
  energy T* = 1/2*(1 kg)*x'^2
  energy V = (40 N/m^3)*x^4
  L: kinetic(p = 1 mH*f) a -> b
  R: dissipator(e = 1 ohm*f) b -> a
  init L.f = 1 A
  init x' = 0 m/s
}
scene s of beside {
  time 0 s to 3 s
  trace x, L.f as i
}
"""


@pytest.mark.long
def test_rows_of_a_motion_beside_what_an_explicit_step_holds_at_the_edge_are_its_own(tmp_path):
    """Further stages of a current of 1e-10 A that noise moves made a cubic of the rows of everything beside it: 3e-5
    off beside ends that are within 1e-11, at twice the steps.
    """
    path = tmp_path / "m.sd"
    path.write_text(BESIDE)
    trace = simulate(
        path, method="dopri", accuracy=1e-5, at=list(np.linspace(0.0, 3.0, 101)[1:]), output=tmp_path / "t.h5"
    )
    found = solve_ivp(
        lambda _, y: [y[1], -160 * y[0] ** 3], (0.0, 3.0), [1.0, 0.0], "DOP853", trace.time, rtol=1e-12, atol=1e-13
    )
    assert np.abs(trace["x"].values - found.y[0]).max() < 1e-6
    assert trace.statistics["steps"] < 1200


IMPLICIT = """model implicit {
  node a, b, c: electrical
  V: effort(e = 12 V*sin(300 rad/s*t + 0.5)) a -> ground
  R: dissipator(e = 2 ohm*f) a -> b
  L: kinetic(f = p/(20 mH) + 5e4 A/Wb^3*p^3) b -> c
  C: potential(q = 40 uF*e*(1 + 0.3*tanh(e/(5 V))^2)) c -> ground
  G: dissipator(f = 10 mA*sinh(e/(4 V))) c -> ground
  init L.p = 0 Wb
  init C.e = 1 V
}
scene s of implicit {
  time 0 s to 50 ms
  trace L.p as p, C.e as v
}
"""


def test_rows_within_a_step_begin_at_the_nearest_stage(tmp_path):
    """Unknowns of further stages near the beginning of a step were sought from its end: where that failed (an implicit
    law) rows were those of a cubic, 1e-6 off where 1e-8 was asked, told as met.
    """

    def rates(t, y):
        p, v = y
        current, slope = p / 0.02 + 5e4 * p**3, np.tanh(v / 5)
        capacity = 40e-6 * (1 + 0.3 * slope**2 + 0.6 * v / 5 * slope / np.cosh(v / 5) ** 2)
        return [12 * np.sin(300 * t + 0.5) - 2 * current - v, (current - 0.01 * np.sinh(v / 4)) / capacity]

    path = tmp_path / "m.sd"
    path.write_text(IMPLICIT)
    trace = simulate(
        path, method="dopri", formulation="lagrangian", accuracy=1e-8, at=list(np.linspace(0.0, 0.05, 33)[1:]),
        output=tmp_path / "t.h5",
    )  # fmt: skip
    found = solve_ivp(rates, (0.0, 0.05), [0.0, 1.0], "DOP853", trace.time, rtol=1e-12, atol=1e-14)
    for name, true in zip(("p", "v"), found.y, strict=True):
        assert np.abs(trace[name].values - true).max() < 5e-8 * np.abs(true).max()


FALLS = """model falls {
  state x = 0.5
  state z = 0.1
  dynamic x' = (x*(1 - x) - 0.891*z*(x - 2.4e-5)/(x + 2.4e-5))/(14.3 ms)
  dynamic z' = (x - z)/(1 s)
}
scene s of falls {
  time 0 s to 7.38 s
  trace x every 20 ms
}
"""


@pytest.mark.parametrize("accuracy", [1e-1, 1e-2])
@pytest.mark.one_in(2)
def test_what_falls_beside_a_pole_is_met_loosely_too(accuracy, tmp_path):
    """An Oregonator, whose x falls from 0.85 to 2.4e-5 beside its pole at -2.4e-5: every loose draft stepped over it,
    all methods were refused (22 of 56 such runs), though at 1e-4 and finer it is met.
    """
    (tmp_path / "falls.sd").write_text(FALLS, encoding="utf-8")
    run = simulate(tmp_path / "falls.sd", accuracy=accuracy, output=tmp_path / "t.h5")
    known = solve_ivp(
        lambda t, y: [(y[0] * (1 - y[0]) - 0.891 * y[1] * (y[0] - 2.4e-5) / (y[0] + 2.4e-5)) / 14.3e-3, y[0] - y[1]],
        (0.0, 7.38), [0.5, 0.1], method="LSODA", t_eval=np.asarray(run.time), rtol=1e-9, atol=1e-14,
    ).y[0]  # fmt: skip
    assert run.met
    assert np.abs(np.asarray(run["x"]) - known).max() < accuracy * known.max()
