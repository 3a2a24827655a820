"""Inputs of a linearisation: differentiated, held, following a formula, of arrays, in loaded stores."""

import numpy as np
import pytest
from linearized import ALL, CLOSE, PRIMAL, RLC, SEED, alike, linear, values
from texts import run_json, write


def test_an_input_that_is_differentiated(tmp_path, capsys):
    """A given current through a coil: v = L du/dt."""
    text = """
    model driven {
      param L = 0.25 H
      input u: A = 0 A
      node a: electrical
      source: flow(f = u) ground -> a
      coil: kinetic(p = L*f) a -> ground
    }
    scene s of driven { time 0 s to 1 s; trace coil.f as i, a.e as v }
    """
    for formulation in PRIMAL:
        found = linear(capsys, write(tmp_path, text), "--formulation", formulation)
        i, v = found["transfer"]
        assert (i["gain"], i["improper"]) == (pytest.approx(1.0, rel=CLOSE), [0.0, 0.0])
        assert (v["gain"], v["improper"][0]) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.25, rel=CLOSE))


@pytest.mark.long
def test_an_amplitude_is_held_at_its_instant(capsys):
    """E sin(w t) at 0.05 s: the filter's own transfer function times sin(w t), in either family."""
    for formulation in ALL:
        options = ("--inputs", "E", "--outputs", "e_o", "--at", "0.05", "--formulation", formulation)
        (t,) = linear(capsys, SEED / "lead_filter.sd", *options)["transfer"]
        assert t["gain"] == pytest.approx(np.sin(12.566370614359172 * 0.05), rel=1e-9), formulation
        alike(values(t["zeros"]), [-10.0])
        alike(values(t["poles"]), [-50.0])


@pytest.mark.parametrize(
    ("inputs", "label"), [((), "u"), (("--inputs", "u"), "u"), (("--inputs", "supply.v"), "supply.v")]
)
@pytest.mark.one_in(2)
def test_an_input_that_follows_a_formula_is_moved_about_it(inputs, label, tmp_path, capsys):
    """Of a linear circuit the transfer function is that of an input that holds a constant."""
    circuit = "from std.electrical import voltage\n" + RLC.replace("effort(e = u)", "voltage(v = u)")
    path = str(write(tmp_path, circuit))
    _, plain = run_json(capsys, "linearize", path, "--outputs", "v", "--inputs", "u", "--backend", "numpy")
    text = circuit.replace("time 0 s to 1 s;", "time 0 s to 1 s; set u = 2 V*sin(3 rad/s*t);")
    path = str(write(tmp_path, text))
    code, found = run_json(capsys, "linearize", path, "--outputs", "v", *inputs, "--at", "0.3", "--backend", "numpy")
    assert code == 0
    ours, theirs = (dict(r["result"]["transfer"][0]) for r in (found, plain))
    assert (ours.pop("input"), theirs.pop("input")) == (label, "u")
    for key in ("gain", "poles", "zeros"):
        assert np.allclose(ours[key], theirs[key], rtol=1e-9)


SQUARE = """model valve {
  input u: 1 = 0
  state x: 1 = 0
  dynamic x' = ((2 + sin(3 rad/s*t) + u)^2 - x)/(1 s)
}
scene s of valve {
  time 0 s to 1 s
  set u = cos(2 rad/s*t)
  trace x
}
"""


def test_a_formula_is_where_the_slope_is_taken(tmp_path, capsys):
    t = 0.7
    code, found = run_json(capsys, "linearize", str(write(tmp_path, SQUARE)), "--at", str(t), "--backend", "numpy")
    assert code == 0
    assert found["result"]["reduced"]["B"][0][0] == pytest.approx(2 * (2 + np.sin(3 * t) + np.cos(2 * t)), rel=1e-9)


BIASED = """
model coil {
  input u: H = 0.1 H
  node a, b: electrical
  V: effort(e = 10 V) a -> ground
  R: dissipator(e = 5 ohm*f) a -> b
  L: kinetic(p = u*f) b -> ground
}
model gap {
  input u: F = 1 mF
  node a, b: electrical
  V: effort(e = 10 V) a -> ground
  R: dissipator(e = 5 ohm*f) a -> b
  L: potential(q = u*e) b -> ground
}
scene coil_s of coil { time 0 s to 1 s
  trace L.f as i, L.e as v }
scene gap_s of gap { time 0 s to 1 s
  trace L.f as i, L.e as v }
"""
"""L i0 = 0.1 H x 2 A, q0 = 1 mF x 10 V: what moves the inductance or the gap of a loaded store moves it by its rate."""


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.parametrize("index", ["3", "1", "0"])
@pytest.mark.parametrize("scene", ["coil_s", "gap_s"])
@pytest.mark.one_in(30)
def test_an_input_in_a_loaded_store_acts_by_its_rate(scene, index, formulation, tmp_path, capsys):
    options = ("--scene", scene, "--equilibrium", "--formulation", formulation, "--index", index)
    found = linear(capsys, write(tmp_path, BIASED), *options)
    for s in (3j, 70.0 + 1j):
        current = -s * 2 / (0.1 * s + 5) if scene == "coil_s" else s * 10 / (1e-3 * s + 0.2) / 5
        expected = np.array([current, -5 * current])
        assert _descriptor(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
        assert _reduction(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)


BASE = """
model base {
  input v: m/s = 0 m/s
  input u: m = 0.2 m
  node b, x: translation
  F: flow(f = v) b -> ground
  K: potential(e = 100 N/m*q) b -> x
  D: dissipator(e = 1 N.s/m*f) b -> x
  M: kinetic(p = 1 kg*f) x
  Mb: kinetic(p = 2 kg*f) b
}
scene base_s of base { time 0 s to 1 s
  trace x.f as vx, F.e as F }
model frame {
  input u: m = 0.2 m
  coord x: translation = 0 m
  let z = x + u
  let y = 2*x + u^2/(1 m)
  energy T* = 1/2*(1 kg)*z'^2
  energy V = 1/2*(9 N/m)*x^2
  work -(0.5 N.s/m)*x' on x
}
scene frame_s of frame { time 0 s to 1 s
  trace x, x'' as a, y, y' as yd }
"""


@pytest.mark.parametrize("index", ["3", "2", "2v", "1", "0"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
@pytest.mark.one_in(12)
def test_matrices_of_every_index_hold_the_rates_of_inputs(formulation, index, tmp_path, capsys):
    """The base moved with v: x'' + x' + 100 x = v' + ...; in the frame x'' + u'' + x'/2 + 9 x = 0."""
    path = write(tmp_path, BASE)
    options = ("--formulation", formulation, "--index", index)
    for s in (3j, 2.0 + 11j):
        found = linear(capsys, path, "--scene", "base_s", "--inputs", "v", *options)
        speed = (100 + s) / (s * s + s + 100)
        expected = np.array([speed, -(2 * s + (100 + s) * (1 - speed) / s)])
        assert _descriptor(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
        assert _reduction(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
        found = linear(capsys, path, "--scene", "frame_s", *options)
        x = -s * s / (s * s + s / 2 + 9)
        expected = np.array([x, s * s * x, 2 * x + 0.4, s * (2 * x + 0.4)])
        assert _descriptor(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
        assert _reduction(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)


def _descriptor(found, s):
    e, a, b, c, d = (np.array(found[k]) for k in "EABCD")
    return (c + s * np.array(found.get("Cd", 0.0 * c))) @ np.linalg.solve(s * e - a, b) + d


def _reduction(found, s):
    small = found["reduced"]
    a, b, c, d = (np.array(small[k]) for k in "ABCD")
    rates = s * np.array(small.get("D1", 0.0 * d)) + s * s * np.array(small.get("D2", 0.0 * d))
    return c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d + rates


ROW = """
model row {
  param u = 10 N/m
  param n = 3
  param c = 2
  for i in 1..n { param k[i] = u*i }
  param kk[1..3] = [u, c*u, 5*u]
  coord x[1..n]: translation = 0 m
  energy T* = sum(i in 1..n: 1/2*(1 kg)*x[i]'^2)
  energy V = sum(i in 1..n: 1/2*(k[i] + kk[i])*x[i]^2)
  for i in 1..n { work 5 N - (0.3 N.s/m)*x[i]' on x[i] }
}
scene s of row { time 0 s to 1 s
  set kk[3] = 40 N/m
  trace x[1], x[2], x[3] }
"""


@pytest.mark.parametrize(("asked", "slopes"), [("u", (2, 4, 3)), ("c", (0, 10, 0)), ("kk[2]", (0, 1, 0))])
@pytest.mark.one_in(2)
def test_arrays_by_formula_follow_an_input(asked, slopes, tmp_path, capsys):
    found = linear(capsys, write(tmp_path, ROW), "--equilibrium", "--inputs", asked)
    s, stiffness = 3j, (20, 40, 70)
    expected = [-m * 5 / k / (s * s + 0.3 * s + k) for m, k in zip(slopes, stiffness, strict=True)]
    assert _descriptor(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
    assert _reduction(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)


SEATS = """
component seat {
  param k = 100 N/m
  input u: m
  port x: translation
  let z = x.q + u
  energy T* = 1/2*(2 kg)*z'^2
  K: potential(e = k*q) x -> ground
}
model two {
  input u[1..2]: m = [0.1 m, 0.2 m]
  input w: m = 0 m
  node a, b: translation
  A: seat(k = 50 N/m) u = u[1] + 2*w, x = a
  B: seat() u = u[2], x = b
}
scene s of two { time 0 s to 1 s
  trace a.q as xa, b.q as xb }
"""


@pytest.mark.long
def test_an_input_that_is_an_array_is_one_input_an_element(tmp_path, capsys):
    """Each seat: 2 (x'' + u'') + k x = 0."""
    found = linear(capsys, write(tmp_path, SEATS), "--equilibrium")
    assert found["inputs"] == ["u[1]", "u[2]", "w"]
    s = 0.3 + 3j
    one, other = (-s * s / (s * s + k / 2) for k in (50, 100))
    expected = np.array([[one, 0, 2 * one], [0, other, 0]])
    for response in (_descriptor(found, s), _reduction(found, s)):
        assert np.abs(response - expected).max() < CLOSE
