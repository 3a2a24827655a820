"""Samples at instants at which something else happens: the text jumps, or another sampler is due by another formula."""

import numpy as np
import pytest
from sysdyn.api import simulate

STEP = """
model m {{
  let r = if t {relation} {at} s then 1 else 0
  state x = 0
  dynamic x' = held/(1 s)
  discrete held = 0
  every 0.05 s {{ held := r + x }}
}}
scene s of m {{ time 0 s to 5 s; trace held every 0.05 s }}
"""
TWO = """
model m {
  state x = 0
  dynamic x' = b/(1 s)
  discrete a = 0
  discrete b = 0
  every 0.03 s { a := a + 1 }
  every 0.13 s { b := a }
}
scene s of m { time 0 s to 4 s; trace a, b every 0.13 s }
"""


def run(text, tmp_path):
    file = tmp_path / "m.sd"
    file.write_text(text)
    return simulate(file, output=tmp_path / "m.h5")


@pytest.mark.parametrize("relation", [">", ">="])
@pytest.mark.parametrize("number", [3, 4, 6, 61, 73])
@pytest.mark.long
def test_a_sample_where_the_text_jumps_reads_what_is_behind(relation, number, tmp_path):
    """0.05*3 is not 0.15 of a double: no row is lost, and the instant stands twice."""
    trace = run(STEP.format(relation=relation, at=f"{0.05 * number:.2f}"), tmp_path)
    stored = [np.abs(trace.time - 0.05 * k).min() for k in range(101)]
    assert max(stored) < 1e-12
    at = np.abs(trace.time - 0.05 * number) < 1e-12
    assert trace["held"].values[at].tolist() == [0.0, 1.0]


@pytest.mark.long
def test_samplers_that_meet_read_what_was_before(tmp_path):
    """15*0.13 and 65*0.03 are two doubles and one instant."""
    trace = run(TWO, tmp_path)
    b = {round(float(t) / 0.13): v for t, v in zip(trace.time, trace["b"].values, strict=True)}
    exact = [13 * k // 3 + (k % 3 > 0) for k in range(31)]  # samples of a before 0.13 k
    assert [b[k] for k in range(31)] == exact


RELAY = """
model relay {{
  param k = {k} N/m
  coord x: translation = 1 m
  discrete g = 1
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*k*x^2
  work -0.3 N*g on x
  init x' = 0 m/s
  every {period} s {{ g := if x > 0 m then 1 else 0 }}
}}
scene s of relay {{ time 0 s to 2 s; trace x; solver {method} }}
"""


def relay(k, period, time):
    """x of the oscillator between samples, its rest moved by the relay: exact but for round-off."""
    omega, x, v, g, found = np.sqrt(k), 1.0, 0.0, 1.0, np.full(time.size, np.nan)
    for n in range(round(2.0 / period)):
        rest = -0.3 * g / k
        here = (time > (n - 1e-9) * period) & (time < (n + 1 + 1e-9) * period)
        tau = omega * (time[here] - n * period)
        found[here] = rest + (x - rest) * np.cos(tau) + v / omega * np.sin(tau)
        c, s = np.cos(omega * period), np.sin(omega * period)
        x, v = rest + (x - rest) * c + v / omega * s, -(x - rest) * omega * s + v * c
        g = float(x > 0.0)
    return found


@pytest.mark.parametrize(
    ("k", "period", "method"), [(4.0, 0.02, "radau"), (4.0, 0.1, "radau"), (1000.0, 0.1, "energy")]
)
@pytest.mark.long
def test_runs_between_samples_are_compared_at_them(k, period, method, tmp_path):
    """Both runs had their steps end at samples, and nothing was compared: 0, where x is off by 7e-12 to 2e-8."""
    trace = run(RELAY.format(k=k, period=period, method=method), tmp_path)
    error = np.max(np.abs(trace["x"].values - relay(k, period, trace.time)))
    estimate = trace.statistics["error_estimate"]
    assert 1e-12 < error < 1e-7
    assert 0.1 * error < estimate < 1e4 * error
