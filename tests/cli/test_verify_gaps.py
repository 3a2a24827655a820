"""What differs between two traces for `sysdyn verify`, and up to which instant."""

from dataclasses import replace

import numpy as np
import pytest
from sysdyn.cli.verify.agreement import gaps, horizon
from sysdyn.runtime.events.plan import Happened
from sysdyn.runtime.trace.trace import Quantity, Trace

# --- agreement --------------------------------------------------------------------------------------------------------


def trace(time, unit="1", **values):
    """A trace of given values."""
    data = {name: Quantity(name, np.asarray(v, dtype=float), unit, None, None) for name, v in values.items()}
    return Trace("", np.asarray(time, dtype=float), {}, {}, data)


def test_between_one_event_of_two_traces_nothing_is_compared():
    """A step at 1.999 s in one, at 2.001 s in the other; what differs behind both is found."""
    one, other = trace([0, 1, 2, 3], x=[0, 0, 1, 1]), trace([0, 1, 2, 3], x=[0, 0, 0, 1])
    assert horizon(one, other, {"x": 0.1})[0] == 1.0
    events = [replace(t, events=(Happened(at, "stop", "stop", "", ""),)) for t, at in ((one, 1.999), (other, 2.001))]
    assert horizon(*events, {"x": 0.1}) == (3.0, None)
    late = replace(trace([0, 1, 2, 3], x=[0, 0, 0, 3]), events=events[1].events)
    assert horizon(events[0], late, {"x": 0.1})[1].time == 3.0


def test_gaps_are_of_the_smaller_nominal_at_common_instants():
    one = trace([0, 1, 2, 3], x=[0, 10, 20, 20])
    other = trace([0, 2, 3, 4], x=[0, 24, 22, 999])
    for pair in ((one, other), (other, one)):
        (gap,) = gaps(*pair, {"x": 0.1}, np.inf)
        assert (gap.variable, gap.time, gap.first) == ("x", 2.0, 2.0)
        assert gap.ratio == pytest.approx(2.0)
    assert gap.values == (24.0, 20.0)
    (gap,) = gaps(one, other, {"x": 0.1}, 1.5)
    assert (gap.time, gap.first, gap.ratio) == (0.0, None, 0.0)
    assert gaps(one, trace([5, 6], x=[0, 0]), {"x": 0.1}, np.inf) == ()


def test_what_is_left_of_a_zero_does_not_count():
    one = trace([0, 1], x=[0, 1e-17], y=[1, 2])
    assert gaps(one, trace([0, 1], x=[0, -1e-17], y=[1, 2]), {"x": 1e-3}, np.inf)[0].ratio < 1e-3
    assert gaps(one, trace([0, 1], x=[0, -1e-10], y=[1, 2]), {"x": 1e-3}, np.inf)[0].ratio > 1.0


def test_what_is_not_a_number_or_has_no_scale_differs():
    one = trace([0, 1], x=[0, 1], z=[0, 0])
    found = gaps(one, trace([0, 1], x=[0, np.nan], z=[0, 0]), {"x": 1.0, "z": 1e-3}, np.inf)
    assert [(g.variable, g.ratio) for g in found] == [("x", np.inf), ("z", 0.0)]
    (gap,) = gaps(one, trace([0, 1], z=[0, 1e-9]), {"z": 1e-3}, np.inf)
    assert gap.ratio == pytest.approx(1e3)


def test_horizon_is_the_last_instant_before_the_first_difference():
    one = trace([0, 1, 2, 3], x=[1, 1, 1, 1], y=[1, 1, 1, 1])
    other = trace([0, 1, 2, 3], x=[1, 1, 1.5, 1], y=[1, 1.05, 1, 3])
    until, beyond = horizon(one, other, {"x": 0.1, "y": 0.1})
    assert (until, beyond.variable, beyond.time) == (1.0, "x", 2.0)
    assert horizon(one, one, {"x": 0.1}) == (3.0, None)
    assert horizon(one, trace([0, 1], x=[9, 9]), {"x": 0.1})[0] == -np.inf
