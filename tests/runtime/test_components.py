"""What a pattern joins, beside a search of the graph."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from sysdyn.runtime.numerics.components import components


def test_a_chain_is_one_and_what_nothing_joins_is_its_own():
    row = np.array([0, 0, 1, 1, 2, 2])
    column = np.array([4, 3, 3, 2, 2, 1])
    assert components(row, column, 6).tolist() == [0, 1, 1, 1, 1, 5]


@pytest.mark.parametrize("entries", [20, 60, 90])
@pytest.mark.one_in(2)
def test_random_patterns(entries):
    rng = np.random.default_rng(entries)
    row, column = rng.integers(0, 40, entries), rng.integers(0, 50, entries)
    joined = coo_array((np.ones(entries), (row, 50 + column)), shape=(100, 100))
    label = connected_components(joined, directed=False)[1][50:]
    first = {number: k for k, number in reversed(list(enumerate(label)))}
    assert components(row, column, 50).tolist() == [first[number] for number in label]
