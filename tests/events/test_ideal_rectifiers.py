"""A slice of the random rectifiers; the whole is `python tests/events/ideal_rectifiers.py`."""

import pytest
from ideal_rectifiers import APART, Circuit, apart


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6, 8, 14, 38, 42, 48])
@pytest.mark.one_in(4)
@pytest.mark.filterwarnings("ignore")
def test_a_run_and_one_by_the_bdf_agree(seed, tmp_path):
    assert apart(tmp_path, seed)[0] < 0.1 * APART


def test_the_same_for_ever():
    assert Circuit(5).text == Circuit(5).text
    assert len({Circuit(seed).text for seed in range(60)}) == 60
