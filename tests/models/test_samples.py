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
def test_a_sample_where_the_text_jumps_reads_what_is_behind(relation, number, tmp_path):
    """0.05*3 is not 0.15 of a double: no row is lost, and the instant stands twice."""
    trace = run(STEP.format(relation=relation, at=f"{0.05 * number:.2f}"), tmp_path)
    stored = [np.abs(trace.time - 0.05 * k).min() for k in range(101)]
    assert max(stored) < 1e-12
    at = np.abs(trace.time - 0.05 * number) < 1e-12
    assert trace["held"].values[at].tolist() == [0.0, 1.0]


def test_samplers_that_meet_read_what_was_before(tmp_path):
    """15*0.13 and 65*0.03 are two doubles and one instant."""
    trace = run(TWO, tmp_path)
    b = {round(float(t) / 0.13): v for t, v in zip(trace.time, trace["b"].values, strict=True)}
    exact = [13 * k // 3 + (k % 3 > 0) for k in range(31)]  # samples of a before 0.13 k
    assert [b[k] for k in range(31)] == exact
