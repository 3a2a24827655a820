"""Nonlinear equations with more unknowns than rows: the solution nearest to a guess.

Gauss-Newton: with u = W (x - guess) / scale, each step takes the minimum-norm u of the linearised rows
A u = A u_k - r, by singular values (dense) or the saddle-point system [I A^T; A -eps] (sparse, SciPy, lazily),
with halving of the step while the rows grow or are not finite.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysdyn.runtime.description import Floats

Mask = NDArray[np.bool_]
DENSE = 500
"""Unknowns up to which singular values are used."""
RANK = 1e-11
"""Singular values below this part of the largest belong to redundant rows."""
_ITERATIONS = 60
_HALVINGS = 12
_ROUND_OFF = 2e-15


@dataclass(frozen=True, slots=True)
class Problem:
    """Rows `use` of residual(x) [number] in the unknowns `free` of x.

    jacobian(x): values at (rows, columns); guess, scale, weight [unknowns].
    """

    residual: Callable[[Floats], Floats]
    jacobian: Callable[[Floats], Floats]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    number: int
    use: Mask
    free: Mask
    guess: Floats
    scale: Floats
    weight: Floats


@dataclass(frozen=True, slots=True)
class Solution:
    """x, its largest scaled row and all scaled rows [number]."""

    x: Floats
    residual: float
    scaled: Floats


class _Linear:
    """The linearised rows at a point: A [used rows, free unknowns] in scaled unknowns and rows."""

    def __init__(self, problem: Problem, x: Floats) -> None:
        unit = problem.scale / problem.weight
        values = problem.jacobian(x)
        take = problem.use[problem.rows] & problem.free[problem.columns]
        rows, columns = problem.rows[take], problem.columns[take]
        values = np.where(np.isfinite(values[take]), values[take], 0.0)
        # a row is as large as its terms are, in magnitudes
        size = np.zeros(problem.number)
        np.add.at(size, rows, np.abs(values) * problem.scale[columns])
        self.row_scale = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 1.0)
        self.unit, self.problem = unit, problem
        number = np.cumsum(problem.use) - 1, np.cumsum(problem.free) - 1
        self.entries = (number[0][rows], number[1][columns], values * unit[columns] * self.row_scale[rows])
        self.shape = int(problem.use.sum()), int(problem.free.sum())

    def nearest(self, u: Floats, r: Floats) -> Floats:
        """The u of least norm with A u = A u_now - r."""
        i, j, v = self.entries
        aim = -r
        np.add.at(aim, i, v * u[j])
        if max(self.shape) <= DENSE:
            a = np.zeros(self.shape)
            np.add.at(a, (i, j), v)
            # rows of equal size: a row of small coefficients must not pass for a redundant one
            size = np.sqrt((a * a).sum(axis=1))
            size = np.where(size > 0.0, size, 1.0)
            return np.linalg.lstsq(a / size[:, None], aim / size, rcond=RANK)[0]
        return self._sparse(aim, u)

    def _sparse(self, aim: Floats, u: Floats) -> Floats:
        from scipy.sparse import csc_array, eye_array, block_array
        from scipy.sparse.linalg import splu

        i, j, v = self.entries
        size = np.zeros(self.shape[0])
        np.add.at(size, i, v * v)
        size = np.where(size > 0.0, np.sqrt(size), 1.0)
        a = csc_array((v / size[i], (i, j)), shape=self.shape)
        rows, unknowns = self.shape
        matrix = block_array([[eye_array(unknowns), a.T], [a, -1e-12 * eye_array(rows)]], format="csc")
        lu = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1)
        right = np.concatenate([np.zeros(unknowns), aim / size])
        found = lu.solve(right)
        found += lu.solve(right - matrix @ found)
        return np.asarray(found[:unknowns])


def solve(problem: Problem, x: Floats) -> Solution:
    """From x towards the solution nearest to problem.guess; the best point met."""
    x = x.copy()
    best = Solution(x, np.inf, np.full(problem.number, np.inf))
    stale = 0
    for _ in range(_ITERATIONS):
        linear = _Linear(problem, x)

        def measure(z: Floats, linear: _Linear = linear) -> tuple[float, Floats]:
            scaled = np.where(problem.use, problem.residual(z) * linear.row_scale, 0.0)
            largest = float(np.abs(scaled).max(initial=0.0))
            return (largest if np.isfinite(largest) else np.inf), scaled

        size, scaled = measure(x)
        if size < best.residual:
            stale = stale if size > 0.5 * best.residual else 0
            best = Solution(x.copy(), size, np.abs(scaled))
        stale += 1
        if size <= _ROUND_OFF or not np.isfinite(size) or stale > (4 if best.residual < 1e-12 else 15):
            break
        u = (x - problem.guess)[problem.free] / linear.unit[problem.free]
        target = linear.nearest(u, scaled[problem.use])
        if not np.isfinite(target).all():
            break
        norm = float(np.linalg.norm(scaled))
        step, tried = 1.0, x
        for _ in range(_HALVINGS):
            tried = x.copy()
            tried[problem.free] += step * (target - u) * linear.unit[problem.free]
            now = float(np.linalg.norm(measure(tried)[1]))
            if np.isfinite(now) and now <= max((1.0 - 0.1 * step) * norm, 1e-11):
                break
            step *= 0.5
        if not np.isfinite(problem.residual(tried)[problem.use]).all():
            break
        x = tried
    return best
