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

Choice = NDArray[np.int64]


def _image(matrix: Floats) -> Floats:
    """Orthonormal columns that span the columns of a matrix."""
    if not matrix.size:
        return np.zeros((matrix.shape[0], 0))
    u, sigma, _ = decomposed(matrix)
    rank = int((sigma > TOLERANCE).sum())
    return u[:, :rank]


def _preimage(matrix: Floats, image: Floats) -> Floats:
    """Orthonormal columns that span what a matrix maps into the span of orthonormal columns."""
    outside = matrix - image @ (image.T @ matrix)
    _, sigma, vt = decomposed(outside)
    return np.asarray(vt[int((sigma > TOLERANCE).sum()) :].T)


def _sequence(into: Floats, by: Floats, space: Floats) -> Floats:
    """The limit of space := into^-1(by space)."""
    for _ in range(into.shape[0] + 1):
        following = _preimage(into, _image(by @ space))
        if following.shape[1] == space.shape[1]:
            return following
        space = following
    return space


def motions(e: Floats, a: Floats) -> tuple[Floats, Floats, Floats]:
    """V [n, states], W [n, rest] and the factors of the unknowns [n] of a regular pencil, in scaled unknowns."""
    row, column = factors(e, a)
    e, a = (row[:, None] * part * column for part in (e, a))
    size = max(float(np.linalg.norm(e, 2)), 1e-300), max(float(np.linalg.norm(a, 2)), 1e-300)
    e, a = e / size[0], a / size[1]
    v = _sequence(a, e, np.eye(e.shape[0]))
    w = _sequence(e, a, null_space(e) if e.any() else np.eye(e.shape[0]))
    if v.shape[1] + w.shape[1] != e.shape[0] or not _regular(np.hstack([e @ v, a @ w])):
        raise NoLinearisation("the equations do not determine every unknown")
    return v, w, column


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
