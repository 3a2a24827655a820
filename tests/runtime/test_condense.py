"""Sums of sums against the matrices they are."""

import numpy as np
import pytest
from sysdyn.runtime.condense.composition import composed


@pytest.mark.parametrize("seed", range(4))
def test_sums_of_sums_are_the_inverse_of_their_matrix(seed):
    """e = D z + L e with L strictly lower: T = (I - L)^-1 D; terms of one place add up, whatever their order."""
    random = np.random.default_rng(seed)
    number, kept = 12, 5
    rows, sources, factors = [], [], []
    for row in range(number):
        for source in random.integers(0, kept + row, size=random.integers(0, 5)):
            rows.append(row)
            sources.append(source)
            factors.append(random.normal())
    rows, sources, factor = np.array(rows), np.array(sources), np.array(factors)
    start = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=number))])
    own = np.where(sources < kept, sources, -1)
    found = composed(start, own, np.where(sources >= kept, sources - kept, -1))
    direct, lower = np.zeros((number, kept)), np.zeros((number, number))
    np.add.at(direct, (rows[own >= 0], sources[own >= 0]), factor[own >= 0])
    np.add.at(lower, (rows[own < 0], sources[own < 0] - kept), factor[own < 0])
    full = np.zeros((number, kept))
    full[np.repeat(np.arange(number), np.diff(found.start)), found.source] = found.values(factor)
    np.testing.assert_allclose(full, np.linalg.solve(np.eye(number) - lower, direct), rtol=1e-12, atol=1e-13)
    assert all((np.diff(found.source[a:b]) > 0).all() for a, b in zip(found.start[:-1], found.start[1:], strict=True))


def test_no_sums_at_all():
    found = composed(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    assert found.start.tolist() == [0]
    assert not found.values(np.zeros(0)).size
