"""Four ideal diodes beside samples at the instants at which they commutate."""

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.runtime.start import restart

TEXT = """from std.electrical import voltage, resistor, diode
model bridge {
  node s, p, m: electrical
  V: voltage(v = 110 V*sqrt(2)*sin(2*pi*50 Hz*t)) s -> ground
  D1: diode.complementary() s -> p
  D2: diode.complementary() ground -> p
  D3: diode.complementary() m -> s
  D4: diode.complementary() m -> ground
  R: resistor(R = 20 ohm) p -> m
  state z: A^2.s = 0 A^2.s
  dynamic z' = R.f^2
  every 10 ms { z := 0 A^2.s }
}
scene run of bridge { time 0 s to 50 ms; trace R.f, z every 0.1 ms; accuracy 1e-5 }
"""


def test_sets_that_short_the_source_are_refused_by_linear_algebra(tmp_path, monkeypatch):
    """The source is zero where they are tried, its rate is not: all strategies of a start were asked, 0.6 s each."""
    searched = []
    monkeypatch.setattr(restart, "behind", lambda *given: searched.append(given))
    file = tmp_path / "m.sd"
    file.write_text(TEXT)
    found = simulate(file, output=tmp_path / "a.h5")
    assert found.met
    assert not searched
    most, turn = 110.0 * np.sqrt(2.0) / 20.0, 2.0 * np.pi * 50.0
    since = np.mod(found.time + 1e-9, 0.01) - 1e-9
    assert found["R.f"].values == pytest.approx(most * np.abs(np.sin(turn * found.time)), abs=1e-5 * most)
    charge = most**2 * (0.5 * since - np.sin(2.0 * turn * since) / (4.0 * turn))
    inside = since > 1e-6  # at the instant itself either side of the assignment
    assert found["z"].values[inside] == pytest.approx(charge[inside], abs=1e-5 * most**2 * 0.005)
