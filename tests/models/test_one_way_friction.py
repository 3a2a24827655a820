"""A content of max(v, 0) resists one way and holds: set-valued at rest, as abs(v) is."""

import numpy as np
import pytest
from model_runs import trace_of

SPRUNG = """model sprung {
  coord s: translation = 0 m
  energy T* = 1/2*(2 kg)*s'^2
  energy V = 1/2*(50 N/m)*s^2
  content D = %s
  init s' = 1 m/s
}
scene go of sprung {
  time 0 s to 3 s
  trace s, s'
  accuracy 1e-7
}
"""
TEXTS = {
    "max": "(4 N)*max(s', 0 m/s)",
    "halves": "(4 N)*(abs(s') + s')/2",
    "min": "-(4 N)*min(0 m/s, -s')",
}


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("content", TEXTS.values(), ids=TEXTS)
@pytest.mark.one_in(5)
def test_it_slips_back_freely_and_holds_at_last(tmp_path, content, formulation):
    """Half cycles about -8 cm with it and about 0 without: at rest at 8 cm less the third amplitude."""
    trace = trace_of(tmp_path, SPRUNG % content, formulation=formulation)
    first = np.hypot(0.08, 0.2) - 0.08
    rest = -0.08 + (first - 0.08)
    turns = np.arctan2(0.2, 0.08) / 5 + np.pi / 5 * np.arange(3)
    assert [e.time for e in trace.events] == pytest.approx(turns, abs=1e-6)
    assert trace["s"].values[-1] == pytest.approx(rest, abs=2e-8)
    assert abs(trace["s'"].values[-1]) < 1e-10
    assert (trace["audit.energy"].values < 1e-6).all()


@pytest.mark.long
def test_a_square_of_it_is_smooth(tmp_path):
    trace = trace_of(tmp_path, SPRUNG % "1/2*(4 N.s/m)*max(s', 0 m/s)^2")
    assert not trace.events or all("slips" not in e.after for e in trace.events)
