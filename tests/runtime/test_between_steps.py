"""Values within the steps of radau of what a stiff law makes follow what moves with time."""

from pathlib import Path

import numpy as np
import pytest
from sysdyn import api

COIL = """
from std.electrical import resistor, inductor, voltage
model coil {
  node a, b: electrical
  V: voltage(v = 300 V*cos(2*pi*50 Hz*t)) a -> ground
  R: resistor(R = 1 kohm) a -> b
  L: inductor(L = 3.6 mH) b -> ground
}
scene s of coil { time 0 s to 50 ms; trace L.f as i every 0.5 ms }
"""


@pytest.mark.long
def test_a_current_that_follows_a_resistor(tmp_path: Path):
    """Its estimate at the ends of steps of 1 ms is damped by 1 / (h R / L): by that alone it is 2.2e-4 off between."""
    file = tmp_path / "m.sd"
    file.write_text(COIL)
    run = api.simulate(file, output=tmp_path / "m.h5", method="radau", rtol=1e-6)
    i, omega = 300.0 / (1e3 + 2j * np.pi * 50.0 * 3.6e-3), 2.0 * np.pi * 50.0
    exact = (i * np.exp(1j * omega * run.time)).real - i.real * np.exp(-1e3 / 3.6e-3 * run.time)
    assert np.abs(run["i"].values - exact).max() < 1e-6 * 0.3
