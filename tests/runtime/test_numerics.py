"""Rank, null space, least squares and equilibration against closed forms."""

import numpy as np
import pytest
from sysdyn.runtime.numerics.equilibrate import equilibrate, factors, sparse_factors
from sysdyn.runtime.numerics.points import distinct, normal, uniform
from sysdyn.runtime.numerics.products import PIECE, add_product, linked_places
from sysdyn.runtime.numerics.rank import (
    TOLERANCE,
    NotFiniteError,
    count,
    least_squares,
    left_null_vectors,
    null_space,
    rank,
    singular_decomposition,
)


def orthogonal(random, n):
    return np.linalg.qr(random.standard_normal((n, n)))[0]


@pytest.mark.parametrize("seed", range(20))
def test_the_rank_of_a_product_is_that_of_its_factors_in_any_units(seed):
    """A [m, r] B [r, n] of random factors has rank r, also where rows and columns are in units from 1e-9 to 1e9."""
    random = np.random.default_rng(seed)
    m, n = random.integers(2, 12, 2)
    r = int(random.integers(1, min(m, n) + 1))
    matrix = random.standard_normal((m, r)) @ random.standard_normal((r, n))
    rows, columns = 10.0 ** random.uniform(-9, 9, m), 10.0 ** random.uniform(-9, 9, n)
    (scaled,) = equilibrate(rows[:, None] * matrix * columns)
    assert rank(scaled) == r
    null = null_space(scaled)
    assert null.shape == (n, n - r)
    assert np.abs(scaled @ null).max(initial=0.0) < 1e-13
    assert np.abs(null.T @ null - np.eye(n - r)).max(initial=0.0) < 1e-13


@pytest.mark.parametrize(("m", "n", "ranks"), [(3, 6, (3, 2, 0, 1)), (4, 2, (2, 1, 0, 2))])
def test_rows_that_many_matrices_map_to_zero(m, n, ranks):
    random = np.random.default_rng(m)
    blocks = np.stack([random.standard_normal((m, r)) @ random.standard_normal((r, n)) for r in ranks])
    matrix, rows = left_null_vectors(blocks)
    for k, r in enumerate(ranks):
        own = rows[matrix == k]
        assert own.shape == (m - r, m)
        assert np.abs(own @ blocks[k]).max(initial=0.0) < 1e-13
        assert np.abs(own @ own.T - np.eye(m - r)).max(initial=0.0) < 1e-13


def test_what_counts_as_zero_lies_between_round_off_and_bad_conditioning():
    random = np.random.default_rng(1)
    u, v = orthogonal(random, 6), orthogonal(random, 6)
    for small, found in ((1e-7, 6), (2 * TOLERANCE, 6), (0.5 * TOLERANCE, 5), (1e-13, 5), (0.0, 5)):
        assert rank(u @ np.diag([1.0, 1.0, 0.5, 0.1, 0.01, small]) @ v) == found
    assert rank(np.zeros((3, 4))) == 0
    assert rank(np.zeros((0, 4))) == 0
    assert count(np.zeros(0)) == 0


def test_factors_do_not_see_the_units():
    """A matrix in other units is scaled to the same one; the largest entry of each line is near one."""
    random = np.random.default_rng(2)
    matrix = random.standard_normal((7, 5)) * (random.random((7, 5)) < 0.6)
    matrix[3] = 0.0
    (plain,) = equilibrate(matrix)
    other = 10.0 ** random.uniform(-30, 30, 7)[:, None] * matrix * 10.0 ** random.uniform(-30, 30, 5)
    (scaled,) = equilibrate(other)
    for found in (plain, scaled):
        assert np.abs(np.log10(np.abs(found).max(axis=1)[[0, 1, 2, 4, 5, 6]])).max() < 0.3
        assert np.abs(np.log10(np.abs(found).max(axis=0))).max() < 0.3
    assert not scaled[3].any()


def test_a_pair_keeps_its_pencil():
    """Both matrices of a pencil take the same factors: their generalised eigenvalues stay."""
    a, b = np.diag([1e6, 2e-6]), np.diag([2e6, 1e-6])
    one, two = equilibrate(a, b)
    assert np.sort(np.diag(one) / np.diag(two)) == pytest.approx([0.5, 2.0], rel=1e-14)
    row, column = factors(a, b)
    assert np.abs(row[:, None] * a * column - one).max() < 1e-15


def test_entries_and_full_matrices_take_the_same_factors():
    random = np.random.default_rng(4)
    matrix = random.standard_normal((9, 9)) * 10.0 ** random.uniform(-9, 9, (9, 9)) * (random.random((9, 9)) < 0.5)
    i, j = np.nonzero(matrix)
    row, column = sparse_factors(i, j, np.abs(matrix[i, j]), matrix.shape)
    full_row, full_column = factors(matrix)
    assert row == pytest.approx(full_row, rel=1e-12)
    assert column == pytest.approx(full_column, rel=1e-12)


def test_least_squares_is_the_pseudo_inverse():
    """x = V S^+ U^T b of a matrix whose singular values are known, one of them zero."""
    random = np.random.default_rng(5)
    u, v = orthogonal(random, 5), orthogonal(random, 4)
    sigma = np.array([3.0, 1.0, 0.1, 0.0])
    matrix = (u[:, :4] * sigma) @ v.T
    aim = random.standard_normal(5)
    exact = v[:, :3] @ ((u[:, :3].T @ aim) / sigma[:3])
    assert least_squares(matrix, aim) == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_has_no_rank(bad, capfd):
    matrix = np.eye(3)
    matrix[1, 2] = bad
    for ask in (
        lambda: rank(matrix),
        lambda: singular_decomposition(matrix),
        lambda: least_squares(matrix, np.ones(3)),
    ):
        with pytest.raises(NotFiniteError):
            ask()
    with pytest.raises(NotFiniteError):
        least_squares(np.eye(3), matrix[1])
    assert capfd.readouterr() == ("", ""), "LAPACK prints nothing"


def test_where_the_fast_algorithm_gives_up_the_slow_one_answers(monkeypatch):
    def gives_up(*_, **__):
        raise np.linalg.LinAlgError

    monkeypatch.setattr(np.linalg, "svd", gives_up)
    monkeypatch.setattr(np.linalg, "lstsq", gives_up)
    matrix = np.array([[2.0, 0.0], [0.0, 1e-12]])
    assert rank(matrix) == 1
    assert least_squares(matrix, np.array([4.0, 1.0])) == pytest.approx([2.0, 0.0])


def test_numbers_each_once():
    random = np.random.default_rng(6)
    for size in (0, 1, 50):
        values = random.integers(-9, 9, size)
        assert np.array_equal(distinct(values), np.unique(values))


@pytest.mark.parametrize("which", [0, 1])
def test_numbers_without_a_pattern_fill_the_interval_evenly(which):
    """Every interval holds as many of n numbers as its length tells, but for a few (discrepancy O(log n / n))."""
    n = 2000
    found = np.sort(uniform(n, which))
    assert 0.0 <= found[0] < found[-1] < 1.0
    assert np.abs(found - (np.arange(n) + 0.5) / n).max() < 6.0 / n
    assert np.array_equal(uniform(n, which)[500:], uniform(1500, which, 500))


def test_both_sequences_together_fill_the_square():
    """Each of 100 squares holds 20 of 2000 points: random ones would leave it by four and a half."""
    i, j = ((uniform(2000, which) * 10).astype(int) for which in (0, 1))
    assert np.abs(np.bincount(10 * i + j, minlength=100) - 20).max() <= 4


def test_normal_numbers_have_the_moments_of_the_normal_distribution():
    found = normal(200, 50)
    assert found.shape == (200, 50)
    moments = [np.mean(found**k) for k in range(1, 5)]
    assert moments == pytest.approx([0.0, 1.0, 0.0, 3.0], abs=0.05)
    assert np.linalg.cond(found[:, :6]) < 10.0


def test_a_matrix_by_its_entries_times_a_vector_is_added_to_what_is_there():
    """[1 2; 0 3; 0 0] by entries, one of them in two parts, times (10, 100)."""
    rows, columns, values = [1, 0, 0, 0], [1, 0, 1, 1], np.array([3.0, 1.0, 1.5, 0.5])
    out = np.array([1.0, 1.0, 1.0])
    assert add_product(rows, columns, values, np.array([10.0, 100.0]), out) is out
    assert out.tolist() == [211.0, 301.0, 1.0]
    none = np.zeros(0)
    assert add_product([], [], none, none, np.array([2.0])).tolist() == [2.0]
    # whatever kind of numbers and strides they come in
    found = add_product(
        np.array([0, 1], dtype=np.int32)[::-1], np.array([0, 0]), np.array([1, 2]), np.arange(6.0)[3::2], np.zeros(2)
    )
    assert found.tolist() == [6.0, 3.0]


@pytest.mark.parametrize("entries", [0, 7, PIECE, 2 * PIECE + 3])
def test_rows_with_entries_in_chosen_columns_are_those_of_the_products_with_them(entries):
    """Of places in 32 bits, in pieces: as a product of the pattern with ones in the chosen columns is not zero."""
    random = np.random.default_rng(entries)
    rows, columns = (random.integers(0, n, entries, dtype=np.int32) for n in (50_000, 4_000))
    chosen = random.random(4_000) < 0.1
    product = np.bincount(rows, chosen[columns].astype(float), 50_000)
    assert (linked_places(chosen, columns, rows, 50_000) == (product > 0.0)).all()
