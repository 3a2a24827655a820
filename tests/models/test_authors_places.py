"""What binding, the start or a formulation refuses in a component of the library: at the author's line."""

import pytest
from sysdyn.api import check

GEARS = """from std.mechanical import inertia, gear
model m {
  node x, y: rotation
  M: inertia(J = 1 kg.m^2) x
  N: inertia(J = 1 kg.m^2) y
  A: gear(ratio = 2) inp = x, out = y
"""
STOPS = """from std.mechanical import mass, stops
model m {
  node x: translation
  M: mass(m = 1 kg) x
  S: stops(lo = -1 m, hi = 1 m) x
}
scene s of m { time 0 s to 1 s; trace x.q; formulation co_lagrangian }
"""
CASES = {
    "E509": (GEARS + "  B: gear(ratio = 2) inp = x, out = y\n}\n", 6, "gear"),
    "E517": (GEARS + "  B: gear(ratio = 3) inp = x, out = y\n  C: gear(ratio = 4) inp = x, out = y\n}\n", 6, "gear"),
    "E602": (STOPS, 5, "stops"),
}


@pytest.mark.parametrize("code", CASES)
def test_a_refusal_of_an_element_stands_at_its_line(code):
    text, line, component = CASES[code]
    (found,) = (d for d in check(text, "m.sd") if d.severity == "error")
    assert (found.code, found.place.file, found.place.start[0]) == (code, "m.sd", line)
    assert found.related[0].message == f"in component '{component}'"
    assert found.related[0].place.file == "std/mechanical.sd"
