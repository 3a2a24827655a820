"""What only dampers tie to a store when it is let go: the store is empty at once, whatever the formulation."""

import numpy as np
import pytest
from sysdyn.api import simulate

SWITCHED = """from std.electrical import voltage, resistor, inductor, switch, capacitor, diode
model m {
  node a, b, c, d, e: electrical
  V: voltage(v = 10 V) a -> ground
  %s
}
scene s of m { time 0 s to 5 ms; trace L.f as i, %s as u }
"""
S = "S: switch(gate = if t < 2 ms or t > 3 ms then 1 else 0)"
L = "L: inductor(L = 1 mH) a -> b; R: resistor(R = 1 ohm) b -> c"
ASIDE = "R5: resistor(R = 3 kohm) e -> ground; R6: resistor(R = 3 kohm) e -> a"
CIRCUITS = {
    "floating coil": (
        f"{S} a -> b; R: resistor(R = 1 ohm) b -> c; R2: resistor(R = 3 ohm) c -> d"
        "; L: inductor(L = 1 mH) d -> e; R3: resistor(R = 1 mohm) e -> ground",
        "c.e",
    ),
    "two coils": (f"{L}; {S} c -> d; R3: resistor(R = 3 ohm) d -> e; L5: inductor(L = 3 mH) e -> ground", "e.e"),
    "coil and capacitor": (
        f"{L}; {S} c -> d; R3: resistor(R = 3 ohm) d -> e; C: capacitor(C = 3 uF) e -> ground; init C.e = 0 V",
        "e.e",
    ),
    "two branches": (
        f"{L}; {S} c -> d; R3: resistor(R = 3 ohm) c -> e; L5: inductor(L = 3 mH) d -> ground"
        "; L6: inductor(L = 3 mH) e -> ground",
        "L6.f",
    ),
    "diode": (
        "L: inductor(L = 1 mH) a -> b; D: diode(Is = 1 nA, vT = 26 mV) b -> c"
        f"; {S} c -> d; R3: resistor(R = 3 ohm) d -> ground; {ASIDE}",
        "R3.f",
    ),
}
CLUTCH = """
model m {
  param k = 1 kN/m
  coord a, b, c: translation = 0 m
  discrete on = true
  phi drive: a = 10 m/s*t
  psi clutch: a' = b' while on
  content D = 1/2*(1 N.s/m)*(b' - c')^2
  energy V = 1/2*k*c^2
  when t >= 2 ms { on := false }
}
scene s of m { time 0 s to 5 ms; trace b, c }
"""


def run(tmp_path, text, **options):
    path = tmp_path / "m.sd"
    path.write_text(text, encoding="utf-8")
    return simulate(path, output=tmp_path / "m.h5", **options)


@pytest.mark.parametrize("formulation", ["co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize("name", CIRCUITS)
@pytest.mark.one_in(12)
def test_a_coil_behind_a_resistor_is_opened(name, formulation, tmp_path):
    """The balances of the nodes between have flows that might answer each of them, and none together (E930)."""
    body, read = CIRCUITS[name]
    text, at = SWITCHED % (body.replace("; ", "\n  "), read), (1.9e-3, 2.5e-3, 4e-3)
    found, wanted = (
        run(tmp_path, text, formulation=f, accuracy=1e-6, at="1.9 ms, 2.5 ms, 4 ms")
        for f in (formulation, "lagrangian")
    )
    for quantity in ("i", "u"):
        values, right = (t[quantity].values[np.searchsorted(t.time, at)] for t in (found, wanted))
        assert values == pytest.approx(right, abs=1e-5 * np.abs(wanted[quantity].values).max())


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_a_spring_behind_a_damper_is_let_go(formulation, tmp_path):
    """It takes along what hangs on the damper: closed form."""
    trace = run(tmp_path, CLUTCH, formulation=formulation, accuracy=1e-7)
    tight = 0.01 * (1.0 - np.exp(-2.0))
    assert trace["c"].values[-1] == pytest.approx(0.0, abs=1e-9)
    assert trace["b"].values[-1] == pytest.approx(0.02 - tight, abs=1e-8)
