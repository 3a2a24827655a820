"""Dense factors of up to five rows, real and complex: as exact as LAPACK's, and left where a pivot is weak."""

import numpy as np
import pytest
from scipy.sparse import csc_array
from solving import Solver
from sysdyn.runtime.model import core_library as lib

SIZES = [1, 2, 3, 4, 5]
LITTLE = 2
"""`replayed` of factors that are little ones."""


def often(matrix):
    solver = Solver(matrix)
    lib.core.sd_linear_often(solver.linear)
    return solver


def met(n, seed):
    """A matrix with some zeros, whose pivots mostly do not stand on its diagonal."""
    rng = np.random.default_rng([n, seed])
    full = rng.normal(size=(n, n)) * (rng.uniform(size=(n, n)) < 0.7)
    full[rng.permutation(n), np.arange(n)] += 3.0
    return full


@pytest.mark.parametrize("n", SIZES)
def test_they_serve_from_the_first_matrix_on_whatever_the_scales(n):
    """Rows and columns forty decades apart, in units of which solutions are as exact as of the matrix between them."""
    rng = np.random.default_rng(n)
    for seed in range(30):
        full = met(n, seed)
        row, column = 10.0 ** rng.uniform(-20, 20, n), 10.0 ** rng.uniform(-20, 20, n)
        solver = often(csc_array(full * np.outer(row, column)))
        assert solver.factor(csc_array(full * np.outer(row, column)).data, 1.0 / column) == 0
        assert (solver.linear.contents.replayed, solver.linear.contents.rank) == (LITTLE, n)
        x = rng.normal(size=n)
        error = np.abs(solver.solve(row * (full @ x)) * column - x).max()
        assert error <= 1e-14 * np.linalg.cond(full) * np.abs(x).max()


@pytest.mark.parametrize("n", SIZES)
def test_complex_ones_are_as_exact(n):
    rng = np.random.default_rng(n)
    for seed in range(30):
        full = met(n, seed) + 1j * met(n, seed) * rng.normal(size=(n, n))
        matrix = csc_array(full)
        pattern = [np.ascontiguousarray(item, np.int32) for item in (matrix.indptr, matrix.indices)]
        linear = lib.core.sd_linear_z_new(n, *map(lib.pointer, pattern), None)
        lib.core.sd_linear_z_often(linear)
        assert lib.core.sd_linear_z_factor(linear, lib.pointer(matrix.data), lib.pointer(np.ones(n))) == 0
        wanted = rng.normal(size=n) + 1j * rng.normal(size=n)
        x = full @ wanted
        lib.core.sd_linear_z_solve(linear, lib.pointer(x))
        assert np.abs(x - wanted).max() <= 1e-14 * np.linalg.cond(full) * np.abs(wanted).max()
        lib.core.sd_linear_z_free(linear)


@pytest.mark.parametrize("size", [1e-3, 1e-12])
def test_a_faint_column_is_no_weak_pivot(size):
    """Where magnitudes are far too small all entries of a column are little parts of their rows."""
    full = np.array([[2.0, size, 1.0], [1.0, 2.0 * size, 3.0], [4.0, -size, 2.0]])
    solver = often(csc_array(full))
    assert solver.factor(csc_array(full).data, np.ones(3)) == 0
    assert solver.linear.contents.replayed == LITTLE
    x = np.array([1.0, 2.0 / size, 3.0])
    assert np.allclose(solver.solve(full @ x), x, rtol=1e-13)


def test_what_is_nearly_singular_is_refined_and_what_is_singular_said():
    faint = np.array([[1.0, 1.0, 0.0], [1.0, 1.0 + 1e-10, 1.0], [0.0, 1.0, 1.0 + 1e10]])
    solver = often(csc_array(faint))
    assert solver.factor(csc_array(faint).data, np.ones(3)) == 0
    assert solver.linear.contents.replayed != LITTLE
    x = np.array([1.0, 2.0, 3.0])
    assert np.abs(faint @ solver.solve(faint @ x) - faint @ x).max() <= 1e-15 * np.abs(faint).max() * 3.0
    singular = csc_array(np.array([[1.0, 2.0], [2.0, 4.0]]))
    solver = often(singular)
    assert solver.factor(singular.data, np.ones(2)) == 1
    assert solver.factor(np.array([1.0, np.nan, 2.0, 4.0]), np.ones(2)) == 1
