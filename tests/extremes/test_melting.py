"""A slab that melts: a heat capacity two hundred times as large within half a kelvin, in all formulations."""

import numpy as np
import pytest
from running import ran
from scipy.integrate import solve_ivp

N = 20
MODEL = f"""model slab {{
  param n = {N}
  node a[1..n], w: heat
  W: effort(e = 320 K) w -> ground
  K0: dissipator(f = 4 W/K*e) w -> a[1]
  for i in 1..n {{
    C[i]: potential(q = 50 J/K*e + 5000 J*(1 + tanh((e - 300 K)/(0.5 K)))) a[i] -> ground
    init C[i].e = 290 K
  }}
  for i in 2..n {{ K[i]: dissipator(f = 2 W/K*e) a[i-1] -> a[i] }}
}}
scene s of slab {{ time 0 s to 1000 s; trace a[1].e as first, a[10].e as middle }}
"""


def truth(times):
    """first, middle (K) at times (s)."""

    def rates(_, e):
        capacity = 50.0 + 1e4 / np.cosh(np.clip((e - 300.0) / 0.5, -300.0, 300.0)) ** 2
        through = np.concatenate([[4.0 * (320.0 - e[0])], 2.0 * (e[:-1] - e[1:]), [0.0]])
        return (through[:-1] - through[1:]) / capacity

    found = solve_ivp(rates, (0.0, 1000.0), np.full(N, 290.0), "LSODA", rtol=1e-10, atol=1e-8, dense_output=True)
    return found.sol(times)[[0, 9]]


@pytest.mark.parametrize("formulation", ["lagrangian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.one_in(2)
def test_a_front_of_melting_is_followed_in_steps_of_its_own(formulation, tmp_path):
    """Rosenbrock took what each correction passes over for a law that jumps: 1e7 steps in the complementary forms."""
    found = ran(tmp_path, MODEL, formulation=formulation, accuracy=1e-4)
    assert not found.refused
    assert found.met
    assert found.trace.statistics["steps"] < 500
    exact = truth(np.asarray(found.trace.time))
    off = max(np.abs(np.asarray(found.trace[name]) - exact[k]).max() for k, name in enumerate(("first", "middle")))
    assert off < 1.5 * max(found.trace.statistics["error_estimate"], 1e-6) * 320.0
