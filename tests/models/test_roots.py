"""Laws with a root at zero, where the slope is infinite: orifices from rest, and until they run dry; closed forms."""

import numpy as np
import pytest
from model_runs import FOUR, trace_of

METHODS = ("auto", "bdf", "radau", "rosenbrock", "dopri")
DRAIN = """model drain {
  state h: m = 1 m
  dynamic h' = -0.05 m/s*sqrt(max(h, 0 m)/(1 m))
}
scene run of drain { time 0 s to 60 s; trace h every 1 s; accuracy 1e-5 }
"""
LEVEL = """model level {
  state a: m = 1 m
  state b: m = 0 m
  let d = a - b
  let q = 0.1 m/s*sign(d)*sqrt(abs(d)/(1 m))
  dynamic a' = -q
  dynamic b' = q
}
scene run of level { time 0 s to 20 s; trace a, b every 0.5 s; accuracy 1e-5 }
"""
FILL = """model fill {
  state h: m = 0 m
  dynamic h' = 0.3 m/s - 0.2 m/s*sqrt(h/(1 m))
}
scene run of fill { time 0 s to 50 s; trace h every 1 s; accuracy 1e-6 }
"""
SWING = """model swing {
  state h: m = 1 m
  let d = h - (1 m + 0.5 m*t/(1 s))
  dynamic h' = -2 m/s*sign(d)*sqrt(abs(d)/(1 m))
}
scene run of swing { time 0 s to 4 s; trace h every 0.1 s; accuracy 1e-6 }
"""
VESSELS = """model vessels {
  node a, b: hydraulic
  A: potential(e = 1e5 Pa/m^3*q) a -> ground
  B: potential(e = 1e5 Pa/m^3*q) b -> ground
  O: dissipator(f = 1e-4 m^3/s*sign(e)*sqrt(abs(e)/(1 Pa))) a -> b
  init A.e = 1e5 Pa
  init B.e = 0 Pa
}
scene run of vessels { time 0 s to 60 s; trace A.e every 1 s; accuracy 1e-5 }
"""


@pytest.mark.parametrize("method", METHODS)
def test_a_tank_runs_dry_and_stays_so(tmp_path, method):
    """Torricelli: sqrt(h) falls with 1/40 a second; below zero the law is flat, not infinity times zero."""
    trace = trace_of(tmp_path, DRAIN, method=method)
    exact = np.maximum(1.0 - np.array(trace.time) / 40.0, 0.0) ** 2
    assert np.abs(trace["h"].values - exact).max() < 2e-5


@pytest.mark.parametrize("method", METHODS[:-1])
def test_two_tanks_level(tmp_path, method):
    """The root of the difference falls with 1/10 a second, to zero after 10 s."""
    trace = trace_of(tmp_path, LEVEL, method=method)
    apart = np.maximum(1.0 - np.array(trace.time) / 10.0, 0.0) ** 2
    assert np.abs(trace["a"].values - (0.5 + 0.5 * apart)).max() < 2e-5
    assert np.abs(trace["b"].values - (0.5 - 0.5 * apart)).max() < 2e-5


@pytest.mark.parametrize("method", METHODS)
def test_a_tank_fills_from_nothing(tmp_path, method):
    """With u = sqrt(h), c = 0.3, k = 0.2: t = -2/k (u + c/k ln(1 - k u/c)); the first slope is infinite."""
    trace = trace_of(tmp_path, FILL, method=method)
    root = np.sqrt(trace["h"].values)
    after = -2.0 / 0.2 * (root + 1.5 * np.log1p(-root / 1.5))
    rate = 0.3 - 0.2 * root
    assert np.abs((after - np.array(trace.time)) * rate)[1:].max() < 3e-6  # of 2.25 m


@pytest.mark.parametrize("method", METHODS)
def test_an_orifice_between_equal_levels(tmp_path, method):
    """Its slope at the start is infinite: d = h - 1 - t/2, d' = -1/2 + 2 sqrt(-d) ends at d = -1/16."""
    trace = trace_of(tmp_path, SWING, method=method)
    t = np.array(trace.time)
    root = np.sqrt(np.maximum(1.0 + 0.5 * t - trace["h"].values, 0.0))
    later = t > 0.0
    after = -(root + 0.25 * np.log1p(-np.minimum(root / 0.25, 1.0 - 1e-16)))  # -d = u^2, 2 u u' = 1/2 - 2 u
    settled = root > 0.2499
    assert np.abs((after - t) * (0.5 - 2.0 * root))[later & ~settled].max() < 6e-6  # of 3 m
    assert np.abs(root[t > 3.0] - 0.25).max() < 1e-5


@pytest.mark.parametrize("formulation", FOUR)
def test_two_vessels_in_every_formulation(tmp_path, formulation):
    """d' = -20 sqrt(d): the root of 1e5 Pa falls with 10 a second."""
    trace = trace_of(tmp_path, VESSELS, formulation=formulation)
    apart = np.maximum(np.sqrt(1e5) - 10.0 * np.array(trace.time), 0.0) ** 2
    assert np.abs(trace["A.e"].values - (5e4 + 0.5 * apart)).max() < 2e-5 * 1e5
