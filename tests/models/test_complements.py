"""Ideal diodes and switches in the complementary family: motion, reactions and events of the primal one."""

import numpy as np
import pytest
from model_runs import FOUR
from sysdyn.api import simulate

PEAK = """from std.electrical import diode, resistor, capacitor
model m {
  node a, b: electrical
  V: effort(e = 5 V*sin(2*pi*t/(1 s))) a -> ground
  D: diode.complementary() a -> b
  C: capacitor(C = 10 mF) b -> ground
  R: resistor(R = 40 ohm) b -> ground
}
scene s of m { time 0 s to 3 s; trace b.e as v, D.f as i, D.one_way.multiplier as r every 0.05 s; accuracy 1e-6 }
"""
CHOPPER = """from std.electrical import diode, resistor, inductor, switch, voltage
model m {
  node i, x, o: electrical
  Vs: voltage(v = 12 V) i -> ground
  S: switch() i -> x, gate = (if mod(t, 10 us) < 4.3 us then 1 else 0)
  D: diode.complementary() ground -> x
  L: inductor(L = 0.1 mH) x -> o
  R: resistor(R = 5 ohm) o -> ground
}
scene s of m { time 0 s to 0.1 ms; trace L.f as i, S.e as u every 1 us; accuracy 1e-6 }
"""
SIDE_BY_SIDE = """from std.electrical import diode, resistor, capacitor
model m {
  param n = 3
  node a: electrical
  node c[1..n]: electrical
  V: effort(e = 5 V*sin(2*pi*t/(1 s))) a -> ground
  for k in 1..n {
    D[k]: diode.complementary() a -> c[k]
    C[k]: capacitor(C = 1 mF*k) c[k] -> ground
    R[k]: resistor(R = 100 ohm) c[k] -> ground
  }
}
scene s of m { time 0 s to 2 s; trace c[1].e, c[3].e, D[2].f, D[3].one_way.multiplier every 0.05 s; accuracy 1e-6 }
"""
CLUTCH = """model m {
  node a: rotation
  node b: rotation
  Ja: kinetic(p = 2 kg.m^2*f) a
  Jb: kinetic(p = 1 kg.m^2*f) b
  M: effort(e = 3 N.m*cos(t/(1 s))) a
  B: dissipator(e = 0.5 N.m.s*f) b
  Ba: dissipator(e = 0.2 N.m.s*f) a
  W: freewheel() b -> a
}
component freewheel {
  branch: rotation
  psi one_way: f >= 0
}
scene s of m { time 0 s to 12 s; trace Ja.f, Jb.f, W.one_way.multiplier every 0.1 s; accuracy 1e-6 }
"""
DRIVEN = """from std.electrical import capacitor, resistor
model m {
  node a, b: electrical
  implicit u: V ~ 0 V
  S: effort(e = u) a -> ground
  R: resistor(R = 1 kohm) a -> b
  C: capacitor(C = 2 mF) b -> ground
  gamma drive: u = 5 V*sin(t/(1 s))
  init C.e = 1 V
}
scene s of m { time 0 s to 3 s; trace b.e as v every 0.1 s; accuracy 1e-6 }
"""


def run(text, folder, formulation):
    (folder / "m.sd").write_text(text)
    return simulate(folder / "m.sd", formulation=formulation, output=folder / f"{formulation}.h5")


@pytest.mark.one_in(2)
@pytest.mark.parametrize("text", [PEAK, CHOPPER, SIDE_BY_SIDE, CLUTCH], ids=["peak", "chopper", "array", "freewheel"])
def test_four_formulations_move_and_happen_alike(tmp_path, text):
    first, *others = (run(text, tmp_path, formulation) for formulation in FOUR)
    assert len(first.events) > 2
    for other in others:
        assert [(e.name, e.before, e.after) for e in other.events] == [
            (e.name, e.before, e.after) for e in first.events
        ]
        assert np.abs(np.subtract([e.time for e in other.events], [e.time for e in first.events])).max() < 1e-6 * 12.0
        for name in first.names:
            one, two = first[name].values, other[name].values
            assert np.abs(one - two).max() < 1e-5 * np.abs(one).max(), name


@pytest.mark.parametrize("formulation", FOUR)
def test_a_capacitor_behind_a_diode_holds_the_peak(tmp_path, formulation):
    """It follows the source until i = C v' + v/R is zero, and falls with R C from there."""
    trace = run(PEAK, tmp_path, formulation)
    w, tau = 2.0 * np.pi, 0.4
    leaves = (np.pi - np.arctan(w * tau)) / w  # tan(w t) = -w R C
    inside = (trace.time > leaves + 1e-3) & (trace.time < 1.0)
    exact = 5.0 * np.sin(w * leaves) * np.exp(-(trace.time[inside] - leaves) / tau)
    assert np.abs(trace["v"].values[inside] - exact).max() < 1e-5 * 5.0
    assert np.abs(trace["r"].values[inside] - (exact - 5.0 * np.sin(w * trace.time[inside]))).max() < 1e-5 * 10.0


@pytest.mark.parametrize("formulation", FOUR[2:])
def test_a_constraint_reads_the_time(tmp_path, formulation):
    """A first-order lag behind a sine: v = A exp(-t/T) + 5 V (sin t - T cos t)/(1 + T^2), T = 2 s."""
    found = run(DRIVEN, tmp_path, formulation)
    t = np.asarray(found.time)
    wanted = 3.0 * np.exp(-t / 2.0) + np.sin(t) - 2.0 * np.cos(t)
    assert np.abs(np.asarray(found["v"]) - wanted).max() < 5e-6
