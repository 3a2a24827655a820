"""The reduction of a pencil of any index whose matrices do not move: E dy' = A dy + B du.

Wong sequences: V, the largest subspace with A V in E V, holds the motions, W, the largest nilpotent one, what follows
from inputs alone.  With S = [E V, A W]^-1 the pencil falls apart (Berger, Ilchmann and Trenn 2012),

    S E [V W] = diag(I, N),  S A [V W] = diag(M, I),  S B = [B1; B2]:
    x1' = M x1 + B1 u,   x2 = -B2 u - N B2 u' - N^2 B2 u'' - ...
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.linear import precise
from sysdyn.runtime.linear.tangent import NoLinearisation, Reduced, Wide, describe_lost
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import CERTAIN, TOLERANCE, count, null_space, singular_decomposition, singular_values
from sysdyn.values import dataclass

CLOCKS = (*range(0, 15, 3), *range(-3, -9, -3))
"""Powers of ten of the units of time that are tried, 1/s."""
WIDEST = 60
"""Unknowns up to which the pencil is parted in many digits."""
SHIFT = tuning.NO_EIGENVALUE
"""Of the size of rates: a point that is no eigenvalue."""
DOUBLINGS, DEEPEST = 2, 4
"""M^4 is zero on what follows from inputs: no index is higher."""
Choice = NDArray[np.int64]


class _Ranks:
    """Decides ranks, and remembers the narrowest gap (in powers of ten) between what counts and what does not."""

    def __init__(self) -> None:
        self.gap = 16.0

    def rank_of(self, sigma: Floats) -> int:
        """How many singular values of a matrix of size one are not zero."""
        # the gap between what counts as rank and what does not: narrow, and the rank is a guess
        rank = int((sigma > TOLERANCE).sum())
        above = sigma[rank - 1] if rank else 1.0
        below = max(float(sigma[rank]) if rank < sigma.size else 0.0, 1e-16)
        self.gap = min(self.gap, float(np.log10(above / below)))
        return rank


@dataclass(frozen=True, slots=True)
class Descriptor:
    """E dy' = A dy + B du; dv = C dy + Cd dy' + D du; states [unknowns]: names of y."""

    e: Floats
    a: Floats
    b: Floats
    c: Floats
    cd: Floats
    d: Floats
    states: tuple[str, ...]


def _image(matrix: Floats, ranks: _Ranks) -> Floats:
    """Orthonormal columns that span the columns of a matrix."""
    # a matrix without entries spans nothing
    if not matrix.size:
        return np.zeros((matrix.shape[0], 0))
    u, sigma, _ = singular_decomposition(matrix)
    return u[:, : ranks.rank_of(sigma)]


def _preimage(matrix: Floats, image: Floats, ranks: _Ranks) -> Floats:
    """Orthonormal columns that span what a matrix maps into the span of orthonormal columns."""
    outside = matrix - image @ (image.T @ matrix)
    _, sigma, vt = singular_decomposition(outside)
    return np.asarray(vt[ranks.rank_of(sigma) :].T)


def _sequence(into: Floats, by: Floats, space: Floats, ranks: _Ranks) -> Floats:
    """The limit of space := into^-1(by space)."""
    # dimensions fall until they stay: at most as many times as there are rows
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
    # ranks in several units of time: the plainest counts
    found = [part for power in CLOCKS if (part := _motions(10.0**power * e, a)) is not None]
    # singular in every unit
    if not found:
        raise NoLinearisation("the equations do not determine every unknown")
    return max(found, key=lambda part: part[0])[1]


def _motions(e: Floats, a: Floats) -> tuple[float, tuple[Floats, Floats, Floats]] | None:
    """The narrowest gap of the ranks, and the spaces; None where they do not fill the whole."""
    # equilibrated and of size one, so that one threshold serves both
    row, column = factors(e, a)
    e, a = (row[:, None] * part * column for part in (e, a))
    size = max(float(np.linalg.norm(e, 2)), 1e-300), max(float(np.linalg.norm(a, 2)), 1e-300)
    e, a, ranks = e / size[0], a / size[1], _Ranks()
    # Wong sequences: v spans the motions, w what follows at once
    v = _sequence(a, e, np.eye(e.shape[0]), ranks)
    w = _sequence(e, a, null_space(e) if e.any() else np.eye(e.shape[0]), ranks)
    # the spaces do not add up: a singular pencil
    if v.shape[1] + w.shape[1] != e.shape[0] or not _regular(np.hstack([e @ v, a @ w])):
        return None
    return ranks.gap, (v, w, column)


def _regular(matrix: Floats) -> bool:
    """Of a matrix whose parts are of size one: round-off alone has no rank."""
    sigma = singular_values(matrix)
    return not sigma.size or bool(count(sigma) == sigma.size and sigma[0] > CERTAIN)


def reduce_pencil(
    matrices: tuple[Floats, ...], chosen: Choice, spaces: tuple[Floats, Floats, Floats], names: tuple[str, ...]
) -> Reduced:
    """The reduction; matrices: E, A, B, C, Cd, D of dv = C dy + Cd dy' + D du; chosen: states among the unknowns;
    spaces: of `motions`; names: of the chosen.
    """
    # back in the units of the unknowns
    e, a, b, c, cd, d = matrices
    v, w, column = spaces
    v, w = column[:, None] * v, column[:, None] * w
    # rows scaled before the inverse is taken
    row, _ = factors(np.hstack([e @ v, a @ w]))
    s = np.linalg.inv(row[:, None] * np.hstack([e @ v, a @ w])) * row
    k = v.shape[1]
    # m: the finite part, n: the nilpotent one
    m, n = (s @ a @ v)[:k], _product(s, e, w)[k:]
    b1, b2 = (s @ b)[:k], _product(s, b)[k:]
    # states are the chosen unknowns instead of directions
    turn = v[chosen]
    back = np.linalg.inv(turn)
    # x2 = follow[0] u + follow[1] u' + follow[2] u'';  x' = v x1' + w x2'
    follow = [-b2, -n @ b2, -n @ n @ b2]
    # outputs by states and by what inputs drag along
    c1, c2, c2d = c @ v + cd @ v @ m, _product(c, w), _product(cd, w)
    d0 = d + c2 @ follow[0] + cd @ v @ b1
    d1 = c2 @ follow[1] + c2d @ follow[0]
    d2 = c2 @ follow[2] + c2d @ follow[1]
    small = (_clean(part) for part in (turn @ m @ back, turn @ b1, c1 @ back, d0, d1, d2))
    return Reduced(next(small), next(small), next(small), next(small), next(small), next(small), chosen, names)


def _product(*factors: Floats) -> Floats:
    """Of matrices, without entries that are round-off of what cancels in them."""
    size = np.linalg.multi_dot([np.abs(part) for part in factors])
    return np.asarray(_clear_round_off(np.linalg.multi_dot(factors), size, 1e-13))


def _clear_round_off(found: Any, size: Any, noise: float) -> Any:
    """Zero where an entry is round-off beside the magnitudes that it is made of."""
    return np.where(np.abs(found) > noise * size, found, 0 * found)


def _rotate_bases(spaces: tuple[Floats, Floats, Floats]) -> tuple[Floats, Floats, Floats]:
    """Bases of the spaces by other columns: what is exact of them stays, round-off on the way differs."""
    # any orthogonal turn spans the same space
    random = np.random.default_rng(5)
    v, w = (part @ np.linalg.qr(random.standard_normal(2 * part.shape[1:]))[0] for part in spaces[:2])
    return v, w, spaces[2]


def surely_parted(
    matrices: tuple[Floats, ...], chosen: Choice, spaces: tuple[Floats, Floats, Floats], names: tuple[str, ...]
) -> Reduced:
    """The reduction by the spaces of `motions`; in many digits where eigenvalues in double precision are lost beside
    each other.

    Raises NoLinearisation where they are lost for good.
    """
    # once as given, once with other round-off in entries and bases
    small = reduce_pencil(matrices, chosen, spaces, names)
    e, a, *rest = matrices
    other = precise.shaken(e), precise.shaken(a)
    again = reduce_pencil((*other, *rest), chosen, _rotate_bases(spaces), names)
    values, others = (precise.eigenvalues(part.a) for part in (small, again))
    # eigenvalues agree: double precision holds them
    if precise.steady(values, others):
        return small
    # else the reduction in many digits, where that can be taken
    found = _reduce_precisely(matrices, (*other, *rest), chosen)
    if found is not None:
        return replace(found, names=names)
    # eigenvalues that move and are far from zero are refused
    precise.refuse_lost(values, others, describe_lost)
    return small


def widely_parted(matrices: tuple[Floats, ...], groups: tuple[Choice, ...], states: int) -> Reduced | None:
    """The reduction in many digits alone, states among the unknowns of the groups [k], the first group first; without
    names.

    None where it is too large, or the groups do not hold as many.  Raises NoLinearisation as above.
    """
    # too many states or rows for many digits
    if not 0 < states <= precise.MOST or matrices[0].shape[0] > WIDEST:
        return None
    with precise.digits():
        if (powers := _powers(matrices)) is None:
            return None
        # columns that span the motions; states are independent rows of them
        spanned = powers[2] @ precise.wide(np.random.default_rng(1).standard_normal((powers[2].shape[0], states)))
        chosen = precise.independent(spanned, groups)
    e, a, *rest = matrices
    return (
        _reduce_precisely(matrices, (precise.shaken(e), precise.shaken(a), *rest), chosen)
        # the groups do not hold as many states
        if chosen.size == states
        else None
    )


def _reduce_precisely(matrices: tuple[Floats, ...], other: tuple[Floats, ...], chosen: Choice) -> Reduced | None:
    """The reduction in many digits, where it can be taken; other: the matrices with their round-off changed."""
    if not 0 < chosen.size <= precise.MOST or matrices[0].shape[0] > WIDEST:
        return None
    with precise.digits():
        # with the entries as they are, and with their round-off changed
        found, beside = (_parted_widely(part, chosen) for part in (matrices, other))
        if found is None or beside is None:
            return None
        # modes that round-off moves are zero or refused
        seen = precise.settle_modes(precise.decompose(found[0]), precise.decompose(beside[0]).values, describe_lost)
        a, b, c, d, d1, d2 = (precise.narrow(part) for part in found)
        wide = Wide(found[0], found[1], found[2], found[3], Wide(beside[0], beside[1], beside[2], beside[3]))
        return Reduced(a, b, c, d, d1, d2, chosen, (), wide, seen)


def _powers(matrices: tuple[Floats, ...]) -> tuple[precise.Wide, precise.Wide, precise.Wide] | None:
    """M, N and the power of M of `_parted_widely`; None where the pencil is singular."""
    e, a, b = (precise.wide(part) for part in matrices[:3])
    column = _units(matrices)
    # (A - s E) of a point s that is no eigenvalue; a singular pencil has none
    e, a = e * column, a * column
    if (both := precise.solve(a - SHIFT * _size(matrices) * e, np.hstack([e, b]))) is None:
        return None
    m, nu = both[:, : e.shape[0]], both[:, e.shape[0] :]
    # a high power maps onto the motions alone
    power = m
    for _ in range(DOUBLINGS):
        power = power @ power
    return m, nu, power


def _units(matrices: tuple[Floats, ...]) -> Floats:
    """Of the unknowns [n]: powers of two, which change no digit."""
    return np.asarray(2.0 ** np.round(np.log2(factors(matrices[0], matrices[1])[1])), dtype=np.float64)


def _parted_widely(matrices: tuple[Floats, ...], chosen: Choice) -> tuple[precise.Wide, ...] | None:
    """a, b, c, d, d1, d2 in many digits.  With M = (A - s E)^-1 E, N = (A - s E)^-1 B at a point s that is no
    eigenvalue the motions are the image X of a power of M, what follows from inputs its null space (Drazin's inverse),

        M X = X m,  L X = 1:   z' = (1/m + s) z + 1/m L N u,   M w' = (1 + s M) w + (1 - X L) N u

    where X is 1 in the chosen places.  None where round-off hides how many motions there are.
    """
    c, cd, d = (precise.wide(part) for part in matrices[3:])
    column, shift = _units(matrices), SHIFT * _size(matrices)
    c, cd = (part * column for part in (c, cd))
    n, states = matrices[0].shape[0], chosen.size
    if (powers := _powers(matrices)) is None:
        return None
    m, nu, power = powers
    # any directions reach all motions, but for chance
    random = np.random.default_rng(1)
    spanned = power @ precise.wide(random.standard_normal((n, states)))
    seen = precise.wide(random.standard_normal((states, n))) @ power
    own = precise.wide(np.eye(states))
    # the columns with 1 in the chosen places
    if (turned := precise.solve((spanned * column[:, None])[chosen].T, spanned.T)) is None:
        return None
    x = turned.T
    # rows that are 1 on these columns and see nothing else
    if (left := precise.solve(seen @ x, seen)) is None:
        return None
    # M is singular on the motions: an eigenvalue at infinity
    if (back := precise.solve(left @ m @ x, np.hstack([own, left @ nu]))) is None:
        return None
    own, b1 = back[:, :states] + shift * own, back[:, states:]
    # the projector onto what follows inputs at once
    still = precise.wide(np.eye(n)) - x @ left
    # it has to cancel the power, else states are missing
    if np.abs(still @ power).max() > precise.ZERO * np.abs(power).max():
        return None
    nilpotent = still @ m
    # 1/(1 + s M) on the nilpotent part, a finite series
    inverse = precise.wide(np.eye(n))
    for _ in range(DEEPEST):
        inverse = precise.wide(np.eye(n)) - shift * (nilpotent @ inverse)
    # magnitudes of what cancels: what is zero but for round-off differentiates no input
    of_still = np.abs(precise.wide(np.eye(n))) + np.abs(x) @ np.abs(left)
    sizes = [np.abs(inverse) @ of_still @ np.abs(nu)]
    follow = [_clear_round_off(-(inverse @ still @ nu), sizes[0], precise.NOTHING)]
    # u' and u'': each differentiation is one more factor M
    for _ in range(2):
        sizes.append(np.abs(inverse) @ of_still @ np.abs(m) @ sizes[-1])
        follow.append(_clear_round_off(inverse @ nilpotent @ follow[-1], sizes[-1], precise.NOTHING))
    # what outputs see of it
    d0 = d + c @ follow[0] + cd @ x @ b1
    d1, d2 = (
        _clear_round_off(
            c @ follow[k] + cd @ follow[k - 1],
            np.abs(c) @ sizes[k] + np.abs(cd) @ sizes[k - 1],
            precise.NOTHING,
        )
        for k in (1, 2)
    )
    return own, b1, c @ x + cd @ x @ own, d0, d1, d2


def _size(matrices: tuple[Floats, ...]) -> float:
    """A rate among those of a pencil, 1/s."""
    e, a = (np.abs(part[part != 0.0]) for part in matrices[:2])
    return float(np.exp(np.log(a).mean() - np.log(e).mean())) if e.size and a.size else 1.0


def _clean(matrix: Floats) -> Floats:
    """Without round-off beside the largest entry of its column."""
    return np.where(np.abs(matrix) > 1e-13 * np.abs(matrix).max(axis=0, initial=0.0), matrix, 0.0)
