"""Currents in a loop of capacitors: no law says them, they follow from the rates of their voltages.

At every row, those at the two sides of an instant among them, against Kirchhoff's laws in the voltages of that row.
"""

import numpy as np
import pytest
from model_runs import FOUR, trace_of

TEXT = """
model loop {{
  node a, b: electrical
  Ca: potential(q = 0.2 F*e) a -> ground
  Cb: potential(q = 0.3 F*e) b -> ground
  Cc: potential(q = 1.1 F*e) a -> b
  {what}
}}
scene run of loop {{
  time 0 s to 1 s
  trace Ca.e, Cb.e, Ca.f, Cb.f, Cc.f every 0.01 s
  accuracy 1e-7
}}
"""
FED = "S: flow(f = 7.7 A*sin(3 rad/s*t)^5) ground -> b\n  "
CASES = {
    "a resistor is switched": (
        "discrete h = 1\n  R: dissipator(e = 2 ohm*h*f) b -> a\n  " + FED + "every 0.794 s { h := 1.2 - h }",
        lambda behind: (np.where(behind(0.794), 2.0, 0.4), lambda t: 7.7 * np.sin(3 * t) ** 5),
    ),
    "a source jumps": (
        "R: dissipator(e = 2 ohm*f) b -> a\n  S: flow(f = 1.5 A*step(t - 0.305 s)) ground -> b",
        lambda behind: (2.0, lambda t: np.where(behind(0.305), 1.5, 0.0)),
    ),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("formulation", FOUR)
def test_currents_in_a_loop_of_capacitors(tmp_path, formulation, case):
    """(Ca + Cc) a' - Cc b' = i, (Cb + Cc) b' - Cc a' = s - i, i = (b - a)/R."""
    what, law = CASES[case]
    trace = trace_of(tmp_path, TEXT.format(what=what), scene="run", formulation=formulation)
    t = trace.time
    later = np.append(False, np.diff(t) == 0.0)  # of two rows at one instant
    resistance, source = law(lambda at: (t > at + 1e-9) | later & (t > at - 1e-9))
    source = source(t)
    a, b = trace["Ca.e"].values, trace["Cb.e"].values
    through = (b - a) / resistance
    rate = np.linalg.solve([[1.3, -1.1], [-1.1, 1.4]], [through, source - through])
    for name, flow in {"Ca.f": 0.2 * rate[0], "Cb.f": 0.3 * rate[1], "Cc.f": 1.1 * (rate[0] - rate[1])}.items():
        assert np.abs(trace[name].values - flow).max() < 1e-7 * np.abs(flow).max(), name
