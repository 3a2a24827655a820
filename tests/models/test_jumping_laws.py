"""Steep laws that jump, and nothing else that happens."""

from pathlib import Path

import pytest
from sysdyn import api
from sysdyn.runtime.events.handler import Handler
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.jumps import pieces

TUBE = Path(__file__).parents[2] / "models" / "benchmark" / "tube.sd"
BASIS = 2
"""Of core/system/settle.c: whose factors stand."""


@pytest.mark.long
def test_steep_laws_that_jump_are_rosenbrocks_first():
    """The friction of a water tube jumps ten times, where its flow turns turbulent; the ends agree with radau's."""
    model = api.load(TUBE)
    trace, other = model.run(accuracy=1e-2), model.run(accuracy=1e-3, method="radau")
    assert trace.attributes["method"] == "rosenbrock"
    assert len(trace.events) == len(other.events) == 10
    for name in trace.names:
        one, two = trace[name].values, other[name].values
        assert abs(one[-1] - two[-1]) <= 1.1e-2 * max(abs(one).max(), abs(two).max()), name


@pytest.mark.parametrize("method", ["radau", "rosenbrock", "bdf"])
@pytest.mark.one_in(5)
def test_the_core_turns_laws_as_the_handler_does(monkeypatch, method):
    """Events and ends are the same but for the errors of runs at this tolerance (1e-4 by radau); what the core does the
    handler is not asked.
    """
    model, fired = api.load(TUBE), []
    fire = Handler.fire
    monkeypatch.setattr(Handler, "fire", lambda self, *a, **k: fired.append(a[0]) or fire(self, *a, **k))
    trace = model.run(rtol=1e-6, method=method)
    assert not fired
    monkeypatch.setattr(pieces, "serves", lambda plan, run: False)
    other = model.run(rtol=1e-6, method=method)
    assert fired
    assert len(trace.events) == len(other.events) == 10
    for one, two in zip(trace.events, other.events, strict=True):
        assert (one.name, one.before, one.after) == (two.name, two.before, two.after)
        assert abs(one.time - two.time) < 1e-5 * trace.time[-1]
    for name in trace.names:
        one, two = trace[name].values, other[name].values
        assert abs(one[-1] - two[-1]) < 3e-4 * max(abs(one).max(), abs(two).max()), name


@pytest.mark.parametrize("method", ["rosenbrock", "radau", "bdf"])
@pytest.mark.one_in(5)
def test_points_of_steep_laws_settle_by_a_basis(monkeypatch, method):
    """At a third of the cost of the least change, which they may miss by a tenth of the tolerance."""
    ran, run = [], Integration.run
    monkeypatch.setattr(Integration, "run", lambda self, *a, **k: ran.append(self) or run(self, *a, **k))
    api.load(TUBE).run(rtol=1e-5, method=method)
    settling = ran[-1].settler.core.contents
    assert settling.calls > 200
    assert (settling.failures, settling.refused) == (0, 0)
    assert settling.ready == BASIS
    assert 0.0 < settling.slack < 1e-5
