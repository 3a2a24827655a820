"""Laws with a root at zero, where the slope is infinite: orifices from rest, and until they run dry; closed forms."""

import numpy as np
import pytest
from model_runs import FOUR, trace_of
from scipy.integrate import solve_ivp
from sysdyn.cli.main import run as main

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
@pytest.mark.long
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
@pytest.mark.long
def test_a_tank_fills_from_nothing(tmp_path, method):
    """With u = sqrt(h), c = 0.3, k = 0.2: t = -2/k (u + c/k ln(1 - k u/c)); the first slope is infinite."""
    trace = trace_of(tmp_path, FILL, method=method)
    root = np.sqrt(trace["h"].values)
    after = -2.0 / 0.2 * (root + 1.5 * np.log1p(-root / 1.5))
    rate = 0.3 - 0.2 * root
    assert np.abs((after - np.array(trace.time)) * rate)[1:].max() < 3e-6  # of 2.25 m


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.long
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
@pytest.mark.long
def test_two_vessels_in_every_formulation(tmp_path, formulation):
    """d' = -20 sqrt(d): the root of 1e5 Pa falls with 10 a second."""
    trace = trace_of(tmp_path, VESSELS, formulation=formulation)
    apart = np.maximum(np.sqrt(1e5) - 10.0 * np.array(trace.time), 0.0) ** 2
    assert np.abs(trace["A.e"].values - (5e4 + 0.5 * apart)).max() < 2e-5 * 1e5


TURNS = """model vessels {
  node a, b: hydraulic
  A: potential(e = 1 Pa/m^3*q) a -> ground
  B: potential(e = 1 Pa/m^3*q) b -> ground
  V: dissipator(e = 2 Pa.s^2/m^6*f*abs(f)) a -> b
  Q: flow(f = 1 m^3/s*sin(2 rad/s*t)) ground -> a
  init A.e = 1 Pa
  init B.e = 0 Pa
}
scene run of vessels { time 0 s to 20 s; trace A.e, B.e every 0.1 s }
"""


@pytest.mark.parametrize("method", ["auto", "bdf", "radau", "dopri", "rosenbrock"])
@pytest.mark.long
def test_a_flow_that_turns_through_a_square(tmp_path, method):
    """Against the law turned over, f = sqrt(d/k), by SciPy; where the flow turns the pressure has no slope."""
    trace = trace_of(tmp_path, TURNS, method=method)

    def rate(t, p):
        f = np.sign(p[0] - p[1]) * np.sqrt(abs(p[0] - p[1]) / 2.0)
        return [np.sin(2.0 * t) - f, f]

    time = np.array(trace.time)
    exact = solve_ivp(rate, (0.0, 20.0), [1.0, 0.0], "DOP853", t_eval=time, rtol=1e-11, atol=1e-12, max_step=0.01).y
    assert np.abs(trace["A.e"].values - exact[0]).max() < 1e-4
    assert np.abs(trace["B.e"].values - exact[1]).max() < 1e-4


def test_rosenbrock_is_refused_there_with_the_reason(tmp_path, capsys):
    """At the first turn, of 1.92 s, and at once, where not even from a settled point a step goes on."""
    file = tmp_path / "turns.sd"
    file.write_text(TURNS)
    asked = ["simulate", str(file), "--method", "rosenbrock", "--accuracy", "1e-6", "-o", str(tmp_path / "t.h5")]
    assert main(asked) == 3
    said = capsys.readouterr().err
    assert "E930" in said
    assert "slopes where a step begins" in said
    assert "help: --method radau, bdf or auto" in said
