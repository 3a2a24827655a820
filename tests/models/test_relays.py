"""Relays: what changes with the sign of a position, a temperature, a speed far away."""

import numpy as np
import pytest
from set_valued import PRIMAL, codes, run


def relay(law, begin="init x' = 0 m/s", end="10 s"):
    return f"""\
model relay {{
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  implicit F: N ~ 0 N
  work F on x
  gamma g: F = {law}
  {begin}
}}
scene s of relay {{ time 0 s to {end}; trace x, F every 0.1 s }}
"""


@PRIMAL
@pytest.mark.one_in(2)
def test_a_relay_of_a_position_lets_it_through(tmp_path, formulation):
    """Parabolas of a period of 4 s: the position cannot be held."""
    trace = run(tmp_path, relay("-(2 N)*setsign(x)"), formulation)
    t = np.mod(trace.time, 4.0)
    expected = np.select([t < 1, t < 3], [1 - t**2, -1 + (t - 2) ** 2], 1 - (4 - t) ** 2)
    assert np.abs(trace["x"].values - expected).max() < 1e-6


@pytest.mark.long
def test_a_relay_of_what_it_gives_follows_what_is_asked(tmp_path):
    """F in 2 N setsign(w - F) is w within 2 N: no state is on the way."""
    trace = run(tmp_path, relay("2 N*setsign(3 N*cos(2 rad/s*t) - F)", end="5 s"))
    assert np.abs(trace["F"].values - np.clip(3 * np.cos(2 * trace.time), -2.0, 2.0)).max() < 1e-6


def test_a_thermostat_holds_its_temperature(tmp_path):
    text = """\
model oven {
  state T: K = 280 K
  implicit P: W ~ 0 W
  dynamic T' = (P - 10 W/K*(T - 270 K))/(100 J/K)
  gamma relay: P = 250 W + 200 W*setsign(290 K - T)
}
scene s of oven { time 0 s to 60 s; trace T, P every 1 s }
"""
    trace = run(tmp_path, text)
    instant = 10.0 * np.log(35.0 / 25.0)
    expected = np.where(trace.time < instant, 315.0 - 35.0 * np.exp(-trace.time / 10.0), 290.0)
    assert np.abs(trace["T"].values - expected).max() < 1e-6
    assert np.abs(trace["P"].values[trace.time > instant + 0.1] - 200.0).max() < 1e-6


@PRIMAL
@pytest.mark.parametrize("speed", ["0.3 m/s", "0 m/s"])
@pytest.mark.long
def test_a_relay_of_a_far_speed_is_a_sign(tmp_path, formulation, speed):
    """The force acts on the neighbour of what it reads: that goes through zero at once."""
    text = f"""\
model far {{
  coord x: translation = 0 m
  coord y: translation = 0.1 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = 1/2*(40 N/m)*(x - y)^2 + 1/2*(20 N/m)*y^2
  implicit F: N ~ 0 N
  work F on x
  gamma g: F + 1 N*setsign(y') = 0 N
  init x' = 0 m/s
  init y' = {speed}
}}
scene s of far {{ time 0 s to 5 s; trace x, y every 0.1 s }}
"""
    one, other = (run(tmp_path, said, formulation, 1e-8) for said in (text, text.replace("setsign", "sign")))
    at = np.linspace(0.0, 5.0, 51)
    values = [np.interp(at, trace.time, trace["x"].values) for trace in (one, other)]
    assert np.abs(values[0] - values[1]).max() < 1e-9


@pytest.mark.parametrize("law", [
    "gamma g: F = -(3 N)*sin(setsign(x'))",
    "gamma g: F = -(3 N)*setsign(x')^2",
    "gamma g: F = -(3 N)*setsign(x' + 1 m/s*setsign(x'))",
    "gamma g: F = -(3 N)*sum(i in 1..2: setsign(x' - i*1 m/s))",
    "gamma g: F = 0 N; work -(3 N)*setsign(x') on x",
    "gamma g: F = 0 N; energy V = 3 N*x*setsign(x)",
    "gamma g: F = 0 N; K: kinetic(p = 3 N.s*setsign(f)) on x",
])  # fmt: skip
def test_what_no_relation_can_say_is_refused(law):
    text = relay("0 N").replace("gamma g: F = 0 N", law)
    assert codes(text) == [("E705", "error")]
