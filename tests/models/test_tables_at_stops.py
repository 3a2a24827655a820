"""A table that ends where a stop is: what it would be beyond does not act on what has arrived there."""

import pytest
from model_runs import trace_of

SOLENOID = """from std.electrical import resistor, voltage
from std.mechanical import mass, spring, damper
table Lx(x: mm) -> mH {kind} clamp [ {rows} ]
component solenoid_coil {{
  branch coil: electrical
  port core: translation
  energy T* = 1/2*Lx(core.q)*coil.f^2
}}
model solenoid {{
  node s, c: electrical
  node x: translation = {sign}6 mm
  V: voltage(v = 24 V*step(t)) s -> ground
  R: resistor(R = 12 ohm) s -> c
  coil: solenoid_coil() c -> ground, core = x
  M: mass(m = 80 g) x
  k: spring(k = 250 N/m, l0 = {sign}8 mm) x -> ground
  b: damper(b = 2 N.s/m) x -> ground
  phi seat: {gap} restitution 0.1
  init x.f = 0 m/s
  init coil.coil.f = 0 A
}}
scene pull_in of solenoid {{
  time 0 s to 60 ms
  limit steps 20000
  trace coil.coil.f as i, x.q, seat.multiplier as contact every 1 ms
}}
"""
ROWS = [(0, 80), (1, 74), (2, 60), (4, 38), (6, 25), (8, 18), (12, 12), (20, 10)]
SLOPES = {"pchip": 2.0, "linear": 6.0}  # H/m, of the first point: (3*6 - 14)/2 and 6


@pytest.mark.parametrize(("kind", "sign", "gap"), [("pchip", "", "x.q >= 0 mm"), ("linear", "-", "x.q <= 0 mm")])
def test_a_core_rests_on_its_seat(tmp_path, kind, sign, gap):
    """Beyond the table there is no pull: the core slid between pull and none, and hopped (over 100 s of computing)."""
    rows = ROWS if not sign else [(-x, value) for x, value in reversed(ROWS)]
    rows = ", ".join(f"({x}, {value})" for x, value in rows)
    trace = trace_of(tmp_path, SOLENOID.format(kind=kind, rows=rows, sign=sign, gap=gap))
    i = trace["i"][-1]
    assert trace["x.q"][-1] == pytest.approx(0.0, abs=1e-9)
    assert trace["contact"][-1] == pytest.approx(0.5 * SLOPES[kind] * i**2 - 250 * 8e-3, rel=1e-6)
