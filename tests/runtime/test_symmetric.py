"""Sparse factors of symmetric patterns against closed forms and SciPy's."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csc_array, random_array
from scipy.sparse.linalg import spsolve
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.numerics.symmetric import Symmetric


def test_the_second_difference_of_a_square():
    """u'' = -2 with u = 0 at both ends is u = x (1 - x), at points exactly."""
    n = 500
    here, x = np.arange(n), np.arange(1, n + 1) / (n + 1)
    rows, columns = np.concatenate([here, here[1:], here[:-1]]), np.concatenate([here, here[:-1], here[1:]])
    matrix = Symmetric(n, (rows, columns), np.concatenate([np.full(n, 2.0), np.full(2 * n - 2, -1.0)]))
    found = matrix.solve(np.full(n, 2.0 / (n + 1) ** 2))
    assert np.abs(found - x * (1.0 - x)).max() < 1e-12
    assert np.abs(matrix.times(x * (1.0 - x)) - 2.0 / (n + 1) ** 2).max() < 1e-15


def test_a_saddle_point_whose_multipliers_have_no_pivot_of_their_own():
    """[I A^T; A 0]: the nearest point of the rows, as SciPy finds it, entries that meet added up."""
    rng = np.random.default_rng(2)
    rows, unknowns = 600, 900
    a = csc_array(random_array((rows, unknowns), density=3.0 / unknowns, rng=rng) + csc_array(np.eye(rows, unknowns)))
    i, j = a.nonzero()
    v, here = np.asarray(a[i, j]).ravel(), np.arange(unknowns)
    places = np.concatenate([here, here, unknowns + i, j]), np.concatenate([here, here, j, unknowns + i])
    values = np.concatenate([np.full(unknowns, 0.25), np.full(unknowns, 0.75), v, v])
    b = rng.normal(size=unknowns + rows)
    full = csc_array((values, places), shape=(b.size, b.size))
    found = Symmetric(b.size, places, values).solve(b)
    wanted = spsolve(full, b)
    assert np.abs(found - wanted).max() < 1e-9 * np.abs(wanted).max()


def _of_a_grid(m: int):
    """[I A^T; A -1e-13] of the rows "difference of two nodes = own unknown" of m x m nodes, and its order."""
    rng, node = np.random.default_rng(3), np.arange(m * m).reshape(m, m)
    ends = [np.concatenate([a.ravel(), b.ravel()]) for a, b in ((node[:, :-1], node[:-1]), (node[:, 1:], node[1:]))]
    rows, unknowns = ends[0].size, m * m + ends[0].size
    here, number = np.arange(unknowns), np.arange(rows)
    i, j = np.tile(number, 3), np.concatenate([*ends, m * m + number])
    v = np.concatenate([np.full(rows, 0.7), np.full(rows, -0.7), rng.uniform(1e-3, 0.1, rows)])
    places = np.concatenate([here, j, unknowns + i, unknowns + number])
    across = np.concatenate([here, unknowns + i, j, unknowns + number])
    return unknowns + rows, (places, across), np.concatenate([np.ones(unknowns), v, v, np.full(rows, -1e-13)])


@pytest.mark.parametrize("definite", [True, False])
def test_a_quasi_definite_matrix_fills_what_its_order_promises(definite):
    """Own rows pivot however faint; by pivots near the largest of their columns a grid fills several times as much."""
    matrix = Symmetric(*_of_a_grid(30), definite=definite)
    promised = 2 * matrix._order.filled + matrix._pattern.unknowns
    order = replace(matrix._order, otherwise=matrix._order.columns, most=promised)
    linear = order.linear(matrix._pattern)
    try:
        assert lib.core.sd_linear_factor(linear, lib.pointer(matrix._values), None) == 0
        assert bool(linear.contents.otherwise) == definite  # beyond `most` the order is given up
    finally:
        lib.core.sd_linear_free(linear)


def test_solutions_of_quasi_definite_matrices_are_refined_to_round_off():
    number, places, values = _of_a_grid(30)
    matrix, b = Symmetric(number, places, values, definite=True), np.random.default_rng(4).normal(size=number)
    found = matrix.solve(b)
    for _ in range(2):
        found = found + matrix.solve(b - matrix.times(found))
    wanted = spsolve(csc_array((values, places), shape=(number, number)), b)
    assert np.abs(found - wanted).max() < 1e-9 * np.abs(wanted).max()


@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_what_cannot_be_solved_is_said(value):
    here = np.arange(450)
    with pytest.raises(NotFiniteError):
        Symmetric(450, (here, here), np.where(here == 7, value, 1.0))
