"""Models of a newcomer's first hour: every wrong turn is told, every last try runs, within three."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from sysdyn.api import Trace, load
from sysdyn.cli.main import run

FOLDER = Path(__file__).parent / "first_hour"
TRIES = sorted({p.name.partition(".")[0] for p in FOLDER.glob("*.sd")})
TURNS = {
    "quarter_car.1": ["E101", "E307"],
    "three_link_arm.1": ["E101", "E113", "E113"],
    "rectifier.1": ["E102", "E113", "E113"],
    "rectifier.2": ["E101", "E101", "E101", "E101", "E205"],
    "opamp_filter.1": ["E402"],
    "induction_motor.1": ["E113"] * 7,
    "induction_motor.2": ["E201"],
}


@pytest.mark.parametrize("name", TRIES)
@pytest.mark.long
def test_it_runs_within_three_tries(name, tmp_path, capsys):
    *wrong, right = sorted(FOLDER.glob(f"{name}.*.sd"))
    assert len(wrong) <= 2
    for path in wrong:
        assert run(["check", str(path), "--json"]) == 1
        found = json.loads(capsys.readouterr().out)["diagnostics"]
        assert sorted(d["code"] for d in found) == TURNS[path.stem]
        assert all(d["help"] for d in found)
    trace = tmp_path / "t.h5"
    assert run(["simulate", str(right), "-o", str(trace), "--quiet"]) == 0, capsys.readouterr().err
    assert Trace.open(trace).met


def test_what_the_models_show(tmp_path):
    """Against what is known of each: static gain, peak of the mains less two diodes, slip, rest of a PD law."""

    def ran(name):
        return load(sorted(FOLDER.glob(f"{name}.*.sd"))[-1]).run()

    car = ran("quarter_car")
    assert car["road"].max() == pytest.approx(0.05, rel=1e-6)
    assert abs(car["zs"][-1]) < 1.0  # mm: at rest again
    volts = ran("rectifier")
    assert 14.5 < volts["plus.e"][-1] < 12 * np.sqrt(2) - 1.0
    motor = ran("induction_motor")
    assert 1400.0 < motor["w"][-1] < 1500.0  # rpm: just below synchronous speed
    assert motor["Te"][-1] == pytest.approx(5.0, rel=0.02)
    arm = ran("three_link_arm")
    assert 30.0 < arm["q1"][-1] < 45.0  # deg: a PD law hangs below its target
    filtered = ran("opamp_filter")
    gain = 1 / abs(1 + 2j * (2 * np.pi * 1e3 * 1e-4) - (2 * np.pi * 1e3 * 1e-4) ** 2)  # both RC equal, gain one
    late = filtered.time > 8e-3
    assert np.abs(filtered["out.e"][late]).max() == pytest.approx(gain, rel=5e-3)


def test_a_fit_finds_what_made_the_data():
    model = load(FOLDER / "fit.1.sd")
    data = model.run({"k": 83.0, "d": 2.6})["x"] + np.random.default_rng(1).normal(0.0, 1e-4, 301)
    found = least_squares(lambda p: model.run({"k": p[0], "d": p[1]})["x"] - data, [60.0, 1.0], x_scale=[10.0, 1.0])
    assert found.x == pytest.approx([83.0, 2.6], rel=2e-3)
    assert repr(model.run()["x"]).startswith("<x [m]: 301 values, -")
    assert "ring of decay" in repr(model.run())
