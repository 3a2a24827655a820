"""Transitions that the core takes by itself against the handler, which is asked for all of them: the same events."""

import sys
from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.runtime.events.handler import Handler
from sysdyn.runtime.integrate import pieces

sys.path.insert(0, str(Path(__file__).parents[1] / "events"))
from random_events import FAMILIES, drawn

BUCK = """from std.electrical import switch, diode, resistor, inductor, capacitor, voltage
model m {
  node i, x, o: electrical
  discrete on = false
  discrete began = 0 s
  discrete count = 0
  Vs: voltage(v = 12 V) i -> ground
  S: switch() i -> x, gate = (if on then 1 else 0)
  D: diode.complementary() ground -> x
  L: inductor(L = 0.1 mH) x -> o
  C: capacitor(C = 10 uF) o -> ground
  R: resistor(R = 5 ohm) o -> ground
  every 10 us {
    on := true
    began := t
    count := count + 1
  }
  when on and (t - began)/(10 us) >= 0.5 + 0.2*(5 V - C.e)/(1 V) { on := false }
  init L.f = 0.95 A
  init C.e = 4.7 V
}
scene s of m { time 0 s to 1 ms; trace L.f as i, C.e as v, count every 1 us; MORE }
"""


@pytest.fixture
def asked(monkeypatch):
    """How often the handler was asked."""
    number = [0]
    fire = Handler.fire

    def counted(*given, **more):
        number[0] += 1
        return fire(*given, **more)

    monkeypatch.setattr(Handler, "fire", counted)
    return number


def both(text, tmp_path, monkeypatch, **options):
    """The run with transitions, and without."""
    file = tmp_path / "m.sd"
    file.write_text(text)
    found = []
    for number, serves in enumerate((pieces.serves, lambda *_: False)):
        monkeypatch.setattr(pieces, "serves", serves)
        output = tmp_path / f"{number}.h5"
        found.append(simulate(file, scene="s", output=output, unmet="warn", **options))
    return found


@pytest.mark.parametrize("method", ["radau", "bdf"])
def test_a_converter_asks_its_handler_a_few_times(method, tmp_path, asked, monkeypatch):
    one, two = both(BUCK.replace("MORE", ""), tmp_path, monkeypatch, rtol=1e-8, method=method)
    assert len(one.events) == len(two.events) >= 600
    assert asked[0] < 0.05 * len(one.events) + len(two.events)
    assert [(e.name, e.element, e.before, e.after) for e in one.events[:40]] == [
        (e.name, e.element, e.before, e.after) for e in two.events[:40]
    ]
    assert one["count"][-1] == two["count"][-1] == 101
    assert np.abs(one["v"].values - two["v"].values).max() < 1e-7


def test_a_limit_of_events_ends_it_where_the_handler_does(tmp_path, monkeypatch):
    ends = []
    for serves in (pieces.serves, lambda *_: False):
        monkeypatch.setattr(pieces, "serves", serves)
        file = tmp_path / "m.sd"
        file.write_text(BUCK.replace("MORE", "limit events 100"))
        with pytest.raises(Exception, match="events") as error:
            simulate(file, scene="s", output=tmp_path / "m.h5", rtol=1e-8, method="radau")
        ends.append(str(error.value))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("number", range(len(FAMILIES)), ids=lambda k: FAMILIES[k].__name__)
@pytest.mark.one_in(2)
def test_random_models_have_the_same_events(number, tmp_path, monkeypatch):
    one, two = both(drawn(number).text, tmp_path, monkeypatch, rtol=1e-7, method="radau")
    assert [e.name for e in one.events] == [e.name for e in two.events]
    span = one.time[-1] - one.time[0]
    assert all(abs(a.time - b.time) <= 1e-9 * span for a, b in zip(one.events, two.events, strict=True))
    for name in one.names:
        assert np.abs(one[name].values[-1] - two[name].values[-1]) <= 1e-6 * max(two[name].nominal, 1e-300)
