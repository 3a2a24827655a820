"""Contacts that let go at rest: reaction, speed and acceleration are zero there, the gap opens by its jerk alone."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sysdyn import api
from sysdyn.runtime.events.locate import Edges, crossing

G = 9.80665

TABLE = """\
model on_a_table {
  coord y: translation = 0 m
  energy T* = 1/2*(3 kg)*y'^2
  work -(3 kg)*g0 on y
  phi table: y >= 2 cm*sin(30 rad/s*t) restitution 0
  init y' = 0.6 m/s
}
scene shaken of on_a_table {
  time 0 s to 0.2 s
  trace y every 2 ms
}
"""

LADDER = """\
model ladder {
  param L = 2 m
  param m = 5 kg
  coord x: translation = 1 m*sin(0.2)
  coord y: translation = 1 m*cos(0.2)
  coord th: rotation = 0.2 rad
  energy T* = 1/2*m*(x'^2 + y'^2) + 1/2*(1/12*m*L^2)*th'^2
  work -m*g0 on y
  phi floor: y - L/2*cos(th) >= 0 m restitution 0
  phi wall: x - L/2*sin(th) >= 0 m restitution 0
  init x' = 0 m/s
  init y' = 0 m/s
  init th' = 0 rad/s
}
scene slides of ladder {
  time 0 s to 1.1 s
  trace th, x every 10 ms
}
"""


def run(tmp_path, text, method, accuracy):
    (tmp_path / "model.sd").write_text(text)
    return api.simulate(tmp_path / "model.sd", method=method, accuracy=accuracy, output=tmp_path / "out.h5")


def thrown_up(t):
    """On the table until its acceleration is -g, then free, then on it again."""
    a, w = 0.02, 30.0
    off = np.arcsin(G / (a * w * w)) / w
    y, v = a * np.sin(w * off), a * w * np.cos(w * off)
    free = lambda s: y + v * (s - off) - G / 2 * (s - off) ** 2  # noqa: E731
    back = brentq(lambda s: free(s) - a * np.sin(w * s), off + 0.05, 0.2)
    return np.where((t > off) & (t < back), free(t), a * np.sin(w * t))


def slid(t):
    """Both ends held until the wall would pull, then the floor alone (angle, rate, place of the centre, speed)."""
    length = 2.0

    def held(_t, z):
        turn = 1.5 * G / length * np.sin(z[0])
        return [z[1], turn, z[3], length / 2 * (np.cos(z[0]) * turn - np.sin(z[0]) * z[1] ** 2)]

    def floor(_t, z):
        s, c = np.sin(z[0]), np.cos(z[0])
        turn = (G - length / 2 * c * z[1] ** 2) * length / 2 * s / (length**2 / 12 + length**2 / 4 * s * s)
        return [z[1], turn, z[3], 0.0]

    pulls = lambda t, z: held(t, z)[3]  # noqa: E731
    pulls.terminal, pulls.direction = True, -1
    exact = {"rtol": 1e-11, "atol": 1e-13, "dense_output": True, "method": "DOP853"}
    first = solve_ivp(held, (0.0, 1.1), [0.2, 0.0, length / 2 * np.sin(0.2), 0.0], events=pulls, **exact)
    then = solve_ivp(floor, (first.t[-1], 1.1), first.y[:, -1], **exact)
    off = first.t[-1]
    return np.where(t <= off, first.sol(np.minimum(t, off)), then.sol(np.maximum(t, off)))[[0, 2]]


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6])
@pytest.mark.long
def test_a_body_leaves_a_shaken_table(tmp_path, accuracy):
    """The bdf's first step, of order 1, is off by g h^2/2: more than the gap has opened."""
    trace = run(tmp_path, TABLE, "bdf", accuracy)
    assert np.abs(trace["y"].values - thrown_up(trace.time)).max() <= accuracy * 0.06


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6])
@pytest.mark.one_in(2)
def test_a_ladder_leaves_the_wall(tmp_path, accuracy):
    trace = run(tmp_path, LADDER, "bdf", accuracy)
    th, x = slid(trace.time)
    assert np.abs(trace["th"].values - th).max() <= accuracy * th.max()
    assert np.abs(trace["x"].values - x).max() <= accuracy * x.max()


def test_a_gap_below_its_level_that_does_not_close_has_not_fallen():
    """From rest: by an error of the step it lies lower, at a rate that is none; at a rate that is one it falls."""
    drawn = lambda rate: lambda t: np.array([-1e-8 * t, rate * t])  # noqa: E731
    watch = Edges(*(np.array([one]) for one in (0, 1, 1, 1e-12, 0.0, 1e-9)))
    assert crossing(drawn(1e-6), watch, 0.0, 1.0) is None
    assert crossing(drawn(-1e-10), watch, 0.0, 1.0) is None
    assert crossing(drawn(-1e-6), watch, 0.0, 1.0) is not None
