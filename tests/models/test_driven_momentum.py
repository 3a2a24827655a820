"""What a prescribed velocity asks of its source, with enough around it that a run is condensed."""

import numpy as np
import pytest
from sysdyn import api

MODEL = """
model table {
  node e: electrical
  node x, y: translation = 0 m
  node r, s: rotation = 0 rad
  C: potential(e = 0.8 V/(1 C)*q) e -> ground
  L: kinetic(p = 7 V.s/(1 A)*f) e -> ground
  R: dissipator(e = 3.5 ohm*f) ground -> e
  M: kinetic(p = 1.8 kg*f) x -> ground
  B: dissipator(e = 0.4 N.s/m*f) y -> x
  B2: dissipator(e = 0.6 N.s/m*f) y -> x
  J: kinetic(p = 0.75 kg.m^2*f) r -> ground
  D: dissipator(e = 0.2 N.m.s*f) r -> ground
  K: potential(e = 0.2 N.m*q) s -> ground
  K2: potential(e = 0.3 N.m*q) s -> ground
  G: dissipator(e = 4 N.m.s*f) s -> r
  T: gyrator(e1 = 3.3 N/(1 A)*f2) x -> ground, e -> ground
  S: flow(f = 5 rad/s*sin(3 rad/s*t)^5) r -> ground
  init C.q = 0 C
  init L.p = 0 V.s
  init M.p = 0 N.s
  init K.q = 0 rad
  init K2.q = 0 rad
  init J.p = 0 kg.m^2/s
}
scene shakes of table {
  time 0 s to 2 s
  trace J.e, S.e, r.f, C.e, C.f, L.e, L.f, R.e, M.e, M.f, B.e, B.f, D.e, K.e, K.f, G.e, G.f every 0.1 s
}
"""


@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_the_torque_of_a_driven_inertia(tmp_path, formulation, method):
    path = tmp_path / "table.sd"
    path.write_text(MODEL)
    found = api.simulate(path, formulation=formulation, method=method, rtol=1e-4, output=tmp_path / "out.h5")
    t = np.asarray(found.time)
    speed, torque = 5 * np.sin(3 * t) ** 5, 0.75 * 75 * np.sin(3 * t) ** 4 * np.cos(3 * t)
    # functions of time alone, and the balance at r: exact at any tolerance
    exact = {"r.f": speed, "J.e": torque, "S.e": found["G.e"] - torque - 0.2 * speed}
    for name, values in exact.items():
        assert np.abs(found[name] - values).max() < 1e-10 * np.abs(values).max(), name
