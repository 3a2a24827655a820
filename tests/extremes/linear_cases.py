"""Extremes of linear systems: oscillators, chains, ladders, coils, levers, and their closed forms."""

from collections.abc import Iterator

import mpmath
import numpy as np
from case import POWERS, Case, Family, in_units


def linear(matrix, start, t):
    """States [n, states] of y' = A y at instants, by mpmath at 60 digits."""
    with mpmath.workdps(60):
        a, y0 = mpmath.matrix(matrix), mpmath.matrix(start)
        return np.array([[float(v) for v in mpmath.expm(a * mpmath.mpf(float(s))) * y0] for s in t])


# --- oscillator: rescaled units, tolerances, nearly zero masses ---------------------------------------------------

OSCILLATOR = """model oscillator {
  param m = 1 kg
  param b = 0.2 N.s/m
  param k = 4 N/m
  param a = 1 m
  coord x: translation = a
  energy T* = 1/2*m*x'^2
  energy V = 1/2*k*x^2
  content D = 1/2*b*x'^2
  init x' = 0 m/s
}
scene run of oscillator { time 0 s to 1 s; trace x, x' as v }
"""


def damped(t, p):
    """Of m x'' + b x' + k x = 0 from (a, 0); m may be zero."""
    m, b, k, a = (mpmath.mpf(p[n]) for n in "mbka")
    with mpmath.workdps(60):
        if m == 0:
            found = [(a * mpmath.exp(-k / b * s), -k / b * a * mpmath.exp(-k / b * s)) for s in map(mpmath.mpf, t)]
        else:
            root = mpmath.sqrt(mpmath.mpc(b * b / (4 * m * m) - k / m))
            one, two = -b / (2 * m) + root, -b / (2 * m) - root
            c = a * two / (two - one)
            terms = [((c, one), (a - c, two)) for _ in t]
            found = [
                (mpmath.re(sum(w * mpmath.exp(r * s) for w, r in pair)),
                 mpmath.re(sum(w * r * mpmath.exp(r * s) for w, r in pair)))
                for s, pair in zip(map(mpmath.mpf, t), terms, strict=True)
            ]  # fmt: skip
    return {"x": np.array([float(x) for x, _ in found]), "v": np.array([float(v) for _, v in found])}


def oscillators() -> Iterator[Family]:
    base = {"m": 1.0, "b": 0.2, "k": 4.0, "a": 1.0}
    scaled = {
        "mass": lambda s: (dict(base, m=s, b=0.2 * s, k=4.0 * s), 6.0),
        "length": lambda s: (dict(base, a=s), 6.0),
        "time": lambda s: (dict(base, b=0.2 / s, k=4.0 / s**2), 6.0 * s),
    }
    yield from in_units("oscillator", OSCILLATOR, damped, scaled)
    tolerances = tuple(
        Case(f"accuracy 1e-{k} {method}", -k, base, 6.0, {"method": method}, 10.0**-k)
        for k in range(1, 14)
        for method in ("auto", "bdf")
    )
    yield Family("oscillator, accuracies", "lg of the accuracy", OSCILLATOR, damped, tolerances)
    light = tuple(
        Case(f"mass {m:g} {method}", np.log10(m) if m else -20.0, dict(base, b=1.0, m=m), 2.0, {"method": method})
        for m in (0.0, *(10.0**-k for k in range(1, 17, 2)))
        for method in ("bdf", "radau")
    )

    def position(t, p):
        return {"x": damped(t, p)["x"]}

    text = OSCILLATOR.replace("init x' = 0 m/s", "init x' ~ 0 m/s").replace(", x' as v", "")
    yield Family("oscillator, nearly no mass", "lg of the mass", text, position, light)
    long = tuple(
        Case(f"1e4 periods {method} {formulation}", k, dict(base, b=0.0), 2e4 * np.pi / 2,
             {"method": method, "formulation": formulation}, 1e-3)
        for k, method in enumerate(("bdf", "radau", "dopri"))
        for formulation in ("lagrangian", "hamiltonian")
    )  # fmt: skip

    def undamped(t, p):
        w = np.sqrt(p["k"] / p["m"])
        return {"x": p["a"] * np.cos(w * t), "v": -p["a"] * w * np.sin(w * t)}

    yield Family("oscillator, 1e4 periods", "method", OSCILLATOR, undamped, long)


# --- two masses and two capacitors of any ratio -------------------------------------------------------------------

CHAIN = """model chain {
  param m1 = 1 kg
  param m2 = 1 kg
  param k1 = 1 N/m
  param k2 = 1 N/m
  param b = 1 N.s/m
  coord x, y: translation = 1 m
  energy T* = 1/2*m1*x'^2 + 1/2*m2*y'^2
  energy V = 1/2*k1*x^2 + 1/2*k2*(y - x)^2
  content D = 1/2*b*(y' - x')^2
  init x' = 0 m/s
  init y' = 0 m/s
}
scene run of chain { time 0 s to 1 s; trace x, y }
"""


def chained(t, p):
    m1, m2, k1, k2, b = (mpmath.mpf(p[n]) for n in ("m1", "m2", "k1", "k2", "b"))
    rows = [[0, 0, 1, 0], [0, 0, 0, 1], [-(k1 + k2) / m1, k2 / m1, -b / m1, b / m1]]
    rows.append([k2 / m2, -k2 / m2, b / m2, -b / m2])
    y = linear(rows, [1, 1, 0, 0], t)
    return {"x": y[:, 0], "y": y[:, 1]}


LADDER = """from std.electrical import voltage, resistor, capacitor
model ladder {
  param R1 = 1 ohm
  param R2 = 1 ohm
  param C1 = 1 F
  param C2 = 1 F
  node s, a, c: electrical
  V: voltage(v = 1 V) s -> ground
  r1: resistor(R = R1) s -> a
  c1: capacitor(C = C1) a -> ground
  r2: resistor(R = R2) a -> c
  c2: capacitor(C = C2) c -> ground
  init c1.e = 0 V
  init c2.e = 0 V
}
scene run of ladder { time 0 s to 1 s; trace c1.e as u, c2.e as w }
"""


def laddered(t, p):
    r1, r2, c1, c2 = (mpmath.mpf(p[n]) for n in ("R1", "R2", "C1", "C2"))
    rows = [[-(1 / r1 + 1 / r2) / c1, 1 / (r2 * c1), 1 / (r1 * c1)], [1 / (r2 * c2), -1 / (r2 * c2), 0], [0, 0, 0]]
    y = linear(rows, [0, 0, 1], t)
    return {"u": y[:, 0], "w": y[:, 1]}


COILS = """from std.electrical import voltage, resistor, inductor
model coils {
  param L1 = 1 H
  param L2 = 1 H
  node s, a, c: electrical
  V: voltage(v = 1 V) s -> ground
  r1: resistor(R = 1 ohm) s -> a
  l1: inductor(L = L1) a -> ground
  r2: resistor(R = 1 ohm) a -> c
  l2: inductor(L = L2) c -> ground
  init l1.f = 0 A
  init l2.f = 0 A
}
scene run of coils { time 0 s to 1 s; trace l1.f as i, l2.f as j }
"""


def coiled(t, p):
    l1, l2 = mpmath.mpf(p["L1"]), mpmath.mpf(p["L2"])
    y = linear([[-1 / l1, -1 / l1, 1 / l1], [-1 / l2, -2 / l2, 1 / l2], [0, 0, 0]], [0, 0, 1], t)
    return {"i": y[:, 0], "j": y[:, 1]}


def ratios() -> Iterator[Family]:
    ones = {"m1": 1.0, "m2": 1.0, "k1": 1.0, "k2": 1.0, "b": 1.0}
    for name, what in (("m2", "masses"), ("k2", "stiffnesses")):
        cases = tuple(
            Case(f"{name} 1e{k} {method}", k, dict(ones, **{name: 10.0**k}), 5.0, {"method": method})
            for k in POWERS
            for method in ("auto", "bdf")
        )
        yield Family(f"two masses, ratio of {what}", "lg of the ratio", CHAIN, chained, cases)
    ones = {"R1": 1.0, "R2": 1.0, "C1": 1.0, "C2": 1.0}
    for name, what in (("C2", "capacities"), ("R2", "resistances")):
        cases = tuple(
            Case(f"{name} 1e{k} {formulation}", k, dict(ones, **{name: 10.0**k}), 5.0, {"formulation": formulation})
            for k in POWERS
            for formulation in ("lagrangian", "co_lagrangian")
        )
        yield Family(f"two capacitors, ratio of {what}", "lg of the ratio", LADDER, laddered, cases)
    cases = tuple(
        Case(f"L2 1e{k} {formulation}", k, {"L1": 1.0, "L2": 10.0**k}, 5.0, {"formulation": formulation})
        for k in POWERS
        for formulation in ("lagrangian", "co_lagrangian")
    )
    yield Family("two coils, ratio of inductances", "lg of the ratio", COILS, coiled, cases)


# --- a coupling ratio, a rod between unlike masses ----------------------------------------------------------------

LEVER = """model lever {
  param r = 1
  param k = 4 N/m
  coord x: translation = 1 m
  coord y: translation ~ r*1 m
  energy T* = 1/2*1 kg*x'^2 + 1/2*1 kg*y'^2
  energy V = 1/2*k*x^2
  phi arm: y = r*x
  init x' = 0 m/s
}
scene run of lever { time 0 s to 1 s; trace x, y }
"""


def levered(t, p):
    x = np.cos(np.sqrt(p["k"] / (1.0 + p["r"] ** 2)) * t)
    return {"x": x, "y": p["r"] * x}
