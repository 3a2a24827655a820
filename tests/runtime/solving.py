"""The core's linear solver by the hand of a test, and random matrices."""

import numpy as np
from scipy.sparse import csc_array, diags_array, random_array
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.numerics.ordering import (
    column_order,
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
