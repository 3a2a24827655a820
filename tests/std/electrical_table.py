"""Circuits of known response."""

from numpy import clip, cos, exp, interp, log, maximum, minimum, pi, sin, sqrt
from runs import PRIMAL, Row


def diode_voltage(t, v0, *, saturation, thermal, capacitance):
    """Of a capacitor that a diode discharges: exp(-v/vT) obeys a linear equation."""
    return -thermal * log(1.0 - (1.0 - exp(-v0 / thermal)) * exp(-t * saturation / (capacitance * thermal)))


def collector_voltage(t, *, base, v0, capacitance):
    """Of a capacitor at the collector, base voltage held: exp((vc - vb)/vT) obeys a linear equation."""
    thermal, forward = 0.03, 2e-14 * (exp(base / 0.03) - 1.0)
    rate = (0.98 * forward + 5e-14) / (capacitance * thermal)
    end = 5e-14 / (capacitance * thermal * rate)
    return base + thermal * log(end + (exp((v0 - base) / thermal) - end) * exp(-rate * t))


def sine_response(t, *, tau, w, start):
    """y + tau*y' = sin(w*t), y(0) = start."""
    scale = 1.0 + (w * tau) ** 2
    return (sin(w * t) - w * tau * cos(w * t)) / scale + (start + w * tau / scale) * exp(-t / tau)


OSCILLATION = 1.0 / sqrt(20e-3 * 5e-6)
TRANSFORMED = (16 / 50 + 1 / 400) / 30e-6

ROWS = (
    Row(
        "resistor",
        """
  node a, b: electrical
  S: voltage(v = 12 V + 7 V*sin(2*pi*50 Hz*t)) a -> ground
  R1: resistor(R = 220 ohm) a -> b
  R2: resistor(R = 330 ohm) ground -> b
""",
        0.03,
        {
            "b.e": lambda t: 0.6 * (12 + 7 * sin(100 * pi * t)),
            "R2.f": lambda t: -(12 + 7 * sin(100 * pi * t)) / 550,
            "R1.power": lambda t: 220 * ((12 + 7 * sin(100 * pi * t)) / 550) ** 2,
        },
    ),
    Row(
        "capacitor",
        """
  node a, b: electrical
  S: voltage(v = 5 V) a -> ground
  R1: resistor(R = 2 kohm) a -> b
  C1: capacitor(C = 3 uF) b -> ground
  init C1.e = 1 V
""",
        0.02,
        {
            "C1.e": lambda t: 5 - 4 * exp(-t / 6e-3),
            "C1.q": lambda t: 3e-6 * (5 - 4 * exp(-t / 6e-3)),
            "R1.f": lambda t: 2e-3 * exp(-t / 6e-3),
        },
    ),
    Row(
        "capacitor",
        """
  node a: electrical
  C1: capacitor(C = 5 uF) a -> ground
  L1: inductor(L = 20 mH) a -> ground
  init C1.q = 10 uC
  init L1.f = 30 mA
""",
        5e-3,
        {
            "a.e": lambda t: 2 * cos(OSCILLATION * t) - 0.03 * sqrt(20e-3 / 5e-6) * sin(OSCILLATION * t),
            "L1.f": lambda t: 0.03 * cos(OSCILLATION * t) + 2 * sqrt(5e-6 / 20e-3) * sin(OSCILLATION * t),
        },
    ),
    Row(
        "inductor",
        """
  node a, b: electrical
  S: voltage(v = 9 V) a -> ground
  L1: inductor(L = 40 mH) a -> b
  R1: resistor(R = 12 ohm) b -> ground
  init L1.f = -0.5 A
""",
        0.01,
        {
            "L1.f": lambda t: 0.75 - 1.25 * exp(-300 * t),
            "L1.p": lambda t: 40e-3 * (0.75 - 1.25 * exp(-300 * t)),
            "b.e": lambda t: 12 * (0.75 - 1.25 * exp(-300 * t)),
        },
    ),
    Row(
        "voltage",
        """
  node a, b: electrical
  S: voltage(v = 3 V*sin(900 rad/s*t)) a -> ground
  R1: resistor(R = 50 ohm) a -> b
  C1: capacitor(C = 40 uF) b -> ground
  init C1.e = -2 V
""",
        0.01,
        {
            "b.e": lambda t: 3 * sine_response(t, tau=2e-3, w=900, start=-2 / 3),
            "S.f": lambda t: (3 * sine_response(t, tau=2e-3, w=900, start=-2 / 3) - 3 * sin(900 * t)) / 50,
        },
    ),
    Row(
        "current",
        """
  node a: electrical
  I: current(i = 20 mA) ground -> a
  R1: resistor(R = 150 ohm) a -> ground
  C1: capacitor(C = 8 uF) a -> ground
  init C1.e = 0.5 V
""",
        5e-3,
        {
            "a.e": lambda t: 3 - 2.5 * exp(-t / 1.2e-3),
            "I.e": lambda t: -3 + 2.5 * exp(-t / 1.2e-3),
            "R1.f": lambda t: (3 - 2.5 * exp(-t / 1.2e-3)) / 150,
        },
    ),
    Row(
        "diode.exponential",
        """
  node a, b: electrical
  D1: diode.exponential(Is = 2 nA, vT = 40 mV) a -> ground
  C1: capacitor(C = 1 nF) a -> ground
  D2: diode(Is = 2 nA, vT = 40 mV) b -> ground
  C2: capacitor(C = 1 nF) b -> ground
  init C1.e = 0.4 V
  init C2.e = -0.3 V
""",
        0.05,
        {
            "a.e": lambda t: diode_voltage(t, 0.4, saturation=2e-9, thermal=0.04, capacitance=1e-9),
            "b.e": lambda t: diode_voltage(t, -0.3, saturation=2e-9, thermal=0.04, capacitance=1e-9),
        },
    ),
    Row(
        "diode.complementary",
        """
  node a, b: electrical
  S: voltage(v = 10 V*sin(400 rad/s*t)) a -> ground
  D: diode.complementary() a -> b
  R1: resistor(R = 500 ohm) b -> ground
""",
        0.03,
        {
            "b.e": lambda t: maximum(10 * sin(400 * t), 0),
            "D.e": lambda t: minimum(10 * sin(400 * t), 0),
        },
    ),
    Row(
        "npn",
        """
  node b, c: electrical
  S: voltage(v = 0.66 V) b -> ground
  Q: npn(Ies = 2e-14 A, Ics = 5e-14 A, aF = 0.98, aR = 0.392, vT = 30 mV) c = c, b = b, e = ground
  C1: capacitor(C = 2 uF) c -> ground
  init C1.e = 3 V
""",
        0.1,
        {
            "c.e": lambda t: collector_voltage(t, base=0.66, v0=3.0, capacitance=2e-6),
            "S.f": lambda t: (
                -0.02 * 2e-14 * (exp(22) - 1)
                - 0.608 * 5e-14 * (exp((0.66 - collector_voltage(t, base=0.66, v0=3.0, capacitance=2e-6)) / 0.03) - 1)
            ),
        },
    ),
    Row(
        "opamp",
        """
  node s, m, o: electrical
  S: voltage(v = 0.3 V) s -> ground
  R1: resistor(R = 10 kohm) s -> m
  C1: capacitor(C = 100 nF) m -> o
  A: opamp(gain = 200) inp = ground, inm = m, out = o
  init C1.e = 5 V
""",
        0.3,
        {
            "o.e": lambda t: -60 + (60 - 5 / (1 + 1 / 200)) * exp(-t / (1e-3 * 201)),
            "m.e": lambda t: 0.3 - (60 - 5 / (1 + 1 / 200)) / 200 * exp(-t / (1e-3 * 201)),
        },
    ),
    Row(
        "ideal_transformer",
        """
  node s, a, c: electrical
  S: voltage(v = 24 V) s -> ground
  R1: resistor(R = 50 ohm) s -> a
  T: ideal_transformer(n = 4) a = a, b = ground, c = c, d = ground
  R2: resistor(R = 400 ohm) c -> ground
  C2: capacitor(C = 30 uF) c -> ground
  init C2.e = 1 V
""",
        5e-4,
        {
            "c.e": lambda t: 64e3 / TRANSFORMED + (1 - 64e3 / TRANSFORMED) * exp(-TRANSFORMED * t),
            "R1.f": lambda t: (24 - 4 * (64e3 / TRANSFORMED + (1 - 64e3 / TRANSFORMED) * exp(-TRANSFORMED * t))) / 50,
        },
    ),
    Row(
        "switch",
        """
  node a, b, c: electrical
  V: voltage(v = 10 V) a -> ground
  S: switch(gate = if t < 2 ms then 1 else 0) a -> b
  D: diode.complementary ground -> b
  L: inductor(L = 1 mH) b -> c
  R: resistor(R = 1 ohm) c -> ground
  init L.f = 0 A
""",
        5e-3,
        {
            "L.f": lambda t: 10 * (1 - exp(-1e3 * minimum(t, 2e-3))) * exp(-1e3 * maximum(t - 2e-3, 0)),
            "b.e": lambda t: 10.0 * (t < 2e-3),
        },
    ),
    Row(
        "thyristor",
        """
  node a, b: electrical
  V: voltage(v = 10 V*sin(2*pi*50 Hz*t)) a -> ground
  S: thyristor(gate = if t > 3 ms and t < 4 ms then 1 else 0) a -> b
  R: resistor(R = 5 ohm) b -> ground
""",
        0.028,
        {
            "b.e": lambda t: 10 * sin(100 * pi * t) * (t > 3e-3) * (t < 1e-2),
        },
    ),
    Row(
        "mosfet",
        """
  node a, b: electrical
  V: voltage(v = 10 V*sin(2*pi*1 Hz*t)) a -> ground
  R: resistor(R = 4 ohm) a -> b
  Q: mosfet(Ron = 1 ohm, gate = if t < 1 s then 1 else 0) d = b, s = ground
""",
        2.1,
        {
            "b.e": lambda t: maximum(10 * sin(2 * pi * t) * (1 - 0.8 * (t < 1.0)), -0.7),
        },
    ),
    Row(
        "pulse",
        """
  node a: electrical
  P: pulse(lo = -1 V, hi = 5 V, delay = 1 s, rise = 0.5 s, fall = 0.2 s, width = 0.5 s, period = 2 s) a -> ground
  R: resistor(R = 2 ohm) a -> ground
""",
        5.0,
        {
            "a.e": lambda t: -1 + (t > 1) * 6 * clip(minimum((t - 1) % 2 / 0.5, (1.2 - (t - 1) % 2) / 0.2), 0, 1),
            "R.f": lambda t: -0.5 + (t > 1) * 3 * clip(minimum((t - 1) % 2 / 0.5, (1.2 - (t - 1) % 2) / 0.2), 0, 1),
        },
    ),
    Row(
        "piecewise_voltage",
        """
  node a: electrical
  P: piecewise_voltage(n = 3, at = [1 s, 2 s, 4 s], v = [1 V, 3 V, -2 V]) a -> ground
  R: resistor(R = 2 ohm) a -> ground
""",
        5.0,
        {
            "R.f": lambda t: 0.5 * interp(t, [1, 2, 4], [1, 3, -2]),
        },
    ),
    Row(
        "three_phase",
        """
  node a, b, c, n: electrical
  S: three_phase(V = 325 V) a = a, b = b, c = c, n = ground
  Ra: resistor(R = 2 ohm) a -> n
  Rb: resistor(R = 2 ohm) b -> n
  Rc: resistor(R = 4 ohm) c -> n
""",
        0.04,
        {
            "b.e": lambda t: 325 * sin(100 * pi * t - 2 * pi / 3),
            "n.e": lambda t: -65 * sin(100 * pi * t + 2 * pi / 3),
        },
    ),
    Row(
        "coupled_inductors",
        """
  node a, b: electrical
  V: voltage(v = 3 V) a -> ground
  L: coupled_inductors(L1 = 2 H, L2 = 0.5 H, k = 0.6) one = a -> ground, two = b -> ground
  R: resistor(R = 1.5 ohm) b -> ground
  init L.one.f = 0 A
  init L.two.f = 0 A
""",
        1.0,
        {
            "R.f": lambda t: 0.6 * (1 - exp(-1.5 / 0.32 * t)),
            "L.one.f": lambda t: 1.5 * t + 0.18 * (1 - exp(-1.5 / 0.32 * t)),
        },
        PRIMAL,
    ),
    Row(
        "pwm",
        """
  node a: electrical
  P: pwm(period = 0.1 s, duty = 0.3)
  V: voltage(v = 2 V*P.gate) a -> ground
  R: resistor(R = 4 ohm) a -> ground
""",
        1.25,
        {
            "R.f": lambda t: 0.5 * ((t % 0.1) < 0.03),
        },
    ),
)
