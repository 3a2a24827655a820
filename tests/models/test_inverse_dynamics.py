"""Which effort makes a motion that is prescribed: right from the first row on, also where it acts through a gear."""

import numpy as np
import pytest
from sysdyn import api

OWN = """model m {
  coord b: translation ~ 0 m
  implicit F: N
  energy T* = 1/2*(38.889 kg)*b'^2
  energy V = 1/2*(1.0854 N/m)*b^2
  content D = 1/2*(8.6046 N.s/m)*b'^2
  work F on b
  gamma follow: b = 1 m*sin(2.2105 rad/s*t)
}
scene s of m { time 0 s to 3 s; trace b, F every 10 ms }
"""
GEARED = """model m {
  coord a, b: translation ~ 0 m
  implicit F: N
  energy T* = 1/2*(2 kg)*a'^2 + 1/2*(1 kg)*b'^2
  energy V = 1/2*(10 N/m)*b^2
  content D = 1/2*(3 N.s/m)*b'^2
  phi gear: a = 2*b
  work F on a
  gamma follow: b = 1 m*sin(2 rad/s*t)
}
scene s of m { time 0 s to 3 s; trace b, F every 10 ms }
"""
# text, frequency of the path (rad/s), (inertia, damping, stiffness, leverage) of F = (m b'' + c b' + k b)/n
ASKED = {"own": (OWN, 2.2105, (38.889, 8.6046, 1.0854, 1.0)), "geared": (GEARED, 2.0, (9.0, 3.0, 10.0, 2.0))}


@pytest.mark.parametrize("method", ["auto", "radau", "bdf"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("case", sorted(ASKED))
def test_the_force_follows_from_the_path(tmp_path, case, formulation, method):
    """F was 12.7 N for 19.0 at the start, where no row said what the acceleration is; then the bdf was off by 73 %,
    met, for what it was off by there made its first steps spikes of 1e9 N, to which errors were relative.
    """
    text, w, (m, c, k, n) = ASKED[case]
    (tmp_path / "m.sd").write_text(text)
    run = {"formulation": formulation, "method": method, "accuracy": 1e-4, "output": tmp_path / "o.h5"}
    trace = api.simulate(tmp_path / "m.sd", **run)
    phase = w * trace.time
    exact = ((k - m * w**2) * np.sin(phase) + c * w * np.cos(phase)) / n
    assert np.abs(trace["F"].values - exact).max() < 1e-4 * np.abs(exact).max()
    assert np.abs(trace["b"].values - np.sin(phase)).max() < 1e-4
