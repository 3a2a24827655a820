import numpy as np
import pytest
from scipy.sparse import csc_array, random_array
from scipy.sparse.linalg import splu
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.numerics.ordering import DENSE, column_order, least_degree


class Solver:
    """The core's linear solver on one pattern; keeps the arrays alive."""

    def __init__(self, matrix, sparse=None):
        matrix = csc_array(matrix)
        matrix.sort_indices()
        n = matrix.shape[0]
        self.pattern = Pattern(n, n, matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32))
        self.order = column_order(self.pattern)
        if sparse:
            self.order = np.arange(n, dtype=np.int32)
        pointers = [lib.pointer(item) for item in (self.pattern.column, self.pattern.row, self.order)]
        self.linear = lib.core.sd_linear_new(n, *pointers)

    def __del__(self):
        lib.core.sd_linear_free(self.linear)

    def factor(self, values, scale=None):
        values = np.ascontiguousarray(values)
        return lib.core.sd_linear_factor(self.linear, lib.pointer(values), lib.pointer(scale))

    def solve(self, b):
        x = np.array(b, dtype=float)
        lib.core.sd_linear_solve(self.linear, lib.pointer(x))
        return x


def random_matrix(n, seed, density=0.05):
    rng = np.random.default_rng(seed)
    matrix = csc_array(random_array((n, n), density=density, rng=rng))
    matrix = csc_array(
        matrix + csc_array((rng.normal(size=n), (rng.permutation(n), np.arange(n))), shape=(n, n))
    )
    matrix.sort_indices()
    return matrix


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


def test_a_column_without_a_pivot_stays_where_it_may():
    # two nodes that nothing ties to the rest but their difference: the second may float
    matrix = csc_array(np.array([[2.0, -2.0, 0.0], [-2.0, 2.0, 1e-300], [0.0, 1e-300, 3.0]]))
    solver = Solver(matrix)
    idle = np.array([0, 1, 0], dtype=np.int32)
    linear = solver.linear.contents
    linear.null_pivot, linear.idle = 1e-10, lib.pointer(idle)
    assert solver.factor(matrix.data) == 0
    assert linear.rank == 2
    x = solver.solve([4.0, -4.0, 6.0])
    assert x == pytest.approx([2.0, 0.0, 2.0], abs=1e-12)
    idle[1] = 0
    solver.factor(matrix.data)
    assert linear.rank == 3


@pytest.mark.parametrize("n", [20, 60, 150])
def test_least_degree_fills_little_more_than_the_library(n):
    rng = np.random.default_rng(n)
    place = rng.permutation(n)
    band = np.triu(np.tril(rng.uniform(0.5, 1.5, (n, n)), 2), -1)[place][:, rng.permutation(n)]
    matrix = csc_array(band)
    order = least_degree(Pattern(n, n, matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)))
    own = splu(csc_array(band[:, order]), permc_spec="NATURAL", diag_pivot_thresh=0.1)
    other = splu(matrix, permc_spec="COLAMD", diag_pivot_thresh=0.1)
    assert own.L.nnz + own.U.nnz <= 1.1 * (other.L.nnz + other.U.nnz)
