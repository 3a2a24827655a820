"""Derivatives in traces: those that the equations determine, and no others."""

from pathlib import Path

import numpy as np
import pytest
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.trace.trace import Trace

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
@pytest.mark.long
def test_rates_that_no_equation_determines_are_not_stored(tmp_path, monkeypatch, file, formulation, known, unknown):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    output = str(tmp_path / "out.h5")
    run(RunRequest(str(MODELS / file), formulation=formulation, output=output, backend="numpy"), Report())
    trace = Trace.open(output)
    assert {name for name in trace.names if trace[name].derivative is not None} == known
    assert {name for name in trace.names if trace[name].derivative is None} == unknown
    for name in known - {"speed"}:
        quantity = trace[name]
        slope = np.gradient(quantity.values, trace.time, edge_order=2)
        assert np.allclose(quantity.derivative, slope, atol=5e-2 * np.max(np.abs(slope)))


@pytest.mark.long
def test_of_two_flows_whose_difference_alone_is_differentiated_no_rate_is_trusted(tmp_path, monkeypatch):
    """Radau made its values between the first steps of the start's rates: 17 % off."""
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    traces = []
    for accuracy in (1e-4, 1e-8):
        output = str(tmp_path / f"{accuracy}.h5")
        file = str(MODELS / "gallery" / "co_circuit.sd")
        run(RunRequest(file, "settle", None, "co_lagrangian", "radau", accuracy=accuracy, output=output), Report())
        traces.append(Trace.open(output))
    assert traces[0]["v1"].derivative is not None
    assert traces[0]["v2"].derivative is None
    for name in ("v1", "v2", "v3"):
        assert np.allclose(traces[0][name], traces[1][name], rtol=0.0, atol=1e-3 * traces[1][name].nominal)
