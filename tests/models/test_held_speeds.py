"""A speed that a constraint holds at zero is on neither side of zero when it is let go."""

import numpy as np
import pytest
from sysdyn import api

FAULT = """\
model fault {
  param v = 35 mm/d
  param k = 2 MN/m
  coord x: translation = 0 m
  discrete stuck = true
  let F = k*(v*t - x)
  energy T* = 1/2*(20 t)*x'^2
  energy V = 1/2*k*(v*t - x)^2
  work -(if stuck then 0 N else 60 kN*sign(x')) on x
  psi hold: x' = 0 m/s while stuck
  when stuck and F > 90 kN { stuck := false }
  when not stuck and x' < 0 m/s { stuck := true }
}
scene s of fault {
  time 0 h to 80 h
  trace x every 30 min
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.one_in(5)
def test_what_slips_thrice_sticks_thrice(formulation, method, tmp_path):
    """What was left of the speed, 1e-50 m/s, had a sign: events without end by radau (E930), by bdf now and then."""
    (tmp_path / "m.sd").write_text(FAULT)
    trace = api.simulate(tmp_path / "m.sd", method=method, formulation=formulation, output=tmp_path / "out.h5")
    load, slip = 2e6 * 0.035 / 86400.0, 2.0 * 30e3 / 2e6
    first, rest = 90e3 / load, slip * 2e6 / load
    slips = np.array([0, *(first + k * rest for k in range(4))])
    numbers = np.searchsorted(slips, trace.time, side="right") - 1
    settled = np.array([abs(slips - t).min() > 5.0 for t in trace.time])  # a slip takes 0.3 s
    assert numbers[-1] == 3
    assert np.abs(trace["x"].values - numbers * slip)[settled].max() < 1e-4 * 3 * slip
