"""Orbits in few steps: loose tolerances, whose errors do not fall as an order says, and pairs that agree by chance."""

import numpy as np
import pytest
from sysdyn.api import simulate

ORBIT = """
model orbit {
  param GM = 1 m^3/s^2
  param m = 1 kg
  param ex = 0.6                       # eccentricity
  coord x: translation = (1 - ex)*(1 m)
  coord y: translation = 0 m
  energy T* = 1/2*m*(x'^2 + y'^2)
  energy V = -GM*m/sqrt(x^2 + y^2)
  init x' = 0 m/s
  init y' = sqrt((1 + ex)/(1 - ex))*(1 m/s)
}
scene turns of orbit { time 0 s to END s; trace x, y every STEP s }
"""


def kepler(t, ex):
    """Positions at instants [k] by Kepler's equation (Newton's method): x, y."""
    anomaly = t.copy()
    for _ in range(300):
        anomaly -= (anomaly - ex * np.sin(anomaly) - t) / (1.0 - ex * np.cos(anomaly))
    return np.cos(anomaly) - ex, np.sqrt(1.0 - ex * ex) * np.sin(anomaly)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("turns", [3, 8, 15])
@pytest.mark.long
def test_what_is_met_is_not_off_by_more_than_three_times(tmp_path, monkeypatch, formulation, turns):
    monkeypatch.chdir(tmp_path)
    end = 2.0 * np.pi * turns
    path = tmp_path / "orbit.sd"
    path.write_text(ORBIT.replace("END", repr(end)).replace("STEP", repr(end / 600.0)), encoding="utf-8")
    for accuracy in (1e-2, 3e-3, 1e-3):
        for ex in (0.3, 0.55, 0.65):
            trace = simulate(str(path), formulation=formulation, accuracy=accuracy, set={"ex": ex})
            exact = kepler(np.array(trace.time), ex)
            errors = [np.abs(trace[k].values - v).max() / np.abs(v).max() for k, v in zip("xy", exact, strict=True)]
            assert trace.attributes["met"] == 1
            assert max(errors) < 3.0 * accuracy, (accuracy, ex)
