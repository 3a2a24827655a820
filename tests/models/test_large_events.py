"""Events that the core takes by itself in a model of so many unknowns that arrays nobody needs exactly are halved."""

import numpy as np
import pytest
from sysdyn import api
from sysdyn.runtime.events.handler import Handler
from sysdyn.runtime.model.system import LARGE

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
