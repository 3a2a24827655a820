"""The prelude's domains, by primitives, and its constants."""

from numpy import cos, exp, log, sin, sqrt
from runs import PRIMAL, Row

DAMPING = 3.0 / (2 * 0.5)
RINGING = sqrt(40 / 0.5 - DAMPING**2)
APART = 300 * (exp(0.2) - exp(-0.1))
MIXED = 300 * (0.25 * exp(0.2) + 0.75 * exp(-0.1))


def series(domain, effort, flow):
    """0.5 q'' + 3 q' + 40 q = 10 around a loop of a common-effort domain."""
    return f"""
  node a, b, c: {domain}
  S: effort(e = 10 {effort}) a -> ground
  D: dissipator(e = 3 {effort} / (1 {flow})*f) a -> b
  L: kinetic(p = 0.5 {effort}.s / (1 {flow})*f) b -> c
  K: potential(e = 40 {effort} / (1 {flow}.s)*q) c -> ground
  init K.q = 1 {flow}.s
  init L.f = -2 {flow}
"""


def point(domain, effort, flow):
    """The same at a node of a common-flow domain."""
    return f"""
  node x: {domain}
  S: effort(e = 10 {effort}) ground -> x
  D: dissipator(e = 3 {effort} / (1 {flow})*f) x -> ground
  L: kinetic(p = 0.5 {effort}.s / (1 {flow})*f) x -> ground
  K: potential(e = 40 {effort} / (1 {flow}.s)*q) x -> ground
  init K.q = 1 {flow}.s
  init L.f = -2 {flow}
"""


def ringing(t):
    return 0.25 + exp(-DAMPING * t) * (0.75 * cos(RINGING * t) + (0.75 * DAMPING - 2) / RINGING * sin(RINGING * t))


def rate(t):
    """Of `ringing`."""
    decay = (0.75 * (RINGING**2 + DAMPING**2) - 2 * DAMPING) / RINGING
    return exp(-DAMPING * t) * (-2 * cos(RINGING * t) - decay * sin(RINGING * t))


OSCILLATORS = tuple(
    Row(domain, text(domain, effort, flow), 1.5, {"K.q": ringing, "L.f": rate})
    for domain, text, effort, flow in (
        ("translation", point, "N", "m/s"),
        ("rotation", point, "N.m", "rad/s"),
        ("electrical", series, "V", "A"),
        ("hydraulic", series, "Pa", "m^3/s"),
    )
)

ROWS = (
    *OSCILLATORS,
    Row(
        "thermal",
        """
  node a, b: thermal
  let heat = 4 W/K*(a.e - b.e)
  A: potential(e = 300 K*exp(q/(50 J/K))) a -> ground
  B: potential(e = 300 K*exp(q/(150 J/K))) b -> ground
  out: flow(f = heat/a.e) a -> ground
  in_: flow(f = heat/b.e) ground -> b
  init A.q = 10 J/K
  init B.q = -15 J/K
""",
        30.0,
        {
            "a.e": lambda t: MIXED + 0.75 * APART * exp(-8 / 75 * t),
            "b.e": lambda t: MIXED - 0.25 * APART * exp(-8 / 75 * t),
            "A.q": lambda t: 50 * log((MIXED + 0.75 * APART * exp(-8 / 75 * t)) / 300),
        },
    ),
    Row(
        "heat",
        """
  node a: heat
  A: potential(q = 50 J/K*e) a -> ground
  D: dissipator(f = 4 W/K*e) a -> ground
  init A.q = 20 kJ
""",
        30.0,
        {"a.e": lambda t: 400 * exp(-0.08 * t)},
    ),
    Row(
        "planar",
        """
  node c: planar
  A: kinetic(p = 2 kg*f) c.x
  B: kinetic(p = 3 kg*f) c.y
  C: kinetic(p = 4 kg.m^2*f) c.th
  P: effort(e = 6 N) ground -> c.x
  work -3 kg*g0 on c.y.q
  Q: effort(e = 8 N.m) ground -> c.th
  init c.y.f = 7 m/s
""",
        2.0,
        {
            "c.x.q": lambda t: 1.5 * t**2,
            "c.y.q": lambda t: 7 * t - 9.80665 / 2 * t**2,
            "c.th.q": lambda t: t**2,
            "c0*t": lambda t: 299792458 * t,
        },
        PRIMAL,
    ),
)
