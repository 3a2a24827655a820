"""Lists of operations in place of pivoting: exact, given up where pivots turn small."""

import ctypes

import numpy as np
import pytest
from scipy.sparse import csc_array
from solving import Solver, random_matrix
from sysdyn.runtime.model import core_library as lib


def replayed(matrix):
    """A solver that has seen enough matrices near this one to have an order of its own."""
    solver = Solver(matrix)
    lib.core.sd_linear_replayed(solver.linear)
    rng = np.random.default_rng(1)
    scale = np.ones(matrix.shape[0])
    for _ in range(3 + matrix.shape[0]):
        assert solver.factor(matrix.data * rng.uniform(0.9, 1.1, matrix.data.size), scale) == 0
    return solver


@pytest.mark.parametrize("n", [1, 6, 16, 40, 100])
def test_a_replayed_elimination_is_as_exact_as_pivoting(n):
    """Backward error of the solution beside that of LAPACK on the same matrices: within the growth that is allowed."""
    matrix = random_matrix(n, n, min(1.0, 3.0 / n))
    solver = replayed(matrix)
    rng = np.random.default_rng(2)
    for _ in range(20):
        values = matrix.data * rng.uniform(0.5, 2.0, matrix.data.size)
        full = csc_array((values, matrix.indices, matrix.indptr), shape=(n, n)).toarray()
        assert solver.factor(values, np.ones(n)) == 0
        b = rng.normal(size=n)
        size = np.abs(full).sum(axis=1).max()
        for x in (solver.solve(b), np.linalg.solve(full, b)):
            assert np.abs(full @ x - b).max() <= 1e-12 * (size * np.abs(x).max() + np.abs(b).max())
    assert solver.linear.contents.factorisations > 20


@pytest.mark.parametrize("n", [12, 80])
def test_a_replay_bears_scales_of_forty_decades(n):
    rng = np.random.default_rng(3)
    matrix = random_matrix(n, 9, 2.0 / n)
    row, column = 10.0 ** rng.uniform(-20, 20, n), 10.0 ** rng.uniform(-20, 20, n)
    solver = Solver(matrix)
    lib.core.sd_linear_replayed(solver.linear)
    for _ in range(n + 4):
        values = matrix.data * rng.uniform(0.9, 1.1, matrix.data.size)
        scaled = values * row[matrix.indices] * np.repeat(column, np.diff(matrix.indptr))
        assert solver.factor(scaled, 1.0 / column) == 0
        x = rng.normal(size=n)
        b = row * (csc_array((values, matrix.indices, matrix.indptr), shape=(n, n)) @ x)
        assert np.allclose(solver.solve(b) * column, x, rtol=1e-8)
    assert solver.linear.contents.replayed


@pytest.mark.parametrize("n", [3, 40, 90])
def test_columns_that_a_steep_law_leaves_open_are_seen_by_a_replay(n):
    """A diode's slope ties two nodes to the ground while it conducts; where it underflows their common potential is
    left, and determined again when it conducts once more.
    """
    rng = np.random.default_rng(n)
    full = np.diag(rng.uniform(2.0, 3.0, n)) + np.diag(np.append([0.0], rng.uniform(-1.0, 1.0, n - 2)), 1)

    def blocked(slope):
        full[:2, :2] = [[2.0, -2.0], [-2.0, 2.0 + slope]]
        return csc_array(full)

    solver = replayed(blocked(1.0))
    linear, idle = solver.linear.contents, (np.arange(n) == 1).astype(np.int32)
    linear.null_pivot, linear.idle = 1e-290, lib.pointer(idle)
    wanted = rng.normal(size=n)
    wanted[1] = -wanted[0]  # the shortest
    for slope, replays in ((1.0, 1), (1e3, 1), (1e-300, 0), (1.0, 1), (1e-6, 1), (0.0, 0), (1e8, 1), (3.0, 1)):
        matrix = blocked(slope)
        assert solver.factor(matrix.data, np.ones(n)) == 0
        assert (linear.replayed, linear.rank) == (replays, n if replays else n - 1)
        assert np.allclose(solver.solve(matrix @ wanted), wanted, rtol=1e-8, atol=0.0)


def test_each_state_of_laws_that_switch_keeps_its_order():
    """Two pairs of rows that pivot on their diagonal or beside it, as their switches stand: no order serves two states.
    All four are replayed once each has been met often enough, and are as exact as LAPACK.
    """
    rng = np.random.default_rng(5)
    solver = Solver(csc_array(np.kron(np.eye(2), np.ones((2, 2)))))
    lib.core.sd_linear_replayed(solver.linear)
    pairs = {False: np.array([[1.0, 1e-9], [1e-9, 1.0]]), True: np.array([[1e-9, 1.0], [1.0, 1e-9]])}
    linear, replays = solver.linear.contents, []
    for k in range(200):
        full = np.zeros((4, 4))
        for pair in range(2):
            at = slice(2 * pair, 2 * pair + 2)
            full[at, at] = pairs[bool(k // 3 >> pair & 1)] * rng.uniform(0.5, 2.0, (2, 2))
        assert solver.factor(csc_array(full).data, np.ones(4)) == 0
        replays.append(linear.replayed)
        b = rng.normal(size=4)
        assert np.allclose(solver.solve(b), np.linalg.solve(full, b), rtol=1e-12, atol=1e-14)
    assert all(replays[60:])


def solve_complex(matrix, b):
    """Solves beside a complex matrix and others near it, each with its own values, as a run makes them."""
    pattern = [np.ascontiguousarray(item, np.int32) for item in (matrix.indptr, matrix.indices)]
    linear = lib.core.sd_linear_z_new(b.size, *map(lib.pointer, pattern), None)
    lib.core.sd_linear_z_replayed(linear)
    rng = np.random.default_rng(1)
    for _ in range(5 + 2 * b.size):
        values = matrix.data * (rng.uniform(0.9, 1.1, matrix.data.size) + 0.1j * rng.normal(size=matrix.data.size))
        assert lib.core.sd_linear_z_factor(linear, lib.pointer(values), lib.pointer(np.ones(b.size))) == 0
        x = b.copy()
        lib.core.sd_linear_z_solve(linear, lib.pointer(x))
        full = csc_array((values, matrix.indices, matrix.indptr), shape=matrix.shape).toarray()
        size = np.abs(full).sum(axis=1).max()
        assert np.abs(full @ x - b).max() <= 1e-10 * (size * np.abs(x).max() + np.abs(b).max())
    lib.core.sd_linear_z_free(linear)


@pytest.mark.parametrize("n", [1, 3, 20, 60])
def test_a_replayed_elimination_of_complex_numbers_is_exact(n):
    matrix = random_matrix(n, 5, min(1.0, 3.0 / n))
    rng = np.random.default_rng(4)
    solve_complex(matrix, rng.normal(size=n) + 1j * rng.normal(size=n))


@pytest.mark.parametrize("n", [5, 12, 25])
@pytest.mark.parametrize("small", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5])
def test_pivots_that_become_small_cost_few_digits_whoever_solves(n, small):
    """While entries grow moderately the order stays: a multiplier of 1e3 costs three digits."""
    rng = np.random.default_rng(n)
    matrix = csc_array(rng.normal(size=(n, n)) + 3.0 * n * np.eye(n))
    solver = replayed(matrix)
    values = matrix.data.copy()
    values[np.repeat(np.arange(n), n) == np.tile(np.arange(n), n)] *= small
    full = values.reshape(n, n).T
    assert solver.factor(values, np.ones(n)) == 0
    b = rng.normal(size=n)
    found = solver.solve(b.copy())
    size = np.abs(full).sum(axis=1).max() * np.abs(found).max()
    assert np.abs(full @ found - b).max() < 1e-12 * size


@pytest.mark.parametrize("n", [5, 12, 25])
@pytest.mark.parametrize("small", [0.0, 1e-14, 1e-6])
def test_an_order_that_makes_entries_grow_gives_way_to_pivoting(n, small):
    """A pivot of the order found becomes small beside its column: exchanges are wanted, and made."""
    rng = np.random.default_rng(n)
    matrix = csc_array(rng.normal(size=(n, n)) + 3.0 * n * np.eye(n))
    solver = replayed(matrix)
    assert solver.linear.contents.replayed
    values = matrix.data.copy()
    values[np.repeat(np.arange(n), n) == np.tile(np.arange(n), n)] *= small
    full = values.reshape(n, n).T
    assert solver.factor(values, np.ones(n)) == 0
    assert not solver.linear.contents.replayed
    b = rng.normal(size=n)
    assert np.abs(full @ solver.solve(b) - b).max() < 1e-10 * np.abs(full).sum(axis=1).max()
    for _ in range(200):  # in time an order for these, too
        solver.factor(values * rng.uniform(0.99, 1.01, values.size), np.ones(n))
    assert solver.linear.contents.replayed


def test_a_pivot_that_cancels_is_left_to_pivoting_and_refinement():
    """The last pivot of two rows that become alike has nothing beside it to grow."""
    matrix = csc_array(np.array([[2.0, 1.0], [1.0, 2.0]]))
    solver = replayed(matrix)
    assert solver.linear.contents.replayed
    values = np.array([1.0, 1.0, 1.0, 1.0 + 1e-9])
    assert solver.factor(values, np.ones(2)) == 0
    assert not solver.linear.contents.replayed
    assert solver.linear.contents.smallest < 1e-8
    assert solver.factor(np.ones(4), np.ones(2)) == 1


def test_a_run_of_its_own_knows_nothing_of_matrices_before():
    """Runs of a batch on the same factors: each as if it were the first."""
    matrix = random_matrix(20, 7, 0.2)
    solver = replayed(matrix)
    lib.core.sd_linear_pivoted.restype = ctypes.POINTER(ctypes.c_int32)
    lib.core.sd_linear_pivoted(solver.linear)[0] = 0
    lib.core.sd_linear_pivoted.restype = ctypes.c_void_p
    assert solver.factor(matrix.data) == 0
    assert not solver.linear.contents.replayed
