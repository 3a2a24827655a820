"""Powers of abs(f) in a content: smooth where the slope vanishes at rest, set-valued where it does not."""

import math

import pytest
from model_runs import trace_of

TEXT = """
model m {{
  param c = 2 N.s^2/m^2
  param N0 = {coulomb} N
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  content D = {content}
  init x' = {speed} m/s
}}
scene s of m {{
  time 0 s to 1 s
  trace x, x' as v
  accuracy 1e-8
}}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("content", ["1/3*c*abs(x')^3", "1/3*c*x'^2*abs(x')", "1/3*c*hypot(x', 0 m/s)^3"])
@pytest.mark.parametrize("speed", [1.0, -1.5])
@pytest.mark.one_in(6)
def test_quadratic_drag_is_smooth(tmp_path, formulation, content, speed):
    trace = trace_of(tmp_path, TEXT.format(coulomb=0, content=content, speed=speed), scene="s", formulation=formulation)
    known = speed / (1.0 + 2.0 * abs(speed))
    assert abs(trace["v"][-1] - known) < 3e-8 * abs(speed)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_drag_and_dry_friction_come_to_rest(tmp_path, formulation):
    """v' = -(1 + 2 v^2): at rest from t = atan(sqrt 2)/sqrt 2 on, after ln(3)/4 m."""
    text = TEXT.format(coulomb=1, content="N0*abs(x') + 1/3*c*abs(x')^3", speed=1)
    trace = trace_of(tmp_path, text, scene="s", formulation=formulation)
    assert math.atan(math.sqrt(2.0)) / math.sqrt(2.0) < 1.0
    assert abs(trace["v"][-1]) < 1e-12
    assert abs(trace["x"][-1] - math.log(3.0) / 4.0) < 3e-8
