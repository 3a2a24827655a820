"""Extremes of laws: steep, growing, decaying, far from zero, with kinks, in events."""

from collections.abc import Iterator

import numpy as np
from case import Case, Family
from scipy.optimize import brentq
from scipy.special import erf

# --- steep and stiff laws -----------------------------------------------------------------------------------------

STIFF = """model follower {
  param s = 1 Hz
  state y: 1 = 1
  dynamic y' = -s*(y - cos(1 rad/s*t)) - 1 Hz*sin(1 rad/s*t)
}
scene run of follower { time 0 s to 1 s; trace y }
"""

DIODE = """from std.electrical import voltage, resistor, diode
model ramp {
  param E = 1 V
  node s, a: electrical
  V: voltage(v = E*t/(1 s)) s -> ground
  r: resistor(R = 100 ohm) s -> a
  D: diode(Is = 1e-14 A, vT = 0.02585 V) a -> ground
}
scene run of ramp { time 0 s to 1 s; trace D.e as v, D.f as i }
"""

RELATIVE = """model fast {
  param c = 1 m/s
  param F = 1 N
  node x: translation = 0 m
  body: kinetic(f = p/(1 kg*sqrt(1 + (p/(1 kg*c))^2))) x
  push: effort(e = F) ground -> x
  init body.p = 0 N.s
}
scene run of fast { time 0 s to 1 s; trace x.q as x, body.p as p, x.f as v }
"""

GROWTH = """model growth {
  param a = 1
  state y: 1 = a
  dynamic y' = 1 Hz*y*(1 - y)
}
scene run of growth { time 0 s to 1 s; trace y }
"""


def ramped(t, p):
    i = []
    for s in t:
        e = p["E"] * s
        balance = lambda u, e=e: 100.0 * np.exp(u) + 0.02585 * np.log1p(np.exp(u) / 1e-14) - e  # noqa: E731
        i.append(np.exp(brentq(balance, -800.0, 30.0, xtol=1e-15, rtol=1e-15)) if e > 0.0 else 0.0)
    i = np.array(i)
    return {"v": 0.02585 * np.log1p(i / 1e-14), "i": i}


def relative(t, p):
    a = p["F"] * t / p["c"]
    return {
        "x": p["c"] ** 2 / p["F"] * a**2 / (1.0 + np.sqrt(1.0 + a**2)),
        "p": p["F"] * t,
        "v": p["F"] * t / np.sqrt(1.0 + a**2),
    }


def steep() -> Iterator[Family]:
    cases = tuple(
        Case(f"1e{k} 1/s, {method}", k, {"s": 10.0**k}, 10.0, {"method": method})
        for k in range(13)
        for method in ("auto", "bdf", "radau")
    )
    yield Family("stiff follower", "lg of the rate", STIFF, lambda t, p: {"y": np.cos(t)}, cases)
    cases = tuple(
        Case(f"1e{k} thermal voltages, {f}", k, {"E": 0.02585 * 10.0**k}, 1.0, {"formulation": f})
        for k in range(7)
        for f in ("lagrangian", "co_lagrangian")
    )
    yield Family("diode on a ramp", "lg of the voltage", DIODE, ramped, cases)
    cases = tuple(
        Case(f"F t/(m c) = 1e{k}, {f}", k, {"F": 10.0**k, "c": 1.0}, 1.0, {"formulation": f})
        for k in range(-8, 9, 2)
        for f in ("lagrangian", "hamiltonian")
    )
    yield Family("relativistic limit", "lg of F t/(m c)", RELATIVE, relative, cases)

    def logistic(t, p):
        return {"y": p["a"] / (p["a"] + (1.0 - p["a"]) * np.exp(-t))}

    cases = tuple(
        Case(f"from 1e-{k}, {method}", -k, {"a": 10.0**-k}, np.log(10.0) * k + 5.0, {"method": method})
        for k in range(2, 13, 2)
        for method in ("auto", "bdf", "radau")
    )
    yield Family("growth", "lg of the start", GROWTH, logistic, cases)


# --- spans, cancellation, kinks, sources --------------------------------------------------------------------------

DECAY = """model decay {
  param s = 1 Hz
  state y: 1 = 1
  dynamic y' = -s*y
}
scene run of decay { time 0 s to 1 s; trace y }
"""

FAR = """model far {
  param d = 1 m
  coord x: translation = d + 1 m
  energy T* = 1/2*1 kg*x'^2
  energy V = 1/2*4 N/m*(x - d)^2
  init x' = 0 m/s
}
scene run of far { time 0 s to 1 s; trace x - d as y }
"""

KINK = """model kink {
  param F = 1 N
  coord x: translation = 1 m
  energy T* = 1/2*1 kg*x'^2
  energy V = F*abs(x)
  init x' = 0 m/s
}
scene run of kink { time 0 s to 1 s; trace x }
"""

STROBE = """model strobe {
  param f = 50 Hz
  state y: 1 = 0
  dynamic y' = 20 Hz*(sin(2*pi*f*t) - y)
}
scene run of strobe { time 0 s to 1 s; trace y every 1 s/50 }
"""


def bounced(t, p):
    """Parabolas between +-1, period 4 sqrt(2/F)."""
    quarter = np.sqrt(2.0 / p["F"])
    phase = np.mod(t, 4.0 * quarter)
    sign = np.where(phase < quarter, 1.0, np.where(phase < 3.0 * quarter, -1.0, 1.0))
    middle = np.where(phase < quarter, 0.0, np.where(phase < 3.0 * quarter, 2.0 * quarter, 4.0 * quarter))
    near = phase - middle
    return {"x": sign * (1.0 - 0.5 * p["F"] * near**2)}


PUSHED = """model pushed {
  param at = 1 s
  param w = 1 s
  coord x: translation = 0 m
  energy T* = 1/2*2 kg*x'^2
  work 3 N*exp(-((t - at)/w)^2) on x
  init x' = 0 m/s
}
scene run of pushed { time 0 s to 10 s; trace x' as v }
"""


def pushed(t, p):
    w, at = p["w"], p["at"]
    return {"v": 3.0 * w * np.sqrt(np.pi) / 4.0 * (erf((t - at) / w) - erf(-at / w))}


def strobed(t, p):
    w, a = 2.0 * np.pi * p["f"], 20.0
    return {"y": a / (a * a + w * w) * (a * np.sin(w * t) - w * np.cos(w * t) + w * np.exp(-a * t))}


def others() -> Iterator[Family]:
    def decayed(t, p):
        return {"y": np.exp(-p["s"] * t)}

    spans = tuple(
        Case(f"span 1e{k} s, rate {r:g} over it, {m}", k, {"s": r * 10.0**-k}, 10.0**k, {"method": m})
        for k in range(-9, 10, 3)
        for r in (1e-9, 5.0, 1e9)
        for m in ("auto", "bdf")
    )
    yield Family("decay, spans", "lg of the span", DECAY, decayed, spans)
    cases = tuple(Case(f"1e{k} m away", k, {"d": 10.0**k}, 6.0) for k in range(0, 16, 2))
    yield Family("cancellation", "lg of the distance", FAR, lambda t, p: {"y": np.cos(2.0 * t)}, cases)
    cases = tuple(
        Case(f"accuracy {a:g} {m}", np.log10(a), {"F": 1.0}, 20.0, {"method": m}, a)
        for a in (1e-2, 1e-4, 1e-6)
        for m in ("auto", "bdf", "radau")
    )
    yield Family("a kink in the force", "lg of the accuracy", KINK, bounced, cases)
    cases = tuple(
        Case(f"1e{k} of the span, {m}", k, {"at": 7.3141592, "w": 10.0 * 10.0**k}, 10.0, {"method": m}, 1e-3)
        for k in (-7, -6, -5, -4, -3, -2)
        for m in ("auto", "bdf", "radau")
    )
    yield Family("a pulse in a long span", "lg of its part", PUSHED, pushed, cases)
    cases = tuple(Case(f"{m}", k, {"f": 50.0}, 1.0, {"method": m}) for k, m in enumerate(("auto", "bdf", "radau")))
    yield Family("a source sampled at its own period", "method", STROBE, strobed, cases)
