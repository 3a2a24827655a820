"""Sums of sums against the matrices they are."""

from types import SimpleNamespace

import numpy as np
import pytest
from sysdyn.runtime.condense.composition import compose_definitions
from sysdyn.runtime.condense.elimination import Elimination
from sysdyn.runtime.condense.sums import ConstantSums, Straights, numbers_of, sums


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.one_in(2)
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
    found = compose_definitions(start, own, np.where(sources >= kept, sources - kept, -1))
    direct, lower = np.zeros((number, kept)), np.zeros((number, number))
    np.add.at(direct, (rows[own >= 0], sources[own >= 0]), factor[own >= 0])
    np.add.at(lower, (rows[own < 0], sources[own < 0] - kept), factor[own < 0])
    full = np.zeros((number, kept))
    full[np.repeat(np.arange(number), np.diff(found.start)), found.source] = found.values(factor)
    np.testing.assert_allclose(full, np.linalg.solve(np.eye(number) - lower, direct), rtol=1e-12, atol=1e-13)
    assert all((np.diff(found.source[a:b]) > 0).all() for a, b in zip(found.start[:-1], found.start[1:], strict=True))


def test_no_sums_at_all():
    found = compose_definitions(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    assert found.start.tolist() == [0]
    assert not found.values(np.zeros(0)).size


def numbers(factor):
    """e0 = 1 + 2 z0, e1 = 3 e0 - z1 of the unknowns (z0, e0, z1, e1), with the factor in place of 3."""
    return ConstantSums(
        place=np.array([1, 3]),
        constant=np.array([1.0, 0.0]),
        start=np.array([0, 1, 3]),
        source=np.array([0, 1, 2]),
        factor=np.array([2.0, factor, -1.0]),
        kept=np.array([0, 2], dtype=np.int32),
        unread=np.zeros(0, dtype=np.int64),
    )


def test_numbers_of_sums_are_composed_of_what_is_kept():
    """e1 = 3 (1 + 2 z0) - z1: by z, 6 and -1."""
    of = numbers(3.0)
    found = of.composition(4)
    full = np.zeros((2, 2))
    full[np.repeat([0, 1], np.diff(found.start)), found.source] = found.values(of.factor)
    assert full.tolist() == [[2.0, 0.0], [6.0, -1.0]]
    assert of.same(numbers(3.0))
    assert not of.same(numbers(np.nextafter(3.0, 4.0)))
    assert numbers_of(4, of.kept).tolist() == [0, -1, 1, -1]


def test_stretches_of_sums_are_renewed_with_their_numbers():
    """Two sums of unlike numbers of terms are two stretches; a constant that vanishes is not added."""
    made = Straights(numbers(3.0))
    made.renew(numbers(3.0))
    assert [(s.place, s.number, s.terms, bool(s.constant)) for s in made.array] == [(1, 1, 1, True), (3, 1, 2, False)]


def test_numbers_of_a_sum_are_those_of_its_row_over_its_pivot():
    """2 x + 4 y - 6 = 0 defines x = 3 - 2 y, and 5 z - x = 0 then z = x/5; w, which nothing reads, goes too."""
    columns = np.array([0, 1, 0, 2])
    system = SimpleNamespace(unknowns=4, pattern=SimpleNamespace(columns_of=lambda: columns))
    longs = [np.array(item) for item in ([0, 2], [0, 1], [0, 3], [0, 1, 2], [1, 2], [3])]
    found = sums(system, Elimination(*longs), np.array([2.0, 4.0, -1.0, 5.0]), np.array([-6.0, 0.0]))
    assert found.constant.tolist() == [3.0, 0.0]
    assert found.factor.tolist() == [-2.0, 0.2]
    assert (found.source.tolist(), found.kept.tolist(), found.unread.tolist()) == ([1, 0], [1], [3])
