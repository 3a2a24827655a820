"""Powers are summed over steps far more exactly than the tolerance that steps are taken by."""

import math

import chain_model as chain
import numpy as np
import pytest
from sysdyn.cli.main import run
from sysdyn.runtime.integrate.integrate import Integration, Request
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.trace.trace import Trace

DRIVEN = """model driven {
  param r = 2 ohm
  coord x: electrical = 0 C
  content D = 1/2*r*x'^2
  psi source: x' = 1 A*FLOW
}

scene s of driven {
  time 0 s to 1.9 s
  trace x, audit.dissipated as heat
}
"""
OMEGA = 2.0 * math.pi


@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-6])
@pytest.mark.long
def test_what_a_known_flow_dissipates(rtol, tmp_path):
    """x' = sin(omega t) solves no equation: r int x'^2 = r (t/2 - sin(2 omega t)/(4 omega)) tests the sums alone."""
    (tmp_path / "d.sd").write_text(DRIVEN.replace("FLOW", "sin(2*pi*1 Hz*t)"))
    asked = ["simulate", str(tmp_path / "d.sd"), "--method", "bdf", "--rtol", str(rtol), "-o", str(tmp_path / "d.h5")]
    assert run([*asked, "--quiet"]) == 0
    trace = Trace.open(tmp_path / "d.h5")
    exact = 2.0 * (trace.time / 2.0 - np.sin(2.0 * OMEGA * trace.time) / (4.0 * OMEGA))
    assert np.abs(trace["heat"].values - exact).max() < 0.3 * rtol * exact[-1]
    assert np.abs(trace["audit.energy"].values).max() < 0.1 * rtol * exact[-1]


@pytest.mark.long
def test_a_pulse_within_steps_is_not_taken_for_what_the_steps_before_it_were(tmp_path):
    """A flow that rests and then rises by exp(-((t - 1)/0.02)^2): r int x'^2 = r 0.02 sqrt(pi/2)."""
    (tmp_path / "d.sd").write_text(DRIVEN.replace("FLOW", "exp(-((t - 1 s)/(20 ms))^2)"))
    asked = ["simulate", str(tmp_path / "d.sd"), "--method", "bdf", "--rtol", "1e-5", "-o", str(tmp_path / "d.h5")]
    assert run([*asked, "--quiet"]) == 0
    trace = Trace.open(tmp_path / "d.h5")
    exact = 2.0 * 0.02 * math.sqrt(math.pi / 2.0)
    assert trace["heat"].values[-1] == pytest.approx(exact, rel=1e-5)


def _looks(rows):
    """How often a run of a chain with so many rows, beside its steps, looks at energies and powers; its steps."""
    seen = []

    class Watched(chain.Chain):
        @classmethod
        def audit_rows(cls, *given):
            seen.append(given[5])
            super().audit_rows(*given)

    system = System({"structure": chain.structure()}, chain.binding(2), load(Watched), "3")
    instants = np.linspace(0.0, 0.2, rows)
    asked = Request(0.2, instants, every_step=False, rtol=1e-6, index=3)
    integration = Integration(system, consistent_start(system, 0.0), asked)
    before = len(seen)
    steps = integration.run(lambda _: None).statistics.steps
    return len(seen) - before, steps


@pytest.mark.long
def test_rows_within_a_step_take_the_powers_that_its_integral_took():
    """A row looks at its own energies and no more: the polynomial of powers is there, of its step and those before."""
    (few, steps), (many, same) = _looks(5), _looks(81)
    assert steps == same > 80 / 3  # no step holds so many rows that points of its own serve them
    assert many - few < 1.5 * 76
