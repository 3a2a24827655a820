"""First magnitudes beside the largest values met, of models whose sources start at zero."""

from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.accuracy import runs

MODELS = Path(__file__).resolve().parents[2] / "models"


def watched(monkeypatch, folder, name, **options):
    """Outcome; name, first magnitude and largest |y| of each unknown that carries the state, of the last run."""
    seen = []

    class Watched(runs.Integration):
        def __init__(self, *given):
            super().__init__(*given)
            seen.append((self, self.sizes.magnitude.copy()))

    monkeypatch.setattr(runs, "Integration", Watched)
    report = Report()
    found = run(RunRequest(str(MODELS / f"{name}.sd"), output=str(folder / "trace.h5"), **options), report)
    assert found is not None, [d.message for d in report.diagnostics]
    last, first = seen[-1]
    met, system = last.last()[2], last.system
    carried = last.roles.state & (system.nominal == 0.0) & (met > 0.0)
    return found.outcome, np.array(system.unknown_names)[carried], first[carried], met[carried]


@pytest.mark.long
def test_the_ring_modulator_is_sized_by_what_its_diodes_let_through(monkeypatch, tmp_path):
    """The whole of its sources on its diodes would be 1e13 times what they meet."""
    outcome, names, first, met = watched(monkeypatch, tmp_path, "benchmark/ring", scene="reference")
    assert outcome.met
    assert names.size == 15
    assert (first <= 50.0 * met).all(), dict(zip(names, first / met, strict=True))
    assert (first >= 0.1 * met).all(), dict(zip(names, first / met, strict=True))


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(2)
def test_a_rectifier_from_rest_needs_no_steps_to_find_its_sizes(monkeypatch, tmp_path, formulation):
    """The diode that blocks first is as large as a part of its like."""
    outcome, *_ = watched(monkeypatch, tmp_path, "gallery/rectifier_motor_slider", formulation=formulation)
    assert outcome.met
    assert outcome.statistics["steps"] < 16_000


BESIDE = """from std.electrical import voltage, resistor, capacitor, diode
from std.mechanical import mass
model beside {
  node s, a, b, p: electrical
  V: voltage(v = 10 V*sin(2*pi*3 Hz*t)) s -> b
  Rs: resistor(R = 1 ohm) s -> a
  D1: diode.complementary() a -> p
  D2: diode.complementary() b -> p
  D3: diode.complementary() ground -> a
  D4: diode.complementary() ground -> b
  C: capacitor(C = 20 mF) p -> ground
  R: resistor(R = 30 ohm) p -> ground
  init C.e = 0 V
  FAST
}
scene s of beside { time 0 s to 1 s; trace p.e OF_FAST every 20 ms }
"""
FAST = """coord y: translation = 0.5 m
  energy T* = 1/2*0.3 kg*y'^2
  work -0.3 kg*g0 on y
  phi floor: y >= 0 m restitution 0.6
  node x: translation
  M: mass.relativistic(m = 1e-9 kg) x
  S: potential(e = 1e-8 N/m*q) x -> ground
  init y' = 0 m/s
  init x.q = 0 m
  init M.p = 0.6 N.s
"""


@pytest.mark.filterwarnings("ignore:at times")
@pytest.mark.parametrize("accuracy", [1e-3, 1e-4])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(2)
def test_what_is_a_billion_times_as_fast_tells_no_time_to_others(tmp_path, accuracy, formulation):
    """A mass near the speed of light begins at zero beside a ball at half a metre, which is not its size: its time was
    2e-9 s by that, sources behind diodes were 1e12 V, and the bridge never led: 75 % off, told as done.
    """
    values, rows = [], np.linspace(0.0, 1.0, 51)
    for k, (text, more, asked) in enumerate(((FAST, ", y, x.q, M.p", accuracy), ("", "", 1e-6))):
        file = tmp_path / f"{k}.sd"
        file.write_text(BESIDE.replace("OF_FAST", more).replace("FAST", text))
        trace = simulate(file, output=tmp_path / f"{k}.h5", formulation=formulation, accuracy=asked)
        values.append(np.interp(rows, trace.time, np.asarray(trace["p.e"])))
    assert np.abs(values[0] - values[1]).max() < accuracy * np.abs(values[1]).max()
