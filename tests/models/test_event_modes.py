"""Transitions that the core takes by itself against the handler, which is asked for all of them: the same events."""

import sys
from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.runtime.events.handler import Handler
from sysdyn.runtime.integrate.jumps import pieces

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
    """How often handlers were asked, and last the one of the last run."""
    number, handlers = [0, 0], [None]
    fire = Handler.fire

    def counted(handler, *given, **more):
        number[:] = number[0] + 1, 1 + (number[1] if handler is handlers[0] else 0)
        handlers[0] = handler
        return fire(handler, *given, **more)

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
@pytest.mark.long
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
@pytest.mark.long
def test_random_models_have_the_same_events(number, tmp_path, monkeypatch):
    one, two = both(drawn(number).text, tmp_path, monkeypatch, rtol=1e-7, method="radau")
    assert [e.name for e in one.events] == [e.name for e in two.events]
    span = one.time[-1] - one.time[0]
    assert all(abs(a.time - b.time) <= 1e-9 * span for a, b in zip(one.events, two.events, strict=True))
    for name in one.names:
        assert np.abs(one[name].values[-1] - two[name].values[-1]) <= 1e-6 * max(two[name].nominal, 1e-300)


RELAY = """model m {
  state x = 0
  discrete u = 1
  discrete n = 0
  dynamic x' = u/(1 s)
  when x >= 0.01 { u := -1; n := n + 1 }
  when x <= -0.01 { u := 1; n := n + 1 }
}
scene s of m { time 0 s to 2 s; trace x, n every 0.3713 s }
"""
CASCADE = """model m {
  state x = 0
  discrete u = 1
  discrete n = 0
  discrete k = 0
  discrete z = 0
  dynamic x' = u/(1 s)
  when x >= 1 { u := -1; n := n + 1 }
  when x <= -1 { u := 1; n := n + 1 }
  when n >= 3*(k + 1) { k := k + 1 }
  when k >= 2*(z + 1) { z := z + 1; x := x/2 }
}
scene s of m { time 0 s to 60 s; trace x, n, k, z every 0.3713 s }
"""
FIRES = """model m {
  param tau = 10 ms
  state v: V = 0 V
  discrete n = 0
  dynamic v' = (1.5 V - v)/tau
  when v >= 1 V { v := 0 V; n := n + 1 }
}
scene s of m { time 0 s to 0.5 s; trace v, n every 7 ms }
"""
TIMER = """from std.electrical import resistor, capacitor, voltage
component discharge { input drive: 1
  branch: electrical
  discrete off = true
  psi block: f = 0 A while off
  when drive > 0.5 { off := false }
  when drive < 0.5 { off := true } }
model m {
  node vcc, d, c: electrical
  discrete q = 0
  V: voltage(v = 9 V) vcc -> ground
  R1: resistor(R = 10 kohm) vcc -> d
  R2: resistor(R = 47 kohm) d -> c
  C: capacitor(C = 10 nF) c -> ground
  T: discharge() d -> ground, drive = q
  when C.e >= 6 V { q := 1 }
  when C.e <= 3 V { q := 0 }
  init C.e = 0 V
}
scene s of m { time 0 s to 20 ms; trace C.e as v every 0.1 ms }
"""
SAMPLES = """model m {
  state x = 0
  discrete u = 0
  discrete i = 0
  dynamic x' = (u - x)/(0.1 s)
  every 1 ms { i := i + 0.02*(1 - x); u := 2*(1 - x) + i }
}
scene s of m { time 0 s to 0.2 s; trace x, u every 7 ms }
"""
BALL = """model m {
  coord x: translation = 1 m
  discrete n = 0
  energy T* = 1/2*(1 kg)*x'^2
  energy V = (1 kg)*g0*x
  content D = 1/2*(0.001 N.s/m)*x'^2
  WHAT
  init x' = 0 m/s
}
scene s of m { time 0 s to 20 s; trace x, n every 37 ms }
"""
FLOOR = "phi floor: x >= 0 m restitution R"
COUNTED = "when x >= 0.5 m { n := n + 1 }\n  every 0.3 s { n := n + 10 }"
TURNED = "when x <= 0 m { x' := -0.99*x'; n := n + 1 }"
WALLS = """model m {
  coord x: translation = 0 m
  coord y: translation = 1 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = (1 kg)*g0*y
  content D = 0.3 N*abs(x')
  phi floor: y >= 0 m restitution 1
  phi right: x <= 1 m restitution 0.9
  phi left: x >= -0.3 m restitution 0.95
  init x' = 2 m/s
  init y' = 0 m/s
}
scene s of m { time 0 s to 8 s; trace x, y every 37 ms }
"""
PLAY = """model m {
  coord a, b: rotation = 0 rad
  param J = 1e-3 kg.m^2
  energy T* = 1/2*J*a'^2 + J*b'^2
  energy V = 1/2*(0.2 N.m/rad)*a^2
  phi up: a - b <= 0.05 rad restitution 1
  phi down: a - b >= -0.05 rad restitution 1
  init a' = 1 rad/s
  init b' = 0 rad/s
}
scene s of m { time 0 s to 3 s; trace a, b every 37 ms }
"""
ROD = """model m {
  coord x: translation = 0.6 m
  coord y: translation ~ -0.8 m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = (1 kg)*g0*y
  phi rod: x^2 + y^2 = (1 m)^2
  phi wall: x >= -0.1 m restitution 1
  init x' = 0 m/s
}
scene s of m { time 0 s to 10 s; trace x, y, rod.multiplier as T every 37 ms }
"""
KICKED = """from std.mechanical import mass, force, damper
model m {
  node x: translation = 1 m
  discrete n = 0
  M: mass(m = 2 kg) x
  F: force(F = (2 kg)*g0) x -> ground
  C: damper(b = 0.01 N.s/m) x -> ground
  when x.q <= 0 m { x.f := -x.f; n := n + 1 }
  init x.f = 0 m/s
}
scene s of m { time 0 s to 20 s; trace x.q as x, n every 37 ms }
"""
TWISTS = """model m {
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  work -2 N*sign(x) on x
  content D = 1 N*abs(x')
  init x' = 0 m/s
}
scene s of m { time 0 s to 6 s; trace x, x' as v every 20 ms }
"""
MANY = {
    "twists": TWISTS,
    "relay": RELAY,
    "cascade": CASCADE,
    "fires": FIRES,
    "timer": TIMER,
    "samples": SAMPLES,
    "elastic": BALL.replace("WHAT", FLOOR.replace("R", "1")),
    "comes to rest": BALL.replace("WHAT", FLOOR.replace("R", "0.7")).replace("20 s", "5 s"),
    "counted": BALL.replace("WHAT", f"{FLOOR.replace('R', '1')}\n  {COUNTED}"),
    "turned": BALL.replace("WHAT", TURNED),
    "walls": WALLS,
    "play": PLAY,
    "rod": ROD,
    "kicked": KICKED,
}
SAME = {"rod": 1e-9}
"""Of the span: instants that are one; points on a curved constraint need not be the least change."""
MOST_ASKED = 10
"""Events of a run that go to the handler: each kind is new once, some sizes grow."""


@pytest.mark.parametrize("way", ["radau", "bdf", "rosenbrock", "dopri", "hamiltonian", "kane"])
@pytest.mark.parametrize("name", list(MANY))
@pytest.mark.long
def test_the_core_makes_what_the_handler_does(name, way, tmp_path, asked, monkeypatch):
    """Assignments, cascades, flows that are assigned, samples, impacts: instants, entries, values, steps."""
    if way == "dopri" and any(word in MANY[name] for word in ("phi ", "psi ", "abs(")):
        pytest.skip("constraints that hold at times")
    if (name, way) == ("twists", "bdf"):
        pytest.skip("chatters behind its Zeno point: runtime/events/decisions.md")
    options = {"formulation": way} if way in ("hamiltonian", "kane") else {"method": way}
    one, two = both(MANY[name], tmp_path, monkeypatch, accuracy=1e-6, **options)
    assert [(e.name, e.element) for e in one.events] == [(e.name, e.element) for e in two.events]
    assert len(one.events) >= 5
    same = SAME.get(name, 1e-10)
    span = one.time[-1] - one.time[0]
    assert max(abs(a.time - b.time) for a, b in zip(one.events, two.events, strict=True)) <= same * span
    assert [e.after.count("=") for e in one.events] == [e.after.count("=") for e in two.events]
    for quantity in one.names:
        assert np.abs(one[quantity].values - two[quantity].values).max() <= 100.0 * same * two[quantity].nominal
    assert one.statistics["steps"] == pytest.approx(two.statistics["steps"], rel=0.02, abs=10)
    assert one.attributes["met"] == two.attributes["met"] == 1


@pytest.mark.parametrize("name", [name for name in MANY if name != "comes to rest"])
@pytest.mark.one_in(3)
def test_the_handler_is_asked_for_what_is_new(name, tmp_path, asked):
    file = tmp_path / "m.sd"
    file.write_text(MANY[name])
    trace = simulate(file, scene="s", output=tmp_path / "m.h5", accuracy=1e-6, method="radau")
    assert asked[1] <= min(MOST_ASKED, len(trace.events))


@pytest.mark.long
def test_elastic_impacts_by_the_core_keep_their_energy(tmp_path, asked):
    """Between two walls: impact k is at (2 k + 1) 5 cm/(1 m/s), 10000 of them."""
    file = tmp_path / "m.sd"
    file.write_text("""model m {
  coord x: translation = 0 m
  energy T* = 1/2*(1 g)*x'^2
  phi right: x <= 5 cm restitution 1
  phi left: x >= -5 cm restitution 1
  init x' = 1 m/s
}
scene s of m { time 0 s to 1000 s; trace x, x' as v every 37 ms }
""")
    trace = simulate(file, scene="s", output=tmp_path / "m.h5")
    k = np.arange(10000)
    assert [e.name for e in trace.events] == ["impact left" if odd else "impact right" for odd in k % 2]
    assert np.abs(np.array([e.time for e in trace.events]) - (2 * k + 1) * 0.05).max() < 1e-9
    assert np.abs(np.abs(trace["v"].values) - 1.0).max() < 1e-12
    assert asked[0] < 100


@pytest.mark.parametrize("method", ["radau", "rosenbrock"])
@pytest.mark.long
def test_what_twists_into_its_zero_rests_there(method, tmp_path):
    """Each half turn takes a third of the way, and the root of a third of the time, of the one before: a finite sum."""
    file = tmp_path / "m.sd"
    file.write_text(TWISTS)
    trace = simulate(file, scene="s", output=tmp_path / "m.h5", method=method)
    first = np.sqrt(2.0) * (1.0 + 1.0 / 3.0)
    end = first / (1.0 - np.sqrt(1.0 / 3.0))
    turns = [e.time for e in trace.events if e.name.startswith("content")]
    exact = [first * (1.0 - 3.0 ** (-k / 2.0)) / (1.0 - 3.0**-0.5) for k in range(1, 11)]
    assert np.abs(np.array(turns[:10]) - exact).max() < 1e-6
    late = trace.time > end + 1e-3
    assert np.abs(trace["x"].values[late]).max() < 1e-6
    assert np.abs(trace["v"].values[late]).max() < 1e-6
    assert len(trace.events) < 60
