"""Contents that are round-off beside their like, and count: heat of 1e-9 J/K beside 1e6 J/K."""

import numpy as np
import pytest
from running import ran
from scipy.integrate import solve_ivp

HEAT = """
model m {
  node a, b, c: heat
  A: potential(e = q/(1e-9 J/K)) a -> ground
  B: potential(e = q/(1e6 J/K)) b -> ground
  C: potential(e = q/(50 J/K)) c -> ground
  bc: dissipator(f = 100 W/K*e) b -> c
  ab: dissipator(f = 1e-6 W/K*e) a -> b
  glow: flow(f = 1e-14 W/K^4*(a.e^4 - c.e^4)) a -> c
  laser: flow(f = 1e-3 W) ground -> a
  init A.q = 3.5e-7 J
  init B.q = 3e8 J
  init C.q = 25 kJ
}
scene s of m {
  time 0 s to 5 ms
  trace a.e as a, b.e as b every 0.1 ms
}
"""


@pytest.mark.parametrize("formulation", ["co_lagrangian", "co_hamiltonian"])
def test_a_fixed_content_is_what_the_text_says(formulation, tmp_path):
    """350 K beside 300 K, which stays, and 500 K, which cool."""
    found, t = ran(tmp_path, HEAT, formulation=formulation, accuracy=1e-6), np.linspace(0.0, 5e-3, 51)
    heat = solve_ivp(
        lambda t, a: (1e-3 - 1e-6 * (a - 300.0) - 1e-14 * (a**4 - (300.0 + 200.0 * np.exp(-2.0 * t)) ** 4)) / 1e-9,
        (0.0, 5e-3),
        [350.0],
        t_eval=t,
        rtol=1e-11,
        atol=1e-9,
        method="Radau",
    )
    assert found.met
    assert np.abs(found.at("a", t) - heat.y[0]).max() < heat.y[0].max() * 2e-6
    assert np.abs(found.at("b", t) - 300.0).max() < 2e-4
