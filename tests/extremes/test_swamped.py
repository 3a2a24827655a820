"""Small quantities beside one that an exponential law makes 1e30 and more times as large: right, or not met.

A diode straight across a source carries up to 1e61 A.  What stands beside it knows nothing of that: closed forms.
"""

import json

import numpy as np
import pytest
from running import ran
from sysdyn import api
from sysdyn.cli.main import run
from sysdyn.runtime.judgement import EPS

RC = """from std.electrical import capacitor, diode, resistor, voltage
model m {{
  node a, b: electrical
  U: voltage(v = {} V*sin(50 rad/s*t)) a -> ground
  R: resistor(R = 1 kohm) a -> b
  C: capacitor(C = 10 uF) b -> ground
  D: diode() a -> ground
  init C.e = 0 V
}}
scene s of m {{
  time 0 s to 0.3 s
  trace C.e, R.f, C.energy, R.power every 1 ms
}}
"""
CUBIC = """from std.electrical import capacitor, diode, voltage
model mm {
  node n2, n1: electrical
  U: voltage(v = -3.383 V*sin(71.27 Hz*t)) n2 -> ground
  C3: capacitor(C = 4.883 uF) n2 -> n1
  D4: diode() n2 -> ground
  P5: dissipator(f = 1 mA*(e/(1 V))^3) n1 -> ground
}
scene sc of mm { time 0 s to 2 s; trace C3.energy }
"""
SCIPY = 1.25386e-5
"""C3.energy at 2 s in J: SciPy's Radau at rtol 1e-10 on q' = ((U - q/C)/V)^3 mA."""


def charging(v, t, R=1e3, C=1e-5, w=50.0):
    """Voltage of C (V), current (A) behind R on v sin(w t) from zero."""
    part = 1.0 / (1.0 + (w * R * C) ** 2)
    e = v * part * (np.sin(w * t) - w * R * C * np.cos(w * t) + w * R * C * np.exp(-t / (R * C)))
    return e, (v * np.sin(w * t) - e) / R


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize("v", [1.0, 2.0, 3.5])
@pytest.mark.long
def test_a_capacitor_beside_a_diode_across_the_source(v, formulation, tmp_path):
    accuracy = 1e-3
    found = ran(tmp_path, RC.format(v), formulation=formulation, accuracy=accuracy)
    assert not found.refused
    assert found.met
    e, i = charging(v, found.trace.time)
    for name, wanted in (("C.e", e), ("R.f", i), ("C.energy", 0.5e-5 * e**2), ("R.power", 1e3 * i**2)):
        assert np.abs(found.trace[name].values - wanted).max() <= accuracy * np.abs(wanted).max()
        assert found.trace[name].nominal <= 3.0 * np.abs(wanted).max()


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_an_estimate_is_of_the_traced_quantity(formulation, tmp_path):
    """It was 0.0, and the energy 30 % or 99 % off: round-off of the diode's 1e61 A excused 1e96 J."""
    found = ran(tmp_path, CUBIC, formulation=formulation)
    assert found.met
    assert found.trace["C3.energy"].values[-1] == pytest.approx(SCIPY, rel=1e-4)
    assert EPS <= found.outcome.error_estimate <= 1e-4


INVERSE = """
model inverse {
  coord a, b: translation ~ 0 m
  implicit F: N
  energy T* = 1/2*(1 kg)*(a'^2 + b'^2)
  energy V = 1/2*(100 N/m)*(a - b)^2
  work F on a
  gamma follow: b = 1 m*sin(t/(1 s))
}
scene s of inverse { time 0 s to 3 s; trace a, b, F every 10 ms }
"""


@pytest.mark.parametrize("method", ["auto", "bdf", "radau", "rosenbrock"])
def test_above_index_three_nothing_is_integrated(method, tmp_path):
    """F was 6359 N off, told as met beside an energy balance of -9.8e28 J."""
    path = tmp_path / "m.sd"
    path.write_text(INVERSE, encoding="utf-8")
    with pytest.raises(api.ModelError, match="the index is 5, and nothing above 3 is integrated"):
        api.simulate(path, method=method, output=tmp_path / "m.h5")


def test_check_notes_an_index_that_is_not_integrated(tmp_path, capsys):
    path = tmp_path / "m.sd"
    path.write_text(INVERSE, encoding="utf-8")
    assert run(["check", "--json", str(path)]) == 0
    (note,) = json.loads(capsys.readouterr().out)["diagnostics"]
    assert note["code"] == "N608"
    assert "prescribe the displacement that this effort acts on" in note["message"]
    assert run(["check", "--strict", str(path)]) == 1
