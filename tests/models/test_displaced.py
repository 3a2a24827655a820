"""A step of a source moves displacements at once: what resists an impulse of flow takes none, in every formulation."""

import numpy as np
import pytest
from model_runs import FOUR, trace_of
from scipy.linalg import expm

SOURCE = "source: effort(e = 1 V*step(t - 1 s)) a -> ground"
CAPACITOR = "potential(q = {}*(1 F)*e)"
RESISTOR = "dissipator(e = {}*(1 ohm)*f)"


def circuit(nodes, *elements, trace):
    """A scene of two seconds, whose source steps after one."""
    listed = "\n  ".join((f"node {nodes}: electrical", *elements))
    scene = f"scene s of m {{\n  time 0 s to 2 s\n  accuracy 1e-9\n  trace {trace} every 0.1 s\n}}\n"
    return f"model m {{\n  {listed}\n}}\n{scene}"


STRAIGHT = circuit(
    "a, b",
    SOURCE,
    f"C0: {CAPACITOR.format(1)} a -> ground",
    f"R1: {RESISTOR.format(1)} a -> b",
    f"C1: {CAPACITOR.format(1)} b -> ground",
    trace="C1.e as v",
)
DIVIDER = circuit(
    "a, b",
    SOURCE,
    f"C1: {CAPACITOR.format(1)} a -> b",
    f"C2: {CAPACITOR.format(3)} b -> ground",
    f"R1: {RESISTOR.format(1)} b -> ground",
    "init C2.e = 0 V",
    trace="C2.e as v",
)
BESIDE = circuit(
    "a, b, c, d",
    SOURCE,
    f"C0: {CAPACITOR.format(1)} a -> ground",
    f"R1: {RESISTOR.format(1)} a -> b",
    f"C1: {CAPACITOR.format(1)} b -> ground",
    f"R2: {RESISTOR.format(1)} b -> c",
    f"C2: {CAPACITOR.format(1)} c -> ground",
    f"R3: {RESISTOR.format(2)} a -> d",
    f"R4: {RESISTOR.format(1)} d -> c",
    trace="C1.e as v",
)
COILS = circuit(
    "a, b",
    "source: flow(f = 1 A*step(t - 1 s)) ground -> a",
    "L0: kinetic(p = (1 H)*f) a -> b",
    f"R1: {RESISTOR.format(1)} b -> ground",
    "L1: kinetic(p = (1 H)*f) b -> ground",
    "init L1.f = 0 A",
    trace="L1.f as v",
)
QUADRATIC = STRAIGHT.replace("e = 1*(1 ohm)*f", "e = (1 V/A^2)*f*abs(f)")
DAMPER = """model m {
  node a, b: translation
  damper: dissipator(e = (2 N.s/m)*f) a -> b
  spring: potential(e = (5 N/m)*q) b -> ground
  phi drive: a.q = 1 m*step(t - 0.5 s)
  init b.q = 0 m
}
scene s of m {
  time 0 s to 1 s
  accuracy 1e-9
  trace b.q as v every 0.1 s
}
"""


def beside(t):
    """V C1 (V): C1 v' = (1 - v) + (w - v), C2 w' = (v - w) + (1 - w)/3."""
    rates = np.array([[-2.0, 1.0, 1.0], [1.0, -4.0 / 3.0, 1.0 / 3.0], [0.0, 0.0, 0.0]])
    return np.array([expm(rates * s)[0, 2] for s in t])


CASES = {
    "straight": (STRAIGHT, lambda t: 1.0 - np.exp(-t)),
    "divider": (DIVIDER, lambda t: 0.25 * np.exp(-t / 4.0)),
    "beside": (BESIDE, beside),
    "coils": (COILS, lambda t: 1.0 - np.exp(-t)),
    # at rest its slope is zero, and it resists all the same: v' = sqrt(1 - v)
    "quadratic": (QUADRATIC, lambda t: 1.0 - (1.0 - t / 2.0) ** 2),
}


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("name", CASES)
def test_a_step_across_stores(tmp_path, name, formulation):
    text, exact = CASES[name]
    trace = trace_of(tmp_path, text, formulation=formulation)
    late = trace.time > 1.0
    assert late.sum() == 10
    assert np.abs(trace["v"].values[late] - exact(trace.time[late] - 1.0)).max() < 3e-9
    assert np.abs(trace["v"].values[trace.time < 1.0]).max() < 1e-12


@pytest.mark.parametrize("formulation", FOUR[:2])
def test_a_damper_takes_along_what_hangs_on_it(tmp_path, formulation):
    trace = trace_of(tmp_path, DAMPER, formulation=formulation)
    late = trace.time > 0.5
    assert np.abs(trace["v"].values[late] - np.exp(-2.5 * (trace.time[late] - 0.5))).max() < 3e-9
