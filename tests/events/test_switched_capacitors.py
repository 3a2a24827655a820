"""Many ideal switches that turn at one instant: capacitors share their charges anew, in closed form."""

import numpy as np
import pytest
from sysdyn import api

CHAIN = """from std.electrical import capacitor, voltage, switch
component switched {
  port p, n: electrical
  node a, b: electrical
  let first = if mod(t, 100 ms) < 50 ms then 1 else 0
  C_: capacitor(C = 0.1 F) a -> b
  A1: switch(gate = 1 - first) p -> a
  A2: switch(gate = first) a -> ground
  B1: switch(gate = 1 - first) b -> n
  B2: switch(gate = first) b -> ground
}
model chain {
  node x[0..%d]: electrical
  V: voltage(v = 1 V) x[0] -> ground
%s
}
scene run of chain { time 0 s to %g s; trace %s every 50 ms }
"""
STAGE = """  S%d: switched() p = x[%d], n = x[%d]
  C%d: capacitor(C = 1 F) x[%d] -> ground
  init C%d.e = 0 V"""


def shared(stages, halves):
    """Potentials [halves + 1, stages] behind each half period: first all small capacitors are emptied, then each lies
    between two nodes, which share what they hold with it.
    """
    links = np.diff(np.eye(stages + 1), axis=0)
    net = 0.1 * links.T @ links
    net[1:, 1:] += np.eye(stages)
    x = np.zeros(stages)
    found = [x]
    for half in range(halves):
        if half % 2:
            x = np.linalg.solve(net[1:, 1:], x - net[1:, 0])
        found.append(x)
    return np.array(found)


@pytest.mark.parametrize("stages", [3, 11])
def test_charges_are_shared_as_often_as_switches_turn(tmp_path, stages):
    """44 switches and 20 instants: one decomposition of the pencil for each was 3 s of CPU an instant."""
    parts = "\n".join(STAGE % (k, k - 1, k, k, k, k) for k in range(1, stages + 1))
    traced = ", ".join(f"x[{k}].e" for k in range(1, stages + 1))
    (tmp_path / "m.sd").write_text(CHAIN % (stages, parts, 1.0, traced))
    trace = api.simulate(tmp_path / "m.sd", output=tmp_path / "out.h5")
    t = trace.time
    behind = [np.flatnonzero(np.abs(t - 0.05 * k) < 1e-9)[-1] for k in range(21)]
    found = np.array([trace[f"x[{k}].e"].values[behind] for k in range(1, stages + 1)]).T
    exact = shared(stages, 21)
    assert np.abs(found - exact[1:22]).max() < 1e-12
