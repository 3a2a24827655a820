"""Relaxation: a slow unknown carries a fast one to a fold, which it leaves by a jump that a small pole takes up.

Behind the fold an implicit step much longer than the pole could land on the unstable branch, where the growing mode
looks to it like a decaying one.  Values beside closed forms and SciPy.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn import api

SLOW = 0.1 / (2.0 * np.log(3.0))
MULTIVIBRATOR = """model relax {
  state m: 1 = 1
  state u: 1 = -15
  dynamic m' = (u - m)/(0.1 s/(2*ln(3)))
  dynamic u' = (%s - u)/(1 us)
}
scene run of relax { time 0 s to 0.2 s; trace m, u every 1 ms }
"""
LAWS = {
    "clip": ("clip(15000*(u/2 - m), -15, 15)", lambda m, u: np.clip(15000 * (u / 2 - m), -15, 15)),
    "tanh": ("15*tanh(1000*(u/2 - m))", lambda m, u: 15 * np.tanh(1000 * (u / 2 - m))),
}
GENERATOR = """model generator {
  state x: 1 = 0
  state u: 1 = 10
  dynamic x' = u/(10 ms)
  dynamic u' = (clip(%g*(u/2 - x), -10, 10) - u)/(1 us)
}
scene run of generator { time 0 s to 0.2 s; trace x, u every 1 ms }
"""
AMPLIFIER = """from std.electrical import resistor, capacitor
model oscillator {
  node inp, inn, o: electrical
  state u: V = -15 V
  C: capacitor(C = 100 nF) inn -> ground
  R: resistor(R = 10 kohm) o -> inn
  R1: resistor(R = 10 kohm) o -> inp
  R2: resistor(R = 10 kohm) inp -> ground
  A: effort(e = u) o -> ground
  dynamic u' = (clip(15000*(inp.e - inn.e), -15 V, 15 V) - u)/(1 us)
}
scene run of oscillator { time 0 s to 10 ms; trace o.e, inn.e every 0.1 ms }
"""
TRIGGER = """from std.electrical import resistor, voltage
model schmitt {
  node s, a, o: electrical
  state u: V = 15 V
  V: voltage(v = 5 V - 10 V/s*t) s -> ground
  R1: resistor(R = 1 kohm) s -> a
  R2: resistor(R = 15 kohm) a -> o
  A: effort(e = u) o -> ground
  dynamic u' = (clip(15000*a.e, -15 V, 15 V) - u)/(1 us)
}
scene run of schmitt { time 0 s to 1 s; trace o.e every 10 ms }
"""
STEPPED = ["radau", "rosenbrock", "bdf"]
STEPS = 2000


def run(tmp_path, text, **options):
    (tmp_path / "m.sd").write_text(text)
    return api.simulate(tmp_path / "m.sd", output=tmp_path / "out.h5", max_steps=20 * STEPS, **options)


def few_steps(trace):
    """A run of its own, or both of an accuracy."""
    return trace.statistics["steps"] < STEPS


@pytest.fixture(scope="module")
def exact():
    """m at each ms, of either law, by LSODA at steps of 10 us."""
    t = np.linspace(0.0, 0.2, 201)
    found = {}
    for name, (_, law) in LAWS.items():

        def rate(_, y, law=law):
            return [(y[1] - y[0]) / SLOW, (law(*y) - y[1]) / 1e-6]

        options = {"method": "LSODA", "rtol": 1e-10, "atol": 1e-12, "max_step": 1e-5}
        found[name] = t, solve_ivp(rate, (0.0, 0.2), [1.0, -15.0], t_eval=t, **options).y[0]
    return found


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("law", LAWS)
def test_a_multivibrator_is_that_of_lsoda(tmp_path, exact, law, method):
    trace = run(tmp_path, MULTIVIBRATOR % LAWS[law][0], method=method, accuracy=1e-4)
    t, m = exact[law]
    at = np.searchsorted(trace.time, t - 1e-12)
    assert np.abs(trace["m"].values[at] - m).max() < 1e-4 * 7.5
    assert few_steps(trace)


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("gain", [2e3, 1e5])
def test_a_function_generator_makes_triangles(tmp_path, gain, method):
    """x goes to and fro between both thresholds with the slope of u, but for what the pole takes."""
    trace = run(tmp_path, GENERATOR % gain, method=method, accuracy=1e-4)
    phase = (trace.time / 10e-3 * 10.0 + 5.0) / 10.0
    triangle = np.where(np.floor(phase) % 2 == 0, phase % 1.0, 1.0 - phase % 1.0) * 10.0 - 5.0
    # 20 turns, each past its threshold by 10/gain and what x moves while u turns, some tens of the pole
    assert np.abs(trace["x"].values - triangle).max() < 20 * (2 * 10.0 / gain + 40e-6 * 1000.0)
    assert few_steps(trace) or method == "bdf"  # which begins each turn at order 1


@pytest.mark.parametrize("method", ["auto", "radau", "rosenbrock"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
def test_an_amplifier_oscillates_with_the_period_of_its_capacitor(tmp_path, formulation, method):
    """RC ln 2 to the first turn, RC ln 3 from each to the next: from half of one rail to half of the other."""
    trace = run(tmp_path, AMPLIFIER, formulation=formulation, method=method, accuracy=1e-4)
    o = trace["o.e"].values
    turn = np.flatnonzero(np.diff(np.sign(o)) != 0)
    expected = 1e-3 * (np.log(2.0) + np.log(3.0) * np.arange(9))
    assert turn.size == expected[expected < 10e-3].size
    assert np.abs(trace.time[turn] - expected[: turn.size]).max() < 0.1e-3
    assert few_steps(trace)


@pytest.mark.parametrize("method", STEPPED)
@pytest.mark.parametrize("formulation", ["lagrangian", "co_hamiltonian"])
def test_a_trigger_turns_where_its_fold_is(tmp_path, formulation, method):
    """a.e = 15/16 s + u/16 falls through 1 mV at s = -1 V + 16/15 mV: the output follows from 15 V to -15 V."""
    trace = run(tmp_path, TRIGGER, formulation=formulation, method=method, accuracy=1e-4)
    o, t = trace["o.e"].values, trace.time
    instant = 0.6 - 16e-3 / 15.0 / 10.0
    assert np.abs(o[t < instant - 1e-6] - 15.0).max() < 1e-3
    assert np.abs(o[t > instant + 1e-4] + 15.0).max() < 1e-3
    assert few_steps(trace)
