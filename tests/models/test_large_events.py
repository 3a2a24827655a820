"""Events that the core takes by itself in a model of so many unknowns that arrays nobody needs exactly are halved."""

import sys
from pathlib import Path

import numpy as np
import pytest
from sysdyn import api
from sysdyn.cli.main import run
from sysdyn.runtime.events.handler import Handler
from sysdyn.runtime.model.system import LARGE
from sysdyn.runtime.trace.trace import Trace

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))
from many_events import TEXTS

ROOMS = """
model rooms {
  param n = 10
  param tau = 1 s
  param low = 0.4
  param high = 0.6
  state x[1..n]: 1 = 0
  discrete heating = true
  for i in 1..n {
    dynamic x[i]' = ((if heating then i/n else 0) - x[i])/tau
  }
  when x[n] >= high { heating := false }
  when x[n] <= low { heating := true }
}

scene day of rooms {
  time 0 s to 4.3 s
  trace x[1], x[2], x[n] every 0.1 s
}
"""
FIRST, EACH = np.log(1.0 / 0.4), np.log(1.5)
"""s: until the last room is warm, and between two events from then on."""


def warmth(t, part):
    """Of a room that is heated by this part of the last one's heater."""
    k = np.floor((t - FIRST) / EACH)
    since = t - FIRST - k * EACH
    later = np.where(k % 2 == 0, 0.6 * np.exp(-since), 1.0 - 0.6 * np.exp(-since))
    return part * np.where(t < FIRST, 1.0 - np.exp(-t), later)


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.one_in(2)
def test_the_core_takes_transitions_of_a_large_model_as_of_a_small_one(tmp_path, monkeypatch, method):
    """The handler is asked as often as of the small one (12 times of nine events; 19 where the core read sizes that
    were no doubles); instants and values are those of the closed form.
    """
    path = tmp_path / "rooms.sd"
    path.write_text(ROOMS)
    fire, asked, fired = Handler.fire, {}, []
    monkeypatch.setattr(Handler, "fire", lambda self, *a, **k: fired.append(1) or fire(self, *a, **k))
    for n in (10, LARGE + 2):
        fired.clear()
        trace = api.load(path, set={"n": n}).run(rtol=1e-7, method=method)
        asked[n] = len(fired)
        t = np.array([event.time for event in trace.events])
        assert t == pytest.approx(FIRST + EACH * np.arange(9), abs=1e-5)
        for name, part in (("x[1]", 1.0 / n), ("x[2]", 2.0 / n), ("x[n]", 1.0)):
            assert trace[name].values == pytest.approx(warmth(np.asarray(trace.time), part), abs=1e-5 * part), name
    assert asked[LARGE + 2] == asked[10]


@pytest.mark.long
def test_each_room_of_a_bank_switches_at_its_own_times(tmp_path):
    """The heat takes T to 45 K, the cold to 5 K, in 2000 s."""
    (tmp_path / "bank.sd").write_text(TEXTS["thermostats"])
    asked = {"set": {"n": 40}, "until": "1000 s", "accuracy": 1e-6}
    trace = api.simulate(tmp_path / "bank.sd", **asked, output=tmp_path / "t.h5")
    first = 2000.0 * np.log((30.0 - 3.0 * np.arange(1, 41) / 40.0) / 24.0)
    off, on = 2000.0 * np.log(16.0 / 14.0), 2000.0 * np.log(26.0 / 24.0)
    wanted = np.concatenate([first, first + off, first + off + on, first + 2.0 * off + on, first + 2.0 * (off + on)])
    found = np.sort([event.time for event in trace.events])
    wanted = np.sort(wanted[wanted < 1000.0])
    assert found.size == wanted.size
    assert np.abs(found - wanted).max() < 1e-6 * 2000.0


def test_balls_of_an_array_come_to_rest_in_one_note(tmp_path, capsys, monkeypatch):
    """The handler is asked for what each does first and last, whatever rests beside it (16 times in every flight)."""
    fire, fired = Handler.fire, list[int]()
    monkeypatch.setattr(Handler, "fire", lambda self, *a, **k: fired.append(1) or fire(self, *a, **k))
    (tmp_path / "balls.sd").write_text(TEXTS["balls"])
    assert run(["simulate", str(tmp_path / "balls.sd"), "--set", "n=12", "-o", str(tmp_path / "t.h5")]) == 0
    said = capsys.readouterr()
    assert len(fired) < 5 * 12  # in both runs, of some 400 impacts
    assert (said.out + said.err).count("N923") == 1
    assert "(and so do those of 11 more)" in said.out + said.err
    trace = Trace.open(tmp_path / "t.h5")
    rest = np.sqrt(2.0 * (1.0 + np.arange(1, 13) / 12.0) / 9.81) * 3.0  # the flights: 1 + 2 (1/2 + 1/4 + ...)
    held = [event.time for event in trace.events if event.after == "holds"]
    assert np.abs(np.sort(held) - rest).max() < 1e-4


@pytest.mark.long
def test_each_ball_bounces_as_often_as_one_alone(tmp_path):
    """By the bdf, which sees low flights by short steps alone: what another ball does meanwhile does not end them."""
    (tmp_path / "balls.sd").write_text(TEXTS["balls"])
    trace = api.load(tmp_path / "balls.sd", method="bdf", set={"n": 6}).run(rtol=1e-4)
    assert [sum(e.name == f"impact floor[{i}]" for e in trace.events) for i in range(1, 7)] == [16] * 6


def carts_that_collide(n, end):
    """When which neighbours meet, of carts that move on straight on between (TEXTS)."""
    x, v, t, found = [0.2 * k for k in range(1, n + 1)], [5.0] + [0.0] * (n - 1), 0.0, []
    while True:
        closing = [k for k in range(n - 1) if v[k] > v[k + 1]]
        times = [((x[k + 1] - x[k] - 0.1) / (v[k] - v[k + 1]), k) for k in closing]
        step, k = min(times)
        if t + step > end:
            return found
        t, x = t + step, [a + b * step for a, b in zip(x, v, strict=True)]
        x[k + 1] = x[k] + 0.1
        mean, part = (v[k] + v[k + 1]) / 2, 0.35 * (v[k] - v[k + 1])
        v[k], v[k + 1] = mean - part, mean + part
        found.append((t, f"impact touch[{k + 1}]"))


def test_carts_meet_one_after_another(tmp_path):
    """Where a microsecond, 1e-9 of their places, lies between two impacts they are not one."""
    (tmp_path / "carts.sd").write_text(TEXTS["carts"])
    trace = api.load(tmp_path / "carts.sd", set={"n": 18}).run(rtol=1e-8, until=3.3)
    wanted = carts_that_collide(18, 3.3)
    assert [e.name for e in trace.events] == [name for _, name in wanted]
    assert max(abs(e.time - t) for e, (t, _) in zip(trace.events, wanted, strict=True)) < 1e-10
