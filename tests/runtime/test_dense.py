"""The core's kernels for small matrices, orders, matchings and magnitudes beside NumPy, SciPy and closed forms."""

import numpy as np
import pytest
from scipy.sparse import coo_array, csc_array, diags_array, eye_array, kron
from scipy.sparse.csgraph import maximum_bipartite_matching
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.balance import RowBalance
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.numerics import ordering, rank
from sysdyn.runtime.numerics.matching import match_rows


def of_rank(random, m, n, k, spread):
    """A matrix [m, n] of rank k whose singular values fall to `spread`."""
    left, right = (np.linalg.qr(random.standard_normal((s, k)))[0] for s in (m, n))
    return np.ascontiguousarray(left * np.geomspace(1.0, spread, k) @ right.T)


@pytest.mark.parametrize("shape", [(1, 1), (3, 7), (7, 3), (20, 20), (32, 30)])
@pytest.mark.parametrize("spread", [1.0, 1e-5])
@pytest.mark.one_in(5)
def test_rank_and_nearest_solution(shape, spread):
    random = np.random.default_rng(4)
    for k in range(1, min(shape) + 1, 3):
        matrix = of_rank(random, *shape, k, spread)
        assert rank.rank(matrix) == k
        aim, x = random.standard_normal(shape[0]), np.zeros(shape[1])
        given = lib.pointer(matrix), lib.pointer(aim)
        assert lib.core.sd_nearest(*shape, *given, 1e-11, lib.pointer(x)) == 0
        expected = np.linalg.lstsq(matrix, aim, rcond=1e-11)[0]
        assert np.abs(x - expected).max() < 1e-10 / spread * np.abs(expected).max()
        assert np.abs(matrix.T @ (matrix @ x - aim)).max() < 1e-13 * np.abs(x).max() + 1e-14


def graded(a, b):
    """x, or None where the core says that a x = b does not determine it."""
    a, b, x = np.array(a, dtype=float), np.array(b, dtype=float), np.zeros(np.shape(a)[1])
    failed = lib.core.sd_graded(*a.shape, lib.pointer(a), lib.pointer(b), None, lib.pointer(x), None)
    assert failed in (0, 1)
    return None if failed else x


def corrected(a, b, noise):
    """The answer, x and what round-off leaves open of it, columns without a pivot being left."""
    a, b, noise = (np.array(item, dtype=float) for item in (a, b, noise))
    x, doubt = np.zeros((2, a.shape[1]))
    answer = lib.core.sd_graded(*a.shape, *map(lib.pointer, (a, b, noise, x, doubt)))
    return answer, x, doubt


def test_what_rows_do_not_determine_is_left():
    """Nodes 1, 2 by 3 S with each other and nothing else: 1 A from the one to the other says 1/3 V between them."""
    answer, x, _ = corrected([[3, -3], [-3, 3]], [1, -1], [1e-16, 1e-16])
    assert answer == 0
    assert x[0] - x[1] == pytest.approx(1 / 3, rel=1e-15)
    answer, _, _ = corrected([[3, -3], [-3, 3]], [1, -1 + 1e-12], [1e-16, 1e-16])
    assert answer == 2  # nowhere for the current to go


def test_of_more_columns_than_rows_the_last_are_left():
    """A rate that stands in one row with another, which stands alone in a second: three columns, two rows.  Which
    is left may depend on what cancels: of two that always stand together one.
    """
    answer, x, doubt = corrected([[2, 1, 0], [0, 4, 1]], [3, 4], [0, 0])
    assert (answer, x.tolist()) == (0, [1.0, 1.0, 0.0])
    assert np.isfinite(doubt).tolist() == [True, True, False]
    answer, x, doubt = corrected([[1, 1, 0], [1, 1, 1]], [1, 3], [0, 0])
    assert (answer, x.tolist()) == (0, [1.0, 0.0, 2.0])
    assert np.isfinite(doubt).tolist() == [True, False, True]
    answer, *_ = corrected([[1, 1, 0, 0], [2, 2, 0, 0], [0, 0, 1, 1]], [1, 3, 1], [0, 0, 0])
    assert answer == 2  # no other one agrees


def test_a_leak_in_a_sum_of_conductances_is_known_as_far_as_its_digits_reach():
    """The same with 1e-12 S from node 2 to ground, summed with the 3 S: one leak's current says 1 V, but for the digits
    that the sum lost; of 1e-17 S it keeps none, and the current is missed.
    """
    leak = 1e-12
    answer, x, doubt = corrected([[3, -3], [-3, 3 + leak]], [leak, 0], [0, 0])
    assert answer == 0
    assert abs(x[1] - 1.0) <= doubt[1] <= 1e-2
    answer, _, _ = corrected([[3, -3], [-3, 3 + 1e-17]], [leak, 0], [1e-20, 1e-20])
    assert answer == 2


@pytest.mark.parametrize("leak", [1e-3, 1e-12, 1e-25, 1e-170, 1e-300])
@pytest.mark.one_in(3)
def test_a_node_that_leakage_alone_holds(leak):
    """Nodes 1, 2 by 3 S with each other, by a leak and thrice a leak with ground; currents as rows of their own.  One
    leak's current into node 1: 1/4 V at both, 1e-17 V apart.
    """
    # unknowns: v1, v2, i12, i1, i2
    rows = [
        [0, 0, 1, 1, 0],
        [0, 0, -1, 0, 1],
        [-3, 3, 1, 0, 0],
        [-leak, 0, 0, 1, 0],
        [0, -3 * leak, 0, 0, 1],
    ]
    x = graded(rows, [leak, 0, 0, 0, 0])
    assert x[:2] == pytest.approx([0.25, 0.25], rel=max(1e-14, leak), abs=0.0)
    assert x[2:] == pytest.approx([0.75 * leak, 0.25 * leak, 0.75 * leak], rel=max(1e-14, leak), abs=0.0)


def test_graded_elimination_beside_fractions():
    """Random matrices, lines scaled by up to 1e60: relative errors of every unknown by its condition."""
    from fractions import Fraction

    random = np.random.default_rng(8)
    for n in (1, 2, 5, 9):
        core = random.integers(-4, 5, (n, n)) + 9 * np.eye(n)
        rows, columns = (10.0 ** random.uniform(-60, 60, n) for _ in range(2))
        a = rows[:, None] * core * columns
        b = rows * random.standard_normal(n)
        exact = [[Fraction(v) for v in [*line, right]] for line, right in zip(a.tolist(), b.tolist(), strict=True)]
        for k in range(n):
            for i in range(n):
                if i != k:
                    factor = exact[i][k] / exact[k][k]
                    exact[i] = [u - factor * v for u, v in zip(exact[i], exact[k], strict=True)]
        wanted = np.array([float(exact[k][n] / exact[k][k]) for k in range(n)])
        found = graded(a, b)
        assert np.abs(found - wanted).max(initial=0.0, where=wanted == 0.0) == 0.0
        assert np.abs(found / wanted - 1.0).max() < 1e-12


def test_what_graded_rows_leave_open():
    assert graded([[1.0, 1.0], [0.1 + 0.2, 0.3]], [1.0, 0.3]) is None  # round-off of a dependent row
    assert graded([[1.0, -1.0], [-1.0, 1.0]], [0.0, 0.0]) is None
    assert graded([[1.0, 1.0]], [1.0]) is None
    assert graded([[2.0, 0.0], [0.0, 0.0]], [1.0, 0.0]).tolist() == [0.5, 0.0]  # an unknown that stands nowhere
    assert graded([[1.0, 0.0], [0.0, 2.0], [1.0, 1.0]], [1.0, 4.0, 3.0]).tolist() == [1.0, 2.0]
    assert graded([[1.0, 0.0], [0.0, 2.0], [1.0, 1.0]], [1.0, 4.0, 3.1]) is None  # rows in excess that do not agree


def test_errors_that_cancel_leave_nothing_open():
    """A node on 1e-10 S of leakage behind 9.55 S: its current is the sum of two rows, known to 2e-16 A, not what 9.55 S
    make of potentials that are open by 2e-6 V each, and the node behind a junction of 1e-7 S is as sure as they are.
    """
    wide, leak, junction = 9.55, 1e-10, 1.8e-7
    rows = [
        [wide, -wide, 0, 0],
        [-wide, wide, 1, 0],
        [leak, 0, -1, 0],
        [0, junction, 0, -junction],
    ]
    answer, x, doubt = corrected(rows, [0, 0, 0, 0], [1e-16, 1e-16, 1e-26, 1e-22])
    assert answer == 0
    assert not x.any()
    assert doubt == pytest.approx([2e-6, 2e-6, 2e-16, 2e-6], rel=1e-6)


def test_what_is_no_number_is_said():
    with pytest.raises(rank.NotFiniteError):
        rank.rank(np.array([[1.0, np.nan], [0.0, 1.0]]))


@pytest.mark.parametrize(
    ("e", "index"),
    [([[1.0]], 0), ([[0.0]], 1), ([[0.0, 1.0], [0.0, 0.0]], 2), (np.diag([1.0, 1.0], 1), 3), (np.eye(6), 0)],
)
@pytest.mark.one_in(3)
def test_index_of_pencils_in_weierstrass_form(e, index):
    """N x' + x has the nilpotency of N as its index, in any bases and units."""
    e = np.array(e)
    n = len(e)
    random = np.random.default_rng(2)
    p, q = (random.standard_normal((n, n)) * 10.0 ** random.uniform(-6, 6, n) for _ in range(2))
    e, b = p.T @ e @ q, p.T @ q
    pattern = np.arange(0, n * n + 1, n, dtype=np.int32), np.tile(np.arange(n, dtype=np.int32), n)
    values = [np.ascontiguousarray(item.T).ravel() for item in (e, b)]
    arrays = [lib.pointer(item) for item in (*pattern, *values)]
    assert lib.core.sd_pencil_index(n, *arrays, 6) == index


def grid(k):
    line = diags_array([1.0, 1.0, 1.0], offsets=[-1, 0, 1], shape=(k, k))
    return csc_array(kron(line, eye_array(k)) + kron(eye_array(k), line))


def fill(matrix, order):
    """Entries of the Cholesky factor of A^T A: what partial pivoting may fill."""
    full = (abs(matrix.T) @ abs(matrix)).toarray()[np.ix_(order, order)] + 300.0 * np.eye(order.size)
    return np.count_nonzero(np.linalg.cholesky(full))


@pytest.mark.parametrize("kind", ["line", "grid"])
def test_order_is_a_permutation_that_fills_little(kind):
    matrix = grid(20) if kind == "grid" else csc_array(diags_array([1.0] * 3, offsets=[-1, 0, 1], shape=(400, 400)))
    n = matrix.shape[0]
    order = ordering._large(Pattern(n, n, matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)))[0]
    assert np.array_equal(np.sort(order), np.arange(n))
    found = fill(matrix, order)
    assert found <= (3 * n if kind == "line" else 0.7 * fill(matrix, np.arange(n)))


@pytest.mark.long
def test_matchings_are_as_large_as_can_be():
    random = np.random.default_rng(0)
    for _ in range(200):
        m, n = random.integers(1, 25, 2)
        a = csc_array((random.random((m, n)) < random.uniform(0.02, 0.3)).astype(float))
        column, row, found = a.indptr.astype(np.int32), a.indices.astype(np.int32), np.zeros(n, dtype=np.int32)
        looks = np.zeros(1, dtype=np.int64)
        places, answers = (lib.pointer(column), lib.pointer(row)), (lib.pointer(found), lib.pointer(looks))
        number = lib.core.sd_match(m, n, *places, 0, *answers)
        assert number == (maximum_bipartite_matching(a.tocsr(), perm_type="row") >= 0).sum()
        there = np.flatnonzero(found >= 0)
        assert np.unique(found[there]).size == there.size == number
        assert (a.toarray()[found[there], there] != 0.0).all()
        given = np.where(random.random(n) < 0.5, found, -1)
        other = match_rows(Pattern(m, n, column, row), given)
        assert (other >= 0).sum() == number
        assert np.isin(found[given >= 0], other).all()  # a row that had a partner has one


@pytest.mark.parametrize("kind", ["line", "grid", "backwards", "random"])
@pytest.mark.one_in(2)
def test_a_matching_looks_at_each_entry_a_few_times(kind):
    """Chains in which each column could drive the one before it from its row: one search through all of them each."""
    random, n = np.random.default_rng(2), 40_000
    a = {
        "line": lambda: diags_array([1.0] * 3, offsets=[-1, 0, 1], shape=(n, n)),
        "grid": lambda: grid(200),
        "backwards": lambda: diags_array([1.0] * 2, offsets=[0, 1], shape=(n, n)).tocsc()[::-1],
        "random": lambda: coo_array((np.ones(2 * n), random.integers(0, n, (2, 2 * n))), shape=(n, n)),
    }[kind]()
    a = csc_array(a)
    a.sum_duplicates()
    looks, found = np.zeros(1, dtype=np.int64), np.zeros(n, dtype=np.int32)
    column, row = a.indptr.astype(np.int32), a.indices.astype(np.int32)
    answers = lib.pointer(found), lib.pointer(looks)
    number = lib.core.sd_match(n, n, lib.pointer(column), lib.pointer(row), 0, *answers)
    assert number == (maximum_bipartite_matching(a.tocsr(), perm_type="row") >= 0).sum()
    assert looks[0] < 12 * a.nnz


def test_rows_that_are_peeled_are_independent():
    random = np.random.default_rng(1)
    for _ in range(100):
        m, n = random.integers(1, 9, 2)
        a = np.where(random.random((m, n)) < 0.3, random.uniform(0.5, 1.0, (m, n)), 0.0)
        row, column = (item.astype(np.int32) for item in np.nonzero(a))
        peeled = np.zeros(m, dtype=np.int32)
        value = a[row, column]
        arrays = [lib.pointer(item) for item in (row, column, value)]
        left = lib.core.sd_peel(m, n, row.size, *arrays, 1e-3, lib.pointer(peeled))
        assert left == m - peeled.sum()
        rest = a[peeled == 0]
        rest_rank = np.linalg.matrix_rank(rest) if rest.size else 0
        assert np.linalg.matrix_rank(a) == peeled.sum() + rest_rank


def test_magnitudes_balance_their_rows():
    """u = R i and i = C u' with u = 5: the current is 5/R, and behind it what the second row makes of that."""
    balance = RowBalance(2, np.array([0, 0, 1, 1]), np.array([0, 1, 1, 2]), np.array([0, 1, 2]))
    size = np.array([1.0, 100.0, 1.0, 1e-3])
    found = balance.propagate(np.array([5.0, 0.0, 0.0]), size, np.zeros(2))
    assert found == pytest.approx([5.0, 0.05, 50.0])
