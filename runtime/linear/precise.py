"""Eigenvalues many decades apart: the reduction and its modes in many digits, and a witness that they are needed.

A slow eigenvalue beside a fast one is a difference of large entries of A: the entries of G determine it, A in double
precision does not.  The witness: the same in double precision with each magnitude of G changed by round-off.  What
moves with it is sought again, eliminated in DIGITS; what moves even then is zero where it is round-off of the
largest, else it is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.values import dataclass

Wide = NDArray[Any]
"""An array of mpf or mpc."""
Values = NDArray[np.complex128]
DIGITS = 120
COUNTED = 1000.0
"""Integers up to which are what is counted (signs of branches, turns, teeth) and known without round-off; beyond, 1e9
N/m is a number as any other."""
NOTHING = 1e-80
"""A pivot, in DIGITS: what is below is zero."""
UNCERTAIN = tuning.PERCENT
"""Relative change with the round-off of G (ten times a true one) from which a difference is round-off."""
DEPENDENT = 1e-60
"""Of a row, in DIGITS: what is left of it is round-off."""
ZERO = 1e-40
"""An eigenvalue relative to the largest entry, in DIGITS."""
STEADY = tuning.DEPENDENT
"""Relative change with the round-off of G up to which eigenvalues in double precision are believed."""
DETERMINED = tuning.SLIGHT
"""The same of eigenvalues in DIGITS: a threefold root moves by the cube root of round-off."""
LOST, CROWDED = tuning.UNSEEN, 1e6
"""Change of an eigenvalue in double precision for which it is refused, where it stands below 1e-4 of the largest."""
ROUND_OFF = tuning.BY_FACTORS
"""Of the largest: an eigenvalue at zero that round-off may have moved; the n-th root of it where n of them are."""
CANCELS = tuning.CANCELS
"""Relative distance of a zero to a pole, the round-off of G."""
MOST = 24
"""States up to which modes are taken in DIGITS."""


@dataclass(frozen=True, slots=True)
class Decomposed:
    """Eigenvalues [n], right and left eigenvectors [n, n] (columns, rows)."""

    values: Values
    right: NDArray[np.complex128]
    left: NDArray[np.complex128]


def digits() -> Any:
    """The precision in which wide arrays are worked on, as a context."""
    return mpmath.workdps(DIGITS)


def shaken(matrix: Floats, seed: int = 3) -> Floats:
    """Each magnitude changed by a round-off of its own, small integers kept."""
    size, place = np.unique(np.abs(matrix), return_inverse=True)
    moved = size * (1.0 + 1e-15 * np.random.default_rng(seed).uniform(-1.0, 1.0, size.size))
    moved = np.where((size == np.round(size)) & (size <= COUNTED), size, moved)
    return np.copysign(moved[place].reshape(matrix.shape), matrix)


def wide(matrix: Floats) -> Wide:
    """The numbers of a matrix as mpf."""
    return np.array([mpmath.mpf(float(x)) for x in matrix.ravel()], dtype=object).reshape(matrix.shape)


def narrow(matrix: Wide) -> Floats:
    """Rounded to doubles."""
    return np.asarray(matrix.astype(np.float64))


def eliminate_consistent(matrix: Floats, aim: Wide) -> Wide | None:
    """X [n, k] of consistent equations matrix [m, n] X = aim [m, k]; None where they leave one open."""
    rows = wide(matrix)
    size = np.abs(matrix).max(axis=1, initial=0.0)
    used = size > 0.0
    return _eliminate(np.hstack([rows, aim])[used] / wide(size[used])[:, None], matrix.shape[1])


def _eliminate(full: Wide, n: int) -> Wide | None:
    """Gauss's elimination of [m, n + k]."""
    # forward elimination, by the largest entry of the column
    for k in range(n):
        place = k + int(np.argmax(np.abs(full[k:, k]))) if full.shape[0] > k else k
        # dependent columns, or fewer rows than unknowns
        if place >= full.shape[0] or abs(full[place, k]) < NOTHING:
            return None
        full[[k, place]] = full[[place, k]]
        # rows that have zero there stay as they are
        below = np.flatnonzero(full[k + 1 :, k] != 0) + k + 1
        full[below, k:] -= (full[below, k] / full[k, k])[:, None] * full[k, k:]
    found = full[:n, n:].copy()
    # back substitution
    for k in range(n - 1, -1, -1):
        found[k] = (found[k] - full[k, k + 1 : n] @ found[k + 1 :]) / full[k, k] if k + 1 < n else found[k] / full[k, k]
    return np.asarray(found)


def solve(matrix: Wide, aim: Wide) -> Wide | None:
    """X [n, k] of matrix [n, n] X = aim [n, k]; None where the matrix is singular."""
    size = [max((abs(x) for x in row), default=0) for row in matrix]
    if not all(size):
        return None
    return _eliminate(np.hstack([matrix, aim]) / np.array(size, dtype=object)[:, None], matrix.shape[1])


def free(
    matrix: Floats, again: Floats, units: NDArray[np.float64], groups: tuple[NDArray[np.int64], ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns of a matrix [m, n] that its null space leaves free, and rows that determine the others; again: with its
    round-off changed, units [n]: of the unknowns.  Of columns in no group as few are free as can be, then of each
    group, the last one's first to be free.  What the change of round-off moves in its first digits is no pivot.
    """
    # sparse rows of pairs: an entry, and the same entry with other round-off
    rows = {i: _pairs(one, other, units) for i, (one, other) in enumerate(zip(matrix, again, strict=True))}
    rest = np.setdiff1d(np.arange(matrix.shape[1]), np.concatenate(groups))
    left: list[int] = []
    used: list[int] = []
    # the columns of no group are eliminated first, and so become dependent
    for group in (rest, *groups):
        members = {int(k) for k in group}
        while (found := _largest(rows, members)) is not None:
            place, column = found
            used.append(place)
            # the row determines this column: out of all others
            pivots = rows.pop(place)
            pivot = pivots.pop(column)
            for row in rows.values():
                if column in row:
                    _subtract_pairs(row, pivots, row.pop(column), pivot)
            members.remove(column)
        # columns that no pivot was found for are free
        left += members
    return np.array(sorted(left), dtype=np.int64), np.array(sorted(used), dtype=np.int64)


Pair = tuple[Any, Any]


def _pairs(one: Floats, other: Floats, units: NDArray[np.float64]) -> dict[int, Pair]:
    """The entries of a row that are not zero, and what they are with the round-off changed."""
    pair = np.stack([one, other]) * units
    return {int(j): (mpmath.mpf(float(pair[0, j])), mpmath.mpf(float(pair[1, j]))) for j in np.flatnonzero(one)}


def _largest(rows: dict[int, dict[int, Pair]], columns: set[int]) -> tuple[int, int] | None:
    """Row and column of the entry in these columns that is largest beside the others of its row, of all rows."""
    best, found = 0.0, None
    for i, row in rows.items():
        inside = [j for j in row if j in columns]
        # the largest entry in these columns over the largest of the row
        if inside:
            column = max(inside, key=lambda j: abs(row[j][0]))
            share = float(abs(row[column][0]) / max(abs(x[0]) for x in row.values()))
            if share > best:
                best, found = share, (i, column)
    return found


def _subtract_pairs(row: dict[int, Pair], pivots: dict[int, Pair], above: Pair, pivot: Pair) -> None:
    """Row := row - above/pivot pivots, without what round-off decides."""
    # both entries of a pair are eliminated alike
    factor = above[0] / pivot[0], above[1] / pivot[1]
    none = mpmath.mpf(0), mpmath.mpf(0)
    for j, value in pivots.items():
        old = row.get(j, none)
        one, other = (old[k] - factor[k] * value[k] for k in (0, 1))
        # agrees in its first digits: a number
        if abs(one - other) < UNCERTAIN * abs(one) and abs(one) > NOTHING * abs(old[0]):
            row[j] = one, other
        # round-off alone: zero
        else:
            row.pop(j, None)


def subtract(row: dict[int, Any], pivots: dict[int, Any], factor: Any, nothing: float) -> None:
    """Row := row - factor pivots, without what cancels to this part of its terms."""
    for j, value in pivots.items():
        term = factor * value
        old = row.get(j, mpmath.mpf(0))
        new = old - term
        # cancelled to nothing
        if abs(new) > nothing * max(abs(old), abs(term)):
            row[j] = new
        else:
            row.pop(j, None)


def independent(columns: Wide, groups: tuple[NDArray[np.int64], ...]) -> NDArray[np.int64]:
    """Rows of a matrix [m, k] that are independent, as many as there are of the first group first; of a
    group the one of which most is left of its own, relative to its size; ascending within a group.
    """
    left = columns.copy()
    size = np.array([max((abs(x) for x in row), default=0) for row in left], dtype=object)
    kept: list[int] = []
    for group in groups:
        # as many from the first group as are independent
        first = len(kept)
        # rows of zeros depend on everything
        members = [int(k) for k in group if size[k] > 0]
        while members and len(kept) < left.shape[1]:
            share = [max(abs(x) for x in left[k]) / size[k] for k in members]
            # nothing independent is left in the group
            if max(share) < DEPENDENT:
                break
            row = members.pop(int(np.argmax(share)))
            column = int(np.argmax(np.abs(left[row])))
            left = left - np.outer(left[:, column], left[row] / left[row, column])
            # what is eliminated is zero to the last digit, and the column stands for this row
            left[:, column] = 0
            kept.append(row)
        kept[first:] = sorted(kept[first:])
    return np.array(kept, dtype=np.int64)


def decompose(matrix: Wide) -> Decomposed:
    """Eigenvalues and eigenvectors in DIGITS, those below ZERO of the largest entry zero."""
    with digits():
        try:
            # eigenvectors of both sides, for participation
            found, left, right = mpmath.mp.eig(mpmath.matrix(matrix.tolist()), left=True, right=True)
        except RuntimeError:  # its iteration gives up on a few matrices; what is lost in doubles is refused later
            values_, vectors = np.linalg.eig(narrow(matrix))
            return Decomposed(values_.astype(complex), vectors.astype(complex), np.linalg.pinv(vectors).astype(complex))
        # eigenvalues that are round-off of the largest entry
        largest = max((abs(x) for x in matrix.ravel()), default=mpmath.mpf(0))
        values = [_round_eigenvalue(mpmath.mpc(v)) if abs(v) > ZERO * largest else 0j for v in found]
        return Decomposed(
            np.array(values, dtype=np.complex128),
            np.array([complex(x) for x in right]).reshape(right.rows, right.cols),
            np.array([complex(x) for x in left]).reshape(left.rows, left.cols),
        )


def _round_eigenvalue(value: Any) -> complex:
    """An eigenvalue in double precision, a part that is round-off of the other zero."""
    least = ZERO * abs(value)
    return complex(*(part if abs(part) > least else 0.0 for part in (value.real, value.imag)))


def relative_distances(one: Values, other: Values) -> NDArray[np.float64]:
    """Relative distance of each value [n] to its partner in another set of as many, the largest values paired first."""
    left = list(range(other.size))
    found = np.zeros(one.size)
    # the largest first: each takes the nearest that is left
    for k in np.argsort(-np.abs(one)):
        near = min(left, key=lambda j: abs(other[j] - one[k]))
        left.remove(near)
        size = max(abs(one[k]), abs(other[near]))
        found[k] = abs(one[k] - other[near]) / size if size > 0.0 else 0.0
    return found


def steady(values: Values, again: Values) -> bool:
    """Whether eigenvalues in double precision are not lost beside each other."""
    return (
        values.size == again.size
        and bool((relative_distances(values, again) <= STEADY).all())
        and bool((values != 0).all())
    )


def refuse_lost(values: Values, again: Values, refuse: Callable[[complex], Exception]) -> None:
    """Raises refuse(value) of an eigenvalue in double precision that moves with round-off and is none."""
    # of different numbers nothing agrees
    away = relative_distances(values, again) if values.size == again.size else np.ones(values.size)
    least = 1e-10 * float(np.abs(values).max(initial=0.0))
    # neither zero, nor near the fast ones: an eigenvalue of its own, and lost
    slow = np.flatnonzero((away > LOST) & (np.abs(values) > least) & (np.abs(values) < CROWDED * least))
    if slow.size:
        raise refuse(complex(values[slow[0]]))


def settle_modes(found: Decomposed, again: Values, refuse: Callable[[complex], Exception]) -> Decomposed:
    """The modes, zero where an eigenvalue is round-off of the largest; raises refuse(value) of one that is neither."""
    # those that move with round-off
    moved = np.flatnonzero(relative_distances(found.values, again) > DETERMINED)
    values = found.values.copy()
    # k of them are zero to the k-th root of round-off (a Jordan block)
    least = ROUND_OFF ** (1.0 / max(moved.size, 1)) * float(np.abs(values).max(initial=0.0))
    for k in moved:
        # too large for a zero
        if not abs(values[k]) <= least:
            raise refuse(complex(values[k]))
        values[k] = 0.0
    return Decomposed(values, found.right, found.left)


def eigenvalues(matrix: Floats) -> Values:
    """In double precision."""
    return np.asarray(np.linalg.eigvals(matrix), dtype=np.complex128)


def rational(a: Wide, b: Wide, c: Wide, d: Any) -> tuple[Values, Values, float]:
    """Zeros, poles and leading coefficient of c (s - a)^-1 b + d, without what cancels (Leverrier and Faddeev)."""
    with digits():
        n, above, below, power = b.size, [], [mpmath.mpf(1)], wide(np.eye(b.size))
        # coefficients of the characteristic polynomial and of c adj(s - a) b
        for k in range(1, n + 1):
            above.append(c @ power @ b)
            power = a @ power
            below.append(-sum(power.diagonal()) / k)
            power = power + below[-1] * wide(np.eye(n))
        # numerator: d times the denominator, and what states add
        top = [d * x for x in below]
        top = [top[0], *(x + y for x, y in zip(top[1:], above, strict=True))]
        largest = max((abs(x) for x in top), default=mpmath.mpf(0))
        # leading coefficients that are zero: the relative degree
        while top and abs(top[0]) <= ZERO * largest:
            top = top[1:]
        if not top:
            return np.zeros(0, complex), np.zeros(0, complex), 0.0
        zeros, poles = _roots(top), _roots(below)
        # a zero at a pole cancels: what is not reachable, or not seen
        for zero in list(zeros):
            near = min(poles, key=lambda p: abs(p - zero), default=None)
            if near is not None and abs(near - zero) <= CANCELS * max(abs(near), abs(zero)):
                zeros.remove(zero)
                poles.remove(near)
        return np.array([complex(z) for z in zeros]), np.array([complex(p) for p in poles]), float(top[0])


def _roots(coefficients: list[Any]) -> list[Any]:
    """Roots of a polynomial, highest power first; zero where its last coefficients are."""
    largest = max(abs(x) for x in coefficients)
    last = len(coefficients)
    # last coefficients that are zero: roots at zero
    while last > 1 and abs(coefficients[last - 1]) <= ZERO**2 * largest:
        last -= 1
    none = [mpmath.mpf(0)] * (len(coefficients) - last)
    kept = coefficients[:last]
    return none + (list(mpmath.polyroots(kept, maxsteps=400, extraprec=400)) if last > 1 else [])
