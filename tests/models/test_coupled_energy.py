"""The energy that each coil of a core has absorbed: together what the core stores."""

import numpy as np
import pytest
from sysdyn.api import simulate

COILS = """from std.electrical import coupled_inductors, voltage, resistor
model core {
  node a, b, c: electrical
  Vs: voltage(v = 10 V*sin(2*pi*50 Hz*t)) a -> ground
  R1: resistor(R = 1 ohm) a -> b
  K: coupled_inductors(L1 = 1 mH, L2 = 2 mH, k = 0.9) one = b -> ground, two = c -> ground
  R2: resistor(R = 5 ohm) c -> ground
}
scene mains of core {
  time 0 s to 40 ms
  trace K.one.energy as e1, K.two.energy as e2, K.one.f as f1, K.two.f as f2
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_hamiltonian", "kane"])
@pytest.mark.one_in(2)
def test_coils_of_one_core_absorb_what_it_stores(tmp_path, formulation):
    """It was refused (E518) where the effort of a coil follows from the rates of two flows."""
    path = tmp_path / "m.sd"
    path.write_text(COILS)
    trace = simulate(path, output=tmp_path / "t.h5", formulation=formulation, accuracy=1e-7)
    e1, e2, f1, f2 = (trace[name].values for name in ("e1", "e2", "f1", "f2"))
    stored = 0.5 * (1e-3 * f1**2 + 2e-3 * f2**2) + 0.9 * np.sqrt(2e-6) * f1 * f2
    assert np.abs(e1 + e2 - stored).max() < 1e-6 * np.abs(e1).max()
    assert np.abs(e1).max() > 0.08
