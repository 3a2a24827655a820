"""Events, discrete variables and laws with corners in a `for`: each element by itself, against closed forms."""

from math import exp, floor, log

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of
from sysdyn.api import load

HEATED = """
from std.control import hysteresis
model m {
  param n = 3
  node r[1..n]: heat = celsius(15)
  for i in 1..n {
    C[i]: potential(q = 100 J/K*i*e) r[i] -> ground
    G[i]: dissipator(f = 2 W/K*(e - celsius(5))) r[i] -> ground
    H[i]: hysteresis(on_at = -celsius(19), off_at = -celsius(21), lo = 0 W, hi = 60 W, begins = 1) u = -r[i].e
    Q[i]: flow(f = H[i].y) ground -> r[i]
  }
}
scene s of m { time 0 s to 300 s; trace r[1..n].e in degC as T every 7 s }
"""


def heated(t, tau):
    """degC at t: towards 35 from 15 until 21, then to and fro between 21 and 19."""
    on = tau * log(20 / 14)
    if t <= on:
        return 35 - 20 * exp(-t / tau)
    cools, heats = tau * log(16 / 14), tau * log(16 / 14)
    t = (t - on) % (cools + heats)
    return 5 + 16 * exp(-t / tau) if t <= cools else 35 - 16 * exp(-(t - cools) / tau)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(5)
def test_thermostats_side_by_side(tmp_path, formulation):
    trace = trace_of(tmp_path, HEATED, formulation=formulation, accuracy=1e-6)
    for i in (1, 2, 3):
        wanted = np.array([heated(t, 50.0 * i) for t in trace.time])
        assert np.max(np.abs(trace[f"T[{i}]"] - wanted)) < 21e-5


COUNTED = """
model m {
  param n = 3
  state x[1..n]: m = 0 m
  discrete k[1..n] = 0
  discrete v[1..n]: m/s = [1 m/s, 2 m/s, 3 m/s]
  discrete up[1..2] = false
  coord y[1..2]: translation = 1 m
  energy T* = 1/2*1 kg*(y[1]'^2 + y[2]'^2)
  for i in 1..n {
    discrete late[i]: s = 0.1 s*i
    dynamic x[i]' = v[i]
    when x[i] >= 1 m { x[i] := 0 m; k[i] := k[i] + 1; late[i] := t + late[i] }
  }
  for i in 1..2 {
    init y[i]' = -1 m/s*i
    every 0.4 s*i { up[i] := not up[i] }
  }
  when y[1] <= 0 m { y[1]' := -y[1]' }
  when y[2] <= 0 m { y[2]' := 3*abs(y[1]') }
}
scene s of m {
  time 0 s to 1.9 s
  trace k[1..n] as k, x[1..n] as x, late[1..n] as late, y[1..2] as y, up[1..2] as up every 0.07 s
}
"""


@pytest.mark.parametrize("method", ["auto", "bdf", "radau"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.one_in(3)
def test_events_assign_elements(tmp_path, formulation, method):
    trace = trace_of(tmp_path, COUNTED, formulation=formulation, method=method, accuracy=1e-7)

    def off(name, closed):
        return np.max(np.abs(trace[name] - [closed(t) for t in trace.time])[away])

    away = np.ones(len(trace.time), dtype=bool)  # not at the instants of jumps, which the trace has on both sides
    for instant in (*np.arange(0.0, 2.0, 1 / 3), *np.arange(0.0, 2.0, 0.4), 0.5, 1.5):
        away &= np.abs(trace.time - instant) > 1e-6
    for i in (1, 2, 3):
        assert off(f"k[{i}]", lambda t, i=i: floor(i * t)) == 0.0
        assert off(f"x[{i}]", lambda t, i=i: i * t % 1) < 1e-6
        assert off(f"late[{i}]", lambda t, i=i: 0.1 * i + sum(j / i for j in range(1, floor(i * t) + 1))) < 1e-6
    assert off("y[1]", lambda t: abs(1 - t)) < 1e-6
    assert off("y[2]", lambda t: 1 - 2 * t if t < 0.5 else 3 * (t - 0.5)) < 1e-6
    assert off("up[1]", lambda t: (floor(t / 0.4) + 1) % 2) == 0.0
    assert off("up[2]", lambda t: (floor(t / 0.8) + 1) % 2) == 0.0


RELAYS = """
model m {
  param n = 4
  state x[1..n]: m = 0.1 m
  for i in 1..n { dynamic x[i]' = 1 m/s*(0.5 + i - 2*i*step(x[i] - 0.2 m*i)) }
}
scene s of m { time 0 s to 1 s; trace x[1..n] as x every 0.05 s }
"""


@pytest.mark.parametrize("method", ["auto", "bdf", "radau"])
@pytest.mark.one_in(2)
def test_relays_that_slide_each_at_its_own_place(tmp_path, method):
    trace = trace_of(tmp_path, RELAYS, method=method, accuracy=1e-7)
    for i in (1, 2, 3, 4):
        wanted = np.minimum(0.1 + (0.5 + i) * trace.time, 0.2 * i)
        assert np.max(np.abs(trace[f"x[{i}]"] - wanted)) < 1e-7


BALLS = """
model m {
  param n = 2
  coord y[1..n]: translation
  energy T* = sum(i in 1..n: 1/2*1 kg*y[i]'^2)
  energy V = sum(i in 1..n: 1 kg*g0*y[i])
  for i in 1..n {
    phi floor[i]: y[i] >= 0 m restitution 0.5
    init y[i] = 1 m*i
    init y[i]' = 0 m/s
  }
}
scene s of m { time 0 s to 0.7 s; trace y[n] as y every 0.1 s }
"""


@pytest.mark.parametrize("sizes", [(1, 3, 2), (3, 1)])
@pytest.mark.long
def test_a_loaded_model_with_events_takes_other_sizes(tmp_path, sizes):
    (tmp_path / "m.sd").write_text(BALLS)
    loaded = load(tmp_path / "m.sd")
    for n in sizes:
        trace = loaded.run(set={"n": n})
        falls = np.sqrt(2 * n / 9.80665)
        after = 0.7 - falls
        wanted = n - 9.80665 * 0.49 / 2 if after < 0 else (0.5 * 9.80665 * falls - 9.80665 * after / 2) * after
        assert abs(trace["y"][-1] - wanted) < 1e-6


def test_what_is_wrong_with_an_array_of_discretes_is_said(tmp_path):
    def codes(text):
        return [d.code for d in attempt(tmp_path, text)[1] if d.severity == "error"]

    assert codes(COUNTED.replace("discrete late[i]: s", "discrete late: s").replace("late[i]", "late")) == ["E806"]
    assert "E805" in codes(COUNTED.replace("[1 m/s, 2 m/s, 3 m/s]", "[1 m/s, 2 m/s]"))
    assert codes(COUNTED.replace("[1 m/s, 2 m/s, 3 m/s]", "[1 m/s, 2 m, 3 m/s]")) == ["E207"]
    assert codes(COUNTED.replace("k[i] := k[i] + 1;", "k[i] := k[i] + 1; k[i] := 0;")) == ["E704"]


TOGETHER = """model fall {
  param n = 3
  coord x[1..n]: translation = 1 m
  discrete total = 0
  for i in 1..n {
    energy T* = 1/2*(1 kg)*x[i]'^2
    when x[i] < 0.9 m { total := total + i }
  }
  for i in 1..n { work FORCE on x[i] }
}
scene s of fall { time 0 s to 1 s; trace total }
"""


def test_elements_of_one_array_that_assign_one_variable_at_once_are_told(tmp_path):
    """The last one counted alone."""
    trace = trace_of(tmp_path, TOGETHER.replace("FORCE", "-1 N*i"))
    assert trace["total"].values[-1] == 6.0
    assert "E704" in [d.code for d in attempt(tmp_path, TOGETHER.replace("FORCE", "-1 N"))[1]]


COUNTERS = """
component counter {
  param n = 2
  param v: m/s
  state x[1..n]: m = 0 m
  discrete k[1..n] = 0
  for j in 1..n {
    dynamic x[j]' = v*j
    when x[j] >= 1 m { x[j] := 0 m; k[j] := k[j] + 1 }
  }
  output total = sum(j in 1..n: k[j] + x[j]/(1 m))
}
model m {
  param half = 1
  param many = 2*half
  for i in 1..3 { C[i]: counter(v = 0.37 m/s*i, n = many) }
  D: counter(v = 0.7 m/s, n = 3)
  let all = sum(i in 1..3: C[i].total)
}
scene s of m { time 0 s to 3 s; trace C[2].total as c, D.total as d, all every 0.1 s }
"""


@pytest.mark.parametrize("half", [1, 2])
def test_arrays_of_components_with_arrays_of_events(tmp_path, half):
    (tmp_path / "m.sd").write_text(COUNTERS)
    trace = load(tmp_path / "m.sd").run(set={"half": half})
    sums = {1: 3, 2: 10}[half]
    assert np.max(np.abs(trace["c"] - 0.74 * sums * trace.time)) < 1e-5
    assert np.max(np.abs(trace["d"] - 0.7 * 6 * trace.time)) < 1e-5
    assert np.max(np.abs(trace["all"] - 0.37 * 6 * sums * trace.time)) < 1e-5
