"""A ball that a `when` throws up bounces without end by a finite instant, of which the text says nothing."""

import numpy as np
import pytest
from sysdyn import api

BALLS = {
    "flow": """\
  coord y: translation = 1 m
  energy T* = 1/2*(1 kg)*y'^2
  work -(1 kg)*g0 on y
  when y <= 0 m { y' := -0.8*y' }
""",
    "closing": """\
  coord y: translation = 1 m
  energy T* = 1/2*(1 kg)*y'^2
  work -(1 kg)*g0 on y
  when y <= 0 m and y' < 0 m/s { y' := -0.8*y' }
""",
    "state": """\
  state y: m = 1 m
  state v: m/s = 0 m/s
  dynamic y' = v
  dynamic v' = -g0
  when y <= 0 m { v := -0.8*v }
""",
}
G = 9.80665


def _heights(t, e=0.8):
    """The ball's height at the instants t (s), 0 where it has come to rest."""
    first = np.sqrt(2.0 / G)
    height, begin, speed = np.where(t <= first, 1.0 - 0.5 * G * t**2, 0.0), first, e * G * first
    for _ in range(200):
        s, flight = t - begin, 2.0 * speed / G
        height = np.where((s > 0.0) & (s <= flight), speed * s - 0.5 * G * s**2, height)
        begin, speed = begin + flight, e * speed
    return height


@pytest.mark.parametrize("method", ["auto", "rosenbrock", "dopri"])
@pytest.mark.parametrize("ball", BALLS)
@pytest.mark.one_in(5)
def test_ends_where_its_bounces_do(ball, method, tmp_path):
    """It fell through the floor, to -4.3 m, told as met: a flight of less than a micrometre was not seen to rise."""
    (tmp_path / "b.sd").write_text(f"model b {{\n{BALLS[ball]}}}\nscene s of b {{\n  time 0 s to 5 s\n  trace y\n}}\n")
    with pytest.raises(api.SolverFailure) as stopped:
        api.simulate(tmp_path / "b.sd", method=method, output=tmp_path / "out.h5")
    assert stopped.value.cause == "zeno"
    rest = np.sqrt(2.0 / G) * (1.0 + 2.0 * 0.8 / 0.2)
    assert rest - 1e-2 < stopped.value.time < rest
    trace = api.Trace.open(tmp_path / "out.h5")
    assert np.abs(trace["y"].values - _heights(trace.time)).max() < 1e-4


@pytest.mark.parametrize("method", ["auto", "bdf"])
@pytest.mark.one_in(2)
def test_holds_until_there(method, tmp_path):
    text = BALLS["flow"].replace("0.8", "0.95")
    (tmp_path / "b.sd").write_text(f"model b {{\n{text}}}\nscene s of b {{\n  time 0 s to 17 s\n  trace y\n}}\n")
    trace = api.simulate(tmp_path / "b.sd", method=method, output=tmp_path / "out.h5")
    assert np.abs(trace["y"].values - _heights(trace.time, 0.95)).max() < 1e-4
    assert len(trace.events) == 65


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("method", ["auto", "bdf"])
@pytest.mark.long
def test_what_an_event_stops_is_not_thrown(formulation, method, tmp_path):
    """It begins back from the limit at rest but for round-off, however low a flight that would be."""
    text = """\
model stopped {
  coord x: translation = 0 m
  energy T* = 1/2*(2 kg)*x'^2
  energy V = 1/2*(18 N/m)*x^2
  when x > 0.5 m { x' := 0 m/s }
  init x' = 3 m/s
}
scene s of stopped {
  time 0 s to 3 s
  trace x every 10 ms
}
"""
    (tmp_path / "m.sd").write_text(text)
    trace = api.simulate(tmp_path / "m.sd", method=method, formulation=formulation, output=tmp_path / "out.h5")
    met = np.arcsin(0.5) / 3.0
    exact = np.where(trace.time < met, np.sin(3.0 * trace.time), 0.5 * np.cos(3.0 * (trace.time - met)))
    assert np.abs(trace["x"].values - exact).max() < 5e-5
