"""Eigenvalues with damping, frequency and participation; poles, zeros and gain of transfer functions.

Participation (Perez-Arriaga, Verghese and Schweppe 1982): of state k in mode i |w_ki v_ik| with left and right
eigenvectors, normed to a sum of one.

Zeros of c (s - a)^-1 b + d: of d != 0 the eigenvalues of a - b c/d.  Else, with relative degree r (c a^(r-1) b the
first Markov parameter m that is not zero), the motion that keeps the output at zero stays in the null space of
[c; c a; ...; c a^(r-1)] and obeys a - b c a^r / m there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.linear import precise
from sysdyn.runtime.linear.precise import Decomposed
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import count, singular_decomposition, singular_values
from sysdyn.values import dataclass

Complexes = NDArray[np.complex128]
VANISHING = tuning.DEPENDENT
"""A Markov parameter below this part of its factors' size is zero."""
FAINT = 1e-24
"""The same beside the largest of its factors: a product of two round-offs."""
FAR = 1e6
"""Of the fastest pole: a zero beyond that moves with round-off has no place."""
APART = 1e3
"""Ratio of the largest to the smallest eigenvalue from which the small ones are taken of the inverse."""
DEFECTIVE = 1e11
"""Condition of the eigenvectors from which they count as dependent: participation is then by right vectors alone."""


@dataclass(frozen=True, slots=True)
class Eigenmode:
    """An eigenvalue (1/s): frequency |s| (rad/s), damping ratio -Re s/|s| (None at zero), participation [states];
    shape [states]: what moves, the largest one.
    """

    eigenvalue: complex
    frequency: float
    damping: float | None
    participation: Floats
    shape: Complexes


@dataclass(frozen=True, slots=True)
class Transfer:
    """gain prod(s - zeros)/prod(s - poles); static: its value at s = 0 (None: infinite); improper: direct slopes by the
    first and second rate of the input.
    """

    output: int
    input: int
    poles: Complexes
    zeros: Complexes
    gain: float
    static: float | None
    improper: tuple[float, float]


def balance_matrix(a: Floats) -> tuple[Floats, Floats]:
    """D^-1 a D with rows and columns of like size, and the diagonal of D (powers of two)."""
    from scipy.linalg import matrix_balance

    # LAPACK refuses an empty matrix
    if not a.size:
        return a, np.ones(0)
    found, (scale, _) = matrix_balance(a, permute=False, separate=True)
    return np.asarray(found), np.asarray(scale)


def modes(a: Floats, precisely: Decomposed | None = None) -> tuple[Eigenmode, ...]:
    """The modes of x' = a x, by rising real part, then imaginary part; precisely: of a in many digits."""
    if not a.size:
        return ()
    # many digits: eigenvectors of both sides are known
    if precisely is not None:
        share = np.abs(precisely.right * precisely.left.T)
        total = share.sum(axis=0)
        return _sort_modes(precisely.values, share / np.where(total > 0.0, total, 1.0), precisely.right)
    inner, scale = balance_matrix(a)
    values, right = np.linalg.eig(inner)
    # small eigenvalues beside large ones lose digits: mended, or zero
    values = _resolve_eigenvalues(_sharpen_small(values, inner), inner)
    share = np.abs(right) ** 2
    # a defective matrix has no left vectors: the share is that of the right ones
    if np.linalg.cond(right) < DEFECTIVE:
        share = np.abs(right * np.linalg.inv(right).T)
    return _sort_modes(values, share / share.sum(axis=0), scale[:, None] * right)


def _sort_modes(values: Complexes, share: Floats, right: Complexes) -> tuple[Eigenmode, ...]:
    order = sorted(range(values.size), key=lambda k: (round(float(values[k].real), 12), float(values[k].imag)))
    return tuple(_mode(complex(values[k]), share[:, k], right[:, k]) for k in order)


def _sharpen_small(values: Complexes, a: Floats) -> Complexes:
    """Eigenvalues whose round-off is that of the largest: small ones from the inverse, where that is to be trusted."""
    size = np.abs(values)
    # close together, or singular: what stands is as good
    if values.size < 2 or not size.max() > APART * size.min() or not regular(a):
        return values
    inverse = np.linalg.eigvals(np.linalg.inv(a))
    # the inverse says nothing
    if not np.abs(inverse).min() > 0.0 or not size.min() > 0.0:
        return values
    other = 1.0 / inverse
    # matched in order of their sizes, the small ones from the inverse
    one, two = (_by_size(v.astype(complex)) for v in (values, other))
    found = values.astype(complex)
    small = size[one] < np.sqrt(size.max() * max(size.min(), 1e-300))
    near = np.abs(other[two] - values[one]) <= 1e-3 * size.max() * APART**-1
    found[one] = np.where(small & near, other[two], values[one])
    return found


def _by_size(values: Complexes) -> NDArray[np.intp]:
    """Places by rising size, of pairs the lower half plane first."""
    size = np.abs(values)
    return np.lexsort((np.sign(np.round(values.imag / size, 9)), np.round(np.log(size), 6)))


def _resolve_eigenvalues(values: Complexes, a: Floats) -> Complexes:
    """Eigenvalues of a balanced matrix, zero where they are below what its round-off leaves open."""
    least = 4.0 * a.shape[0] * np.finfo(float).eps * float(np.abs(a).sum(axis=0).max(initial=0.0))
    return np.where(np.abs(values) > least, values, 0.0)


def _mode(value: complex, share: Floats, right: Complexes) -> Eigenmode:
    # the shape in units of its largest component
    size = abs(value)
    largest = right[int(np.argmax(np.abs(right)))]
    shape = np.asarray(right / largest if largest != 0.0 else right, dtype=np.complex128)
    return Eigenmode(value, size, 0.0 - value.real / size if size > 0.0 else None, share, shape)


def store_shares(modes_: Sequence[Eigenmode], content: Floats, conjugate: Floats) -> Floats:
    """Shares [modes, stores] of each mode's energy: |Re(content* conjugate)| of q, e or p, f [stores, states], normed.

    Of an oscillation twice the mean over a period, of a decay the energy itself, relative to the whole.
    """
    shapes = np.array([m.shape for m in modes_], dtype=complex).reshape(len(modes_), content.shape[1])
    energy = np.abs(((shapes @ content.T).conj() * (shapes @ conjugate.T)).real)
    total = energy.sum(axis=1, keepdims=True)
    return np.asarray(energy / np.where(total > 0.0, total, 1.0))


def transfer(
    a: Floats, b: Floats, c: Floats, d: float, place: tuple[int, int], improper: tuple[float, float]
) -> Transfer:
    """One output by one input; b, c [states]; place: output, input; improper: slopes by the input's rates."""
    # balanced, then cut to what the input reaches and the output sees (Kalman)
    inner, scale = balance_matrix(a)
    first = _first_markov(inner, b / scale, c * scale)
    inner, b, c = reachable_part(inner, b / scale, c * scale)
    inner, c, b = reachable_part(inner.T, c, b)
    inner = inner.T
    zeros, gain = _zeros(inner, b, c, d, first)
    zeros = _at_origin(inner, b, c, d, zeros)
    # poles of what is left; zeros at the origin are known exactly
    poles = np.linalg.eigvals(inner).astype(complex) if inner.size else np.zeros(0, complex)
    poles = _resolve_eigenvalues(_sharpen_small(poles, inner), inner)
    poles, zeros = (values[np.lexsort((values.imag, values.real))] for values in (poles, zeros))
    return Transfer(*place, poles, zeros, gain, _static(poles, zeros, gain), improper)


def wide_transfer(
    one: Sequence[precise.Wide], other: Sequence[precise.Wide], place: tuple[int, int], improper: tuple[float, float]
) -> Transfer:
    """Zeros, poles and gain of one output by one input, of a, b [states], c [states], d in many digits; other: with the
    round-off of the rows changed. Roots that move with it are at zero where they are small, and at infinity where they
    are large.

    Roots that move with it are at zero where they are small, and at infinity where they are large.
    """
    zeros, poles, gain = precise.rational(*one)
    zeros2, poles2, _ = precise.rational(*other)
    fastest = float(np.abs(poles).max(initial=0.0))
    # the same number of zeros in both: those that move with round-off are none
    if zeros.size == zeros2.size:
        loose = precise.relative_distances(zeros, zeros2) > precise.DETERMINED
        # beyond all poles: at infinity, and a factor of the gain
        far = loose & (np.abs(zeros) > FAR * fastest)
        zeros, gain = np.where(loose & ~far, 0.0, zeros)[~far], gain * float(np.prod(-zeros[far]).real)
    # poles that move with round-off are at zero
    if poles.size == poles2.size:
        poles = np.where(precise.relative_distances(poles, poles2) > precise.DETERMINED, 0.0, poles)
    poles, zeros = (values[np.lexsort((values.imag, values.real))] for values in (poles, zeros))
    return Transfer(*place, poles, zeros, gain, _static(poles, zeros, gain), improper)


def reachable_part(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats, Floats]:
    """a, b, c on the states that b reaches (Arnoldi's process, orthogonalised twice)."""
    size = float(np.linalg.norm(a, 2)) if a.size else 0.0
    basis: list[Floats] = []
    # each direction is what a makes of the last, orthogonal to all so far
    following, least = b, 0.0
    while len(basis) < b.size:
        # twice is enough (Kahan)
        for _ in range(2):
            for q in basis:
                following = following - (q @ following) * q
        norm = float(np.linalg.norm(following))
        # nothing is left but round-off: the space is closed
        if norm <= least:
            break
        basis.append(following / norm)
        following, least = a @ basis[-1], VANISHING * size
    q = np.array(basis).reshape(len(basis), b.size)
    return q @ a @ q.T, q @ b, q @ c


def _first_markov(a: Floats, b: Floats, c: Floats) -> tuple[int, float] | None:
    """r, c a^r b: the first Markov parameter that is not zero; None where nothing passes.

    In the coordinates of the model, where zeros are zeros: those of `reachable_part` mix them with round-off.
    """
    row, size = c, np.abs(c)
    # c a^r b for r = 0, 1, ...: the first that is neither zero nor the difference of large terms
    for r in range(b.size):
        markov = float(row @ b)
        faint = FAINT * float(np.abs(row).max() * np.abs(b).max())
        if abs(markov) > max(VANISHING * float(size @ np.abs(b)), faint):
            return r, markov
        row, size = row @ a, size @ np.abs(a)
    return None


def _zeros(a: Floats, b: Floats, c: Floats, d: float, first: tuple[int, float] | None) -> tuple[Complexes, float]:
    """Zeros and leading coefficient; none and 0 where nothing passes; first: of `_first_markov`."""
    # no states: the direct part alone
    if not b.size:
        return np.zeros(0, complex), d
    # a direct part: zeros of the inverse system
    if d != 0.0:
        return np.linalg.eigvals(a - np.outer(b, c) / d).astype(complex), d
    if first is None or first[0] >= b.size:
        return np.zeros(0, complex), 0.0
    # relative degree r + 1: rows c a^k that vanish along zero dynamics
    kept = [c]
    for _ in range(first[0]):
        kept.append(kept[-1] @ a)
    return _kept_at_zero(a, b, np.array(kept), first[1]), first[1]


def _kept_at_zero(a: Floats, b: Floats, kept: Floats, markov: float) -> Complexes:
    """Eigenvalues of the motion that keeps the output at zero; kept [r, n]: c, c a, ..., c a^(r-1)."""
    size = np.linalg.norm(kept, axis=1)
    # the null space of c, c a, ..., in which the motion stays
    _, _, vt = singular_decomposition(kept / size[:, None])
    basis = vt[len(kept) :].T
    # the output fixes all states: no zeros
    if not basis.size:
        return np.zeros(0, complex)
    inner = a - np.outer(b, kept[-1] @ a) / markov
    return np.linalg.eigvals(basis.T @ inner @ basis).astype(complex)


def _at_origin(a: Floats, b: Floats, c: Floats, d: float, zeros: Complexes) -> Complexes:
    """The zeros, those at s = 0 exactly: as many as moments d - c a^-1 b, -c a^-2 b, ... vanish."""
    # without zeros, or with poles at the origin, moments do not exist
    if not zeros.size or not regular(a):
        return zeros
    inverse = np.linalg.inv(a)
    size, number = np.abs(c), 0
    row, direct = c @ inverse, d
    # each moment that vanishes is one more zero at the origin
    while number < zeros.size:
        size = size @ np.abs(inverse)
        moment = direct - float(row @ b)
        if abs(moment) > VANISHING * (abs(direct) + float(size @ np.abs(b))):
            break
        row, direct, number = row @ inverse, 0.0, number + 1
    found = zeros.copy()
    # as many of the smallest zeros
    found[np.argsort(np.abs(zeros))[:number]] = 0.0
    return found


def regular(a: Floats) -> bool:
    """Whether a square matrix has an inverse to be trusted."""
    row, column = factors(a)
    sigma = singular_values(row[:, None] * a * column)
    return count(sigma) == sigma.size


def _static(poles: Complexes, zeros: Complexes, gain: float) -> float | None:
    """The value at s = 0."""
    below = np.prod(-poles)
    return float((gain * np.prod(-zeros) / below).real) + 0.0 if below != 0.0 else None
