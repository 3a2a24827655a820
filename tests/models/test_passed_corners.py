"""Instants at which the text jumps or bends, passed by the core: against closed forms, and beside Python's way."""

from itertools import pairwise

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.runtime.integrate import integrate

FILTER = """from std.electrical import pulse, resistor, capacitor
model m {
  node i, o: electrical
  V: pulse(lo = 1 V, hi = 5 V, rise = 10 us, fall = 20 us, width = 170 us, period = 0.5 ms, delay = 0.1 ms) i -> ground
  R: resistor(R = 1 kohm) i -> o
  C: capacitor(C = 0.1 uF) o -> ground
  init C.e = 1 V
}
scene s of m { time 0 s to 5 ms; trace o.e as v, R.f as i every 7 us }
"""
SQUARE = """from std.electrical import voltage, resistor, capacitor
model m {
  node i, a, b: electrical
  V: voltage(v = (if mod(t, 2 ms) < 1 ms then 2 V else -1 V)) i -> ground
  R: resistor(R = 1 kohm) i -> a
  C: capacitor(C = 1 uF) a -> b
  Q: resistor(R = 1 kohm) b -> ground
}
scene s of m { time 0 s to 6 ms; trace R.f as i, C.e as v every 0.5 ms }
"""
LOOP = """from std.electrical import voltage, resistor, capacitor
model m {
  node i, o: electrical
  V: voltage(v = (if t < 1 ms then 0 V else 3 V)) i -> ground
  C: capacitor(C = 2 uF) i -> o
  D: capacitor(C = 1 uF) o -> ground
  R: resistor(R = 1 kohm) o -> ground
  init D.e = 0 V
}
scene s of m { time 0 s to 4 ms; trace o.e as v every 0.1 ms }
"""
FORMULATIONS = ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"]


@pytest.fixture
def python(monkeypatch):
    """The instants that Python passes."""
    passed, cross = [], integrate.cross
    monkeypatch.setattr(integrate, "cross", lambda run, segment: passed.append(segment.label) or cross(run, segment))
    return passed


def run(text, folder, **options):
    (folder / "m.sd").write_text(text)
    return simulate(folder / "m.sd", output=folder / "t.h5", **options)


def filtered(times, tau=1e-4):
    """The voltage of FILTER [times], which begins at rest: corner by corner a line and what relaxes onto it."""
    corners = [(0.0, 1.0)]
    for k in range(10):
        begin = 1e-4 + 5e-4 * k
        corners += [(begin, 1.0), (begin + 1e-5, 5.0), (begin + 1.8e-4, 5.0), (begin + 2e-4, 1.0)]
    corners.append((6e-3, 1.0))
    found, v = np.empty(times.size), 1.0
    for (a, low), (b, high) in pairwise(corners):
        slope = (high - low) / (b - a)

        def at(since, low=low, slope=slope, v=v):
            line = low + slope * (since - tau)
            return line + (v - low + slope * tau) * np.exp(-since / tau)

        here = (times >= a) & (times <= b)
        found[here], v = at(times[here] - a), at(b - a)
    return found


@pytest.mark.parametrize("method", ["bdf", "radau", "rosenbrock", "dopri"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.long
def test_bends_of_a_source_are_the_cores(tmp_path, python, method, formulation):
    trace = run(FILTER, tmp_path, method=method, formulation=formulation, rtol=1e-7)
    exact = filtered(trace.time)
    assert np.abs(trace["v"].values - exact).max() < 3e-6
    assert len(python) <= 1  # a first unknown of no known size


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.long
def test_jumps_of_what_follows_are_the_cores_and_have_two_rows(tmp_path, python, formulation):
    trace = run(SQUARE, tmp_path, formulation=formulation, accuracy=1e-7)
    period, v, rows = 1e-3, 0.0, []
    for k in range(7):  # tau 2 ms, and the row before each jump beside the one behind it
        level = 2.0 if k % 2 == 0 else -1.0
        for part in (0.0, 0.5, 1.0)[: 1 if k == 6 else 3]:
            here = level + (v - level) * np.exp(-part / 2.0)
            rows.append(((k + part) * period, (level - here) / 2e3, here))
        v = level + (v - level) * np.exp(-0.5)
    exact = np.array(rows)
    assert trace.time.size == len(rows)
    assert np.abs(trace.time - exact[:, 0]).max() < 1e-15
    assert np.abs(trace["i"].values - exact[:, 1]).max() < 1e-9
    assert np.abs(trace["v"].values - exact[:, 2]).max() < 2e-6
    assert len(python) <= (12 if formulation == "co_lagrangian" else 2)  # there a state jumps with them


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.long
def test_states_that_jump_are_pythons(tmp_path, python, formulation):
    """Charges of a loop of a source and two capacitors: v jumps by 3 V * 2/3, and falls with 3 ms."""
    trace = run(LOOP, tmp_path, formulation=formulation, accuracy=1e-7)
    exact = np.where(trace.time > 1e-3, 2.0 * np.exp(-(trace.time - 1e-3) / 3e-3), 0.0)
    behind = np.abs(trace.time - 1e-3) > 1e-9
    assert np.abs(trace["v"].values - exact)[behind].max() < 1e-6
    assert set(python) == {1e-3}


@pytest.mark.long
def test_both_ways_write_the_same_rows(tmp_path, monkeypatch):
    mine = run(FILTER, tmp_path, method="bdf", rtol=1e-5)
    monkeypatch.setattr(integrate, "serves", lambda run: False)
    pythons = run(FILTER, tmp_path, method="bdf", rtol=1e-5)
    assert mine.time.tobytes() == pythons.time.tobytes()
    assert np.abs(mine["i"].values - pythons["i"].values).max() < 1e-12
