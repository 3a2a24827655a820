"""Inductors and current sources that cut capacitors off: the sum of the balances behind the cut has a hidden rate."""

import json

import numpy as np
import pytest
from model_runs import FOUR, trace_of
from sysdyn.runtime.numerics import least_change

MODEL = """
from std.electrical import resistor, inductor, capacitor, current
model cut {
  node a, b, d: electrical
  I: current(i = 0.5 A + 0.2 A*sin(2 rad/s*t)) ground -> a
  C1: capacitor(C = 0.3 F) a -> b
  C2: capacitor(C = 0.2 F) b -> d
  R2: resistor(R = 2.5 ohm) a -> d
  R3: resistor(R = 1 ohm) b -> d
  L1: inductor(L = 0.4 H) d -> ground
  init C1.e = 0.8 V
  init C2.e = 0.1 V
}
scene go of cut {
  time 0 s to 3 s
  accuracy 1e-7
  trace a.e, b.e, d.e, C1.q, L1.f, L1.p every 30 ms
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_capacitors_behind_a_cut(tmp_path, formulation):
    trace = trace_of(tmp_path, MODEL, formulation=formulation)
    t = trace.time
    assert trace["L1.f"].values == pytest.approx(0.5 + 0.2 * np.sin(2 * t), abs=1e-6)
    assert trace["d.e"].values == pytest.approx(0.16 * np.cos(2 * t), abs=1e-5)
    assert trace["a.e"].values[0] == pytest.approx(0.16 + 0.9, abs=1e-6)
    reference = trace_of(tmp_path, MODEL, formulation="lagrangian")
    for name in ("a.e", "b.e", "C1.q"):
        assert trace[name].values == pytest.approx(reference[name].values, abs=1e-5), name


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(5)
def test_an_inerter_between_free_springs(tmp_path, formulation):
    """The same in a common-flow domain: nothing but springs and a force hold what the inerter joins."""
    text = """
    model inerter {
      node x, y: translation
      M: kinetic(p = 2 kg*f) x -> y
      k1: potential(e = 3 N/m*q) x -> ground
      k2: potential(e = 5 N/m*q) y -> ground
      b: dissipator(e = 0.5 N.s/m*f) x -> y
      F: effort(e = 1 N*cos(1 rad/s*t)) ground -> x
      init x.q = 0.7 m
      init M.f = 0 m/s
    }
    scene go of inerter {
      time 0 s to 3 s
      accuracy 1e-7
      trace k1.q, k2.q, M.f every 30 ms
    }
    """
    trace = trace_of(tmp_path, text, formulation=formulation)
    found = 3 * trace["k1.q"].values + 5 * trace["k2.q"].values
    assert found == pytest.approx(np.cos(trace.time), abs=1e-6)
    assert trace["k1.q"].values[0] == pytest.approx(0.7, abs=1e-9)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_inductors_alone_at_nodes_of_a_family(tmp_path, formulation):
    """Two sections in series: only v[2] of v[0..2] has inertia in the complementary family."""
    text = """
    model line {
      param n = 2
      node w[1..n], v[0..n]: electrical
      V: effort(e = 1 V*cos(2 rad/s*t)) v[0] -> ground
      for i in 1..n {
        R[i]: dissipator(e = 0.4 ohm*i*f) v[i - 1] -> w[i]
        L[i]: kinetic(p = 0.5 H*i*f) w[i] -> v[i]
      }
      C: potential(q = 0.4 F*e) v[n] -> ground
      init C.e = 0.5 V
      init L[1].f = 0.2 A
    }
    scene go of line {
      time 0 s to 1 s
      accuracy 1e-6
      trace L[1].f, L[2].f, v[1].e, w[2].e every 0.1 s
    }
    """
    trace = trace_of(tmp_path, text, formulation=formulation)
    # 1.5 i' = 0.5 - 1.2 * 0.2
    rate = (0.5 - 1.2 * 0.2) / 1.5
    assert trace["v[1].e"].values[0] == pytest.approx(1.0 - 0.4 * 0.2 - 0.5 * rate, abs=1e-6)
    assert trace["w[2].e"].values[0] == pytest.approx(1.0 - 1.2 * 0.2 - 0.5 * rate, abs=1e-6)
    assert trace["L[1].f"].values == pytest.approx(trace["L[2].f"].values, abs=1e-6)


FLOATING = {
    "to one": """
      node a, b, c[1..n]: electrical
      I: flow(f = 0.5 A + 0.2 A*sin(2 rad/s*t)) ground -> a
      for i in 1..n {
        C[i]: potential(q = 0.3 F*e) a -> c[i]
        L[i]: kinetic(p = 0.4 H*i*f) c[i] -> b
        init C[i].e = 0.1 V*i
      }
      R: dissipator(e = 1 ohm*f) b -> ground
      init L[1].f = 0.1 A
      init L[2].f = 0.2 A
    """,
    "side by side": """
      node a[1..n], c[0..n]: electrical
      for i in 1..n {
        I[i]: flow(f = 0.5 A*i + 0.2 A*sin(2 rad/s*t)) ground -> a[i]
        C[i]: potential(q = 0.3 F*e) a[i] -> c[i - 1]
        R[i]: dissipator(e = 2 ohm*f) a[i] -> c[i - 1]
        L[i]: kinetic(p = 0.4 H*i*f) c[i - 1] -> ground
        init C[i].e = 0.1 V*i
      }
      S: dissipator(e = 2 ohm*f) c[n] -> ground
      T: dissipator(e = 2 ohm*f) c[n] -> ground
    """,
}


def compared(tmp_path, case, n, formulation):
    """The trace of families of n behind a cut, which agrees with that in Lagrange's form."""
    text = f"""
    model cut {{
      param n = {n}
      {FLOATING[case]}
    }}
    scene go of cut {{
      time 0 s to 1 s
      accuracy 1e-6
      trace a{"" if case == "to one" else "[1]"}.e as a, c[1].e, C[2].q, L[3].f every 0.1 s
    }}
    """
    trace = trace_of(tmp_path, text, formulation=formulation)
    reference = trace_of(tmp_path, text, formulation="lagrangian")
    for name in reference.names:
        assert trace[name].values == pytest.approx(reference[name].values, abs=5e-5), name
    return trace


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("case", FLOATING)
@pytest.mark.long
def test_families_behind_a_cut(tmp_path, case, formulation):
    compared(tmp_path, case, 3, formulation)


@pytest.mark.parametrize("formulation", ["co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize("case", FLOATING)
@pytest.mark.one_in(2)
def test_families_behind_a_cut_step_as_small_ones(tmp_path, case, formulation):
    """The sum of the balances is a row of its own: without it the steps are ten times as many."""
    trace = compared(tmp_path, case, 30, formulation)
    assert json.loads(trace.attributes["statistics"])["steps"] < 60


CUT = """
model cut {{
  param n = {n}
  node a[1..n], c[1..n]: electrical
  for i in 1..n {{
    I[i]: flow(f = 0.5 A + 0.2 A*sin(2 rad/s*t)) ground -> a[i]
    C[i]: potential(q = 0.3 F*e) a[i] -> c[i]
    S[i]: dissipator(e = 5 ohm*f) a[i] -> c[i]
    {held}
    init C[i].e = 0.1 V
  }}
}}
scene go of cut {{
  time 0 s to 1 s
  accuracy 1e-5
  trace a[1].e, c[1].e, a[n].e, c[n].e every 0.1 s
}}
"""
HELD = {
    "by inductors": ("L[i]: kinetic(p = 0.4 H*f) c[i] -> ground\n init L[i].f = 0.5 A", lambda i, rate: 0.4 * rate),
    "by resistors": ("R[i]: dissipator(e = 2 ohm*f) c[i] -> ground", lambda i, rate: 2.0 * i),
}


@pytest.mark.parametrize("formulation", ["co_lagrangian", "co_hamiltonian", "lagrangian"])
@pytest.mark.parametrize("case", HELD)
@pytest.mark.long
def test_many_pairs_behind_cuts_begin_by_the_factors_of_their_rows(tmp_path, case, formulation, monkeypatch):
    """Capacitors that float, more of them than full matrices hold: what pairs have in common follows from currents, or
    their rates; that of rates may stay open, and the saddle point of twice the size is not asked for it.
    """
    asked = lambda *_: pytest.fail("rows determine what is asked of them")  # noqa: E731
    monkeypatch.setattr(least_change, "_SPARSE", (asked,))
    held, exact = HELD[case]
    trace = trace_of(tmp_path, CUT.format(n=500, held=held), formulation=formulation)
    t = trace.time
    i, rate = 0.5 + 0.2 * np.sin(2.0 * t), 0.4 * np.cos(2.0 * t)
    decay, w = 1.0 / 1.5, 2.0  # 1.5 s u' = 5 i - u: the voltage of a capacitor
    wave = 0.2 * decay * 5.0 * (decay * np.sin(w * t) - w * np.cos(w * t)) / (decay**2 + w**2)
    u = 2.5 + wave + (0.1 - 2.5 - wave[0]) * np.exp(-decay * t)
    for k in ("1", "n"):
        assert trace[f"c[{k}].e"].values == pytest.approx(exact(i, rate), abs=3e-5)
        assert trace[f"a[{k}].e"].values == pytest.approx(exact(i, rate) + u, abs=3e-5)
        assert trace[f"c[{k}].e"].values[0] == pytest.approx(exact(i, rate)[0], rel=1e-9)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
@pytest.mark.long
def test_an_inerter_between_springs_that_a_constraint_reads(tmp_path, formulation):
    """Psi ties z' to what the inerter sees: 3 a + 5 c = 0 with w = a - c leaves 3 kg w'' = - (15/8 N/m) w."""
    text = """
    model tied {
      coord a, c: translation
      coord z: translation = 0 m
      energy T* = 1/2*(2 kg)*(a' - c')^2 + 1/2*(1 kg)*z'^2
      energy V = 1/2*(3 N/m)*a^2 + 1/2*(5 N/m)*c^2
      psi tie: (a' - c')*(1 + 0.1 m^-2*z^2) = z'*(1 + 0.1 m^-2*z^2)
      init a = 0.625 m
      init z' = 0.2 m/s
    }
    scene go of tied {
      time 0 s to 3 s
      accuracy 1e-6
      trace a, c, z' as v every 0.1 s
    }
    """
    trace = trace_of(tmp_path, text, formulation=formulation)
    t, rate = trace.time, np.sqrt(15 / 8 / 3)
    w = np.cos(rate * t) + 0.2 / rate * np.sin(rate * t)
    assert trace["a"].values == pytest.approx(5 / 8 * w, abs=1e-6)
    assert trace["c"].values == pytest.approx(-3 / 8 * w, abs=1e-6)
    assert trace["v"].values == pytest.approx(0.2 * np.cos(rate * t) - rate * np.sin(rate * t), abs=1e-6)


def _levered(t):
    """x and x' of 1 kg on a lever between springs: 2 x + 3 y = 0, so x' - 2 y' = 7/3 x', whose rate is -x."""
    rate = np.sqrt(3 / 7)
    return np.cos(rate * t) + 0.7 / rate * np.sin(rate * t), 0.7 * np.cos(rate * t) - rate * np.sin(rate * t)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(2)
def test_a_mass_on_a_lever_between_springs(tmp_path, formulation):
    """The sum of balances that reads no inertia weighs them 2 to 1: its rates ask for y' at the start."""
    text = """
    model lever {
      param m = 1 kg
      coord x: translation = 1 m
      coord y: translation ~ 0.5 m
      energy T* = 1/2*m*(x' - 2*y')^2
      energy V = 1/2*(1 N/m)*x^2 + 1/2*(3 N/m)*y^2
      init x' = 0.7 m/s
    }
    scene go of lever {
      time 0 s to 3 s
      accuracy 1e-6
      trace x, y, x' as v, y' as w every 0.1 s
    }
    """
    trace = trace_of(tmp_path, text, formulation=formulation)
    x, v = _levered(trace.time)
    for name, value in {"x": x, "y": -2 / 3 * x, "v": v, "w": -2 / 3 * v}.items():
        assert trace[name].values == pytest.approx(value, abs=2e-6), name
    assert trace["w"].values[0] == pytest.approx(-1.4 / 3, rel=1e-12)


LEVERS = """
model levers {{
  param n = {n}
  coord x[1..n], y[1..n]: translation
  for i in 1..n {{
    energy T* = 1/2*(1 kg)*(x[i]' - 2*y[i]')^2
    energy V = 1/2*(1 N/m)*x[i]^2 + 1/2*(3 N/m)*y[i]^2
    init x[i] = 1 m
    init x[i]' = 0.7 m/s
  }}
}}
scene go of levers {{ time 0 s to 3 s; accuracy 1e-6; trace x[n] as x, y[n] as y, y[n]' as w every 0.1 s }}
"""


@pytest.mark.parametrize("n", [3, 300])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(5)
def test_however_many_levers_begin_where_their_balances_say(tmp_path, formulation, n):
    """2 x + 3 y = 0 follows from both balances of each, and its rate."""
    trace = trace_of(tmp_path, LEVERS.format(n=n), scene="go", formulation=formulation)
    x, v = _levered(trace.time)
    for name, exact in (("x", x), ("y", -2 / 3 * x), ("w", -2 / 3 * v)):
        assert np.abs(trace[name].values - exact).max() < 1e-6, name


INERTERS = """
model inerters {{
  param n = {n}
  coord x[1..n]: translation
  for i in 1..n-1 {{ energy T* = 1/2*(1 kg)*(x[i]' - x[i+1]')^2 }}
  for i in 1..n {{ energy V = 1/2*(1 N/m)*(1 + i/n)*x[i]^2 }}
  init x[1] = 1 m
  init x[1]' = 0.7 m/s
}}
scene go of inerters {{
  time 0 s to 0.1 s
  trace sum(i in 1..n: (1 + i/n)*x[i]) as s, sum(i in 1..n: (1 + i/n)*x[i]') as r, x[1] every 0.1 s
}}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_a_long_chain_of_inerters_begins_where_its_springs_balance(tmp_path, formulation):
    """All balances added up have no rate left: sum k x = 0, and so have rates."""
    trace = trace_of(tmp_path, INERTERS.format(n=450), scene="go", formulation=formulation)
    assert abs(trace["x[1]"].values[0] - 1.0) < 1e-12
    assert abs(trace["s"].values[0]) < 1e-12
    assert abs(trace["r"].values[0]) < 1e-11


@pytest.mark.parametrize("formulation", ["co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_where_nothing_is_traced_every_node_is_told_whole(tmp_path, formulation):
    """sin(t) through 3 H and two capacitors side by side: node impulses are 3 sin(t) and (t - sin(t))/7 more.

    Rows count one node from the other; what is told is the node.
    """
    text = """
    model cut {
      node a, b: electrical
      source: flow(f = 1 A*sin(t/1 s)) ground -> a
      c1: potential(e = q/(2 F)) a -> b
      c2: potential(e = q/(5 F)) a -> b
      l1: kinetic(p = 3 H*f) b -> ground
    }
    scene go of cut { time 0 s to 2 s; accuracy 1e-6 }
    """
    trace = trace_of(tmp_path, text, formulation=formulation)
    t = trace.time
    assert trace["b"].values == pytest.approx(3.0 * np.sin(t), abs=1e-5)
    assert trace["a"].values == pytest.approx(3.0 * np.sin(t) + (t - np.sin(t)) / 7.0, abs=1e-5)
