"""Coordinates without inertia: resistors, capacitors and inductors at index 0, springs at stops."""

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of

HEAD = """
from std.electrical import resistor, capacitor, inductor
model net {
  node a, b: electrical
"""
SCENE = """
}
scene run of net { time 0 s to 3 s; accuracy 1e-9; trace C.e, L.f every 0.1 s }
"""
FILTER = "\n  ".join(
    (
        "  L: inductor(L = 1 H) a -> b",
        "C: capacitor(C = 1 F) b -> ground",
        "R: resistor(R = 2 ohm) b -> ground",
        "S: resistor(R = 0.5 ohm) a -> ground",
        "init C.e = 1 V",
    )
)


@pytest.mark.parametrize("method", ["dopri", "energy"])
@pytest.mark.parametrize("formulation", [*FOUR, "kane"])
@pytest.mark.long
def test_a_loop_with_two_resistors(tmp_path, formulation, method):
    """C u' = -u/R + f, L f' = -u - S f: f'' + f' + 5/4 f = 0 from f = 0, f' = -1; u = -f' - f/2."""
    trace = trace_of(tmp_path, HEAD + FILTER + SCENE, scene="run", formulation=formulation, method=method)
    assert trace.attributes["index"] == "0"
    t = trace.time
    f = -np.exp(-t / 2) * np.sin(t)
    rate = -f / 2 - np.exp(-t / 2) * np.cos(t)
    assert np.abs(trace["L.f"].values - f).max() < 2e-9
    assert np.abs(trace["C.e"].values - (-rate - f / 2)).max() < 2e-9


BRIDGE = "\n  ".join(
    (
        "  node c, d: electrical",
        "C: capacitor(C = 0.5 F) a -> ground",
        "R1: resistor(R = 1 ohm) a -> b",
        "R2: resistor(R = 2 ohm) a -> c",
        "R3: resistor(R = 3 ohm) b -> c",
        "R4: resistor(R = 4 ohm) b -> ground",
        "R5: resistor(R = 5 ohm) c -> d",
        "L: inductor(L = 2 H) d -> ground",
        "init C.e = 1 V",
        "init L.f = 0.3 A",
    )
)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_bridge_of_resistors_between_two_stores(tmp_path, formulation):
    """Its currents follow from Kirchhoff's laws alone; against the exponential of the state's matrix."""
    trace = trace_of(tmp_path, HEAD + BRIDGE + SCENE, scene="run", formulation=formulation, method="dopri")
    # efforts of b, c, d from those of a and the current f into d: conductances at b, c, d
    left = np.array([[1 + 1 / 3 + 1 / 4, -1 / 3, 0], [-1 / 3, 1 / 2 + 1 / 3 + 1 / 5, -1 / 5], [0, -1 / 5, 1 / 5]])
    right = np.array([[1, 0], [1 / 2, 0], [0, -1]])
    efforts = np.linalg.solve(left, right)
    drawn = np.array([1.5, 0]) - efforts[0] - efforts[1] / 2
    matrix = np.stack([-drawn / 0.5, efforts[2] / 2.0])
    rates, modes = np.linalg.eig(matrix)
    part = np.linalg.solve(modes, [1.0, 0.3])
    expected = np.real(modes @ (part[:, None] * np.exp(np.outer(rates, trace.time))))
    assert np.abs(trace["C.e"].values - expected[0]).max() < 2e-9
    assert np.abs(trace["L.f"].values - expected[1]).max() < 2e-9


def test_what_would_need_rates_of_balances_says_so(tmp_path):
    """Two capacitors on one node hold coordinates of their own in Lagrange's form: one effort, two balances of it."""
    text = HEAD + FILTER + "\n  D: capacitor(C = 2 F) b -> ground" + SCENE
    ran, report = attempt(tmp_path, text, scene="run", formulation="lagrangian", method="dopri")
    assert ran is None
    (found,) = [d for d in report if d.code == "E607"]
    assert "a balance without it would have to be differentiated too): inertia on " in found.message
    listed, advised = found.message.split(" not determined")[0], found.message.split("inertia on ")[-1]
    names = [word.rstrip("',") for word in listed.split(": ")[1].split() if word.rstrip(",").endswith("'")]
    assert advised.split(", constraints")[0].split(", ") == list(dict.fromkeys(names))[:3]  # in one order
    assert trace_of(tmp_path, text, scene="run", formulation="co_lagrangian", method="dopri").attributes["index"] == "0"


STOPPED = """from std.mechanical import spring, force
model stopped {{
  node x, y: translation
  K: spring(k = 50 N/m, l0 = {free}) x -> ground
  L: spring(k = 50 N/m) y -> x
  F: force(F = {force}) ground -> y
  phi stop: y.q <= 30 mm
}}
scene go of stopped {{
  time 0 s to 1 s
  trace x.q as x, y.q as y, stop.multiplier as s every 50 ms
}}
"""


@pytest.mark.parametrize("formulation", FOUR[:2])
@pytest.mark.long
def test_springs_without_masses_begin_at_the_stop_that_they_press_on(tmp_path, formulation):
    """Springs of 0.11 m and none push to 0.11 m: nothing moves there, and still it is beyond the stop."""
    trace = trace_of(tmp_path, STOPPED.format(free="0.11 m", force="0 N"), formulation=formulation)
    for name, value in (("x", 0.07), ("y", 0.03), ("s", 2.0)):
        assert np.abs(trace[name].values - value).max() < 1e-12


@pytest.mark.parametrize("formulation", FOUR[:2])
def test_a_force_that_jumps_takes_massless_springs_to_the_stop_and_not_beyond(tmp_path, formulation):
    text = STOPPED.format(free="0 m", force="if t < 0.42 s then -1 N else 2 N")
    trace = trace_of(tmp_path, text, formulation=formulation)
    behind = trace.time >= 0.42
    for name, before, after in (("x", -0.02, 0.015), ("y", -0.04, 0.03), ("s", 0.0, 2.0 - 0.75)):
        assert np.abs(trace[name].values - np.where(behind, after, before)).max() < 1e-12


TURNED = """
model turned {
  param I = 2 kg.m^2
  coord c: rotation = 1
  coord s: rotation ~ 0
  let w = c*s' - s*c'
  energy T* = 1/2*I*w^2
  phi unit_: c^2 + s^2 = 1
  init w = 1 rad/s
}
scene run of turned { time 0 s to 8 s; trace c, s every 50 ms }
"""


@pytest.mark.parametrize(("method", "accuracy"), [("radau", 1e-6), ("bdf", 1e-3)])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
@pytest.mark.long
def test_an_inertia_that_turns(tmp_path, formulation, method, accuracy):
    """Coordinates without inertia along themselves: at the start this is c alone, elsewhere both.  c = cos(t),
    s = sin(t); with roles as the start alone shows them radau stops and bdf takes 40 000 steps.
    """
    asked = {"formulation": formulation, "method": method, "index": "2", "accuracy": accuracy}
    trace = trace_of(tmp_path, TURNED, scene="run", max_steps=3000, **asked)
    assert np.abs(trace["c"].values - np.cos(trace.time)).max() < accuracy
    assert np.abs(trace["s"].values - np.sin(trace.time)).max() < accuracy
