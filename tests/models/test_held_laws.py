"""Laws whose branches end in a root: a step that crosses their corner does not evaluate them beyond it."""

import numpy as np
import pytest
from model_runs import trace_of
from scipy.integrate import solve_ivp

VALVE = """model held_branch {
  state p: 1 = %g
  let law = if p <= 2 then sqrt(max(1 - (p/2)^2, 1e-12)) else -sqrt(max(1 - (2/p)^2, 1e-12))
  dynamic p' = (law - %g*sin(t/(1 s)))/(1 s)
}
scene s of held_branch {
  time 0 s to 12 s
  trace p
  accuracy %g
}
"""


def valve(begin, drive):
    """The same by SciPy, in pieces of its own step control."""

    def rate(t, p):
        law = np.sqrt(max(1 - (p / 2) ** 2, 1e-12)) if p <= 2 else -np.sqrt(max(1 - (2 / p) ** 2, 1e-12))
        return law - drive * np.sin(t)

    return solve_ivp(
        lambda t, y: [rate(t, y[0])],
        (0, 12),
        [begin],
        "LSODA",
        rtol=1e-11,
        atol=1e-13,
        dense_output=True,
        max_step=0.01,
    ).sol


@pytest.mark.parametrize("method", ["auto", "bdf", "radau", "rosenbrock", "dopri"])
@pytest.mark.parametrize(("begin", "drive"), [(2.0, 0.1), (1.0, 0.3), (3.0, 0.7)])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-5])
@pytest.mark.long
def test_a_valve_that_turns_through_its_root(tmp_path, begin, drive, method, accuracy):
    trace = trace_of(tmp_path, VALVE % (begin, drive, accuracy), method=method)
    right = valve(begin, drive)(trace.time)[0]
    assert np.abs(trace["p"].values - right).max() < 3 * accuracy * right.max()
