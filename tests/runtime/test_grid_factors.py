"""Factors (runtime/core/linear/sparse) of grids, which fill: solutions by their residuals."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron, random_array
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.numerics.ordering import symmetric_order

ROUND_OFF = 1e-14


def grid(side, kind=float, seed=0):
    """Nodes of a square net, each with its neighbours; three of four neighbours are seen from both sides."""
    line = diags_array([np.ones(side - 1), np.ones(side - 1)], offsets=[-1, 1], shape=(side, side))
    matrix = csc_array(kron(line, eye_array(side)) + kron(eye_array(side), line))
    rng = np.random.default_rng(seed)
    kept = rng.random(matrix.nnz) > 0.15
    matrix.data = np.where(kept, -rng.uniform(0.2, 1.0, matrix.nnz), 0.0)
    matrix.eliminate_zeros()
    matrix = csc_array(matrix + diags_array(rng.uniform(2.0, 5.0, side * side))).astype(kind)
    if kind is complex:
        matrix.data = matrix.data * np.exp(0.3j * rng.normal(size=matrix.nnz))
    matrix.sort_indices()
    return matrix


class Factors:
    """Of matrices of one pattern, every row in its own column."""

    def __init__(self, matrix):
        n = matrix.shape[0]
        self.pattern = Pattern(n, n, matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32))
        self.order = symmetric_order(self.pattern)
        self.indices, self.indptr, self.kind = matrix.indices, matrix.indptr, matrix.dtype
        letter = "z_" if np.issubdtype(self.kind, complex) else ""
        self.linear = (self.order.complex_linear if letter else self.order.linear)(self.pattern)
        self.factor, self.solve, self.free = (
            getattr(lib.core, f"sd_linear_{letter}{name}") for name in ("factor", "solve", "free")
        )

    def __del__(self):
        self.free(self.linear)

    def residual(self, values, seed=0):
        """Largest residual of a solution, over the sizes of row, solution and right side."""
        n = self.indptr.size - 1
        values = np.ascontiguousarray(values)
        assert self.factor(self.linear, lib.pointer(values), lib.pointer(np.ones(n))) == 0
        side = np.random.default_rng(seed).normal(size=n).astype(self.kind)
        found = side.copy()
        self.solve(self.linear, lib.pointer(found))
        matrix = csc_array((values, self.indices, self.indptr), shape=(n, n))
        return np.abs(matrix @ found - side).max() / (np.abs(matrix) @ np.abs(found) + np.abs(side)).max()


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("side", [6, 11, 20, 47])
def test_grids_are_solved_to_round_off(side, kind):
    matrix = grid(side, kind)
    factors = Factors(matrix)
    rng = np.random.default_rng(1)
    for change in (0.0, 0.3, 3.0):  # the last ones pivot in another order than the first would
        assert factors.residual(matrix.data * (1.0 + change * rng.random(matrix.nnz))) < ROUND_OFF


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("first", [True, False])
def test_a_row_without_a_pivot_of_its_own_gets_another(kind, first):
    matrix = grid(24, kind)
    factors = Factors(matrix)
    faint = matrix.copy()
    faint.setdiag(np.where(np.arange(576) % 5 == 0, 1e-13, faint.diagonal()))
    for values in (faint, matrix, faint) if first else (matrix, faint, matrix):
        assert factors.residual(values.data) < ROUND_OFF


def test_a_singular_matrix_says_so():
    matrix = grid(20)
    values = matrix.copy()
    values.data[values.indices == 137] = 0.0
    factors = Factors(matrix)
    assert factors.factor(factors.linear, lib.pointer(values.data), None) == 1
    assert factors.residual(matrix.data) < ROUND_OFF


def test_numbers_that_are_none_say_so():
    matrix = grid(20)
    factors = Factors(matrix)
    assert factors.residual(matrix.data) < ROUND_OFF
    values = matrix.data.copy()
    values[77] = np.nan
    assert factors.factor(factors.linear, lib.pointer(values), None) != 0
    assert factors.residual(matrix.data) < ROUND_OFF


def test_a_net_at_random_is_solved():
    rng = np.random.default_rng(5)
    net = csc_array(random_array((800, 800), density=0.004, rng=rng))
    matrix = csc_array(net + net.T + diags_array(10.0 + rng.random(800)))
    matrix.sort_indices()
    assert Factors(matrix).residual(matrix.data) < ROUND_OFF


@pytest.mark.parametrize("part", [0.2, 0.03, 0.002, 1e-5])
def test_pivots_that_fade_cost_no_digits(part):
    """Multipliers of 1/part would grow: other pivots are chosen then."""
    matrix = grid(24)
    factors = Factors(matrix)
    assert factors.residual(matrix.data) < ROUND_OFF
    weak = matrix.copy()
    rng = np.random.default_rng(2)
    weak.setdiag(weak.diagonal() * np.where(rng.random(576) < 0.5, part, 1.0))
    assert factors.residual(weak.data) < 10.0 * ROUND_OFF
