"""Members of stores, dissipators, coordinates and nodes: integrals of their laws from zero, in every formulation."""

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of
from scipy.integrate import quad

CIRCUITS = {
    "kinetic": ("K: potential(q = 0.8 F*e) a", "init K.e = 1.3 V"),
    "potential": ("M: kinetic(p = 0.6 H*f) a", "init M.f = 0.7 A"),
    "dissipator": ("K: potential(q = 0.8 F*e) a\n  M: kinetic(p = 0.6 H*f) a", "init K.e = 1.3 V\n  init M.f = 0.7 A"),
}
OWN = {"kinetic": ("T", "Tstar", "p", "f"), "potential": ("V", "Vstar", "q", "e"), "dissipator": ("D", "G", "f", "e")}
UNITS = {"e": "V", "f": "A", "q": "C", "p": "Wb"}
LAWS = {  # edge, side, law in the language, the same in Python, start
    "linear inductor": ("kinetic", "p", "1.7 H*f", lambda f: 1.7 * f, 0.9),
    "saturating inductor": ("kinetic", "p", "2 Wb*tanh(f/(1.5 A))", lambda f: 2 * np.tanh(f / 1.5), 1.1),
    "hardening inductor": ("kinetic", "p", "1 H*f + 0.3 H/A^2*f^3", lambda f: f + 0.3 * f**3, -1.2),
    "relativistic": ("kinetic", "p", "2 H*f/sqrt(1 - (f/(3 A))^2)", lambda f: 2 * f / np.sqrt(1 - f**2 / 9), 2.2),
    "inductor f(p)": ("kinetic", "f", "0.5 A*sinh(p/(0.8 Wb))", lambda p: 0.5 * np.sinh(p / 0.8), 0.9),
    "linear f(p)": ("kinetic", "f", "p/(3 H)", lambda p: p / 3, -1.4),
    "cubic spring": ("potential", "e", "2 V/C*q + 1.1 V/C^3*q^3", lambda q: 2 * q + 1.1 * q**3, 1.2),
    "square spring": ("potential", "e", "1.5 V/C^2*q*abs(q)", lambda q: 1.5 * q * abs(q), -0.9),
    "exponential": ("potential", "e", "2 V*(exp(q/(0.9 C)) - 1)", lambda q: 2 * (np.exp(q / 0.9) - 1), 0.8),
    "offset": ("potential", "e", "1.1 V/C*(q - 0.4 C)", lambda q: 1.1 * (q - 0.4), 1.5),
    "varactor": ("potential", "q", "1 F*e + 0.2 F/V^2*e^3", lambda e: e + 0.2 * e**3, 1.4),
    "linear q(e)": ("potential", "q", "0.7 F*e", lambda e: 0.7 * e, -2.0),
    "sinh q(e)": ("potential", "q", "0.6 C*sinh(e/(1.2 V))", lambda e: 0.6 * np.sinh(e / 1.2), 1.0),
    "resistor": ("dissipator", "e", "2.5 ohm*f", lambda f: 2.5 * f, None),
    "valve": ("dissipator", "e", "1.2 ohm*f + 3 ohm/A*f*abs(f)", lambda f: 1.2 * f + 3 * f * abs(f), None),
    "conductor": ("dissipator", "f", "0.3 S*e + 0.1 S/V^2*e^3", lambda e: 0.3 * e + 0.1 * e**3, None),
    "diode": ("dissipator", "f", "0.1 A*(exp(e/(0.7 V)) - 1)", lambda e: 0.1 * (np.exp(e / 0.7) - 1), None),
}


def integral(law, x):
    return quad(law, 0.0, x, epsabs=1e-13, epsrel=1e-12)[0]


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.long
def test_state_functions_are_integrals_of_the_law(tmp_path, name, formulation):
    edge, side, text, law, start = LAWS[name]
    given = {"kinetic": "pf", "potential": "qe", "dissipator": "ef"}[edge].replace(side, "")
    rest, begins = CIRCUITS[edge]
    own = "" if start is None else f"init S.{given} = {start} {UNITS[given]}"
    functions = OWN[edge]
    audit = {"kinetic": ", audit.kinetic as held", "potential": ", audit.potential as held"}.get(edge, "")
    model = f"""
model m {{
  node a: electrical
  S: {edge}({side} = {text}) a
  R: dissipator(f = 0.2 S*e) a
  {rest}
  {begins}
  {own}
}}
scene s of m {{
  time 0 s to 1 s
  accuracy 1e-7
  trace S.{functions[0]} as one, S.{functions[1]} as other, S.{given} as x, S.{side} as y{audit} every 0.1 s
}}
"""
    trace = trace_of(tmp_path, model, formulation=formulation, backend="numpy")
    x, y, one, other = (trace[n].values for n in ("x", "y", "one", "other"))
    scale = np.abs(x * y).max()
    assert scale > 0.05
    area = np.array([integral(law, v) for v in x])
    # of p, q and f are T, V and D; what the law is not written in is the Legendre transform
    wanted = (area, x * y - area) if functions[2] == given else (x * y - area, area)
    np.testing.assert_allclose(one, wanted[0], atol=2e-6 * scale)
    np.testing.assert_allclose(other, wanted[1], atol=2e-6 * scale)
    if audit:
        np.testing.assert_allclose(trace["held"].values, one, atol=2e-6 * scale)


BOTH = """
model m {
  node a, b: electrical
  L1: kinetic(p = 2.5 H*f) a -> b
  L2: kinetic(f = p/(1.5 H)) a -> b
  C1: potential(q = 0.4 F*e) a
  C2: potential(q = 0.9 F*e) b
  init L1.f = 1.2 A
  init L2.f = -0.7 A
  init C1.e = 2 V
  init C2.e = 1 V
}
scene s of m {
  time 0 s to 1 s
  accuracy 1e-7
  trace L1.T, L1.Tstar, L2.T, L2.Tstar, L1.f, L2.f, audit.kinetic as held every 0.1 s
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_stores_of_a_loop_hold_what_they_start_with(tmp_path, formulation):
    """Inductors in parallel with different flux linkages: their energy is that of each, not of the node's momentum."""
    trace = trace_of(tmp_path, BOTH, formulation=formulation, backend="numpy")
    for name, inductance in (("L1", 2.5), ("L2", 1.5)):
        wanted = inductance * trace[f"{name}.f"].values ** 2 / 2
        for member in ("T", "Tstar"):
            np.testing.assert_allclose(trace[f"{name}.{member}"].values, wanted, atol=1e-6)
    assert trace["held"].values[0] == pytest.approx(2.5 * 1.2**2 / 2 + 1.5 * 0.7**2 / 2, rel=1e-6)


TABLE = """
table pull(x: m) -> N linear extend [ (0, 0), (1, 3), (2, 4) ]
model m {
  node x: translation = 1.5 m
  M: kinetic(p = 2 kg*f) x
  K: potential(e = pull(q)) x
  init x.f = 0 m/s
}
scene s of m {
  time 0 s to 1 s
  accuracy 1e-7
  trace K.V, K.Vstar, K.energy, K.e*K.q as product every 0.1 s
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_without_a_closed_form_it_is_the_integral_of_the_power(tmp_path, formulation):
    trace = trace_of(tmp_path, TABLE, formulation=formulation, backend="numpy")
    np.testing.assert_allclose(trace["K.V"].values, trace["K.energy"].values, atol=1e-7)
    np.testing.assert_allclose(trace["K.V"].values + trace["K.Vstar"].values, trace["product"].values, atol=1e-9)
    assert trace["K.V"].values[0] == 0.0
    assert trace["K.V"].values[-1] < -0.5


def test_a_content_without_a_closed_form_is_refused(tmp_path):
    text = TABLE.replace("K: potential(e = pull(q)) x", "K: dissipator(e = 2 N.s/m*f*atan(f/(1 m/s))^2) x")
    text = text.replace("K.V, K.Vstar, K.energy, K.e*K.q as product", "K.D")
    ran, report = attempt(tmp_path, text)
    assert ran is None
    assert "E102" in [d.code for d in report]


POINT = """
model m {
  param m = 1.3 kg
  node x, y: translation
  M: kinetic(p = m*f) x
  N: kinetic(f = p/(0.4 kg)) x
  P: kinetic(p = 2 kg*f) y
  K: potential(e = 7 N/m*q) x -> y
  D: dissipator(e = 0.5 N.s/m*f) y
  init x.f = 0.6 m/s
  init y.f = -0.2 m/s
  init x.q = 0.3 m
  init y.q = 0 m
}
scene s of m {
  time 0 s to 1 s
  accuracy 1e-7
  trace x.p, x.e, y.p, y.e, K.e, D.e, x.f, y.f every 0.1 s
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_momentum_and_effort_of_a_point(tmp_path, formulation):
    """p = dT*/df of what moves with it, p' = e."""
    trace = trace_of(tmp_path, POINT, formulation=formulation, backend="numpy")
    values = {name: trace[name].values for name in ("x.p", "x.e", "y.p", "y.e", "K.e", "D.e", "x.f", "y.f")}
    np.testing.assert_allclose(values["x.p"], 1.7 * values["x.f"], atol=1e-6)
    np.testing.assert_allclose(values["x.e"], -values["K.e"], atol=1e-5)
    np.testing.assert_allclose(values["y.p"], 2 * values["y.f"], atol=1e-6)
    np.testing.assert_allclose(values["y.e"], values["K.e"] - values["D.e"], atol=1e-5)


COORDINATE = """
model m {
  STYLE u: electrical = 0.4 UNIT
  energy CO = 1/2*(1.5 J)*(u.RATE/(1 RUNIT))^2
  energy STORE = 1/2*(6 J)*(u/(1 UNIT))^2
  init u.RATE = 0.9 RUNIT
}
scene s of m {
  time 0 s to 1 s
  accuracy 1e-7
  trace u.e, u.f, u.p, u.q every 0.1 s
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_all_four_variables_of_a_coordinate(tmp_path, formulation):
    words = {"STYLE": "coord", "RUNIT": "A", "RATE": "f", "CO": "T*", "STORE": "V", "UNIT": "C"}
    if formulation.startswith("co_"):
        words = {"STYLE": "cocoord", "RUNIT": "V", "RATE": "e", "CO": "V*", "STORE": "T", "UNIT": "Wb"}
    text = COORDINATE
    for word, means in words.items():
        text = text.replace(word, means)
    trace = trace_of(tmp_path, text, formulation=formulation, backend="numpy")
    e, f, p, q = (trace[f"u.{letter}"].values for letter in "efpq")
    w = 2.0
    t = trace.time
    x = 0.4 * np.cos(w * t) + 0.9 / w * np.sin(w * t)
    v = 0.9 * np.cos(w * t) - 0.4 * w * np.sin(w * t)
    own, rate, held, other = (p, e, q, f) if formulation.startswith("co_") else (q, f, p, e)
    np.testing.assert_allclose(own, x, atol=1e-6)
    np.testing.assert_allclose(rate, v, atol=1e-6)
    np.testing.assert_allclose(held, 1.5 * v, atol=1e-6)
    np.testing.assert_allclose(other, -6 * x, atol=1e-5)


CELLS = """from std.electrical import resistor, capacitor, voltage
component stage {
  port a, b: electrical
  param k = 1
  node m: electrical
  r: resistor(R = 1 kohm) a -> m
  c: capacitor(C = 1 uF) m -> ground
  let charge = c.q
  leak: flow(f = 1e-4 A/V*c.e*k) m -> ground
  out_: resistor(R = 100 ohm) m -> b
}
component cell {
  port a, b: electrical
  node m[0..2]: electrical
  for i in 1..2 {
    s[i]: stage(k = 0.5*i) a = m[i - 1], b = m[i]
    init s[i].c.e = 0.1 V*i
  }
  let total = s[1].charge + s[2].c.q
  in_: resistor(R = 1 ohm) a -> m[0]
  out_: resistor(R = 1 ohm) m[2] -> b
  output seen = s[2].c.e
}
model chain {
  node v[0..3]: electrical
  S: voltage(v = 1 V) v[0] -> ground
  x[1]: cell() a = v[0], b = v[1]
  for k in 2..3 { x[k]: cell() a = v[k - 1], b = v[k] }
  load: resistor(R = 10 kohm) v[3] -> ground
  let whole = x[1].total + sum(k in 2..3: x[k].total)
}
scene run of chain {
  time 0 s to 10 ms
  trace x[1..3].s[1..2].c.e as u, x[3].seen as seen, x[1].total as total, whole every 1 ms
  accuracy 1e-7
}
"""


def stages():
    """Conductances [6, 6] between the capacitors of all cells, currents of the source into them (A), first voltages."""
    edges, places = [], {}
    for cell in (1, 2, 3):
        edges.append((f"v{cell - 1}", f"{cell}m0", 1.0))
        for i in (1, 2):
            places[f"{cell}s{i}"] = (0.5e-4 * i, 0.1 * i)
            edges += [(f"{cell}m{i - 1}", f"{cell}s{i}", 1e3), (f"{cell}s{i}", f"{cell}m{i}", 100.0)]
        edges.append((f"{cell}m2", f"v{cell}", 1.0))
    edges.append(("v3", "ground", 1e4))
    known = ("v0", "ground")
    names = [*places, *sorted({end for edge in edges for end in edge[:2]} - {*places, *known})]
    at = {name: k for k, name in enumerate(names)}
    matrix, given = np.zeros((len(names), len(names))), np.zeros(len(names))
    for a, b, ohm in edges:
        for here, there in ((a, b), (b, a)):
            if here not in known:
                matrix[at[here], at[here]] += 1 / ohm
                if there == "v0":
                    given[at[here]] += 1 / ohm
                elif there != "ground":
                    matrix[at[here], at[there]] -= 1 / ohm
    for name, (leak, _) in places.items():
        matrix[at[name], at[name]] += leak
    own, rest = slice(0, 6), slice(6, None)
    reach = matrix[own, rest] @ np.linalg.inv(matrix[rest, rest])
    first = [volt for _, volt in places.values()]
    return matrix[own, own] - reach @ matrix[rest, own], given[own] - reach @ given[rest], first


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_components_within_components_within_an_array(tmp_path, formulation):
    """Read from within by a law, a let, an output and an init, and from outside; against the circuit's own matrix."""
    trace = trace_of(tmp_path, CELLS, formulation=formulation)
    between, given, first = stages()
    rates, modes = np.linalg.eigh(between / 1e-6)
    still = np.linalg.solve(between, given)
    parts = modes.T @ (np.array(first) - still)
    exact = still + (np.exp(-np.outer(trace.time, rates)) * parts) @ modes.T
    for k, name in enumerate(f"u[{cell}, {i}]" for cell in (1, 2, 3) for i in (1, 2)):
        np.testing.assert_allclose(trace[name].values, exact[:, k], atol=2e-7)
    np.testing.assert_allclose(trace["seen"].values, exact[:, 5], atol=2e-7)
    np.testing.assert_allclose(trace["total"].values, 1e-6 * exact[:, :2].sum(1), atol=4e-13)
    np.testing.assert_allclose(trace["whole"].values, 1e-6 * exact.sum(1), atol=1.2e-12)
