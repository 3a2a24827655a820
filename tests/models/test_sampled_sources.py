"""Sources that events set, where the displacement (momentum) they drive is read: it goes on from where it was."""

import numpy as np
import pytest
from model_runs import FOUR
from scipy.linalg import expm
from sysdyn import api

CHOPPER = """\
model chopper {
  node x, y: electrical
  discrete on = 1
  drive: effort(e = 48 V*on) x -> ground
  L: kinetic(p = 100 uH*f) x -> y
  C: potential(e = q/(220 uF)) y -> ground
  load: dissipator(e = 2 ohm*f) y -> ground
  every 50 us { on := if y.e < 12 V then 1 else 0 }
  init L.f = 0 A
  init C.e = 0 V
}
scene s of chopper {
  time 0 s to 0.59 ms
  trace L.f as i, y.e as v every 20 us
}
"""


def _exact(times):
    """Current (A) and voltage (V), sample by sample by the exponential."""
    matrix = np.array([[0.0, -1e4], [1.0 / 220e-6, -1.0 / 440e-6]])
    inverse, now, found = np.linalg.inv(matrix), np.zeros(2), []
    for k in range(12):
        drive = inverse @ np.array([48e4 * (now[1] < 12.0), 0.0])
        for t in times[(times > 5e-5 * k + 1e-9 if k else times >= 0.0) & (times <= 5e-5 * (k + 1) + 1e-9)]:
            found.append(expm(matrix * (t - 5e-5 * k)) @ (now + drive) - drive)
        now = expm(matrix * 5e-5) @ (now + drive) - drive
    return np.array(found)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_voltage_that_samples_set_moves_no_flux(tmp_path, formulation):
    """Its integral was 48 V*on*t: 72 A too little at the first sample that opened, told as met."""
    (tmp_path / "model.sd").write_text(CHOPPER)
    trace = api.simulate(tmp_path / "model.sd", formulation=formulation, accuracy=1e-5, output=tmp_path / "out.h5")
    exact = _exact(np.unique(trace.time))
    first = np.append(True, np.diff(trace.time) > 0.0)
    for k, name in enumerate(("i", "v")):
        assert np.abs(trace[name].values[first] - exact[:, k]).max() <= 1e-5 * np.abs(exact[:, k]).max()
