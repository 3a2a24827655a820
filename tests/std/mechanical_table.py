"""Motions along a line, about an axis and in the plane, of known response."""

from numpy import arcsin, arcsinh, arctan2, cos, exp, maximum, pi, sin, sinh, sqrt, tanh, where
from runs import PRIMAL, Row
from scipy.special import ellipj, ellipk

LIGHT = 299792458.0
SPRING = sqrt(90 / 2.5)
PAIR = sqrt(120 * (1 / 2 + 1 / 3))
DAMPED = 1.2 / (2 * 0.3)
TORSION = sqrt(30 / 0.3 - DAMPED**2)
SLIP = 2 * 0.4 * 0.05 * 60 * (1 / 0.5 + 1 / 0.8)
HINGE = 1.7 * 9.81 * 0.6 / (0.2 + 1.7 * 0.6**2)


def relativistic(t):
    """Momentum over m*c0."""
    return (1e8 + 5e8 * t) / (2 * LIGHT)


def driven(t):
    """Speed under a force that oscillates."""
    return 8 / 61 * (5 * cos(3 * t) + 6 * sin(3 * t)) - 101 / 61 * exp(-2.5 * t)


def twisted(t):
    """Angle of a torsion pendulum from where it comes to rest."""
    return exp(-DAMPED * t) * (-0.7 * cos(TORSION * t) + (2 - 0.7 * DAMPED) / TORSION * sin(TORSION * t))


def slipping(t):
    """Of a clutch whose friction is smoothed at 0.5 rad/s."""
    return 0.5 * arcsinh(sinh(9 / 0.5) * exp(-SLIP * t / 0.5))


def swing(t, *, amplitude, w):
    """Angle of a pendulum let go at rest."""
    k = sin(amplitude / 2)
    return 2 * arcsin(k * ellipj(ellipk(k**2) - w * t, k**2)[0])


def swing_rate(t, *, amplitude, w):
    k = sin(amplitude / 2)
    return -2 * w * k * ellipj(ellipk(k**2) - w * t, k**2)[1]


ROWS = (
    Row(
        "mass.newton",
        """
  node x: translation
  M: mass.newton(m = 2.5 kg) x
  P: force(F = 4 N) ground -> x
  init x.q = 3 m
  init x.f = -2 m/s
""",
        4.0,
        {
            "x.q": lambda t: 3 - 2 * t + 0.8 * t**2,
            "M.p": lambda t: -5 + 4 * t,
            "M.T": lambda t: (-5 + 4 * t) ** 2 / 5,
        },
    ),
    Row(
        "mass.relativistic",
        """
  node x: translation
  M: mass.relativistic(m = 2 kg) x
  P: force(F = 5e8 N) ground -> x
  init x.q = 1e7 m
  init M.p = 1e8 N.s
""",
        5.0,
        {
            "x.f": lambda t: LIGHT * relativistic(t) / sqrt(1 + relativistic(t) ** 2),
            "x.q": lambda t: (
                1e7 + 2 * LIGHT**2 / 5e8 * (sqrt(1 + relativistic(t) ** 2) - sqrt(1 + relativistic(0) ** 2))
            ),
        },
    ),
    Row(
        "spring",
        """
  node x: translation
  M: mass(m = 2.5 kg) x
  K: spring(k = 90 N/m, l0 = 0.4 m) x -> ground
  init x.q = 0.7 m
  init x.f = 1.2 m/s
""",
        3.0,
        {
            "x.q": lambda t: 0.4 + 0.3 * cos(SPRING * t) + 1.2 / SPRING * sin(SPRING * t),
            "K.e": lambda t: 90 * (0.3 * cos(SPRING * t) + 1.2 / SPRING * sin(SPRING * t)),
        },
    ),
    Row(
        "spring",
        """
  node a, b: translation
  A: mass(m = 2 kg) a
  B: mass(m = 3 kg) b
  K: spring(k = 120 N/m, l0 = 0.5 m) b -> a
  init a.q = 0.1 m
  init b.q = 0.8 m
  init a.f = 1 m/s
  init b.f = 0 m/s
""",
        2.0,
        {
            "a.q": lambda t: 0.52 + 0.4 * t - 0.6 * (0.5 + 0.2 * cos(PAIR * t) - sin(PAIR * t) / PAIR),
            "b.q": lambda t: 0.52 + 0.4 * t + 0.4 * (0.5 + 0.2 * cos(PAIR * t) - sin(PAIR * t) / PAIR),
        },
    ),
    Row(
        "damper",
        """
  node a, b: translation
  A: mass(m = 4 kg) a
  B: mass(m = 6 kg) b
  D: damper(b = 12 N.s/m) a -> b
  init a.f = 5 m/s
  init b.f = -1 m/s
""",
        1.5,
        {
            "a.f": lambda t: 1.4 + 3.6 * exp(-5 * t),
            "b.f": lambda t: 1.4 - 2.4 * exp(-5 * t),
            "D.e": lambda t: 72 * exp(-5 * t),
        },
    ),
    Row(
        "force",
        """
  node x: translation
  M: mass(m = 2 kg) x
  D: damper(b = 5 N.s/m) x -> ground
  P: force(F = 8 N*cos(3 rad/s*t)) ground -> x
  init x.f = -1 m/s
""",
        3.0,
        {
            "x.f": driven,
            "P.power": lambda t: -8 * cos(3 * t) * driven(t),
        },
    ),
    Row(
        "velocity",
        """
  node x, y: translation
  V: velocity(v = 0.6 m/s) y -> ground
  K: spring(k = 90 N/m) y -> x
  M: mass(m = 2.5 kg) x
  init x.q = 0.2 m
  init y.q = 0.3 m
  init x.f = 0 m/s
""",
        2.0,
        {
            "x.f": lambda t: 0.6 - 0.6 * cos(SPRING * t) + 0.1 * SPRING * sin(SPRING * t),
            "V.e": lambda t: -90 * (0.1 * cos(SPRING * t) + 0.6 / SPRING * sin(SPRING * t)),
        },
    ),
    Row(
        "coulomb",
        """
  node x: translation
  M: mass(m = 2 kg) x
  C: coulomb(Fc = 3 N) x -> ground
  init x.f = -4 m/s
""",
        5.0,
        {"x.f": lambda t: -maximum(4 - 1.5 * t, 0)},
        PRIMAL,
    ),
    Row(
        "inertia",
        """
  node s: rotation
  J1: inertia(J = 0.7 kg.m^2) s
  P: torque(M = 2.1 N.m) s -> ground
  init s.q = 0.4 rad
  init s.f = 6 rad/s
""",
        5.0,
        {
            "s.q": lambda t: 0.4 + 6 * t - 1.5 * t**2,
            "J1.p": lambda t: 4.2 - 2.1 * t,
        },
    ),
    Row(
        "torsion",
        """
  node s: rotation
  J1: inertia(J = 0.3 kg.m^2) s
  D: rotary_damper(b = 1.2 N.m.s/rad) s -> ground
  K: torsion(k = 30 N.m/rad) s -> ground
  P: torque(M = 6 N.m) ground -> s
  init s.q = -0.5 rad
  init s.f = 2 rad/s
""",
        2.0,
        {
            "s.q": lambda t: 0.2 + twisted(t),
            "K.e": lambda t: 6 + 30 * twisted(t),
        },
    ),
    Row(
        "rotary_damper",
        """
  node a, b: rotation
  A: inertia(J = 0.4 kg.m^2) a
  B: inertia(J = 0.6 kg.m^2) b
  D: rotary_damper(b = 1.2 N.m.s/rad) b -> a
  init a.f = 50 rad/s
  init b.f = -10 rad/s
""",
        1.5,
        {
            "a.f": lambda t: 14 + 36 * exp(-5 * t),
            "D.e": lambda t: -72 * exp(-5 * t),
        },
    ),
    Row(
        "torque",
        """
  node s: rotation
  J1: inertia(J = 0.5 kg.m^2) s
  P: torque(M = 3 N.m*exp(-2 Hz*t)) ground -> s
  init s.f = -1 rad/s
""",
        2.0,
        {
            "s.f": lambda t: 2 - 3 * exp(-2 * t),
            "P.power": lambda t: -3 * exp(-2 * t) * (2 - 3 * exp(-2 * t)),
        },
    ),
    Row(
        "gear.ideal",
        """
  node a, b: rotation
  A: inertia(J = 0.2 kg.m^2) a
  B: inertia(J = 5 kg.m^2) b
  G: gear.ideal(ratio = -5) inp = a, out = b
  P: torque(M = 4 N.m) ground -> a
  D: rotary_damper(b = 15 N.m.s/rad) b -> ground
  init a.f = 2 rad/s
  init a.q = 1 rad
""",
        2.0,
        {
            "a.f": lambda t: 4 / 0.6 + (2 - 4 / 0.6) * exp(-1.5 * t),
            "b.f": lambda t: -(4 / 0.6 + (2 - 4 / 0.6) * exp(-1.5 * t)) / 5,
            "G.g.e1": lambda t: 4 - 0.2 * -1.5 * (2 - 4 / 0.6) * exp(-1.5 * t),
        },
    ),
    Row(
        "gear.losses",
        """
  node a, b: rotation
  A: inertia(J = 0.2 kg.m^2) a
  B: inertia(J = 5 kg.m^2) b
  G: gear.losses(ratio = 5, eta = 0.9) inp = a, out = b
  P: torque(M = 4 N.m) ground -> a
  init a.f = 2 rad/s
""",
        2.0,
        {
            "a.f": lambda t: 2 + 4 / 0.42 * t,
            "b.f": lambda t: (2 + 4 / 0.42 * t) / 5,
            "G.drag.power": lambda t: 0.1 * 0.2 * 4 / 0.42 * (2 + 4 / 0.42 * t),
        },
    ),
    Row(
        "clutch.setvalued",
        """
  node a, b: rotation
  A: inertia(J = 0.5 kg.m^2) a
  B: inertia(J = 0.8 kg.m^2) b
  C: clutch.setvalued(clamp = 60 N, mu = 0.4, r = 50 mm) a = a, b = b
  init a.f = 9 rad/s
  init b.f = 0 rad/s
""",
        2.0,
        {
            "a.f": lambda t: 9 / 1.3 * 0.5 + 8 / 13 * maximum(9 - SLIP * t, 0),
            "b.f": lambda t: 9 / 1.3 * 0.5 - 5 / 13 * maximum(9 - SLIP * t, 0),
        },
        PRIMAL,
    ),
    Row(
        "clutch.smooth",
        """
  node a, b: rotation
  A: inertia(J = 0.5 kg.m^2) a
  B: inertia(J = 0.8 kg.m^2) b
  C: clutch.smooth(clamp = 60 N, mu = 0.4, r = 50 mm) a = a, b = b
  init a.f = 9 rad/s
  init b.f = 0 rad/s
""",
        1.5,
        {
            "a.f": lambda t: 9 / 1.3 * 0.5 + 8 / 13 * slipping(t),
            "b.f": lambda t: 9 / 1.3 * 0.5 - 5 / 13 * slipping(t),
            "C.law_friction.e": lambda t: 2.4 * tanh(slipping(t) / 0.5),
        },
    ),
    Row(
        "clutch.automaton",
        """
  node a, b: rotation
  A: inertia(J = 0.5 kg.m^2) a
  B: inertia(J = 0.8 kg.m^2) b
  C: clutch.automaton(clamp = 60 N, mu = 0.4, r = 50 mm) a = a, b = b
  init a.f = 9 rad/s
  init b.f = 0 rad/s
""",
        2.0,
        {"a.f": lambda t: 9 / 1.3 * 0.5 + 8 / 13 * maximum(9 - SLIP * t, 0)},
        PRIMAL,
    ),
    Row(
        "rack",
        """
  node s: rotation
  node x: translation
  J1: inertia(J = 0.02 kg.m^2) s
  M: mass(m = 3 kg) x
  R: rack(r = 80 mm) inp = s, out = x
  P: torque(M = 0.5 N.m) ground -> s
  D: damper(b = 7 N.s/m) x -> ground
  init s.q = 2 rad
  init s.f = -3 rad/s
""",
        2.0,
        {
            "s.f": lambda t: 0.5 / 0.0448 + (-3 - 0.5 / 0.0448) * exp(-0.0448 / 0.0392 * t),
            "x.f": lambda t: 0.08 * (0.5 / 0.0448 + (-3 - 0.5 / 0.0448) * exp(-0.0448 / 0.0392 * t)),
        },
    ),
    Row(
        "body2d",
        """
  node c: planar
  B: body2d(m = 2 kg, J = 0.3 kg.m^2, gravity = 9.81 m/s^2) cm = c
  P: force(F = 5 N) ground -> c.x
  Q: torque(M = 0.6 N.m) ground -> c.th
  init c.x.q = 1 m
  init c.y.q = 2 m
  init c.th.q = 0.1 rad
  init c.x.f = 3 m/s
  init c.y.f = 8 m/s
  init c.th.f = -4 rad/s
""",
        1.5,
        {
            "c.x.q": lambda t: 1 + 3 * t + 1.25 * t**2,
            "c.y.q": lambda t: 2 + 8 * t - 4.905 * t**2,
            "c.th.q": lambda t: 0.1 - 4 * t + t**2,
        },
        PRIMAL,
    ),
    Row(
        "revolute2d",
        """
  node c, w: planar
  phi x: w.x.q = 0.5 m
  phi y: w.y.q = -0.3 m
  phi th: w.th.q = pi/2
  B: body2d(m = 1.7 kg, J = 0.2 kg.m^2, gravity = 9.81 m/s^2) cm = c
  H: revolute2d(ra = [0.36 m, 0.48 m], rb = [0.1 m, 0 m]) a = c, b = w
  init c.th.q = 1.9 rad + atan2(0.36, 0.48)
  init c.th.f = 0 rad/s
  init c.x.q ~ 1 m
  init c.y.q ~ 0 m
""",
        3.0,
        {
            "c.th.q": lambda t: arcsin(0.6) + swing(t, amplitude=1.9, w=sqrt(HINGE)),
            "c.x.q": lambda t: 0.5 + 0.6 * sin(swing(t, amplitude=1.9, w=sqrt(HINGE))),
            "c.y.q": lambda t: -0.2 - 0.6 * cos(swing(t, amplitude=1.9, w=sqrt(HINGE))),
            "c.th.f": lambda t: swing_rate(t, amplitude=1.9, w=sqrt(HINGE)),
        },
        PRIMAL,
    ),
    Row(
        "revolute2d",
        """
  node a, b: planar
  A: body2d(m = 2 kg, J = 0.1 kg.m^2, gravity = 0 m/s^2) cm = a
  B: body2d(m = 3 kg, J = 0.4 kg.m^2, gravity = 0 m/s^2) cm = b
  H: revolute2d(ra = [0 m, 0.5 m], rb = [0.3 m, 0.4 m]) a = a, b = b
  init a.x.q = 0 m
  init a.y.q = 0 m
  init a.th.q = 0 rad
  init a.th.f = 2.5 rad/s
  init b.th.q = -pi/2 - atan2(0.4, 0.3)
  init b.th.f = 2.5 rad/s
  init a.x.f = 1.1 m/s
  init a.y.f = 0.7 m/s
  init b.x.q ~ 0 m
  init b.y.q ~ 1 m
""",
        2.0,
        {
            "a.x.q": lambda t: 0.6 * sin(2.5 * t) - 0.4 * t,
            "a.y.q": lambda t: 0.6 - 0.6 * cos(2.5 * t) + 0.7 * t,
            "b.x.q": lambda t: -0.4 * sin(2.5 * t) - 0.4 * t,
            "b.y.q": lambda t: 0.6 + 0.4 * cos(2.5 * t) + 0.7 * t,
            "b.th.q": lambda t: -pi / 2 - arctan2(4, 3) + 2.5 * t,
            "H.px.on(a.x.q)": lambda t: -7.5 * sin(2.5 * t),
        },
        PRIMAL,
    ),
    Row(
        "stops",
        """
  node x: translation
  M: mass(m = 2 kg) x
  S: stops(lo = 0 m, hi = 1 m, bounce = 0.5) x -> ground
  init x.q = 0.2 m
  init x.f = 2 m/s
""",
        3.0,
        {
            "x.q": lambda t: where(t < 0.4, 0.2 + 2 * t, where(t < 1.4, 1.4 - t, 0.5 * (t - 1.4))),
            "x.f": lambda t: where(t < 0.4, 2.0, where(t < 1.4, -1.0, 0.5)),
        },
        PRIMAL,
    ),
    Row(
        "ratchet",
        """
  node a: rotation
  J: inertia(J = 2 kg.m^2) a
  M: torque(M = 2 N.m*cos(1 rad/s*t)) ground -> a
  R: ratchet() a -> ground
  init a.f = 0 rad/s
""",
        6.0,
        {
            "a.f": lambda t: where(t < pi, sin(t), where(t < 1.5 * pi, 0, 1 + sin(t))),
        },
        PRIMAL,
    ),
    Row(
        "coulomb_joint",
        """
  node a: rotation
  J: inertia(J = 2 kg.m^2) a
  C: coulomb_joint(Mc = 3 N.m) a -> ground
  init a.f = -4 rad/s
""",
        5.0,
        {"a.f": lambda t: -maximum(4 - 1.5 * t, 0)},
        PRIMAL,
    ),
    Row(
        "brake",
        """
  node a: rotation
  J: inertia(J = 2 kg.m^2) a
  B: brake(clamp = 100 N, r = 0.1 m) a -> ground
  init a.f = 10 rad/s
""",
        4.0,
        {"a.f": lambda t: maximum(10 - 4 * t, 0)},
        PRIMAL,
    ),
)
