"""A slice of random_truths.py: no run that is met is off by more than its accuracy allows."""

import os

import pytest
from random_truths import SORTS, TIMES, case, off

MANY = len(SORTS)
"""Seeds in a row are one of each sort."""


SEEDS = range(1010 * MANY, 1040 * MANY) if os.environ.get("SYSDYN_LONG") else range(1010 * MANY, 1011 * MANY)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_run_that_is_met_is_right(seed, tmp_path):
    _, text, formulation, method, accuracy, truth = case(seed)
    ratio, what = off(text, formulation, method, accuracy, truth, tmp_path)
    assert ratio is None or ratio <= TIMES, what
