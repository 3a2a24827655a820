"""What is at rest until a force begins steeply: how large it gets is told by what follows, not by the first instant."""

import numpy as np
import pytest
from running import ran
from scipy.integrate import solve_ivp

TEXT = """
model m {
  node x: translation
  M: kinetic(p = 1 kg*f) x
  K: potential(e = 4 N/m*q) x -> ground
  D: dissipator(e = 0.2 N.s/m*f) x -> ground
  F: effort(e = %s) ground -> x
}
scene s of m {
  time 0 s to 10 s
  trace x.q as x every 50 ms
}
"""
BEGIN = np.arcsin(0.999999)
FORCES = {
    "a ramp of a millisecond, and back": (
        "clip(1e6 N/s*(t - 4 s), 0 N, 1000 N) - clip(1e6 N/s*(t - 4.002 s), 0 N, 1000 N)",
        lambda t: np.clip(1e6 * (t - 4.0), 0.0, 1e3) - np.clip(1e6 * (t - 4.002), 0.0, 1e3),
        (4.0, 4.001, 4.002, 4.003, 10.0),
    ),
    "the tip of a sine": (
        "1e9 N*max(sin(t/(1 s)) - 0.999999, 0)",
        lambda t: 1e9 * max(np.sin(t) - 0.999999, 0.0),
        (BEGIN, np.pi - BEGIN, 2.0 * np.pi + BEGIN, 3.0 * np.pi - BEGIN, 10.0),
    ),
}


@pytest.mark.parametrize("force", FORCES)
@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-9])
@pytest.mark.one_in(5)
def test_forces_that_begin_steeply_late(force, accuracy, tmp_path):
    """Hundreds of steps of 1e-15 s and E930 before, for sizes were those of round-off of the force."""
    text, law, knots = FORCES[force]
    found, rows = ran(tmp_path, TEXT % text, accuracy=accuracy), np.linspace(0.0, 10.0, 201)
    assert found.met
    assert found.outcome.statistics["steps"] < 600
    x, state = np.zeros(rows.size), [0.0, 0.0]
    for begin, end in zip((0.0, *knots), knots, strict=False):
        within = (rows > begin) & (rows <= end)
        swing = solve_ivp(
            lambda t, y: (y[1], law(t) - 4.0 * y[0] - 0.2 * y[1]),
            (begin, end),
            state,
            t_eval=np.unique(np.append(rows[within], end)),
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
        )
        x[within], state = swing.y[0, : within.sum()], swing.y[:, -1]
    assert np.abs(found.at("x", rows) - x).max() < accuracy * np.abs(x).max()
