"""Sparse factors: columns that fill alike, dense rests, lines, column orders."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron
from scipy.sparse.linalg import splu
from solving import Solver, expander
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.numerics.ordering import (
    Order,
    any_order,
    least_degree,
    paired_order,
    with_pairs,
)


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
