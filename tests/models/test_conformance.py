"""Models that the language's page allows and nobody wrote before: right by closed forms, or refused.

Each case: a claim of the page, a text, quantities with what they are at t (s), formulations that can express it.
"""

from functools import cache
from math import cos, exp, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn.api import check, simulate
from sysdyn.cli.main import run
from sysdyn.cli.run.start import starting
from sysdyn.runtime.model.failures import InconsistentStart

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
@pytest.mark.one_in(10)
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


def driven(friction, more=""):
    return (
        f"model fr {{ node x: translation; param c = -3 N\n M: kinetic(p = 2 kg*f) x\n {friction}\n"
        f" init M.f = 3 m/s {more}}}\nscene s of fr {{ time 0 s to 2 s; trace x.f }}\n"
    )


@pytest.mark.parametrize("friction", ["R: dissipator(e = c*setsign(f)) x", "content D = c*abs(x.f)"])
def test_negative_dry_friction_is_no_dissipator(friction):
    (found,) = [d for d in check(driven(friction)) if d.severity == "error"]
    assert (found.code, found.place.start[0]) == ("E313", 3)
    assert "c = -3 N" in found.message
    assert "abs(c)" in found.help


def test_negative_dry_friction_is_refused_of_other_numbers(tmp_path):
    file = tmp_path / "m.sd"
    file.write_text(driven("R: dissipator(e = c*setsign(f)) x").replace("-3 N", "3 N"))
    with pytest.raises(Exception, match="E313"):
        simulate(file, output=tmp_path / "m.h5", set={"c": -3})


@pytest.mark.parametrize(
    ("friction", "pushed", "formulation"),
    [
        ("R: dissipator(e = (4 N - 8 N/s*t)*setsign(f)) x", "", "lagrangian"),
        ("R: dissipator(e = (4 N - 8 N/s*t)*setsign(f)) x", "; W: effort(e = 30 N) ground -> x", "hamiltonian"),
        ("R: dissipator(e = (4 N - 8 N/s*t)*setsign(f)) x", "; W: effort(e = 30 N) ground -> x", "co_lagrangian"),
        ("content D = (4 N - 8 N/s*t)*abs(x.f)", "; W: effort(e = 30 N) ground -> x", "lagrangian"),
        ("content D = (4 N - 8 N/s*t)*abs(x.f)", "", "co_hamiltonian"),
    ],
)
@pytest.mark.one_in(3)
def test_dry_friction_ends_the_run_where_it_would_drive(tmp_path, friction, pushed, formulation):
    file = tmp_path / "m.sd"
    file.write_text(driven(friction, pushed))
    with pytest.raises(Exception, match=r"drives at t = 0\.5\d* s") as raised:
        simulate(file, output=tmp_path / "m.h5", formulation=formulation)
    assert raised.value.cause == "drives"


LIFTED = """
model fr {
  coord x, y: translation = 0 m
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2)
  phi floor: y >= 0 m
  R: dissipator(e = 0.3*floor.multiplier*setsign(f)) on x
  work 30 N/s*t - (2 kg)*g0 on y
  init x' = 10 m/s
}
scene s of fr { time 0 s to 1 s; trace x', floor.multiplier as N }
"""


@pytest.mark.parametrize("formulation", PRIMAL)
def test_a_bound_ends_with_the_reaction_that_tells_it(tmp_path, formulation):
    """The floor lets go at t1 = m g0/(30 N/s); until then x'' = -0.3 N/m."""
    file, t1 = tmp_path / "m.sd", 2 * 9.80665 / 30
    file.write_text(LIFTED)
    trace = simulate(file, output=tmp_path / "m.h5", formulation=formulation, accuracy=1e-7)
    wanted = [10 - 0.15 * (30 * t1 * s - 15 * s**2) for s in np.minimum(trace.time, t1)]
    assert np.abs(np.array(trace["x'"]) - wanted).max() < 1e-6
    (warned,) = [d for d in check(LIFTED) if d.severity == "warning"]
    assert (warned.code, warned.place.start[0]) == ("W705", 6)


# -- refused ----------------------------------------------------------------------------------------------------

RATCHET = """model z {{
  node a, b: rotation
  A: kinetic(p = 1 kg.m^2*f) a
  B: kinetic(p = 2 kg.m^2*f) b
  C: dissipator(e = 1 N.m*setsign(f)) a
  R: ratchet() a -> b
  init A.f = -1 rad/s
  {0}
}}
component ratchet {{ branch: rotation; psi one_way: f >= 0 rad/s }}
"""
REFUSED = {
    "a product in parentheses is no unit": (
        "model a {\n let x = 30 N/(m.s^2)*3\n}\n",
        ("E101", 2, "'m'", "30 N/m/s^2: a unit has no parentheses: '.' multiplies, '/' divides the next factor only"),
    ),
    "nor with a space in it": ("model a {\n let x = 30 W/(m K)\n}\n", ("E113", 2, "no parentheses", "'30 W/m/K'")),
    "nor behind a colon": ("model a {\n param x: N.m/(rad/s)\n}\n", ("E113", 2, "no parentheses", "'N.m.s/rad'")),
    "ground has no value": (
        "model a { node x: electrical\n R: dissipator(e = 1 ohm*f) x\n S: effort(e = 1 V) x\n"
        " let u = x.e - ground.e }\n",
        ("E104", 4, "'ground' is not a value", "0: its"),
    ),
    "a branch is no node": (
        "component k { branch el: electrical\n R: dissipator(e = 1 ohm*f) el }\n"
        "model m { node a: electrical\n K: k() el = a -> ground\n S: effort(e = 1 V) a }\n",
        ("E407", 2, "'el' is no node", "on el.q"),
    ),
    "kelvins take no prefix": ("model m { let a = 3 mK }\n", ("E201", 1, "'mK'", "1e-3 K")),
    "what divides behind a unit is a variable": (
        "model z { param n = 3\n param c = 4 kJ/K/n }\n",
        ("E201", 2, "'n' is not a unit, in '4 kJ/K/n'", "'4 kJ/K / n'"),
    ),
    "unit variables that disagree": (
        "component c { param k: $u\n input u: $u\n output y = u + k }\nmodel z { K: c(k = 3 A) u = 3 V }\n",
        ("E209", 4, "is A by 'k' and V by 'u'", ""),
    ),
    "a level does not replace one pair of ends by two": (
        "component A { port a, b: electrical\n level grob default { R1: dissipator(e = 1 ohm*f) a -> b }\n"
        " level fein extends grob { R1: transformer(e1 = 3*e2) a -> b, b -> a } }\n"
        "model z { node n: electrical\n i: A() a = n, b = ground\n S: effort(e = 1 V) n }\n",
        ("E808", 3, "'R1'", "a new label"),
    ),
    "a traced quotient by zero": (
        "model z { param n = 0 kg\n param p = 2 N.s\n let x = p/n }\nscene s of z { time 0 s to 1 s; trace x }\n",
        ("E324", 4, "p/n, n = 0 kg", ""),
    ),
    "a bound is a whole number": (
        "model a {\n coord y[1..2.5]: translation = 0 m\n}\n",
        ("E805", 2, "a bound is 2.5", "an index within the bounds"),
    ),
    "a file of rows that is not there": (
        'table f(x: m) -> N linear file "nope.csv"\nmodel a { let y = f(1 m) }\n',
        ("E206", 1, "'nope.csv' cannot be read", "rows of numbers"),
    ),
    "a text is no value": ('model a {\n let y = "abc"\n}\n', ("E203", 2, "a text stands", "a number")),
    "what is fixed is named as it is written": (
        "model z {\n node a: electrical\n I: flow(f = 1 A) ground -> a\n L: kinetic(p = 1 H*f) a\n init L.f = 0 A\n}\n",
        ("E903", 3, "fixed initial values of 'L.f'", "free 'L.f'"),
    ),
    "an impact at the start": (
        "model z {\n coord h: translation = 0 m\n energy T* = 1/2*(1 kg)*h'^2\n phi floor: h >= 0 m\n"
        " init h' = -2 m/s\n}\n",
        ("E903", 4, "contradict floor", "the rate behind the impact"),
    ),
    "an input that is a condition": (
        "component s { port a: electrical\n input g: 1\n R: dissipator(e = (if g > 0.5 then 1 ohm else 2 ohm)*f) a }\n"
        "model z {\n node a: electrical\n S: s(g = t > 1 s) a = a\n C: potential(e = 1 V/C*q) a\n}\n",
        ("E203", 3, "'g' is a condition", "(if t > 1 s then 1 else 0)"),
    ),
    "a source whose ends are one": (
        "from std.electrical import voltage\nmodel z {\n node a: electrical\n V: voltage(v = 1 V) ground -> ground\n"
        " R: dissipator(e = 1 ohm*f) a\n C: potential(e = 1 V/C*q) a\n}\n",
        ("E411", 4, "both ends of the effort source V are one node", ""),
    ),
    "a value for an element": (
        "component c { port a: electrical\n param k: V/C\n C: potential(e = k*q) a }\nmodel z {\n node a: electrical\n"
        " K: c(k = 1 V/C) a = a\n R: dissipator(e = 1 ohm*f) a\n}\n"
        "scene s of z { time 0 s to 1 s; set K = 3 V/C; trace a.e }\n",
        ("E910", 9, "'K' is not a parameter", "set K.k = ..."),
    ),
    "a ratchet that begins backwards, beside friction": (
        RATCHET.format("init b.f = 0 rad/s"),
        ("E903", 10, "fixed initial values of 'A.f', 'b.f' contradict R", "free one of"),
    ),
    "ground is declared once": ("model z {\n node ground: electrical\n}\n", ("E108", 2, "'ground'", "")),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_slip_is_told_once_with_its_remedy(name):
    text, (code, line, said, remedy) = REFUSED[name]
    (found,) = [d for d in check(text) if d.severity == "error"]
    assert (found.code, found.place.start[0]) == (code, line)
    assert said in found.message
    assert remedy in (found.help or "")


def test_sets_that_ask_for_each_other_are_told_with_their_remedy(monkeypatch):
    """Where no point between them is found either (events/start.py)."""

    def asked(*_, **__):
        raise InconsistentStart("stuck", float("inf"), names=("R.one_way",))

    monkeypatch.setattr(starting, "eventful_start", asked)
    (found,) = [d for d in check(RATCHET.format("")) if d.severity == "error"]
    assert (found.code, found.place.start[0]) == ("E903", 10)
    assert "would let go at once, and hold" in found.message
    assert "initial values of all that it ties" in found.help


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
def test_what_is_unsaid_behind_a_ratchet_begins_where_it_lets_go(tmp_path, formulation):
    """B is taken along to -1 rad/s at least, and not held there: the friction on A brakes it by 1 rad/s^2."""
    scene = "scene s of z { time 0 s to 0.5 s; trace A.f, B.f every 0.1 s }"
    (tmp_path / "z.sd").write_text(RATCHET.format("") + scene)
    trace = simulate(tmp_path / "z.sd", output=tmp_path / "t.h5", formulation=formulation)
    assert np.abs(trace["A.f"].values - (trace.time - 1.0)).max() < 1e-9
    assert np.abs(trace["B.f"].values + 1.0).max() < 1e-12


ENDLESS = "model z {{\n state x: 1 = 0\n dynamic x' = {rate}\n let y = {read}\n}}\n"
ENDLESS += "scene s of z {{ time 0 s to 1 s; trace y }}\n"
TABLE = "table k(x: 1) -> N pchip stop [ (0, 1), (0.5, 2), (0.75, 0) ]\n"


@pytest.mark.parametrize(
    ("text", "code", "since"),
    [
        (ENDLESS.format(rate="0 Hz", read="1/x"), "E920", 0.0),
        (TABLE + ENDLESS.format(rate="1 Hz", read="k(x)"), "E932", 0.75),
    ],
)
def test_no_run_is_met_whose_trace_is_no_number(tmp_path, capsys, text, code, since):
    file = tmp_path / "m.sd"
    file.write_text(text)
    assert run(["simulate", str(file), "-o", str(tmp_path / "m.h5")]) == 3
    said = capsys.readouterr().err
    assert code in said
    assert float(said.partition("t = ")[2].split()[0]) == pytest.approx(since, abs=0.01)
