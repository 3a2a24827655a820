"""Models as a reader of the language's page would write them, against closed forms."""

from math import cos, sin

import numpy as np
import pytest
from sysdyn.api import check, simulate

G = 9.80665


def run(folder, text, **options):
    file = folder / "m.sd"
    file.write_text(text)
    return simulate(file, output=folder / "m.h5", **{"accuracy": 1e-7, **options})


def off(trace, name, closed):
    """The greatest error of a quantity, in parts of its greatest value."""
    wanted = np.array([closed(t) for t in trace.time])
    return float(np.max(np.abs(np.array(trace[name]) - wanted)) / np.max(np.abs(wanted)))


def codes(text):
    return [d.code for d in check(text) if d.severity == "error"]


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_tables_of_one_name_in_two_files_are_two_tables(tmp_path, formulation):
    (tmp_path / "parts.sd").write_text(
        "table map(x: 1) -> N linear clamp [ (0, 0), (1, 10) ]\n"
        "fn twice(x: 1) -> N = 2*map(x)\n"
        "component push { port x: translation\n  F: effort(e = map(t/(1 s))) ground -> x\n}\n"
    )
    text = """
from parts import push, twice
table map(x: 1) -> N linear clamp [ (0, 100), (1, 200) ]
model m {
  node x: translation = 0 m
  M: kinetic(p = 1 kg*f) x
  A: push() x = x
  B: effort(e = map(t/(1 s))) ground -> x
  C: effort(e = twice(t/(1 s))) ground -> x
}
scene s of m { time 0 s to 1 s; trace M.p as p, A.F.e as a, B.e as b, C.e as c every 0.1 s }
"""
    trace = run(tmp_path, text, formulation=formulation)
    assert off(trace, "p", lambda t: 100 * t + 65 * t**2) < 1e-7
    assert off(trace, "a", lambda t: 10 * t) < 1e-12
    assert off(trace, "b", lambda t: 100 + 100 * t) < 1e-12
    assert off(trace, "c", lambda t: 20 * t) < 1e-12


BUNDLES = """
bundle point { x, y: translation }
bundle pair { a, b: point }
component bob {
  param m: kg
  port at: point
  energy T* = 1/2*m*(at.x.f^2 + at.y.f^2)
  work -m*g0 on at.y.q
}
component dumbbell {
  port ends: pair
  A: bob(m = 1 kg) at = ends.a
  B: bob(m = 2 kg) at = ends.b
}
component tether {
  port a, b: point
  X: potential(e = 12 N/m*q) on a.x.q - b.x.q
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_bundles_hold_bundles_and_their_ports_take_ground(tmp_path, formulation):
    text = (
        BUNDLES
        + """
model m {
  param n = 2
  node P[1..n]: pair
  for i in 1..n {
    D[i]: dumbbell() ends = P[i]
    T[i]: tether() a = P[i].a, b = ground
    init P[i].a.x.q = 0.5 m*i
    init P[i].b.y.f = 3 m/s
  }
}
scene s of m { time 0 s to 1 s; trace P[2].a.x.q as x, P[1].b.y.q as y, T[2].X.e as F every 0.1 s }
"""
    )
    trace = run(tmp_path, text, formulation=formulation)
    assert off(trace, "x", lambda t: cos(12**0.5 * t)) < 1e-6
    assert off(trace, "y", lambda t: 3 * t - G * t**2 / 2) < 1e-6
    assert off(trace, "F", lambda t: 12 * cos(12**0.5 * t)) < 1e-6


def test_what_is_wrong_with_a_bundle_is_said():
    model = "model m { node p: a; coord z: translation = 1 m; energy T* = 1/2*1 kg*z'^2 }\n"
    assert codes(f"bundle a {{ x: b }}\nbundle b {{ z: a }}\n{model}") == ["E801"]
    assert codes(f"bundle a {{ x: trans }}\n{model}") == ["E202"]
    assert codes(f"bundle a {{ x, x: translation }}\n{model}") == ["E106"]
    other = f"{BUNDLES}model m {{ node p: planar; B: bob(m = 1 kg) at = p }}\n"
    assert codes(other) == ["E401"]
    assert codes(f"{BUNDLES}model m {{ node p: point; let h = p; B: bob(m = 1 kg) at = p }}\n") == ["E104"]


def test_a_function_of_an_array(tmp_path):
    text = """
const n = 3
fn length(v[n]: m) -> m = sqrt(sum(i in 1..n: v[i]^2))
fn turned(v[2]: m, by: 1) -> m = v[1]*cos(by) - v[2]*sin(by)
fn outer(v[2]: m) -> m = turned(v, 0.5) + length([v[1], v[2], 0 m])
model m {
  param a[1..2]: m = [3 m, 4 m]
  state z: m = 0 m
  dynamic z' = 1 m/s
  let one = length([z, 2*z, 3 m])
  let two = outer(a) + outer([z, 0 m])
  let rate = one'
}
scene s of m { time 0 s to 2 s; trace one, two, rate every 0.1 s }
"""
    trace = run(tmp_path, text)
    assert off(trace, "one", lambda t: (5 * t**2 + 9) ** 0.5) < 1e-12
    assert off(trace, "two", lambda t: 3 * cos(0.5) - 4 * sin(0.5) + 5 + t * (cos(0.5) + 1)) < 1e-12
    assert off(trace, "rate", lambda t: 5 * t / (5 * t**2 + 9) ** 0.5) < 1e-12
    wrong = text.replace("length([z, 2*z, 3 m])", "{}")
    for argument in ("length([z, z])", "length(z)", "length([z, z, 1 s])"):
        assert codes(wrong.replace("{}", argument)) == ["E206"]
    assert codes(text.replace("v[n]: m", "v[0]: m")) == ["E807"]
    assert codes("table f(x[2]: m) -> N linear clamp [ (0, 1), (1, 2) ]\n" + text) == ["E206"]


LADDERS = """
component ladder {
  param n = 2
  param R: ohm
  port a: electrical
  node v[0..n]: electrical
  for j in 1..n {
    r[j]: dissipator(e = R*f) v[j - 1] -> v[j]
    c[j]: potential(q = 1 F*e) v[j] -> ground
    init c[j].e = 0 V
  }
  w: dissipator(e = R*f) a -> v[0]
}
model m {
  node p: electrical
  V: effort(e = 1 V) p -> ground
  for i in 1..3 { L[i]: ladder(n = 3, R = 1 ohm*i) a = p }
  K: ladder(R = 1 ohm) a = p
}
scene s of m { time 0 s to 4 s; trace L[1].c[3].e as a, L[3].c[1].e as b, K.c[2].e as c every 0.1 s }
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_components_in_an_array_have_arrays_of_their_own_size(tmp_path, formulation):
    trace = run(tmp_path, LADDERS, formulation=formulation)
    for name, n, ohms, k in (("a", 3, 1.0, 2), ("b", 3, 3.0, 0), ("c", 2, 1.0, 1)):
        matrix = -2 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)
        matrix[0, 0], matrix[-1, -1] = -1.5, -1.0
        values, vectors = np.linalg.eigh(matrix / ohms)
        wanted = [(vectors @ ((1 - np.exp(values * t)) * (vectors.T @ np.ones(n))))[k] for t in trace.time]
        assert np.max(np.abs(trace[name] - wanted)) < 1e-5


def test_inputs_of_components_are_arrays_of_their_shape(tmp_path):
    text = """
component mixer {
  param n = 2
  input u[0..n - 1]: V
  output y = u[0] - 2*u[1]
}
model m {
  state x[1..2]: V = 1 V
  for i in 1..2 { dynamic x[i]' = -x[i]/(1 s*i) }
  A: mixer() u = x
  B: mixer(u = [x[2], 3 V])
}
scene s of m { time 0 s to 2 s; trace A.y as a, B.y as b every 0.1 s }
"""
    trace = run(tmp_path, text)
    assert np.max(np.abs(trace["a"] - (np.exp(-trace.time) - 2 * np.exp(-trace.time / 2)))) < 1e-6
    assert np.max(np.abs(trace["b"] - (np.exp(-trace.time / 2) - 6))) < 1e-6
    for wrong, code in (("x[1]", "E805"), ("[x[1], 3 V, x[2]]", "E805"), ("[x[1], 3 m]", "E207")):
        assert codes(text.replace("u = x\n", f"u = {wrong}\n")) == [code]
    one = text.replace("input u[0..n - 1]: V", "input u: V").replace("u[0] - 2*u[1]", "u")
    assert set(codes(one)) == {"E805"}


STARS = """
component star {
  param n = 3
  param R[1..n]: ohm
  port c: electrical
  port p[1..n]: electrical
  for i in 1..n { r[i]: dissipator(e = R[i]*f) p[i] -> c }
  let mean = sum(i in 1..n: p[i].e)/n
}
component half {
  port q[1..3]: electrical
  port c: electrical
  S: star(R = [2 ohm, 4 ohm, 8 ohm]) c = c, p = q
}
component loads {
  node a[1..3], c: electrical
  for k in 1..2 { D[k]: half() c = c, q = a }
  for i in 1..3 {
    C[i]: potential(q = 1 F*e) a[i] -> ground
    init C[i].e = 1 V*i
  }
  G: dissipator(e = 5 ohm*f) c -> ground
}
model m { for j in 1..2 { L[j]: loads() } }
scene s of m { time 0 s to 1 s; trace L[1].a[1].e as x, L[2].D[2].S.mean as mean every 0.1 s }
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_ports_that_are_arrays(tmp_path, formulation):
    trace = run(tmp_path, STARS, formulation=formulation)
    g = np.array([1, 0.5, 0.25])
    values, vectors = np.linalg.eigh(np.outer(g, g) / (g.sum() + 0.2) - np.diag(g))
    wanted = np.array([vectors @ (np.exp(values * t) * (vectors.T @ [1.0, 2.0, 3.0])) for t in trace.time])
    assert np.max(np.abs(trace["x"] - wanted[:, 0])) < 1e-6
    assert np.max(np.abs(trace["mean"] - wanted.mean(axis=1))) < 1e-6


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("c = c, q = a", "c = c, q = c"),
        ("node a[1..3]", "node a[0..3]"),
        ("p[i] -> c }", "p -> c }"),
        ("p[i] -> c }", "p[i] -> c[i] }"),
        ("p[i].e)/n", "c[i].e)/n"),
    ],
)
def test_what_is_wrong_with_an_array_of_ports_is_said(right, wrong):
    assert "E805" in codes(STARS.replace(right, wrong))


FED = """
model m {
  param n = 3
  param tau[1..n]: s = [1 s, 2 s, 0.5 s]
  input u[1..n]: V = [1 V, 2 V, 3 V]
  input w[1..n]: V = 1 V
  input k[1..2]: V = [1 V*t/(1 s), 2 V]
  input f[0..1]: V
  state z[1..n]: V = 0 V
  for i in 1..n { dynamic z[i]' = (u[i]*w[i]/(1 V) - z[i])/tau[i] }
  let total = sum(i in 1..n: u[i]*i)
  let signals = k[1] + k[2] + 10*f[0] + f[1]
}
scene s of m {
  time 0 s to 1 s
  set u[2] = 4 V
  set f = [1 V*t/(1 s), 2 V]
  trace z[2] as z, total, signals every 0.1 s
}
"""


@pytest.mark.parametrize("weight", [1, 10])
@pytest.mark.long
def test_inputs_of_a_model_are_arrays(tmp_path, weight):
    trace = run(tmp_path, FED, set={"w[2]": weight})
    assert off(trace, "z", lambda t: 4 * weight * (1 - np.exp(-t / 2))) < 1e-6
    assert off(trace, "total", lambda t: 18.0) < 1e-12
    assert off(trace, "signals", lambda t: 11 * t + 4) < 1e-12


@pytest.mark.parametrize(
    ("right", "wrong", "code"),
    [
        ("  set f = [1 V*t/(1 s), 2 V]\n", "", "E904"),
        ("set u[2] = 4 V", "set u = [1 V, 2 V]", "E805"),
        ("set u[2] = 4 V", "set u[2] = 4 V*t/(1 s)", "E807"),
        ("set u[2] = 4 V", "set u[4] = 4 V", "E805"),
        ("set u[2] = 4 V", "set u = 4 A", "E207"),
        ("set u[2] = 4 V", "set k[2] = 4 V", "E910"),
        ("[1 V*t/(1 s), 2 V]\n  input", "1 V*t/(1 s)\n  input", "E805"),
    ],
)
def test_what_is_wrong_with_an_array_of_inputs_is_said(right, wrong, code):
    assert right in FED
    assert code in codes(FED.replace(right, wrong))


SET = """
model m {
  param n = 4
  param a[1..4]: kg = 1 kg
  param b[1..2, 1..2]: kg = 1 kg
  param c[1..n]: kg = 1 kg
  coord x[1..2]: translation = 1 m
  energy T* = sum(i in 1..2: 1/2*1 kg*x[i]'^2)
  let sa = a[1] + 10*a[2] + 100*a[3] + 1000*a[4]
  let sb = b[1, 1] + 10*b[1, 2] + 100*b[2, 1] + 1000*b[2, 2]
  let sc = c[1] + 10*c[2] + 100*c[3] + 1000*c[4]
}
scene s of m { time 0 s to 1 s; set STATEMENT; trace sa, sb, sc, x[1..2]; accuracy 1e-5 on x[1..2] }
"""


@pytest.mark.parametrize(
    ("statement", "sums"),
    [
        ("a[1..2] = 5 kg", (1155, 1111, 1111)),
        ("a[2..3] = [5 kg, 6 kg]", (1651, 1111, 1111)),
        ("a[1..4] = 3 kg", (3333, 1111, 1111)),
        ("b[1, 1..2] = 5 kg", (1111, 1155, 1111)),
        ("b[1..2, 1] = [5 kg, 6 kg]", (1111, 1615, 1111)),
        ("b[1..2, 1..2] = 4 kg", (1111, 4444, 1111)),
        ("c[2..n] = 7 kg", (1111, 1111, 7771)),
        ("c[n] = 7 kg; set c = 2 kg", (1111, 1111, 7222)),
    ],
)
@pytest.mark.one_in(5)
def test_a_range_of_a_parameter_is_set_and_no_more(tmp_path, statement, sums):
    trace = run(tmp_path, SET.replace("STATEMENT", statement), accuracy=None)
    assert [trace[name][0] for name in ("sa", "sb", "sc")] == list(sums)


@pytest.mark.long
def test_the_command_line_wins_over_elements_that_the_scene_sets(tmp_path):
    text = SET.replace("STATEMENT", "a[1] = 7 kg")
    assert run(tmp_path, text, accuracy=None, set={"a": "5"})["sa"][0] == 5555
    assert run(tmp_path, text, accuracy=None, set={"a[1..2]": "5"})["sa"][0] == 1155
    assert run(tmp_path, text, accuracy=None, set={"a[4]": "5"})["sa"][0] == 5117


@pytest.mark.parametrize("statement", ["a[3..5] = 1 kg", "a[1..2] = [1 kg, 2 kg, 3 kg]", "b[1..2] = 1 kg"])
def test_a_range_that_does_not_fit_is_said(statement):
    assert codes(SET.replace("STATEMENT", statement)) == ["E805"]


CELLS = """
component cell {
  param R = 1 ohm
  param k[1..2] = 1
  port a: electrical
  r: dissipator(e = R*(k[1] + 10*k[2])/11*f) a -> ground
}
model m {
  node v[1..3]: electrical
  for i in 1..3 {
    X[i]: cell() a = v[i]
    C[i]: potential(q = 1 F*e) v[i] -> ground
    init C[i].e = 1 V
  }
}
scene s of m { time 0 s to 1 s; set STATEMENT; trace X[1..3].r.f as i }
"""


@pytest.mark.parametrize(
    ("statement", "ohms"),
    [
        ("X[1..2].R = 7 ohm", (7, 7, 1)),
        ("X[3].R = 7 ohm", (1, 1, 7)),
        ("X[2..3].k = [11, 22]", (1, 21, 21)),
        ("X[1].k = 5", (5, 1, 1)),
        ("X[1..2].k[1] = 12", (2, 2, 1)),
        ("X[1..2].k[1..2] = 4", (4, 4, 1)),
    ],
)
@pytest.mark.one_in(3)
def test_parameters_of_a_range_of_components_are_set(tmp_path, statement, ohms):
    trace = run(tmp_path, CELLS.replace("STATEMENT", statement))
    assert [trace[f"i[{k}]"][0] for k in (1, 2, 3)] == pytest.approx([1 / r for r in ohms], rel=1e-12)
