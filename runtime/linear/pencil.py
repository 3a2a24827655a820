"""The reduction of a pencil of any index whose matrices do not move: E dy' = A dy + B du.

Wong sequences: V, the largest subspace with A V in E V, holds the motions, W, the largest nilpotent one, what follows
from inputs alone.  With S = [E V, A W]^-1 the pencil falls apart (Berger, Ilchmann and Trenn 2012),

    S E [V W] = diag(I, N),  S A [V W] = diag(M, I),  S B = [B1; B2]:
    x1' = M x1 + B1 u,   x2 = -B2 u - N B2 u' - N^2 B2 u'' - ...
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.linear.tangent import NoLinearisation, Reduced
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import TOLERANCE, count, decomposed, null_space

CLOCKS = (0, 3, 6, 9, 12, -3, -6)
"""Powers of ten of the units of time that are tried, 1/s."""
Choice = NDArray[np.int64]


class _Ranks:
    """Decides ranks, and remembers the narrowest gap (in powers of ten) between what counts and what does not."""

    def __init__(self) -> None:
        self.gap = 16.0

    def of(self, sigma: Floats) -> int:
        """How many singular values of a matrix of size one are not zero."""
        rank = int((sigma > TOLERANCE).sum())
        above = sigma[rank - 1] if rank else 1.0
        below = max(float(sigma[rank]) if rank < sigma.size else 0.0, 1e-16)
        self.gap = min(self.gap, float(np.log10(above / below)))
        return rank


def _image(matrix: Floats, ranks: _Ranks) -> Floats:
    """Orthonormal columns that span the columns of a matrix."""
    if not matrix.size:
        return np.zeros((matrix.shape[0], 0))
    u, sigma, _ = decomposed(matrix)
    return u[:, : ranks.of(sigma)]


def _preimage(matrix: Floats, image: Floats, ranks: _Ranks) -> Floats:
    """Orthonormal columns that span what a matrix maps into the span of orthonormal columns."""
    outside = matrix - image @ (image.T @ matrix)
    _, sigma, vt = decomposed(outside)
    return np.asarray(vt[ranks.of(sigma) :].T)


def _sequence(into: Floats, by: Floats, space: Floats, ranks: _Ranks) -> Floats:
    """The limit of space := into^-1(by space)."""
    for _ in range(into.shape[0] + 1):
        following = _preimage(into, _image(by @ space, ranks), ranks)
        if following.shape[1] == space.shape[1]:
            return following
        space = following
    return space


def motions(e: Floats, a: Floats) -> tuple[Floats, Floats, Floats]:
    """V [n, states], W [n, rest] and the factors of the unknowns [n] of a regular pencil, in scaled unknowns.

    In the unit of time in which ranks are plainest: where a second is 1e9 time constants, potentials that differ by the
    effort of a microhenry would pass for equal.
    """
    found = [part for power in CLOCKS if (part := _motions(10.0**power * e, a)) is not None]
    if not found:
        raise NoLinearisation("the equations do not determine every unknown")
    return max(found, key=lambda part: part[0])[1]


def _motions(e: Floats, a: Floats) -> tuple[float, tuple[Floats, Floats, Floats]] | None:
    """The narrowest gap of the ranks, and the spaces; None where they do not fill the whole."""
    row, column = factors(e, a)
    e, a = (row[:, None] * part * column for part in (e, a))
    size = max(float(np.linalg.norm(e, 2)), 1e-300), max(float(np.linalg.norm(a, 2)), 1e-300)
    e, a, ranks = e / size[0], a / size[1], _Ranks()
    v = _sequence(a, e, np.eye(e.shape[0]), ranks)
    w = _sequence(e, a, null_space(e) if e.any() else np.eye(e.shape[0]), ranks)
    if v.shape[1] + w.shape[1] != e.shape[0] or not _regular(np.hstack([e @ v, a @ w])):
        return None
    return ranks.gap, (v, w, column)


def _regular(matrix: Floats) -> bool:
    sigma = decomposed(matrix)[1]
    return count(sigma) == sigma.size


def parted(
    matrices: tuple[Floats, ...], chosen: Choice, spaces: tuple[Floats, Floats, Floats], names: tuple[str, ...]
) -> Reduced:
    """The reduction; matrices: E, A, B, C, Cd, D of dv = C dy + Cd dy' + D du; chosen: states among the unknowns;
    spaces: of `motions`; names: of the chosen.
    """
    e, a, b, c, cd, d = matrices
    v, w, column = spaces
    v, w = column[:, None] * v, column[:, None] * w
    row, _ = factors(np.hstack([e @ v, a @ w]))
    s = np.linalg.inv(row[:, None] * np.hstack([e @ v, a @ w])) * row
    k = v.shape[1]
    m, n = (s @ a @ v)[:k], (s @ e @ w)[k:]
    b1, b2 = (s @ b)[:k], (s @ b)[k:]
    turn = v[chosen]
    back = np.linalg.inv(turn)
    # x2 = follow[0] u + follow[1] u' + follow[2] u'';  x' = v x1' + w x2'
    follow = [-b2, -n @ b2, -n @ n @ b2]
    c1, c2, c2d = c @ v + cd @ v @ m, c @ w, cd @ w
    d0 = d + c2 @ follow[0] + cd @ v @ b1
    d1 = c2 @ follow[1] + c2d @ follow[0]
    d2 = c2 @ follow[2] + c2d @ follow[1]
    small = (_clean(part) for part in (turn @ m @ back, turn @ b1, c1 @ back, d0, d1, d2))
    return Reduced(next(small), next(small), next(small), next(small), next(small), next(small), chosen, names)


def _clean(matrix: Floats) -> Floats:
    """Without round-off beside the largest entry of its column."""
    return np.where(np.abs(matrix) > 1e-13 * np.abs(matrix).max(axis=0, initial=0.0), matrix, 0.0)
