"""Switches, diodes and thyristors in random circuits against backward Euler (converters.c)."""

import numpy as np
import pytest
from converters import ROWS, SPAN, drawn
from sysdyn import api

NUMBERS = [k for k in range(60) if k != 34]  # of which the reference finds no set of diodes at some steps
CASES = [(k, f) for f in ("lagrangian", "hamiltonian", "co_lagrangian") for k in NUMBERS]


@pytest.mark.parametrize(("number", "formulation"), CASES)
@pytest.mark.long
def test_converters_run_as_by_backward_euler(number, formulation, tmp_path):
    case = drawn(number)
    (tmp_path / "net.sd").write_text(case.text)
    trace = api.simulate(tmp_path / "net.sd", formulation=formulation, output=tmp_path / "out.h5")
    exact, off = case.moved()
    at = [np.flatnonzero(np.abs(trace.time - SPAN * k / ROWS) < 1e-9) for k in range(ROWS + 1)]
    for k, name in enumerate(case.traced):
        values = trace[name].values
        apart = max(np.abs(values[rows] - exact[j, k]).min() for j, rows in enumerate(at))  # before a jump, or behind
        of_kind = [j for j, other in enumerate(case.traced) if other[0] == name[0]]
        assert apart <= 2e-3 * np.abs(exact[:, of_kind]).max() + 5.0 * off[k]


FULL_WAVE = """from std.electrical import voltage, resistor, thyristor
model bridge {
  node a, b, p: electrical
  V: voltage(v = 100 V*sin(2*pi*50 Hz*t)) a -> b
  T1: thyristor(gate = if mod(t, 20 ms) > 2 ms and mod(t, 20 ms) < 3 ms then 1 else 0) a -> p
  T2: thyristor(gate = if mod(t, 20 ms) > 12 ms and mod(t, 20 ms) < 13 ms then 1 else 0) b -> p
  T3: thyristor(gate = if mod(t, 20 ms) > 12 ms and mod(t, 20 ms) < 13 ms then 1 else 0) ground -> a
  T4: thyristor(gate = if mod(t, 20 ms) > 2 ms and mod(t, 20 ms) < 3 ms then 1 else 0) ground -> b
  R: resistor(R = 10 ohm) p -> ground
}
scene go of bridge { time 0 s to 60 ms; trace R.e as u }
"""


FORMULATIONS = ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"]


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.long
def test_four_thyristors_block_and_fire_by_pairs(tmp_path, formulation):
    """All of them block at the start, and between two halves: of what they say then one follows from the others (E509
    before), and nothing says where the source floats (E516 before).  From 2 ms of each half on the load has its size.
    """
    (tmp_path / "m.sd").write_text(FULL_WAVE)
    trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "t.h5")
    within = np.mod(trace.time, 0.01)
    exact = np.where(within > 2e-3, np.abs(100.0 * np.sin(100.0 * np.pi * trace.time)), 0.0)
    apart = np.abs(within - 2e-3) > 1e-6  # both rows of a jump
    assert np.abs(trace["u"].values - exact)[apart].max() < 1e-9
    assert sum(exact > 50.0) > 20


H_BRIDGE = """from std.electrical import voltage, resistor, switch
model bridge {
  node d, a, b: electrical
  V: voltage(v = 24 V) d -> ground
  S1: switch(gate = if mod(t, 20 ms) > 2 ms and mod(t, 20 ms) < 8 ms then 1 else 0) d -> a
  S2: switch(gate = if mod(t, 20 ms) > 12 ms and mod(t, 20 ms) < 18 ms then 1 else 0) d -> b
  S3: switch(gate = if mod(t, 20 ms) > 12 ms and mod(t, 20 ms) < 18 ms then 1 else 0) a -> ground
  S4: switch(gate = if mod(t, 20 ms) > 2 ms and mod(t, 20 ms) < 8 ms then 1 else 0) b -> ground
  R: resistor(R = 10 ohm) a -> b
}
scene go of bridge { time BEGIN to 60 ms; trace R.f as i, S1.e as u every 1 ms }
"""


@pytest.mark.parametrize("begin", ["0 s", "3 ms"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.long
def test_a_load_floats_between_four_open_switches(tmp_path, formulation, begin):
    """The current of a bridge with dead times (E509, E516, E931 before, in all four formulations); of the potential
    that nothing determines meanwhile a sentence says so, and of the current none.
    """
    (tmp_path / "m.sd").write_text(H_BRIDGE.replace("BEGIN", begin))
    with pytest.warns(UserWarning, match=r"at times S1.blocks, S2.blocks, S3.blocks, S4.blocks leave u open"):
        trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "t.h5")
    within = np.mod(trace.time, 0.02)
    exact = 2.4 * (((within > 2e-3) & (within < 8e-3)) - 1.0 * ((within > 12e-3) & (within < 18e-3)))
    apart = np.min([np.abs(within - at) for at in (2e-3, 8e-3, 12e-3, 18e-3)], axis=0) > 1e-6  # both rows of a jump
    assert np.abs(trace["i"].values - exact)[apart].max() < 1e-9
    assert np.abs(trace["u"].values - np.where(exact > 0.0, 0.0, 24.0))[apart & (exact != 0.0)].max() < 1e-9
