"""Limiters, `gamma` relations that bound a current: what they pass in circuits, against closed forms."""

import numpy as np
import pytest
from set_valued import ALL, run

LIMITER = """\
model charge {
  param G = 0 S
  node a, b, k: electrical
  V: effort(e = 10 V) a -> ground
  L: dissipator(f = LAW) a -> b
  R: dissipator(e = 1 kohm*f) b -> k
  C: potential(e = q/(1 uF)) k -> ground
  init C.e = 0 V
}
scene s of charge {
  time 0 s to 20 ms
  trace C.e, L.e, L.f every 0.5 ms
}
"""


@ALL
@pytest.mark.parametrize("leak", [0.0, 1e-4])
@pytest.mark.parametrize("method", ["bdf", "radau", "rosenbrock", "auto"])
@pytest.mark.long
def test_a_capacitor_is_charged_by_a_limited_current(tmp_path, formulation, leak, method):
    """At 1 mA + G e until nothing is left over the limiter, then by R C."""
    law = "1 mA*setsign(e)" + (" + 0.1 mS*e" if leak else "")
    trace = run(tmp_path, LIMITER.replace("LAW", law), formulation, method=method)
    rate, end = leak / (1e-6 * (1.0 + leak * 1e3)), 10.0 + (1e-3 / leak if leak else 0.0)
    instant = -np.log1p(-9.0 / end) / rate if leak else 9e-3
    t = trace.time
    limited = -end * np.expm1(-rate * t) if leak else 1e3 * t
    expected = np.where(t < instant, limited, 10.0 - np.exp(-np.maximum(t - instant, 0.0) / 1e-3))
    assert np.abs(trace["C.e"].values - expected).max() < 1e-5
    assert [e.time for e in trace.events] == pytest.approx([instant], abs=1e-8)


@ALL
@pytest.mark.one_in(2)
def test_a_limiter_stops_an_inductor_without_a_jump(tmp_path, formulation):
    """A current within its limit is held at it, and let go where the voltage turns: the same as a pair of one-way
    constraints says.
    """
    text = """\
component pair { branch: electrical; psi high: f <= 1 mA; psi low: f >= -1 mA }
model coil {
  node a, b, k: electrical
  V: effort(e = 3 V*cos(500 rad/s*t)) a -> ground
  L: ELEMENT a -> b
  I: kinetic(p = 1 H*f) b -> k
  R: dissipator(e = 1 kohm*f) k -> ground
  init I.f = 0 A
}
scene s of coil { time 0 s to 30 ms; trace I.f, L.e every 0.5 ms }
"""
    one = run(tmp_path, text.replace("ELEMENT", "dissipator(f = 1 mA*setsign(e))"), formulation, method="radau")
    other = run(tmp_path, text.replace("ELEMENT", "pair"), "lagrangian", method="radau")
    at = np.linspace(0.1e-3, 29.9e-3, 50)
    for name, size in (("I.f", 1e-3), ("L.e", 2.0)):
        values = [np.interp(at, trace.time, trace[name].values) for trace in (one, other)]
        assert np.abs(values[0] - values[1]).max() < 1e-5 * size, name


@ALL
@pytest.mark.long
def test_limiters_of_an_array_end_one_after_the_other(tmp_path, formulation):
    text = """\
model bank {
  param n = 3
  node a, b[1..n], k[1..n]: electrical
  V: effort(e = 10 V) a -> ground
  for i in 1..n {
    L[i]: dissipator(f = i*1 mA*setsign(e)) a -> b[i]
    R[i]: dissipator(e = 1 kohm*f) b[i] -> k[i]
    C[i]: potential(e = q/(1 uF)) k[i] -> ground
    init C[i].e = 0 V
  }
}
scene s of bank { time 0 s to 20 ms; trace C[1].e, C[2].e, C[3].e every 0.5 ms }
"""
    trace = run(tmp_path, text, formulation)
    for i in (1, 2, 3):
        instant = (10.0 - i) / i * 1e-3
        rest = 10.0 - i * np.exp(-np.maximum(trace.time - instant, 0.0) / 1e-3)
        expected = np.where(trace.time < instant, i * 1e3 * trace.time, rest)
        assert np.abs(trace[f"C[{i}].e"].values - expected).max() < 1e-5
