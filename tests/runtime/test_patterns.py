import numpy as np
import pytest
from sysdyn.runtime.model.description import _kernel
from sysdyn.runtime.model.failures import ContractError
from sysdyn.runtime.model.patterns import number_pairs, places, spared_loops

# x[i] in rows i, columns j; loops i = 1..n, j = 1..i (ix = 1, n)
LOOPS = [[0, 1], [0, [0, -1, 0]]]


def kernel(loops=LOOPS, outer=0, inner=1):
    entry = [[0, [[outer, -1, 0]]], [0, [[inner, -1, 0]]]]
    return _kernel({"loops": loops, "rows": [entry[0]], "dy": [entry]})


@pytest.mark.parametrize("n", [0, 1, 2, 7])
def test_bounds_that_follow_an_outer_loop(n):
    ix, shapes = np.array([1, n], dtype=np.int32), [((1, n),)]
    tables = np.zeros(1, dtype=np.int32), np.array([10], dtype=np.int32)
    found = places([kernel()], "dy", ix, (shapes, shapes), tables)
    expected = [(i - 1, 10 + j - 1) for i in range(1, n + 1) for j in range(1, i + 1)]
    assert list(zip(found.row.tolist(), found.column.tolist(), strict=True)) == expected


def test_an_empty_inner_loop_and_an_offset_bound():
    # j = i + 1 .. n: the last i has none
    ix, shapes = np.array([1, 3], dtype=np.int32), [((1, 3),)]
    loops = [[0, 1], [[0, -1, 1], 1]]
    tables = np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int32)
    found = places([kernel(loops)], "dy", ix, (shapes, shapes), tables)
    assert list(zip(found.row.tolist(), found.column.tolist(), strict=True)) == [(0, 1), (0, 2), (1, 2)]


def test_a_loop_is_spared_where_nobody_reads_a_row_of_it():
    """Of loops over rows 0..2, over 2..4 of the same family, and what no loop goes round."""
    ix, shapes, to = np.array([1, 3, 5], dtype=np.int32), [((1, 5),)], np.zeros(1, dtype=np.int32)
    kernels = [kernel([[0, 1]], inner=0), kernel([[1, 2]], inner=0), _kernel({"rows": [[0, [[-1, 0, 0]]]]})]
    for read, expected in (([0], [0, 1, 0]), ([2], [0, 0, 0]), ([4], [1, 0, 0]), ([], [1, 1, 0])):
        rows = np.isin(np.arange(5), read)
        assert spared_loops(kernels, rows, ix, shapes, to).tolist() == expected


def test_a_bound_follows_outer_loops_only():
    with pytest.raises(ContractError, match="bound"):
        kernel([[0, [1, -1, 0]], [0, 1]])


@pytest.mark.parametrize(("size", "firsts", "seconds"), [(0, 1, 1), (1, 5, 5), (99, 1, 7), (500, 40, 3), (999, 90, 90)])
def test_pairs_are_numbered_in_their_order(size, firsts, seconds):
    random = np.random.default_rng(size)
    first, second = random.integers(0, firsts, size), random.integers(0, seconds, size)
    keys, wanted = np.unique(first * seconds + second, return_inverse=True)
    found, begin, each = number_pairs(first, second, firsts, seconds)
    assert np.array_equal(found, wanted.ravel())
    assert np.array_equal(each, keys % seconds)
    assert np.array_equal(np.repeat(np.arange(firsts), np.diff(begin)), keys // seconds)
