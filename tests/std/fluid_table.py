"""Flows of known response."""

from numpy import arctan, cos, exp, log, maximum, minimum, sin, sqrt, vectorize, where
from runs import Row
from scipy.optimize import brentq

DRAIN = sqrt(900 * 9.8 / (0.5 * 4e7))
COLUMN = 8e4 / (2 * 2e5)
SWAY = sqrt(900 * 9.8 * (1 / 0.5 + 1 / 0.25) / 2e5 - COLUMN**2)


def orifice_flow(e, opening=1.0):
    return opening * 0.7 * 3e-4 * sqrt(2 / 900) * e / (e**2 + 500**2) ** 0.25


def orifice_time(e):
    """Primitive of -(e^2 + d^2)^(1/4)/e, up to its scale: u^4 = e^2 + d^2."""
    d, u = 500.0, (e**2 + 500.0**2) ** 0.25
    return -(2 * u + sqrt(d) * (0.5 * log((u - sqrt(d)) / (u + sqrt(d))) - arctan(u / sqrt(d))))


@vectorize
def orifice_pressure(t):
    """Of a tank that an orifice drains from 4 kPa."""
    rate = 900 * 9.8 / 0.5 * 0.7 * 3e-4 * sqrt(2 / 900)
    return brentq(lambda e: orifice_time(e) - orifice_time(4000.0) - rate * t, 1.0, 4000.0, xtol=1e-9, rtol=1e-14)


def gas_volume(t):
    """V0 - q of an accumulator that empties through a laminar resistance."""
    return sqrt(3e-3**2 + 2 * 2e5 * 5e-3 / 4e8 * t)


def pipe_sway(t):
    """Of two vessels that a pipe joins, released at rest: 1 at the start."""
    return exp(-COLUMN * t) * (cos(SWAY * t) + COLUMN / SWAY * sin(SWAY * t))


ROWS = (
    Row(
        "tank",
        """
  node a, b: hydraulic
  A: tank(A = 0.5 m^2, rho = 900 kg/m^3, gravity = 9.8 m/s^2) a = a
  B: tank(A = 0.25 m^2, rho = 900 kg/m^3, gravity = 9.8 m/s^2) a = b
  R: dissipator(e = 3e5 Pa.s/m^3*f) a -> b
  init A.store.q = 0.9 m^3
  init B.store.q = 0.1 m^3
""",
        40.0,
        {
            "A.store.q": lambda t: 2 / 3 + (0.9 - 2 / 3) * exp(-900 * 9.8 * 6 / 3e5 * t),
            "b.e": lambda t: 900 * 9.8 / 0.25 * (1 / 3 - (0.9 - 2 / 3) * exp(-900 * 9.8 * 6 / 3e5 * t)),
        },
    ),
    Row(
        "valve",
        """
  node a, b: hydraulic
  A: tank(A = 0.5 m^2, rho = 900 kg/m^3, gravity = 9.8 m/s^2) a = a
  V: valve(Cr = 4e7 Pa.s^2/m^6) a -> ground
  B: tank(A = 0.5 m^2, rho = 900 kg/m^3, gravity = 9.8 m/s^2) a = b
  W: valve(Cr = 4e7 Pa.s^2/m^6) ground -> b
  init A.store.q = 0.8 m^3
  init B.store.q = 0.6 m^3
""",
        50.0,
        {
            "A.store.q": lambda t: (sqrt(0.8) - DRAIN / 2 * t) ** 2,
            "B.store.q": lambda t: (sqrt(0.6) - DRAIN / 2 * t) ** 2,
            "V.f": lambda t: DRAIN * (sqrt(0.8) - DRAIN / 2 * t),
            "W.f": lambda t: -DRAIN * (sqrt(0.6) - DRAIN / 2 * t),
        },
    ),
    Row(
        "orifice",
        """
  node a: hydraulic
  P: effort(e = 3 kPa*sin(2 rad/s*t)) a -> ground
  O: orifice(Cd = 0.7, A = 3 cm^2, rho = 900 kg/m^3, dp_lam = 500 Pa, opening = 0.4 + 0.5*t/(4 s)) a -> ground
""",
        4.0,
        {
            "O.f": lambda t: orifice_flow(3000 * sin(2 * t), 0.4 + t / 8),
            "O.power": lambda t: 3000 * sin(2 * t) * orifice_flow(3000 * sin(2 * t), 0.4 + t / 8),
        },
    ),
    Row(
        "orifice",
        """
  node a: hydraulic
  A: tank(A = 0.5 m^2, rho = 900 kg/m^3, gravity = 9.8 m/s^2) a = a
  O: orifice(Cd = 0.7, A = 3 cm^2, rho = 900 kg/m^3, dp_lam = 500 Pa) a -> ground
  init a.e = 4 kPa
""",
        800.0,
        {"a.e": orifice_pressure},
    ),
    Row(
        "pipe",
        """
  node a: hydraulic
  P: effort(e = 5 kPa) a -> ground
  L: pipe(I = 2e5 Pa.s^2/m^3, R = 6e5 Pa.s/m^3) a = a, b = ground
  init L.inert.f = -2e-3 m^3/s
""",
        1.5,
        {
            "L.inert.f": lambda t: 5 / 600 - (2e-3 + 5 / 600) * exp(-3 * t),
            "L.m.e": lambda t: 6e5 * (5 / 600 - (2e-3 + 5 / 600) * exp(-3 * t)),
        },
    ),
    Row(
        "pipe",
        """
  node a, b: hydraulic
  A: tank(A = 0.5 m^2, rho = 900 kg/m^3, gravity = 9.8 m/s^2) a = a
  B: tank(A = 0.25 m^2, rho = 900 kg/m^3, gravity = 9.8 m/s^2) a = b
  L: pipe(I = 2e5 Pa.s^2/m^3, R = 8e4 Pa.s/m^3) a = a, b = b
  init A.store.q = 0.9 m^3
  init B.store.q = 0.1 m^3
  init L.inert.f = 0 m^3/s
""",
        12.0,
        {
            "A.store.q": lambda t: 2 / 3 + (0.9 - 2 / 3) * pipe_sway(t),
            "B.store.q": lambda t: 1 / 3 - (0.9 - 2 / 3) * pipe_sway(t),
        },
    ),
    Row(
        "accumulator",
        """
  node a: hydraulic
  A: accumulator(V0 = 5 l, p0 = 2 bar) a = a
  Q: flow(f = 0.4 l/s) ground -> a
  init A.gas.q = 1 l
""",
        8.0,
        {
            "a.e": lambda t: 2e5 * 5e-3 / (4e-3 - 0.4e-3 * t),
            "A.gas.energy": lambda t: 1e3 * log(4e-3 / (4e-3 - 0.4e-3 * t)),
        },
    ),
    Row(
        "accumulator",
        """
  node a: hydraulic
  A: accumulator(V0 = 5 l, p0 = 2 bar) a = a
  R: dissipator(e = 4e8 Pa.s/m^3*f) a -> ground
  init A.gas.q = 2 l
""",
        3.0,
        {
            "A.gas.q": lambda t: 5e-3 - gas_volume(t),
            "R.f": lambda t: 2e5 * 5e-3 / 4e8 / gas_volume(t),
        },
    ),
    Row(
        "ram",
        """
  node a: hydraulic
  node x: translation
  P: effort(e = 3 bar) a -> ground
  C: ram(A = 20 cm^2) a = a, rod = x
  M: kinetic(p = 40 kg*f) x
  D: dissipator(e = 160 N.s/m*f) x -> ground
  init x.f = -1 m/s
""",
        1.0,
        {
            "x.f": lambda t: 3.75 - 4.75 * exp(-4 * t),
            "P.f": lambda t: -20e-4 * (3.75 - 4.75 * exp(-4 * t)),
            "C.t.e2": lambda t: -600.0 + 0 * t,
        },
    ),
    Row(
        "pump",
        """
  node s: rotation
  node i, o: hydraulic
  J1: kinetic(p = 0.02 kg.m^2*f) s
  M: effort(e = 15 N.m) ground -> s
  P: pump(Dp = 3 cm^3/rad) shaft = s, inlet = i, out = o
  S: effort(e = 4 bar) i -> ground
  R: dissipator(e = 2e10 Pa.s/m^3*f) o -> ground
  init s.f = 20 rad/s
""",
        0.3,
        {
            "s.f": lambda t: 90 - 70 * exp(-9 * t),
            "o.e": lambda t: 6e4 * (90 - 70 * exp(-9 * t)),
            "S.f": lambda t: -3e-6 * (90 - 70 * exp(-9 * t)),
        },
    ),
    Row(
        "check_valve",
        """
  node i, o: hydraulic
  S: effort(e = 2 bar*sin(3 rad/s*t)) i -> ground
  V: check_valve() i -> o
  R: dissipator(e = 2e9 Pa.s/m^3*f) o -> ground
""",
        4.0,
        {
            "o.e": lambda t: 2e5 * maximum(sin(3 * t), 0),
            "V.e": lambda t: 2e5 * minimum(sin(3 * t), 0),
        },
    ),
    Row(
        "relief_valve",
        """
  node a: hydraulic
  S: flow(f = 1e-4 m^3/s^2*t) ground -> a
  R: dissipator(e = 1e10 Pa.s/m^3*f) a -> ground
  V: relief_valve(opens = 10 bar, R = 1e9 Pa.s/m^3) a = a, b = ground
""",
        4.0,
        {
            "a.e": lambda t: where(t < 1, 1e6 * t, (1e-4 * t + 1e-3) / 1.1e-9),
        },
    ),
)
