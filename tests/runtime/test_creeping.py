"""A run that works and gets nowhere is stopped; one that works through a short layer goes on."""

import pytest
from sysdyn.runtime.integrate.creeping import Creeping
from sysdyn.runtime.integrate.request import Statistics

SPAN = 1000.0


def stopped_at(step, residuals, *, draft, tried=False, most=10_000_000):
    """Steps of a run whose steps are this long [s] and take so many residuals each; `most` where it goes on."""
    creeping = Creeping(SPAN, 0.0, Statistics(), draft=draft, tried=tried)
    for steps in range(0, most, 500):
        if not creeping.goes_on(steps * step, Statistics(steps, 0, steps * residuals, 0, 0, 0)):
            return steps
    return most


@pytest.mark.parametrize(
    ("draft", "step", "residuals", "steps"),
    [
        (False, 1e-12, 3, 20_000),
        (False, 1e-8, 3, 200_000),
        (False, 3e-8, 400, 5_000),  # Newton's method fails again and again
        (True, 1e-8, 3, 20_000),
        (True, 1e-8, 400, 500),
    ],
)
@pytest.mark.one_in(3)
def test_what_creeps_is_stopped(draft, step, residuals, steps):
    assert stopped_at(step, residuals, draft=draft) == steps


@pytest.mark.parametrize("draft", [False, True])
def test_what_creeps_is_left_early_to_a_method_that_follows(draft):
    assert stopped_at(1e-5, 3, draft=draft, tried=True) == 5_000
    assert stopped_at(1e-4, 3, draft=draft, tried=True, most=1_000_000) == 1_000_000


@pytest.mark.parametrize(("draft", "step"), [(False, 1e-7), (True, 1e-7)])
def test_what_gets_on_goes_on(draft, step):
    assert stopped_at(step, 3, draft=draft, most=1_000_000) == 1_000_000


def test_a_layer_of_many_short_steps_is_passed():
    creeping = Creeping(SPAN, 0.0, Statistics(), draft=False)
    assert creeping.goes_on(1e-10, Statistics(15_000, 0, 100_000, 0, 0, 0))
    assert creeping.goes_on(1e-2, Statistics(25_000, 0, 150_000, 0, 0, 0))
