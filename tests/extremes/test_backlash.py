"""What a hundred knocks make of round-off: no run is nearer than that, however small its tolerance."""

import numpy as np
from running import ran

TEXT = """
fn dead(u: rad) -> rad = max(u - 0.01, 0) + min(u + 0.01, 0)
model m {
  coord a: rotation = 0 rad
  coord b: rotation = 0 rad
  energy T* = 1/2*(0.01 kg.m^2)*a'^2 + 1/2*(0.02 kg.m^2)*b'^2
  work 1 N.m*sin(6 rad/s*t) - 1e5 N.m/rad*dead(a - b) on a
  work 1e5 N.m/rad*dead(a - b) - 0.05 N.m.s/rad*b' on b
  init a' = 0 rad/s
  init b' = 0 rad/s
}
scene s of m {
  time 0 s to 2 s
  trace a, b, a' as wa, b' as wb every 5 ms
}
"""


def test_what_knocks_leave_open_is_told(tmp_path):
    """The first speeds are known to 1e-12, those behind 150 knocks to 1e-6: 3e-8 was told, for two runs agreed by
    chance.
    """
    rows = np.linspace(0.0, 2.0, 401)
    runs = [ran(tmp_path, TEXT, formulation="hamiltonian", accuracy=accuracy) for accuracy in (1e-6, 1e-7)]
    values = [{name: run.at(name, rows) for name in ("wa", "wb")} for run in runs]
    apart = max(np.abs(values[0][n] - values[1][n]).max() / np.abs(values[0][n]).max() for n in ("wa", "wb"))
    told = [run.trace.statistics["error_estimate"] for run in runs]
    assert apart <= sum(told)
    assert all(run.met == (estimate <= asked) for run, estimate, asked in zip(runs, told, (1e-6, 1e-7), strict=True))
    assert apart <= 2.0 * told[0]
