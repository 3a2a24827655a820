"""Switches whose gates are given a constant: a wire or a gap for the whole run, currents by Ohm's law."""

import pytest
from sysdyn.api import simulate

MODEL = """from std.electrical import resistor, switch, voltage
model divider {
  input g: 1 = 0
  node a, b, c: electrical
  V: voltage(v = 12 V) a -> ground
  S: switch(gate = g) a -> b
  R: resistor(R = 3 ohm) b -> ground
  T: switch(gate = 1) a -> c
  Q: resistor(R = 4 ohm) c -> ground
  U: switch(gate = 0) c -> ground
}
scene s of divider { time 0 s to 1 s; trace R.f as through, Q.f as beside, U.f as off; set g = SET }
"""


@pytest.mark.parametrize(("gate", "current"), [("0", 0.0), ("1", 4.0), ("step(t/(1 s) - 0.5)", 4.0)])
@pytest.mark.one_in(5)
def test_gates_that_stand_still(tmp_path, gate, current):
    path = tmp_path / "m.sd"
    path.write_text(MODEL.replace("SET", gate))
    trace = simulate(path, output=tmp_path / "o.h5")
    assert trace["through"].values[-1] == pytest.approx(current, abs=1e-12)
    assert trace["beside"].values[-1] == pytest.approx(3.0, rel=1e-12)
    assert abs(trace["off"].values[-1]) < 1e-12
