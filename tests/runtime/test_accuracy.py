"""The accuracy control's verdict on runs made up for the purpose."""

import numpy as np
import pytest
from sysdyn.runtime.integrate.accuracy import ROUND_OFF, Sampled, control


def sampled(tolerance, values):
    values = np.asarray(values, dtype=np.float64).reshape(-1, 1)
    return Sampled(tolerance, values, np.abs(values).max(axis=0), np.ones(1))


def test_runs_that_never_agree_leave_no_estimate():
    def run(tolerance, magnitude):
        return sampled(tolerance, [1.0, np.nan])

    achieved = control(run, np.array([1e-4]))
    assert achieved.error_estimate is None
    assert not achieved.met
    assert not achieved.below_round_off


@pytest.mark.parametrize(("part", "below"), [(1e-3, False), (1e-16, True)])
def test_an_estimate_below_round_off_says_so(part, below):
    def run(tolerance, magnitude):
        return sampled(tolerance, [1.0, 0.5 + part * tolerance])

    achieved = control(run, np.array([1e-4]))
    assert achieved.met
    assert achieved.below_round_off is below
    assert (achieved.error_estimate < ROUND_OFF) is below
