"""Voltages of capacitors between two nodes in the co-Lagrangian form: differences of efforts, which error tests see."""

import numpy as np
import pytest
from sysdyn.api import simulate

CLAMPED = """from std.electrical import diode, switch, resistor, capacitor, voltage, coupled_inductors
model m {
  node i, a, c, k, o: electrical
  V: voltage(v = 24 V) i -> ground
  K: coupled_inductors(L1 = 100 uH, L2 = 25 uH, k = 0.98) one = i -> a, two = ground -> c
  S: switch(gate = if mod(t, 20 us) < 8 us then 1 else 0) a -> ground
  D1: diode.complementary() a -> k
  Ck: capacitor(C = 1 uF) k -> i
  Rk: resistor(R = 500 ohm) k -> i
  D2: diode.complementary() c -> o
  C: capacitor(C = 100 uF) o -> ground
  R: resistor(R = 5 ohm) o -> ground
  init K.one.f = 0 A
  init K.two.f = 0 A
  init Ck.e = 30 V
  init C.e = 5 V
}
scene s of m { time 0 s to 0.25 ms; trace Ck.e as v every 3.3 us }
"""


@pytest.mark.parametrize(("method", "rtol", "most"), [("radau", 1e-5, 2e-4), ("bdf", 1e-7, 2e-5)])
def test_the_voltage_of_a_clamp_is_as_accurate_as_in_the_primal_form(tmp_path, method, rtol, most):
    """It was tested with the step's length in seconds, a millionth of what it counts: radau's was 1.4e-3 off, and runs
    compared told 3e-4 where 1e-3 was asked and 3e-3 achieved.
    """
    (tmp_path / "m.sd").write_text(CLAMPED)
    fine = simulate(tmp_path / "m.sd", output=tmp_path / "a.h5", formulation="lagrangian", accuracy=1e-7)
    found = simulate(tmp_path / "m.sd", output=tmp_path / "b.h5", formulation="co_lagrangian", method=method, rtol=rtol)
    at = np.arange(1, 75) * 3.3e-6
    exact, other = (np.interp(at, run.time, run["v"].values) for run in (fine, found))
    assert np.abs(other - exact).max() <= most * np.abs(exact).max()
