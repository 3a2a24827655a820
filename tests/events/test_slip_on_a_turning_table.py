"""A block on a table that turns faster and faster sticks, then slips: from rest beside flows that are large.

Behind its slip the speed is for a while less than what steps leave open of the flows whose difference it is.  Values:
SciPy's Radau at 1e-12 in the sliding motion, from where W^2 r and the Euler force pass 5 N.
"""

import pytest
from sysdyn import api

TABLE = """
model table {
  param W1 = 2 rad/s^2
  coord x: translation = 0.5 m
  coord y: translation = 0 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  content D = 5 N*hypot(x' + W1*t*y, y' - W1*t*x)
  init x' = 0 m/s
  init y' = 0 m/s
}
scene s of table {
  time 0 s to 2 s
  trace x, y
}
"""
X, Y = -0.4144107662770, -0.4140171010183
"""m, at 2 s."""
SLIPS = 1.5650845800732873
"""s."""


@pytest.mark.parametrize("accuracy", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("method", ["auto", "bdf", "radau", "rosenbrock"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_it_slips_once(formulation, method, accuracy, tmp_path):
    (tmp_path / "table.sd").write_text(TABLE)
    model = api.load(tmp_path / "table.sd", formulation=formulation)
    trace = model.run(method=method, accuracy=accuracy)
    assert abs(trace["x"][-1] - X) < accuracy * abs(X)
    assert abs(trace["y"][-1] - Y) < accuracy * abs(Y)
    assert [(e.before, e.after) for e in trace.events] == [("sticks", "slips")]
    assert abs(trace.events[0].time - SLIPS) < accuracy
