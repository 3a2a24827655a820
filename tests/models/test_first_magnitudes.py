"""First magnitudes beside the largest values met, of models whose sources start at zero."""

from pathlib import Path

import numpy as np
import pytest
from sysdyn.cli.run.asked import Request
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.integrate import runs

MODELS = Path(__file__).resolve().parents[2] / "models"


def watched(monkeypatch, folder, name, **options):
    """Outcome; name, first magnitude and largest |y| of each unknown that carries the state, of the last run."""
    seen = []

    class Watched(runs.Integration):
        def __init__(self, *given):
            super().__init__(*given)
            seen.append((self, self.magnitude.copy()))

    monkeypatch.setattr(runs, "Integration", Watched)
    report = Report()
    found = run(Request(str(MODELS / f"{name}.sd"), output=str(folder / "trace.h5"), **options), report)
    assert found is not None, [d.message for d in report.diagnostics]
    last, first = seen[-1]
    met, system = last._sizes()[0], last.system
    carried = last.roles.state & (system.nominal == 0.0) & (met > 0.0)
    return found.outcome, np.array(system.unknown_names)[carried], first[carried], met[carried]


def test_the_ring_modulator_is_sized_by_what_its_diodes_let_through(monkeypatch, tmp_path):
    """The whole of its sources on its diodes would be 1e13 times what they meet."""
    outcome, names, first, met = watched(monkeypatch, tmp_path, "benchmark/ring", scene="reference")
    assert outcome.met
    assert names.size == 15
    assert (first <= 50.0 * met).all(), dict(zip(names, first / met, strict=True))
    assert (first >= 0.1 * met).all(), dict(zip(names, first / met, strict=True))


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
def test_a_rectifier_from_rest_needs_no_steps_to_find_its_sizes(monkeypatch, tmp_path, formulation):
    """The diode that blocks first is as large as a part of its like."""
    outcome, *_ = watched(monkeypatch, tmp_path, "gallery/rectifier_motor_slider", formulation=formulation)
    assert outcome.met
    assert outcome.statistics["steps"] < 16_000
