"""Drives of known response."""

import numpy as np
from numpy import exp, sin
from runs import Row

WINDING = np.array([[-0.8 / 5e-3, -0.06 / 5e-3], [0.06 / 4e-5, -2e-4 / 4e-5]])
"""Rates of change of current and speed of a motor."""
STEADY = -np.linalg.solve(WINDING, [12 / 5e-3, 0.0])
RATES, MODES = np.linalg.eig(WINDING)
WEIGHTS = np.linalg.solve(MODES, np.array([3.0, -50.0]) - STEADY)
WARMING = (1 / 5 - 0.05 * 0.004 * 400) / 60


def winding(k):
    """Current (0) or speed (1) of a motor on 12 V."""
    return lambda t: STEADY[k] + np.real(exp(np.multiply.outer(t, RATES)) @ (MODES[k] * WEIGHTS))


def winding_temperature(t):
    """At a held current of 20 A, from 320 K."""
    return 290 + 20 / (60 * WARMING) * (1 - exp(-WARMING * t)) + 30 * exp(-WARMING * t)


ROWS = (
    Row(
        "dc_motor.ideal",
        """
  node a, b: electrical
  node s: rotation
  S: effort(e = 10 V) a -> ground
  R: dissipator(e = 0.5 ohm*f) a -> b
  M: dc_motor.ideal(K = 0.2 V.s/rad) p = b, n = ground, shaft = s
  J1: kinetic(p = 0.01 kg.m^2*f) s
  init s.f = 5 rad/s
""",
        0.5,
        {
            "s.f": lambda t: 50 - 45 * exp(-8 * t),
            "b.e": lambda t: 10 - 9 * exp(-8 * t),
            "R.f": lambda t: 18 * exp(-8 * t),
        },
    ),
    Row(
        "dc_motor.rl",
        """
  node a: electrical
  node s: rotation
  S: effort(e = 12 V) a -> ground
  M: dc_motor.rl(
    K = 0.06 V.s/rad, R = 0.8 ohm, L = 5 mH, J = 4e-5 kg.m^2, b = 2e-4 N.m.s/rad
  ) p = a, n = ground, shaft = s
  init M.La.f = 3 A
  init s.f = -50 rad/s
""",
        0.05,
        {"M.La.f": winding(0), "s.f": winding(1)},
    ),
    Row(
        "dc_motor.thermal",
        """
  node a: electrical
  node s: rotation
  I: flow(f = 20 A) ground -> a
  M: dc_motor.thermal(
    K = 0.06 V.s/rad, R = 50 mohm, L = 5 mH, J = 2 kg.m^2, b = 0.05 N.m.s/rad,
    Cth = 60 J/K, Rth = 5 K/W, alpha = 0.004 K^-1, Tamb = 290 K
  ) p = a, n = ground, shaft = s
  init s.f = 0 rad/s
""",
        1000.0,
        {
            "M.hot.e": winding_temperature,
            "s.f": lambda t: 24 * (1 - exp(-t / 40)),
        },
        start="\n  init M.hot.e = 320 K",
    ),
    Row(
        "dc_motor.thermal",
        """
  node a: electrical
  node s: rotation
  I: flow(f = 20 A) ground -> a
  M: dc_motor.thermal(
    K = 0.06 V.s/rad, R = 50 mohm, L = 5 mH, J = 2 kg.m^2, b = 0.05 N.m.s/rad,
    Cth = 60 J/K, Rth = 5 K/W, alpha = 0.004 K^-1, Tamb = 290 K
  ) p = a, n = ground, shaft = s
""",
        1000.0,
        {"M.hot.e": lambda t: winding_temperature(t) - 30 * exp(-WARMING * t)},
    ),
    Row(
        "sensor",
        """
  node a: electrical
  R: dissipator(e = 100 ohm*f) a -> ground
  S: effort(e = 5 V*sin(3 rad/s*t)) a -> ground
  M: sensor(gain = -2.5) x = a.e/(1 V)
""",
        4.0,
        {
            "M.y": lambda t: -12.5 * sin(3 * t),
            "S.f": lambda t: -0.05 * sin(3 * t),
        },
    ),
)
