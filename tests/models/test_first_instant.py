"""What a trace says at the first instant: every quantity is consistent there, also what only hidden rates determine."""

from pathlib import Path

import pytest
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.trace.trace import Trace

ROOT = Path(__file__).resolve().parents[2]

SERIES = """
model series {
  param m = 1 kg
  param k1 = 3 N/m
  param k2 = 1 N/m
  node a, b: translation
  body: kinetic(p = m*f) b
  s1: potential(e = k1*q) a -> ground
  s2: potential(e = k2*q) b -> a
  init b.q = 0.4 m
  init b.f = 1 m/s
}
scene go of series {
  time 0 s to 1 s
  trace a.q as x, a.f as v, s1.e as e, body.e as force every 0.1 s
}
"""

LADDER = """
model divider {
  param C1 = 3 uF
  param C2 = 1 uF
  param L = 2 mH
  node s, a: electrical
  coil: kinetic(p = L*f) s -> ground
  c1: potential(q = C1*e) s -> a
  c2: potential(q = C2*e) a -> ground
  init coil.f = 2 A
  init c1.e = 1 V
  init c2.e = 2 V
}
scene go of divider {
  time 0 s to 0.1 ms
  trace c1.f as i1, c2.f as i2, coil.e as v every 10 us
}
"""


def first(tmp_path, text, formulation):
    path = tmp_path / "model.sd"
    path.write_text(text)
    report = Report()
    ran = run(RunRequest(str(path), formulation=formulation, output=str(tmp_path / "trace.h5")), report)
    assert ran is not None, [f"{d.code} {d.message}" for d in report]
    trace = Trace.open(tmp_path / "trace.h5")
    return {name: float(trace[name].values[0]) for name in trace.names}


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.one_in(5)
def test_springs_in_series(tmp_path, formulation):
    """A massless point between two springs: k1 x = k2 (y - x), so its flow is k2/(k1 + k2) of the body's."""
    found = first(tmp_path, SERIES, formulation)
    assert found == pytest.approx({"x": 0.1, "v": 0.25, "e": 0.3, "force": -0.3}, rel=1e-9)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_capacitors_in_series(tmp_path, formulation):
    """One current through all: minus the coil's."""
    found = first(tmp_path, LADDER, formulation)
    assert found == pytest.approx({"i1": -2.0, "i2": -2.0, "v": 3.0}, rel=1e-9)


@pytest.mark.long
def test_a_guess_on_a_singular_point_starts_alike_in_both_formulations(tmp_path):
    """What nothing determines stays at its guess: b ~ 0 is where b^2 has no slope."""
    path = ROOT / "tests" / "mutation" / "held.sd"
    for formulation in ("lagrangian", "hamiltonian"):
        report = Report()
        request = RunRequest(str(path), formulation=formulation, until="0.1", output=str(tmp_path / "t.h5"))
        ran = run(request, report)
        assert ran is not None
        trace = Trace.open(tmp_path / "t.h5")
        assert abs(trace["b"][0]) == pytest.approx(0.4, rel=1e-9)
        assert abs(trace["d'"][0]) <= 1e-9
        assert trace["a'"][0] == pytest.approx((0.05 - 0.1 * trace["b"][0]) / 0.3, rel=1e-5)
