"""The extremes: small models whose motion is known by other means, pushed to the ends of what doubles can hold.

A `Family` is a text of the language with its parameters open, and what its traced quantities are at any instants: in
closed form, by mpmath, or by SciPy in variables in which nothing is small.  `families()` lists them, each with its
cases: settings, options, what the case is about.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import mpmath
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import erf

Values = dict[str, float]
POWERS = tuple(range(-15, 16, 3))


@dataclass(frozen=True)
class Case:
    """One run.  x: where it stands on the axis of its family's figure; values: of parameters."""

    name: str
    x: float
    values: Values
    until: float
    options: dict[str, object] = field(default_factory=dict)
    accuracy: float = 1e-4


@dataclass(frozen=True)
class Family:
    """wanted(t, values) -> traced name -> values at instants t [n]; {until} of the text is filled in for each case."""

    name: str
    axis: str
    text: str
    wanted: Callable[[np.ndarray, Values], dict[str, np.ndarray]]
    cases: tuple[Case, ...]


def ode(rate, start, t, method="DOP853", atol=1e-14, rtol=1e-12):
    found = solve_ivp(rate, (t[0], t[-1]), start, method=method, t_eval=t, rtol=rtol, atol=atol)
    assert found.success, found.message
    return found.y


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
    for unit, change in scaled.items():
        cases = []
        for k in POWERS:
            values, until = change(10.0**k)
            for formulation in ("lagrangian", "hamiltonian"):
                cases.append(Case(f"{unit} 1e{k} {formulation}", k, values, until, {"formulation": formulation}))
        yield Family(f"oscillator, unit of {unit}", "lg of the factor", OSCILLATOR, damped, tuple(cases))
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


CART = """model cart {
  param M = 1 kg
  param m = 1 kg
  param l = 1 m
  coord X: translation = 0 m
  coord x: translation = 0.6 m
  coord y: translation ~ -0.8 m
  energy T* = 1/2*M*X'^2 + 1/2*m*(x'^2 + y'^2)
  work -9.81 N/kg*m on y
  phi rod: (x - X)^2 + y^2 = l^2
  init X' = 0 m/s
  init x' = 0 m/s
}
scene run of cart { time 0 s to 1 s; trace X, x, y }
"""


def carted(t, p):
    other = p["m"] / (p["M"] + p["m"])  # of the bob in the whole mass

    def rate(_, s):
        # relative angle th, from the Lagrangian of th alone: horizontal momentum is zero
        th, om = s
        inertia = p["M"] / (p["M"] + p["m"]) + other * np.sin(th) ** 2
        return [om, (-9.81 * np.sin(th) - other * om**2 * np.sin(th) * np.cos(th)) / inertia]

    th = ode(rate, [np.arcsin(0.6), 0.0], t)[0]
    cart = other * (0.6 - np.sin(th))  # the centre of mass is at rest
    return {"X": cart, "x": cart + np.sin(th), "y": -np.cos(th)}


def couplings() -> Iterator[Family]:
    cases = tuple(
        Case(f"ratio 1e{k} {f}", k, {"r": 10.0**k, "k": 4.0}, 6.0 * max(1.0, 10.0**k), {"formulation": f})
        for k in range(-9, 10, 2)
        for f in ("lagrangian", "hamiltonian")
    )
    yield Family("lever", "lg of the ratio", LEVER, levered, cases)
    cases = tuple(
        Case(f"cart 1e{k} {f}", k, {"M": 10.0**k, "m": 1.0, "l": 1.0}, 3.0, {"formulation": f})
        for k in (-8, -6, -4, -2, 0, 3, 6, 9, 12, 15)
        for f in ("lagrangian", "hamiltonian")
    )
    yield Family("pendulum on a cart", "lg of the cart's mass", CART, carted, cases)


# --- pendulums: units, the top, starts off the manifold, redundant rods -------------------------------------------

PENDULUM = """model pendulum {
  param m = 1 kg
  param l = 1 m
  param g = 9.81 m/s^2
  param x_0 = 0.6 m
  param y_0 = -0.8 m
  coord x: translation = x_0
  coord y: translation ~ y_0
  energy T* = 1/2*m*(x'^2 + y'^2)
  work -m*g on y
  phi rod: x^2 + y^2 = l^2
  MORE
  init x' = 0 m/s
}
scene run of pendulum { time 0 s to 1 s; trace x, y; redundancy minimum_norm }
"""


def swung(t, p):
    """From rest at (x_0, +-): the angle from the vertical, in whose variable nothing is small."""
    w = p["g"] / p["l"]
    above = p["y_0"] > 0.0
    th0 = np.arcsin(p["x_0"] / p["l"])
    scale = 1.0 / np.sqrt(w)
    sign = 1.0 if above else -1.0
    th = ode(lambda _, s: [s[1], sign * np.sin(s[0])], [th0, 0.0], t / scale, atol=1e-14 * min(1.0, abs(th0)))[0]
    return {"x": p["l"] * np.sin(th), "y": sign * p["l"] * np.cos(th)}


def elliptic(t, p):
    """From rest, without gravity's small numbers: sin(th/2) = k cd, cos(th/2) = k' nd, to 30 digits."""
    with mpmath.workdps(30):
        k = mpmath.sin(mpmath.asin(mpmath.mpf(p["x_0"]) / p["l"]) / 2)
        w = mpmath.sqrt(mpmath.mpf(p["g"]) / p["l"])
        half = [k * mpmath.ellipfun("cd", w * s, k=k) for s in map(mpmath.mpf, map(float, t))]
        x = [2 * s * mpmath.sqrt(1 - s * s) * p["l"] for s in half]
        return {"x": np.array([float(v) for v in x]), "y": np.array([float(-p["l"] * (1 - 2 * s * s)) for s in half])}


def pendulums() -> Iterator[Family]:
    plain, base = PENDULUM.replace("MORE", ""), {"m": 1.0, "l": 1.0, "g": 9.81, "x_0": 0.6, "y_0": -0.8}
    scaled = {
        "mass": lambda s: (dict(base, m=s), 3.0),
        "length": lambda s: (dict(base, l=s, g=9.81 * s, x_0=0.6 * s, y_0=-0.8 * s), 3.0),
        "time": lambda s: (dict(base, g=9.81 / s**2), 3.0 * s),
    }
    for unit, change in scaled.items():
        cases = []
        for k in POWERS:
            values, until = change(10.0**k)
            for formulation in ("lagrangian", "hamiltonian"):
                cases.append(Case(f"{unit} 1e{k} {formulation}", k, values, until, {"formulation": formulation}))
        yield Family(f"pendulum, unit of {unit}", "lg of the factor", plain, swung, tuple(cases))
    top = tuple(
        Case(f"1e-{k} rad from the top, {method}", -k, dict(base, x_0=10.0**-k, y_0=1.0),
             (np.log(10.0) * k + 3.0) / np.sqrt(9.81), {"method": method})
        for k in range(1, 13)
        for method in ("auto", "bdf", "radau")
    )  # fmt: skip
    yield Family("pendulum near its top", "lg of the angle", plain, swung, top)
    off = tuple(
        Case(f"guess off by 1e-{k} {f}", -k, dict(base, y_0=-0.8 + 10.0**-k), 3.0, {"formulation": f})
        for k in range(1, 13)
        for f in ("lagrangian", "hamiltonian")
    )
    yield Family("pendulum, start off its circle", "lg of the distance", plain, swung, off)
    again = PENDULUM.replace("MORE", "phi again: (x^2 + y^2)/l = l\n  phi third: l*(x^2 + y^2) = l^3")
    twice = tuple(
        Case(f"{policy} {method} {f}", k, base, 3.0, {"redundancy": policy, "method": method, "formulation": f})
        for k, policy in enumerate(("drop", "minimum_norm"))
        for method in ("bdf", "radau", "auto")
        for f in ("lagrangian", "hamiltonian")
    )
    yield Family("pendulum, its rod stated three times", "policy", again, swung, twice)
    tolerances = tuple(
        Case(f"accuracy 1e-{k} {method}", -k, base, 3.0, {"method": method}, 10.0**-k)
        for k in range(1, 14)
        for method in ("auto", "bdf")
    )
    yield Family("pendulum, accuracies", "lg of the accuracy", plain, elliptic, tolerances)
    level = tuple(
        Case(f"through the horizontal, {method}, index {index}", k, dict(base, x_0=1.0, y_0=0.0), 3.0,
             {"method": method, "index": index})
        for k, (method, index) in enumerate(
            (m, i) for m in ("bdf", "radau") for i in ("2", "3", "2v", "1")
        )
    )  # fmt: skip

    def dropped(t, p):
        th = ode(lambda _, s: [s[1], -9.81 * np.sin(s[0])], [np.pi / 2, 0.0], t)[0]
        return {"x": np.sin(th), "y": -np.cos(th)}

    yield Family("pendulum from the horizontal", "method and index", plain, dropped, level)


# --- singular positions -------------------------------------------------------------------------------------------

CRANK = """model crank {
  param m1 = 1 kg
  param m2 = 0.8 kg
  param r = 1 m
  coord th: rotation = 0.7853981633974483 rad
  coord x: translation ~ 2*r*cos(0.7853981633974483)
  energy T* = 1/2*m1*r^2*th'^2 + 1/2*m2*x'^2
  phi conrod: x^2 - 2*r*x*cos(th) + r^2 = r^2
  init th' = 2 rad/s
}
scene run of crank { time 0 s to 1 s; trace th, x }
"""


def cranked(t, p):
    def inertia(th):
        return p["m1"] + 4.0 * p["m2"] * np.sin(th) ** 2

    twice = inertia(np.pi / 4) * 4.0
    th = ode(lambda _, s: np.sqrt(twice / inertia(s)), [np.pi / 4], t)[0]
    return {"th": th, "x": 2.0 * p["r"] * np.cos(th)}


def singular() -> Iterator[Family]:
    cases = tuple(
        Case(f"r = l, {method} {f}", k, {"m1": 1.0, "m2": 0.8, "r": 1.0}, 3.0, {"method": method, "formulation": f})
        for k, method in enumerate(("bdf", "radau", "dopri", "auto"))
        for f in ("lagrangian", "hamiltonian")
    )
    yield Family("slider-crank with r = l", "method", CRANK, cranked, cases)


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


def families() -> tuple[Family, ...]:
    """All of them."""
    return (*oscillators(), *ratios(), *couplings(), *pendulums(), *singular(), *steep(), *others())
