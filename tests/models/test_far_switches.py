"""Smooth switches 1/(1 + exp(v)) far from where they switch: exp(v) is beyond 1e308 there, the law is zero."""

import pytest
from model_runs import trace_of

WALL = """model wall {{
  param F = 10 N
  param a = 1
  coord x: translation = 2 m
  energy T* = 1/2*(1 kg)*x'^2
  work {law} on x
  init x' = -1 m/s
}}
scene back of wall {{ time 0 s to 3.9 s; trace x, x' as v; accuracy 1e-7; method; expect always: x >= -0.11 m }}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("law", ["F/(1 + exp(x/(1 mm)))", "F*a/(a + 2*a*exp(x/(1 mm)))", "F - F/(1 + exp(-x/(1 mm)))"])
@pytest.mark.one_in(12)
def test_a_soft_wall_throws_back(tmp_path, formulation, law):
    """It begins 2000 widths away; its law has a potential, so the speed comes back.  It was E903: no numbers."""
    trace = trace_of(tmp_path, WALL.format(law=law).replace("method", f"formulation {formulation}"))
    assert trace["v"][-1] == pytest.approx(1.0, abs=1e-6)
    assert trace["x"][-1] > 1.0
