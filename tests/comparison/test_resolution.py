"""What rows say of a curve between them: the estimate against a sine, and the note of a verdict."""

import numpy as np
import pytest
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.comparison.compare import compare
from sysdyn.runtime.comparison.curve import Curve
from sysdyn.runtime.comparison.resolution import _between
from sysdyn.runtime.comparison.verdict import Tolerance


@pytest.mark.parametrize("with_rates", [True, False])
@pytest.mark.parametrize("rows", [60, 200])
@pytest.mark.one_in(2)
def test_the_estimate_of_a_sine_is_its_error(rows, with_rates):
    t = np.linspace(0.0, 20.0, rows) ** 1.1
    curve = Curve(t, np.sin(t), np.cos(t) if with_rates else None)
    for at in (1.3, 7.7, 14.2):
        k = int(np.searchsorted(t, at)) - 1
        h, x = t[k + 1] - t[k], (at - t[k]) / (t[k + 1] - t[k])
        error = h**4 / 24.0 * (x * (1.0 - x)) ** 2 if with_rates else h**2 / 2.0 * x * (1.0 - x)
        assert 0.3 * abs(np.sin(at)) < _between(curve, at)[0] / error < 2.0
    assert _between(curve, float(t[30]))[0] < 1e-12


def test_a_verdict_on_rows_that_are_far_apart_says_so():
    """Two samplings of one sine; and two sines, of which rows as few do tell that they differ."""
    coarse, fine = np.linspace(0.0, 10.0, 35), np.linspace(0.0, 10.0, 2001)

    def verdict(first, second):
        (found,) = compare(Arrays(*first), Arrays(*second), Tolerance()).quantities
        return found

    def wave(t, size=1.0):
        return t, {"x": size * np.sin(2.0 * t)}

    found = verdict(wave(coarse), wave(fine))
    assert found.status == "differs"
    assert found.note.startswith("rows of the reference are 0.294 s apart there")
    assert verdict(wave(fine), wave(coarse)).note.startswith("rows of the test")
    assert verdict(wave(coarse, 3.0), wave(fine)).note == ""
    assert verdict(wave(fine, 1.01), wave(fine)).note == ""
