"""Steep laws that jump, and nothing else that happens."""

from pathlib import Path

from sysdyn import api

TUBE = Path(__file__).parents[2] / "models" / "benchmark" / "tube.sd"


def test_steep_laws_that_jump_are_rosenbrocks_first():
    """The friction of a water tube jumps ten times, where its flow turns turbulent; the ends agree with radau's."""
    model = api.load(TUBE)
    trace, other = model.run(accuracy=1e-2), model.run(accuracy=1e-3, method="radau")
    assert trace.attributes["method"] == "rosenbrock"
    assert len(trace.events) == len(other.events) == 10
    for name in trace.names:
        one, two = trace[name].values, other[name].values
        assert abs(one[-1] - two[-1]) <= 1.1e-2 * max(abs(one).max(), abs(two).max()), name
