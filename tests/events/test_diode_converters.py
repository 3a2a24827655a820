"""The current of a coil on which a switch opens is continuous where a diode takes it over, and right."""

import sys
from pathlib import Path

import numpy as np
import pytest
from diode_converters import FORMS, cases, error, text

sys.path.append(str(Path(__file__).parents[1] / "extremes"))
from running import ran

RUN_ON = """from std.electrical import voltage, mosfet, diode, inductor, capacitor, resistor
model coil {
  node i, x, o: electrical
  Vs: voltage(v = 12 V) i -> ground
  S: mosfet(Ron = 50 mohm, gate = if t < 1 us then 1 else 0) d = i, s = x
  D: diode(Is = 20 nA, vT = 45 mV) ground -> x
  L: inductor(L = 47 uH) x -> o
  Co: capacitor(C = 47 uF) o -> ground
  R: resistor(R = 10 ohm) o -> ground
  init L.f = 0.3 A
  init Co.e = 4 V
}
scene s of coil { time 0 s to 2 us; trace L.f every 0.1 us }
"""
SCIPY = {1e-6: 0.46981, 1.1e-6: 0.45968, 2e-6: 0.36857}
"""L.f (A) at instants (s): SciPy's Radau on L i' = -vT ln(1 + i/Is) - v_C behind 1 us."""


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.parametrize("case", list(cases()), ids=lambda case: "-".join(map(str, case)).replace(" ", ""))
@pytest.mark.one_in(200)
def test_a_coil_into_a_diode(case, formulation, tmp_path):
    """Of 36 such converters none was right with an exponential diode: 9 wrong, 27 refused; now all of 216 are."""
    run = ran(tmp_path, text(*case), formulation=formulation, accuracy=1e-5, max_wall="60")
    assert not run.refused
    assert run.met
    assert error(run.trace, *case) <= 1e-4


@pytest.mark.parametrize("formulation", FORMS)
@pytest.mark.one_in(5)
def test_a_coil_behind_a_transistor_with_a_body_diode(formulation, tmp_path):
    """The current fell to -Is at once, told as met in Lagrange's and Hamilton's form; the others may stop there."""
    run = ran(tmp_path, RUN_ON, formulation=formulation)
    if run.refused:
        assert formulation.startswith("co_")
        assert "t = 1.0000000000" in run.refused
        return
    time, current = (np.asarray(x) for x in (run.trace.time, run.trace["L.f"]))
    assert np.interp(list(SCIPY), time, current) == pytest.approx([*SCIPY.values()], abs=1e-4)
    assert np.ptp(current[np.abs(time - 1e-6) < 1e-12]) <= 1e-9
