"""Our factors beside those of libraries: python tests/bench/factors.py [--sides N ...] [--loads R ...]

Grids of N x N nodes, 1 + R * Laplacian with conductances drawn at random: what an implicit step solves where R is the
length of the step over the time constant of a node.  CPU ms of factors on a pattern that is known (KLU: refactored;
UMFPACK: numbers anew; SuperLU has no such call) and of one solution, the least of several; largest residual of each.
Iterations to a residual of 1e-8: conjugate gradients behind the diagonal, and BiCGSTAB, as for a matrix without
symmetry, behind SuperLU's incomplete factors; products of matrix and vector are SciPy's.  KLU and UMFPACK are Debian's
libsuitesparse-dev; what is missing is left out.
"""

from __future__ import annotations

import argparse
import ctypes as c
import ctypes.util
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse.linalg import LinearOperator, bicgstab, cg, spilu, splu
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.numerics.ordering import symmetric_order

Floats = NDArray[np.float64]
LASTS, MOST = 0.3, 40
"""Seconds and repetitions of one measurement, whichever is over first; at least two."""
CLOSE = 1e-8
"""Residual, over that of the right side, at which iterations end: no step of Newton asks for more."""
MANY = 3000
"""Iterations."""
FILLS, DROPS = 4.0, 1e-2
"""Of incomplete factors."""


def grid(side: int, load: float) -> csc_array:
    """1 + load * Laplacian of a grid, its conductances between 0.5 and 1.5."""
    rng = np.random.default_rng(side)
    node = np.arange(side * side).reshape(side, side)
    ends = np.hstack([[node[:, :-1].ravel(), node[:, 1:].ravel()], [node[:-1].ravel(), node[1:].ravel()]])
    value = load * rng.uniform(0.5, 1.5, ends.shape[1])
    off = csc_array((-value, tuple(ends)), shape=(side * side,) * 2)
    off = csc_array(off + off.T)
    whole = csc_array(off + diags_array(-np.asarray(off.sum(axis=0)).ravel()) + eye_array(side * side))
    whole.sort_indices()
    return whole


@dataclass(frozen=True)
class Raced:
    """One way to solve: CPU ms of its factors and of a solution, and the largest residual over the right side's."""

    name: str
    factor: float
    solution: float
    residual: float
    said: str = ""


def least(work: Callable[[], Any]) -> float:
    """CPU ms, the least of several."""
    found, end = [], time.monotonic() + LASTS
    while len(found) < 2 or (time.monotonic() < end and len(found) < MOST):
        began = time.process_time()
        work()
        found.append(1e3 * (time.process_time() - began))
    return min(found)


def raced(
    name: str,
    matrix: csc_array,
    side: Floats,
    factor: Callable[[], Any],
    solution: Callable[[], Floats],
    said: str = "",
) -> Raced:
    """Both measured."""
    factors, x = least(factor), solution()
    off = float(np.abs(matrix @ x - side).max() / np.abs(side).max())
    return Raced(name, factors, least(solution), off, said)


def ours(matrix: csc_array, side: Floats) -> Raced:
    """The core's, on the order that a run takes."""
    n = side.size
    pattern = Pattern(n, n, matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32))
    order = symmetric_order(pattern)  # kept as long as what is made by it
    linear = order.linear(pattern)
    values, scale, x = np.ascontiguousarray(matrix.data), np.ones(n), side.copy()

    def solution() -> Floats:
        x[:] = side
        lib.core.sd_linear_solve(linear, lib.pointer(x))
        return x

    def factor() -> None:
        assert lib.core.sd_linear_factor(linear, lib.pointer(values), lib.pointer(scale)) == 0

    try:
        return raced("sysdyn", matrix, side, factor, solution)
    finally:
        lib.core.sd_linear_free(linear)


def _library(name: str) -> Any:
    found = ctypes.util.find_library(name)
    return c.CDLL(found) if found else None


def _numbers(*arrays: NDArray[Any]) -> list[c.c_void_p]:
    return [c.c_void_p(array.ctypes.data) for array in arrays]


def of_klu(matrix: csc_array, side: Floats) -> Raced | None:
    """KLU (Davis & Palamadai Natarajan 2010), factors of a known pattern and pivots: klu_refactor."""
    klu = _library("klu")
    if klu is None:
        return None
    klu.klu_analyze.restype = klu.klu_factor.restype = c.c_void_p
    common = c.create_string_buffer(4096)
    klu.klu_defaults(common)
    start, row, values = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data.copy()
    symbolic = c.c_void_p(klu.klu_analyze(side.size, *_numbers(start, row), common))
    numeric = c.c_void_p(klu.klu_factor(*_numbers(start, row, values), symbolic, common))
    x = side.copy()

    def solution() -> Floats:
        x[:] = side
        assert klu.klu_solve(symbolic, numeric, side.size, 1, *_numbers(x), common)
        return x

    def factor() -> None:
        assert klu.klu_refactor(*_numbers(start, row, values), symbolic, numeric, common)

    found = raced("KLU", matrix, side, factor, solution)
    klu.klu_free_numeric(c.byref(numeric), common)
    klu.klu_free_symbolic(c.byref(symbolic), common)
    return found


def of_umfpack(matrix: csc_array, side: Floats) -> Raced | None:
    """UMFPACK (Davis 2004), numbers anew on a symbolic analysis."""
    library = _library("umfpack")
    if library is None:
        return None
    start, row, values = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data.copy()
    arrays, n, x = _numbers(start, row, values), side.size, np.zeros(side.size)
    symbolic, numeric = c.c_void_p(), c.c_void_p()
    assert library.umfpack_di_symbolic(n, n, *arrays, c.byref(symbolic), None, None) == 0

    def solution() -> Floats:
        assert library.umfpack_di_solve(0, *arrays, *_numbers(x, side), numeric, None, None) == 0
        return x

    def factor() -> None:
        library.umfpack_di_free_numeric(c.byref(numeric))
        assert library.umfpack_di_numeric(*arrays, symbolic, c.byref(numeric), None, None) == 0

    found = raced("UMFPACK", matrix, side, factor, solution)
    library.umfpack_di_free_numeric(c.byref(numeric))
    library.umfpack_di_free_symbolic(c.byref(symbolic))
    return found


def of_superlu(matrix: csc_array, side: Floats) -> Raced:
    """SuperLU by SciPy, in its order for a symmetric pattern; a known pattern does not help it."""
    made: list[Any] = [None]

    def factor() -> None:
        made[0] = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1, options={"SymmetricMode": True})

    return raced("SuperLU", matrix, side, factor, lambda: made[0].solve(side))


def iterated(matrix: csc_array, side: Floats) -> list[Raced]:
    """Conjugate gradients behind the diagonal, BiCGSTAB behind incomplete factors."""
    made: list[Any] = [None]

    def diagonal() -> None:
        made[0] = (1.0 / matrix.diagonal()).__mul__

    def incomplete() -> None:
        asked = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0}
        made[0] = spilu(matrix, drop_tol=DROPS, fill_factor=FILLS, **asked).solve

    found = []
    for name, method, factor in (("CG", cg, diagonal), ("BiCGSTAB", bicgstab, incomplete)):
        passes = [0]

        def solution(method: Any = method, passes: list[int] = passes) -> Floats:
            passes[0] = 0

            def count(_: Any) -> None:
                passes[0] += 1

            before = LinearOperator(matrix.shape, matvec=made[0])
            return np.asarray(method(matrix, side, rtol=CLOSE, atol=0.0, maxiter=MANY, M=before, callback=count)[0])

        one = raced(name, matrix, side, factor, solution)
        found.append(replace(one, said=f"{passes[0]} iterations"))
    return found


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sides", type=int, nargs="*", default=[20, 60, 100, 300, 400])
    parser.add_argument("--loads", type=float, nargs="*", default=[1.0, 100.0])
    asked = parser.parse_args()
    print(
        "| nodes | load | way | factors ms | solution ms | factors and 12 solutions, over ours | residual | |\n"
        + "|---" * 8
        + "|"
    )
    for side in asked.sides:
        for load in asked.loads:
            matrix = grid(side, load)
            right = np.random.default_rng(1).normal(size=side * side)
            direct = [ours(matrix, right), of_klu(matrix, right), of_umfpack(matrix, right), of_superlu(matrix, right)]
            found = [one for one in direct if one is not None] + iterated(matrix, right)
            whole = [one.factor + 12.0 * one.solution for one in found]
            for one, work in zip(found, whole, strict=True):
                ends = f"{work / whole[0]:.2f} | {one.residual:.0e} | {one.said}"
                print(
                    f"| {side} x {side} | {load:g} | {one.name} | {one.factor:.3g} | {one.solution:.3g} | {ends} |",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
