"""Control laws of known response."""

from numpy import cos, exp, floor, maximum, minimum, pi, sin, sqrt, where
from runs import Row

CLOSED = (1 + 4.0) / (2 * 0.5)
RING = sqrt(60 / 0.5 - CLOSED**2)


def sampled(t):
    """Of a proportional-integral law whose error is held; a sample reads the integral before it assigns it."""
    return minimum(0.8 * 1.5 + 2.0 * 0.1 * 1.5 * floor(t / 0.1 + 1e-9), 4.0)


def held_back(t):
    """The integral of an error that changes its sign at 4 s, stopped at both limits of the output."""
    return maximum(0.5 * minimum(t, 2.0) - 0.5 * maximum(t - 4.0, 0.0), -1 / 6)


def sampled_pid(t):
    """Of an error that falls along a line; a sample reads the integral before it assigns it."""
    k = floor(t / 0.1 + 1e-9)
    return 0.8 * (1.5 - 0.05 * k) + 0.2 * (1.5 * k - 0.05 * k * (k - 1) / 2) - 0.05 * (k > 0)


ROWS = (
    Row(
        "pid",
        """
  input r: V = 3 V
  C: pid(kp = 2, ki = 5 s^-1, kd = 0.4 s, tau = 80 ms, lo = -100 V, hi = 100 V) r = r, y = 0.5 V
""",
        2.0,
        {
            "C.u": lambda t: 5 + 5 * (0.3 + 2.5 * t) + 0.4 / 0.08 * 1.5 * exp(-t / 0.08),
            "C.I": lambda t: 0.3 + 2.5 * t,
        },
        start="""
  init C.I = 0.3 V.s
  init C.d = 1 V
""",
    ),
    Row(
        "pid",
        """
  node x: rotation
  J1: kinetic(p = 0.5 kg.m^2*f) x
  B: dissipator(e = 1 N.m.s/rad*f) x -> ground
  C: pid(
    kp = 4 N.m.s/rad, ki = 60 N.m/rad, lo = -1 kN.m, hi = 1 kN.m
  ) r = 7 rad/s, y = x.f
  M: effort(e = C.u) ground -> x
  init x.f = 0 rad/s
""",
        1.0,
        {
            "x.f": lambda t: 7 - exp(-CLOSED * t) * (7 * cos(RING * t) + (7 * CLOSED - 56) / RING * sin(RING * t)),
        },
    ),
    Row(
        "pid",
        """
  input r: A = if t < 4 s then 0.5 A else -0.5 A
  C: pid(kp = 2 V/A, ki = 3 V/A/s, lo = -1.5 V, hi = 4 V) r = r, y = 0 A
""",
        7.0,
        {
            "C.u": lambda t: 2 * (0.5 - (t >= 4.0)) + 3 * held_back(t),
            "C.I": held_back,
        },
    ),
    Row(
        "lead_lag",
        """
  input u: m = 2 m
  C: lead_lag(t1 = 0.3 s, t2 = 0.1 s) u = u
""",
        0.5,
        {
            "C.y": lambda t: 2 + 3 * exp(-10 * t),
            "C.z": lambda t: 2 - 1.5 * exp(-10 * t),
        },
        start="""
  init C.z = 0.5 m
""",
    ),
    Row(
        "lead_lag",
        """
  input u: Pa = 4 kPa*sin(5 rad/s*t)
  C: lead_lag(t1 = 0.1 s, t2 = 0.4 s) u = u
""",
        3.0,
        {
            "C.y": lambda t: 800 * (2 * sin(5 * t) - 1.5 * cos(5 * t)) + 0.75 * 2600 * exp(-2.5 * t),
        },
        start="""
  init C.z = 1 kPa
""",
    ),
    Row(
        "low_pass",
        """
  C: low_pass(tau = 0.4 s) u = 4 K*sin(5 rad/s*t)
""",
        3.0,
        {
            "C.y": lambda t: 0.8 * (sin(5 * t) - 2 * cos(5 * t)) + 2.6 * exp(-2.5 * t),
        },
        start="""
  init C.z = 1 K
""",
    ),
    Row(
        "sampled_pi",
        """
  C: sampled_pi(kp = 0.8 V/K, ki = 2 V/K/s, Ts = 0.1 s, lo = -4 V, hi = 4 V) r = 302 K, y = 300.5 K
""",
        1.25,
        {"C.u": sampled},
    ),
    Row(
        "relay",
        """
  C: relay(band = 1 V, lo = -3 A, hi = 2 A) u = 2 V*sin(1 rad/s*t)
""",
        8.0,
        {"C.y": lambda t: where(sin(t) > 0.5, 2, where(sin(t) < -0.5, -3, 0))},
    ),
    Row(
        "hysteresis",
        """
  C: hysteresis(on_at = 1 V, off_at = -1 V, lo = 0 A, hi = 4 A) u = 2 V*sin(1 rad/s*t)
""",
        8.0,
        {"C.y": lambda t: 4.0 * (((t > pi / 6) & (t < 7 * pi / 6)) | (t > 13 * pi / 6))},
    ),
    Row(
        "hysteresis",
        """
  C: hysteresis(on_at = 1 V, off_at = -1 V, lo = 0 A, hi = 4 A) u = 2 V*cos(1 rad/s*t)
""",
        8.0,
        {"C.y": lambda t: 4.0 * ((t < 2 * pi / 3) | ((t > 5 * pi / 3) & (t < 8 * pi / 3)))},
    ),
    Row(
        "hysteresis",
        """
  C: hysteresis(on_at = 1 V, off_at = -1 V, lo = 0 A, hi = 4 A, begins = 1) u = -2 V*cos(1 rad/s*t)
""",
        8.0,
        {"C.y": lambda t: 4.0 * (((t > 2 * pi / 3) & (t < 5 * pi / 3)) | (t > 8 * pi / 3))},
    ),
    Row(
        "sample_hold",
        """
  C: sample_hold(Ts = 0.1 s) u = 2 V*sin(1 rad/s*t)
""",
        1.25,
        {"C.y": lambda t: 2 * sin(0.1 * floor(t / 0.1 + 1e-9))},
    ),
    Row(
        "quantiser",
        """
  C: quantiser(q = 0.25 V, Ts = 0.1 s) u = 2 V*sin(1 rad/s*t)
""",
        1.25,
        {"C.y": lambda t: 0.25 * floor(2 * sin(0.1 * floor(t / 0.1 + 1e-9)) / 0.25 + 0.5)},
    ),
    Row(
        "sampled_pid",
        """
  C: sampled_pid(
    kp = 0.8 V/K, ki = 2 V/K/s, kd = 0.1 V.s/K, Ts = 0.1 s, lo = -4 V, hi = 4 V
  ) r = 302 K, y = 300.5 K + 0.5 K/s*t
""",
        1.25,
        {"C.u": sampled_pid},
    ),
)
