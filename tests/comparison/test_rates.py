"""Derivatives in traces: those that the equations determine, and no others."""

from pathlib import Path

import numpy as np
import pytest
from sysdyn.cli.running import Request, run
from sysdyn.dsl.diagnostics import Report
from sysdyn.runtime.trace import Trace

MODELS = Path(__file__).resolve().parents[2] / "models"


@pytest.mark.parametrize(
    ("file", "formulation", "known", "unknown"),
    [
        ("seed/pendulum.sd", "lagrangian", {"q1", "q2", "f1", "f2", "speed"}, {"kappa1"}),
        ("seed/pendulum.sd", "hamiltonian", {"q1", "q2", "f1", "f2", "speed"}, {"kappa1"}),
        ("seed/pendulum_spring.sd", "lagrangian", {"q1", "q2", "p1", "p2", "w"}, {"z"}),
        ("gallery/diode_circuit.sd", "lagrangian", set(), {"current", "drop"}),
    ],
)
def test_rates_that_no_equation_determines_are_not_stored(tmp_path, monkeypatch, file, formulation, known, unknown):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    output = str(tmp_path / "out.h5")
    run(Request(str(MODELS / file), formulation=formulation, output=output, backend="numpy"), Report())
    trace = Trace.open(output)
    assert {name for name in trace.names if trace[name].derivative is not None} == known
    assert {name for name in trace.names if trace[name].derivative is None} == unknown
    for name in known - {"speed"}:
        quantity = trace[name]
        slope = np.gradient(quantity.values, trace.time, edge_order=2)
        assert np.allclose(quantity.derivative, slope, atol=5e-2 * np.max(np.abs(slope)))
