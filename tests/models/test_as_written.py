"""Physics as written: branches in energies, elements along displacements, labels of several places, false alarms."""

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of

END = "scene s of m {{\n  time 0 s to 1 s\n  accuracy 1e-7\n  trace {} every 0.05 s\n}}\n"


def run(tmp_path, text, traced, formulation, **options):
    return trace_of(tmp_path, text + END.format(traced), formulation=formulation, backend="numpy", **options)


def codes_of(tmp_path, text):
    _, report = attempt(tmp_path, text + END.format("t"), backend="numpy")
    return {d.code for d in report if d.severity == "error"}


# -- branches in energies ----------------------------------------------------------------------------------

PAIR = """
component pair {
  branch a, b: electrical
  energy V = 1/2*(2.5 V/C)*a.q^2 + 1/2*(1.5 V/C)*b.q^2 + (0.8 V/C)*a.q*b.q + 1/4*(0.6 V/C^3)*a.q^4
}
component windings {
  branch a, b: electrical
  energy T* = 1/2*(2 H)*a.f^2 + 1/2*(3 H)*b.f^2 + (1.2 H)*a.f*b.f
}
component lossy {
  branch: electrical
  content D = 1/2*(4 ohm)*f^2
}
model m {
  node u, v, w: electrical
  X: pair() a = u -> ground, b = w -> ground
  Y: windings() a = u -> v, b = v -> w
  R: lossy() v
  init X.a.q = 0.7 C
  init X.b.q = -0.3 C
  init Y.a.f = 0.2 A
  init Y.b.f = 0.1 A
}
"""
READ = "X.a.q as qa, X.b.q as qb, X.a.e as ea, X.b.e as eb, u.e as u, v.e as v, w.e as w"
READ += ", R.e as er, R.f as fr, Y.a.e as y"


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_branch_in_an_energy_has_its_slope_as_effort(tmp_path, formulation):
    trace = run(tmp_path, PAIR, READ + ", audit.energy", formulation)
    names = ("qa", "qb", "ea", "eb", "u", "v", "w", "er", "fr", "y")
    qa, qb, ea, eb, u, v, w, er, fr, y = (trace[n].values for n in names)
    np.testing.assert_allclose(ea, 2.5 * qa + 0.8 * qb + 0.6 * qa**3, atol=1e-6)
    np.testing.assert_allclose(eb, 1.5 * qb + 0.8 * qa, atol=1e-6)
    for node, effort in ((u, ea), (w, eb), (v, er)):
        np.testing.assert_allclose(node, effort, atol=1e-6)
    np.testing.assert_allclose(er, 4 * fr, atol=1e-6)
    np.testing.assert_allclose(y, u - v, atol=1e-6)
    assert np.ptp(qa) > 0.1
    assert np.abs(trace["/audit/energy"].values).max() < 1e-6


def test_the_four_formulations_agree_on_energies_over_several_branches(tmp_path):
    ends = []
    for formulation in FOUR:
        trace = run(tmp_path, PAIR, READ, formulation)
        ends.append([trace[n].values[-1] for n in ("qa", "qb", "u", "v", "w")])
    np.testing.assert_allclose(ends, np.broadcast_to(ends[0], (4, 5)), atol=1e-6)


# -- elements along displacements --------------------------------------------------------------------------

ALONG = """
component leg {
  branch b: translation
  K: potential(e = 6 N/m*q) on b.q
  D: dissipator(e = 0.9 N.s/m*f) on b.q
}
model m {
  node x, y: translation = 0 m
  M: kinetic(p = 1.5 kg*f) x
  N: kinetic(p = 2.5 kg*f) y
  L: leg() b = x -> y
  S: potential(e = 3 N/m*q) x
  E: dissipator(e = 0.2 N.s/m*f) on S.q
  G: potential(e = 2 N/m*q) on 1.5*x.q - 0.4*y.q
  init x.f = 0.8 m/s
  init y.f = -0.3 m/s
}
"""
BESIDE = """
model m {
  node x, y: translation = 0 m
  coupled: potential(e = 6 N/m*q) x -> y
  damped: dissipator(e = 0.9 N.s/m*f) x -> y
  M: kinetic(p = 1.5 kg*f) x
  N: kinetic(p = 2.5 kg*f) y
  S: potential(e = 3 N/m*q) x
  E: dissipator(e = 0.2 N.s/m*f) x
  energy V = 1/2*(2 N/m)*(1.5*x.q - 0.4*y.q)^2
  init x.f = 0.8 m/s
  init y.f = -0.3 m/s
}
"""
SERIES = """
component wire {
  branch b: electrical
  L: kinetic(p = 1.4 H*f) on b.q
  R: dissipator(e = 2.2 ohm*f) on b.q
}
model m {
  node a, c: electrical
  C: potential(q = 0.8 F*e) a
  W: wire() b = a -> c
  L2: kinetic(p = 0.6 H*f) c
  R2: dissipator(e = 1.7 ohm*f) on L2.q
  init C.e = 1.9 V
  init W.L.f = 0.1 A
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_elements_along_displacements(tmp_path, formulation):
    """Two masses: against the same springs between nodes, in Lagrange's form."""
    wanted = run(tmp_path, BESIDE, "x.f as x, y.f as y, coupled.e + damped.e as e", "lagrangian")
    trace = run(tmp_path, ALONG, "x.f as x, y.f as y, L.b.e as e, L.b.f as f, L.K.q as q, x.q as xq", formulation)
    for name in ("x", "y", "e"):
        np.testing.assert_allclose(trace[name].values, wanted[name].values, atol=1e-6)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_elements_in_the_flow_of_a_branch(tmp_path, formulation):
    """A loop of one current: 2 H, 3.9 ohm, 0.8 F."""
    trace = run(tmp_path, SERIES, "W.L.f as f, a.e as a, c.e as c, L2.e + R2.e as far, W.b.e as b", formulation)
    times = trace.time
    a, w = 3.9 / 2 / 2, np.sqrt(1 / (2 * 0.8) - (3.9 / 4) ** 2 + 0j)
    # C a' = -f, 2 f' + 3.9 f = a
    f0, rate = 0.1, (1.9 - 0.39) / 2
    f = (np.exp(-a * times) * (f0 * np.cos(w * times) + (rate + a * f0) / w * np.sin(w * times))).real
    np.testing.assert_allclose(trace["f"].values, f, atol=1e-6)
    np.testing.assert_allclose(trace["c"].values, trace["far"].values, atol=1e-6)
    np.testing.assert_allclose(trace["b"].values, trace["a"].values - trace["c"].values, atol=1e-6)


def test_a_spring_of_lengths_along_an_angle_is_refused(tmp_path):
    text = """
component spring {
  param k: N/m
  branch: translation
  law e = k*q
}
model m {
  coord th: rotation = 0.3 rad
  energy T* = 1/2*(2 kg.m^2)*th'^2
  K: spring(k = 5 N/m) on WHERE
  init th' = 0 rad/s
}
"""
    assert codes_of(tmp_path, text.replace("WHERE", "th")) == {"E401"}
    assert codes_of(tmp_path, text.replace("WHERE", "2*th")) & {"E401", "E208"}
    assert codes_of(tmp_path, text.replace("WHERE", "(0.4 m)*th")) == set()


# -- labels of several places, initial values --------------------------------------------------------------

LINKS = """
component link {
  param m: kg
  param k: N/m
  port a: translation
  M: kinetic(p = m*f) a
  K: potential(e = k*q) a
  state w: m = 0.3 m
  dynamic w' = -2*w/(1 s)
  init M.f = 4 m/s
}
model m {
  param n = 5
  node x[1..n]: translation
  for i in 1..2 { P[i]: link(m = 2 kg, k = 3 N/m) x[i] }
  for i in 3..n { P[i]: link(m = 1 kg, k = 5 N/m) x[i] }
  for i in 1..n { init x[i].q = 0.1 m*i }
  for i in 1..n { init P[i].M.f = 0.5 m/s*i }
  init P[4].w = 0.9 m
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_initial_values_over_a_label_of_two_places(tmp_path, formulation):
    traced = ", ".join(f"P[{i}].M.f as f{i}, P[{i}].w as w{i}" for i in range(1, 6))
    trace = run(tmp_path, LINKS, f"{traced}, sum(i in 1..n: P[i].K.e) as total", formulation)
    t = trace.time
    total = np.zeros(t.size)
    for i in range(1, 6):
        m, k = (2, 3) if i < 3 else (1, 5)
        w = np.sqrt(k / m)
        f = 0.5 * i * np.cos(w * t) - 0.1 * i * w * np.sin(w * t)
        total += k * (0.1 * i * np.cos(w * t) + 0.5 * i / w * np.sin(w * t))
        np.testing.assert_allclose(trace[f"f{i}"].values, f, atol=1e-5)
        np.testing.assert_allclose(trace[f"w{i}"].values, (0.9 if i == 4 else 0.3) * np.exp(-2 * t), atol=1e-6)
    np.testing.assert_allclose(trace["total"].values, total, atol=1e-4)


def test_no_second_place_has_a_name_that_nobody_wrote(tmp_path):
    ran, report = attempt(tmp_path, LINKS.replace("k = 5 N/m", "k = -5 N/m") + END.format("P[3].M.f"))
    assert ran is None
    assert any(d.code == "E325" for d in report)
    assert not any("#" in d.message for d in report)


@pytest.mark.long
def test_a_scene_goes_before_the_model_and_the_model_before_a_component(tmp_path):
    text = LINKS + END.format("P[1].M.f as a, P[2].M.f as b").replace("time 0", "init P[2].M.f = -7 m/s\n  time 0")
    trace = trace_of(tmp_path, text, backend="numpy")
    assert trace["a"].values[0] == pytest.approx(0.5)
    assert trace["b"].values[0] == pytest.approx(-7)


def test_two_of_one_level_are_still_an_error(tmp_path):
    assert "E106" in codes_of(tmp_path, LINKS.replace("init P[4].w = 0.9 m", "init P[4].w = 0.9 m; init P[4].w = 1 m"))


# -- false alarms ------------------------------------------------------------------------------------------


def test_the_rate_of_an_array(tmp_path):
    text = """
model m {
  coord x: translation = 0.4 m
  coord y: translation = 0.1 m
  let r = [x, y]
  energy T* = 1/2*(3 kg)*dot(r', r')
  energy V = 1/2*(2 N/m)*dot(r, r)
  init x' = 0 m/s
  init y' = 0.5 m/s
}
"""
    trace = run(tmp_path, text, "norm(r') as speed, x", "lagrangian")
    w = np.sqrt(2 / 3)
    t = trace.time
    speed = np.hypot(-0.4 * w * np.sin(w * t), 0.5 * np.cos(w * t) - 0.1 * w * np.sin(w * t))
    np.testing.assert_allclose(trace["speed"].values, speed, atol=1e-6)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("law", ["gain*e", "0.3 S*e*(1 + t/(1 s))"])
@pytest.mark.one_in(4)
def test_a_source_that_reads_an_input_or_time_is_one(tmp_path, law, formulation):
    text = f"""
model m {{
  input gain: S = 0.3 S*(1 + t/(1 s))
  node a: electrical
  C: potential(q = 2 F*e) a
  S: flow(f = {law}) a
  init C.e = 1.6 V
}}
"""
    trace = run(tmp_path, text, "a.e as a", formulation)
    t = trace.time
    np.testing.assert_allclose(trace["a"].values, 1.6 * np.exp(-0.15 * (t + t**2 / 2)), atol=1e-6)


def test_a_source_of_its_own_variable_alone_is_still_refused(tmp_path):
    text = "model m {\n  param g = 0.3 S\n  node a: electrical\n  C: potential(q = 2 F*e) a\n  S: flow(f = g*e) a\n}\n"
    assert codes_of(tmp_path, text) == {"E315"}


# -- checks that were never raised, by texts that are no examples ------------------------------------------

REFUSED = {
    "E311": """
component tank {
  branch: hydraulic
  law q = 3e-6 m^3/Pa*e
  energy V* = 1/2*(3e-6 m^3/Pa)*e^2
}
model m {
  node a: hydraulic
  T: tank() a
  R: dissipator(e = 4e5 Pa.s/m^3*f) a
  init a.e = 2 Pa
}
""",
    "E310": """
component valve {
  branch a, b: translation
  law a.e = 40 N/m*a.q + 7 N/m*b.q
  law b.e = -7 N/m*a.q + 30 N/m*b.q
}
model m {
  node x, y: translation = 0 m
  M: kinetic(p = 1 kg*f) x
  N: kinetic(p = 1 kg*f) y
  V: valve() a = x -> ground, b = y -> ground
}
""",
    "E313": """
model m {
  node a: electrical
  C: potential(q = 2 F*e) a
  R: dissipator(f = 0.2 S*e - 0.7 A) a
  init C.e = 1 V
}
""",
}


@pytest.mark.parametrize("code", REFUSED)
def test_they_are_raised(tmp_path, code):
    assert codes_of(tmp_path, REFUSED[code]) == {code}


@pytest.mark.long
def test_a_loop_of_stores_is_a_note(tmp_path):
    text = """
model m {
  node a: electrical
  C: potential(q = 2 F*e) a
  D: potential(q = 3 F*e) a
  R: dissipator(e = 2 ohm*f) a
  init a.e = 1 V
}
"""
    ran, report = attempt(tmp_path, text + END.format("a.e as a"), backend="numpy")
    notes = [d for d in report if d.code == "N401"]
    assert [d.severity for d in notes] == ["note"]
    assert "C, D" in notes[0].message
    assert ran is not None


# -- the fixed step, the manifest --------------------------------------------------------------------------

KNIFE = """
model m {
  param len = 250 mm
  coord x: translation = 0.4 m
  coord y: translation = 0.1 m
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2)
  psi knife: 2*x' = y'*sin(1 + x/len)
  work -9 N on y
  init x' = 0 m/s
}
scene s of m {
  time 0 s to 0.7 s
  solver euler(step = 0.01 s)
  trace x, knife.multiplier as mu
}
"""


@pytest.mark.parametrize("end", ["0.7", "0.333", "3"])
@pytest.mark.long
def test_the_last_euler_sample_is_on_the_end(tmp_path, end):
    trace = trace_of(tmp_path, KNIFE, until=end)
    assert trace.time[-1] == float(end)
    assert np.diff(trace.time).min() > 1e-4
    assert np.abs(np.diff(trace["mu"].values)).max() < 1.0


def test_the_manifest_s_values_are_in_its_units(tmp_path):
    import json

    from sysdyn.cli.main import main

    (tmp_path / "m.sd").write_text(KNIFE)
    with pytest.raises(SystemExit) as ended:
        main(["compile", str(tmp_path / "m.sd"), "--scene", "s", "-o", str(tmp_path), "--quiet"])
    assert ended.value.code in (0, None)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert {p["name"]: (p["value"], p["unit"]) for p in manifest["parameters"]}["len"] == (250.0, "mm")
    units = {u["name"]: u["unit"] for u in manifest["unknowns"]}
    assert units["knife.multiplier"] == "W/(m/s)"
    with pytest.raises(SystemExit) as ended:
        main(["compile", str(tmp_path / "m.sd"), "--scene", "s", "-o", str(tmp_path), "--index", "3", "--quiet"])
    assert ended.value.code == 0  # as written, whatever its index
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert (manifest["index"], manifest["index_form"]) == (2, "3")


# -- singular starts ---------------------------------------------------------------------------------------

SINGULAR = {
    "folded parallelogram": (
        """
model m {
  param l = 0.6 m
  param d = 1.1 m
  coord x1: translation ~ 0.6 m
  coord y1: translation ~ 0 m
  coord x2: translation ~ 1.7 m
  coord y2: translation ~ 0 m
  energy T* = 1/2*(2 kg)*(x1'^2 + y1'^2 + x2'^2 + y2'^2)
  work -9 N on y1
  work -9 N on y2
  phi a: x1^2 + y1^2 = l^2
  phi b: (x2 - d)^2 + y2^2 = l^2
  phi c: (x2 - x1)^2 + (y2 - y1)^2 = d^2
}
""",
        "rank 2, 3 nearby",
        ("y1: translation ~ 0 m", "y1: translation ~ 0.2 m"),
    ),
    "two equal links": (
        """
model m {
  param l = 0.45 m
  coord th: rotation = ANGLE
  coord ph: rotation ~ ANGLE
  coord s: translation ~ 0 m
  energy T* = 1/2*(0.3 kg.m^2)*(th'^2 + ph'^2) + 1/2*(2 kg)*s'^2
  phi along: l*cos(th) + l*cos(ph) = s
  phi across: l*sin(th) - l*sin(ph) = 0 m
  init th' = 0 rad/s
}
""".replace("ANGLE", "90 deg"),
        "rank 1, 2 nearby",
        ("90 deg", "70 deg"),
    ),
    "a circle of radius 0": (
        """
model m {
  param r = 0 m
  coord x: translation ~ 0 m
  coord y: translation ~ 0 m
  energy T* = 1/2*(3 kg)*(x'^2 + y'^2)
  phi ring: x^2 + y^2 = r^2
}
""",
        "rank 0, 1 nearby",
        ("r = 0 m", "r = 0.4 m"),
    ),
}


@pytest.mark.parametrize("formulation", FOUR[:2])
@pytest.mark.parametrize("name", SINGULAR)
@pytest.mark.one_in(5)
def test_a_singular_start_is_found_and_a_regular_one_is_none(tmp_path, name, formulation):
    text, says, (here, moved) = SINGULAR[name]
    ran, report = attempt(tmp_path, text + END.format("t"), formulation=formulation, backend="numpy")
    assert ran is None
    found = [d for d in report if d.severity == "error"]
    assert [d.code for d in found] == ["E512"]
    assert says in found[0].message
    text = text.replace(here, moved).replace("coord x: translation ~ 0 m", "coord x: translation ~ 0.1 m")
    _, report = attempt(tmp_path, text + END.format("t"), formulation=formulation, backend="numpy")
    assert "E512" not in [d.code for d in report]
