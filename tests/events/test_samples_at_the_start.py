"""Switches that are turned by samples due at the start: what holds there is what holds behind them."""

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.dsl.text.diagnostics import ModelError

PUMP = """from std.electrical import resistor, capacitor, voltage, switch, pwm
model pump {
  node v, a, b, o: electrical
  discrete n = 0
  every 100 us { n := n + 1 }
  V: voltage(v = 5 V) v -> ground
  P: pwm(period = 100 us, duty = DUTY)
  S1: switch(gate = P.gate) v -> a
  S2: switch(gate = P.gate) b -> ground
  S3: switch(gate = 1 - P.gate) a -> o
  S4: switch(gate = 1 - P.gate) v -> b
  Cf: capacitor(C = 1 uF) a -> b
  Co: capacitor(C = 10 uF) o -> ground
  R: resistor(R = 1 kohm) o -> ground
  init Cf.e GIVEN V
  init Co.e = 5 V
}
scene s of pump { time 0 s to 0.99 ms; trace o.e as vo, n }
"""
"""Pulses begin at 0 s: Cf lies on V then, not between V and o."""


def output():
    """V at o at 0.99 ms, from charges: behind each pulse Cf lies on top of V, beside Co."""
    v = 5.0
    for k in range(10):
        v *= np.exp(-50e-6 / 10e-3)
        v = (10.0 * v + 10.0) / 11.0
        v *= np.exp(-(50e-6 if k < 9 else 40e-6) / 11e-3)
    return v


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize(("given", "duty"), [("= 5", "0.5"), ("~ 5", "if Co.e < 4 V then 0.9 else 0.5")])
@pytest.mark.one_in(5)
def test_a_charge_pump_begins_with_the_phase_of_its_first_pulse(given, duty, formulation, tmp_path):
    path = tmp_path / "m.sd"
    path.write_text(PUMP.replace("GIVEN", given).replace("DUTY", duty))
    trace = simulate(path, output=tmp_path / "o.h5", formulation=formulation, accuracy=1e-6)
    assert trace["vo"].values[0] == pytest.approx(5.0, rel=1e-12)
    assert abs(trace["vo"].values[-1] - output()) < 1e-6 * 10.0
    assert trace["n"].values[0] == 1
    assert trace["n"].values[-1] == 10


def test_a_start_that_no_phase_has_names_the_switches_of_the_first_pulse(tmp_path):
    path = tmp_path / "m.sd"
    path.write_text(PUMP.replace("GIVEN", "= 1").replace("DUTY", "0.5"))
    with pytest.raises(ModelError, match="E903") as refused:
        simulate(path, output=tmp_path / "o.h5", formulation="lagrangian")
    assert "'Cf.e' contradict S1" in str(refused.value)
