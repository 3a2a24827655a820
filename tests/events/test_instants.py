"""Instants of events are resolved to spacings of t, however long the run is and however soon they come again."""

import numpy as np
import pytest
from sysdyn import api
from sysdyn.cli.run import running
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.dsl.text.diagnostics import Report

AGAIN = """model again {
  state y: 1 = 1
  dynamic y' = -1/(1 s)
  discrete n = 0
  when y <= 0 { n := n + 1; y := (if n < 0.5 then %g else 1) }
}
scene go of again {
  time 0 s to 1.5 s
  trace y, n every 0.1 s
}
"""
TIMER = """model timer {
  state y: s = 0 s
  discrete next: s = %(begin)g s + 1 s
  discrete k = 0
  discrete on = false
  dynamic y' = if on then 1 else 0
  when t >= next { on := not on; k := k + 1; next := (if on then next + 1 s else next + (1 us)*(1 + mod(k/2, 5))) }
}
scene go of timer {
  time %(begin)g s to %(begin)g s + 200 s
  trace y, k every 10 s
}
"""
LATE = """model late {
  state y: 1 = 0
  discrete n = 0
  dynamic y' = 1/(%(span)g s)
  when t >= %(span)g s - 10 s { n := n + 1 }
}
scene go of late {
  time 0 s to %(span)g s
  trace y, n
}
"""
HALVES = """model halves {
  state y: 1 = 1
  discrete r = 1
  dynamic y' = -1/(1 s)
  when y <= 0 { r := %g*r; y := r }
}
scene go of halves {
  time 0 s to 30 s
  trace y
}
"""
TANKS = """model tanks {
  state a: 1 = 1
  state b: 1 = %g
  discrete left = true
  dynamic a' = (if left then %g else -1)/(1 s)
  dynamic b' = (if left then -1 else %g)/(1 s)
  when b <= 0 { left := false }
  when a <= 0 { left := true }
}
scene go of tanks {
  time 0 s to 100 s
  trace a, b
}
"""
OVERFLOW = """model overflow {
  coord q: translation = 0.1 m
  energy T* = 1/2*(1 kg)*q'^2
  discrete k = 1
  %s { k := k*1e10 }
}
scene s of overflow {
  time 0 s to 1 s
  trace q, k
}
"""


def run(tmp_path, text, **options):
    (tmp_path / "m.sd").write_text(text)
    return api.simulate(tmp_path / "m.sd", output=tmp_path / "out.h5", **options)


def refused(tmp_path, text, **options):
    """What is said of a run that stops, or of a text that does not start."""
    (tmp_path / "m.sd").write_text(text)
    report = Report()
    ran = running.run(RunRequest(str(tmp_path / "m.sd"), output=str(tmp_path / "out.h5"), **options), report)
    assert ran is None or ran.exit == 3
    return " ".join(f"{d.code} {d.message}" for d in report)


@pytest.mark.parametrize("method", ["auto", "bdf", "radau", "dopri"])
@pytest.mark.parametrize("soon", [1e-7, 5e-10, 1e-12, 3e-15])
@pytest.mark.long
def test_what_is_due_again_at_once_happens(tmp_path, soon, method):
    trace = run(tmp_path, AGAIN % soon, method=method)
    assert [e.time for e in trace.events] == pytest.approx([1.0, 1.0 + soon], abs=1e-14)
    assert trace["y"].values[-1] == pytest.approx(0.5 + soon, abs=1e-12)


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.parametrize("begin", [0.0, 1e4, 1e6])
@pytest.mark.long
def test_pulses_of_a_timer_have_their_lengths(tmp_path, begin, method):
    """1 to 5 us each second: 200 pulses, of which the last but for 3 us of its own is over at the end."""
    trace = run(tmp_path, TIMER % {"begin": begin}, method=method)
    assert trace["k"].values[-1] == 398
    expected = sum(1e-6 * (1 + k % 5) for k in range(199))
    assert trace["y"].values[-1] == pytest.approx(expected, abs=398 * 4 * np.spacing(begin + 200.0))


@pytest.mark.parametrize("span", [1e9, 1e11, 1e13])
@pytest.mark.long
def test_an_event_shortly_before_the_end_of_a_long_span_happens(tmp_path, span):
    trace = run(tmp_path, LATE % {"span": span})
    assert trace["n"].values[-1] == 1
    assert trace.events[0].time == pytest.approx(span - 10.0, abs=4 * np.spacing(span))


@pytest.mark.parametrize("method", ["auto", "bdf", "radau"])
@pytest.mark.parametrize(("text", "limit"), [
    *[(HALVES % ratio, 1.0 + 1.0 / (1.0 - ratio)) for ratio in (0.1, 0.5, 0.9)],
    *[(TANKS % (b, fill, fill), (1.0 + b) / (1.0 - fill)) for b, fill in ((1.0, 0.75), (1.3, 0.5), (0.2, 0.2))],
])  # fmt: skip
@pytest.mark.one_in(12)
def test_instants_with_a_limit_end_the_run_there(tmp_path, text, limit, method):
    said = refused(tmp_path, text, method=method)
    assert "E930" in said
    assert "ever sooner" in said
    assert float(said.partition("t = ")[2].split()[0]) == pytest.approx(limit, abs=1e-9 * limit)


@pytest.mark.parametrize("when", ["every 1 ms", "when sin(1000 rad/s*t) >= 0.5"])
def test_a_discrete_variable_without_bound_ends_the_run_where_it_is_assigned(tmp_path, when):
    said = refused(tmp_path, OVERFLOW % when)
    assert "E933" in said
    assert "what an event assigns is no number, of k (= inf, by" in said


def test_samples_closer_than_instants_are_refused(tmp_path):
    for period in ("5e-324 s", "1e-13 s"):
        with pytest.raises(api.ModelError, match="E703"):
            run(tmp_path, OVERFLOW % f"every {period}")


FOLD = """from std.electrical import resistor, voltage
model schmitt {
  node s, a, o: electrical
  V: voltage(v = 5 V - 10 V/s*t) s -> ground
  R1: resistor(R = 1 kohm) s -> a
  R2: resistor(R = %g kohm) a -> o
  A: effort(e = clip(15000*a.e, -15 V, 15 V)) o -> ground
}
scene run of schmitt {
  time 0 s to 1 s
  trace o.e every 10 ms
}
"""


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.parametrize("r", [15.0, 30.0])
@pytest.mark.one_in(2)
def test_a_trigger_without_a_pole_is_told_as_a_fold(tmp_path, r, method):
    said = refused(tmp_path, FOLD % r, method=method)
    assert "E930" in said
    assert "an algebraic loop folds" in said
    at = 0.5 + 0.1 * (15.0 / r) * (1.0 - (1.0 + 1.0 / r) / 1e3)
    assert float(said.partition("t = ")[2].split()[0]) == pytest.approx(at, abs=1e-4)
