"""Jumps of the text in time, one right behind the start too, against closed forms; by the core and the handler."""

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.runtime.events.handler import Handler
from sysdyn.runtime.integrate.jumps import pieces

PULSED = """from std.electrical import switch, diode, resistor, inductor, voltage
model m {
  node i, x, o: electrical
  Vs: voltage(v = 12 V) i -> ground
  S: switch() i -> x, gate = (if mod(t, 10 us) < 4.3 us then 1 else 0)
  D: diode.complementary() ground -> x
  L: inductor(L = 0.1 mH) x -> o
  R: resistor(R = 5 ohm) o -> ground
}
scene s of m { time 0 s to 2 ms; trace L.f as i every 20 us; accuracy 1e-6 }
"""
STEP = """from std.electrical import diode, resistor, capacitor, voltage
model m {
  node a, b: electrical
  V: voltage(v = VALUE) a -> ground
  D: diode.complementary() a -> b
  C: capacitor(C = 1 mF) b -> ground
  R: resistor(R = 10 ohm) b -> ground
}
scene s of m { time 0 s to 1 s; trace D.f as i, C.e as v every 0.1 s; accuracy 1e-6 }
"""


def run(text, folder, **options):
    (folder / "m.sd").write_text(text)
    return simulate(folder / "m.sd", output=folder / "t.h5", **options)


def current(times):
    """Of the coil [times]: to 2.4 A while the switch conducts, to zero else, with 20 us."""
    on, off, found, begin = 4.3e-6, 5.7e-6, np.empty(times.size), 0.0
    for k in range(201):
        since = np.clip(times - k * 1e-5, 0.0, 1e-5)
        here = (times >= k * 1e-5 - 1e-15) & (times <= (k + 1) * 1e-5 + 1e-15)
        rising = 2.4 + (begin - 2.4) * np.exp(-np.minimum(since, on) / 2e-5)
        found[here] = (rising * np.exp(-np.maximum(since - on, 0.0) / 2e-5))[here]
        begin = (2.4 + (begin - 2.4) * np.exp(-on / 2e-5)) * np.exp(-off / 2e-5)
    return found


@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_pulses_of_the_text_are_the_cores(tmp_path, monkeypatch, method, formulation):
    """400 jumps, at which a switch and a diode turn: the handler is asked for a few."""
    asked = []
    fire = Handler.fire
    monkeypatch.setattr(Handler, "fire", lambda self, *given, **more: asked.append(0) or fire(self, *given, **more))
    trace = run(PULSED, tmp_path, method=method, formulation=formulation)
    assert len(asked) < 60
    assert len(trace.events) == 1200  # a condition, the switch, the diode
    exact = current(trace.time)
    assert np.abs(trace["i"].values - exact).max() < 3e-6 * exact.max()


@pytest.mark.long
def test_the_handler_finds_the_same_pulses(tmp_path, monkeypatch):
    found = []
    for serves in (pieces.serves, lambda *_: False):
        monkeypatch.setattr(pieces, "serves", serves)
        found.append(run(PULSED.replace("2 ms", "0.2 ms"), tmp_path, method="radau"))
    one, two = ([(e.time, e.name, e.element, e.before, e.after) for e in trace.events] for trace in found)
    assert one == two
    assert np.abs(found[0]["i"].values - found[1]["i"].values).max() < 1e-12


@pytest.mark.parametrize("value", ["if t > 0 s then 5 V else 0 V", "5 V*sign(t/(1 s))", "5 V*sign(sin(t/(1 s)))"])
@pytest.mark.parametrize("method", ["auto", "bdf", "radau"])
@pytest.mark.one_in(5)
def test_a_source_that_steps_behind_the_start_charges_a_capacitor(tmp_path, method, value):
    """By an impulse, half of whose energy goes; both sides of the instant have a row."""
    trace = run(STEP.replace("VALUE", value), tmp_path, method=method)
    assert trace.time[:3].tolist() == pytest.approx([0.0, 0.0, 0.1])
    assert trace["v"].values[:3] == pytest.approx([0.0, 5.0, 5.0], abs=1e-9)
    assert trace["i"].values[:3] == pytest.approx([0.0, 0.5, 0.5], abs=1e-6)
    assert np.abs(trace["audit.energy"].values).max() < 1e-8


@pytest.mark.parametrize("value", ["if t >= 0 s then 5 V else 0 V", "5 V*(1 - mod(t, 2 s)/(4 s))"])
@pytest.mark.long
def test_what_holds_at_the_start_has_one_row_there(tmp_path, value):
    trace = run(STEP.replace("VALUE", value).replace("D: diode.complementary()", "D: resistor(R = 1 ohm)"), tmp_path)
    assert trace.time[:2].tolist() == pytest.approx([0.0, 0.1])


@pytest.mark.parametrize("method", ["auto", "bdf", "radau", "rosenbrock", "dopri"])
@pytest.mark.long
def test_a_step_behind_the_start_of_a_smooth_model(tmp_path, method):
    text = """model m {
  state u: 1 = 0
  dynamic u' = ((if t > 0 s then 1 else 0) - u)/(0.1 s)
}
scene s of m { time 0 s to 1 s; trace u every 0.05 s; accuracy 1e-7 }
"""
    trace = run(text, tmp_path, method=method)
    assert np.abs(trace["u"].values - (1.0 - np.exp(-trace.time / 0.1))).max() < 3e-7
