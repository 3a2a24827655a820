"""Dry friction on the slider of a crank: at its dead centres friction that would stick has no finite reaction."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn import api

CRANK = """\
model crank {
  coord th: rotation = 0.5 rad
  coord x: translation ~ 0.6 m
  energy T* = 1/2*0.1 kg.m^2*th'^2 + 1/2*2 kg*x'^2
  phi rod: (x - 0.2 m*cos(th))^2 + (0.2 m*sin(th))^2 = (0.5 m)^2
  content D = 3 N*abs(x') + 1/2*0.05 N.m.s*th'^2
  init th' = 8 rad/s
}
scene turns of crank {
  time 0 s to 4 s
  trace th, x, rod.multiplier as push every 10 ms
}
"""


def _slider(th):
    """The slider's place, and its first two derivatives by the angle."""
    root = np.sqrt(0.25 - (0.2 * np.sin(th)) ** 2)
    lean = 0.04 * np.sin(th) * np.cos(th)
    first = -0.2 * np.sin(th) - lean / root
    second = -0.2 * np.cos(th) - 0.04 * np.cos(2.0 * th) / root - lean**2 / root**3
    return 0.2 * np.cos(th) + root, first, second


def _rate(th, speed, sense):
    """th'' where the slider slips in a sense: (J + m x_th^2) th'' = -m x_th x_thth th'^2 - b th' - F x_th sense."""
    _, first, second = _slider(th)
    return -(2.0 * first * second * speed**2 + 0.05 * speed + 3.0 * first * sense) / (0.1 + 2.0 * first**2)


def _exact(times):
    """Angle [rad] and push of the rod [N/m] at instants (s), each stretch of one sense until th' or x' is zero."""
    begin, state, found, push = 0.0, np.array([0.5, 8.0]), np.zeros(times.size), np.zeros(times.size)
    while begin < times[-1]:
        sense = np.sign(_slider(state[0] + 1e-6 * state[1])[1] * state[1])
        ends = [lambda _t, s: _slider(s[0])[1], lambda _t, s: s[1]]
        for end in ends:
            end.terminal = True
        ends[0].direction = -1.0 if sense > 0.0 else 1.0
        run = solve_ivp(
            lambda _t, s, sense=sense: [s[1], _rate(*s, sense)], (begin, times[-1]), state, events=ends,
            method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True,
        )  # fmt: skip
        here = (times >= begin) & (times <= run.t[-1])
        found[here], speed = run.sol(times[here])
        x, first, second = _slider(found[here])
        force = 2.0 * (first * _rate(found[here], speed, sense) + second * speed**2) + 3.0 * sense
        push[here] = -force / (2.0 * (x - 0.2 * np.cos(found[here])))
        begin, state = run.t[-1], run.y[:, -1]
        if run.t_events[1].size:  # at rest nothing moves it
            found[times > begin], push[times > begin] = state[0], 0.0
            break
    return found, push


def _missed(trace, accuracy):
    """The quantities that miss the accuracy at rows 0.1 ms or more from an event."""
    events = np.unique([event.time for event in trace.events])
    rows = np.abs(trace.time[:, None] - events).min(axis=1) > 1e-4
    angle, push = _exact(trace.time[rows])
    exact = {"th": angle, "x": _slider(angle)[0], "push": push}
    return [n for n, v in exact.items() if np.abs(trace[n].values[rows] - v).max() > accuracy * np.abs(v).max()]


@pytest.mark.parametrize(
    ("method", "accuracy"),
    [("auto", 1e-3), ("auto", 1e-6), ("radau", 1e-3), ("radau", 1e-6), ("rosenbrock", 1e-3), ("rosenbrock", 1e-6),
     ("rosenbrock", 1e-7), ("rosenbrock", 1e-8), ("bdf", 1e-3), ("bdf", 1e-4), ("bdf", 1e-6), ("bdf", 1e-7),
     ("bdf", 1e-8)],
)  # fmt: skip
@pytest.mark.long
def test_a_crank_runs_down(method, accuracy, tmp_path):
    """A trial of friction that sticks there made 1e27 of a multiplier and of a rate, and points behind were settled
    beside that: they were off by 6 N, and at rest slips followed each other without end (E934).
    """
    (tmp_path / "crank.sd").write_text(CRANK)
    trace = api.simulate(tmp_path / "crank.sd", method=method, accuracy=accuracy, output=tmp_path / "out.h5")
    assert not _missed(trace, accuracy)


@pytest.mark.parametrize(("method", "rtol"), [("radau", 1e-4), ("rosenbrock", 1e-8)])
@pytest.mark.one_in(2)
def test_a_crank_comes_to_rest_by_its_own_tolerance(method, rtol, tmp_path):
    """No set of constraints fitted there (E930)."""
    (tmp_path / "crank.sd").write_text(CRANK)
    trace = api.simulate(tmp_path / "crank.sd", method=method, rtol=rtol, output=tmp_path / "out.h5")
    assert [event.after for event in trace.events] == ["slips +", "slips -", "sticks"]
    assert not _missed(trace, 30 * rtol)
