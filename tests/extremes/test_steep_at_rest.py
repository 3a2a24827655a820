"""A store of a steep law at rest: its constant and `tanh` cancel but for round-off, which is no size of anything."""

import pytest
from running import ran

MODEL = """model m {
  node a: electrical
  C: potential(q = 0.0101 C*e/(0.864 V) + 0.101 C*tanh((e + 0.183 V)/(0.247 V)) - 0.06359798226084425 C) a -> ground
  Z: dissipator(e = 1.11 ohm*f) a -> ground
  I: flow(f = 2.07 A*sin(4.58 rad/s*t)) ground -> a
  init C.q = 0 C
}
scene s of m { time 0 s to 2.7 s; trace C.e as v }
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "co_lagrangian"])
@pytest.mark.long
def test_round_off_of_a_law_is_no_magnitude(formulation, tmp_path):
    """E519 before: the residual cannot fall below 1.39e-17."""
    found = ran(tmp_path, MODEL, formulation=formulation, accuracy=1e-4)
    assert not found.refused
    assert found.met
    assert abs(found.trace["v"].values[0]) < 1e-15
