"""What a pencil E dy' = A dy with constant entries says of its eigenvalues without finding them.

    det(s E - A) = c_m s^m + ... + c_k s^k

has as many roots as its degree m, k of them at zero, and the product of the others is (-1)^(m - k) c_k/c_m: far out the
determinant is its first term, near zero its last one.  Taken in DIGITS no state is chosen, no small entry lost beside a
large one: a reduction that lost a mode contradicts it.  Where it moves with the round-off of the entries themselves,
these do not hold the modes: sums at a node are rounded before anything is asked of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.linear.precise import DETERMINED, Values, shaken, subtract
from sysdyn.runtime.model.description import Floats
from sysdyn.values import dataclass

LARGEST = 120
"""Unknowns up to which determinants are taken."""
DIGITS = 300
FAR = 30
"""Power of ten of the rates (1/s) at which the first and the last term stand alone."""
CANCELLED = 1e-200
"""Of the terms of a difference: it is zero.  A pencil of index 4 cancels to the fourth power of FAR."""
AGREE = tuning.UNSEEN
"""Relative difference of the products of eigenvalues."""
BEYOND, SHIFT = 3, tuning.NO_EIGENVALUE
"""Decades beyond the eigenvalues in which determinants are compared at each, and their distance farther out; of the
points, so that none is an eigenvalue."""
CONTRAST = 1e10
"""Ratio of entries from which a sum of them (the conductances at a node) loses one to round-off."""


@dataclass(frozen=True, slots=True)
class Witness:
    """Number of finite eigenvalues, of those at zero; size: natural logarithm of the product of the others, 1/s;
    loose: what of it the round-off of the entries moves, infinite where it moves the numbers.
    """

    states: int
    zeros: int
    size: float
    loose: float = 0.0

    @property
    def certain(self) -> bool:
        """Whether the entries, rounded as they are, determine the eigenvalues."""
        return self.loose <= DETERMINED

    def contradicts(self, values: Values) -> bool:
        """Whether these are not the eigenvalues."""
        moving = values[values != 0.0]
        # another number of states, or of zeros
        if values.size != self.states or values.size - moving.size != self.zeros:
            return True
        # uncertain entries allow less agreement
        close = AGREE + (10.0 * self.loose if self.certain else 0.0)
        return abs(float(np.log(np.abs(moving)).sum()) - self.size) > close


def witness(e: Floats, a: Floats) -> Witness | None:
    """None where the pencil is large or singular."""
    # beyond LARGEST elimination in many digits takes long
    if not 0 < e.shape[0] <= LARGEST:
        return None
    with mpmath.workdps(DIGITS):
        # again with other round-off: what that moves is uncertain
        one = _witness(e, a)
        other = _witness(shaken(e), shaken(a, 4)) if one is not None else None
    if one is None or other is None:
        return None
    same = (one.states, one.zeros) == (other.states, other.zeros)
    return replace(one, loose=abs(one.size - other.size) if same else np.inf)


def agrees(e: Floats, a: Floats, values: Values) -> bool:
    """Whether det(s E - A) is a constant times the product of s - values, wherever round-off of the entries leaves it
    certain, and that is so beyond the fastest and below the slowest of them that is not zero.
    """
    moving = np.abs(values[values != 0.0])
    # all at zero: no constant to compare
    if not moving.size:
        return False
    # decades between the slowest and the fastest, and beyond
    first, last = (int(np.floor(np.log10(x))) for x in (moving.min(), moving.max()))
    with mpmath.workdps(DIGITS):
        points = range(first - BEYOND, last + BEYOND + 1)
        # farther out, more sparsely: the leading and the last term
        outside = (*range(-FAR, points[0], BEYOND), *range(FAR, points[-1], -BEYOND))
        found = {s: part for s in (*points, *outside) if (part := _certain(e, a, s, values)) is not None}
    constant = list(found.values())
    # certain on both sides and for most of the points between: one constant
    outer = min(found, default=0) < first and max(found, default=0) > last + 1
    return outer and sum(s in points for s in found) > len(points) // 2 and max(constant) - min(constant) <= DETERMINED


def _certain(e: Floats, a: Floats, power: int, values: Values) -> float | None:
    """Logarithm of |det(s E - A)| less those of |s - values| near s = 10^power; None where round-off moves it."""
    s = SHIFT * mpmath.mpf(10) ** power
    # singular, or decided by round-off
    one, other = (_log_determinant(*part, s) for part in ((e, a), (shaken(e), shaken(a, 4))))
    if one is None or other is None or abs(one - other) > DETERMINED:
        return None
    return float(one - sum(mpmath.log(abs(s - mpmath.mpmathify(complex(value)))) for value in values))


def spread(e: Floats, a: Floats) -> float:
    """Largest ratio of two entries of E, or of A."""
    sizes = [np.abs(part[part != 0.0]) for part in (e, a)]
    return max((float(size.max() / size.min()) for size in sizes if size.size), default=1.0)


def _witness(e: Floats, a: Floats) -> Witness | None:
    first, last = _term(e, a, FAR), _term(e, a, -FAR)
    # singular pencils have no term
    if first is None or last is None:
        return None
    return Witness(first[0], last[0], float(last[1] - first[1]))


def _term(e: Floats, a: Floats, power: int) -> tuple[int, Any] | None:
    """Exponent of the term of the determinant that is alone at 10^power and beyond, logarithm of its coefficient."""
    # between two far points one term alone remains: their quotient tells its exponent
    near, beyond = (_log_determinant(e, a, mpmath.mpf(10) ** p) for p in (power, power + np.sign(power)))
    if near is None or beyond is None:
        return None
    exponent = (beyond - near) / (mpmath.log(10) * int(np.sign(power)))
    whole = int(mpmath.nint(exponent))
    # the exponent is a whole number, else other terms still count
    return (whole, near - whole * power * mpmath.log(10)) if abs(exponent - whole) < AGREE else None


def _log_determinant(e: Floats, a: Floats, s: Any) -> Any:
    """Logarithm of |det(s E - A)| by Gauss's elimination of the shortest row by its largest entry; None if zero."""
    places = (e != 0.0) | (a != 0.0)
    rows = {i: {int(j): s * float(e[i, j]) - float(a[i, j]) for j in np.flatnonzero(places[i])} for i in range(len(e))}
    total = mpmath.mpf(0)
    while rows:
        # the shortest row: least fill
        row = rows.pop(min(rows, key=lambda i: len(rows[i])))
        # no entry is left: singular
        if not row:
            return None
        column = max(row, key=lambda j: abs(row[j]))
        pivot = row.pop(column)
        total += mpmath.log(abs(pivot))
        for other in rows.values():
            if column in other:
                subtract(other, row, other.pop(column) / pivot, CANCELLED)
    return total
