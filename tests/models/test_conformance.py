"""Models that the language's page allows and nobody wrote before: right by closed forms.

Each case: a claim of the page, a text, quantities with what they are at t (s), formulations that can express it.
"""

from functools import cache
from math import cos, exp, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn.api import simulate

PRIMAL = ("lagrangian", "hamiltonian")
FOUR = (*PRIMAL, "co_lagrangian", "co_hamiltonian")
FIVE = (*FOUR, "kane")
EACH = ("lagrangian", "co_hamiltonian")
"""One of each family."""
EXACT, CLOSE = 1e-9, 1e-5
"""Of the greatest value: where the motion is made of straight pieces, and of curves at an accuracy of 1e-7."""


def solved(rates, start, end, **read):
    """Quantities of an ordinary differential equation, by another solver, which runs when one of them is asked for."""

    @cache
    def sol():
        return solve_ivp(rates, (0, end), start, dense_output=True, rtol=1e-11, atol=1e-14, method="DOP853").sol

    return {name: (lambda t, of=of: of(t, sol()(t))) for name, of in read.items()}


def oscillating(t):
    """A mass of 2 kg on a spring of 8 N/m with dry friction of 3 N, from 2 m at rest."""
    turns = ((1.625, 0.375), (0.875, -0.375), (0.125, 0.375))
    k = int(t // (np.pi / 2))
    return turns[k][0] * cos(2 * t) + turns[k][1] if k < 3 else 0.25


def charged(charge, held=1e-5, drop=800e3, law=lambda q: q / 1e-5):
    """A memristor in series with a coil and a capacitor."""
    return solved(
        lambda t, y: [4 * sin(900 * t) - (90 + drop * y[2]) * y[0] / 2e-3 - law(y[1]), y[0] / 2e-3, y[0] / 2e-3],
        [0.2 * 2e-3, held, charge],
        5e-3,
        **{"Lx.f": lambda t, y: y[0] / 2e-3, "c.e": lambda t, y: law(y[1]), "R.q": lambda t, y: y[2]},
    )


MEMRISTOR = """
model nl {{
  node a, b, c: electrical
  S: effort(e = 4 V*sin(900 Hz*t)) a -> ground
  R: dissipator(e = {ohm}*f) a -> b
  Lx: kinetic(p = 2 mH*f) b -> c
  Cx: potential({store}) c -> ground
  init Lx.f = 0.2 A
  {said}
}}
scene s of nl {{ time 0 s to 5 ms; trace Lx.f, c.e, R.q; expect always: abs(audit.energy) <= 1e-7 J }}
"""
LINEAR, CUBIC = "q = 10 uF*e", "e = q/(10 uF) + (q/(20 uC))^3*(1 V)"
OHM, MEM = "90 ohm", "(90 ohm + 800 kohm/C*q)"
ONE_VOLT = 9.067953030328076e-06
"""C in the cubic store at 1 V: 1e5 q + (q/2e-5)^3 = 1."""


def cubic(q):
    return q / 1e-5 + (q / 2e-5) ** 3


def memristor(ohm=MEM, store=LINEAR, said=""):
    return MEMRISTOR.format(ohm=ohm, store=store, said=said)


FRICTION = """
component rub {{ param c: N; branch: translation; content D = c*abs(f) }}
model b {{
  node x: translation
  M: kinetic(p = 2 kg*f) x
  {friction}
  K: potential(e = 8 N/m*q) x -> ground
  init K.q = 2 m
  init M.f = 0 m/s
}}
scene s of b {{ time 0 s to 8 s; trace K.q }}
"""


def signs(states, traced):
    return f"model e {{\n{states}\n}}\nscene s of e {{ time 0 s to 1 s; trace {traced} every 10 ms }}\n"


CASES = {
    # sign(0) = 0: also where the argument stays there, whatever round-off says (section 2)
    "sign of a speed at rest": (
        signs(
            "coord x: translation = 0 m; coord y: translation = 1 m; energy T* = 1/2*(1 kg)*(x'^2 + y'^2)\n"
            "work 2 N*sign(x') on y; init x' = 0 m/s; init y' = 1 m/s",
            "x, y, sign(x') as s",
        ),
        {"x": lambda t: 0, "y": lambda t: 1 + t, "s": lambda t: 0},
        (*PRIMAL, "kane"),
        EXACT,
    ),
    "sign of a current of nothing": (
        signs(
            "node a: electrical; S: effort(e = 0 V) a; R: dissipator(e = 1 ohm*f) a\n"
            "state z: 1 = 1; dynamic z' = sign(R.f)*1 Hz",
            "z, sign(R.e) as s",
        ),
        {"z": lambda t: 1, "s": lambda t: 0},
        EACH,
        EXACT,
    ),
    "sign, step and relations of a state that leaves zero": (
        signs(
            "state z: 1 = 0; state u: 1 = 0; state v: 1 = 0; state w: V = 0 V\n"
            "dynamic w' = (if t < 0.5 s then 0 V/s else 1 V/s)\n"
            "dynamic z' = 2 Hz*sign(w) - 1 Hz*sign(-w); dynamic u' = step(w)*1 Hz + step(-w)*2 Hz\n"
            "dynamic v' = (if w > 0 V then 1 Hz else 0 Hz) + (if w >= 0 V then 2 Hz else 0 Hz)",
            "z, u, v",
        ),
        {
            "z": lambda t: 3 * max(0, t - 0.5),
            "u": lambda t: min(3 * t, 1.5 + (t - 0.5)),
            "v": lambda t: max(2 * t, 1 + 3 * (t - 0.5)),
        },
        PRIMAL,
        EXACT,
    ),
    "sign of what an event sets to zero": (
        signs(
            "state w: V = 1 V; state z: 1 = 0; dynamic w' = 0 V/s; dynamic z' = sign(w)*1 Hz\n"
            "when t >= 0.25 s { w := 0 V }",
            "z",
        ),
        {"z": lambda t: min(t, 0.25)},
        PRIMAL,
        EXACT,
    ),
    # decision 7, and the row 'dissipator' of section 4: content and law are one
    **{
        f"dry friction by {name}": (FRICTION.format(friction=said), {"K.q": oscillating}, FOUR, 1e-6)
        for name, said in {
            "its law": "R: dissipator(e = 3 N*setsign(f)) x",
            "the content of a component": "R: rub(c = 3 N) x",
            "the content of a node": "content D = 3 N*abs(x.f)",
        }.items()
    },
    "dry friction between two nodes": (
        """
model b {
  node x, y: translation
  M: kinetic(p = 2 kg*f) x
  N: kinetic(p = 1 kg*f) y
  F: effort(e = 9 N) ground -> y
  content D = 3 N*abs(x.f - y.f) + 1/2*(0.5 N.s/m)*y.f^2
  init M.f = 0 m/s
  init N.f = 1 m/s
}
scene s of b { time 0 s to 2 s; trace x.f, y.f }
""",
        solved(lambda t, y: [1.5, 6 - 0.5 * y[1]], [0, 1], 2, **{"x.f": lambda t, y: y[0], "y.f": lambda t, y: y[1]}),
        EACH,
        CLOSE,
    ),
    "dry friction of an array": (
        """
model b {
  node x[1..3]: translation
  for i in 1..3 {
    M[i]: kinetic(p = i*1 kg*f) x[i]
    content D = i*1 N*abs(x[i].f)
    K[i]: potential(e = 4 N/m*i*q) x[i] -> ground
    init x[i].f = 0 m/s
    init K[i].q = i*0.3 m
  }
}
scene s of b { time 0 s to 1 s; trace K[1].q, K[3].q }
""",
        {"K[1].q": lambda t: 0.05 * cos(2 * t) + 0.25, "K[3].q": lambda t: 0.65 * cos(2 * t) + 0.25},
        EACH,
        CLOSE,
    ),
    # decision 11: a constant for each tangible branch of a series class
    "a memristor begins at nothing": (memristor(said="init Cx.e = 1 V"), charged(0), PRIMAL, CLOSE),
    "a memristor begins where it is said": (
        memristor(said="init Cx.e = 1 V; init R.q = 40 uC"),
        charged(4e-5),
        (*PRIMAL, "kane"),
        CLOSE,
    ),
    "a memristor beside a store of which nothing is said": (
        memristor(said="init R.q = 40 uC"),
        charged(4e-5, 0),
        PRIMAL[:1],
        CLOSE,
    ),
    "a memristor beside a store whose voltage no formula turns into a charge": (
        memristor(store=CUBIC, said="init Cx.e = 1 V; init R.q = 40 uC"),
        charged(4e-5, ONE_VOLT, law=cubic),
        PRIMAL[1:],
        CLOSE,
    ),
    "a traced charge is the integral of its current": (
        memristor(OHM, CUBIC, "init c.e = 1 V"),
        charged(0, ONE_VOLT, 0, cubic),
        FIVE,
        CLOSE,
    ),
    # section 5, initial values: where nothing is said, each position is a guess of zero, in both families
    "a group of points that an init stretches": (
        """
model k {
  node a, b: translation
  F: effort(e = 3 N*sin(2 rad/s*t)) ground -> a
  K: potential(e = 5 N/m*q) a -> b
  D: dissipator(e = 2 N.s/m*f) b -> ground
  M: kinetic(p = 1 kg*f) a
  init K.q = 0.4 m
  init M.f = 1 m/s
}
scene s of k { time 0 s to 3 s; trace a.q, D.q, D.p }
""",
        solved(
            lambda t, y: [3 * sin(2 * t) - 5 * y[1], y[0] - 5 * y[1] / 2, 5 * y[1] / 2, 5 * y[1]],
            [1, 0.4, -0.2, 0],
            3,
            **{"a.q": lambda t, y: y[1] + y[2], "D.q": lambda t, y: y[2], "D.p": lambda t, y: y[3]},
        ),
        EACH,
        CLOSE,
    ),
    # members of nodes (sections 5, 6): rates in the complementary forms
    "the acceleration of a point": (
        "model b { node x: translation; M: kinetic(p = 2 kg*f) x; K: potential(e = 8 N/m*q) x -> ground\n"
        "init K.q = 2 m; init M.f = 0 m/s }\n"
        "scene s of b { time 0 s to 1 s; trace x.f' as a, x.q'' as b }\n",
        {"a": lambda t: -8 * cos(2 * t), "b": lambda t: -8 * cos(2 * t)},
        FIVE,
        CLOSE,
    ),
    # section 3: two-ended ports, inputs across levels of components, modulated gyrators
    "a modulated gyrator two components deep": (
        """
component erreger { input k: V.s/rad; branch el: electrical; branch me: rotation
  G: gyrator(e1 = k*f2) on el.q, on me.q
  lossless }
component schale { input kk: V.s/rad; port a: electrical; port w: rotation
  inner: erreger() el = a -> ground, me = w -> ground, k = kk
  output z = inner.G.f1 }
model mo {
  node quelle, a: electrical
  node welle: rotation
  input mod: V.s/rad
  S: effort(e = 10 V) quelle
  R: dissipator(e = 4 ohm*f) quelle -> a
  X: schale() a = a, w = welle, kk = mod
  J: kinetic(p = 1 kg.m^2*f) welle
  D: dissipator(e = 0.3 N.m.s/rad*f) welle
  init J.f = 0 rad/s
}
scene s of mo {
  time 0 s to 4 s
  set mod = 1 V.s/rad*(1 + 0.5*sin(2 rad/s*t))
  trace welle.f, X.z
}
""",
        solved(
            lambda t, y: [(1 + 0.5 * sin(2 * t)) * (10 - (1 + 0.5 * sin(2 * t)) * y[0]) / 4 - 0.3 * y[0]],
            [0],
            4,
            **{"welle.f": lambda t, y: y[0], "X.z": lambda t, y: (10 - (1 + 0.5 * sin(2 * t)) * y[0]) / 4},
        ),
        FIVE,
        CLOSE,
    ),
    "a domain of one's own with a ledger of its own": (
        """
domain money { effort price: 1; flow goods: mol/s; displacement stock: mol; node common effort; ground "free"
  pseudo: mol/s }
model shop { node here: money; S: potential(e = q/(4 mol)) here; D: dissipator(f = e*0.5 mol/s) here
  init S.q = 8 mol }
scene s of shop { time 0 s to 20 s; trace S.q, here.e as p }
""",
        {"S.q": lambda t: 8 * exp(-t / 8), "p": lambda t: 2 * exp(-t / 8)},
        EACH,
        CLOSE,
    ),
    "levels replace a label and what it touches": (
        """
component dipol { param R = 3 ohm; port a, b: electrical
  level grob default { node m: electrical
    W: dissipator(e = R*f) a -> m
    L: kinetic(p = 1 mH*f) m -> b }
  level fein extends grob { W: dissipator(e = 2*R*f) m -> a
    init L.f = 1 A }
  output i = L.f }
model z { node n: electrical; S: effort(e = 12 V) n; X: dipol() a = n, b = ground
  Y: dipol.fein(R = 1 ohm) a = n, b = ground }
scene s of z { time 0 s to 2 ms; level X = fein; trace X.i as x, Y.i as y }
""",
        {"x": lambda t: 2 - exp(-6000 * t), "y": lambda t: 6 - 5 * exp(-2000 * t)},
        EACH,
        CLOSE,
    ),
    "contents over two ports, whose losses are in the ledger": (
        """
component wet { branch a: rotation; branch b: rotation
  content D = 1/4*(0.02 N.m.s^3)*(a.f^2 + b.f^2 + a.f*b.f)^2 }
component leak { branch a: electrical; branch b: electrical
  content G = 1/2*(3 ohm^-1)*(a.e^2 + b.e^2) + (1 ohm^-1)*a.e*b.e }
model w { node x, y: rotation; node u, v: electrical
  J: kinetic(p = 0.1 kg.m^2*f) x; K: kinetic(p = 0.3 kg.m^2*f) y
  B: wet() a = x -> ground, b = y -> ground
  C: potential(q = 1 F*e) u; D: potential(q = 2 F*e) v
  L: leak() a = u -> ground, b = v -> ground
  init x.f = 3 rad/s; init y.f = -2 rad/s; init C.e = 3 V; init D.e = -2 V }
scene s of w { time 0 s to 1 s; trace x.f, y.f, u.e, v.e; expect always: abs(audit.energy) <= 1e-5 J }
""",
        solved(
            lambda t, y: [
                -0.1 * (y[0] ** 2 + y[1] ** 2 + y[0] * y[1]) * (2 * y[0] + y[1]),
                -0.1 / 3 * (y[0] ** 2 + y[1] ** 2 + y[0] * y[1]) * (2 * y[1] + y[0]),
                -3 * y[2] - y[3],
                -(3 * y[3] + y[2]) / 2,
            ],
            [3, -2, 3, -2],
            1,
            **{name: (lambda t, y, k=k: y[k]) for k, name in enumerate(("x.f", "y.f", "u.e", "v.e"))},
        ),
        EACH,
        CLOSE,
    ),
    "a rheonomic constraint, its effort and its supply": (
        """
model w { coord r: translation = 0.3 m; coord φ: rotation = 0 rad
  energy T* = 1/2*(0.7 kg)*(r'^2 + r^2*φ'^2)
  work 2 N on r^2/(1 m)
  phi spin: φ = 3 rad/s*t
  init r' = 0 m/s }
scene s of w { time 0 s to 0.5 s; trace r, spin.on(φ) as M; expect always: abs(audit.energy) <= 1e-6 J }
""",
        {
            "r": lambda t: 0.3 * np.cosh(t * sqrt(9 + 4 / 0.7)),
            "M": lambda t: 0.7 * 3 * 0.3**2 * sqrt(9 + 4 / 0.7) * np.sinh(2 * t * sqrt(9 + 4 / 0.7)),
        },
        PRIMAL,
        CLOSE,
    ),
}


@pytest.mark.parametrize(
    ("name", "formulation"), [(name, form) for name, (_, _, forms, _) in CASES.items() for form in forms]
)
@pytest.mark.long
def test_a_model_is_what_its_text_says(tmp_path, name, formulation):
    text, closed, _, within = CASES[name]
    file = tmp_path / "m.sd"
    file.write_text(text)
    trace = simulate(file, output=tmp_path / "m.h5", formulation=formulation, accuracy=1e-7)
    for quantity, of in closed.items():
        wanted = np.array([of(t) for t in np.array(trace.time)], dtype=float)
        off = np.abs(np.array(trace[quantity]) - wanted).max() / (np.abs(wanted).max() or 1.0)
        assert off <= within, (quantity, off)


# -- dry friction that would drive ----------------------------------------------------------------------------
