"""Switches alike in both families: a relay on a displacement that is only traced, a friction whose bound vanishes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
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
@pytest.mark.long
def test_switches_alike(formulation, tmp_path):
    """It was a fault of sysdyn (exit 4) in the complementary formulations: what is traced alone has no place there."""
    (tmp_path / "m.sd").write_text(RELAY)
    trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "out.h5")
    assert np.abs(trace["y.q"].values - _switched(trace.time)).max() < 5e-5
    assert sum(e.name.startswith("when") for e in trace.events) >= 5


RELEASE = """\
table clamp(x: s) -> 1 linear clamp [ (0, 1), (1.5, 1), (1.6, 0) ]
model release {
  node a, b: rotation
  Ja: kinetic(p = 0.2 kg.m^2*f) a
  Jb: kinetic(p = 0.3 kg.m^2*f) b
  M: effort(e = 20 N.m - 0.1 N.m.s*a.f) ground -> a
  FRICTION
  init Ja.f = 20 rad/s
  init Jb.f = 20 rad/s
}
scene s of release {
  time 0 s to 2 s
  trace a.f, b.f
}
"""


def _released():
    """The speeds at 2 s: both shafts turn as one until the clamp holds less than what the second one takes."""

    def bound(t):
        return max(1500.0 * (1.6 - t), 0.0)

    slips = brentq(lambda t: bound(t) - 0.3 * 36.0 * np.exp(-0.2 * t), 1.5, 1.6, xtol=1e-14)
    one = np.full(2, 200.0 - 180.0 * np.exp(-0.2 * slips))

    def rates(t, w):
        return [(20.0 - 0.1 * w[0] - bound(t)) / 0.2, bound(t) / 0.3]

    a, b = solve_ivp(rates, (slips, 1.6), one, rtol=1e-11, atol=1e-12).y[:, -1]
    return 200.0 - (200.0 - a) * np.exp(-0.2), b


@pytest.mark.parametrize(
    ("friction", "formulation"),
    [
        ("rub: dissipator(e = 150 N.m*clamp(t)*setsign(f)) a -> b", "co_hamiltonian"),
        (
            "rub[1]: dissipator(e = 50 N.m*clamp(t)*setsign(f)) a -> b\n"
            "  for i in 2..5 { rub[i]: dissipator(e = 25 N.m*clamp(t)*setsign(f)) a -> b }",
            "co_lagrangian",
        ),
    ],
    ids=["one", "five"],
)
def test_a_friction_whose_bound_falls_to_zero_while_it_sticks(tmp_path, friction, formulation):
    """Its sense was divided by that bound: shafts of 93 rad/s told as 224, runs without an end."""
    (tmp_path / "m.sd").write_text(RELEASE.replace("FRICTION", friction))
    given = {"formulation": formulation, "method": "radau", "rtol": 1e-6, "atol": 1e-6}
    trace = api.simulate(tmp_path / "m.sd", output=tmp_path / "o.h5", **given)
    np.testing.assert_allclose([trace[name].values[-1] for name in ("a.f", "b.f")], _released(), rtol=1e-7)
