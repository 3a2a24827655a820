"""Each line of an energy over several branches adds: split into lines, it is what it is in one."""

import numpy as np
import pytest
from sysdyn import api

COILS = """from std.electrical import resistor, voltage
component coils {
  branch a, b: electrical
  energy T* = 1/2*(1 H)*a.f^2
  energy T* = 1/2*(10 mH)*b.f^2
  energy T* = (50 mH)*a.f*b.f
}
model core {
  node in_, s: electrical
  V: voltage(v = 10 V) in_ -> ground
  K: coils() a = in_ -> ground, b = s -> ground
  R: resistor(R = 10 ohm) s -> ground
  init K.a.p = 5 mWb
  init K.b.f = 0.1 A
}
scene charge of core {
  time 0 s to 10 ms
  trace K.a.p as flux, K.a.f as i, K.b.f as j, R.energy as heat
  accuracy 1e-7
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_coils_on_one_core(tmp_path, formulation):
    """flux' = 10 V from 5 mWb = i + 50 mH j; 7.5 mH j' = -10 j - 0.5 V from 0.1 A."""
    path = tmp_path / "core.sd"
    path.write_text(COILS)
    trace = api.simulate(path, formulation=formulation, output=str(tmp_path / "t.h5"))
    t = np.asarray(trace.time)
    flux, j = 5e-3 + 10.0 * t, -0.05 + 0.15 * np.exp(-t * 10.0 / 7.5e-3)
    for name, wanted in (("flux", flux), ("i", flux - 0.05 * j), ("j", j)):
        assert np.max(np.abs(trace[name].values - wanted)) <= 1e-6 * np.max(np.abs(wanted)), name
