"""Sparse factors of symmetric patterns against closed forms and SciPy's."""

import numpy as np
import pytest
from scipy.sparse import csc_array, random_array
from scipy.sparse.linalg import spsolve
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


@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_what_cannot_be_solved_is_said(value):
    here = np.arange(450)
    with pytest.raises(NotFiniteError):
        Symmetric(450, (here, here), np.where(here == 7, value, 1.0))
