"""Conditions that hold for a moment alone: events that no step passes over, however short the moment."""

import numpy as np
import pytest
from running import ran

FLIGHT = """
model m {
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  init x' = 1 m/s
  param a = 3.3333 m
  param w = 0.1 mm
  discrete n = 0
  discrete at = 0 s
  when %s { n := n + 1; at := t }
}
scene s of m { time 0 s to 9.5 s; trace x, n, at }
"""
MOMENTS = {  # how often, and the last instant
    "(x - a)*(x - a - w) < 0 m^2": (1, 3.3333),
    "1/(1 + ((x - a)/w)^2) > 0.5": (1, 3.3332),
    "tanh((x - a)/w) - tanh((x - a)/w - 3) > 1": (1, 3.3333005),
    "1/(1 + exp((a - x)/w)) - 1/(1 + exp((a + 3*w - x)/w)) > 0.5": (1, None),
    "atan((x - a)/w) - atan((x - a)/w - 3) > 1.9": (1, None),
    "smoothstep((x - a)/w)*(1 - smoothstep((x - a)/w - 2)) > 0.5": (1, 3.33335),
    "clip((x - a)/w, 0, 1) - clip((x - a)/w - 1, 0, 1) > 0.5": (1, 3.33335),
    "(if x < a then 0 else if x < a + w then 1 else 0) > 0.5": (1, 3.3333),
    "(if x < a then x else 0 m) > a - w": (1, 3.3332),
    "step(x - a)*step(a + w - x) > 0.5": (1, 3.3333),
    "ln(abs(x - a)/(1 m)) < -9": (1, 3.3333 - np.exp(-9.0)),
    "sqrt(abs(x - a)/(1 m)) < 0.01": (1, 3.3332),
    "frac(x/(1 m)) > 0.9999": (9, 8.9999),
    "mod(x, 1 m) < w and x > 0.5 m": (9, 9.0),
    "ceil(x/(1 m)) - x/(1 m) > 0.9999": (10, 9.0),
    "sin(50*x/(1 m))^40 > 0.99": (151, None),
    "max(i in 1..3: w - abs(x - a - 0.5 m*i)) > 0 m": (3, 4.8332),
    "sum(i in 1..3: w^2/(w^2 + (x - a - 0.5 m*i)^2)) > 0.5": (3, 4.8332),
}


@pytest.mark.parametrize("condition", MOMENTS)
@pytest.mark.parametrize("options", [{"accuracy": 1e-2}, {"accuracy": 1e-5, "method": "dopri"}])
@pytest.mark.one_in(30)
def test_a_moment_is_not_passed_over(condition, options, tmp_path):
    """Of steps of 0.1 s and more none was long enough to be told: no event, or one of ten, told as met."""
    found = ran(tmp_path, FLIGHT % condition, **options)
    number, last = MOMENTS[condition]
    assert found.met
    assert found.trace["n"][-1] == number
    if last is not None:
        assert abs(found.trace["at"][-1] - last) < 1e-7 + 1e-3 * options["accuracy"]


HILLS = """
model m {
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 0.1 J*exp(-((x - 0.5 m)/(10 mm))^2) + 0.3 J*exp(-((x - 0.53 m)/(0.1 mm))^2)
  init x' = 1 m/s
  discrete n = 0
  when x > 0.45 m { n := 1 }
}
scene s of m { time 0 s to 2 s; trace x, x' as v }
"""


@pytest.mark.parametrize("method", ["radau", "dopri", "bdf"])
@pytest.mark.one_in(2)
def test_what_happens_within_a_hill_does_not_lengthen_its_steps(method, tmp_path):
    """Two peaks, one within the other's range, beside an event; v^2/2 + V stays."""
    found = ran(tmp_path, HILLS, accuracy=1e-6, method=method)
    x, v = np.asarray(found.trace["x"]), np.asarray(found.trace["v"])
    stored = 0.1 * np.exp(-(((x - 0.5) / 1e-2) ** 2)) + 0.3 * np.exp(-(((x - 0.53) / 1e-4) ** 2))
    assert found.met
    assert np.abs(v**2 / 2.0 + stored - 0.5).max() < 1e-5
    assert stored.max() > 0.25


TEETH = """
model m {
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  work (if %s then 30 N else 0 N) on x
  init x' = 1 m/s
}
scene s of m { time 0 s to 0.6 s; trace x, x' as v }
"""


@pytest.mark.parametrize("window", ["floor(x/(1 mm)) == 500", "mod(x + 0.5 m, 1 m) < 1 mm and x < 1 m"])
@pytest.mark.parametrize("options", [{"accuracy": 1e-3}, {"accuracy": 1e-6}, {"accuracy": 1e-6, "method": "dopri"}])
@pytest.mark.one_in(12)
def test_a_law_within_a_narrow_window_of_whole_numbers_acts(window, options, tmp_path):
    """30 N over 1 mm, by v^2/2.  It was passed over: no force, told as met, its energy balance zero."""
    found = ran(tmp_path, TEETH % window, **options)
    assert found.met
    assert abs(found.trace["v"][-1] - np.sqrt(1.0 + 2.0 * 0.03)) < options["accuracy"]
