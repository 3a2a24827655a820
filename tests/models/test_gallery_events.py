"""Models of the gallery with events, against what is known in closed form."""

from math import asin, cos, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import simulate

GALLERY = Path(__file__).parents[2] / "models" / "gallery"
G0 = 9.80665


def test_the_last_ball_of_the_cradle_leaves_with_what_came_in(tmp_path):
    """Two impacts one after another, each an exchange of speeds between equal masses."""
    swing, gap, w = 0.02, 1e-4, sqrt(G0 / 0.3)
    first = (pi / 2 + asin(gap / swing)) / w
    speed = swing * w * sin(w * first)
    turn = asin(gap * w / speed)
    second, left = first + turn / w, speed * cos(turn)
    run = simulate(GALLERY / "newtons_cradle.sd", at=["0.4"], o=tmp_path / "x.h5")
    k = abs(run.time - 0.4).argmin()
    assert run["x3"][k] / 1e3 == pytest.approx(left / w * sin(w * (0.4 - second)), rel=0, abs=1e-6 * swing)


def test_the_clutch_locks_alike_by_friction_and_by_events(tmp_path):
    """One speed behind the lock, from two texts of one clutch."""
    ends = [
        simulate(GALLERY / "clutch_launch.sd", scene=scene, accuracy=1e-6, o=tmp_path / f"{scene}.h5")["engine"][-1]
        for scene in ("launch", "modes")
    ]
    assert ends[0] == pytest.approx(ends[1], rel=2e-6)


@pytest.mark.parametrize("name", ["six_pulse_rectifier", "buck_converter", "piston_pump", "backlash_gear"])
def test_what_a_model_expects_holds(name, tmp_path):
    """Its own expects are closed forms, or bounds, and raise where they fail; the books close."""
    run = simulate(GALLERY / f"{name}.sd", accuracy=1e-6, o=tmp_path / "x.h5")
    assert run.statistics["error_estimate"] <= 1e-6
    assert len(run.events) > 10


def test_the_teeth_of_a_gear_with_play_keep_their_distance_and_lose_energy_at_each_knock(tmp_path):
    run = simulate(GALLERY / "backlash_gear.sd", accuracy=1e-6, o=tmp_path / "x.h5")
    assert max(abs(run["gap"].values)) <= 0.01 + 1e-9
    first = next(e.time for e in run.events if e.name == "impact forward")
    # alone until the first knock: J1 driver' = T/w (1 - cos w t), so the play of 0.01 rad is crossed where
    # T/(J1 w^2) (w t - sin w t) = 0.01
    assert 1.0 / (0.01 * 36.0) * (6.0 * first - sin(6.0 * first)) == pytest.approx(0.01, rel=0, abs=1e-8)


@pytest.mark.parametrize("method", ["bdf", "rosenbrock"])
def test_what_relaxes_behind_an_event_within_a_row_counts(method, tmp_path):
    """The valves of the pump open into flows that follow within a millisecond, the interval of the trace."""
    file, accuracy = GALLERY / "piston_pump.sd", 1e-4
    run = simulate(file, method=method, accuracy=accuracy, o=tmp_path / "x.h5")
    exact = simulate(file, method="radau", accuracy=1e-8, o=tmp_path / "exact.h5")
    rows, one, two = np.intersect1d(run.time, exact.time, return_indices=True)
    assert rows.size > 1900
    for name in run.names:
        apart = np.abs(run[name].values[one] - exact[name].values[two]).max()
        assert apart < accuracy * exact[name].nominal, name
