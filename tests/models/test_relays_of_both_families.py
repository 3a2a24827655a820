"""A relay on a displacement that the complementary family has only where it is traced."""

import numpy as np
import pytest
from sysdyn import api

RELAY = """\
model relay {
  node x, y, w: translation
  M: kinetic(p = 60 kg*f) x
  K: potential(e = 28 kN*(exp(q/(1 m)) - 1)) x -> ground
  W: flow(f = 3 m/s*cos(30 rad/s*t)) w -> ground
  KW: potential(e = 15 kN/m*q) w -> x
  C: dissipator(e = 334 N*setsign(f)) x -> ground
  init x.q = -0.4 m
  init x.f = 0 m/s
  N: kinetic(p = 28 kg*f) y
  KN: potential(e = 28 kN/m*q) y -> ground
  init y.q = -0.27 m
  init y.f = 0 m/s
  discrete r: N = 0 N
  R: effort(e = r) ground -> y
  when y.q > 0.1 m { r := -1.4 kN }
  when y.q < -0.1 m { r := 1.4 kN }
}
scene s of relay {
  time 0 s to 0.6 s
  trace x.q, y.q every 5 ms
}
"""


def _switched(times):
    """The second mass at these instants, 1000 (rad/s)^2, pushed to where its relay says: piece by piece."""
    w, rest, begin, a, b = np.sqrt(1000.0), 0.0, 0.0, -0.27, 0.0  # rest + a cos + b sin of w (t - begin)
    fine = np.linspace(0.0, 0.6, 600_001)
    found, falls = np.empty_like(fine), False
    was = -0.27
    for k, t in enumerate(fine):
        s = w * (t - begin)
        now = rest + a * np.cos(s) + b * np.sin(s)
        if (was <= 0.1 < now) or (was >= -0.1 > now):
            falls = now > 0.0
            speed = b * np.cos(s) - a * np.sin(s)
            rest, begin = (-0.05 if falls else 0.05), t
            a, b = now - rest, speed
        found[k] = was = now
    return np.interp(times, fine, found)


@pytest.mark.parametrize("formulation", ["co_lagrangian", "co_hamiltonian", "lagrangian"])
def test_switches_alike(formulation, tmp_path):
    """It was a fault of sysdyn (exit 4) in the complementary formulations: what is traced alone has no place there."""
    (tmp_path / "m.sd").write_text(RELAY)
    trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "out.h5")
    assert np.abs(trace["y.q"].values - _switched(trace.time)).max() < 5e-5
    assert sum(e.name.startswith("when") for e in trace.events) >= 5
