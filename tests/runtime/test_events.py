"""Events against closed forms: impacts, dry friction, samples; what the trace and the books say of them."""

import numpy as np
import pytest
from sysdyn.api import simulate

G = 9.81
BALL = """
model ball {
  param m = 1 kg
  param r = 0.8
  coord h: translation = 1 m
  energy T* = 1/2*m*h'^2
  energy V = m*9.81 m/s^2*h
  phi floor: h >= 0 m restitution r
  init h' = 0 m/s
}
scene s of ball {
  time 0 s to 2.5 s
  trace h, h' as v, floor.multiplier as push
}
"""


def run(text, tmp_path, **options):
    file = tmp_path / "m.sd"
    file.write_text(text)
    return simulate(file, output=tmp_path / "m.h5", **options)


def impacts(r, number):
    """Instants of the first impacts from 1 m, and the speed after each."""
    speed = np.sqrt(2.0 * G)
    times, after = [speed / G], [r * speed]
    while len(times) < number:
        times.append(times[-1] + 2.0 * after[-1] / G)
        after.append(r * after[-1])
    return np.array(times), np.array(after)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.long
def test_a_ball_bounces_at_the_exact_instants(tmp_path, formulation, method):
    trace = run(BALL, tmp_path, formulation=formulation, method=method, accuracy=1e-9)
    times, after = impacts(0.8, 4)
    found = [e.time for e in trace.events if e.element == "floor"]
    assert np.abs(np.array(found) - times).max() < 1e-10
    for t, v in zip(times, after, strict=True):
        (here,) = np.nonzero(np.abs(trace.time - t) < 1e-9)
        assert len(here) == 2  # the instant stands twice: before and after
        assert trace["v"][here[0]] == pytest.approx(-v / 0.8, rel=1e-9)
        assert trace["v"][here[1]] == pytest.approx(v, rel=1e-9)
    end = 2.5 - times[-1]
    assert trace["h"][-1] == pytest.approx(after[-1] * end - 0.5 * G * end**2, abs=1e-9)


LEAK = """
model leak {
  discrete k = 1
  node a, m: electrical
  Vs: effort(e = 10 V) a
  R: dissipator(e = 1 kohm*f) a -> m
  C: potential(q = 1 uF*e) m
  drain: dissipator(f = k*e/(10 kohm)) m -> ground
  when C.e > 2 V { k := 3 }
  init C.e = 0 V
}
scene s of leak {
  time 0 s to 5 ms
  trace C.e as u
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("how", [("bdf", "1"), ("radau", "1"), ("bdf", "0"), ("rosenbrock", "auto"), ("dopri", "auto")])
@pytest.mark.long
def test_a_resistance_jumps_in_every_index_form(tmp_path, formulation, how):
    """No flow has inertia: each follows anew, also where the rates of derived constraints stand beside them."""
    method, index = how
    trace = run(LEAK, tmp_path, formulation=formulation, method=method, index=index, accuracy=1e-6)
    before, after = 1e3 * 1e4 / 11e3 * 1e-6, 1e3 * 1e4 / 13e3 * 1e-6
    jump = -before * np.log(1.0 - 2.0 / (100.0 / 11.0))
    assert [e.time for e in trace.events] == pytest.approx([jump], rel=1e-6)
    end = 100.0 / 13.0 + (2.0 - 100.0 / 13.0) * np.exp(-(5e-3 - jump) / after)
    assert trace["u"][-1] == pytest.approx(end, rel=1e-6)


TRIP = """
model supply {
  discrete trips = 0
  discrete at: s = 0 s
  node a, b: electrical
  V: effort(e = if t < 1 s then 1 V else 5 V) a
  R: dissipator(e = 1 ohm*f) a -> b
  C: potential(q = 1 F*e) b
  when R.f >= 2 A { trips := trips + 1; at := t }
  init C.e = 0 V
}
scene s of supply {
  time 0 s to 2 s
  trace C.e as u, R.f as i, trips, at every 0.3 s
}
"""
ROPE = """
model rope {
  discrete held = true
  coord x: translation = 0 m
  energy T* = 1/2*(2 kg)*x'^2
  psi rope: x' = 0 m/s while held
  when held and abs(rope.multiplier) >= 3 N { held := false }
  work (if t < 1 s then 1 N else 5 N) on x
  init x' = 0 m/s
}
scene s of rope {
  time 0 s to 3 s
  trace x
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian"])
@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.one_in(5)
def test_a_current_that_jumps_past_a_limit_with_its_source_trips(tmp_path, formulation, method):
    """The current follows from the source by the circuit's equations: no relation reads the text that jumps."""
    trace = run(TRIP, tmp_path, formulation=formulation, method=method, accuracy=1e-6)
    assert [e.time for e in trace.events] == pytest.approx([1.0], abs=1e-12)
    assert trace["trips"][-1] == 1.0
    assert trace["at"][-1] == pytest.approx(1.0, abs=1e-12)
    (here,) = np.nonzero(np.abs(trace.time - 1.0) < 1e-12)
    assert trace["trips"][here].tolist() == [0.0, 1.0]  # the instant stands twice, between those of `every`
    assert trace["i"][here] == pytest.approx([np.exp(-1.0), 4.0 + np.exp(-1.0)], rel=1e-6)
    assert trace.events[0].time == trace.time[here[1]]
    u = 5.0 - (4.0 + np.exp(-1.0)) * np.exp(-1.0)
    assert trace["u"][-1] == pytest.approx(u, rel=1e-6)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
@pytest.mark.long
def test_a_rope_breaks_where_its_force_jumps_past_what_it_bears(tmp_path, formulation):
    trace = run(ROPE, tmp_path, formulation=formulation, accuracy=1e-8)
    assert trace["x"][-1] == pytest.approx(0.5 * (5.0 / 2.0) * 2.0**2, rel=1e-8)


TWO_POINT = """
model two_point {
  state x: V = 0 V
  discrete high = true
  discrete held: V = 0 V
  when x <= 0.5 V { high := true }
  when x >= 0.9 V { high := false }
  every 0.26 s { held := x }
  dynamic x' = (if x <= 0.5 V or high and x < 0.9 V then 1 V/s else -1 V/s)
}
scene s of two_point {
  time 0 s to 5 s
  trace x, held every 0.05 s
}
"""


@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.long
def test_a_threshold_that_is_met_at_a_sample_is_passed(tmp_path, method):
    """At 1.3 s a sample is due and the lower threshold is met: the law does not rest upon it, for its memory turns."""
    trace = run(TWO_POINT, tmp_path, method=method, accuracy=1e-6)
    past = np.mod(trace.time - 0.9, 0.8)
    expected = np.where(trace.time < 0.9, trace.time, np.where(past < 0.4, 0.9 - past, 0.1 + past))
    assert np.abs(trace["x"] - expected).max() < 1e-6
    assert trace["held"][-1] == pytest.approx(0.86, abs=1e-6)  # of 4.94 s


@pytest.mark.parametrize("beside", ["every 0.1 s { s := s + 1 }", "work (if t < 0.5 s then 0 N else 1e-12 N) on h"])
@pytest.mark.one_in(2)
def test_an_impact_at_the_instant_of_a_sample_or_a_jump_is_counted(tmp_path, beside):
    """The first impact is at 0.5 s, the next at 1.3 s."""
    text = BALL.replace("= 1 m\n", "= 1/2*(9.81 m/s^2)*(0.5 s)^2\n").replace("2.5 s", "1.45 s")
    counts = "  discrete n = 0\n  discrete s = 0\n  when h <= 0 m { n := n + 1 }\n"
    text = text.replace("  init", f"{counts}  {beside}\n  init")
    trace = run(text.replace("trace h,", "trace n, h,"), tmp_path)
    assert trace["n"][-1] == 2.0
    struck = [e.time for e in trace.events if e.element == "floor"]
    assert struck == pytest.approx([0.5, 1.3], abs=1e-9)
    assert all(len(np.flatnonzero(np.abs(trace.time - t) < 1e-9)) == 2 for t in struck)
    assert trace["h"][-1] == pytest.approx(0.64 * 0.5 * G * 0.15 - 0.5 * G * 0.15**2, rel=1e-6)


SLOT = """
model slot {
  coord th: rotation = 0 rad
  discrete n = 0
  state x: V = 0 V
  energy T* = 1/2*(1 kg.m^2)*th'^2
  dynamic x' = (if cos(th) > 0.99995 then 1 V/s else 0 V/s)
  when cos(th) > 0.99995 { n := n + 1 }
  init th' = 60 rpm
}
scene s of slot {
  time 0 s to 20.5 s
  trace x, n every 0.5 s
}
"""


@pytest.mark.parametrize("method", ["auto", "radau", "bdf"])
@pytest.mark.one_in(5)
def test_a_narrow_slot_is_seen_in_every_turn_of_a_long_step(tmp_path, method):
    """The angle grows evenly, so steps are many turns long; the slot is open for 3.2 ms of each second."""
    trace = run(SLOT, tmp_path, method=method)
    assert trace["n"][-1] == 20.0
    assert trace["x"][-1] == pytest.approx(41.0 * np.arccos(0.99995) / (2.0 * np.pi), rel=1e-4)
