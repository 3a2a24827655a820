"""Models whose laws are inverted: against closed forms, and against themselves with the laws kept implicit."""

import functools

import numpy as np
import pytest
from model_runs import FOUR, trace_of
from scipy.integrate import solve_ivp
from scipy.special import lambertw
from sysdyn.compiler.network.primal import choices
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.load import document, network
from sysdyn.dsl.text.diagnostics import ModelError, Report, SourceText


def _text(parameters, nodes, elements, trace, end="1.5 s", declared=""):
    listed = "\n".join(f"  param {p}" for p in parameters)
    return f"""
{declared}
model m {{
{listed}
  node {nodes}
  {elements}
}}
scene go of m {{
  time 0 s to {end}
  accuracy 1e-9
  trace {trace} every 0.05 s
}}
"""


DIODE = ("VT = 25 mV", "Is = 1e-3 A", "R = 10 ohm", "C = 10 mF", "v0 = 0.1 V")
_PEAK = """
  supply: effort(e = 1 V*sin(5 rad/s*t)) a -> ground
  Rs: dissipator(e = R*f) a -> b
  D: dissipator({law}) b -> c
  cap: potential(q = C*e) c -> ground
  init cap.e = v0
"""
DIODE_E = _text(DIODE, "a, b, c: electrical", _PEAK.format(law="e = VT*ln(1 + f/Is)"), "cap.e as c, D.f as f")
DIODE_F = _text(DIODE, "a, b, c: electrical", _PEAK.format(law="f = Is*(exp(e/VT) - 1)"), "cap.e as c, D.f as f")

RELATIVISTIC = _text(
    ("m = 2 kg", "c = 3 m/s", "F = 6 N"),
    "x: translation",
    """
  push: effort(e = F) ground -> x
  body: kinetic(p = m*f/sqrt(1 - (f/c)^2)) x
  init body.p = 0 N.s
  init x.q = 0 m
""",
    "body.p as p, x.f as f, audit.kinetic as T",
)

SPRING = _text(
    ("m = 1 kg", "k = 2 m", "F = 1 N"),
    "x: translation",
    """
  push: effort(e = 3 N*sin(2 rad/s*t)) ground -> x
  body: kinetic(p = m*f) x
  spring: potential(q = k*give(e/F)) x -> ground
  rub: dissipator(e = (0.2 N.s/m)*f) x -> ground
  init spring.e = 0.5 N
  init x.f = 0 m/s
""",
    "spring.q as q, spring.e as e",
    declared="table give(x: 1) -> 1 linear extend [(-2, -3), (-1, -1), (1, 1), (2, 3)]",
)

INDUCTOR = _text(
    ("L0 = 0.5 H", "I0 = 0.2 A", "R = 2 ohm"),
    "a, b: electrical",
    """
  supply: effort(e = 4 V*sin(3 rad/s*t)) a -> ground
  Rs: dissipator(e = R*f) a -> b
  coil: kinetic(p = L0*I0*asinh(f/I0)) b -> ground
  init coil.f = 0 A
""",
    "coil.p as p, coil.f as f, audit.kinetic as T",
)

VALVE = _text(
    ("k = 5e-3 m^3/s", "C = 2e-3 m^3/kPa", "p0 = 5 kPa"),
    "a: hydraulic",
    """
  tank: potential(q = C*e) a -> ground
  valve: dissipator(f = k*sign(e)*sqrt(abs(e)/(1 kPa))) a -> ground
  init tank.e = p0
""",
    "tank.e as e, valve.f as f",
)

ORIFICE = _text(
    ("a = 2e3 kPa.s/m^3", "b = 3e6 kPa.s^2/m^6", "C = 1e-4 m^3/kPa"),
    "u, v: hydraulic",
    """
  pump: effort(e = 5 kPa*sin(4 rad/s*t)) u -> ground
  hole: dissipator(e = a*f + b*f*abs(f)) u -> v
  tank: potential(q = C*e) v -> ground
  init tank.e = 0 kPa
""",
    "tank.e as e, hole.f as f",
)

STORE = _text(
    ("Q0 = 2 mC", "V0 = 0.4 V", "R = 10 ohm"),
    "a, b: electrical",
    """
  supply: effort(e = 3 V*sin(9 rad/s*t)) a -> ground
  Rs: dissipator(e = R*f) a -> b
  cap: potential(q = Q0*sinh(e/V0)) b -> ground
  init cap.e = 0 V
""",
    "cap.q as q, cap.e as e, audit.potential as V",
)


def _compiled(text, formulation):
    report = Report()
    read = document(SourceText("m", text), report)
    net = network(read, read.models["m"], read.scenes["go"], report)
    assert net is not None, list(report)
    return compile_network(net, formulation, "numpy")


CASES = {
    "diode e(f)": (DIODE_E, FOUR[2:], "N602"),
    "relativistic": (RELATIVISTIC, FOUR[2:], "N602"),
    "table spring": (SPRING, FOUR[:2], "N603"),
    "inductor": (INDUCTOR, FOUR[2:], "N602"),
    "valve": (VALVE, FOUR[:2], "N602"),
    "orifice": (ORIFICE, FOUR[2:], "N602"),
    "store": (STORE, FOUR[:2], "N602"),
}
INVERTED = [(name, f) for name, (_, forms, _) in CASES.items() for f in forms]


@pytest.mark.parametrize(("name", "formulation"), INVERTED)
@pytest.mark.one_in(6)
def test_an_inverse_needs_fewer_unknowns(monkeypatch, name, formulation):
    text, _, code = CASES[name]
    found = _compiled(text, formulation)
    assert code in [d.code for d in found.notes]
    monkeypatch.setattr(choices, "inverse", lambda *_: None)
    implicit = _compiled(text, formulation)
    assert code not in [d.code for d in implicit.notes]
    sizes = [sum(f["kind"] != "audit" for f in c.structure()["families"]) for c in (found, implicit)]
    assert sizes[0] < sizes[1], sizes


def _reduced(rate, start, read):
    """Quantities over time from an ODE of one unknown."""
    t = np.linspace(0.0, 1.5, 31)
    y = solve_ivp(rate, (0.0, 1.5), [start], "Radau", t, rtol=1e-11, atol=1e-14).y[0]
    return read(t, y)


def _diode(t, c):
    """The diode's flow between sin(5 t) and c: u = 1 + f/Is solves ln(u) + 0.4 u = (sin(5 t) - c)/VT + 0.4."""
    return 1e-3 * (np.real(lambertw(0.4 * np.exp((np.sin(5 * t) - c) / 0.025 + 0.4))) / 0.4 - 1.0)


def _relativistic(t, p):
    root = np.sqrt(1 + (p / 6) ** 2)
    return {"p": p, "f": p / 2 / root, "T": 18 * (root - 1)}


def _hole(t, e):
    x = 5 * np.sin(4 * t) - e
    return 2 * x / (2e3 + np.sqrt(4e6 + 12e6 * np.abs(x)))


def _spring_rate(t, y):
    return [y[1], 3 * np.sin(2 * t) - np.interp(y[0] / 2, [-3, -1, 1, 3], [-2, -1, 1, 2]) - 0.2 * y[1]]


def _spring():
    """Both pieces of the table are reached."""
    t = np.linspace(0.0, 1.5, 31)
    q = solve_ivp(_spring_rate, (0.0, 1.5), [1.0, 0.0], "DOP853", t, rtol=1e-11, atol=1e-13, max_step=1e-3).y[0]
    return {"q": q, "e": np.interp(q / 2, [-3, -1, 1, 3], [-2, -1, 1, 2])}


@functools.cache
def _expected(name):
    t = np.linspace(0.0, 1.5, 31)
    match name:
        case "diode e(f)" | "diode f(e)":
            return _reduced(lambda t, c: _diode(t, c) / 1e-2, 0.1, lambda t, c: {"c": c, "f": _diode(t, c)})
        case "relativistic":
            return _relativistic(t, 6 * t)
        case "table spring":
            return _spring()
        case "inductor":
            return _reduced(
                lambda t, p: 4 * np.sin(3 * t) - 0.4 * np.sinh(10 * p),
                0.0,
                lambda t, p: {
                    "p": p,
                    "f": 0.2 * np.sinh(10 * p),
                    "T": 0.02 * (np.cosh(10 * p) - 1),
                },
            )
        case "valve":
            root = np.sqrt(5.0) - 1.25 * t  # C e' = -k sqrt(e), in kPa
            return {"e": 1e3 * root**2, "f": 5e-3 * root}
        case "orifice":
            return _reduced(lambda t, e: _hole(t, e) / 1e-4, 0.0, lambda t, e: {"e": 1e3 * e, "f": _hole(t, e)})
        case "store":
            return _reduced(
                lambda t, q: (3 * np.sin(9 * t) - 0.4 * np.arcsinh(q / 2e-3)) / 10,
                0.0,
                lambda t, q: {
                    "q": q,
                    "e": 0.4 * np.arcsinh(q / 2e-3),
                    "V": 8e-4 * (q / 2e-3 * np.arcsinh(q / 2e-3) - np.sqrt(1 + (q / 2e-3) ** 2) + 1),
                },
            )


def _near(trace, expected, within, said):
    events = np.isin(trace.time, [event.time for event in trace.events])  # their rows stand beside the grid
    for quantity, values in expected.items():
        error = np.abs(trace[quantity].values[~events] - values).max() / np.abs(values).max()
        assert error < within, (said, quantity, error)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("name", [n for n in CASES if n != "diode e(f)"])
@pytest.mark.long
def test_against_closed_forms(tmp_path, monkeypatch, name, formulation):
    """Inverted, and with the laws kept implicit."""
    text, forms, _ = CASES[name]
    expected = {q: x for q, x in _expected(name).items() if q not in "TV" or formulation in FOUR[:2]}
    _near(trace_of(tmp_path, text, formulation=formulation), expected, 2e-8, "inverted")
    if formulation in forms:
        monkeypatch.setattr(choices, "inverse", lambda *_: None)
        stored = {q: x for q, x in expected.items() if q not in "TV"}  # an implicit law's energy is counted as supplied
        _near(trace_of(tmp_path, text, formulation=formulation), stored, 2e-8, "implicit")


@pytest.mark.parametrize("text", [DIODE_F, DIODE_E], ids=["f(e)", "e(f)"])
@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_diode_in_both_directions(tmp_path, formulation, text):
    """Down to -1.7 V, where 1 + f/Is is 0 in doubles: the primal forms keep e implicit, closed by f(e) in both."""
    if formulation in FOUR[:2]:
        assert "N604" in [d.code for d in _compiled(text, formulation).notes]
    _near(trace_of(tmp_path, text, formulation=formulation), _expected("diode f(e)"), 2e-8, formulation)


@pytest.mark.parametrize(("text", "formulation"), [(DIODE_F, f) for f in FOUR[:3]] + [(DIODE_E, f) for f in FOUR[:3]])
@pytest.mark.long
def test_a_wild_guess_does_no_harm(tmp_path, text, formulation):
    """exp(1000/0.025) overflows."""
    text = text.replace("init cap.e = v0", "init cap.e = v0\n  init D.e ~ 1000 V")
    _near(trace_of(tmp_path, text, formulation=formulation), _expected("diode f(e)"), 2e-8, formulation)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"a": -2.0}, "the law of hole was compiled for a > 0, which is now -2"),
        ({"b": 0.0}, "the law of hole was compiled for b > 0, which is now 0"),
    ],
)
def test_a_binding_keeps_the_signs_that_prove(values, said):
    compiled = _compiled(ORIFICE, "co_lagrangian")
    compiled.bind({"a": 1.0, "b": 1e9})
    with pytest.raises(ModelError) as error:
        compiled.bind(values)
    assert [(d.code, d.message) for d in error.value.diagnostics] == [("E605", said)]


def test_a_sign_that_proves_nothing_keeps_the_law_implicit():
    text = ORIFICE.replace("b = 3e6", "b = -3e6").replace("b*f*abs(f)", "b*f*abs(f) + 2e9 kPa.s^3/m^9*f^3")
    notes = _compiled(text, "co_lagrangian").notes
    assert [(d.code, d.message) for d in notes if d.code == "N604"] == [("N604", "e(f) of hole stays implicit")]


ARRAY = _text(
    ("n = 3", "Q0[1..3] = [1 mC, 2 mC, 3 mC]", "V0 = 0.4 V", "a = 4 ohm", "b = 20 ohm/A"),
    "s, c[1..n]: electrical",
    """
  supply: effort(e = 3 V*sin(9 rad/s*t)) s -> ground
  for i in 1..n {
    hole[i]: dissipator(e = a*f + i*b*f*abs(f)) s -> c[i]
    cap[i]: potential(q = Q0[i]*sinh(e/V0)) c[i] -> ground
    init cap[i].e = 0 V
  }
""",
    "cap[1].q as q1, cap[3].q as q3, hole[2].f as f2",
)


@pytest.mark.long
def test_an_array_is_inverted_as_one(tmp_path):
    said = [d.message for d in _compiled(ARRAY, "lagrangian").notes if d.code == "N602"]
    assert said == ["the law of cap was inverted: e = asinh(q/Q0[i])*V0"]
    assert "N602" in [d.code for d in _compiled(ARRAY, "co_lagrangian").notes]
    traces = [trace_of(tmp_path, ARRAY, formulation=f) for f in FOUR]
    for name in ("q1", "q3", "f2"):
        scale = np.abs(traces[0][name].values).max()
        for trace in traces[1:]:
            assert trace[name].values == pytest.approx(traces[0][name].values, abs=1e-7 * scale), name


AXES = """
model axes {
  node a, d, d2, q, q2: electrical
  V: effort(e = 1 V) a -> ground
  Rd: dissipator(e = 1 ohm*f) a -> d
  Ld: kinetic(p = 1 H*f) d -> d2
  Rq: dissipator(e = 2 ohm*f) a -> q
  Lq: kinetic(p = 1 H*f) q -> q2
  G: gyrator(e1 = MODULUS*f2) d2 -> ground, q2 -> ground
  init Ld.f = 0 A
  init Lq.f = 0 A
}
scene run of axes { time 0 s to 3 s; accuracy 1e-7; trace Ld.f, Lq.f every 0.1 s }
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("zero", [0.0, 1.0])
@pytest.mark.long
def test_a_modulus_that_goes_through_zero(tmp_path, formulation, zero):
    """Speed voltages of two axes, zero at the start or at 1 s: the complementary forms have efforts that the modulus
    multiplies, and flows that nothing is divided for.  d' = 1 - d - r q, q' = 1 - 2 q + r d by quadrature.
    """
    text = AXES.replace("MODULUS", f"1 ohm*(t/(1 s) - {zero})")
    trace = trace_of(tmp_path, text, scene="run", formulation=formulation)

    def slopes(t, y):
        r = t - zero
        return [1.0 - y[0] - r * y[1], 1.0 - 2.0 * y[1] + r * y[0]]

    exact = solve_ivp(slopes, (0.0, 3.0), [0.0, 0.0], "DOP853", trace.time, rtol=1e-11, atol=1e-13).y
    for name, values in zip(("Ld.f", "Lq.f"), exact, strict=True):
        assert np.abs(trace[name].values - values).max() < 1e-7 * np.abs(values).max()


@pytest.mark.parametrize("law", ["f = on*e/R", "e = R/max(on, 1e-300)*f"])
@pytest.mark.long
def test_what_events_assign_decides_no_form(tmp_path, law):
    """A leak that is shut at the start, opens at 2 V and shuts at 20 ms: the law had been compiled as f = 0."""
    elements = f"""
  supply: effort(e = 5 V) s -> ground
  feed: dissipator(e = R*f) s -> a
  cap: potential(q = C*e) a -> ground
  leak: dissipator({law}) a -> ground
  discrete on = 0
  when a.e > 2 V {{ on := 1 }}
  when t > 20 ms {{ on := 0 }}
  init cap.e = 0 V
"""
    text = _text(("R = 1 kohm", "C = 10 uF"), "s, a: electrical", elements, "cap.e as c", "0.05 s").replace(
        "0.05 s\n}", "1 ms\n}"
    )
    for formulation in FOUR:
        trace = trace_of(tmp_path, text, formulation=formulation)
        t, tau, opens, shuts = trace.time, 0.01, 0.01 * np.log(5 / 3), 0.02
        open_ = 2.5 - 0.5 * np.exp(-2 * (np.clip(t, opens, shuts) - opens) / tau)
        c = np.where(t < opens, 5 * (1 - np.exp(-t / tau)), 5 - (5 - open_) * np.exp(-np.maximum(t - shuts, 0) / tau))
        assert np.abs(trace["c"] - c).max() < 5e-8, formulation
