"""Least and largest values that `sweep` keeps, of motions whose crests are known and lie between the rows."""

import numpy as np
import pytest
from sysdyn.cli.run.many.reusable_model import Loaded
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.sweep.one_run import Runner
from sysdyn.cli.sweep.run_records import KeptRuns

OSCILLATOR = """\
model m {
  param k = 4 N/m
  coord x: translation = 0.3 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*k*x^2
  init x' = 0.7 m/s
}
scene s of m { time 0 s to 10 s; trace x in mm as x, x'^2 as square EVERY }
"""
DAMPED = """\
from std.electrical import resistor, capacitor, inductor, voltage
model m {
  param R = 20 ohm
  node a, b, c: electrical
  V1: voltage(v = 1 V) a -> ground
  R1: resistor(R = R) a -> b
  L1: inductor(L = 10 mH) b -> c
  C1: capacitor(C = 1 uF) c -> ground
  init C1.e = 0 V
  init L1.f = 0 A
}
scene s of m { time 0 s to 2 ms; trace c.e as x every 1 ms }
"""
DROPPED = """\
model m {
  param v = 3 m/s
  coord h: translation = 0.5 m
  energy T* = 1/2*(1 kg)*h'^2
  energy V = (1 kg)*g0*h
  phi floor: h >= 0 m restitution 0.8
  init h' = v
}
scene s of m { time 0 s to 2 s; trace h as x, h' as w every 2 s }
"""


def _both(folder, text, name, values, **asked):
    """[(least, most)] of x and of a second quantity, of the cases in the core and one by one."""
    file = folder / "m.sd"
    file.write_text(text)
    tasks = [(k, {name: value}) for k, value in enumerate(values)]
    loaded = Loaded(RunRequest(str(file), **asked))
    found, left = Runner(RunRequest(str(file), **asked), loaded=loaded).chunk(tasks)
    alone = Runner(RunRequest(str(file), **asked), core=False, loaded=loaded)
    single = [alone(*task) for task in tasks]
    inside = [block.one(k) for block in found if isinstance(block, KeptRuns) for k in range(len(block.runs))]
    return inside, single, left


def _ends(kept, quantity):
    return np.array([[one.least[quantity], one.most[quantity]] for one in kept])


@pytest.mark.parametrize("every", ["every 1 s", "every 10 s", "every 1 ms", ""])
@pytest.mark.parametrize("method", ["dopri", "radau", "bdf"])
@pytest.mark.one_in(12)
def test_a_crest_is_as_exact_as_the_run(tmp_path, every, method):
    """Rows at each second were 2 % off, as were those at the steps of dopri."""
    k = np.array([3.0, 4.0, 7.0])
    text = OSCILLATOR.replace("EVERY", every)
    inside, single, left = _both(tmp_path, text, "k", k.tolist(), method=method, accuracy=1e-6)
    assert not left
    most = np.sqrt(0.3**2 + 0.49 / k)
    for kept in (inside, single):
        np.testing.assert_allclose(_ends(kept, "x"), 1e3 * np.transpose([-most, most]), rtol=2e-6)  # in mm
        square = _ends(kept, "square")
        np.testing.assert_allclose(square[:, 1], k * most**2, rtol=6e-6)
        np.testing.assert_allclose(square[:, 0], 0.0, atol=2e-6)


def test_the_overshoot_of_a_circuit(tmp_path):
    """Of an underdamped series circuit: 1 + exp(-pi decay/frequency)."""
    R = np.array([10.0, 20.0, 60.0])
    inside, single, left = _both(tmp_path, DAMPED, "R", R.tolist())
    assert not left
    decay = R / 0.02
    most = 1.0 + np.exp(-np.pi * decay / np.sqrt(1e8 - decay**2))
    for kept in (inside, single):
        np.testing.assert_allclose(_ends(kept, "x")[:, 1], most, rtol=2e-4)


def test_extrema_on_both_sides_of_impacts(tmp_path):
    """A ball that is thrown up: its height, and its speed at the floor before and behind."""
    v = np.array([2.0, 3.0])
    _, single, left = _both(tmp_path, DROPPED, "v", v.tolist())
    assert len(left) == 2  # of events nothing is in the core
    g0 = 9.80665
    speed = np.sqrt(v**2 + 2 * g0 * 0.5)
    np.testing.assert_allclose(_ends(single, "x")[:, 1], speed**2 / (2 * g0), rtol=1e-6)
    np.testing.assert_allclose(_ends(single, "w"), np.transpose([-speed, 0.8 * speed]), rtol=1e-6)


@pytest.mark.long
def test_what_nobody_asks_is_not_sought(tmp_path):
    """End values alone: no look, the same steps."""
    file = tmp_path / "m.sd"
    file.write_text(OSCILLATOR.replace("EVERY", "every 1 s"))
    loaded = Loaded(RunRequest(str(file)))
    end, traces = (
        Runner(RunRequest(str(file)), keep, core=False, loaded=loaded)(0, {"k": 5.0}) for keep in ("end", "traces")
    )
    assert end.least is None
    assert end.most is None
    assert (end.steps, end.end) == (traces.steps, traces.end)
