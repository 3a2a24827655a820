"""Where a watched value falls through zero within a step: Ridders' method, by few looks at the dense output."""

import math

import numpy as np
import pytest
from sysdyn.runtime.events.locate import _root

FALLING = {
    "an exponential": (lambda t: math.exp(-t) - 0.3, 0.0, 5.0, -math.log(0.3)),
    "a parabola": (lambda t: 1.0 - t * t, 0.5, 9.0, 1.0),
    "a steep one": (lambda t: math.tanh(40.0 * (0.7 - t)), 0.0, 1.0, 0.7),
    "a root at the end": (lambda t: (1.0 - t) * (3.0 + t), 0.0, 1.0, 1.0),
}


@pytest.mark.parametrize(("value", "begin", "end", "root"), list(FALLING.values()), ids=list(FALLING))
@pytest.mark.parametrize(("side", "level"), [(1, 0.0), (-1, 0.0), (1, -0.2)])
def test_a_root_is_found_by_few_looks(value, begin, end, root, side, level):
    """A look costs all observed quantities: halving alone would take 50, a false position of these some hundreds."""
    looks = []

    def dense(t):
        looks.append(t)
        return np.array([np.nan, side * (value(t) + level)])

    ends = [(t, value(t)) for t in (begin, end)]
    found = _root(dense, 1, side, *ends, level)
    assert found == pytest.approx(root, rel=1e-13)
    assert value(found) >= 0.0 or found == root
    assert len(looks) <= 20


def test_what_begins_at_zero_and_rises_first_falls_later():
    found = _root(lambda t: np.array([t * (2.0 - t)]), 0, 1, (0.0, 0.0), (3.0, -3.0))
    assert found == pytest.approx(2.0, rel=1e-13)


def test_what_begins_at_zero_and_falls_falls_there():
    assert _root(lambda t: np.array([-t]), 0, 1, (0.0, 0.0), (3.0, -3.0)) == 0.0
