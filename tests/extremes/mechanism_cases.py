"""Extremes of mechanisms: a cart and its pendulum, couplings, a pendulum by elliptic functions, a crank."""

from collections.abc import Iterator

import mpmath
import numpy as np
from case import Case, Family, in_units
from linear_cases import LEVER, levered
from scipy.integrate import solve_ivp


def ode(rate, start, t, method="DOP853", atol=1e-14, rtol=1e-12):
    found = solve_ivp(rate, (t[0], t[-1]), start, method=method, t_eval=t, rtol=rtol, atol=atol)
    assert found.success, found.message
    return found.y


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
    yield from in_units("pendulum", plain, swung, scaled)
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
