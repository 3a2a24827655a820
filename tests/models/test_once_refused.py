"""Small models that once were refused, or ran off, beside closed forms."""

import numpy as np
import pytest
from model_runs import FOUR, trace_of

SINE = 2e3 * np.pi
SOURCE = "V: voltage(v = 1 V*sin(2*pi*1 kHz*t)) a -> ground"
DIVIDER = f"""from std.electrical import voltage, resistor, capacitor
model divider {{
  node a, b: electrical
  {SOURCE}
  C1: capacitor(C = 1 uF) a -> b
  C2: capacitor(C = 1 uF) b -> ground
  R: resistor(R = 1 kohm) b -> ground
}}
scene s of divider {{ time 0 s to 2 ms; trace R.e, C1.f every 20 us; accuracy 1e-6 }}
"""


@pytest.mark.parametrize("formulation", [*FOUR, "kane"])
@pytest.mark.one_in(3)
def test_a_capacitive_divider_on_a_sine(tmp_path, formulation):
    """(C1 + C2) b' = C1 a' - b/R, from b = 0."""
    trace = trace_of(tmp_path, DIVIDER, formulation=formulation)
    t, decay = trace.time, 1.0 / (1e3 * 2e-6)
    rising = decay * (np.cos(SINE * t) - np.exp(-decay * t)) + SINE * np.sin(SINE * t)
    b = 0.5 * SINE * rising / (decay**2 + SINE**2)
    assert trace["R.e"].values == pytest.approx(b, abs=3e-6)
    flow = 1e-6 * (0.5 * SINE * np.cos(SINE * t) + decay * b)
    assert trace["C1.f"].values == pytest.approx(flow, abs=3e-6 * 1e-6 * SINE)


ACROSS = f"""from std.electrical import voltage, capacitor
model across {{
  node a: electrical
  {SOURCE}
  C: capacitor(C = 1 uF) a -> ground
}}
scene s of across {{ time 0 s to 2 ms; trace C.e, C.f every 20 us; accuracy 1e-6 }}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(2)
def test_a_capacitor_across_a_sine(tmp_path, formulation):
    trace = trace_of(tmp_path, ACROSS, formulation=formulation)
    assert trace["C.e"].values == pytest.approx(np.sin(SINE * trace.time), abs=3e-6)
    assert trace["C.f"].values == pytest.approx(1e-6 * SINE * np.cos(SINE * trace.time), abs=3e-6 * 1e-6 * SINE)


CLIPPED = """model clipped {
  state y: 1 = 1
  dynamic y' = clip(1 - 2e9*y, -1, 1)/(1 s)
}
scene s of clipped { time 0 s to 3 s; trace y every 0.25 s; accuracy 1e-6 }
"""


@pytest.mark.parametrize("method", ["auto", "bdf", "radau", "rosenbrock"])
def test_a_steep_law_between_its_corners(tmp_path, method):
    """It falls to 1e-9 at 1 s, and from there to 5e-10 within 1e-9 s."""
    trace = trace_of(tmp_path, CLIPPED, method=method)
    assert trace["y"].values == pytest.approx(np.maximum(1.0 - trace.time, 5e-10), abs=2e-9)
    late = trace.time > 1.1
    assert trace["y"].values[late] == pytest.approx(5e-10, rel=1e-3)


CRANK = """model crank {
  coord c: rotation = 0.3 rad
  coord x: translation ~ 2 m
  energy T* = 1/2*(1 kg)*x'^2 + 1/2*(1 kg.m^2)*c'^2
  phi drive: c = 0.3 rad + 1 rad/s*t
  phi rod: (x - 1 m*cos(c))^2 + (1 m*sin(c))^2 = (1.001 m)^2
}
scene s of crank { time 0 s to 7 s; trace x, rod.multiplier as push every 0.05 s; accuracy 1e-6 }
"""


@pytest.mark.parametrize("method", ["auto", "bdf", "radau"])
@pytest.mark.parametrize("formulation", FOUR[:2])
@pytest.mark.one_in(2)
def test_a_driven_crank_whose_rod_is_hardly_longer(tmp_path, formulation, method):
    """X = cos c + sqrt(l^2 - sin^2 c), which turns by 45 of its slopes within 0.045 rad twice a turn: the push of the
    rod is m x'' / (2 sqrt(l^2 - sin^2 c)).
    """
    trace = trace_of(tmp_path, CRANK, formulation=formulation, method=method)
    c = 0.3 + trace.time
    root = np.sqrt(1.001**2 - np.sin(c) ** 2)
    assert trace["x"].values == pytest.approx(np.cos(c) + root, abs=4e-6)
    slope = -np.sin(c) * np.cos(c) / root
    rate = -np.cos(c) - (np.cos(2.0 * c) + slope**2) / root
    assert np.abs(trace["push"].values) == pytest.approx(np.abs(rate / (2.0 * root)), rel=1e-4, abs=1e-3)
