"""Temperatures of known response."""

from numpy import cos, exp, sin
from runs import Row

ROWS = (
    Row(
        "capacity",
        """
  node a, b: heat
  A: capacity(C = 200 J/K) a -> ground
  B: capacity(C = 300 J/K) b -> ground
  G: conductance(G = 6 W/K) a -> b
  init A.e = 350 K
  init B.e = 290 K
""",
        60.0,
        {
            "a.e": lambda t: 314 + 36 * exp(-t / 20),
            "b.e": lambda t: 314 - 24 * exp(-t / 20),
            "A.q": lambda t: 200 * (314 + 36 * exp(-t / 20)),
        },
    ),
    Row(
        "conductance",
        """
  node a, air: heat
  T: temperature(T = celsius(20)) air -> ground
  A: capacity(C = 200 J/K) a -> ground
  G: conductance(G = 8 W/K) a -> air
  init A.e = celsius(-10)
""",
        80.0,
        {
            "a.e": lambda t: 293.15 - 30 * exp(-t / 25),
            "G.f": lambda t: -240 * exp(-t / 25),
            "T.f": lambda t: -240 * exp(-t / 25),
        },
    ),
    Row(
        "resistance",
        """
  node a, wall, air: heat
  T: temperature(T = 290 K) air -> ground
  A: capacity(C = 40 J/K) a -> ground
  R1: resistance(R = 0.3 K/W) a -> wall
  R2: resistance(R = 0.2 K/W) wall -> air
  init A.e = 400 K
""",
        60.0,
        {
            "a.e": lambda t: 290 + 110 * exp(-t / 20),
            "wall.e": lambda t: 290 + 44 * exp(-t / 20),
            "R2.f": lambda t: 220 * exp(-t / 20),
        },
    ),
    Row(
        "temperature",
        """
  node a, air: heat
  T: temperature(T = 290 K + 10 K*sin(0.1 rad/s*t)) air -> ground
  A: capacity(C = 40 J/K) a -> ground
  R1: resistance(R = 0.25 K/W) a -> air
  init A.e = 300 K
""",
        80.0,
        {
            "a.e": lambda t: 290 + 5 * (sin(0.1 * t) - cos(0.1 * t)) + 15 * exp(-t / 10),
            "R1.f": lambda t: 4 * (-5 * (sin(0.1 * t) + cos(0.1 * t)) + 15 * exp(-t / 10)),
        },
    ),
    Row(
        "heat_flow",
        """
  node a: heat
  Q: heat_flow(Q = 50 W*(1 + cos(0.2 rad/s*t))) ground -> a
  A: capacity(C = 125 J/K) a -> ground
  init A.e = 280 K
""",
        60.0,
        {
            "a.e": lambda t: 280 + 0.4 * t + 2 * sin(0.2 * t),
            "Q.f": lambda t: 50 * (1 + cos(0.2 * t)),
        },
    ),
)
