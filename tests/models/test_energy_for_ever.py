"""A slice of tests/bench/long_runs.py: energy, constraints and phase over a thousand periods, against closed forms."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))
from long_runs import measure, problems


@pytest.mark.parametrize(
    ("name", "formulation"), [(name, form) for name, problem in problems().items() for form in problem.forms]
)
@pytest.mark.one_in(4)
def test_a_thousand_periods(name, formulation):
    row = measure(name, formulation, "energy", 1e3, 1e-8)
    assert row.energy < 1e-12
    assert row.constraints < 1e-14
    # the tolerance is the error over one period: of a thousand it adds up to no more than as many
    assert abs(row.phase) < 1e-5


@pytest.mark.long
def test_the_meter_of_the_others_drifts():
    # so what holds above is no accident of the model
    assert measure("pendulum", "lagrangian", "dopri", 1e3, 1e-8).energy > 1e-6
