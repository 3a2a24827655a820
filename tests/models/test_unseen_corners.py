"""Tables whose second derivative jumps, which the explicit method's error test may pass unseen."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from sysdyn import api

PLACES, FORCES = [-30e-3, -10e-3, 0.0, 5e-3, 20e-3, 40e-3], [-80.0, -10.0, 0.0, 2.0, 30.0, 200.0]

SPRING = """\
table F(x: mm) -> N pchip extend [ (-30, -80), (-10, -10), (0, 0), (5, 2), (20, 30), (40, 200) ]
model on_a_spring {
  coord x: translation = 25 mm
  energy T* = 1/2*0.4 kg*x'^2
  work -F(x) on x
  content D = 1/2*0.5 N.s/m*x'^2
  init x' = 0 m/s
}
scene swing of on_a_spring {
  time 0 s to 3 s
  trace x, x' as v every 10 ms
}
"""


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4])
@pytest.mark.long
def test_dopri_on_a_spring_of_a_table(tmp_path, accuracy):
    (tmp_path / "model.sd").write_text(SPRING)
    trace = api.simulate(tmp_path / "model.sd", method="dopri", accuracy=accuracy, output=tmp_path / "out.h5")
    force = PchipInterpolator(PLACES, FORCES)
    exact = solve_ivp(
        lambda _t, z: [z[1], (-force(z[0]) - 0.5 * z[1]) / 0.4],
        (0.0, 3.0),
        [0.025, 0.0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-13,
        max_step=2e-3,
        dense_output=True,
    ).sol(trace.time)
    for name, values in zip(("x", "v"), exact, strict=True):
        assert np.abs(trace[name].values - values).max() <= accuracy * np.abs(values).max()
