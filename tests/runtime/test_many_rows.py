"""Rows of a step that holds many are as exact as single ones."""

from pathlib import Path

import numpy as np
import pytest
from sysdyn import api
from sysdyn.runtime.integrate.integrate import Integration

FILTER = """
from std.electrical import resistor, capacitor, inductor, voltage, diode
model filter {
  node a, b, c: electrical
  V: voltage(v = SOURCE) a -> ground
  R1: resistor(R = 1 kohm) a -> b
  C1: capacitor(C = 1 uF) b -> ground
  BRANCH
  R3: resistor(R = 3 kohm) c -> ground
  init C1.e = 0 V
}
scene s of filter { time 0 s to 20 ms; trace a.e as a, b.e as b, c.e as c, V.f as i ROWS }
"""
BRANCHES = {
    "linear": "R2: resistor(R = 2 kohm) b -> c",
    "diode": "D: diode(Is = 1 nA, vT = 50 mV) b -> c",
}


def rows(folder: Path, source: str, branch: str, method: str, asked: str):
    """The trace of a run with an rtol, and its rows as asked."""
    file = folder / "f.sd"
    text = FILTER.replace("SOURCE", source).replace("BRANCH", BRANCHES[branch])
    file.write_text(text.replace("ROWS", asked))
    return api.simulate(file, output=folder / "f.h5", method=method, rtol=1e-4)


@pytest.mark.parametrize("method", ["radau", "bdf", "rosenbrock"])
@pytest.mark.parametrize("branch", BRANCHES)
@pytest.mark.long
def test_many_rows_are_where_single_ones_are(branch, method, tmp_path):
    """Steps do not depend on rows: eleven alone are settled one by one, and 2001 have them among theirs."""
    source = "5 V*sin(2*pi*40 Hz*t)"
    many = rows(tmp_path, source, branch, method, "every 0.01 ms")
    values = {name: many[name].values[::200].copy() for name in "abci"}
    few = rows(tmp_path, source, branch, method, "every 2 ms")
    assert many.statistics["steps"] == few.statistics["steps"] < 100
    assert np.abs(many["audit.constraints"].values).max() < 1e-12
    for name, found in values.items():
        single = few[name].values
        assert np.abs(found - single).max() <= 1e-8 * np.abs(single).max()


PULSES = {
    "exp(-((t - 13.37 ms)/(30 us))^2)": lambda x: np.exp(-x * x),
    "1/(1 + ((t - 13.37 ms)/(30 us))^2)": lambda x: 1 / (1 + x * x),
}


@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.parametrize("pulse", PULSES)
@pytest.mark.long
def test_a_pulse_between_nodes_is_seen_by_its_rows(pulse, method, tmp_path):
    """What follows from the time alone is exact at each row, however narrow: 20 V for 0.03 ms beside a quiet filter."""
    trace = rows(tmp_path, f"1 V + 20 V*{pulse}", "linear", method, "every 0.01 ms")
    exact = 1.0 + 20.0 * PULSES[pulse]((trace.time - 13.37e-3) / 30e-6)
    assert np.abs(trace["a"].values - exact).max() < 1e-9
    flow = (trace["a"].values - trace["b"].values) / 1e3
    assert np.abs(np.abs(trace["i"].values) - np.abs(flow)).max() < 1e-11
    assert np.abs(trace["c"].values - 0.6 * trace["b"].values).max() < 1e-9


@pytest.mark.long
def test_a_row_of_a_steep_law_is_measured_as_its_last_move_leaves_it(monkeypatch, tmp_path):
    """Rates that follow flows are put with each move: what was measured behind the last one is what the row tells."""
    kept = []

    def run(self, *given, **more):
        found = whole(self, *given, **more)
        kept.append((self.settler.core.contents.calls, self.settler.system.core.residual_evaluations))
        return found

    whole = Integration.run
    monkeypatch.setattr(Integration, "run", run)
    rows(tmp_path, "5 V*sin(2*pi*40 Hz*t)", "diode", "bdf", "every 0.2 ms")
    ((settled, measured),) = kept
    assert settled > 100
    assert measured < 5 * settled  # as they come, and behind three or four moves
