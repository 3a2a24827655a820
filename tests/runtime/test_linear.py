"""Factors and solutions of dense and sparse matrices, refactorised; what is left open where one is singular."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from solving import Solver, expander, random_matrix
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.numerics.ordering import (
    DENSE,
)


@pytest.mark.parametrize("n", [1, 2, 8, 9, 50, 120, 201, 400])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_agrees_with_numpy(n, seed):
    matrix = random_matrix(n, seed, min(1.0, 4.0 / n))
    solver = Solver(matrix)
    assert (solver.order is None) == (n <= DENSE)
    assert solver.factor(matrix.data) == 0
    b = np.random.default_rng(seed).normal(size=n)
    x = solver.solve(b)
    full = matrix.toarray()
    assert np.abs(full @ x - b).max() < 1e-11 * (1 + np.abs(full).max() * np.abs(x).max())


def test_refactorises_on_the_pattern_and_pivots_anew_when_a_pivot_dies():
    n = 80
    matrix = random_matrix(n, 5)
    solver = Solver(matrix)
    rng = np.random.default_rng(0)
    for _ in range(5):
        values = matrix.data * rng.uniform(0.9, 1.1, matrix.data.size)
        assert solver.factor(values) == 0
    assert solver.linear.contents.pivotings == 1
    # all large entries become small and the reverse: the old pivots are unhealthy
    values = 1e-6 / matrix.data
    assert solver.factor(values) == 0
    assert solver.linear.contents.pivotings >= 2
    b = rng.normal(size=n)
    exact = np.linalg.solve(csc_array((values, matrix.indices, matrix.indptr), shape=(n, n)).toarray(), b)
    assert np.allclose(solver.solve(b), exact, rtol=1e-8)


@pytest.mark.parametrize("n", [12, 80])
def test_scales_of_twelve_decades(n):
    rng = np.random.default_rng(3)
    matrix = random_matrix(n, 9, 0.1)
    row, column = 10.0 ** rng.uniform(-12, 12, n), 10.0 ** rng.uniform(-12, 12, n)
    values = matrix.data * row[matrix.indices] * np.repeat(column, np.diff(matrix.indptr))
    solver = Solver(matrix)
    assert solver.factor(values, 1.0 / column) == 0
    x = rng.normal(size=n)
    assert np.allclose(solver.solve(row * (matrix @ x)) * column, x, rtol=1e-8)


@pytest.mark.parametrize("n", [5, 70])
def test_singular_matrix_names_its_place(n):
    matrix = csc_array(np.eye(n) + np.eye(n, k=1))
    matrix.data = matrix.data.copy()
    solver = Solver(matrix)
    values = matrix.data.copy()
    values[matrix.indptr[3] : matrix.indptr[4]] = 0.0
    assert solver.factor(values) == 1
    assert solver.linear.contents.bad_column == 3


@pytest.mark.parametrize("beside", [0, 70])
def test_of_columns_without_a_pivot_the_shortest_solution_is_taken(beside):
    # two nodes that nothing ties to the rest but their difference; `beside`: more unknowns, for the sparse kernels
    matrix = np.eye(3 + beside)
    matrix[:3, :3] = [[2.0, -2.0, 0.0], [-2.0, 2.0, 1e-300], [0.0, 1e-300, 3.0]]
    matrix = csc_array(matrix)
    solver = Solver(matrix)
    rest = np.zeros(beside)
    idle = np.append([0, 1, 0], rest).astype(np.int32)
    linear = solver.linear.contents
    linear.null_pivot, linear.idle = 1e-10, lib.pointer(idle)
    for _ in range(2):  # chosen pivots, and the same once more
        assert solver.factor(matrix.data) == 0
        assert linear.rank == 2 + beside
        x = solver.solve([4.0, -4.0, 6.0, *rest])
        assert x == pytest.approx([1.0, -1.0, 2.0, *rest], abs=1e-12)
    assert solver.factor(matrix.data, np.array([1.0, 2.0, 1.0, *(1.0 + rest)])) == 0
    assert solver.solve([4.0, -4.0, 6.0, *rest])[:2] == pytest.approx([2 / 5, -8 / 5], abs=1e-12)
    # what has become a pivot is one
    values = matrix.data.copy()
    values[0] *= 2.0
    assert solver.factor(values) == 0
    assert linear.rank == 3 + beside
    assert solver.solve([4.0, -2.0, 6.0, *rest])[:2] == pytest.approx([1.0, 0.0], abs=1e-12)
    idle[1] = 0
    solver.factor(matrix.data)
    assert linear.rank == 3 + beside


@pytest.mark.parametrize("beside", [0, 70])
def test_directions_that_share_unknowns_are_all_taken_out(beside):
    # one row that four unknowns share: of all solutions of a + b + c + d = 4 the shortest, beside others
    matrix = np.eye(4 + beside)
    matrix[:4, :4] = [[1.0, 1.0, 1.0, 1.0], [2.0, 2.0, 2.0, 2.0], [-1.0, -1.0, -1.0, -1.0], [3.0, 3.0, 3.0, 3.0]]
    matrix = csc_array(matrix)
    solver = Solver(matrix)
    idle = np.append([1, 1, 1, 1], np.zeros(beside)).astype(np.int32)
    linear = solver.linear.contents
    linear.null_pivot, linear.idle = 1e-10, lib.pointer(idle)
    assert solver.factor(matrix.data) == 0
    assert linear.rank == 1 + beside
    x = solver.solve([4.0, 8.0, -4.0, 12.0, *np.ones(beside)])
    assert x == pytest.approx(np.ones(4 + beside), abs=1e-12)


@pytest.mark.parametrize("equal", [3, 300])
def test_a_dense_rest_without_a_pivot_names_its_place(equal):
    n = 700
    matrix = expander(n, 3, float).tolil()
    matrix[equal] = matrix[equal + 1]
    solver = Solver(matrix.tocsc())
    if solver.factor(csc_array(matrix).data) == 0:  # round-off
        assert solver.linear.contents.smallest < 1e-12
    else:
        assert 0 <= solver.linear.contents.bad_row < n
        assert 0 <= solver.linear.contents.bad_column < n


@pytest.mark.parametrize(("n", "often"), [(1, 1), (3, 1), (5, 1), (5, 0), (8, 1), (40, 0), (40, 1), (120, 0), (300, 0)])
def test_the_sign_of_a_determinant_is_that_of_its_rows_and_columns(n, often):
    """Of all factors: little ones, replayed orders, dense and sparse ones; two rows exchanged turn it."""
    seen = set()
    for seed in range(12):
        matrix = random_matrix(n, seed, min(1.0, 4.0 / n))
        solver = Solver(matrix)
        if often:
            lib.core.sd_linear_often(solver.linear)
        rng = np.random.default_rng(seed)
        for _ in range(12):
            values = matrix.data * rng.uniform(0.9, 1.1, matrix.data.size) * np.sign(rng.uniform(-0.05, 1.0))
            full = csc_array((values, matrix.indices, matrix.indptr), shape=(n, n)).toarray()
            assert solver.factor(values) == 0
            found = lib.core.sd_linear_orientation(solver.linear)
            assert found in (np.linalg.slogdet(full)[0], 0)
            assert found or solver.linear.contents.smallest < 1e-8
            seen.add((found, solver.linear.contents.replayed))
    assert {sign for sign, _ in seen} >= {1, -1}
    assert not often or len({kind for _, kind in seen}) == (1 if n <= 5 else 2)
