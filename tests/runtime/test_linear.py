import ctypes
import os

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron, random_array
from scipy.sparse.linalg import splu
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.numerics.ordering import (
    DENSE,
    Order,
    any_order,
    column_order,
    least_degree,
    paired_order,
    with_pairs,
)


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
    matrix = csc_array(matrix + csc_array((rng.normal(size=n), (rng.permutation(n), np.arange(n))), shape=(n, n)))
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


def expander(n, seed, kind):
    """A net with branches drawn at random: behind a sparse beginning its factors are dense; rows of no symmetry."""
    rng = np.random.default_rng(seed)
    ends = rng.integers(0, n, (2, 2 * n))
    ends = ends[:, ends[0] != ends[1]]
    values = rng.uniform(0.5, 1.0, (2, ends.shape[1]))
    if kind is complex:
        values = values + 0.3j * rng.normal(size=values.shape)
    rows, columns = np.hstack([ends, ends[::-1]])
    matrix = csc_array((-values.ravel(), (rows, columns)), shape=(n, n))
    matrix = csc_array(matrix + diags_array(6.0 + rng.random(n)))
    matrix.sort_indices()
    return matrix


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("paired", [False, True])
def test_columns_that_fill_alike_are_applied_together(kind, paired):
    n = 700
    matrix = expander(n, 3, kind)
    rng = np.random.default_rng(0)
    pattern = Pattern(n, n, matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32))
    order = any_order(pattern)
    if paired:
        order = with_pairs(pattern, order, lambda: np.arange(n, dtype=np.int32))
    assert order.paired == paired
    linear = order.complex_linear(pattern) if kind is complex else order.linear(pattern)
    letter = "z_" if kind is complex else ""
    factor, solve, free = (getattr(lib.core, f"sd_linear_{letter}{name}") for name in ("factor", "solve", "free"))
    try:
        for change in (0.0, 0.2, 0.0):
            values = np.ascontiguousarray(matrix.data * (1.0 + change * rng.random(matrix.data.size)))
            assert factor(linear, lib.pointer(values), lib.pointer(np.ones(n))) == 0
            side = rng.normal(size=n).astype(kind)
            found = side.copy()
            solve(linear, lib.pointer(found))
            there = csc_array((values, matrix.indices, matrix.indptr), shape=(n, n)) @ found
            assert np.abs(there - side).max() < 1e-13 * np.abs(values).max() * n
    finally:
        free(linear)


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


def replayed(matrix, *, machine=True):
    """A solver that has seen enough matrices near this one to have an order of its own."""
    lib.core.sd_code_allow(2 * machine)
    solver = Solver(matrix)
    lib.core.sd_linear_replayed(solver.linear)
    rng = np.random.default_rng(1)
    scale = np.ones(matrix.shape[0])
    for _ in range(3 + matrix.shape[0]):
        assert solver.factor(matrix.data * rng.uniform(0.9, 1.1, matrix.data.size), scale) == 0
    lib.core.sd_code_allow(1)
    return solver


@pytest.mark.parametrize("n", [1, 6, 16, 40, 100])
@pytest.mark.parametrize("machine", [True, False])
def test_a_replayed_elimination_is_as_exact_as_pivoting(n, machine):
    """Backward error of the solution beside that of LAPACK on the same matrices: within the growth that is allowed."""
    matrix = random_matrix(n, n, min(1.0, 3.0 / n))
    solver = replayed(matrix, machine=machine)
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


def test_machine_code_and_interpreter_agree_to_the_bit():
    matrix = random_matrix(40, 3, 0.1)
    one, other = replayed(matrix), replayed(matrix, machine=False)
    b = np.random.default_rng(4).normal(size=40)
    for solver in (one, other):
        assert solver.factor(matrix.data) == 0
        assert solver.linear.contents.replayed
    assert (one.solve(b) == other.solve(b)).all()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of forks beside threads
@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes do not fork here")
def test_a_process_that_forks_and_the_other_write_no_code_on_shared_pages():
    """What a matrix that is no more left behind is there in both: each writes its next code on pages of its own."""
    b = np.random.default_rng(4).normal(size=6)
    matrices = [random_matrix(6, seed, 0.3) for seed in range(4)]
    kept, gone = replayed(matrices[0]), replayed(matrices[1])
    del gone
    kept.factor(matrices[0].data)
    before = kept.solve(b)
    begin, told = os.pipe()
    child = os.fork()
    mine = matrices[2 if child else 3]
    if not child:
        os.read(begin, 1)
    other = replayed(mine)
    other.factor(mine.data)
    first = other.solve(b)
    kept.factor(matrices[0].data)
    fine = np.allclose(mine @ first, b) and (kept.solve(b) == before).all()
    if not child:
        os._exit(0 if fine else 1)
    os.write(told, b"x")
    assert os.waitpid(child, 0)[1] == 0
    assert fine
    other.factor(mine.data)
    assert (other.solve(b) == first).all()


def complex_solutions(matrix, b, *, machine):
    """Solutions beside a complex matrix and others near it, each with its own values, as a run makes them."""
    lib.core.sd_code_allow(2 * machine)
    pattern = [np.ascontiguousarray(item, np.int32) for item in (matrix.indptr, matrix.indices)]
    linear = lib.core.sd_linear_z_new(b.size, *map(lib.pointer, pattern), None)
    lib.core.sd_linear_z_replayed(linear)
    rng = np.random.default_rng(1)
    solutions = []
    for _ in range(5 + 2 * b.size):
        values = matrix.data * (rng.uniform(0.9, 1.1, matrix.data.size) + 0.1j * rng.normal(size=matrix.data.size))
        assert lib.core.sd_linear_z_factor(linear, lib.pointer(values), lib.pointer(np.ones(b.size))) == 0
        x = b.copy()
        lib.core.sd_linear_z_solve(linear, lib.pointer(x))
        full = csc_array((values, matrix.indices, matrix.indptr), shape=matrix.shape).toarray()
        size = np.abs(full).sum(axis=1).max()
        assert np.abs(full @ x - b).max() <= 1e-10 * (size * np.abs(x).max() + np.abs(b).max())
        solutions.append(x)
    lib.core.sd_code_allow(1)
    lib.core.sd_linear_z_free(linear)
    return np.array(solutions)


@pytest.mark.parametrize("n", [1, 3, 20, 60])
def test_machine_code_of_complex_numbers_agrees_to_the_bit(n):
    matrix = random_matrix(n, 5, min(1.0, 3.0 / n))
    rng = np.random.default_rng(4)
    b = rng.normal(size=n) + 1j * rng.normal(size=n)
    one, other = (complex_solutions(matrix, b, machine=machine) for machine in (True, False))
    assert one.tobytes() == other.tobytes()


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


@pytest.mark.parametrize("faint", [False, True])
def test_rows_of_a_net_that_pivot_in_columns_of_their_own(faint):
    """A grid whose rows are shuffled: pairs are found and fill a third; where they are faint, any row pivots."""
    m, rng = 60, np.random.default_rng(5)
    line = diags_array([-1.0, 2.1, -1.0], offsets=[-1, 0, 1], shape=(m, m))
    grid = csc_array(kron(eye_array(m), line) + kron(line, eye_array(m)))
    rows = rng.permutation(m * m)
    matrix = csc_array(grid[rows])
    matrix.sort_indices()
    pattern = Pattern(m * m, m * m, matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32))
    own = np.argsort(rows).astype(np.int32)
    given = np.where(rng.random(m * m) < 0.9, own, -1)
    order = with_pairs(pattern, any_order(pattern), lambda: given)
    assert order.paired
    assert order.filled < 0.4 * order.most
    values = matrix.data.copy()
    if faint:  # pairs would fill all the same
        values[matrix.indices == np.repeat(order.own, np.diff(matrix.indptr))] *= 1e-9
        order = Order(order.columns, order.filled, True, order.own, order.otherwise, 2 * order.filled)
    linear = order.linear(pattern)
    try:
        for _ in range(2):
            assert lib.core.sd_linear_factor(linear, lib.pointer(values), None) == 0
            side = rng.normal(size=m * m)
            found = side.copy()
            lib.core.sd_linear_solve(linear, lib.pointer(found))
            there = csc_array((values, matrix.indices, matrix.indptr), shape=matrix.shape) @ found
            assert np.abs(there - side).max() < 1e-12 * np.abs(found).max()
        assert bool(linear.contents.otherwise) != faint
    finally:
        lib.core.sd_linear_free(linear)


def test_a_factorisation_leaves_small_numbers_to_others():
    """Subnormal numbers are zeros within it alone."""
    n = 300
    matrix = csc_array(np.eye(n) + 1e-200 * np.eye(n, k=1) + 1e-200 * np.eye(n, k=-1))
    solver = Solver(matrix, sparse=True)
    for _ in range(2):
        assert lib.core.sd_linear_factor(solver.linear, lib.pointer(matrix.data), None) == 0
        assert np.full(2, 1e-310)[0] * 0.5 > 0.0


def lines(steps, seed):
    """Lines of 90 to 150 unknowns of which each waits for the one `step` before.

    Behind them, joined to the ends of each, stands a dense block.
    """
    rng = np.random.default_rng(seed)
    blocks, ends, first = [], [], 0
    for step in steps:
        n = step * int(rng.integers(90 // step, 150 // step))
        off = [rng.uniform(-1.0, -0.5, n - step) for _ in range(2)]
        blocks.append(diags_array([*off, rng.uniform(2.5, 4.0, n)], offsets=[step, -step, 0]).toarray())
        ends += list(range(first + n - step, first + n))
        first += n
    full = np.zeros((first + 5, first + 5))
    at = 0
    for block in blocks:
        full[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    full[first:, first:] = rng.normal(size=(5, 5)) + 20.0 * np.eye(5)
    full[first:, ends] = rng.normal(size=(5, len(ends)))
    full[np.ix_(ends, range(first, first + 5))] = rng.normal(size=(len(ends), 5))
    return csc_array(full)


@pytest.mark.parametrize("steps", [(1,), (2,), (3,), (7,), (1, 2), (2, 1), (3, 1, 2), (1, 40), (2, 2, 5)])
@pytest.mark.parametrize("seed", range(3))
def test_chains_are_solved_and_refactorised_as_any_matrix(steps, seed):
    matrix = lines(steps, seed)
    solver = Solver(matrix, sparse=True)
    rng = np.random.default_rng(seed)
    n = matrix.shape[0]
    for scale in (None, 10.0 ** rng.uniform(-6, 6, n)):
        for _ in range(3):
            values = matrix.data * rng.uniform(0.8, 1.2, matrix.data.size)
            if scale is not None:  # in units of its unknowns
                values = values / np.repeat(scale, np.diff(matrix.indptr))
            assert solver.factor(values, scale) == 0
            full = csc_array((values, matrix.indices, matrix.indptr), shape=(n, n)).toarray()
            x = rng.normal(size=n) * (1.0 if scale is None else scale)
            error = (solver.solve(full @ x) - x) / (1.0 if scale is None else scale)
            assert np.abs(error).max() < 1e-12
    assert solver.linear.contents.pivotings == 1


@pytest.mark.parametrize("faint", [1e-2, 1e-4])
def test_rows_of_a_long_line_pivot_in_their_own_columns(faint):
    """Of inductances and capacitances that a step passes over: two entries a column, where other pivots left three.
    Factors that have let go of their numbers are made anew to the bit.
    """
    n = 120_000
    rng = np.random.default_rng(0)
    aside = rng.uniform(0.5, 1.0, n - 1)
    matrix = csc_array(diags_array([-aside, faint * rng.uniform(1.0, 2.0, n), aside], offsets=[-1, 0, 1]))
    matrix.sort_indices()
    pattern = Pattern(n, n, matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32))
    columns = paired_order(pattern)
    order = Order(columns, paired=True, otherwise=columns, most=2 * n)
    linear = order.linear(pattern)
    b, found = rng.normal(size=n), []
    for _ in range(3):
        assert lib.core.sd_linear_factor(linear, lib.pointer(matrix.data), None) == 0
        assert linear.contents.otherwise  # the order for any pivots was not asked
        x = b.copy()
        lib.core.sd_linear_solve(linear, lib.pointer(x))
        assert np.abs(matrix @ x - b).max() < 1e-15 / faint * np.abs(x).max()
        found.append(x)
        lib.core.sd_linear_rest(linear)
    assert linear.contents.pivotings == 1
    assert (found[1] == found[2]).all()
    lib.core.sd_linear_free(linear)


@pytest.mark.parametrize("waits", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_the_fill_of_a_column_order_is_that_of_rows_merged_by_hand(seed, waits):
    """Also behind the column whose merged row holds all that are left: the rest stands in one row.  What waits for
    others comes behind them.
    """
    rng = np.random.default_rng(seed)
    m, n = 14 + seed, 12 + seed
    there = rng.random((m, n)) < 0.08 + 0.03 * (seed % 4)
    there[np.arange(n), np.arange(n)] = True
    pattern = csc_array(there.astype(float))
    pattern.sort_indices()
    order, filled = np.zeros(n, dtype=np.int32), np.zeros(1, dtype=np.int64)
    later = np.flatnonzero(rng.random(n) < 0.4) if waits else np.zeros(0, dtype=int)
    waiting = [(c, j) for c in range(n) for j in later if c not in later and rng.random() < 0.3]
    starts = np.searchsorted([c for c, _ in waiting], np.arange(n + 1)).astype(np.int32)
    ahead = (starts, np.array([j for _, j in waiting], dtype=np.int32)) if waits else (None, None)
    places = (np.ascontiguousarray(a, dtype=np.int32) for a in (pattern.indptr, pattern.indices))
    arrays = [lib.pointer(a) for a in (*places, *ahead, order, filled)]
    assert lib.core.sd_column_order(m, n, *arrays) == 0
    assert sorted(order) == list(range(n))
    assert all(list(order).index(c) < list(order).index(j) for c, j in waiting)
    rows, wanted = [set(np.flatnonzero(row)) for row in there], 0
    for c in order:
        merged = set().union(*(r for r in rows if c in r)) - {c}
        rows = [r for r in rows if c not in r] + [merged]
        wanted += len(merged)
    assert filled[0] == wanted
