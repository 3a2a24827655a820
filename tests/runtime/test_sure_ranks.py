"""Ranks told by factors where these leave no doubt say what singular values say, and leave the rest to them."""

import numpy as np
import pytest
from sysdyn.runtime.numerics.rank import (
    CERTAIN,
    singular_decomposition,
    singular_values,
    sure_complement,
    sure_solver,
)


def with_singular_values(rng, m, n, sigma):
    u, v = (np.linalg.qr(rng.normal(size=(k, k)))[0] for k in (m, n))
    return u[:, : len(sigma)] * np.asarray(sigma) @ v[:, : len(sigma)].T, v


@pytest.mark.parametrize(("m", "n"), [(3, 7), (40, 55), (30, 30)])
def test_what_rows_leave_open_is_what_singular_values_say(m, n):
    rng = np.random.default_rng(m)
    matrix, v = with_singular_values(rng, m, n, np.geomspace(1.0, 1e-6, m))
    found = sure_complement(matrix, CERTAIN)
    assert found.shape == (n, n - m)
    assert np.abs(found.T @ found - np.eye(n - m)).max(initial=0.0) < 1e-13
    assert np.abs(matrix @ found).max(initial=0.0) < 1e-14
    assert np.abs(v[:, :m].T @ found).max(initial=0.0) < 1e-9


@pytest.mark.parametrize("last", [0.0, 1e-16, 1e-12, 1e-11])
def test_where_rows_nearly_depend_on_each_other_singular_values_are_asked(last):
    rng = np.random.default_rng(2)
    matrix, _ = with_singular_values(rng, 20, 25, [*np.ones(19), last])
    assert sure_complement(matrix, CERTAIN) is None
    assert sure_complement(np.vstack([matrix, matrix]), CERTAIN) is None
    square, _ = with_singular_values(rng, 20, 20, [*np.ones(19), last])
    assert sure_solver(square, CERTAIN) is None
    assert sure_solver(np.zeros((3, 3)), CERTAIN) is None


def test_a_matrix_that_is_regular_beyond_doubt_solves():
    rng = np.random.default_rng(3)
    square, _ = with_singular_values(rng, 50, 50, np.geomspace(1.0, 1e-5, 50))
    wanted = rng.normal(size=(50, 4))
    assert np.abs(sure_solver(square, CERTAIN)(square @ wanted) - wanted).max() < 1e-9
    assert np.abs(singular_values(square) - singular_decomposition(square)[1]).max() < 1e-14


def test_a_small_matrix_is_decomposed_once():
    """Whoever asks for it again has the same arrays, which nobody may write."""
    matrix = np.array([[3.0, 0.0], [0.0, 2.0], [0.0, 0.0]])
    u, sigma, vt = singular_decomposition(matrix)
    assert sigma.tolist() == [3.0, 2.0]
    assert (u[:, :2] * sigma @ vt == matrix).all()
    assert singular_decomposition(matrix.copy())[0] is u
    assert singular_decomposition(2.0 * matrix)[1].tolist() == [6.0, 4.0]
    with pytest.raises(ValueError, match="read-only"):
        sigma[0] = 1.0
