"""One decision of rank: which singular values of an equilibrated matrix count as zero.

A Jacobian of a model in SI units mixes nano-farads and mega-pascals.  Scaled so that the largest entry of every row
and column is near one (`equilibrate`), what is left of an exact zero is round-off of the entries' own computation and
of the factorisation: 1e-16, times the dimension, times the growth where entries are differences.  TOLERANCE stands well
above that, and below the conditioning of a model that a double can be trusted with.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.patterns import read_only
from sysdyn.runtime.numerics.equilibrate import SMALL

TOLERANCE = tuning.SAME
"""Singular values below this part of the largest count as zero."""
CERTAIN = tuning.CANCELS
"""The same where a model is refused for it: what is above may be a true, if bad, conditioning."""

REMEMBERED, DECOMPOSITIONS = 120, 256
"""Rows and columns of a matrix whose decomposition is kept, and of how many: 90 MB at most, 15 of fifty unknowns."""
DOUBT = 10.0
"""Times that an estimate of a condition, which in sums is n times that of singular values at most, may be too small;
counter-examples are made by hand (Higham, SIAM Rev. 29, 1987)."""


class NotFiniteError(ArithmeticError):
    """A matrix holds what is no number: nothing can be said of its rank."""


def singular_decomposition(matrix: Floats) -> tuple[Floats, Floats, Floats]:
    """U [m, m], singular values [min(m, n)] (falling), v^T [n, n] of a matrix [m, n]; read-only.  NotFiniteError."""
    if not np.isfinite(matrix).all():
        raise NotFiniteError
    # large matrices are not remembered
    if max(matrix.shape) > REMEMBERED:
        return _decompose(matrix)
    return _recall(np.ascontiguousarray(matrix, dtype=np.float64).tobytes(), *matrix.shape)


@functools.lru_cache(maxsize=DECOMPOSITIONS)
def _recall(data: bytes, m: int, n: int) -> tuple[Floats, Floats, Floats]:
    """The decomposition of a matrix by its numbers: those of a linear network come again with every set of its
    switches.
    """
    u, sigma, vt = _decompose(np.frombuffer(data).reshape(m, n))
    return read_only(u), read_only(sigma), read_only(vt)


def _decompose(matrix: Floats) -> tuple[Floats, Floats, Floats]:
    try:
        u, sigma, vt = np.linalg.svd(matrix)
    except np.linalg.LinAlgError:  # LAPACK's fast algorithm gives up on a few finite matrices
        from scipy.linalg import svd

        u, sigma, vt = svd(matrix, lapack_driver="gesvd")
    return u, sigma, vt


def singular_values(matrix: Floats) -> Floats:
    """Those of a matrix [m, n], falling [min(m, n)]: half of the work where nothing else is asked.  NotFiniteError."""
    # no numbers: no rank
    if not np.isfinite(matrix).all():
        raise NotFiniteError
    try:
        return np.asarray(np.linalg.svd(matrix, compute_uv=False))
    except np.linalg.LinAlgError:
        return singular_decomposition(matrix)[1]


def sure_complement(matrix: Floats, smallest: float) -> Floats | None:
    """Orthonormal columns [n, n - m] that a matrix [m, n] maps to zero, where its rows are independent beyond doubt: no
    singular value below `smallest` of the largest.  None where singular values have to tell.
    """
    from scipy.linalg import qr
    from scipy.linalg.lapack import dtrcon

    m, n = matrix.shape
    # more rows than columns depend in any case
    if not 0 < m <= n or not np.isfinite(matrix).all():
        return None
    q, r = qr(matrix.T, check_finite=False)
    return np.asarray(q[:, m:]) if dtrcon(r[:m])[0] > DOUBT * m * smallest else None


def sure_solver(matrix: Floats, smallest: float) -> Callable[[Floats], Floats] | None:
    """What solves by a matrix [n, n] that is regular beyond doubt, in this sense."""
    # LU with an estimate of its condition
    from scipy.linalg.lapack import dgecon, dgetrf, dgetrs

    n = matrix.shape[0]
    lu, pivots, failed = dgetrf(matrix)
    # singular, or too near to it to be sure
    if failed or not dgecon(lu, np.linalg.norm(matrix, 1))[0] > DOUBT * n * smallest:
        return None
    return lambda aim: np.asarray(dgetrs(lu, pivots, aim)[0])


def count(sigma: Floats, smallest: float = TOLERANCE) -> int:
    """How many singular values [k] are not zero: above `smallest` of the largest."""
    return int((sigma > smallest * sigma.max(initial=0.0)).sum())


def rank(matrix: Floats) -> int:
    """Rank of an equilibrated matrix.  NotFiniteError."""
    if not matrix.size:
        return 0
    # large: by singular values; small ones in the core
    if max(matrix.shape) > SMALL:
        return count(singular_values(matrix))
    matrix = np.ascontiguousarray(matrix, dtype=np.float64)
    found = int(lib.core.sd_rank(*matrix.shape, lib.pointer(matrix), TOLERANCE))
    # the core has met an entry that is no number
    if found < 0:
        raise NotFiniteError
    return found


def null_space(matrix: Floats) -> Floats:
    """Orthonormal columns [n, n - rank] that an equilibrated matrix [m, n] maps to zero.  NotFiniteError."""
    _, sigma, vt = singular_decomposition(matrix)
    return np.asarray(vt[count(sigma) :].T)


def left_null_vectors(blocks: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Of equilibrated matrices [k, m, n], finite ones: the number of each one's matrix and orthonormal rows [found, m]
    that it maps to zero from the left.
    """
    u, sigma, _ = np.linalg.svd(blocks)
    # rows of U behind the rank, and those beyond all singular values
    rest = np.ones((len(blocks), blocks.shape[1]), dtype=bool)
    rest[:, : sigma.shape[1]] = sigma <= TOLERANCE * sigma.max(axis=1, keepdims=True)
    matrix, place = np.nonzero(rest)
    return matrix, u[matrix, :, place]


def least_squares(matrix: Floats, aim: Floats, smallest: float = TOLERANCE) -> Floats:
    """The x [n] of least norm with the least |A x - aim|; singular values below `smallest` of the largest are zero.

    NotFiniteError.
    """
    if not (np.isfinite(matrix).all() and np.isfinite(aim).all()):
        raise NotFiniteError
    try:
        return np.asarray(np.linalg.lstsq(matrix, aim, rcond=smallest)[0], dtype=np.float64)
    # LAPACK's fast algorithm gives up on a few finite matrices
    except np.linalg.LinAlgError:
        return least_by(singular_decomposition(matrix), aim, smallest)


def least_by(parts: tuple[Floats, Floats, Floats], aim: Floats, smallest: float = TOLERANCE) -> Floats:
    """The least-squares solution by a decomposition, as `singular_decomposition` answers it."""
    u, sigma, vt = parts
    k = count(sigma, smallest)
    return np.asarray(vt[:k].T @ ((u[:, :k].T @ aim) / sigma[:k]))
